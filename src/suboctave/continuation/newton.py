"""Newton's method for a point of a curve: the equations plus one scalar row.

The row is either the hyperplane through a predicted point orthogonal to the tangent (arclength) or a fixed parameter.
Convergence is judged on the residual (dimensionless) and on the correction (in scaled arclength), both at the final
point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Generic, Protocol, TypeVar

import numpy as np

from suboctave.arguments import Count, Length, Positive, checked
from suboctave.continuation.linear import Factor, distance, length
from suboctave.continuation.problem import Array, Evaluation, Problem
from suboctave.errors import ConvergenceError, InputError
from suboctave.interruption import check_time

#: correction in scaled arclength below which the Jacobian is not computed anew
_SHORT = 1e-3
#: unknowns from which factors cost as much as a correction by old ones, and from there on more as the square; how much
#: of a correction the next one by old factors may be
_DEAR, _SLOWEST = 150, 0.5
#: correction, in units of motions and ranges, that leads away from a guess of a square system; corrections of one after
#: which the rate counts: where two solutions are about to merge the first tell little
_FAR, _TELLING = 4.0, 3
#: rate at which corrections shrink, twice in succession, that comes to nothing: at a corner of the equations Newton's
#: method goes to and fro between its sides
_STALLED = 0.8
#: correction in scaled arclength that rounding of the unknowns makes
_ROUNDING = 1e-13
#: share of the tolerance that `closely` leaves, and its least
_SHARE, _LEAST = 1e-3, 1e-13


@checked(methods=False)
@dataclass(frozen=True)
class NewtonOptions:
    """How a point is solved for.

    tolerance
        Residual in units of the forces that balance, at most.
    correction
        Last correction in scaled arclength, at most (with the convergence rate seen).
    iterations
        Corrections before a step is given up and shortened.
    damped
        Shorten corrections until the residual decreases: for starts from far away.
    longest
        Length in scaled arclength to which corrections are shortened.
    rounding
        Whether the iterate of least residual counts as solved where corrections have come down to rounding of the
        unknowns, if that residual is below the root of the tolerance: right behind a grazing the equations are so steep
        that the last digit of an unknown is more than the tolerance.
    """

    tolerance: Positive = 1e-10
    correction: Positive = 1e-7
    iterations: Count = 8
    damped: bool = False
    longest: Length = math.inf
    rounding: bool = False

    def share(self, size: float) -> float:
        """The share of a correction of some length that is taken."""
        return 1.0 if size <= self.longest else self.longest / size

    def __post_init__(self) -> None:
        if not (self.tolerance < 1e-2 and self.correction < 1.0):
            raise InputError(f"NewtonOptions out of range: {self}; tolerance in (0, 1e-2), correction in (0, 1)")


#: the equations that a point solves
Equations = TypeVar("Equations", bound=Problem)
Equations_co = TypeVar("Equations_co", bound=Problem, covariant=True)


@dataclass(eq=False, slots=True)
class Solved(Generic[Equations_co]):
    """A converged point of `curve`, in whose discretisation u, the evaluation and the weights are. `factor` is the LU
    of the scaled bordered Jacobian at u: columns divided by `weights`.
    """

    curve: Equations_co
    u: Array
    evaluation: Evaluation
    weights: Array
    factor: Factor
    iterations: int
    distance: float


class Nearby(Protocol):
    """A point of a curve: its tangent (in u), and the LU factors that it was solved with, scaled by its weights."""

    @property
    def tangent(self) -> Array: ...

    @property
    def weights(self) -> Array: ...

    @property
    def factor(self) -> Factor | None: ...


@lru_cache(maxsize=16)
def closely(options: NewtonOptions) -> NewtonOptions:
    """The same for points that are wanted about as exactly as rounding allows."""
    return replace(options, tolerance=min(options.tolerance, max(_SHARE * options.tolerance, _LEAST)))


def factorised(evaluation: Evaluation, row: Array | None, weights: Array) -> Factor:
    """Factorise `[F_u; row]`, or F_u alone, with columns scaled to arclength."""
    scaled = np.empty((weights.size, weights.size))
    np.multiply(evaluation.jacobian, 1.0 / weights, out=scaled if row is None else scaled[:-1])
    if row is not None:
        scaled[-1] = row
    return Factor.of(scaled, overwrite=True)


def correct(
    curve: Equations,
    guess: Array,
    row: Array | int | None,
    weights: Array,
    options: NewtonOptions,
    known: Factor | None = None,
    spare: float = 0.0,
    near: Nearby | None = None,
) -> Solved[Equations]:
    """Solve `F(u) = 0`, `row . (weights * (u - guess)) = 0`, starting from the guess.

    Parameters
    ----------
    row
        Scaled row, shape (N + 1,): the unit tangent in scaled variables; or which unknown keeps its value. None where
        there are as many equations as unknowns.
    known
        Factors of a point close by with the same row and weights: for a first correction, which is then made however
        good the guess is.
    spare
        Way in scaled arclength within which the derivatives of an iterate count as those of the point, if the
        evaluation can keep them.
    near
        A point close by: where factors are dear its own are tried first, for as long as corrections shrink.

    Raises ConvergenceError if the iterations do not contract or run out.
    """
    fixed, plane = (row, np.eye(1, len(guess), row)[0]) if isinstance(row, int) else (None, row)
    if near is not None and plane is not None and len(guess) >= 2 * _DEAR:
        early = _beside(curve, guess, plane, weights, options, near)
        if early is not None:
            return early
    return _newton(curve, guess, fixed, plane, weights, options, known, spare)


def _newton(
    curve: Equations,
    guess: Array,
    fixed: int | None,
    plane: Array | None,
    weights: Array,
    options: NewtonOptions,
    known: Factor | None,
    spare: float,
) -> Solved[Equations]:
    """Newton's method for `correct`: the row as numbers, `plane`, or the unknown that is fixed as well."""
    u, last, factor = guess.copy(), None, known
    way, before, contraction, first, previous = 0.0, 0.0, 0.0, 0.0, math.inf
    nearest: Solved[Equations] | None = None
    iteration, cheap = 0, 0 if options.damped else (len(u) // _DEAR) ** 2
    while True:
        check_time()
        evaluation = curve.evaluate(u)
        error = evaluation.error
        if not math.isfinite(error):
            raise ConvergenceError(f"the residual is not finite at {curve.where(u)}")
        # the correction that Newton's method would still make is bounded by the square of the last, seen in its rate
        contracts = contraction < 1.0 and not (options.rounding and contraction == 0.0)
        settled = (previous * contraction if contracts else previous) <= options.correction
        if error <= options.tolerance and (settled or (iteration == 0 and known is None)):
            if factor is None or last is None or way > spare or not _takes_over(evaluation, last):
                factor = factorised(evaluation, plane, weights)
            return Solved(curve, u, evaluation, weights, factor, iteration, distance(u, guess, weights))
        if iteration == options.iterations:
            break
        # after a short step that contracts, the old factors take the next one as far; where that is not far enough, new
        # ones are those of the point as well
        stale = previous > _SHORT or contraction > 0.1 or (spare > 0.0 and 2.0 * error**2 > options.tolerance * before)
        rhs = evaluation.residual if plane is None else _beneath(evaluation.residual, plane.dot(weights * (u - guess)))
        stale, step = stale and iteration > 0, None
        if factor is not None and (not stale or cheap > 0):
            step = factor.solve(rhs)
            if stale and _corrections(length(step), previous, error / options.tolerance) > cheap:
                step = None
        if factor is None or step is None:
            factor, last, way, stale = factorised(evaluation, plane, weights), evaluation, 0.0, False
            step = factor.solve(rhs)
        if factor.singular:
            raise ConvergenceError(f"the equations are singular at {curve.where(u)}")
        if fixed is not None:
            step[fixed] = 0.0  # but for rounding of the factors it is
        size = length(step)
        still = options.rounding and previous <= options.correction and size <= _ROUNDING
        if still and (nearest is None or error < nearest.evaluation.error):
            nearest = Solved(curve, u, evaluation, weights, factor, iteration, distance(u, guess, weights))
        share = _decrease(curve, u, step / weights, error) if options.damped else options.share(size)
        u, way, before = u - share * step / weights, way + share * size, error
        if iteration == 0:
            first = size
        else:
            rate, contraction = contraction, size / previous if previous > 0.0 else 0.0
            lost = (contraction > 2.0 and size > first) or min(rate, contraction) > _STALLED
            if plane is None:
                lost = size > _FAR or (iteration > _TELLING and contraction > 0.5 and previous > _SHORT**2)
            if lost and not options.damped and nearest is None:
                break
        previous = size if share == 1.0 else math.inf
        iteration, cheap = (iteration, cheap - 1) if stale else (iteration + 1, cheap)
    # beside a pole of the equations a rounding of the unknowns moves them by any amount: nothing is solved there
    if nearest is not None and nearest.evaluation.error <= math.sqrt(options.tolerance):
        return nearest
    where = curve.where(guess)
    raise ConvergenceError(
        f"Newton's method did not converge near {where} (residual {error:.1e} after {iteration} iterations)"
    )


def _takes_over(evaluation: Evaluation, other: Evaluation) -> bool:
    """See `Evaluation`."""
    takes_over: Callable[[Evaluation], bool] | None = getattr(evaluation, "takes_over", None)
    return takes_over is not None and takes_over(other)


def _beside(
    curve: Equations, guess: Array, row: Array, weights: Array, options: NewtonOptions, near: Nearby
) -> Solved[Equations] | None:
    """The same by the factors of a point close by alone, None where its own serve better."""
    most, u, previous, contraction = (len(guess) // _DEAR) ** 2, guess, math.inf, 1.0
    factor, along, plane = near.factor, near.tangent, row * weights
    if factor is None or factor.singular or len(along) != len(guess) or options.damped or options.rounding:
        return None
    for iteration in range(most):
        try:
            evaluation = curve.evaluate(u)
        except ConvergenceError:
            return None
        error = evaluation.error
        if not math.isfinite(error):
            return None
        if error <= options.tolerance and previous * contraction <= options.correction:
            factor = factorised(evaluation, row, weights)
            return Solved(curve, u, evaluation, weights, factor, 1, distance(u, guess, weights))
        step = factor.solve(_beneath(evaluation.residual, 0.0)) / near.weights
        # along the tangent, which the equations map to nothing, back into the plane
        step += along * (plane.dot(u - guess - step) / plane.dot(along))
        size = length(weights * step)
        if iteration > 0 and _corrections(size, previous, error / options.tolerance) > most - iteration:
            return None
        contraction = min(1.0, size / previous) if iteration > 0 else 1.0
        u, previous = u - step, size
    return None


def _corrections(size: float, previous: float, error: float) -> float:
    """How many corrections by old factors are left if all shrink as this one does, for an error in tolerances."""
    if not (previous < math.inf and size < _SLOWEST * previous):
        return math.inf
    return math.log(max(error, 1.0)) / math.log(previous / size) if size > 0.0 else 0.0


def _beneath(vector: Array, number: float) -> Array:
    """A vector with a number below it."""
    out = np.empty(vector.size + 1)
    out[:-1], out[-1] = vector, number
    return out


def _decrease(curve: Problem, u: Array, step: Array, error: float) -> float:
    """The share of a correction with which the residual decreases, 1 if the whole of it does."""
    share = 1.0
    while share > 1e-3:
        try:
            if curve.evaluate(u - share * step).error <= (1.0 - 0.1 * share) * error:
                return share
        except ConvergenceError:
            pass
        share *= 0.5
    return 1.0


def tangent(solved: Solved[Equations]) -> Array:
    """Unit tangent in u, normalised in scaled arclength, oriented along the row the point was solved with."""
    rhs = np.zeros(len(solved.u))
    rhs[-1] = 1.0
    if solved.factor.singular:
        raise ConvergenceError("the equations are singular (an undamped resonance, or a body free to move)")
    direction: Array = solved.factor.solve(rhs)
    return direction / (length(direction) * solved.weights)


def null_row(curve: Problem, u: Array, weights: Array) -> Array:
    """Unit vector that the scaled Jacobian at u maps to zero, its last component positive: the curve's direction."""
    row: Array = np.linalg.qr((curve.evaluate(u).jacobian / weights).T, mode="complete")[0][:, -1]
    return math.copysign(1.0, row[-1]) * row
