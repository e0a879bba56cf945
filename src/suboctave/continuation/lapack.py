"""LU factors inside compiled code, by the LAPACK that Numba links for `numpy.linalg`, and solutions with them."""

from __future__ import annotations

import math

import numpy as np
from numba import config, types
from scipy.linalg import lapack

from suboctave.compiled import kernel
from suboctave.continuation.kernels import determinant_sign, log_modulus

try:
    from numba.np.linalg import _LAPACK, F_INT_nptype

    _getrf = _LAPACK.numba_xxgetrf(types.float64)
except (ImportError, AttributeError):  # names that Numba may change
    _getrf = None
_REAL = ord("d")
_FAST = {"reassoc", "contract", "nsz"}


@kernel(at_once=True)
def factorise_plainly(transposed, pivots):
    """As `factorise`, without LAPACK: for a Numba that names it otherwise."""
    n = transposed.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(transposed[k, i]) > abs(transposed[k, pivot]):
                pivot = i
        pivots[k] = pivot
        if transposed[k, pivot] == 0.0:
            return True
        if pivot != k:
            for j in range(n):
                transposed[j, k], transposed[j, pivot] = transposed[j, pivot], transposed[j, k]
        for i in range(k + 1, n):
            transposed[k, i] /= transposed[k, k]
        for j in range(k + 1, n):
            value = transposed[j, k]
            for i in range(k + 1, n):
                transposed[j, i] -= transposed[k, i] * value
    return False


@kernel(at_once=True)
def factorise(transposed, pivots):
    """LU factors of a matrix whose transpose is given, in place; returns whether it is singular.

    pivots (n,): filled with the row that each row was exchanged with, counted from 0, as `scipy.linalg.lapack` does.
    """
    n = transposed.shape[0]
    found = np.empty(n, dtype=F_INT_nptype)
    state = _getrf(_REAL, n, n, transposed.ctypes, n, found.ctypes)
    for i in range(n):
        pivots[i] = found[i] - 1
    return state != 0


@kernel(at_once=True)
def solve_factorised(transposed, pivots, right):
    """The solution for a right-hand side, in its place; factors as `factorise` leaves them."""
    n = right.shape[0]
    for i in range(n):
        other = pivots[i]
        if other != i:
            right[i], right[other] = right[other], right[i]
    for j in range(n):
        value, column = right[j], transposed[j, j + 1 :]
        below = right[j + 1 :]
        for i in range(below.shape[0]):
            below[i] -= column[i] * value
    for j in range(n - 1, -1, -1):
        value = right[j] / transposed[j, j]
        right[j] = value
        column, above = transposed[j, :j], right[:j]
        for i in range(j):
            above[i] -= column[i] * value


@kernel(fastmath=_FAST)
def solve_transposed(transposed, pivots, right):
    """The solution with the transpose of the matrix, as `solve_factorised`."""
    n = right.shape[0]
    for i in range(n):
        row, above = transposed[i, :i], right[:i]
        total = 0.0
        for j in range(i):
            total += row[j] * above[j]
        right[i] = (right[i] - total) / transposed[i, i]
    for i in range(n - 2, -1, -1):
        row, below = transposed[i, i + 1 :], right[i + 1 :]
        total = 0.0
        for j in range(below.shape[0]):
            total += row[j] * below[j]
        right[i] -= total
    for i in range(n - 1, -1, -1):
        other = pivots[i]
        if other != i:
            right[i], right[other] = right[other], right[i]


def _factorise_interpreted(transposed, pivots):
    """As `factorise`, outside of compiled code: there the function of LAPACK that Numba names does nothing at all."""
    lu, pivots[:], state = lapack.dgetrf(transposed.T, overwrite_a=True)
    transposed[:] = lu.T
    return state != 0


if config.DISABLE_JIT:
    factorise = _factorise_interpreted
elif _getrf is None:
    factorise = factorise_plainly


@kernel()
def leading_block(transposed, pivots, size, columns, corner, corner_pivots):
    """Sign and logarithm of the determinant of the leading block of a factorised matrix, `size` rows and columns.

    Filled: the last columns of the inverse, as rows (k, N), and the factors of their last k entries (k, k); see
    `linear.LeadingBlock`.
    """
    more = columns.shape[0]
    sign, log = determinant_sign(transposed, pivots), log_modulus(transposed)
    for c in range(more):
        for i in range(columns.shape[1]):
            columns[c, i] = 0.0
        columns[c, size + c] = 1.0
        solve_factorised(transposed, pivots, columns[c])
        for i in range(more):
            corner[c, i] = columns[c, size + i]
    if more > 0:
        if factorise_plainly(corner, corner_pivots):
            return 0.0, -math.inf
        sign *= determinant_sign(corner, corner_pivots)
        log += log_modulus(corner)
    return sign, log


@kernel()
def solve_leading(transposed, pivots, columns, corner, corner_pivots, right):
    """The solution with that block; arguments as `leading_block` leaves them."""
    size, more = right.shape[0], columns.shape[0]
    whole = np.zeros(size + more)
    whole[:size] = right
    solve_factorised(transposed, pivots, whole)
    if more > 0:
        last = whole[size:].copy()
        solve_factorised(corner, corner_pivots, last)
        for c in range(more):
            for i in range(size):
                whole[i] -= columns[c, i] * last[c]
    return whole[:size]
