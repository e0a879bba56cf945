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


@kernel(fastmath=_FAST, error_model="numpy")
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


@kernel(fastmath=_FAST, error_model="numpy")
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


@kernel(fastmath=_FAST, error_model="numpy")
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


@kernel(fastmath=_FAST, error_model="numpy")
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


@kernel(fastmath=_FAST, error_model="numpy")
def _kinds(spans, stretch):
    """A number for every panel, the same for those that follow one another and are the same."""
    kinds = np.zeros(spans.shape[0], dtype=np.int64)
    for p in range(1, spans.shape[0]):
        kinds[p] = kinds[p - 1] + (1 if stretch[p] != stretch[p - 1] else 0)
        for j in range(spans.shape[1]):
            if kinds[p] == kinds[p - 1] and abs(spans[p, j] - spans[p - 1, j]) > 1e-12 * spans[p, j]:
                kinds[p] = kinds[p - 1] + 1
    return kinds


@kernel(fastmath=_FAST, error_model="numpy")
def structure(spans, stretch, forms):
    """What blocks make of initial states and forces on panels with dt/ds = spans (P, m).

    stretch (P,): which of the forms (`blocks.Forms`) each panel has; S states. Returns which kind each panel is, (P,),
    a panel like the one before being of the same kind, and for each kind

    - moved (D, blocks, 2, 2): exp(L t) over the panel
    - reading (D, 2, G m, S): q and q' at the nodes from initial states
    - influence (D, 2, G m, G m): the same from forces at the nodes
    - entering (D, S, G m): final states from forces at the nodes.
    """
    motion, first, driven, read = forms.motion, forms.first, forms.driven, forms.read
    kinds = _kinds(spans, stretch)
    size, groups = driven.shape[1:]
    m, most, count = ORDER, motion.shape[1], kinds[-1] + 1
    moved, reading = np.zeros((count, most, 2, 2)), np.empty((count, 2, groups * m, size))
    influence, entering = np.empty((count, 2, groups * m, groups * m)), np.empty((count, size, groups * m))
    times, left, rate = np.empty(m - 1), np.empty((m - 1, _POINTS)), np.empty((m - 1, _POINTS))
    e, w, sums = np.zeros((2, m)), np.zeros((2 * most, m * m)), np.zeros((2 * groups * groups, m * m))
    turned, e[0, 0] = np.empty(2), 1.0
    for p in range(spans.shape[0]):
        d, r = kinds[p], stretch[p]
        if p > 0 and d == kinds[p - 1]:
            continue
        uniform = _times(spans[p], times, left, rate)
        for b in range(most):
            s, wide, v = first[r, b], first[r, b + 1] - first[r, b], w[2 * b : 2 * b + 2]
            if wide == 0:
                # behind the last block
                for l in range(m * m):
                    v[0, l] = v[1, l] = 0.0
                continue
            # one number counts as a double one
            mean = 0.5 * (motion[r, b, 0, 0] + motion[r, b, wide - 1, wide - 1])
            half = 0.5 * (motion[r, b, 0, 0] - motion[r, b, wide - 1, wide - 1])
            square = half * half + motion[r, b, 0, 1] * motion[r, b, 1, 0]
            if uniform:
                _uniform(2.0 * spans[p, 0], mean, square, e, v)
            else:
                _integrals(times, left, rate, mean, square, e, v)
            for i in range(wide):
                for k in range(wide):
                    moved[d, b, i, k] = e[1, m - 1] * motion[r, b, i, k] + (e[0, m - 1] if i == k else 0.0)
                for g in range(groups):
                    turned[0] = turned[1] = 0.0
                    for k in range(wide):
                        turned[0] += motion[r, b, i, k] * driven[r, s + k, g]
                    for j in range(m):
                        l = (m - 1) * m + j
                        entering[d, s + i, g * m + j] = v[0, l] * driven[r, s + i, g] + v[1, l] * turned[0]
                    for part in range(2):
                        turned[1] = 0.0
                        for k in range(wide):
                            turned[1] += read[r, part, g, s + k] * motion[r, b, k, i]
                        for j in range(m):
                            reading[d, part, g * m + j, s + i] = e[0, j] * read[r, part, g, s + i] + e[1, j] * turned[1]
        if groups > 0 and most > 0:
            np.dot(forms.coupling[r], w, sums)
        for part in range(2):
            for g in range(groups):
                for h in range(groups):
                    for j in range(m):
                        for l in range(m):
                            value = sums[(part * groups + g) * groups + h, j * m + l]
                            influence[d, part, g * m + j, h * m + l] = value
                        if part == 0:
                            influence[d, 0, g * m + j, h * m + j] += forms.flexible[r, g, h]
    return kinds, moved, reading, influence, entering
