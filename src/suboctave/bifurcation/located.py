"""Newton's method for a limit point or a period doubling in one compiled call.

What `solve.newton` does step by step, for the common case: the frequency is free, the structure has matrices of its
own, and all laws are known in closed form. There the calls would cost more than what they do. At a limit point the
factors of the bordered J_0 that give g give the step too (`bordered_kernels.fold_step`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from suboctave.bifurcation.bordered_kernels import (
    LARGE,
    augment,
    border,
    border_again,
    border_at,
    fold_step,
    inverse_iteration,
    unit_of,
)
from suboctave.compiled import kernel
from suboctave.continuation.lapack import solve_factorised
from suboctave.harmonic.evaluation import add_told, along_directions, evaluate, evaluate_told, jacobian
from suboctave.harmonic.group_force import PackedLaws
from suboctave.harmonic.group_kernels import add_pieces
from suboctave.harmonic.real_form import add_steps, closed_gradient

#: how a search ended: solved; given up as `solve.newton` does; something that it knows more about
SOLVED, OFF_AXIS, AWAY, STILL, UNSOLVED, OTHER, GOES_ON = 0, 1, 2, 3, 4, 5, 6


@kernel()
def judged(step, previous, iteration, far, error, tolerance):
    """What a dimensionless step means for the iteration, GOES_ON if it is to be taken; and its length.

    previous: length of the last one; far: one that leads away; error: that before the step.
    """
    moved = 0.0
    for i in range(step.shape[0]):
        moved += step[i] * step[i]
    moved = math.sqrt(moved)
    if not math.isfinite(moved):
        return OTHER, moved
    if iteration > 0 and moved > far:
        return AWAY, moved
    if iteration > 3 and moved > 0.5 * previous and previous > 1e-6:
        return STILL, moved
    if moved <= 1e-12 and error <= tolerance:
        return SOLVED, moved
    return GOES_ON, moved


@kernel(alone=True)
def located(
    u, mean, known, right, left, span, least, limits, iterations, nu, moving, multiples, halves, matrices, starts, dofs,
    shape, pieces, first, polynomial, grid, nodes, load, weight, points, widths, steps, step_first, line, rule_nodes,
    rule_weights, blocks, table, motions, parts, sizes, numbers,
):  # fmt: skip
    """Solve `[R; g] = 0` from u = (X, omega), in its place; returns how that ended.

    Parameters
    ----------
    mean
        Whether g is that of J_0, else of J_half.
    known
        Whether null vectors of the operator nearby are given.
    right, left
        They, in weighted form and of unit length; filled with those at the solution.
    span
        Width of the frequency's range.
    least
        Sizes of motion and forces that count as no smaller, (2,).
    limits
        Tolerance, step at which the iteration has settled, step below which old factors are kept, step that leads
        away, (4,).
    nu, moving, ..., rule_weights
        As in `analysis.corrector.corrected`, with the frequencies of the half-odd basis.
    blocks, table, motions, parts, sizes
        Filled: the evaluation at the solution.
    numbers
        Filled: error, iterations, (2,).
    """
    n, size = u.shape[0] - 1, parts.shape[2]
    m = n if mean else n + size
    frequencies = multiples if mean else halves
    tolerance, small, short, far = limits[0], limits[1], limits[2], limits[3]
    top = table.shape[2] - 1
    scale = np.empty(m)
    for i in range(m):
        scale[i] = weight[i % size]
    # not a literal, for which the Jacobian would be compiled once more
    integer = n > 0
    lu, pivots, v, w = np.empty((m + 1, m + 1)), np.empty(m + 1, dtype=np.int32), np.empty(m + 1), np.empty(m + 1)
    whole, step = np.empty((n, n + 1)), np.empty(n + 1)
    other = np.empty((0, 0)) if mean else np.empty((m, m))
    factors = np.empty((0, 0)) if mean else np.empty((n + 1, n + 1))
    turns = np.empty(n + 1, dtype=np.int32)
    rows, columns = np.empty(n), np.empty(n)
    by_x = np.empty((parts.shape[1], size))
    left_form, right_form = np.empty((m // size, size)), np.empty((m // size, size))
    sampled = [np.empty((4, 0)) for _ in range(motions.shape[0])]
    previous, contraction, unit = np.inf, 0.0, 1.0
    factorised = False
    for iteration in range(iterations + 1):
        numbers[1] = iteration
        omega = u[n]
        if omega <= 0.0:
            return OFF_AXIS
        total = 0.0
        for i in range(n + 1):
            total += u[i] * u[i]
        if not math.isfinite(total):
            return OTHER
        x = u[:n].reshape(parts.shape[1], size)
        for part in range(3):
            for g in range(motions.shape[0]):
                for q in range(top + 1):
                    table[part, g, q] = 0.0
        if points is not None:
            # `evaluate_told`, whose nodes the gradient of g needs as well
            along_directions(x, starts, dofs, shape, motions)
            for g in range(motions.shape[0]):
                low, high = step_first[g], step_first[g + 1]
                if high > low:
                    sampled[g] = add_told(
                        motions[g], points[low:high], widths[low:high], steps[low:high], line[g], grid, rule_nodes,
                        rule_weights, table[0, g], table[1, g],
                    )  # fmt: skip
        finite = evaluate(
            x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
            weight, table, motions, parts, sizes,
        )  # fmt: skip
        if not finite:
            return OTHER
        # J_0, which Newton's step needs, or J_half
        matrix = whole if mean else other
        for i in range(matrix.shape[0]):
            for j in range(matrix.shape[1]):
                matrix[i, j] = 0.0
        jacobian(matrix, table, moving, omega / nu, mean, starts, dofs, shape, matrices, frequencies, omega, x)
        if not known and iteration == 0 and inverse_iteration(matrix, scale, 4, right, left):
            return OTHER
        square = omega * omega
        # after a short step the factors at hand tell g and its vectors in less time than new ones, of a large matrix
        anew = m < LARGE or iteration == 0 or previous > short
        if (anew or border_again(matrix, scale, left, right, square, lu, pivots, v, w)) and border(
            matrix, scale, left, right, square, lu, pivots, v, w
        ):
            return OTHER
        unit_of(v, right)
        unit_of(w, left)
        value = v[m] * square
        force = max(sizes[1] + sizes[2] + sizes[3], least[1])
        error = max(sizes[0] / force, abs(v[m]))
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
        if mean or not factorised or previous > short or contraction > 0.03:
            motion = 0.0
            for r in range(parts.shape[1]):
                for i in range(size):
                    motion += (x[r, i] / weight[i]) ** 2
                    by_x[r, i] = 0.0
            motion = max(math.sqrt(motion), least[0])
            for i in range(n):
                columns[i] = motion * weight[i % size]
                rows[i] = weight[i % size] / force
            unit = square
            for i in range(m):
                right_form[i // size, i % size] = v[i] * scale[i]
                left_form[i // size, i % size] = w[i] * scale[i]
            by_omega, _ = closed_gradient(
                left_form, right_form, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes,
                None, None, None, None, None, None, None, top, frequencies, omega, matrices, by_x,
            )  # fmt: skip
            if points is not None:
                for g in range(motions.shape[0]):
                    low, high = step_first[g], step_first[g + 1]
                    at, along = dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
                    if high > low:
                        add_steps(left_form, right_form, mean, at, along, sampled[g], steps[low:high], by_x)
            for r in range(parts.shape[1]):
                for i in range(size):
                    by_x[r, i] = -by_x[r, i]
            if mean:
                if fold_step(whole, scale, lu, pivots, v, parts[2].ravel(), by_x.ravel(), -by_omega, value, step):
                    return OTHER
                for i in range(n):
                    step[i] /= columns[i]
                step[n] /= span
            else:
                for i in range(n):
                    for j in range(n + 1):
                        whole[i, j] = 0.0
                jacobian(whole, table, moving, omega / nu, integer, starts, dofs, shape, matrices, multiples, omega, x)
                if augment(whole, rows, columns, span, by_x.ravel(), -by_omega, unit, factors, turns):
                    return OTHER
                factorised = True
        if not mean:
            residual = parts[2].ravel()
            for i in range(n):
                step[i] = residual[i] * rows[i]
            step[n] = value / unit
            solve_factorised(factors, turns, step)
        ended, moved = judged(step, previous, iteration, far, error, tolerance)
        if ended != GOES_ON:
            return ended
        contraction = moved / previous if previous > 0.0 else 0.0
        damp = min(1.0, 0.5 / moved) if moved > 0.0 else 1.0
        for i in range(n):
            u[i] -= damp * step[i] * columns[i]
        u[n] -= damp * step[n] * span
        previous = moved
    return UNSOLVED


def located_parts(packed: PackedLaws) -> tuple[Callable[..., Any], ...]:
    """The kernels that are compiled before `located` is, but for those of `real_form.closed_parts`."""
    forces = (evaluate_told,) if packed.told else (evaluate,)
    return (border_at, closed_gradient, *forces, *((add_pieces,) if len(packed.pieces) else ()))


__all__ = ["AWAY", "GOES_ON", "OFF_AXIS", "OTHER", "SOLVED", "STILL", "UNSOLVED", "judged", "located", "located_parts"]
