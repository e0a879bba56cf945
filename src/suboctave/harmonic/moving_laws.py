"""Compiled: laws known in closed form at a value of a parameter that their coefficients are linear in."""

from __future__ import annotations

from suboctave.compiled import kernel
from suboctave.model import rounding

__all__ = ["laws_at"]

_at_rest = kernel(at_once=True)(rounding.at_rest)
_at_rest_by_gap = kernel(at_once=True)(rounding.at_rest_by_gap)
_at_rest_by_sharpness = kernel(at_once=True)(rounding.at_rest_by_sharpness)


@kernel()
def laws_at(by, linear, rounded, pieces, changed, steps, points, widths, line, rest, moved_steps, moved_line):
    """The laws where the parameter is `by` larger than where its elements' coefficients are told, and its effect there.

    Parameters
    ----------
    linear
        Pieces of piecewise-linear laws with the parameter: number among all, side, stiffness, gap and their rates,
        (M, 6); None without any.
    rounded
        Rounded stops with the parameter: number among all steps, direction, side, stiffness, gap, sharpness and their
        rates, (R, 9); None without any.
    rest
        Constant and slope along every direction of the arctan steps' laws without the parameter, (G, 2).
    pieces, changed
        Filled, but for laws without the parameter: pieces as in `evaluation.evaluate`; `law_changes.add_changes`'s.
    steps, points, widths, line, moved_steps, moved_line
        The same for arctan steps.
    """
    if linear is not None:
        for r in range(linear.shape[0]):
            number, side, stiffness, gap, by_stiffness, by_gap = linear[r]
            stiffness += by * by_stiffness
            gap += by * by_gap
            at = int(number)
            pieces[at, 0] = changed[r, 0] = stiffness
            pieces[at, 1] = changed[r, 1] = gap
            changed[r, 2], changed[r, 3], changed[r, 4] = side, by_stiffness, by_gap
    if rounded is not None:
        line[:] = rest
        moved_line.fill(0.0)
        for r in range(rounded.shape[0]):
            number, direction, side, k, b, s, k_by, b_by, s_by = rounded[r]
            k += by * k_by
            b += by * b_by
            s += by * s_by
            at, g = int(number), int(direction)
            points[at] = steps[at, 0] = moved_steps[r, 0] = b
            widths[at] = steps[at, 1] = moved_steps[r, 1] = 1.0 / s
            steps[at, 2] = moved_steps[r, 2] = side * k
            moved_steps[r, 3], moved_steps[r, 4], moved_steps[r, 5] = b_by, -s_by / (s * s), side * k_by
            constant = _at_rest(side, b, s) - 0.5 * side * b
            line[g, 0] += k * constant
            line[g, 1] += 0.5 * k
            by_gap = _at_rest_by_gap(side, b, s) - 0.5 * side
            moved_line[g, 0] += k_by * constant + k * (b_by * by_gap + s_by * _at_rest_by_sharpness(side, b, s))
            moved_line[g, 1] += 0.5 * k_by
