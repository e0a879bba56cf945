"""The time mesh of the linearised motion: panels of Lobatto nodes that follow the laws along a motion.

A period is cut into panels on which everything is smooth: at the instants where the motion crosses the gap of a
piecewise-linear law (there the stiffness jumps), and towards the passages of a sharp law. A law with singularities at
`u = point +- i width` has, along the motion, singularities at complex instants `s +- i d`; near them panels are equal
in v, with `tau = s + d sinh(v)`, in which they lie at `+- i pi / 2` whatever the sharpness is. Elsewhere panels are
equal in tau and as long as the motion's harmonics allow; `resolution` makes them as short as the structure needs.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.aft.closed_form import add_step, add_values
from suboctave.harmonic.basis import Array
from suboctave.harmonic.trigonometric import crossings_of, displacement, extrema, jet

#: nodes per panel, both ends among them: quadrature of order 12
ORDER = 7
#: longest panels in v, next to a singularity and further away: with them products of multipliers are good for 1e-10
_NEAR, _FAR = 1.5, 2.25
#: how close to a singularity panels are as long as elsewhere, in units of their length
_CLEAR = 0.25
#: most panels that are graded towards one instant
_GRADED = 64
#: longest panel in tau: phase of the highest harmonic of the tangent, and of the highest harmonic of the motion
_TANGENT, _MOTION = 7.0, 5.5
#: harmonics of less than this share of the largest do not count for the former
_RELEVANT = 1e-3
#: extrema that miss a gap by less than this share of the motion are events: the true motion may touch it
_MISS = 1e-3


def _lobatto() -> Array:
    """Nodes on [-1, 1]: the ends and the extrema of the Legendre polynomial of degree ORDER - 1."""
    first = np.polynomial.legendre.Legendre.basis(ORDER - 1).deriv()
    inner = np.sort(first.roots().real)
    for _ in range(3):
        inner -= first(inner) / first.deriv()(inner)
    return np.concatenate(([-1.0], inner, [1.0]))


def _integration() -> Array:
    """From values at the nodes to the integrals of their polynomial from -1 to each node, (ORDER, ORDER)."""
    powers = np.vander(NODES, increasing=True)
    integrals = np.array([(NODES ** (i + 1) - (-1.0) ** (i + 1)) / (i + 1) for i in range(ORDER)]).T
    return np.linalg.solve(powers.T, integrals.T).T.copy()


def _highest() -> Array:
    """Of the two highest Legendre components of a polynomial, from its values at the nodes to its share of each, and
    their values at the nodes, (2, 2, ORDER).
    """
    legendre = np.polynomial.legendre.legvander(NODES, ORDER - 1)
    return np.ascontiguousarray(np.stack((np.linalg.inv(legendre)[-2:], legendre.T[-2:]), axis=1))


NODES = _lobatto()
INTEGRATION = _integration()
#: a panel's quadrature weights
WEIGHTS = INTEGRATION[-1].copy()
HIGHEST = _highest()


@kernel()
def events_along(c, pieces, owner, passages, zr, zi):
    """What happens along a motion, in any order: rows (tau, depth, du/dtau, d2u/dtau2, miss, piece).

    A crossing of the gap of a piece has infinite depth; an extremum that falls short of it has the distance `miss`. A
    passage of a sharp law has the distance of its complex singularity for depth, and -1 for piece.

    c (G, H + 1): the motion along all directions; pieces (Q, 3), owner (Q,): stiffness, gap, side of each, and its
    direction; passages (2, K): instants and depths; zr, zi: a uniform grid on the circle.
    """
    rows = np.empty((2 * zr.shape[0] * pieces.shape[0] + passages.shape[1], 6))
    count = 0
    turns, size = np.empty((3, 0)), 0.0
    for q in range(pieces.shape[0]):
        g, gap = owner[q], pieces[q, 1]
        if q == 0 or g != owner[q - 1]:
            turns = extrema(c[g], zr, zi)
            highest, lowest = -np.inf, np.inf
            for j in range(turns.shape[1]):
                highest, lowest = max(highest, turns[1, j]), min(lowest, turns[1, j])
            size = highest - lowest if turns.shape[1] > 0 else 0.0
        at, _above = crossings_of(c[g], gap, turns)
        for tau in at:
            _x, d, s = jet(c[g], math.cos(tau), math.sin(tau))
            rows[count, 0], rows[count, 1], rows[count, 2] = tau, np.inf, d
            rows[count, 3], rows[count, 4], rows[count, 5] = s, 0.0, q
            count += 1
        for j in range(turns.shape[1]):
            # an extremum towards the gap that falls short of it
            miss, s = turns[1, j] - gap, turns[2, j]
            if abs(miss) < _MISS * size and (miss > 0.0) == (s > 0.0) and s != 0.0:
                rows[count, 0], rows[count, 1], rows[count, 2] = turns[0, j], np.inf, 0.0
                rows[count, 3], rows[count, 4], rows[count, 5] = s, miss, q
                count += 1
    for i in range(passages.shape[1]):
        rows[count, 0], rows[count, 1], rows[count, 2] = passages[0, i], passages[1, i], 0.0
        rows[count, 3], rows[count, 4], rows[count, 5] = 0.0, 0.0, -1.0
        count += 1
    return rows[:count]


@kernel()
def panels_between(events, longest):
    """Panels from the first event over one period, rows (from, to, centre, depth), and where each event's begin.

    With depth 0, from and to are instants, else values of v. longest: of the others, in tau.
    """
    n = events.shape[0]
    start = np.zeros(n, dtype=np.int64)
    depth = np.full(max(n, 1), np.inf)
    for i in range(n):
        # to the nearest complex singularity, the event's own or another's
        for j in range(n):
            apart = abs(events[i, 0] - events[j, 0])
            depth[i] = min(depth[i], math.hypot(min(apart, 2.0 * math.pi - apart), events[j, 1]))
    out = np.empty((int(2.0 * math.pi / longest) + (2 * _GRADED + 4) * (n + 1), 4))
    count = 0
    reach = np.zeros(2)
    for i in range(max(n, 1)):
        follow = i + 1 if i + 1 < n else 0
        low, high = 0.0, 2.0 * math.pi
        if n > 0:
            start[i] = count
            low = events[i, 0]
            high = events[follow, 0] + (0.0 if follow > i else 2.0 * math.pi)
        gap = high - low
        if gap <= 1e-14:
            continue
        # graded panels reach from either end to where the others may begin
        reach[0] = _CLEAR * longest if depth[i] < longest else 0.0
        reach[1] = _CLEAR * longest if depth[follow] < longest else 0.0
        if reach[0] + reach[1] > gap:
            short = 0 if reach[0] < 0.5 * gap else 1
            reach[1 - short] = gap - reach[short] if reach[short] < 0.5 * gap else 0.5 * gap
            reach[short] = gap - reach[1 - short]
        rest = gap - reach[0] - reach[1]
        if rest < 0.05 * longest and rest < gap:
            # not worth a panel of its own
            reach[0 if reach[0] > reach[1] else 1] += rest
            rest = 0.0
        for side in range(2):
            if side == 1 and rest > 0.0:
                parts = max(1, math.ceil(rest / longest - 1e-9))
                for p in range(parts):
                    out[count, 0] = low + reach[0] + rest * (p / parts)
                    out[count, 1] = low + reach[0] + rest * ((p + 1) / parts)
                    out[count, 2] = out[count, 3] = 0.0
                    count += 1
            if reach[side] <= 0.0:
                continue
            d = depth[follow if side else i]
            v = math.asinh(reach[side] / d)
            parts = min(_GRADED, max(1, 1 + math.ceil((v - _NEAR) / _FAR - 1e-9)))
            whole = _NEAR + (parts - 1) * _FAR
            for p in range(parts):
                # from the singularity outwards, or inwards to it
                q = p if side == 0 else parts - 1 - p
                inner = v * ((_NEAR + (q - 1) * _FAR) / whole) if q > 0 else 0.0
                outer = v * ((_NEAR + q * _FAR) / whole)
                out[count, 0] = inner if side == 0 else -outer
                out[count, 1] = outer if side == 0 else -inner
                out[count, 2] = high if side else low
                out[count, 3] = d
                count += 1
    for i in range(n):
        if start[i] >= count > 0:
            # an event without a panel of its own at the period's end
            start[i] -= count
    return out[:count].copy(), start


@kernel()
def longest_panel(c, degree):
    """Longest panel in tau for a tangent that is a polynomial of this degree in the motion c (G, H + 1)."""
    top = 0
    for g in range(c.shape[0]):
        size = 0.0
        for k in range(c.shape[1]):
            size = max(size, abs(c[g, k]))
        for k in range(top + 1, c.shape[1]):
            if abs(c[g, k]) > _RELEVANT * size:
                top = k
    # quarters of a period at most: the least that a polynomial of degree six follows
    return min(_TANGENT / max(1, degree * top), _MOTION / (c.shape[1] - 1), 1.6)


@kernel()
def along_panels(panels, c, forces, rate, pieces, owner, polynomial, steps, step_owner, line, spans, path, law, base):
    """Motion and laws at the nodes of panels; node j of panel p is node `p (m - 1) + j` of the period, N in all.

    panels: see `panels_between`; c (G, H + 1), forces (G, top + 1): displacement along the directions, and Fourier
    coefficients of the force there; pieces, owner: see `events_along`; polynomial (G, D); steps (S, 3),
    step_owner (S,), line (G, 2): of arctan steps gap, width, stiffness, direction, and constant and slope of the laws
    that they belong to. Into arrays, the last two of which are zero:

    - spans: dt/ds on every panel, s in [-1, 1], (P, m)
    - path: u, du/dt at the nodes, (G, 2, N)
    - law: force beyond the basis, stiffness, damping at the nodes, and the part of the stiffness due to steps,
      (G, 4, N); the stiffness without that of the pieces
    - base: stiffness of the pieces on every panel, (G, P).
    """
    groups = c.shape[0]
    count = panels.shape[0]
    m = ORDER
    total = count * (m - 1) + 1
    cos = np.empty(total)
    sin = np.empty(total)
    for p in range(count):
        half = 0.5 * (panels[p, 1] - panels[p, 0])
        depth = panels[p, 3]
        for j in range(m):
            tau = 0.5 * (panels[p, 0] + panels[p, 1]) + half * NODES[j]
            spans[p, j] = half / rate
            if depth > 0.0:
                e = math.exp(tau)
                tau = panels[p, 2] + 0.5 * depth * (e - 1.0 / e)
                spans[p, j] = 0.5 * depth * (e + 1.0 / e) * half / rate
            cos[p * (m - 1) + j] = math.cos(tau)
            sin[p * (m - 1) + j] = math.sin(tau)
    within = np.empty(c.shape[1], dtype=np.complex128)
    for g in range(groups):
        for k in range(c.shape[1]):
            within[k] = (-2.0 if k > 0 else -1.0) * forces[g, k]
        displacement(c[g], cos, sin, path[g])
        displacement(within, cos, sin, law[g, :1])
        for j in range(total):
            path[g, 1, j] *= rate
        add_values(polynomial[g], path[g, 0], law[g, 0], law[g, 1])
        for j in range(total):
            law[g, 0, j] += line[g, 0] + line[g, 1] * path[g, 0, j]
            law[g, 3, j] = line[g, 1]
    for s in range(steps.shape[0]):
        g = step_owner[s]
        add_step(path[g, 0], steps[s, 0], steps[s, 1], steps[s, 2] / math.pi, law[g, 0], law[g, 3])
    for g in range(groups):
        for j in range(total):
            law[g, 1, j] += law[g, 3, j]
    for q in range(pieces.shape[0]):
        g = owner[q]
        k, gap, right = pieces[q, 0], pieces[q, 1], pieces[q, 2] > 0.0
        u = path[g, 0]
        for p in range(count):
            if (u[p * (m - 1) + m // 2] > gap) == right:
                base[g, p] += k
        for j in range(total):
            if (u[j] > gap) == right:
                law[g, 0, j] += k * (u[j] - gap)


@kernel()
def changed_laws(path, law, change, rate, pieces, owner, polynomial, steps, step_owner, events, start, out, kick):
    """The laws known in closed form along the motion changed by `change` (G, 2, N).

    path, law: see `along_panels`. Into `out` (G, 3, N), zeros: no force, stiffness, damping at the old nodes,
    polynomials as they are there, steps to first order (panels are graded towards the old passages; where the change
    exceeds a step's width, the new ones lie between the nodes, and the linear form has the right integral all the
    same). Into `kick` (G, P), zeros: the impulses `-kick y` at the beginnings of the panels that stand for the movement
    of the contacts: a crossing moves by `t = -d / u'` (a root of the parabola where the motion grazes), and a slice of
    stiffness k that is as thin is an impulse k t.
    """
    groups, _, total = path.shape
    moved = np.empty(total)
    for g in range(groups):
        for j in range(total):
            out[g, 1, j], moved[j] = law[g, 3, j], path[g, 0, j] + change[g, 0, j]
        add_values(polynomial[g], moved, out[g, 0], out[g, 1])
    for s in range(steps.shape[0]):
        g = step_owner[s]
        point, width, k = steps[s, 0], steps[s, 1], steps[s, 2] / math.pi
        for j in range(total):
            ratio = (path[g, 0, j] - point) / width
            out[g, 1, j] += k / (width * (1.0 + ratio * ratio)) * change[g, 0, j]
    m = (total - 1) // kick.shape[1]
    for i in range(events.shape[0]):
        q = int(events[i, 5])
        if q < 0:
            continue
        g = owner[q]
        k, right = pieces[q, 0], pieces[q, 2] > 0.0
        p = start[i]
        d = change[g, 0, p * m]
        bend = rate * rate * events[i, 3]
        if events[i, 2] == 0.0:
            # an extremum that missed the gap: carried across, it is in contact (or out of it) for a while
            reached = events[i, 4] + d
            square = -2.0 * reached / bend
            if square > 0.0 and (reached > 0.0) != (events[i, 4] > 0.0):
                time = 2.0 * math.sqrt(square)
                kick[g, p] += k * time if (reached > 0.0) == right else -k * time
            continue
        slope = rate * events[i, 2] + change[g, 1, p * m]
        square = slope * slope - 2.0 * bend * d
        if square > 0.0:
            shift = -2.0 * d / (slope + math.copysign(math.sqrt(square), slope))
        else:
            # contact lost, or never: up to the extremum
            shift = -slope / bend
        # a contact that begins later is missing for a while
        kick[g, p] += -k * shift if (events[i, 2] > 0.0) == right else k * shift
