"""Compiled searches along a motion: its local extrema, and which of them pass a level between two neighbours.

Arrays in, arrays out, as in `kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.instants import _jet
from suboctave.harmonic.kernels import motion


@kernel()
def _turn(c, lo, hi, rises, first):
    """The extremum in (lo, hi), before which the motion rises or falls: tau, value, second derivative."""
    t = first
    x = s = 0.0
    for _ in range(60):
        x, d, s = _jet(c, math.cos(t), math.sin(t))
        if (d > 0.0) == rises:
            lo = t
        else:
            hi = t
        new = t - d / s if s != 0.0 else 0.5 * (lo + hi)
        if not (lo <= new <= hi):
            new = 0.5 * (lo + hi)
        # an error e of the instant is one of s e^2 / 2 in the value
        done = abs(new - t) < 1e-9
        t = new
        if done:
            break
    # the sign that alternates, where rounding hides it
    return t, x, -abs(s) if rises else abs(s)


@kernel()
def extrema(c, zr, zi):
    """Local extrema of `Re sum_k c_k exp(i k tau)` over a period: tau, value, second derivative, (3, m); ascending in
    tau.

    Brackets of the derivative's zeros on the uniform grid z, then safeguarded Newton. A pair hidden between two samples
    is looked for where the cubic through them nearly turns. Maxima and minima alternate, so that their number is even.
    """
    n = zr.shape[0]
    h = 2.0 * math.pi / n
    values = motion(c, zr, zi)
    found = np.empty((3, 2 * n))
    tau, value, curve = found[0], found[1], found[2]
    count = 0
    for j in range(n):
        d0 = values[1, j]
        d1 = values[1, (j + 1) % n]
        lo = j * h
        hi = lo + h
        if (d0 > 0.0) != (d1 > 0.0):
            tau[count], value[count], curve[count] = _turn(c, lo, hi, d0 > 0.0, lo + h * d0 / (d0 - d1))
            count += 1
            continue
        # slope of the cubic: d0 + b s + a s^2, s in (0, 1)
        mean = (values[0, (j + 1) % n] - values[0, j]) / h
        a = 3.0 * (d0 + d1 - 2.0 * mean)
        b = 2.0 * (3.0 * mean - 2.0 * d0 - d1)
        if not (a * d0 > 0.0 and 0.0 < -b / a < 2.0) or abs(d0) - b * b / (4.0 * abs(a)) > 0.5 * min(abs(d0), abs(d1)):
            continue
        middle = lo - 0.5 * h * b / a
        _, d, s = _jet(c, math.cos(middle), math.sin(middle))
        new = middle - 0.5 * h * h * s / a
        if lo < new < hi:
            middle = new
            _, d, s = _jet(c, math.cos(middle), math.sin(middle))
        if d * d0 < 0.0:
            for first, last, rises in ((lo, middle, d0 > 0.0), (middle, hi, d0 <= 0.0)):
                tau[count], value[count], curve[count] = _turn(c, first, last, rises, 0.5 * (first + last))
                count += 1
    return found[:, :count].copy()


@kernel()
def _level_count(x, level):
    """How often the motion crosses a level, from its extrema."""
    crossed = 0
    for i in range(x.shape[0]):
        if (x[i] > level) != (x[(i + 1) % x.shape[0]] > level):
            crossed += 1
    return crossed


@kernel()
def _smoothed(x, wanted):
    """Indices of `wanted` extrema: neighbouring pairs are dropped, the least different first, ripples that have just
    come or are about to go.
    """
    m = x.shape[0]
    index = np.empty(m, dtype=np.int64)
    for i in range(m):
        index[i] = i
    while m > wanted:
        best = 0
        least = np.inf
        for i in range(m):
            difference = abs(x[index[i]] - x[index[(i + 1) % m]])
            if difference < least:
                least = difference
                best = i
        other = (best + 1) % m
        kept = 0
        for i in range(m):
            if i != best and i != other:
                index[kept] = index[i]
                kept += 1
        m = kept
    return index


@kernel()
def pass_by(ta, xa, sa, level_a, tb, xb, sb, level_b):
    """Whether `passages` finds anything: extrema that pass a level, or a level crossed more or less often."""
    _, count, crossed_a, crossed_b = passages(ta, xa, sa, level_a, tb, xb, sb, level_b)
    return count > 0 or crossed_a != crossed_b


@kernel()
def passages(ta, xa, sa, level_a, tb, xb, sb, level_b):
    """Extrema that pass a level between two neighbouring motions a and b (instants t, values x, curvatures s).

    Extrema are paired in their cyclic order, so that two that pass at once in opposite senses are both seen. Returns
    pairs of indices, shape (m, 2), the number m of them that count, and how often each motion crosses its level. If the
    crossings differ by other than what the pairs explain, extrema have come or gone as well.
    """
    crossed_a = _level_count(xa, level_a)
    crossed_b = _level_count(xb, level_b)
    wanted = min(xa.shape[0], xb.shape[0])
    found = np.empty((wanted, 2), dtype=np.int64)
    count = 0
    if wanted == 0:
        return found, count, crossed_a, crossed_b
    ia = _smoothed(xa, wanted)
    ib = _smoothed(xb, wanted)
    # maxima to maxima
    first = 0 if (sa[ia[0]] < 0.0) == (sb[ib[0]] < 0.0) else 1
    best = first
    least = np.inf
    for shift in range(first, wanted, 2):
        total = 0.0
        for i in range(wanted):
            way = abs(ta[ia[i]] - tb[ib[(i + shift) % wanted]])
            total += min(way, 2.0 * math.pi - way)
        if total < least:
            least = total
            best = shift
    for i in range(wanted):
        p = ia[i]
        q = ib[(i + best) % wanted]
        if (xa[p] > level_a) != (xb[q] > level_b):
            found[count, 0] = p
            found[count, 1] = q
            count += 1
    return found, count, crossed_a, crossed_b
