"""What is looked for along a curve of bifurcations: extrema of its parameters, and points of codimension two.

Functions of the curve's points that change sign:

    extremum of p     component of the tangent along p
    CP                psi . R''[phi, phi] on LP curves; both components of the tangent vanish with it
    R1, R2            psi . (dJ_kappa/dkappa) phi on LP, PD curves: the multiplier is double
    R3, R4            kappa - w0/3, kappa - w0/4 on NS curves
    GPD               the cubic coefficient c3 on PD curves: super- turns into subcritical
    LPPD              det J_half on LP curves, det J_0 on PD curves: the other multiplier is critical too

At a cusp the curve turns in both parameters, which makes no extremum of either: there the tangent's components divided
by the cusp's function keep their signs. (Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., chapters 8, 9.)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from suboctave.analysis.tracked_curve import TrackedCurve, TrackedEvaluation
from suboctave.bifurcation.augmented import SingularEquations, SingularOperator
from suboctave.bifurcation.bordered import NullVectors, bordered, null_vectors
from suboctave.bifurcation.normal_form_real import Expansion
from suboctave.continuation.events import locate_zero
from suboctave.continuation.linear import Factor, length
from suboctave.continuation.march import CurvePoint, make_point
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.errors import ConvergenceError
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.third import Multilinear
from suboctave.lazy import lazy

#: coefficient of a double multiplier, in units of omega, below which rounding has its say (an undamped structure)
_NOTHING = 1e-9


class TrackedSample:
    """A point of a tracked curve with what the tests ask of it."""

    def __init__(self, point: CurvePoint) -> None:
        assert isinstance(point.curve, TrackedCurve)
        assert isinstance(point.evaluation, TrackedEvaluation)
        self.point = point
        self.curve = point.curve
        self.evaluation = point.evaluation
        self.state: BalanceState = point.evaluation.state

    @property
    def equations(self) -> SingularEquations:
        """The scalar equations, where they are those of a singular operator."""
        equations = self.evaluation.equations
        assert isinstance(equations, SingularEquations)
        return equations

    def curve_tangent(self, curve: TrackedCurve) -> np.ndarray:
        """The tangent in the discretisation of another point's curve."""
        return curve.transfer(self.point.tangent, self.curve)

    @property
    def kappa(self) -> float:
        """Frequency of the critical perturbation at an NS, else 0."""
        equations = self.evaluation.equations
        return equations.kappa if isinstance(equations, SingularEquations) else 0.0

    @property
    def vectors(self) -> NullVectors | None:
        """Null vectors of the singular operator, None where there is none."""
        found = getattr(self.evaluation.equations, "bordered", None)
        return None if found is None else found.vectors

    @lazy
    def bend(self) -> float:
        """psi . R''[phi, phi] of an LP."""
        equations = self.equations
        return float((equations.gradient[0] @ equations.bordered.right).real)

    @lazy
    def twist(self) -> float:
        """psi . (dJ_kappa/dkappa) phi of an LP or PD; 0 where it is rounding."""
        equations = self.equations
        b = equations.bordered
        size = length(b.left / b.scale) * length(b.right / b.scale) * self.state.omega
        value = float(equations.gradient[2].imag)
        return 0.0 if abs(value) <= _NOTHING * size else value

    @lazy
    def cubic(self) -> float:
        """c3 of a PD, see `bifurcation.normal_form`; psi is not turned, so that it is smooth along the curve."""
        equations, state = self.equations, self.state
        b, by_x = equations.bordered, equations.gradient[0].real
        by_motion = -by_x.reshape(state.x.shape)
        own = Expansion(state, Kind.HALF, b.right, b.left, 0.0, 0.0, by_motion, 0.0, Multilinear(state))
        return own.cubic(self._other_factor.solve(-0.5 * own.squared()))[0]

    @lazy
    def coefficient(self) -> float:
        """What decides the normal form: psi . R''[phi, phi] / 2 of an LP, c3 of a PD, psi turned; nan for others."""
        augmentation = self.curve.augmentation
        kind = augmentation.kind if isinstance(augmentation, SingularOperator) else Kind.FREE
        if kind is Kind.FREE:
            return float("nan")
        turn = -1.0 if self.twist > 0.0 else 1.0
        return turn * (0.5 * self.bend if kind is Kind.INTEGER else self.cubic)

    @property
    def other(self) -> float:
        """Sign of det J_half of an LP, of det J_0 of a PD."""
        return self._other_factor.sign

    @lazy
    def _other_factor(self) -> Factor:
        limit = self.equations.of.kind is Kind.INTEGER
        return Factor.of(self.state.half_jacobian if limit else self.state.jacobian)


class CurveTest(ABC):
    """One kind of event: a function of the curve's points that changes sign."""

    kind: str

    @abstractmethod
    def value(self, sample: TrackedSample) -> float:
        """The test function; 0 where it says nothing."""

    def within(self, a: TrackedSample, b: TrackedSample) -> CurveTest:
        """The test with a function that is smooth between two neighbours."""
        return self


@dataclass(frozen=True)
class Extremum(CurveTest):
    """The curve turns in one of its parameters."""

    name: str
    kind = "extremum"

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        slope = float(sample.point.tangent[sample.curve.index(self.name)])
        # at a cusp both change sign
        return slope / sample.bend if sample.curve.augmentation.name == "LP" and sample.bend != 0.0 else slope


@dataclass(frozen=True)
class Cusp(CurveTest):
    """Two limit points meet and vanish."""

    kind = "CP"

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        return sample.bend


@dataclass(frozen=True)
class GeneralisedDoubling(CurveTest):
    """The motions that branch off change sides; a curve of their limit points begins."""

    kind = "GPD"

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        # at a fold-flip c3 passes through infinity, and det J_0 through zero
        return sample.cubic * sample.other


@dataclass(frozen=True)
class DoubleMultiplier(CurveTest):
    """R1 on LP curves, R2 on PD curves: a curve of Neimark-Sacker points begins."""

    kind: str

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        return sample.twist


@dataclass(frozen=True)
class Resonance(CurveTest):
    """R3, R4 on NS curves: kappa = w0 / order."""

    order: int

    @property
    def kind(self) -> str:  # type: ignore[override]
        """R3 or R4."""
        return f"R{self.order}"

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        return sample.kappa / sample.state.rate - 1.0 / self.order


@dataclass(frozen=True)
class FoldFlip(CurveTest):
    """Multipliers +1 and -1 at once; between neighbours by g of the other operator with fixed borders."""

    borders: NullVectors | None = None
    operator: Kind = Kind.HALF
    kind = "LPPD"

    def value(self, sample: TrackedSample) -> float:
        """See `CurveTest.value`."""
        if self.borders is None:
            return sample.other
        return float(bordered(sample.state, self.operator, self.borders).g.real)

    def within(self, a: TrackedSample, b: TrackedSample) -> CurveTest:
        """See `CurveTest.within`."""
        operator = Kind.HALF if b.equations.of.kind is Kind.INTEGER else Kind.INTEGER
        return FoldFlip(null_vectors(b.state, operator), operator)


def tests_of(curve: TrackedCurve) -> tuple[CurveTest, ...]:
    """What to look for along a curve, by the kind of its bifurcations."""
    turns = tuple(Extremum(name) for name in curve.names)
    augmentation = curve.augmentation
    if not isinstance(augmentation, SingularOperator):
        return turns
    own: dict[Kind, tuple[CurveTest, ...]] = {
        Kind.INTEGER: (Cusp(), DoubleMultiplier("R1"), FoldFlip()),
        Kind.HALF: (GeneralisedDoubling(), DoubleMultiplier("R2"), FoldFlip()),
        Kind.FREE: (Resonance(3), Resonance(4)),
    }
    return turns + own[augmentation.kind]


@dataclass(frozen=True)
class Found:
    """An event between two neighbours: its test, where it lies, and at an extremum which way the curve turns."""

    test: CurveTest
    sample: TrackedSample
    extreme: str = ""


def events_between(
    a: TrackedSample, b: TrackedSample, tests: tuple[CurveTest, ...], newton: NewtonOptions, warnings: list[str]
) -> list[Found]:
    """Every event between two neighbours in the same discretisation, in the order met."""
    found = []
    for test in tests:
        first, last = test.value(a), test.value(b)
        if not (first * last < 0.0 or (last == 0.0 and first != 0.0)):
            continue
        smooth = test.within(a, b)
        try:
            point = locate_zero(
                a.point,
                b.point,
                smooth.value(a),
                smooth.value(b),
                lambda p, smooth=smooth: smooth.value(TrackedSample(p)),  # type: ignore[misc]
                newton,
            )
        except ConvergenceError as failure:
            warnings.append(f"{test.kind} near {b.curve.where(b.point.u)}: {failure}")
            continue
        found.append(Found(test, TrackedSample(point), _extreme(test, a)))
    return sorted(found, key=lambda item: item.sample.point.arclength)


def _extreme(test: CurveTest, a: TrackedSample) -> str:
    if not isinstance(test, Extremum):
        return ""
    return "maximum" if a.point.tangent[a.curve.index(test.name)] > 0.0 else "minimum"


def same_discretisation(a: TrackedSample, b: TrackedSample, newton: NewtonOptions) -> TrackedSample:
    """The first of two neighbours solved again in the discretisation of the second, where that differs."""
    curve, point = b.curve, a.point
    if a.curve.balance is curve.balance:
        return a
    weights = b.point.weights
    along = curve.transfer(point.tangent, a.curve)
    row = weights * along / length(weights * along)
    solved = correct(curve, curve.transfer(point.u, a.curve), row, weights, newton)
    return TrackedSample(make_point(solved, curve, along, point.arclength))


def nearest_point(curve: TrackedCurve, u: np.ndarray, weights: np.ndarray, newton: NewtonOptions) -> CurvePoint:
    """The point of a curve nearest to a guess close to it.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge.
    """
    row = null_row(curve, u, weights)
    return make_point(correct(curve, u, row, weights, newton), curve, row / weights, 0.0)


def null_row(curve: TrackedCurve, u: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Unit vector that the scaled Jacobian at u maps to zero: the curve's direction there."""
    jacobian = curve.evaluate(u).jacobian / weights
    q = np.linalg.qr(jacobian.T, mode="complete")[0]
    result: np.ndarray = q[:, -1]
    return result


def zero_along(
    start: CurvePoint, test: CurveTest, newton: NewtonOptions, reach: float, iterations: int = 12
) -> TrackedSample:
    """The zero of a test along a curve near one of its points, by secants in arclength.

    Raises
    ------
    ConvergenceError
        If there is none within `reach`.
    """
    curve, weights = start.curve, start.weights
    row = weights * start.tangent
    row = row / length(row)

    def at(s: float) -> TrackedSample:
        solved = correct(curve, start.u + s * row / weights, row, weights, newton)
        return TrackedSample(make_point(solved, curve, start.tangent, s))

    s, old = 0.02 * reach, 0.0
    value_old = test.value(at(0.0))
    for _ in range(iterations):
        sample = at(s)
        value = test.value(sample)
        if value == 0.0 or abs(s - old) < 1e-11:
            return sample
        if value == value_old:
            break
        s, old, value_old = s - value * (s - old) / (value - value_old), s, value
        if abs(s) > reach:
            break
    raise ConvergenceError(f"no {test.kind} found beside {start.curve.where(start.u)}")


__all__ = ["CurveTest", "Found", "TrackedSample", "events_between", "same_discretisation", "tests_of", "zero_along"]
