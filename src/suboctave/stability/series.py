"""Compiled kernels that sum the power series of `several`: one step of the linearised motion of several DOFs.

On a step dt/ds and what the elements add are polynomials in s; the solution's coefficients follow from each other.
"""

from __future__ import annotations

import math

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


@kernel(inline="always", fastmath=FAST)
def series(state, matrix, damping, left, right, local, span, moving, graded, enough, terms, room):
    """Sum the series of one step into `state` (2 n, cols); returns how many terms it took.

    local (1 + 3 G, ORDER): coefficients of dt/dx, and of k, c, r along every direction (times dt/dx if graded), x in
    [0, 1]; span: dt/dx if not graded. Beyond the 2 n homogeneous solutions, a single column feels r; G ORDER columns
    feel one power of x along one direction each. Terms of y, y', `right_g^T y` and `right_g^T y'` go to `terms`
    (., 2 n + 2 G, cols), after `PAST` zeros. They are taken until those of the velocities stay below the share
    `enough`. room (G + 2 n, cols): for work.
    """
    groups, n = left.shape
    size = 2 * n
    cols = state.shape[1]
    small = used = 0
    for i in range(size):
        for j in range(cols):
            terms[PAST, i, j] = state[i, j]
    for order in range(TERMS - 1):
        o = order + PAST
        for g in range(groups):
            for j in range(cols):
                room[g, j] = 0.0
            for part in range(2):
                row = size + part * groups + g
                for j in range(cols):
                    terms[o, row, j] = 0.0
                for i in range(n):
                    f = right[g, i]
                    if f != 0.0:
                        for j in range(cols):
                            terms[o, row, j] += f * terms[o, part * n + i, j]
                if part == 0 or moving:
                    # products of polynomials and series
                    for q in range(ORDER):
                        f = local[1 + 3 * g + part, q]
                        if f != 0.0:
                            for j in range(cols):
                                room[g, j] += f * terms[o - q, row, j]
            if order < ORDER:
                if cols == size + 1:
                    room[g, size] += local[3 + 3 * g, order]
                elif cols > size:
                    room[g, size + g * ORDER + order] += 1.0
        share = 1.0 / (order + 1)
        if not graded:
            share *= span
        if graded:
            for i in range(size):
                for j in range(cols):
                    room[groups + i, j] = 0.0
                for q in range(ORDER):
                    f = local[0, q]
                    for j in range(cols):
                        room[groups + i, j] += f * terms[o - q, i, j]
        now = room[groups:] if graded else terms[o]
        most = last = 0.0
        for i in range(n):
            for j in range(cols):
                terms[o + 1, i, j] = share * now[n + i, j]
                terms[o + 1, n + i, j] = 0.0
            for k in range(n):
                p = share * matrix[i, k]
                q = share * damping[i, k]
                if p != 0.0 or q != 0.0:
                    for j in range(cols):
                        terms[o + 1, n + i, j] -= p * now[k, j] + q * now[n + k, j]
            for g in range(groups):
                f = share * left[g, i]
                if f != 0.0:
                    for j in range(cols):
                        terms[o + 1, n + i, j] -= f * room[g, j]
            for j in range(cols):
                state[i, j] += terms[o + 1, i, j]
                state[n + i, j] += terms[o + 1, n + i, j]
                most = max(most, abs(state[n + i, j]))
                last = max(last, abs(terms[o + 1, n + i, j]))
        used = order
        if order + 1 >= ORDER:
            small = small + 1 if last <= enough * most else 0
            if small == 2:
                break
    return used


@kernel(inline="always", fastmath=FAST)
def evaluate(terms, used, row, x, out):
    """The series of a row of `terms` at x into out (cols,)."""
    for j in range(out.shape[0]):
        out[j] = terms[PAST + used, row, j]
    for order in range(PAST + used - 1, PAST - 1, -1):
        for j in range(out.shape[0]):
            out[j] = out[j] * x + terms[order, row, j]


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
