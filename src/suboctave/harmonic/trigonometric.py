"""Motions as trigonometric polynomials: values, Fourier coefficients, crossings of a level, extrema.

A motion along one direction is `u(tau) = Re sum_k c_k exp(i k tau)`, k = 0 .. H. Points on the unit circle are handed
over as `z = exp(i tau)`, split into real and imaginary part: powers of `z` replace trigonometric functions. Compiled
inner loops; arrays in, arrays out.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray

#: flags under which the compiler may reorder sums, for loops in vector registers
FAST = {"reassoc", "contract", "nsz"}
#: points that are dealt with together, so that the nearest cache holds all of it
_STRETCH = 256


@kernel(fastmath=FAST)
def sum_waves(coefficients, zr, zi, real, imaginary):
    """`sum_k coefficients[r, k] z^k` at the points z, real and imaginary part into arrays (R, N)."""
    top = coefficients.shape[1] - 1
    for r in range(coefficients.shape[0]):
        factors = coefficients[r]
        for begin in range(0, zr.shape[0], _STRETCH):
            end = begin + _STRETCH
            x, y, co, si = real[r, begin:end], imaginary[r, begin:end], zr[begin:end], zi[begin:end]
            a, b = factors[top].real, factors[top].imag
            for j in range(x.shape[0]):
                x[j] = a
                y[j] = b
            # two harmonics at a time: what is between them stays in registers
            for k in range(top - 1, 0, -2):
                a, b, d, e = factors[k].real, factors[k].imag, factors[k - 1].real, factors[k - 1].imag
                for j in range(x.shape[0]):
                    t = x[j] * co[j] - y[j] * si[j] + a
                    u = x[j] * si[j] + y[j] * co[j] + b
                    x[j] = t * co[j] - u * si[j] + d
                    y[j] = t * si[j] + u * co[j] + e
            if top % 2 == 1:
                a, b = factors[0].real, factors[0].imag
                for j in range(x.shape[0]):
                    t = x[j] * co[j] - y[j] * si[j] + a
                    y[j] = x[j] * si[j] + y[j] * co[j] + b
                    x[j] = t


@kernel()
def displacement(c, zr, zi, out):
    """`Re sum_k c_k z^k` and its first derivatives by tau at the points z, into the rows of `out` (D, N)."""
    factors = np.empty((out.shape[0], c.shape[0]), dtype=np.complex128)
    for k in range(c.shape[0]):
        factors[0, k] = c[k]
        for order in range(1, out.shape[0]):
            factors[order, k] = complex(-k * factors[order - 1, k].imag, k * factors[order - 1, k].real)
    sum_waves(factors, zr, zi, out, np.empty(out.shape))


@kernel()
def projected(values, zr, zi, shift, out):
    """`1/(2 pi) sum_j values_j z_j^(shift - k)` of complex values (N,) into `out` (K,), k = 0 .. K - 1."""
    parts = np.empty((2, zr.shape[0]))
    for j in range(zr.shape[0]):
        parts[0, j], parts[1, j] = values[j].real, values[j].imag
    last = out.shape[0] - 1 - shift
    means = spectra(parts, np.ones(zr.shape[0]), zr, zi, max(abs(shift), abs(last)))
    for k in range(out.shape[0]):
        a, b = means[0, abs(k - shift)], means[1, abs(k - shift)]
        # of real functions those of negative index are conjugate
        out[k] = a + 1j * b if k >= shift else a.conjugate() + 1j * b.conjugate()


@kernel()
def pulled(waves, weights, zr, zi, values, out):
    """What `conj(left) W right` is at points z, (R, N) into the rows of `values` (real parts, then imaginary ones, or
    real parts alone), and its integrals against 1, cos tau, sin tau, .. up to H likewise into `out` (., 2 H + 1).

    waves (1 + Q, F): amplitudes of left and of the rows of right on one row of frequencies; weights W (R, Q, N).
    """
    rows, read, n = weights.shape
    real, imaginary = np.empty((1 + read, n)), np.empty((1 + read, n))
    sum_waves(waves, zr, zi, real, imaginary)
    for r in range(rows):
        for j in range(n):
            a = b = 0.0
            for s in range(read):
                a += weights[r, s, j] * real[1 + s, j]
                b += weights[r, s, j] * imaginary[1 + s, j]
            values[r, j] = real[0, j] * a + imaginary[0, j] * b
            if values.shape[0] > rows:
                values[rows + r, j] = real[0, j] * b - imaginary[0, j] * a
    high = out.shape[1] // 2
    means = spectra(values, np.ones(n), zr, zi, high)
    for r in range(values.shape[0]):
        out[r, 0] += means[r, 0].real
        for k in range(1, high + 1):
            out[r, 2 * k - 1] += means[r, k].real
            out[r, 2 * k] -= means[r, k].imag


def motion(c: ComplexArray, zr: Array, zi: Array) -> Array:
    """Values and first derivative of `Re sum_k c_k z^k` with respect to tau at the points z; shape (2, N)."""
    out = np.empty((2, len(zr)))
    displacement(c, zr, zi, out)
    return out


def wave_sums(coefficients: ComplexArray, zr: Array, zi: Array) -> ComplexArray:
    """`sum_k coefficients[r, k] z^k` at the points z; complex, shape (R, N)."""
    real, imaginary = np.empty((2, len(coefficients), len(zr)))
    sum_waves(np.ascontiguousarray(coefficients), zr, zi, real, imaginary)
    return real + 1j * imaginary


@kernel(fastmath=FAST)
def spectra(values, weights, zr, zi, top):
    """Fourier coefficients `1/(2 pi) sum_j weights_j values[r, j] z_j^-q`, q = 0 .. top; shape (R, top + 1)."""
    rows, n = values.shape
    out = np.zeros((rows, top + 1), dtype=np.complex128)
    real, imaginary = np.empty(_STRETCH), np.empty(_STRETCH)
    scale = 1.0 / (2.0 * math.pi)
    # two rows at a time, which share the powers of z; a last one alone is its own neighbour
    for r in range(0, rows, 2):
        s = min(r + 1, rows - 1)
        for begin in range(0, n, _STRETCH):
            end = begin + _STRETCH
            f, g, w, co, si = (
                values[r, begin:end],
                values[s, begin:end],
                weights[begin:end],
                zr[begin:end],
                zi[begin:end],
            )
            x, y = real[: w.shape[0]], imaginary[: w.shape[0]]
            for j in range(w.shape[0]):
                x[j] = w[j] * scale
                y[j] = 0.0
            # two harmonics at a time: what is between them stays in registers
            for q in range(0, top + 1, 2):
                fr = fi = gr = gi = hr = hi = kr = ki = 0.0
                for j in range(w.shape[0]):
                    a, b, c, d = x[j], y[j], co[j], si[j]
                    fr += f[j] * a
                    fi += f[j] * b
                    gr += g[j] * a
                    gi += g[j] * b
                    e = a * c - b * d
                    b = a * d + b * c
                    hr += f[j] * e
                    hi += f[j] * b
                    kr += g[j] * e
                    ki += g[j] * b
                    x[j] = e * c - b * d
                    y[j] = e * d + b * c
                out[r, q] += complex(fr, -fi)
                if s > r:
                    out[s, q] += complex(gr, -gi)
                if q < top:
                    out[r, q + 1] += complex(hr, -hi)
                    if s > r:
                        out[s, q + 1] += complex(kr, -ki)
    return out


@kernel(forceinline=True)
def jet(c, zr, zi):
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
def extrema(c, zr, zi):
    """Local extrema of `Re sum_k c_k exp(i k tau)` over a period: tau, value, second derivative, (3, m); ascending in
    tau.

    Brackets of the derivative's zeros on the uniform grid z, then safeguarded Newton. A pair hidden between two samples
    is looked for where the cubic through them nearly turns. Maxima and minima alternate, so that their number is even.
    """
    n = zr.shape[0]
    h = 2.0 * math.pi / n
    values, turns = np.empty((2, n)), np.empty((3, 2 * n))
    displacement(c, zr, zi, values)
    ends, count = np.empty(3), 0
    for j in range(n):
        d0 = values[1, j]
        d1 = values[1, (j + 1) % n]
        lo = j * h
        ends[0], ends[1] = lo, lo + h
        turning = 1
        if (d0 > 0.0) == (d1 > 0.0):
            # slope of the cubic: d0 + b s + a s^2, s in (0, 1)
            mean = (values[0, (j + 1) % n] - values[0, j]) / h
            a = 3.0 * (d0 + d1 - 2.0 * mean)
            b = 2.0 * (3.0 * mean - 2.0 * d0 - d1)
            near = a * d0 > 0.0 and 0.0 < -b / a < 2.0
            if not near or abs(d0) - b * b / (4.0 * abs(a)) > 0.5 * min(abs(d0), abs(d1)):
                continue
            middle = lo - 0.5 * h * b / a
            _, d, s = jet(c, math.cos(middle), math.sin(middle))
            new = middle - 0.5 * h * h * s / a
            if lo < new < lo + h:
                middle = new
                _, d, s = jet(c, math.cos(middle), math.sin(middle))
            if d * d0 >= 0.0:
                continue
            ends[1], ends[2] = middle, lo + h
            turning = 2
        for i in range(turning):
            first, last, rises = ends[i], ends[i + 1], (d0 > 0.0) == (i == 0)
            t = lo + h * d0 / (d0 - d1) if turning == 1 else 0.5 * (first + last)
            x = s = 0.0
            for _ in range(60):
                x, d, s = jet(c, math.cos(t), math.sin(t))
                if (d > 0.0) == rises:
                    first = t
                else:
                    last = t
                new = t - d / s if s != 0.0 else 0.5 * (first + last)
                if not (first <= new <= last):
                    new = 0.5 * (first + last)
                # an error e of the instant is one of s e^2 / 2 in the value
                done = abs(new - t) < 1e-9
                t = new
                if done:
                    break
            # the sign that alternates, where rounding hides it
            turns[0, count], turns[1, count], turns[2, count] = t, x, -abs(s) if rises else abs(s)
            count += 1
    return turns[:, :count].copy()


@kernel()
def crossings_of(c, level, turns):
    """Instants in [0, 2 pi) at which the motion crosses `level`, ascending, and whether it lies above before the first.

    turns: the motion's extrema, between any two of which it rises or falls (`extrema`). Exact up to rounding.
    """
    m = turns.shape[1]
    roots, count = np.empty(m), 0
    above = m == 0 and c[0].real > level
    for k in range(m):
        # the last bracket comes first: it may reach beyond the period
        i, j = (m - 1, 0) if k == 0 else (k - 1, k)
        f0, f1 = turns[1, i] - level, turns[1, j] - level
        if k == 0:
            above = f0 > 0.0
        if (f0 > 0.0) == (f1 > 0.0):
            continue
        first, last = turns[0, i] - (2.0 * math.pi if k == 0 else 0.0), turns[0, j]
        # as if it were a cosine, then Newton's method kept inside the bracket
        tau, step = first + (last - first) * math.acos((f0 + f1) / (f1 - f0)) / math.pi, last - first
        for _ in range(100):
            x, d, _s = jet(c, math.cos(tau), math.sin(tau))
            f = x - level
            if f == 0.0:
                break
            if (f > 0.0) == (f0 > 0.0):
                first = tau
            else:
                last = tau
            new = tau - f / d if d != 0.0 else np.inf
            if not (first < new < last):
                # a step out of the bracket that rounding alone explains: the root is here
                if abs(new - tau) < 1e-14 * max(1.0, abs(tau)) or last - first < 4e-16 * max(1.0, abs(tau)):
                    break
                new = 0.5 * (first + last)
            previous, step = step, abs(new - tau)
            tau = new
            # converging quadratically: the step after one of 1e-8 is below rounding
            if step < 1e-15 * max(1.0, abs(tau)) or (step < 1e-8 and step < 1e-4 * previous):
                x, d, _s = jet(c, math.cos(tau), math.sin(tau))
                if d != 0.0 and abs(x - level) < abs(d) * 1e-12:
                    tau -= (x - level) / d
                break
        roots[count] = tau
        count += 1
    if count > 0 and roots[0] < 0.0:
        # of the period before: the last of this one
        before = roots[0] + 2.0 * math.pi
        for k in range(1, count):
            roots[k - 1] = roots[k]
        roots[count - 1] = before
        above = not above
    return roots[:count], above


def crossings(c: ComplexArray, level: float, zr: Array, zi: Array) -> tuple[Array, bool]:
    """`crossings_of`, with extrema searched on the uniform grid z."""
    result: tuple[Array, bool] = crossings_of(c, level, extrema(c, zr, zi))
    return result


@kernel()
def passages(ta, xa, sa, level_a, tb, xb, sb, level_b):
    """Extrema that pass a level between two neighbouring motions a and b (instants t, values x, curvatures s).

    Extrema are paired in their cyclic order, so that two that pass at once in opposite senses are both seen. Returns
    all pairs of indices, those that pass first, shape (m, 2), how many do, how often each motion crosses its level, and
    the least height of an extremum across it, in units of the motion's largest value.
    If the crossings differ by other than what the pairs explain, extrema have come or gone as well.
    """
    crossed_a = crossed_b = 0
    least = np.inf
    for side in range(2):
        x, s, level = (xa, sa, level_a) if side == 0 else (xb, sb, level_b)
        crossed, largest, lowest = 0, 0.0, np.inf
        for i in range(x.shape[0]):
            crossed += (x[i] > level) != (x[(i + 1) % x.shape[0]] > level)
            largest = max(largest, abs(x[i]))
            height = level - x[i] if s[i] > 0.0 else x[i] - level
            if height > 0.0:
                lowest = min(lowest, height)
        if lowest < np.inf and largest > 0.0:
            least = min(least, lowest / largest)
        if side == 0:
            crossed_a = crossed
        else:
            crossed_b = crossed
    wanted = min(xa.shape[0], xb.shape[0])
    pairs = np.empty((wanted, 2), dtype=np.int64)
    count = 0
    if wanted == 0:
        return pairs, count, crossed_a, crossed_b, least
    kept = np.empty((2, max(xa.shape[0], xb.shape[0])), dtype=np.int64)
    for side in range(2):
        # neighbouring pairs are dropped, the least different first: ripples that have just come or are about to go
        x, index = (xa, kept[0]) if side == 0 else (xb, kept[1])
        m = x.shape[0]
        for i in range(m):
            index[i] = i
        while m > wanted:
            best = 0
            smallest = np.inf
            for i in range(m):
                difference = abs(x[index[i]] - x[index[(i + 1) % m]])
                if difference < smallest:
                    smallest = difference
                    best = i
            other, left = (best + 1) % m, 0
            for i in range(m):
                if i != best and i != other:
                    index[left] = index[i]
                    left += 1
            m = left
    ia, ib = kept[0], kept[1]
    # maxima to maxima
    first = 0 if (sa[ia[0]] < 0.0) == (sb[ib[0]] < 0.0) else 1
    best = first
    shortest = np.inf
    for shift in range(first, wanted, 2):
        total = 0.0
        for i in range(wanted):
            way = abs(ta[ia[i]] - tb[ib[(i + shift) % wanted]])
            total += min(way, 2.0 * math.pi - way)
        if total < shortest:
            shortest = total
            best = shift
    last = wanted
    for i in range(wanted):
        p = ia[i]
        q = ib[(i + best) % wanted]
        if (xa[p] > level_a) != (xb[q] > level_b):
            at = count
            count += 1
        else:
            last -= 1
            at = last
        pairs[at, 0] = p
        pairs[at, 1] = q
    return pairs, count, crossed_a, crossed_b, least
