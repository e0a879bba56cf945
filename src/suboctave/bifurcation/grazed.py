"""Newton's method for a grazing in one compiled call: what `located` is for limit points and period doublings.

R(X, omega) = 0,    u(tau) = b,    du/dtau(tau) = 0,    u = d . x
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.bifurcation.located import GOES_ON, OFF_AXIS, OTHER, SOLVED, UNSOLVED, judged
from suboctave.compiled import kernel
from suboctave.continuation.lapack import factorise, solve_factorised
from suboctave.harmonic.evaluation import evaluate_anew, jacobian


@kernel()
def graze_rows(x, direction, tau, value, slope):
    """Basis functions at an instant and their derivatives by tau into `value`, `slope` (2 H + 1,); returns u, its first
    and second derivative there, and the length of its coefficients. x (2 H + 1, n), direction (n,).
    """
    high = x.shape[0] // 2
    value[0], slope[0] = 1.0, 0.0
    for k in range(1, high + 1):
        c, s = math.cos(k * tau), math.sin(k * tau)
        value[2 * k - 1], value[2 * k] = c, s
        slope[2 * k - 1], slope[2 * k] = -k * s, k * c
    at = rate = bend = total = 0.0
    for r in range(x.shape[0]):
        u = 0.0
        for i in range(x.shape[1]):
            u += direction[i] * x[r, i]
        k = (r + 1) // 2
        at += value[r] * u
        rate += slope[r] * u
        bend -= k * k * value[r] * u
        total += u * u
    return at, rate, bend, math.sqrt(total)


@kernel()
def graze_factors(matrix, rows, columns, span, direction, value, slope, rate, bend, size, lu, pivots):
    """Factors of the dimensionless derivatives of `[R; u - b; u']` by (X, omega, tau); returns whether they are
    singular. matrix: `[R_X, R_omega]`, (N, N + 1); the rest as in `bordered_kernels.augment` and from `graze_rows`.
    """
    n = rows.shape[0]
    for j in range(n):
        for i in range(n):
            lu[j, i] = matrix[i, j] * rows[i] * columns[j]
        along = direction[j % direction.shape[0]] * columns[j] / size
        lu[j, n] = value[j // direction.shape[0]] * along
        lu[j, n + 1] = slope[j // direction.shape[0]] * along
        lu[n, j] = matrix[j, n] * rows[j] * span
        lu[n + 1, j] = 0.0
    lu[n, n] = lu[n, n + 1] = 0.0
    lu[n + 1, n] = rate / size
    lu[n + 1, n + 1] = bend / size
    return factorise(lu, pivots)


@kernel()
def grazed(
    u, direction, level, span, least, limits, iterations, nu, moving, multiples, halves, matrices, starts, dofs, shape,
    pieces, first, polynomial, grid, nodes, load, weight, points, widths, steps, step_first, line, rule_nodes,
    rule_weights, blocks, table, motions, parts, sizes, numbers,
):  # fmt: skip
    """Solve for a grazing from u = (X, omega, tau), in its place; returns how that ended.

    direction, level: d (n,) and b; the rest as in `located.located`.
    """
    n, size = u.shape[0] - 2, parts.shape[2]
    tolerance, small, short, far = limits[0], limits[1], limits[2], limits[3]
    # not a literal, for which the Jacobian would be compiled once more
    integer = n > 0
    matrix, lu, pivots = np.empty((n, n + 1)), np.empty((n + 2, n + 2)), np.empty(n + 2, dtype=np.int32)
    rows, columns, step = np.empty(n), np.empty(n), np.empty(n + 2)
    value, slope = np.empty(parts.shape[1]), np.empty(parts.shape[1])
    previous, contraction, unit = np.inf, 0.0, 1.0
    factorised = False
    for iteration in range(iterations + 1):
        numbers[1] = iteration
        omega = u[n]
        if omega <= 0.0:
            return OFF_AXIS
        total = 0.0
        for i in range(n + 2):
            total += u[i] * u[i]
        if not math.isfinite(total):
            return OTHER
        x = u[:n].reshape(parts.shape[1], size)
        finite, _sampled = evaluate_anew(
            x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
            weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
        )  # fmt: skip
        at, rate, bend, large = graze_rows(x, direction, u[n + 1], value, slope)
        if not (finite and large > 0.0):
            return OTHER
        force = max(sizes[1] + sizes[2] + sizes[3], least[1])
        error = max(sizes[0] / force, max(abs(at - level), abs(rate)) / large)
        numbers[0] = error
        if not math.isfinite(error):
            return OTHER
        settled = previous <= small or (previous <= 1e-5 and error <= 1e-3 * tolerance)
        if error <= tolerance and settled:
            return SOLVED
        if iteration == iterations:
            return UNSOLVED
        if previous <= small:
            # whether that is rounding the general way tells
            return OTHER
        if not factorised or previous > short or contraction > 0.03:
            motion = 0.0
            for r in range(parts.shape[1]):
                for i in range(size):
                    motion += (x[r, i] / weight[i]) ** 2
            motion = max(math.sqrt(motion), least[0])
            for i in range(n):
                columns[i] = motion * weight[i % size]
                rows[i] = weight[i % size] / force
                for j in range(n + 1):
                    matrix[i, j] = 0.0
            unit = large
            jacobian(matrix, table, moving, omega / nu, integer, starts, dofs, shape, matrices, multiples, omega, x)
            if graze_factors(matrix, rows, columns, span, direction, value, slope, rate, bend, unit, lu, pivots):
                return OTHER
            factorised = True
        residual = parts[2].ravel()
        for i in range(n):
            step[i] = residual[i] * rows[i]
        step[n], step[n + 1] = (at - level) / unit, rate / unit
        solve_factorised(lu, pivots, step)
        ended, moved = judged(step, previous, iteration, far, error, tolerance)
        if ended != GOES_ON:
            return ended
        contraction = moved / previous if previous > 0.0 else 0.0
        damp = min(1.0, 0.5 / moved) if moved > 0.0 else 1.0
        for i in range(n):
            u[i] -= damp * step[i] * columns[i]
        u[n] -= damp * step[n] * span
        u[n + 1] -= damp * step[n + 1]
        previous = moved
    return UNSOLVED


__all__ = ["graze_factors", "graze_rows", "grazed"]
