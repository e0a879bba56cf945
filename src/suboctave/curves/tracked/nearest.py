"""Single points of a curve: the nearest to a guess, and the zero of a function beside a point."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from suboctave.continuation.linear import Factor, length
from suboctave.continuation.newton import NewtonOptions, correct, null_row
from suboctave.continuation.point import CurvePoint, make_point, solved_again
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError

#: way in scaled arclength within which derivatives count as those of a point that a search begins at
BEGINNING = 1e-5
#: way along a curve, in scaled arclength, that a zero may still be off by the last secant, and the first secant's least
_AT_ZERO, _SECANT = 1e-10, 1e-6
#: share of its first value from which on a function's secants are no rounding
_ROUNDING = 1e-3
#: shortest corrections towards a curve before a point of it is solved for
_SHORTEST = 6


def same_discretisation(a: Sample, b: Sample, newton: NewtonOptions) -> Sample:
    """The first of two neighbours solved again in the discretisation of the second, where that differs."""
    if a.curve.balance is b.curve.balance:
        return a
    return a.at(solved_again(a.point, b.curve, b.point.weights, newton, BEGINNING))


def nearest_point(
    curve: MotionProblem,
    u: np.ndarray,
    weights: np.ndarray,
    newton: NewtonOptions,
    along: np.ndarray | None = None,
    spare: float = 0.0,
) -> CurvePoint:
    """The point of a curve nearest to a guess close to it; `along`: its tangent, where that is about known; `spare` as
    in `newton.correct`.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge.
    """
    row = null_row(curve, u, weights) if along is None else weights * along / length(weights * along)
    try:
        return make_point(correct(curve, u, row, weights, newton, spare=spare), curve, row / weights, 0.0)
    except ConvergenceError:
        if along is not None:
            raise
    # the plane through the guess may miss a curve that turns sharply: the shortest corrections lead to it
    for _ in range(_SHORTEST):
        evaluation = curve.evaluate(u)
        factor = Factor.of(np.vstack((evaluation.jacobian / weights, row)))
        if factor.singular:
            break
        u = u - factor.solve(np.append(evaluation.residual, 0.0)) / weights
        row = null_row(curve, u, weights)
    return make_point(correct(curve, u, row, weights, newton), curve, row / weights, 0.0)


def zero_along(
    start: CurvePoint,
    function: Callable[[Sample], float],
    newton: NewtonOptions,
    reach: float,
    slope: float = 0.0,
    iterations: int = 12,
    factor: Factor | None = None,
) -> Sample:
    """The zero of a function along a curve near one of its points, by secants in arclength.

    `slope`: about the derivative of the function by arclength at the zero, 0 if that is not known; `factor`: that of
    the start, if it was solved with about its tangent.

    Raises
    ------
    ConvergenceError
        If there is none within `reach`.
    """
    curve, weights = start.curve, start.weights
    row = weights * start.tangent
    row = row / length(row)
    first = value_old = function(Sample(start))
    known = slope
    step = -value_old / slope if slope != 0.0 else math.inf
    # not so short that the secant would be one through rounding
    s, old = math.copysign(min(max(abs(step), _SECANT), 0.02 * reach), step), 0.0
    guess = start.u + s * row / weights
    before, last = start.u, None
    for iteration in range(iterations):
        try:
            solved = correct(curve, guess, row, weights, newton, factor)
        except ConvergenceError:
            # a curve that turns sharply does not reach as far along one tangent
            if last is not None:
                return zero_along(last, function, newton, reach, known or slope, iterations - iteration)
            if abs(s) < 10.0 * _SECANT:
                raise
            s *= 0.1
            guess = start.u + s * row / weights
            continue
        factor = solved.factor
        last = make_point(solved, curve, start.tangent, start.arclength + s)
        sample = Sample(last)
        value = function(sample)
        if value == value_old and value != 0.0:
            break
        slope = (value - value_old) / (s - old)
        change = value / slope if value != 0.0 else 0.0
        if slope * known < 0.0 and abs(value) > _ROUNDING * abs(first):
            # it turns before it comes to the zero at which it has its slope: the other way lies another one
            change = -2.0 * (s - old)
        if abs(change) < _AT_ZERO:
            return sample
        # on the straight line through the last two, in the plane that belongs to the next
        guess = solved.u - change * (solved.u - before) / (s - old)
        s, old, value_old, before = s - change, s, value, solved.u
        if abs(s) > reach:
            break
    raise ConvergenceError(f"no zero found beside {start.curve.where(start.u)}")
