"""Where the linearised motion is looked at: panels of Lobatto nodes that follow the laws along a motion.

A period is cut into panels on which everything is smooth: at the instants where the motion crosses the gap of a
piecewise-linear law (there the stiffness jumps), and towards the passages of a sharp law. A law with singularities at
`u = point +- i width` has, along the motion, singularities at complex instants `s +- i d`; near them panels are equal
in v, with `tau = s + d sinh(v)`, in which they lie at `+- i pi / 2` whatever the sharpness is (as in
`harmonic.sharp_nodes`). Elsewhere panels are equal in tau and as long as the motion's harmonics allow.

Every element is asked once for all nodes; what needs more is interpolated by the polynomials through a panel's nodes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from suboctave.compiled import QUICK, kernel
from suboctave.harmonic.arctangent import add_step
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.kernels import displacement, slope
from suboctave.stability.passages import depths, events_along, grown

#: longest panels in v, next to a singularity and further away: with them the rule is good for 1e-7 of the part of the
#: period that it covers
_NEAR, _FAR = 3.0, 4.5
#: how close to a singularity panels are as long as elsewhere, in units of their length
_CLEAR = 0.25
#: longest panel in tau: phase of the highest harmonic of the tangent, and of the highest harmonic of the motion
_TANGENT, _MOTION = 7.0, 5.5
#: harmonics of less than this share of the largest do not count for the former
_RELEVANT = 1e-3


@kernel()
def _panels(events, longest):
    """Panels from the first event over one period, rows (from, to, centre, depth), and where each event's begin.

    With depth 0, from and to are instants, else values of v.
    """
    n = events.shape[0]
    depth = depths(events)
    start = np.zeros(n, dtype=np.int64)
    out = np.empty((64, 4))
    count = 0
    reach = np.zeros(2)
    deep = np.zeros(2)
    for i in range(max(n, 1)):
        low = events[i, 0] if n > 0 else 0.0
        high = low + 2.0 * math.pi
        reach[0] = reach[1] = deep[0] = deep[1] = 0.0
        if n > 0:
            start[i] = count
            follow = i + 1 if i + 1 < n else 0
            high = events[follow, 0] + (0.0 if follow > i else 2.0 * math.pi)
            deep[0] = depth[i]
            deep[1] = depth[follow]
            # graded panels reach from either end to where the others may begin
            for side in range(2):
                if deep[side] < longest:
                    reach[side] = _CLEAR * longest
        gap = high - low
        if gap <= 1e-14:
            continue
        if reach[0] + reach[1] > gap:
            if reach[0] < 0.5 * gap:
                reach[1] = gap - reach[0]
            elif reach[1] < 0.5 * gap:
                reach[0] = gap - reach[1]
            else:
                reach[0] = reach[1] = 0.5 * gap
        rest = gap - reach[0] - reach[1]
        if rest < 0.05 * longest and rest < gap:
            # not worth a panel of its own
            reach[0 if reach[0] > reach[1] else 1] += rest
            rest = 0.0
        v = 0.0
        for part in range(3):
            # graded from the left, plain, graded to the right
            if part == 1:
                length = rest
                centre = d = 0.0
                first = low + reach[0]
                last = high - reach[1]
                pieces = math.ceil(length / longest - 1e-9)
            else:
                side = 0 if part == 0 else 1
                length = reach[side]
                centre = low if part == 0 else high
                d = deep[side]
                v = math.asinh(length / d) if length > 0.0 else 0.0
                pieces = 1 + math.ceil((v - _NEAR) / _FAR - 1e-9)
                first = 0.0 if part == 0 else -v
                last = -first
            if length <= 0.0:
                continue
            pieces = max(1, pieces)
            while count + pieces > out.shape[0]:
                out = grown(out)
            for p in range(pieces):
                # from the left end of what is covered, or from the singularity outwards
                begin, end = p / pieces, (p + 1) / pieces
                if part == 0:
                    whole = _NEAR + (pieces - 1) * _FAR
                    begin = (_NEAR + (p - 1) * _FAR) / whole if p > 0 else 0.0
                    end = (_NEAR + p * _FAR) / whole
                elif part == 2:
                    whole = _NEAR + (pieces - 1) * _FAR
                    begin = p * _FAR / whole
                    end = (p + 1) * _FAR / whole if p < pieces - 1 else 1.0
                span = last - first if part == 1 else v
                out[count, 0] = first + span * begin
                out[count, 1] = first + span * end
                out[count, 2] = centre
                out[count, 3] = d
                count += 1
    for i in range(n):
        if start[i] >= count > 0:
            # an event without a panel of its own at the period's end
            start[i] -= count
    return out[:count], start


@kernel(patience=QUICK)
def _series(c, f, zr, zi, scale, u, v, r):
    """`u = Re sum c_k z^k`, `v = scale du/dtau` and `r = -Re(f_0 + 2 sum f_k z^k)` at the points z; (N,) each."""
    displacement(c, zr, zi, u)
    displacement(slope(c, scale), zr, zi, v)
    within = np.empty_like(c)
    for k in range(c.shape[0]):
        within[k] = complex(-2.0 * f[k].real, -2.0 * f[k].imag)
    within[0] = complex(-f[0].real, 0.0)
    displacement(within, zr, zi, r)


@kernel()
def longest_panel(c, degree):
    """Longest panel in tau for a tangent that is a polynomial of this degree in the motion."""
    top = 1
    for g in range(c.shape[0]):
        largest = 0.0
        for k in range(c.shape[1]):
            largest = max(largest, abs(c[g, k]))
        for k in range(c.shape[1] - 1, top, -1):
            if abs(c[g, k]) > _RELEVANT * largest:
                top = k
                break
    # quarters of a period at most: the least that a polynomial of degree six follows
    return min(_TANGENT / max(1, degree * top), _MOTION / (c.shape[1] - 1), 1.6)


def lay_out(
    c: ComplexArray,
    f: ComplexArray,
    rate: float,
    pieces: Array,
    owner: NDArray[np.int64],
    polynomial: Array,
    steps: Array,
    step_owner: NDArray[np.int64],
    line: Array,
    passed: Array,
    longest: float,
    zr: Array,
    zi: Array,
    nodes: Array,
) -> tuple[Array, Array, Array, Array, Array, NDArray[np.int64]]:
    """Panels along a motion, the motion at their nodes, and the laws that are known in closed form.

    Parameters
    ----------
    c, f
        Displacement along the G directions: amplitudes (G, H + 1); Fourier coefficients of the force (G, > H).
    rate
        Base frequency.
    pieces
        Stiffness, gap, side of the pieces of piecewise-linear laws (Q, 3), direction by direction; `owner` (Q,): which.
    polynomial
        Coefficients of u^0, u^1, ... along every direction (G, D).
    steps, line
        Gap, width, stiffness of arctan steps (S, 3), direction by direction (`step_owner`, (S,)); constant and slope of
        the laws that they belong to (G, 2).
    passed
        Passages of sharp laws, steps among them: instants and distances of their complex singularities, (2, K).
    longest
        Upper bound of the panels' lengths.
    zr, zi
        Uniform grid on the circle, for searches.
    nodes
        `NODES`.

    Returns
    -------
    stretch
        dtau/ds on every panel, s in [-1, 1]; (P, m). Node i of panel p is node `p (m - 1) + i` of the period.
    path
        u, du/dt at the nodes, (G, 2, N), N = P (m - 1) + 1.
    law
        Force less its harmonics within the basis, stiffness, damping at the nodes, and the part of the stiffness due to
        steps, (G, 4, N); the stiffness without that of the pieces.
    base
        Stiffness of the pieces on every panel, (G, P).
    events, start
        See `passages.events_along`; the panel that begins at each.
    """
    events = events_along(c, pieces, owner, passed, zr, zi)
    panels, start = _panels(events, longest)
    stretch, path, law, base = _filled(c, f, rate, pieces, owner, polynomial, steps, step_owner, line, panels, nodes)
    return stretch, path, law, base, events, start


@kernel()
def _filled(c, f, rate, pieces, owner, polynomial, steps, step_owner, line, panels, nodes):
    """The results of `lay_out` at the nodes of its panels."""
    groups = c.shape[0]
    count = panels.shape[0]
    m = nodes.shape[0]
    total = count * (m - 1) + 1
    tau = np.empty(total)
    stretch = np.empty((count, m))
    for p in range(count):
        middle = 0.5 * (panels[p, 0] + panels[p, 1])
        half = 0.5 * (panels[p, 1] - panels[p, 0])
        depth = panels[p, 3]
        at = p * (m - 1)
        for j in range(m):
            v = middle + half * nodes[j]
            if depth == 0.0:
                tau[at + j] = v
                stretch[p, j] = half
            else:
                e = math.exp(v)
                tau[at + j] = panels[p, 2] + 0.5 * depth * (e - 1.0 / e)
                stretch[p, j] = 0.5 * depth * (e + 1.0 / e) * half
    path = np.empty((groups, 2, total))
    law = np.zeros((groups, 4, total))
    base = np.zeros((groups, count))
    cos = np.empty(total)
    sin = np.empty(total)
    for j in range(total):
        cos[j] = math.cos(tau[j])
        sin[j] = math.sin(tau[j])
    for g in range(groups):
        _series(c[g], f[g], cos, sin, rate, path[g, 0], path[g, 1], law[g, 0])
        add_polynomial(polynomial[g], path[g, 0], law[g, 0], law[g, 1])
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
    return stretch, path, law, base


@kernel()
def add_polynomial(coefficients, u, force, stiffness):
    """Add `sum c_p u^p` and its derivative to force and stiffness (N,), in place."""
    degree = coefficients.shape[0] - 1
    if degree < 0:
        return
    for j in range(u.shape[0]):
        f = slope = 0.0
        for p in range(degree, -1, -1):
            slope = slope * u[j] + f
            f = f * u[j] + coefficients[p]
        force[j] += f
        stiffness[j] += slope


@kernel()
def closed_changes(path, law, change, rate, pieces, owner, polynomial, steps, step_owner, events, start, panels):
    """The laws known in closed form along the motion changed by `change` (G, 2, N).

    path, law: see `lay_out`. Returns stiffness and damping at the old nodes (G, 2, N), polynomials as they are there,
    steps to first order (panels are graded towards the old passages; where the change exceeds a step's width, the new
    ones lie between the nodes, and the linear form has the right integral all the same), and the impulses `-kick y` at
    the beginnings of the panels (G, P) that stand for the movement of the contacts: a crossing moves by `t = -d / u'`
    (a root of the parabola where the motion grazes), and a slice of stiffness k that is as thin is an impulse k t.
    """
    groups, _, total = path.shape
    out = np.zeros((groups, 2, total))
    kick = np.zeros((groups, panels))
    idle = np.zeros(total)
    moved = np.empty(total)
    for g in range(groups):
        for j in range(total):
            moved[j] = path[g, 0, j] + change[g, 0, j]
            out[g, 0, j] = law[g, 3, j]
        add_polynomial(polynomial[g], moved, idle, out[g, 0])
    for s in range(steps.shape[0]):
        g = step_owner[s]
        point, width, k = steps[s, 0], steps[s, 1], steps[s, 2] / math.pi
        for j in range(total):
            ratio = (path[g, 0, j] - point) / width
            out[g, 0, j] += k / (width * (1.0 + ratio * ratio)) * change[g, 0, j]
    m = (total - 1) // panels
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
    return out, kick
