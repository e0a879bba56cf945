"""Newton's method for a point of a frequency response in one compiled call.

What `continuation.newton.correct` does step by step, for the common case: the frequency is free, the structure has
matrices of its own, and all laws are known in closed form. There the calls would cost more than what they do.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.continuation.kernels import (
    bordered_transposed,
    determinant_sign,
    distance,
    moved,
    normalised,
    right_hand_side,
)
from suboctave.continuation.lapack import factorise, solve_factorised
from suboctave.continuation.newton import SHORT, STALLED
from suboctave.harmonic.evaluation import evaluate_anew, jacobian

#: how a correction ended: solved; given up without convergence; something the general way knows more about
SOLVED, UNSOLVED, OTHER = 0, 1, 2
_TINY = float(np.finfo(float).tiny)
#: largest relative change of a tangent by a refinement that leaves its square
_CLOSE = 1e-6


@kernel()
def bordered_by_frequency(table, moving, rate, starts, dofs, shape, matrices, multiples, omega, x, row, weights):
    """`ResponseEvaluation.bordered_transposed` along omega, of a structure's own matrices."""
    n = x.shape[0] * x.shape[1]
    extended = np.zeros((n, n + 1))
    # not a literal, for which the Jacobian would be compiled once more
    mean = n > 0
    jacobian(extended, table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x)
    return bordered_transposed(extended, row, weights)


@kernel()
def refined_tangent(transposed, lu, pivots, direction):
    """The solution of `B d = (0, ..., 0, 1)` by the factors of a matrix close by, into `direction`; returns whether
    that goes: one step of iterative refinement squares the distance between the two.

    transposed: B^T; lu, pivots: as `factorise` has left them.
    """
    n = direction.shape[0]
    rest = np.zeros(n)
    rest[n - 1] = 1.0
    for i in range(n):
        direction[i] = rest[i]
    solve_factorised(lu, pivots, direction)
    for j in range(n):
        value = direction[j]
        for i in range(n):
            rest[i] -= transposed[j, i] * value
    solve_factorised(lu, pivots, rest)
    size = change = 0.0
    for i in range(n):
        size += direction[i] * direction[i]
        change += rest[i] * rest[i]
        direction[i] += rest[i]
    return change <= _CLOSE * _CLOSE * size


@kernel()
def corrected(
    guess, row, weights, tolerance, correction, iterations, spare, floor, nu, moving, multiples, matrices, starts, dofs,
    shape, pieces, first, polynomial, grid, nodes, load, weight, points, widths, steps, step_first, line, rule_nodes,
    rule_weights, u, tangent, lu, pivots, blocks, table, motions, parts, sizes, numbers,
):  # fmt: skip
    """Solve `F(u) = 0`, `row . (weights * (u - guess)) = 0` from the guess; returns how that ended.

    Parameters
    ----------
    guess, row, weights, spare
        As in `newton.correct`; tolerance, correction, iterations as in `NewtonOptions`.
    floor
        Least force that a residual is held against, in units of omega^2.
    nu, moving
        Periods of the load in the basis's period; whether a direction has damping.
    multiples, ..., weight
        As in `evaluation.evaluate`; points, ..., rule_weights as in `evaluation.evaluate_told`, or None.
    u, tangent, lu, pivots
        Filled: solution, its unit tangent along the row, factors of the transposed bordered Jacobian at the solution,
        or at an iterate within `spare` of it.
    blocks, table, motions, parts, sizes
        Filled: the evaluation there.
    numbers
        Filled: error, iterations, distance from the guess, contraction, sign of the determinant; (5,).
    """
    n = guess.shape[0]
    for i in range(n):
        u[i] = guess[i]
    error = previous = np.inf
    contraction = before = start = way = 0.0
    factorised = False
    direction = np.empty(n)
    for iteration in range(iterations + 1):
        numbers[1] = iteration
        omega = u[n - 1]
        total = 0.0
        for i in range(n):
            total += u[i] * u[i]
        if not (math.isfinite(total) and omega > 0.0):
            return OTHER
        x = u[: n - 1].reshape(parts.shape[1], parts.shape[2])
        finite, _sampled = evaluate_anew(
            x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
            weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
        )  # fmt: skip
        error = sizes[0] / max(sizes[1] + sizes[2] + sizes[3], floor * omega * omega, _TINY)
        if not (finite and math.isfinite(error)):
            return OTHER
        numbers[0] = error
        settled = previous <= correction or previous * min(contraction, 1.0) <= correction
        done = error <= tolerance and (settled or iteration == 0)
        if iteration == iterations and not done:
            return UNSOLVED
        stale = previous > SHORT or contraction > 0.1 or (spare > 0.0 and 2.0 * error**2 > tolerance * before)
        if done or not factorised or (iteration > 0 and stale):
            found = bordered_by_frequency(
                table, moving, omega / nu, starts, dofs, shape, matrices, multiples, omega, x, row, weights
            )
            if done and factorised and way <= spare and refined_tangent(found, lu, pivots, direction):
                break
            for i in range(n):
                for j in range(n):
                    lu[i, j] = found[i, j]
            if factorise(lu, pivots):
                return OTHER
            factorised = True
            way = 0.0
        if done:
            for i in range(n):
                direction[i] = 0.0
            direction[n - 1] = 1.0
            solve_factorised(lu, pivots, direction)
            break
        before = error
        step = right_hand_side(parts[2].ravel(), row, weights, u, guess)
        solve_factorised(lu, pivots, step)
        further, size = moved(u, step, weights, 1.0)
        way += size
        for i in range(n):
            u[i] = further[i]
        if iteration == 0:
            start = size
        else:
            rate = contraction
            contraction = size / previous if previous > 0.0 else 0.0
            if (contraction > 2.0 and size > start) or min(rate, contraction) > STALLED:
                return UNSOLVED
        previous = size
    numbers[2] = distance(u, guess, weights)
    numbers[3] = contraction
    numbers[4] = determinant_sign(lu, pivots)
    unit = normalised(direction, weights)
    for i in range(n):
        tangent[i] = unit[i]
    return SOLVED
