"""Compiled pieces of bordered systems for real operators: g and its vectors, null vectors, and Newton's steps.

Notation of `bordered`: with weights S (a diagonal matrix) and a size s, the bordered matrix is `[S J S, s b; s c^T,
0]`; its transpose is kept, as in `continuation.lapack`. Arrays in, arrays out.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.continuation.lapack import factorise, solve_factorised, solve_transposed
from suboctave.harmonic.evaluation import jacobian

_FAST = {"reassoc", "contract", "nsz"}
#: rows of a matrix whose factors cost more than their repeated use
LARGE = 80
#: most improvements of a solution with the factors of another matrix, and the change that is rounding
_SWEEPS, _ROUNDING = 3, 1e-16


@kernel()
def border(matrix, scale, left, right, size, lu, pivots, v, u):
    """Solve `[S J S, s b; s c^T, 0] v = (0, s)` and with the transpose for u, b = left and c = right, (N,); returns
    whether that is singular.

    matrix
        J, (N, N), or with columns more.
    lu, pivots, v, u
        Filled: factors, (N + 1, N + 1) and (N + 1,); the solutions (N + 1,), whose last entries are g / s.
    """
    n = scale.shape[0]
    for j in range(n):
        for i in range(n):
            lu[j, i] = matrix[i, j] * (scale[i] * scale[j])
        lu[j, n] = size * right[j]
        lu[n, j] = size * left[j]
        v[j] = u[j] = 0.0
    lu[n, n] = 0.0
    if factorise(lu, pivots):
        return True
    v[n] = u[n] = size
    solve_factorised(lu, pivots, v)
    solve_transposed(lu, pivots, u)
    return False


@kernel(fastmath=_FAST)
def _lacking(matrix, scale, left, right, size, v, out):
    """`(0, s) - B v` into `out` (N + 1,), B the bordered matrix."""
    n = scale.shape[0]
    z, last = np.empty(n), 0.0
    for j in range(n):
        z[j] = scale[j] * v[j]
        last += right[j] * v[j]
    for i in range(n):
        row, total = matrix[i, :n], 0.0
        for j in range(n):
            total += row[j] * z[j]
        out[i] = -scale[i] * total - size * left[i] * v[n]
    out[n] = size - size * last


@kernel(fastmath=_FAST)
def _lacking_transposed(matrix, scale, left, right, size, u, out):
    """`(0, s) - B^T u` into `out` (N + 1,)."""
    n = scale.shape[0]
    above, last = out[:n], 0.0
    for j in range(n):
        above[j] = 0.0
    for i in range(n):
        row, factor = matrix[i, :n], scale[i] * u[i]
        last += left[i] * u[i]
        for j in range(n):
            above[j] -= row[j] * factor
    for j in range(n):
        above[j] = above[j] * scale[j] - size * right[j] * u[n]
    out[n] = size - size * last


@kernel()
def border_again(matrix, scale, left, right, size, lu, pivots, v, u):
    """`border` from v and u of a matrix nearby and its factors, which are kept: solutions improved until what is
    missing is rounding. Returns whether that takes more than new factors.
    """
    n = scale.shape[0]
    change = np.empty(n + 1)
    for transposed in range(2):
        y = u if transposed else v
        previous = 1e-6
        for sweep in range(_SWEEPS):
            if transposed:
                _lacking_transposed(matrix, scale, left, right, size, y, change)
                solve_transposed(lu, pivots, change)
            else:
                _lacking(matrix, scale, left, right, size, y, change)
                solve_factorised(lu, pivots, change)
            moved = whole = 0.0
            for i in range(n + 1):
                y[i] += change[i]
                moved += change[i] * change[i]
                whole += y[i] * y[i]
            moved = math.sqrt(moved / whole) if whole > 0.0 else np.inf
            # the next change is as much smaller as this one has been
            if moved * moved <= _ROUNDING * previous:
                break
            if not moved <= 1e-2 or sweep == _SWEEPS - 1:
                return True
            previous = moved
    return False


@kernel()
def border_at(
    table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x, scale, left, right, size, matrix, lu,
    pivots, v, u,
):  # fmt: skip
    """`border` of a motion's operator, J_0 (mean) or J_half, which `matrix` (zeros before) gets; arguments from `table`
    to `x` as in `evaluation.jacobian`.
    """
    jacobian(matrix, table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x)
    return border(matrix, scale, left, right, size, lu, pivots, v, u)


@kernel()
def unit_of(vector, out):
    """The first entries of a vector with unit length, into `out` (N,)."""
    total = 0.0
    for i in range(out.shape[0]):
        total += vector[i] * vector[i]
    total = math.sqrt(total)
    for i in range(out.shape[0]):
        out[i] = vector[i] / total


@kernel()
def inverse_iteration(matrix, scale, iterations, right, left):
    """Singular vectors of the smallest singular value of S J S into `right` and `left` (N,); returns whether that
    failed, as the matrix is singular to the last digit.
    """
    n = scale.shape[0]
    lu, pivots = np.empty((n, n)), np.empty(n, dtype=np.int32)
    for j in range(n):
        for i in range(n):
            lu[j, i] = matrix[i, j] * (scale[i] * scale[j])
    if factorise(lu, pivots):
        return True
    work = np.empty(n)
    # a start with a component along everything, the same in every run
    for i in range(n):
        work[i] = math.cos(i * 1.7 + 0.3) / (1.0 + i / 8.0)
    for _ in range(iterations):
        unit_of(work, right)
        solve_factorised(lu, pivots, right)
        unit_of(right, left)
        for i in range(n):
            work[i] = left[i]
        solve_transposed(lu, pivots, work)
    unit_of(right, right)
    unit_of(work, left)
    total = 0.0
    for i in range(n):
        total += right[i] + left[i]
    return not math.isfinite(total)


@kernel()
def fold_step(matrix, scale, lu, pivots, v, residual, by_x, by_parameter, g, step):
    """Newton's step for `[R; g] = 0` from the factors of the bordered J_0, which is regular where J_0 is not; into
    `step` (N + 1,); returns whether it is not defined.

    With `B [y; s] = [S r; 0]`, `B [z; t] = [S R_p; 0]` and v, the step along X is `S (y - d z + a v)`: d, that along
    the parameter, and a follow from the two equations `s - d t + a v_N = 0` and `g_X . step + g_p d = g`.

    matrix
        `[R_X, R_p]`, (N, N + 1).
    lu, pivots, v
        As `border` leaves them.
    by_x, by_parameter
        Gradient of g.
    """
    n = scale.shape[0]
    y, z = np.zeros(n + 1), np.zeros(n + 1)
    for i in range(n):
        y[i] = scale[i] * residual[i]
        z[i] = scale[i] * matrix[i, n]
    solve_factorised(lu, pivots, y)
    solve_factorised(lu, pivots, z)
    along_y = along_z = along_v = 0.0
    for i in range(n):
        slope = by_x[i] * scale[i]
        along_y += slope * y[i]
        along_z += slope * z[i]
        along_v += slope * v[i]
    determinant = -z[n] * along_v - v[n] * (by_parameter - along_z)
    if determinant == 0.0 or not math.isfinite(determinant):
        return True
    d = (-y[n] * along_v - v[n] * (g - along_y)) / determinant
    a = (-z[n] * (g - along_y) + y[n] * (by_parameter - along_z)) / determinant
    for i in range(n):
        step[i] = scale[i] * (y[i] - d * z[i] + a * v[i])
    step[n] = d
    return False


@kernel()
def augment(matrix, rows, columns, span, by_x, by_parameter, size, lu, pivots):
    """Factors of `[R_X, R_p; g_X, g_p]` in dimensionless rows and unknowns into `lu`, `pivots` (N + 1, N + 1 and
    N + 1); returns whether it is singular.

    matrix: `[R_X, R_p]`, (N, N + 1); rows, columns (N,): factors of the equations and units of X; span, size: units of
    p and g.
    """
    n = rows.shape[0]
    for j in range(n):
        for i in range(n):
            lu[j, i] = matrix[i, j] * rows[i] * columns[j]
        lu[j, n] = by_x[j] * columns[j] / size
        lu[n, j] = matrix[j, n] * rows[j] * span
    lu[n, n] = by_parameter * span / size
    return factorise(lu, pivots)


__all__ = ["augment", "border", "border_again", "border_at", "fold_step", "inverse_iteration", "unit_of"]
