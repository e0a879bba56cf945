"""What blocks of the linear part make of initial states and of forces on a panel, exactly.

See `propagate` for the formulas: exponentials of blocks in closed form, and their integrals with Lagrange's polynomials
by Gauss's formula between neighbouring nodes, which holds on panels of any mapping. On those that are uniform in time
they follow from the phi functions of exponential integrators (Hochbruck & Ostermann, Acta Numerica 19 (2010) 209-286),

    int_0^t exp(L (t - s)) s^k ds = k! t^(k+1) phi_(k+1)(L t),    phi_k(z) = 1/k! + z phi_(k+1)(z),    phi_0 = exp,

however fast a block is.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.time_mesh import NODES, ORDER

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
#: points of Gauss's formula between neighbouring nodes
_POINTS = 8
#: phase of a block over a panel to which that serves
TURNS = 24.0
#: moduli from which phi functions follow from those before, and terms of the series of the last of them below
_UPWARDS, _TERMS = 3.0, 20


def _between() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For Gauss's points between every two neighbouring nodes, from values at the nodes: values there, integrals from
    there to the right node, (m - 1, points, m) each, and over the whole interval, (m - 1, m); the weights.
    """
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    left, right = NODES[:-1, None], NODES[1:, None]
    points = 0.5 * (left + right) + 0.5 * (right - left) * x
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(NODES, ORDER - 1))
    integral = np.array([np.polynomial.legendre.legint(row) for row in np.eye(ORDER)])
    over = np.polynomial.legendre.legvander(NODES, ORDER) @ integral.T @ inverse
    until = over[1:, None, :] - np.polynomial.legendre.legvander(points, ORDER) @ integral.T @ inverse
    values = np.polynomial.legendre.legvander(points, ORDER - 1) @ inverse
    return np.ascontiguousarray(values), np.ascontiguousarray(until), over[1:] - over[:-1], 0.5 * (right - left) * w


def _powers() -> np.ndarray:
    """What Lagrange's polynomials are made of up to every node, in units of `t phi_(k+1)`, (m, k, m)."""
    lagrange = np.linalg.inv(np.vander(0.5 * (NODES + 1.0), increasing=True))
    k = np.arange(ORDER)
    factorials = np.array([math.factorial(i) for i in k], dtype=float)
    scale = factorials * np.power.outer(0.5 * (NODES + 1.0), k)
    return np.ascontiguousarray(scale[:, :, None] * lagrange)


_VALUES, _UNTIL, _WHOLE, _WEIGHTS = _between()
_POWERS = _powers()
_FACTORIALS = np.array([1.0 / math.factorial(i) for i in range(ORDER + _TERMS + 1)])


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def exponential(mean, square, t):
    """e_0, e_1 with `exp(L t) = e_0 + e_1 L` for a matrix whose eigenvalues are `mean +- sqrt(square)`."""
    if square < 0.0:
        turn = math.sqrt(-square)
        size = math.exp(mean * t)
        odd = size * (math.sin(turn * t) / turn if turn * t > 1e-6 else t)
        return size * math.cos(turn * t) - mean * odd, odd
    root = math.sqrt(square)
    low, high = math.exp((mean - root) * t), math.exp((mean + root) * t)
    odd = 0.5 * (high - low) / root if root * t > 1e-3 else low * t * (1.0 + root * t * (1.0 + root * t * (2.0 / 3.0)))
    return 0.5 * (low + high) - mean * odd, odd


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _uniform(length, mean, square, e, w):
    """`_integrals` on a panel of this length that is uniform in time."""
    m = ORDER
    phi = np.empty((2, m + 1))
    for j in range(1, m):
        t = 0.5 * (NODES[j] + 1.0) * length
        e[0, j], e[1, j] = exponential(mean, square, t)
        # in z = L t, with z^2 = trace z + minus
        trace, minus = 2.0 * mean * t, (square - mean * mean) * t * t
        if abs(minus) > _UPWARDS * _UPWARDS:
            phi[0, 0], phi[1, 0] = e[0, j], e[1, j] / t
            for k in range(m):
                x, y = phi[0, k] - _FACTORIALS[k], phi[1, k]
                phi[0, k + 1], phi[1, k + 1] = y - x * trace / minus, x / minus
        else:
            x, y = _FACTORIALS[m + _TERMS], 0.0
            for n in range(m + _TERMS - 1, 0, -1):
                x, y = _FACTORIALS[n] + minus * y, x + trace * y
                if n <= m:
                    phi[0, n], phi[1, n] = x, y
        for l in range(m):
            x = y = 0.0
            for k in range(m):
                x += phi[0, k + 1] * _POWERS[j, k, l]
                y += phi[1, k + 1] * _POWERS[j, k, l]
            w[0, j * m + l], w[1, j * m + l] = t * x, t * t * y


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _integrals(times, left, rate, mean, square, e, w):
    """e_0, e_1 at the nodes into e (2, m), and w_0, w_1 into w (2, m m), on one panel, but for those at the first node;
    mean, square: see `exponential`.

    times (m - 1,): between the nodes; left, rate (m - 1, points): time from Gauss's points to the next node, and dt/ds
    there times their weight.
    """
    m = ORDER
    trace, minus = 2.0 * mean, square - mean * mean
    for i in range(m - 1):
        old, new = i * m, (i + 1) * m
        x, y = exponential(mean, square, times[i])
        # (x + y L) (u + v L) with L^2 = trace L + minus
        e[0, i + 1] = x * e[0, i] + minus * y * e[1, i]
        e[1, i + 1] = x * e[1, i] + y * e[0, i] + trace * y * e[1, i]
        for l in range(m):
            w[0, new + l] = x * w[0, old + l] + minus * y * w[1, old + l]
            w[1, new + l] = x * w[1, old + l] + y * w[0, old + l] + trace * y * w[1, old + l]
        for g in range(_POINTS):
            x, y = exponential(mean, square, left[i, g])
            x *= rate[i, g]
            y *= rate[i, g]
            for l in range(m):
                w[0, new + l] += x * _VALUES[i, g, l]
                w[1, new + l] += y * _VALUES[i, g, l]


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _times(span, times, left, rate):
    """What `_integrals` wants of a panel with dt/ds = span (m,); returns whether it is uniform in time."""
    uniform = True
    for i in range(ORDER - 1):
        uniform = uniform and abs(span[i + 1] - span[0]) <= 1e-12 * span[0]
        times[i] = 0.0
        for l in range(ORDER):
            times[i] += _WHOLE[i, l] * span[l]
        for g in range(_POINTS):
            left[i, g] = rate[i, g] = 0.0
            for l in range(ORDER):
                left[i, g] += _UNTIL[i, g, l] * span[l]
                rate[i, g] += _VALUES[i, g, l] * span[l] * _WEIGHTS[i, g]
    return uniform


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _kinds(spans, stretch):
    """A number for every panel, the same for those of one stretch that are the same, and the first of every kind."""
    kinds, first = np.empty((2, spans.shape[0]), dtype=np.int64)
    count = begin = 0
    for p in range(spans.shape[0]):
        if p == 0 or stretch[p] != stretch[p - 1]:
            begin = count
        kinds[p] = count
        for d in range(begin, count):
            same = True
            for j in range(spans.shape[1]):
                same = same and abs(spans[p, j] - spans[first[d], j]) <= 1e-12 * spans[p, j]
            if same:
                kinds[p] = d
                break
        if kinds[p] == count:
            first[count], count = p, count + 1
    return kinds, first[:count]


@kernel(fastmath=_FAST, error_model="numpy")
def structure(spans, stretch, forms):
    """What blocks make of initial states and forces on panels with dt/ds = spans (P, m).

    stretch (P,): which of the forms (`blocks.Forms`) each panel has; S states. Returns which kind each panel is, (P,),
    those of one stretch that are the same being of the same kind, and for each kind

    - moved (D, blocks, 2, 2): exp(L t) over the panel
    - e (D, blocks, 2, m): e_0, e_1 at the nodes
    - w (D, 2 blocks, m m): w_0, w_1 of every block, from each of the nodes to all of them
    - made (D, G): of which channels the rest is known, see `act`
    - reading (D, 2, G m, S): q and q' at the nodes from initial states
    - influence (D, 2, G m, G m): the same from forces at the nodes
    - entering (D, S, G m): final states from forces at the nodes.
    """
    motion, first = forms.motion, forms.first
    kinds, panel = _kinds(spans, stretch)
    size, groups = forms.driven.shape[1:]
    m, most, count = ORDER, motion.shape[1], panel.shape[0]
    moved, e, w = np.zeros((count, most, 2, 2)), np.zeros((count, most, 2, m)), np.zeros((count, 2 * most, m * m))
    times, left, rate = np.empty(m - 1), np.empty((m - 1, _POINTS)), np.empty((m - 1, _POINTS))
    to = np.zeros((2, m * m))
    for d in range(count):
        p, r = panel[d], stretch[panel[d]]
        uniform = _times(spans[p], times, left, rate)
        for b in range(most):
            wide = first[r, b + 1] - first[r, b]
            if wide == 0:
                break  # behind the last block
            # one number counts as a double one
            mean = 0.5 * (motion[r, b, 0, 0] + motion[r, b, wide - 1, wide - 1])
            half = 0.5 * (motion[r, b, 0, 0] - motion[r, b, wide - 1, wide - 1])
            square = half * half + motion[r, b, 0, 1] * motion[r, b, 1, 0]
            e[d, b, 0, 0] = 1.0
            if uniform:
                _uniform(2.0 * spans[p, 0], mean, square, e[d, b], to)
            else:
                _integrals(times, left, rate, mean, square, e[d, b], to)
            for j in range(m):
                for l in range(m):
                    w[d, 2 * b, l * m + j], w[d, 2 * b + 1, l * m + j] = to[0, j * m + l], to[1, j * m + l]
            for i in range(wide):
                for k in range(wide):
                    moved[d, b, i, k] = e[d, b, 1, m - 1] * motion[r, b, i, k] + (e[d, b, 0, m - 1] if i == k else 0.0)
    made, nodes = np.zeros((count, groups), dtype=np.int64), groups * m
    reading, influence = np.empty((count, 2, nodes, size)), np.empty((count, 2, nodes, nodes))
    return kinds, moved, e, w, made, reading, influence, np.empty((count, size, nodes))


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def act(structures, d, forms, r, acts, moving):
    """Know of a kind of panels d with the form r what the channels that act, (G,), make of one another, without q' if
    none of them has damping.
    """
    _kinds, _moved, e, w, made, reading, influence, entering = structures
    m, groups, parts = ORDER, acts.shape[0], 2 if moving else 1
    motion, first, driven, read = forms.motion[r], forms.first[r], forms.driven[r], forms.read[r]
    channels, count = np.empty(groups, dtype=np.int64), 0
    for g in range(groups):
        made[d, g] = parts if acts[g] else 0
        if acts[g]:
            channels[count], count = g, count + 1
    for b in range(motion.shape[0]):
        s, wide = first[b], first[b + 1] - first[b]
        for i in range(wide):
            for n in range(count):
                g, turned = channels[n], 0.0
                for k in range(wide):
                    turned += motion[b, i, k] * driven[s + k, g]
                for l in range(m):
                    at = l * m + m - 1
                    entering[d, s + i, g * m + l] = w[d, 2 * b, at] * driven[s + i, g] + w[d, 2 * b + 1, at] * turned
                for part in range(parts):
                    turned = 0.0
                    for k in range(wide):
                        turned += read[part, g, s + k] * motion[b, k, i]
                    for j in range(m):
                        value = e[d, b, 0, j] * read[part, g, s + i] + e[d, b, 1, j] * turned
                        reading[d, part, g * m + j, s + i] = value
    pairs, sums = np.empty((count, w.shape[1])), np.zeros((count, m * m))
    for part in range(parts):
        for n in range(count):
            g = channels[n]
            for i in range(count):
                for b in range(w.shape[1]):
                    pairs[i, b] = forms.coupling[r, (part * groups + g) * groups + channels[i], b]
            if w.shape[1] > 0:
                np.dot(pairs, w[d], sums)
            for i in range(count):
                h = channels[i]
                for j in range(m):
                    for l in range(m):
                        influence[d, part, g * m + j, h * m + l] = sums[i, l * m + j]
                    if part == 0:
                        influence[d, 0, g * m + j, h * m + j] += forms.flexible[r, g, h]


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def along(e, w, motion, first, driven, force, start, since, states):
    """The states (m, S) at the nodes of a panel, from the node `since` on, from those at its beginning, `start` (S, 1),
    and forces at the nodes (G m,); e, w: see `structure`, of one kind.
    """
    m, groups = ORDER, driven.shape[1]
    own, ends = np.zeros((2, m)), np.empty((2, m))
    for b in range(motion.shape[0]):
        s, wide = first[b], first[b + 1] - first[b]
        if wide == 0:
            break  # behind the last block
        for i in range(wide):
            for l in range(m):
                own[i, l] = 0.0
            for g in range(groups):
                for l in range(m):
                    own[i, l] += driven[s + i, g] * force[g * m + l]
        here, other = start[s, 0], start[s + 1, 0] if wide == 2 else 0.0
        a, back, across, c = motion[b, 0, 0], motion[b, 0, 1], motion[b, 1, 0], motion[b, 1, 1]
        if wide == 1:
            # one state alone: nothing of a second
            back = across = 0.0
            for l in range(m):
                own[1, l] = 0.0
        for j in range(since, m):
            ends[0, j] = e[b, 0, j] * here + e[b, 1, j] * (a * here + back * other)
            ends[1, j] = e[b, 0, j] * other + e[b, 1, j] * (across * here + c * other)
        for l in range(m):
            x, y = own[0, l], own[1, l]
            u, v = a * x + back * y, across * x + c * y
            for j in range(since, m):
                even, odd = w[2 * b, l * m + j], w[2 * b + 1, l * m + j]
                ends[0, j] += even * x + odd * u
                ends[1, j] += even * y + odd * v
        for i in range(wide):
            for j in range(since, m):
                states[j, s + i] = ends[i, j]
