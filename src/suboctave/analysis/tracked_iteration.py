"""Compiled: one iteration of Newton's method for a point of a curve of limit points or period doublings.

Two kernels, between which and after which the laws and the load at the iterate's parameter are asked for: the equations
at an iterate, which corrects it where the factors at hand will do, and new factors with the correction by them. A third
one goes through all iterations where laws and load follow from numbers that are linear in the parameter.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.analysis.tracked_matrix import gradient_and_matrix
from suboctave.bifurcation.bordered_kernels import LARGE, border, border_again
from suboctave.compiled import kernel
from suboctave.continuation.kernels import determinant_sign, distance, moved, normalised, right_hand_side
from suboctave.continuation.lapack import factorise, solve_factorised
from suboctave.continuation.newton import SHORT, STALLED
from suboctave.harmonic.evaluation import evaluate_anew, jacobian
from suboctave.harmonic.law_changes import add_changes
from suboctave.harmonic.moving_laws import laws_at
from suboctave.harmonic.real_form import linear_rates

#: what an iterate is: solved, with factors at hand or not; given up; something that the general way knows more about;
#: corrected with factors at hand; to be corrected with new ones
SOLVED, LAST, UNSOLVED, OTHER, MOVED, ANEW = 0, 1, 2, 3, 4, 5
#: what an iteration passes on to the next: error, number of the iteration, length of the last step, rate, error before,
#: length of the first step, way from where the factors are those of, whether there are any, whether they are of
#: another solution; for those who count: evaluations, factorisations
ERROR, ITERATION, PREVIOUS, RATE, BEFORE, FIRST, WAY, FACTORS, GIVEN, LOOKS, FACTORISED = range(11)
MEMO = 11
_TINY = float(np.finfo(float).tiny)


@kernel()
def stepped(u, guess, row, weights, residual, value, lu, pivots, memo):
    """One correction with the factors at hand, u in its place; returns whether the iteration goes away, or nowhere.

    residual, value: R, and g in its unit.
    """
    n, unknown = u.shape[0], residual.shape[0]
    whole = np.empty(n - 1)
    for i in range(unknown):
        whole[i] = residual[i]
    whole[unknown] = value
    step = right_hand_side(whole, row, weights, u, guess)
    solve_factorised(lu, pivots, step)
    further, size = moved(u, step, weights, 1.0)
    for i in range(n):
        u[i] = further[i]
    previous, rate = memo[PREVIOUS], memo[RATE]
    if memo[ITERATION] == 0:
        memo[FIRST] = size
    else:
        memo[RATE] = size / previous if previous > 0.0 else 0.0
    memo[PREVIOUS], memo[BEFORE] = size, memo[ERROR]
    memo[WAY] += size
    away = memo[ITERATION] > 0 and memo[RATE] > 2.0 and size > memo[FIRST]
    return away or min(rate, memo[RATE]) > STALLED


@kernel()
def directed(lu, pivots, weights, tangent):
    """The unit tangent along the last row of the factorised matrix, into `tangent`."""
    n = weights.shape[0]
    direction = np.zeros(n)
    direction[n - 1] = 1.0
    solve_factorised(lu, pivots, direction)
    unit = normalised(direction, weights)
    for i in range(n):
        tangent[i] = unit[i]


@kernel(alone=True)
def looked_at(
    u, guess, row, weights, limits, memo, lu, pivots, tangent, left_border, right_border, unit, force, mean,
    frequencies, nu, moving, scale, multiples, matrices, starts, dofs, shape, pieces, first, polynomial, grid, nodes,
    load, weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, blocks, table, motions, parts,
    sizes, operator, border_lu, border_pivots, vectors, numbers,
):  # fmt: skip
    """Evaluate the equations at an iterate u = (X, omega, a parameter), and correct it if the factors at hand will do.

    Parameters
    ----------
    guess, row, weights
        As in `newton.correct`.
    limits
        Tolerance, correction and iterations of `NewtonOptions`, `spare`, least size of forces, (5,).
    memo
        What an iteration passes on to the next, (MEMO,).
    lu, pivots
        Factors of the matrix that `differentiated` makes.
    left_border, right_border, unit, force
        Null vectors of the operator nearby (M,); the units of g, and of its row.
    mean, frequencies, nu, moving, scale
        Whether the operator is J_0, else J_half; its frequencies in units of omega; periods of the load in the basis's;
        whether a direction has damping; weights of the operator's rows (M,).
    multiples, ..., weight and points, ..., rule_weights
        As in `evaluation.evaluate`, and as in `evaluate_told` or None.
    blocks, ..., sizes, operator, border_lu, border_pivots
        Filled: the evaluation; the operator (M, M); the factors of it, or of one nearby, with its borders.
    vectors
        Filled: its right and left null vector, and without the weights g in units of omega^2, (2, M + 1).
    tangent, numbers
        Filled where the point is solved: the unit tangent along the row; distance from the guess, sign of the
        determinant, derivative of g by kappa (imaginary part), (3,).

    Returns
    -------
    What the iterate is (SOLVED, ..., ANEW), and the nodes of the only direction with arctan steps.
    """
    n = parts.shape[1] * parts.shape[2]
    omega = u[n]
    memo[LOOKS] += 1
    total = 0.0
    for i in range(u.shape[0]):
        total += u[i] * u[i]
    if not (math.isfinite(total) and omega > 0.0):
        return OTHER, np.empty((4, 0))
    x = u[:n].reshape((parts.shape[1], parts.shape[2]))
    finite, sampled = evaluate_anew(
        x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
        weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
    )  # fmt: skip
    if not finite:
        return OTHER, sampled
    m = scale.shape[0]
    operator.fill(0.0)
    jacobian(operator, table, moving, omega / nu, mean, starts, dofs, shape, matrices, frequencies, omega, x)
    right, left = vectors[0], vectors[1]
    # after a short step the factors at hand tell g and its vectors in less time than new ones, of a large matrix
    anew = m < LARGE or memo[ITERATION] == 0 or memo[PREVIOUS] > SHORT
    if not anew:
        for i in range(m):
            right[i] /= scale[i]
            left[i] /= scale[i]
        anew = border_again(
            operator, scale, left_border, right_border, omega * omega, border_lu, border_pivots, right, left
        )
    if anew and border(
        operator, scale, left_border, right_border, omega * omega, border_lu, border_pivots, right, left
    ):
        return OTHER, sampled
    for i in range(m):
        right[i] *= scale[i]
        left[i] *= scale[i]
    value = right[m] * omega * omega / unit
    error = max(sizes[0] / max(sizes[1] + sizes[2] + sizes[3], limits[4], _TINY), abs(value))
    if not math.isfinite(error):
        return OTHER, sampled
    memo[ERROR] = error
    tolerance, correction, spare = limits[0], limits[1], limits[3]
    iteration, previous, rate = memo[ITERATION], memo[PREVIOUS], memo[RATE]
    settled = previous <= correction or previous * min(rate, 1.0) <= correction
    if error <= tolerance and (settled or (iteration == 0 and memo[GIVEN] == 0.0)):
        numbers[0] = distance(u, guess, weights)
        if memo[FACTORS] == 0.0 or memo[WAY] > spare:
            return LAST, sampled
        directed(lu, pivots, weights, tangent)
        numbers[1] = determinant_sign(lu, pivots)
        left_form, right_form = left[:m].reshape((-1, x.shape[1])), right[:m].reshape((-1, x.shape[1]))
        numbers[2] = linear_rates(left_form, right_form, mean, frequencies, omega, matrices)[1]
        return SOLVED, sampled
    if iteration == limits[2]:
        return UNSOLVED, sampled
    stale = previous > SHORT or rate > 0.1 or (spare > 0.0 and 2.0 * error * error > tolerance * memo[BEFORE])
    if memo[FACTORS] == 0.0 or (iteration > 0 and stale):
        return ANEW, sampled
    away = stepped(u, guess, row, weights, parts[2].ravel(), value * force, lu, pivots, memo)
    memo[ITERATION] += 1
    return (UNSOLVED if away else MOVED), sampled


@kernel(alone=True)
def differentiated(
    last, u, guess, row, weights, memo, lu, pivots, tangent, unit, force, mean, frequencies, nu, moving, multiples,
    matrices, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps, step_first, line,
    rule_nodes, rule_weights, noted, changed, changed_first, moved_steps, moved_first, moved_line, by_load, motions,
    table, parts, vectors, gx, rates, numbers, extended,
):  # fmt: skip
    """New factors at an iterate that has been looked at; a correction with them or, at the last, the tangent.

    Parameters
    ----------
    last
        Whether the point is solved.
    noted
        The nodes that `looked_at` has returned, if one direction has all steps.
    changed, ..., moved_line
        What the parameter does to the laws, as in `law_changes.add_changes`.
    by_load
        What it does to `F - P` by the load alone, (2 H + 1, n); overwritten.
    gx, rates
        Filled: minus the gradient of g by X (2 H + 1, n); minus that by omega, by the parameter, by kappa (imaginary
        part), (3,).

    extended
        Overwritten, (N - 2, N - 1) for N entries of u.

    The rest as in `looked_at`; returns what the iterate is.
    """
    m, n, size = vectors.shape[1] - 1, parts.shape[1] * parts.shape[2], parts.shape[2]
    omega = u[n]
    x = u[:n].reshape((parts.shape[1], size))
    right, left = vectors[0, :m].reshape((m // size, size)), vectors[1, :m].reshape((m // size, size))
    top = table.shape[2] - 1
    spectra = np.zeros((2, motions.shape[0], top + 1), dtype=np.complex128)
    add_changes(
        motions, changed, changed_first, moved_steps, moved_first, moved_line, grid, noted, points, widths, step_first,
        rule_nodes, rule_weights, spectra[0], spectra[1],
    )  # fmt: skip
    gx.fill(0.0)
    gradient_and_matrix(
        left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
        step_first, line, rule_nodes, rule_weights, noted, top, frequencies, omega, matrices, table, moving, omega / nu,
        multiples, x, spectra[0], spectra[1], by_load, unit, force, row, weights, gx, rates, lu, extended,
    )  # fmt: skip
    if factorise(lu, pivots):
        return OTHER
    memo[FACTORS], memo[WAY] = 1.0, 0.0
    memo[FACTORISED] += 1
    if last:
        directed(lu, pivots, weights, tangent)
        numbers[1] = determinant_sign(lu, pivots)
        numbers[2] = rates[2]
        return SOLVED
    value = vectors[0, m] * omega * omega / unit
    away = stepped(u, guess, row, weights, parts[2].ravel(), value * force, lu, pivots, memo)
    memo[ITERATION] += 1
    return UNSOLVED if away else MOVED


@kernel(alone=True)
def iterated(
    value, linear, rounded, rest, base_load, load_by, load_alone,
    u, guess, row, weights, limits, memo, lu, pivots, tangent, left_border, right_border, unit, force, mean,
    frequencies, nu, moving, scale, multiples, matrices, starts, dofs, shape, pieces, first, polynomial, grid, nodes,
    load, weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, blocks, table, motions, parts,
    sizes, operator, border_lu, border_pivots, vectors, numbers,
    alone, changed, changed_first, moved_steps, moved_first, moved_line, gx, rates, extended,
):  # fmt: skip
    """Newton's method from beginning to end; returns SOLVED, UNSOLVED or OTHER, and the nodes as `looked_at`.

    Parameters
    ----------
    value, linear, rounded, rest
        As in `moving_laws.laws_at`, and the parameter's value where its elements' coefficients are told.
    base_load, load_by, load_alone
        The load at that value and its rate, (2 H + 1, n); the rate's negative, as `differentiated` wants it.
    alone
        Whether one direction has all arctan steps.

    The rest as in `looked_at` and `differentiated`; what belongs to the parameter's value (pieces, load, points,
    widths, steps, line, changed, moved_steps, moved_line) is filled.
    """
    last = u.shape[0] - 1
    none = np.empty((4, 0))
    while True:
        by = u[last] - value
        laws_at(by, linear, rounded, pieces, changed, steps, points, widths, line, rest, moved_steps, moved_line)
        for i in range(load.shape[0]):
            for j in range(load.shape[1]):
                load[i, j] = base_load[i, j] + by * load_by[i, j]
        ended, sampled = looked_at(
            u, guess, row, weights, limits, memo, lu, pivots, tangent, left_border, right_border, unit, force, mean,
            frequencies, nu, moving, scale, multiples, matrices, starts, dofs, shape, pieces, first, polynomial, grid,
            nodes, load, weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, blocks, table,
            motions, parts, sizes, operator, border_lu, border_pivots, vectors, numbers,
        )  # fmt: skip
        if ended in (ANEW, LAST):
            load_alone[:] = -load_by
            noted = sampled if alone else none
            ended = differentiated(
                ended == LAST, u, guess, row, weights, memo, lu, pivots, tangent, unit, force, mean, frequencies, nu,
                moving, multiples, matrices, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points,
                widths, steps, step_first, line, rule_nodes, rule_weights, noted, changed,
                changed_first, moved_steps, moved_first, moved_line, load_alone, motions, table, parts, vectors, gx,
                rates, numbers, extended,
            )  # fmt: skip
        if ended != MOVED:
            return ended, sampled
