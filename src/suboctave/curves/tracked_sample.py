"""A point of a tracked curve with what tests of it ask: null vectors, normal-form coefficients, other determinants.

Besides the points between two neighbours (`continuation`), single ones: the nearest to a guess, and the zero of a
function beside a point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.normal_form.cubic import cubic_coefficient
from suboctave.continuation.linear import Factor, LeadingBlock, length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, make_point
from suboctave.curves.kinds.branch_point import BranchPointEquations
from suboctave.curves.kinds.extremum import ExtremalEquations
from suboctave.curves.kinds.grazing import GrazingEquations
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.floquet import FloquetResult, StabilityMethod
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import truncation
from suboctave.lazy import lazy

#: coefficient of a double multiplier, in units of omega, below which rounding has its say (an undamped structure)
_NOTHING = 1e-9
#: way in scaled arclength within which derivatives count as those of a point that a search begins at
BEGINNING = 1e-5
#: way along a curve, in scaled arclength, that a zero may still be off by the last secant, and the first secant's least
_AT_ZERO, _SECANT = 1e-10, 1e-6
#: share of its first value from which on a function's secants are no rounding
_ROUNDING = 1e-3
#: way along the tangent that leads no further off the curve than rounding, and its product with the secant's length
#: from which on what the secant leaves is less than that
_STRAIGHT, _SURE = 1e-7, 1e-13
#: inverse of the component along the last parameter up to which a curve's direction is found at the first attempt
_STEEP = 100.0
#: shortest corrections towards a curve before a point of it is solved for
_SHORTEST = 6


class TrackedSample:
    """A point of a tracked curve with what the tests ask of it."""

    def __init__(self, point: CurvePoint) -> None:
        assert isinstance(point.curve, MotionProblem)
        assert isinstance(point.evaluation, MotionEvaluation)
        self.point = point
        self.curve = point.curve
        self.evaluation = point.evaluation
        self.state: BalanceState = point.evaluation.state

    @property
    def equations(self) -> SingularEquations | BranchPointEquations:
        """The scalar equations, where they are those of a singular operator."""
        equations = self.evaluation.equations.own
        assert isinstance(equations, SingularEquations | BranchPointEquations)
        return equations

    @lazy
    def slopes(self) -> dict[str, float]:
        """Components of the tangent along the free parameters, by name."""
        names = self.curve.names
        return dict(zip(names, self.point.tangent[-len(names) :].tolist(), strict=True))

    @lazy
    def orbit(self) -> PeriodicOrbit:
        """The motion."""
        state, values = self.state, dict(self.state.values)
        error, neglected = self.evaluation.error, truncation(state)
        return PeriodicOrbit(state.balance, state.x.copy(), state.omega, values, error, neglected, self.curve.adaptive)

    def curve_tangent(self, curve: MotionProblem) -> np.ndarray:
        """The tangent in the discretisation of another point's curve."""
        return curve.transfer(self.point.tangent, self.curve)

    @property
    def kappa(self) -> float:
        """Frequency of the critical perturbation at an NS, else 0."""
        equations = self.evaluation.equations.own
        return equations.kappa if isinstance(equations, SingularEquations) else 0.0

    @property
    def instant_or_frequency(self) -> float:
        """The instant tau in (0, 2 pi) of a grazing, kappa of an NS, else 0."""
        equations = self.evaluation.equations.own
        if isinstance(equations, GrazingEquations):
            return equations.tau % (2.0 * math.pi)
        return self.kappa

    @property
    def vectors(self) -> NullVectors | None:
        """Null vectors of the singular operator, None where there is none."""
        found = getattr(self.evaluation.equations.own, "bordered", None)
        return None if found is None else found.vectors

    @lazy
    def bend(self) -> float:
        """psi . R''[phi, phi] of an LP."""
        equations = self.equations
        return float((equations.gradient[0] @ equations.bordered.right).real)

    @lazy
    def twist(self) -> float:
        """psi . (dJ_kappa/dkappa) phi of an LP, BP or PD; 0 where it is rounding."""
        equations = self.equations
        b = equations.bordered
        size = length(b.left / b.scale) * length(b.right / b.scale) * self.state.omega
        value = float(equations.gradient[2].imag)
        return 0.0 if abs(value) <= _NOTHING * size else value

    @lazy
    def cubic(self) -> float:
        """c3 of a PD, see `bifurcation.normal_form`; psi is not turned, so that it is smooth along the curve."""
        b, by_x = self.equations.bordered, self.equations.gradient[0].real
        by_motion = -by_x.reshape(self.state.x.shape)
        weights = self.point.weights[: self.state.x.size]
        return cubic_coefficient(self.state, b.right, b.left, by_motion, self._plain, weights)

    @lazy
    def coefficient(self) -> float:
        """What decides the normal form: psi . R''[phi, phi] / 2 of an LP, c3 of a PD, psi turned; nan for others."""
        augmentation = self.curve.augmentation.own
        kind = augmentation.kind if isinstance(augmentation, SingularOperator) else Kind.FREE
        if kind is Kind.FREE:
            return float("nan")
        # gradients are those of -psi.J phi: `twist` is the g of normal forms, `bend` has the other sign
        turn = 1.0 if self.twist > 0.0 else -1.0
        return turn * (-0.5 * self.bend if kind is Kind.INTEGER else self.cubic)

    @lazy
    def extreme(self) -> str:
        """On a curve of extrema whether it is a "minimum" or a "maximum", else empty."""
        equations = self.evaluation.equations
        if not isinstance(equations, ExtremalEquations):
            return ""
        return "minimum" if equations.curvature > 0.0 else "maximum"

    @lazy
    def isola(self) -> str:
        """On a curve of extrema of limit points the type of `bifurcation.extremum`, else empty."""
        equations = self.evaluation.equations
        return equations.isola if isinstance(equations, ExtremalEquations) else ""

    def sign(self, operator: Kind) -> float:
        """Sign of det J_0 (Kind.INTEGER) or det J_half (Kind.HALF)."""
        return self._plain.sign if operator is Kind.INTEGER else self._half.sign

    def determinant(self, operator: Kind) -> tuple[float, float]:
        """Sign and logarithm of that determinant; rows of harmonic f in units of mass times `w0^2 (1 + f^2)`."""
        state, size = self.state, self.state.balance.size
        if operator is Kind.INTEGER:
            n = state.balance.dimension
            # its columns are in scaled arclength: the weights are those of the DOFs over the size of the motion
            sign, found = self._plain.sign, self._plain.log_determinant
            found += n * math.log(float(self.point.weights[0]) / float(state.balance.scales()[0][0]))
            masses = state.balance.logarithm_of_masses(n)
        else:
            n = len(self._half.lu)
            sign, found = self._half.sign, self._half.log_determinant
            masses = 2.0 * state.balance.logarithm_of_masses(n)
        units = 2.0 * n * math.log(state.rate) + _frequencies(n, size, operator is Kind.INTEGER) + masses
        return sign, found - units

    @lazy
    def _half(self) -> Factor:
        return Factor.of(self.state.half_jacobian)

    @lazy
    def _plain(self) -> LeadingBlock:
        """J_0, its columns in scaled arclength: the leading block of what the point was solved with."""
        point, size = self.point, self.state.balance.dimension
        whole = point.factor
        if whole is None or whole.singular or len(point.u) > size + 4:
            whole = Factor.of(self.state.jacobian / point.weights[:size])
        return LeadingBlock(whole, size)

    def multipliers_by(self, method: StabilityMethod) -> FloquetResult | None:
        """Multipliers and errors as a method would give them along a curve, None if that is still to be computed."""
        known: FloquetResult | None = self.evaluation.__dict__.get("floquet")
        return known if method.follows_monodromy else None

    @lazy
    def others(self) -> ComplexArray:
        """Multipliers but the one, or the pair, that is critical all along the curve."""
        mu, critical = self.evaluation.floquet.multipliers, self.evaluation.critical
        if critical is None:
            return mu
        distance = np.minimum(np.abs(mu - critical), np.abs(mu - np.conj(critical)))
        nearest = np.argsort(distance, kind="stable")
        result: ComplexArray
        if self.curve.augmentation.name != "NS" and mu[nearest[0]].imag != 0.0:
            # two that are nearly the same came out as a pair, whose sum is known better than either
            pair = np.abs(mu - np.conj(mu[nearest[0]])).argmin()
            beside = 2.0 * mu[nearest[0]].real - critical
            result = np.append(np.delete(mu, [nearest[0], pair]), beside)
        else:
            result = np.delete(mu, nearest[: 2 if self.curve.augmentation.name == "NS" else 1])
        return result


@lru_cache(maxsize=64)
def _frequencies(rows: int, size: int, mean: bool) -> float:
    """Sum of `log (1 + f^2)` over the rows of an operator, f the harmonic of each, whole (mean) or half-odd."""
    k = np.arange(rows) // size
    f = (k + 1) // 2 if mean else k // 2 + 0.5
    return float(np.log(1.0 + f**2).sum())


def same_discretisation(a: TrackedSample, b: TrackedSample, newton: NewtonOptions) -> TrackedSample:
    """The first of two neighbours solved again in the discretisation of the second, where that differs."""
    curve, point = b.curve, a.point
    if a.curve.balance is curve.balance:
        return a
    weights = b.point.weights
    along = curve.transfer(point.tangent, a.curve)
    row = weights * along / length(weights * along)
    solved = correct(curve, curve.transfer(point.u, a.curve), row, weights, newton, spare=BEGINNING)
    return TrackedSample(make_point(solved, curve, along, point.arclength))


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


def null_row(curve: MotionProblem, u: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Unit vector that the scaled Jacobian at u maps to zero: the curve's direction there."""
    jacobian = curve.evaluate(u).jacobian / weights
    last = np.zeros(len(u))
    last[-1] = 1.0
    row = last
    for _ in range(2):
        factor = Factor.of(np.vstack((jacobian, row)))
        found = factor.solve(last) if not factor.singular else None
        if found is None or not np.isfinite(found).all():
            break
        size = length(found)
        row = found / size
        if size < _STEEP:
            return row
        # the second time the row is the direction itself, so that the matrix is as regular as can be
    else:
        return row
    result: np.ndarray = np.linalg.qr(jacobian.T, mode="complete")[0][:, -1]
    return result


def zero_along(
    start: CurvePoint,
    function: Callable[[TrackedSample], float],
    newton: NewtonOptions,
    reach: float,
    slope: float = 0.0,
    iterations: int = 12,
    factor: Factor | None = None,
) -> TrackedSample:
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
    first = value_old = function(TrackedSample(start))
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
        sample = TrackedSample(last)
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
        if abs(change) < _STRAIGHT and abs(change * (s - old)) < _SURE:
            found = _beside(last, -change, newton)
            if found is not None:
                return found
        # on the straight line through the last two, in the plane that belongs to the next
        guess = solved.u - change * (solved.u - before) / (s - old)
        s, old, value_old, before = s - change, s, value, solved.u
        if abs(s) > reach:
            break
    raise ConvergenceError(f"no zero found beside {start.curve.where(start.u)}")


def _beside(point: CurvePoint, way: float, newton: NewtonOptions) -> TrackedSample | None:
    """The point so little further along a curve that its tangent leads there; None if it is no solution."""
    factor, evaluation = point.factor, point.evaluation
    if factor is None or factor.singular:
        return None
    missing: np.ndarray = factor.solve(np.append(evaluation.residual, 0.0)) / point.weights
    u = point.u - missing + way * point.tangent
    evaluation = point.curve.evaluate(u)
    if evaluation.error > newton.tolerance:
        return None
    return TrackedSample(replace(point, u=u, evaluation=evaluation, arclength=point.arclength + way))


__all__ = ["BEGINNING", "TrackedSample", "nearest_point", "null_row", "same_discretisation", "zero_along"]
