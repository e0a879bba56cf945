"""Compiled inner loops of the alternating frequency/time method. Arrays in, arrays out.

Points on the unit circle are handed over as `z = exp(i tau)`, split into real and imaginary part: powers of `z` replace
trigonometric functions. Kernels receive arrays only, never functions, so that Numba can keep them in its cache.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import QUICK, kernel

_FAST = {"reassoc", "contract", "nsz"}
#: points that are dealt with together
_STRETCH = 256


@kernel(patience=QUICK, fastmath=_FAST)
def displacement(c, zr, zi, out):
    """Values of `Re sum_k c_k z^k` at the points z, into `out` (N,)."""
    n, top = zr.shape[0], c.shape[0] - 1
    imaginary = np.empty(_STRETCH)
    # stretch by stretch, so that the nearest cache holds all of it
    for begin in range(0, n, _STRETCH):
        x, co, si = out[begin : begin + _STRETCH], zr[begin : begin + _STRETCH], zi[begin : begin + _STRETCH]
        y = imaginary[: x.shape[0]]
        a, b = c[top].real, c[top].imag
        for j in range(x.shape[0]):
            x[j] = a
            y[j] = b
        # two harmonics at a time: what is between them stays in registers
        k = top - 1
        while k > 0:
            a, b, d, e = c[k].real, c[k].imag, c[k - 1].real, c[k - 1].imag
            for j in range(x.shape[0]):
                t = x[j] * co[j] - y[j] * si[j] + a
                u = x[j] * si[j] + y[j] * co[j] + b
                x[j] = t * co[j] - u * si[j] + d
                y[j] = t * si[j] + u * co[j] + e
            k -= 2
        if k == 0:
            a = c[0].real
            for j in range(x.shape[0]):
                x[j] = x[j] * co[j] - y[j] * si[j] + a


@kernel()
def slope(c, factor):
    """Complex coefficients `factor i k c_k` of the derivative with respect to tau, times a factor."""
    out = np.empty_like(c)
    for k in range(c.shape[0]):
        out[k] = complex(-factor * k * c[k].imag, factor * k * c[k].real)
    return out


@kernel(patience=QUICK)
def motion(c, zr, zi):
    """Values and first derivative of `Re sum_k c_k z^k` with respect to tau at the points z; shape (2, N)."""
    out = np.empty((2, zr.shape[0]))
    displacement(c, zr, zi, out[0])
    displacement(slope(c, 1.0), zr, zi, out[1])
    return out


@kernel(patience=QUICK, fastmath=_FAST)
def spectra(values, zr, zi, top):
    """Fourier coefficients `1/(2 pi) sum_j values[r, j] z_j^-q`, q = 0 .. top (weights already in `values`); shape
    (R, top + 1).
    """
    rows, n = values.shape
    out = np.zeros((rows, top + 1), dtype=np.complex128)
    real, imaginary = np.empty(_STRETCH), np.empty(_STRETCH)
    scale = 1.0 / (2.0 * math.pi)
    for r in range(rows):
        for begin in range(0, n, _STRETCH):
            g, co, si = values[r, begin : begin + _STRETCH], zr[begin : begin + _STRETCH], zi[begin : begin + _STRETCH]
            x, y = real[: g.shape[0]], imaginary[: g.shape[0]]
            for j in range(g.shape[0]):
                x[j] = g[j] * scale
                y[j] = 0.0
            # two harmonics at a time: what is between them stays in registers
            for q in range(0, top + 1, 2):
                sr = su = tr = tu = 0.0
                for j in range(g.shape[0]):
                    a, b, c, d = x[j], y[j], co[j], si[j]
                    sr += a
                    su += b
                    e = a * c - b * d
                    f = a * d + b * c
                    tr += e
                    tu += f
                    x[j] = e * c - f * d
                    y[j] = e * d + f * c
                out[r, q] += complex(sr, -su)
                if q < top:
                    out[r, q + 1] += complex(tr, -tu)
    return out


@kernel()
def toeplitz_form(left, spectrum, right):
    """`left^H T right`, T the product with a real periodic function whose Fourier coefficients 0 .. top are given, on
    waves of consecutive frequencies, shape (F,) each.
    """
    count = left.shape[0]
    total = 0.0 + 0.0j
    for k in range(count):
        re = im = 0.0
        for m in range(count):
            c = spectrum[k - m] if k >= m else spectrum[m - k].conjugate()
            re += c.real * right[m].real - c.imag * right[m].imag
            im += c.real * right[m].imag + c.imag * right[m].real
        total += left[k].conjugate() * complex(re, im)
    return total


@kernel()
def contact_spectrum(tau, above, side, top):
    """Fourier coefficients q = 0 .. top of the indicator of `side * (x - level) > 0`, from the crossings of `level`.

    chi_q = 1/(2 pi) int chi exp(-i q tau): sums of exp(-i q tau_i) / q over the ends of the contact intervals.
    """
    out = np.zeros(top + 1, dtype=np.complex128)
    active = above == (side > 0)
    n = tau.shape[0]
    if n == 0:
        out[0] = 1.0 if active else 0.0
        return out
    scale = 1.0 / (2.0 * math.pi)
    length = 2.0 * math.pi if active else 0.0
    state = active
    for i in range(n):
        sign = 1.0 if state else -1.0  # +1: a contact ends here, -1: one begins
        length += sign * tau[i]
        zr = math.cos(tau[i])
        zi = -math.sin(tau[i])
        pr = zr
        pi = zi
        for q in range(1, top + 1):
            f = sign * scale / q
            out[q] += complex(-f * pi, f * pr)  # i/q * exp(-i q tau), the antiderivative at an end
            t = pr * zr - pi * zi
            pi = pr * zi + pi * zr
            pr = t
        state = not state
    out[0] = length * scale
    return out


@kernel(patience=QUICK, fastmath=_FAST)
def product_spectrum(c, shift, chi, top):
    """Fourier coefficients k = 0 .. top of `(x - shift) * chi`, x given by its c_k, chi by chi_q with q up to top +
    H.
    """
    high = c.shape[0] - 1
    # chi_q for q = -H .. top + H, negative ones by conjugation
    xr = np.empty(top + 2 * high + 1)
    xi = np.empty(top + 2 * high + 1)
    for q in range(-high, top + high + 1):
        xr[q + high] = chi[q].real if q >= 0 else chi[-q].real
        xi[q + high] = chi[q].imag if q >= 0 else -chi[-q].imag
    re = np.empty(top + 1)
    im = np.empty(top + 1)
    mean = c[0].real - shift
    for k in range(top + 1):
        re[k] = mean * xr[k + high]
        im[k] = mean * xi[k + high]
    for m in range(1, high + 1):
        # x_m = c_m / 2 and x_-m its conjugate
        a = 0.5 * c[m].real
        b = 0.5 * c[m].imag
        # views, whose indices the compiler knows to be positive
        pr, pi = xr[high - m : high - m + top + 1], xi[high - m : high - m + top + 1]
        qr, qi = xr[high + m : high + m + top + 1], xi[high + m : high + m + top + 1]
        for k in range(top + 1):
            re[k] += a * (pr[k] + qr[k]) + b * (qi[k] - pi[k])
            im[k] += a * (pi[k] + qi[k]) + b * (pr[k] - qr[k])
    out = np.empty(top + 1, dtype=np.complex128)
    for k in range(top + 1):
        out[k] = complex(re[k], im[k])
    return out


@kernel()
def galerkin(stiffness, damping, rate, rows, cols, rows_mean, cols_mean):
    """Galerkin matrix `T(f_x) + T(f_v) d/dt` between two real bases.

    rows, cols: twice the frequencies of the basis functions in units of the base frequency (even: integer basis, odd:
    half-odd basis), one entry per harmonic; the mean, if any, comes first. `rate` is the base frequency. Spectra must
    reach the largest sum of two frequencies.
    """
    nr = 2 * rows.shape[0] - (1 if rows_mean else 0)
    nc = 2 * cols.shape[0] - (1 if cols_mean else 0)
    out = np.empty((nr, nc))
    moving = damping.shape[0] > 0
    for i in range(rows.shape[0]):
        row_mean = rows_mean and i == 0
        rc = 0 if row_mean else (2 * i - 1 if rows_mean else 2 * i)
        for j in range(cols.shape[0]):
            col_mean = cols_mean and j == 0
            cc = 0 if col_mean else (2 * j - 1 if cols_mean else 2 * j)
            low = (rows[i] - cols[j]) // 2
            top = (rows[i] + cols[j]) // 2
            g = stiffness[low] if low >= 0 else stiffness[-low].conjugate()
            p = stiffness[top]
            # C_q = 2 Re g_q, S_q = -2 Im g_q
            a = g.real + p.real
            b = g.imag - p.imag
            e = -g.imag - p.imag
            d = g.real - p.real
            if moving:
                w = 0.5 * cols[j] * rate
                g = damping[low] if low >= 0 else damping[-low].conjugate()
                p = damping[top]
                # d/dt turns cos into -w sin and sin into w cos
                a -= w * (g.imag - p.imag)
                b += w * (g.real + p.real)
                e -= w * (g.real - p.real)
                d += w * (-g.imag - p.imag)
            if row_mean:
                out[0, cc] = 0.5 * a
                if not col_mean:
                    out[0, cc + 1] = 0.5 * b
            else:
                out[rc, cc] = a
                out[rc + 1, cc] = e
                if not col_mean:
                    out[rc, cc + 1] = b
                    out[rc + 1, cc + 1] = d
    return out


@kernel(patience=QUICK, fastmath=_FAST)
def polynomial(coefficients, zr, zi):
    """`sum_k coefficients[r, k] z^k` at the points z; complex, shape (R, N)."""
    rows, count = coefficients.shape
    n = zr.shape[0]
    out = np.empty((rows, n), dtype=np.complex128)
    real, imaginary = np.empty(_STRETCH), np.empty(_STRETCH)
    for r in range(rows):
        c = coefficients[r]
        for begin in range(0, n, _STRETCH):
            co, si, found = zr[begin : begin + _STRETCH], zi[begin : begin + _STRETCH], out[r, begin : begin + _STRETCH]
            x, y = real[: co.shape[0]], imaginary[: co.shape[0]]
            a, b = c[count - 1].real, c[count - 1].imag
            for j in range(x.shape[0]):
                x[j] = a
                y[j] = b
            k = count - 2
            while k > 0:
                a, b, d, e = c[k].real, c[k].imag, c[k - 1].real, c[k - 1].imag
                for j in range(x.shape[0]):
                    t = x[j] * co[j] - y[j] * si[j] + a
                    u = x[j] * si[j] + y[j] * co[j] + b
                    x[j] = t * co[j] - u * si[j] + d
                    y[j] = t * si[j] + u * co[j] + e
                k -= 2
            if k == 0:
                a, b = c[0].real, c[0].imag
                for j in range(x.shape[0]):
                    t = x[j] * co[j] - y[j] * si[j] + a
                    y[j] = x[j] * si[j] + y[j] * co[j] + b
                    x[j] = t
            for j in range(x.shape[0]):
                found[j] = complex(x[j], y[j])
    return out


@kernel()
def add_linear(out, blocks, mean):
    """Add complex blocks (h, n, n), one per harmonic, to the block diagonal of a real matrix of the sine/cosine basis.

    A complex amplitude `a - i b` stands for `a cos + b sin`: the block of a matrix `P + i Q` is [[P, Q], [-Q, P]].
    """
    n = blocks.shape[1]
    for h in range(blocks.shape[0]):
        if mean and h == 0:
            for i in range(n):
                for j in range(n):
                    out[i, j] += blocks[0, i, j].real
            continue
        at = (2 * h - 1 if mean else 2 * h) * n
        for i in range(n):
            for j in range(n):
                p = blocks[h, i, j].real
                q = blocks[h, i, j].imag
                out[at + i, at + j] += p
                out[at + n + i, at + n + j] += p
                out[at + i, at + n + j] += q
                out[at + n + i, at + j] -= q


@kernel()
def add_element(out, matrix, rows, row_values, cols, col_values, n):
    """Add `matrix` (per basis function) times the outer product of two sparse shapes over the DOFs to a real or
    complex matrix.
    """
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            for p in range(rows.shape[0]):
                for q in range(cols.shape[0]):
                    out[i * n + rows[p], j * n + cols[q]] += matrix[i, j] * row_values[p] * col_values[q]


@kernel()
def form(left, blocks, right):
    """`sum_f left_f^H blocks_f right_f`; left, right (F, n), blocks (F, n, n)."""
    total = 0.0 + 0.0j
    for f in range(left.shape[0]):
        for i in range(left.shape[1]):
            row = 0.0 + 0.0j
            for j in range(right.shape[1]):
                row += blocks[f, i, j] * right[f, j]
            total += left[f, i].conjugate() * row
    return total
