"""Compiled searches along a motion: where a gap is crossed, where a sharp law is passed, where the motion peaks.

Arrays in, arrays out, as in `kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import QUICK, kernel
from suboctave.harmonic.kernels import motion


@kernel(patience=QUICK)
def _jet(c, zr, zi):
    """Value, first and second derivative of `Re sum_k c_k z^k` with respect to tau at one point."""
    pr = pi = dr = di = sr = 0.0
    si = 0.0
    for k in range(c.shape[0] - 1, -1, -1):
        a = c[k].real
        b = c[k].imag
        t = pr * zr - pi * zi + a
        pi = pr * zi + pi * zr + b
        pr = t
        t = dr * zr - di * zi + k * a
        di = dr * zi + di * zr + k * b
        dr = t
        t = sr * zr - si * zi + k * k * a
        si = sr * zi + si * zr + k * k * b
        sr = t
    return pr, -di, -sr


@kernel()
def _refine(c, lo, hi, flo, level):
    """A root of the motion minus `level` in the bracket (lo, hi), by Newton's method kept inside the bracket."""
    tau = 0.5 * (lo + hi)
    last = hi - lo
    for _ in range(100):
        x, d, _s = _jet(c, math.cos(tau), math.sin(tau))
        f = x - level
        if f == 0.0:
            return tau
        if (f > 0.0) == (flo > 0.0):
            lo = tau
        else:
            hi = tau
        new = tau - f / d if d != 0.0 else np.inf
        if not (lo < new < hi):
            # a step out of the bracket that rounding alone explains: the root is here
            if abs(new - tau) < 1e-14 * max(1.0, abs(tau)) or hi - lo < 4e-16 * max(1.0, abs(tau)):
                return tau
            new = 0.5 * (lo + hi)
        step = abs(new - tau)
        # converging quadratically: the step after one of 1e-8 is below rounding
        if step < 1e-15 * max(1.0, abs(tau)) or (step < 1e-8 and step < 1e-4 * last):
            x, d, _s = _jet(c, math.cos(new), math.sin(new))
            if d != 0.0 and abs(x - level) < abs(d) * 1e-12:
                new -= (x - level) / d
            return new
        last = step
        tau = new
    return tau


@kernel()
def _search(c, level, lo, hi, f0, d0, f1, d1, found, count):
    """Append the crossings of `level` in (lo, hi), an interval with one extremum at most; returns the new count.

    f, d: the motion minus level and its derivative at both ends.
    """
    if (f0 > 0.0) != (f1 > 0.0):
        found[count] = _refine(c, lo, hi, f0, level)
        return count + 1
    if not ((f0 > 0.0 and d0 < 0.0 and d1 > 0.0) or (f0 <= 0.0 and d0 > 0.0 and d1 < 0.0)):
        return count
    # an extremum towards the level lies in between: does it reach across?
    if min(abs(f0), abs(f1)) > (hi - lo) * (abs(d0) + abs(d1)):
        return count
    first, last = lo, hi
    tau = lo + (hi - lo) * d0 / (d0 - d1)
    for _ in range(60):
        x, d, s = _jet(c, math.cos(tau), math.sin(tau))
        if (x - level > 0.0) != (f0 > 0.0):
            break
        if (d > 0.0) == (d0 > 0.0):
            lo = tau
        else:
            hi = tau
        new = tau - d / s if s != 0.0 else 0.5 * (lo + hi)
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
        if abs(new - tau) < 1e-14:
            break
        tau = new
    x, d, s = _jet(c, math.cos(tau), math.sin(tau))
    if (x - level > 0.0) != (f0 > 0.0):
        found[count] = _refine(c, first, tau, f0, level)
        found[count + 1] = _refine(c, tau, last, x - level, level)
        count += 2
    return count


@kernel()
def crossings(c, level, zr, zi):
    """Instants in [0, 2 pi) at which the motion crosses `level`, ascending, and whether it lies above before the first.

    Sampled on the uniform grid z; a pair hidden between two samples is looked for at every extremum near the level
    (whose parabola comes within half its own rise of it), and two extrema between two samples where the cubic through
    them slows down. Exact up to rounding.
    """
    return crossings_of(c, level, motion(c, zr, zi))


@kernel()
def crossings_of(c, level, values):
    """`crossings`, from value and derivative of the motion (2, N) on a uniform grid that starts at tau = 0."""
    n = values.shape[1]
    h = 2.0 * math.pi / n
    found = np.empty(4 * n)
    # not a literal, for which the search would be compiled twice
    count = np.int64(0)
    for j in range(n):
        f0 = values[0, j] - level
        f1 = values[0, (j + 1) % n] - level
        d0 = values[1, j]
        d1 = values[1, (j + 1) % n]
        near = min(abs(f0), abs(f1)) <= h * (abs(d0) + abs(d1))
        if d0 * d1 > 0.0 and near:
            # slope of the cubic: d0 + b s + a s^2, s in (0, 1)
            mean = (f1 - f0) / h
            a = 3.0 * (d0 + d1 - 2.0 * mean)
            b = 2.0 * (3.0 * mean - 2.0 * d0 - d1)
            # its extremum towards zero lies inside, and is less than half of the lesser slope at the ends
            if a * d0 > 0.0 and 0.0 < -b / a < 2.0 and abs(d0) - b * b / (4.0 * abs(a)) < 0.5 * min(abs(d0), abs(d1)):
                lo, hi = j * h, (j + 1) * h
                tau = lo - 0.5 * h * b / a
                x, d, s = _jet(c, math.cos(tau), math.sin(tau))
                new = tau - 0.5 * h * h * s / a
                if lo < new < hi:
                    tau = new
                    x, d, s = _jet(c, math.cos(tau), math.sin(tau))
                if d * d0 < 0.0:
                    count = _search(c, level, lo, tau, f0, d0, x - level, d, found, count)
                    count = _search(c, level, tau, hi, x - level, d, f1, d1, found, count)
                    continue
        if (f0 > 0.0) != (f1 > 0.0) or (near and d0 * d1 < 0.0):
            count = _search(c, level, j * h, (j + 1) * h, f0, d0, f1, d1, found, count)
    return found[:count], values[0, 0] - level > 0.0


@kernel()
def peak(c, samples):
    """Largest modulus of `Re sum_k c_k exp(i k tau)` over a period and where: (max |x|, tau, x there).

    Every sample interval that may hold an extremum large enough is searched by Newton's method on the derivative.
    """
    n = samples
    h = 2.0 * math.pi / n
    zr, zi = np.empty(n), np.empty(n)
    for j in range(n):
        zr[j], zi[j] = math.cos(j * h), math.sin(j * h)
    values = motion(c, zr, zi)
    x, d = values[0], values[1]
    best = -1.0
    for j in range(n):
        if abs(x[j]) > best:
            best = abs(x[j])
            where = j * h
            value = x[j]
    floor = best
    for j in range(n):
        m = (j + 1) % n
        if (d[j] > 0.0) == (d[m] > 0.0):
            continue
        # within the interval x rises at most by h |d| above its ends
        if max(abs(x[j]), abs(x[m])) + h * (abs(d[j]) + abs(d[m])) < floor:
            continue
        lo = j * h
        hi = (j + 1) * h
        sign = d[j] > 0.0
        tau = lo + h * d[j] / (d[j] - d[m])
        for _ in range(60):
            v, g, b = _jet(c, math.cos(tau), math.sin(tau))
            if (g > 0.0) == sign:
                lo = tau
            else:
                hi = tau
            new = tau - g / b if b != 0.0 else 0.5 * (lo + hi)
            if not (lo <= new <= hi):
                new = 0.5 * (lo + hi)
            done = abs(new - tau) < 1e-13
            tau = new
            if done:
                break
        v, g, b = _jet(c, math.cos(tau), math.sin(tau))
        if abs(v) > best:
            best = abs(v)
            where = tau
            value = v
    return best, where, value
