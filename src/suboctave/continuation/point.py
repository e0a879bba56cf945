"""Points of a curve with their tangents: solved for, interpolated, and solved for between two neighbours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.continuation.linear import Factor, cosine, course, distance, length
from suboctave.continuation.newton import Nearby, NewtonOptions, Solved, closely, correct, tangent
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.errors import ConvergenceError


@dataclass(eq=False, slots=True)
class CurvePoint:
    """A point of a curve with its tangent (in u, unit length in scaled arclength); `factor` as in `Solved`, while the
    point is new, and `before` the same point in the weights that it was solved with.
    """

    curve: Curve
    u: Array
    tangent: Array
    weights: Array
    evaluation: Evaluation
    orientation: float
    arclength: float
    iterations: int
    factor: Factor | None = None
    before: CurvePoint | None = None

    @property
    def parameter(self) -> float:
        """Value of the curve's free parameter."""
        return float(self.u[self.curve.parameter])

    @property
    def turned(self) -> CurvePoint:
        """The same, headed the other way."""
        return replace(self, tangent=-self.tangent, orientation=-self.orientation)


def make_point(solved: Solved[Curve], along: Array | None, arclength: float) -> CurvePoint:
    """A solved point with its tangent; `along` (in u) orients it, default: as the row it was solved with."""
    t = tangent(solved)
    sign = solved.factor.sign
    # sign of det [F_u; t]: changes at a branch point that the curve passes straight on. t spans the null space of
    # F_u, so that det [F_u; row] = (row . t) det [F_u; t], and the tangent came out with row . t > 0
    if along is not None and cosine(t, along, solved.weights) < 0.0:
        t, sign = -t, -sign
    s = solved
    return CurvePoint(s.curve, s.u, t, s.weights, s.evaluation, sign, arclength, s.iterations, s.factor)


def solved_point(
    curve: Curve,
    guess: Array,
    row: Array,
    weights: Array,
    newton: NewtonOptions,
    along: Array | None,
    arclength: float,
    spare: float = 0.0,
    near: Nearby | None = None,
) -> CurvePoint:
    """The point of a curve in the plane through a guess across a scaled row, `spare` and `near` as in `newton.correct`;
    solved for in the coordinates in which the curve is regular, where it has its own. May raise ConvergenceError.
    """
    regular = getattr(curve, "regular", None)
    own = None if regular is None else regular(guess)
    if own is not None:
        point: CurvePoint = own.solved_point(guess, row, weights, newton, along, arclength, spare)
        return point
    return make_point(correct(curve, guess, row, weights, newton, spare=spare, near=near), along, arclength)


def between(a: CurvePoint, b: CurvePoint, fraction: float) -> Array:
    """Cubic Hermite interpolation of the curve between two neighbours, in the discretisation of b."""
    ua, ta = b.curve.transfer(a.u, a.curve), b.curve.transfer(a.tangent, a.curve)
    chord = distance(b.u, ua, b.weights)
    s, r = fraction, 1.0 - fraction
    first = s * r * r * chord / length(b.weights * ta)
    last = s * s * r * chord / length(b.weights * b.tangent)
    return (1.0 + 2.0 * s) * r * r * ua + first * ta + s * s * (3.0 - 2.0 * s) * b.u - last * b.tangent


def course_between(a: CurvePoint, b: CurvePoint) -> tuple[float, float, float]:
    """How a curve runs between two neighbours in one discretisation: see `linear.course`."""
    found: tuple[float, float, float] = course(a.tangent, b.tangent, b.u - a.u, b.weights)
    return found


def point_between(
    a: CurvePoint, b: CurvePoint, fraction: float, newton: NewtonOptions, exactly: bool = False
) -> CurvePoint:
    """The point of the curve at a fraction of the way between two neighbours.

    exactly: about as rounding allows. Beside a branch point what is left of the equations moves a point by as much over
    the distance to it, and turns its tangent.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge there.
    """
    guess = between(a, b, fraction)
    chord = b.u - b.curve.transfer(a.u, a.curve)
    row = b.weights * chord
    row /= length(row)
    arclength = a.arclength + fraction * (b.arclength - a.arclength)
    try:
        options = closely(newton) if exactly else newton
        return solved_point(b.curve, guess, row, b.weights, options, chord, arclength, near=b.before or b)
    except ConvergenceError:
        if not exactly:
            raise
        return solved_point(b.curve, guess, row, b.weights, newton, chord, arclength)


def point_ahead(point: CurvePoint, way: float, newton: NewtonOptions) -> CurvePoint:
    """The point of the curve in the plane across the tangent of one, a way along that; may raise ConvergenceError."""
    curve, weights, along = point.curve, point.weights, point.tangent
    row = weights * along
    arclength = point.arclength + way
    return solved_point(curve, point.u + way * along, row / length(row), weights, newton, along, arclength)


def solved_again(
    point: CurvePoint, curve: Curve, weights: Array, newton: NewtonOptions, spare: float = 0.0
) -> CurvePoint:
    """A point solved for in another discretisation of its curve, orthogonally to its tangent; raises ConvergenceError
    where there is none. `spare` as in `newton.correct`.
    """
    u, along = curve.transfer(point.u, point.curve), curve.transfer(point.tangent, point.curve)
    row = weights * along
    return solved_point(curve, u, row / length(row), weights, newton, along, point.arclength, spare)


def crossing_matrix(point: CurvePoint) -> Array:
    """`[F_u; t]`, columns in scaled arclength, rows of unit length: singular where another curve of F = 0 crosses."""
    matrix: Array = np.empty((len(point.u), len(point.u)))
    np.divide(point.evaluation.jacobian, point.weights, out=matrix[:-1])
    np.multiply(point.weights, point.tangent, out=matrix[-1])
    matrix /= np.sqrt(np.einsum("ij,ij->i", matrix, matrix))[:, None]
    return matrix
