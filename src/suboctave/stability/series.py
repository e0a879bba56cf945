"""Compiled kernels that sum the power series of `several`: one step of the linearised motion of several DOFs.

On a step dt/ds and what the elements add are polynomials in s; the solution's coefficients follow from each other.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.stability.nodes import ORDER

#: most terms of a series
TERMS = 80
#: rows of zeros before a series, so that products with polynomials need no exceptions
PAST = ORDER - 1
#: sums may be reordered; infinities keep their meaning
FAST = {"reassoc", "contract", "nsz"}


@kernel()
def shifted(coefficients, origin, length, out):
    """Coefficients of `p(origin + length x)` in powers of x."""
    for i in range(ORDER):
        out[i] = coefficients[i]
    for i in range(ORDER):
        for j in range(ORDER - 2, i - 1, -1):
            out[j] += origin * out[j + 1]
    f = 1.0
    for i in range(ORDER):
        out[i] *= f
        f *= length


@kernel()
def norm(a):
    """Largest sum of moduli along a row."""
    size = 0.0
    for i in range(a.shape[0]):
        row = 0.0
        for j in range(a.shape[1]):
            row += abs(a[i, j])
        size = max(size, row)
    return size


@kernel(fastmath=FAST)
def series(state, matrix, damping, left, right, local, span, active, moving, graded, enough, y, w, ry, rw):
    """Sum the series of one step into `state` (2 n, cols); returns how many terms it took.

    local (1 + 3 G, ORDER): coefficients of dt/dx, and of k, c, r along every direction (times dt/dx if graded), x in
    [0, 1]; span: dt/dx if not graded. Beyond the 2 n homogeneous solutions, a single column feels r; G ORDER columns
    feel one power of x along one direction each. Terms of y and y' go to y, w (., n cols),
    those of `right_g^T y` and `right_g^T y'` to ry, rw (., G cols), after `PAST` rows of zeros. They
    are taken until those of the velocities stay below the share `enough`.
    """
    groups, n = left.shape
    cols = state.shape[1]
    small = 0
    force = np.zeros(groups * cols)
    ty = np.empty(n * cols)
    tw = np.empty(n * cols)
    for i in range(n):
        for j in range(cols):
            y[PAST, i * cols + j] = state[i, j]
            w[PAST, i * cols + j] = state[n + i, j]
    for order in range(TERMS - 1):
        o = order + PAST
        for g in range(groups):
            b = g * cols
            for j in range(b, b + cols):
                ry[o, j] = 0.0
                rw[o, j] = 0.0
            for i in range(n):
                f = right[g, i]
                if f != 0.0:
                    a = i * cols
                    for j in range(cols):
                        ry[o, b + j] += f * y[o, a + j]
                        rw[o, b + j] += f * w[o, a + j]
            if active[g]:
                # products of polynomials and series
                q = 1 + 3 * g
                f0, f1, f2, f3 = local[q, 0], local[q, 1], local[q, 2], local[q, 3]
                f4, f5, f6 = local[q, 4], local[q, 5], local[q, 6]
                for j in range(b, b + cols):
                    force[j] = (
                        f0 * ry[o, j]
                        + f1 * ry[o - 1, j]
                        + f2 * ry[o - 2, j]
                        + f3 * ry[o - 3, j]
                        + f4 * ry[o - 4, j]
                        + f5 * ry[o - 5, j]
                        + f6 * ry[o - 6, j]
                    )
                if moving:
                    for r in range(ORDER):
                        f = local[q + 1, r]
                        for j in range(b, b + cols):
                            force[j] += f * rw[o - r, j]
            else:
                for j in range(b, b + cols):
                    force[j] = 0.0
            if order < ORDER:
                if cols == 2 * n + 1:
                    force[b + cols - 1] += local[3 + 3 * g, order]
                elif cols > 2 * n:
                    force[b + 2 * n + g * ORDER + order] += 1.0
        share = 1.0 / (order + 1)
        if graded:
            for j in range(n * cols):
                ty[j] = 0.0
                tw[j] = 0.0
            for r in range(ORDER):
                f = local[0, r]
                for j in range(n * cols):
                    ty[j] += f * y[o - r, j]
                    tw[j] += f * w[o - r, j]
        else:
            share *= span
            for j in range(n * cols):
                ty[j] = y[o, j]
                tw[j] = w[o, j]
        for i in range(n):
            a = i * cols
            for j in range(a, a + cols):
                y[o + 1, j] = share * tw[j]
                w[o + 1, j] = 0.0
            for k in range(n):
                p = share * matrix[i, k]
                q = share * damping[i, k]
                if p != 0.0 or q != 0.0:
                    b = k * cols
                    for j in range(cols):
                        w[o + 1, a + j] -= p * ty[b + j] + q * tw[b + j]
            for g in range(groups):
                f = share * left[g, i]
                if f != 0.0:
                    b = g * cols
                    for j in range(cols):
                        w[o + 1, a + j] -= f * force[b + j]
            for j in range(cols):
                state[i, j] += y[o + 1, a + j]
                state[n + i, j] += w[o + 1, a + j]
        if order + 1 >= ORDER:
            most = last = 0.0
            for i in range(n):
                for j in range(cols):
                    most = max(most, abs(state[n + i, j]))
                    last = max(last, abs(w[o + 1, i * cols + j]))
            small = small + 1 if last <= enough * most else 0
            if small == 2:
                return order
    return TERMS - 2


@kernel(fastmath=FAST)
def evaluate(terms, used, g, cols, x, out):
    """The series of direction g at x into out (cols,)."""
    b = g * cols
    for j in range(cols):
        out[j] = terms[PAST + used, b + j]
    for order in range(PAST + used - 1, PAST - 1, -1):
        for j in range(cols):
            out[j] = out[j] * x + terms[order, b + j]


@kernel(fastmath=FAST)
def through(row, one, local, out):
    """A row of a step's propagator, with its responses to powers of x, applied to the states `one` before the step."""
    size, cols = one.shape
    for j in range(cols):
        out[j] = 0.0
    for q in range(size):
        f = row[q]
        for j in range(cols):
            out[j] += f * one[q, j]
    if cols > size:
        a = 0.0
        for i in range(row.shape[0] - size):
            a += row[size + i] * local[3 + 3 * (i // ORDER), i % ORDER]
        out[size] += a


@kernel()
def _whole(values):
    """Sum of the moduli."""
    total = 0.0
    for i in range(values.shape[0]):
        total += abs(values[i])
    return total


@kernel()
def growth(poly, local, span, steps, length, graded, size_k, size_c, shares):
    """Largest length of a step in units of the fastest time scale, as large as the polynomials are on the unit disc."""
    most = 0.0
    for step in range(steps):
        for q in range(poly.shape[0]):
            if q % 3 > 0 or (q == 0 and graded):
                shifted(poly[q], -1.0 + span * step, span, local[q])
        time = span * length
        if graded:
            time = span * _whole(local[0])
        k = time * size_k
        c = time * size_c
        for g in range(shares.shape[0]):
            f = span * shares[g] * (1.0 if graded else length)
            k += f * _whole(local[1 + 3 * g])
            c += f * _whole(local[2 + 3 * g])
        most = max(most, math.sqrt(time * k) + c)
    return most
