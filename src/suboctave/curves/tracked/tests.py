"""Test functions along a curve of bifurcations: extrema of its parameters, and points of codimension two.

    extremum of p     component of the tangent along p; on ridges of the amplitude: its change over that of p
    CP                psi . R''[phi, phi] on LP curves; both components of the tangent vanish with it
    R1, R2            psi . (dJ_kappa/dkappa) phi on LP, PD curves: the multiplier is double
    R3, R4            kappa - w0/3, kappa - w0/4 on NS curves
    GPD               the cubic coefficient c3 on PD curves: super- turns into subcritical
    LPPD              det J_half on LP curves, det J_0 on PD curves: the other multiplier is critical too
    LPNS, PDNS        det J_0, det J_half on NS curves; the number of multipliers outside the unit circle on LP, PD
                      curves, as of NS points along a branch: a complex pair passes it
    NSNS              the same on NS curves
    LP, BP, PD, NS    the same on curves of motions that need no critical multiplier (`MOTION_KINDS`)
    LPPD, LPNS        of limit cycles, where J_0 is singular all along: det [R_X R_omega; phase condition]; LPPD of
                      conservative modes: the same bordered by R_zeta and the derivatives of the action
    LP, BP            of motions of a free phase, where J_0 is singular all along: the last parameter turns, of
                      conservative modes the action; the orientation of the curve changes

The multiplier or the pair that is critical all along the curve is not counted. Two real multipliers whose product
passes one (a neutral saddle) stay where they are. (Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., chapters
8, 9.)
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, bordered, null_vectors, transversality
from suboctave.bifurcation.measures import crossing_pair
from suboctave.continuation.linear import Factor, length
from suboctave.continuation.point import crossing_matrix
from suboctave.curves.kinds.branch_point import BranchPointUnfolded
from suboctave.curves.kinds.free_phase import FreePhaseOperator
from suboctave.curves.kinds.nonlinear_mode import NonlinearMode
from suboctave.curves.kinds.ridge import Ridge, RidgeEquations
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.floquet.symmetric import symmetric_functions
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.perturbation import Kind
from suboctave.kinds import MOTION_KINDS

#: component of the tangent in scaled arclength up to which it may be rounding
_LEVEL = 1e-9
#: distance of the other multiplier from +1 or -1 at a point where det J_0 or det J_half vanishes
_CRITICAL = 0.1
#: share of a parameter's forces along the left null vector below which it does not move the multiplier
_TRANSVERSAL = 1e-6
#: distance of the critical pair from there within which that is asked for
_RESONANT = 0.5
#: corrections of kappa, and their size in units of the base frequency, after which it is known
_CORRECTIONS, _KNOWN = 6, 1e-11
#: distance of that kappa from the one of the multipliers, in the same units, at which it belongs to another pair, and
#: of that pair's growth from that of the multipliers, as a share
_STRAYED, _AGREES = 0.1, 0.25
#: least singular value of a crossing matrix above which no curves cross
_CROSSED = 1e-5
#: logarithm of a determinant, in units of those at the ends of a step, up to which it counts
_LARGE = 300.0
#: logarithm of a pair's modulus up to which it may be on the unit circle
_ON_IT = 0.03


class CurveTest(ABC):
    """One kind of event: a function of the curve's points that changes sign; `kind` is what the events are called."""

    kind: str
    #: whether a crossing of curves that a symmetry brings about changes its sign as well
    at_crossings: bool = False
    #: whether its function is a coefficient of third order, which converges more slowly than the motion
    of_third_order: bool = False

    @abstractmethod
    def value(self, sample: Sample) -> float:
        """The test function; 0 where it says nothing."""

    def changed(self, a: Sample, b: Sample) -> bool:
        """Whether it changes sign between two neighbours. A zero has the sign of its sign bit: walked either way from
        a point at which it vanishes, a curve has the event once.
        """
        first, last = self.value(a), self.value(b)
        product = first * last
        return product < 0.0 or (product == 0.0 and math.copysign(1.0, first) != math.copysign(1.0, last))

    def within(self, a: Sample, b: Sample) -> CurveTest:
        """The test with a function that is smooth between two neighbours."""
        return self

    def smooth(self, sample: Sample) -> tuple[float, float]:
        """Sign and logarithm of the modulus of a function that vanishes with it, smooth along the whole curve."""
        value = self.value(sample)
        return (1.0 if value > 0.0 else -1.0), _logarithm(value)

    def genuine(self, sample: Sample) -> bool:
        """Whether what was located is an event."""
        return True

    def still(self, sample: Sample) -> bool:
        """Whether the function is zero but for rounding, and may be all along a part of the curve."""
        return False

    def extreme(self, before: float, at: Sample) -> str:
        """Whether a parameter that turns has a maximum or a minimum, empty for other events; before: the sign before
        it.
        """
        return ""

    def confirmed(self, sample: Sample) -> bool:
        """Whether multipliers, which depend little on the harmonics kept, agree with an event as it is reported."""
        return True


@dataclass(frozen=True)
class Extremum(CurveTest):
    """The curve turns in one of its parameters."""

    name: str
    kind = "extremum"
    at_crossings = True

    def value(self, sample: Sample) -> float:
        slope = sample.slopes[self.name]
        return slope / sample.bend if self.beside_cusps(sample) else slope

    @staticmethod
    def beside_cusps(sample: Sample) -> bool:
        """Whether both parameters turn where the cusp's function vanishes, which it does not do here."""
        augmentation = sample.curve.augmentation
        return augmentation.own.name == "LP" and not augmentation.turning and sample.bend != 0.0

    def extreme(self, before: float, at: Sample) -> str:
        rising = before * at.bend if self.beside_cusps(at) else before
        return "maximum" if rising > 0.0 else "minimum"

    def changed(self, a: Sample, b: Sample) -> bool:
        return not (self.still(a) and self.still(b)) and super().changed(a, b)

    def still(self, sample: Sample) -> bool:
        return stands(sample, self.name)

    def smooth(self, sample: Sample) -> tuple[float, float]:
        # at a cusp it vanishes as well; the same all along a parameter that stays as it is
        if stands(sample, self.name):
            return 1.0, _logarithm(_LEVEL)
        slope = _slope(sample, self.name)
        return math.copysign(1.0, slope), _logarithm(slope)


def _slope(sample: Sample, name: str) -> float:
    """Component of the tangent along a parameter, in units of the oscillation: it does not vanish with that."""
    return sample.slopes[name] / sample.oscillation if sample.oscillation > 0.0 else sample.slopes[name]


def stands(sample: Sample, name: str) -> bool:
    """Whether a parameter stays as it is along the curve but for rounding."""
    weight = float(sample.point.weights[sample.curve.index(name)])
    return abs(_slope(sample, name) * weight) < _LEVEL


@dataclass(frozen=True)
class TurningPoint(Extremum):
    """The limit point of motions of a free phase: their parameter turns."""

    kind = "LP"


@dataclass(frozen=True)
class PeakTurns(CurveTest):
    """The peaks that a ridge consists of are highest or lowest over its last parameter. Where that turns, either a peak
    and a valley meet, and the amplitude turns with it, or a closed response has its peak and its valley in one point:
    neither is an extremum over the parameter.
    """

    name: str = "amplitude"
    kind = "extremum"

    @staticmethod
    def _rates(sample: Sample) -> tuple[float, float]:
        """Of the amplitude, relative to it, and of the parameter, in units of its range, along the curve."""
        equations, name = sample.evaluation.equations.own, sample.curve.name
        assert isinstance(equations, RidgeEquations)
        weight = float(sample.point.weights[sample.curve.index(name)])
        return equations.rate(sample.point.tangent), weight * sample.slopes[name]

    def value(self, sample: Sample) -> float:
        rate, slope = self._rates(sample)
        size = rate * rate + slope * slope
        return rate * slope / size if size > 0.0 else math.nan

    def genuine(self, sample: Sample) -> bool:
        rate, slope = self._rates(sample)
        return abs(rate) < abs(slope)

    def extreme(self, before: float, at: Sample) -> str:
        return "maximum" if before * at.slopes[at.curve.name] > 0.0 else "minimum"


@dataclass(frozen=True)
class ActionTurns(CurveTest):
    """The limit point of conservative modes: action and energy turn, `dE = omega dJ`, and beside the two multipliers
    that are +1 by themselves two more are. Where omega turns instead there are none.
    """

    kind = "LP"
    at_crossings = True

    def value(self, sample: Sample) -> float:
        return sample.action_slope


@dataclass(frozen=True)
class CurvesCross(CurveTest):
    """Another curve of the same equations crosses: the orientation changes. Between neighbours by the determinant of
    the equations with the tangent as their last row, all rows of unit length; `unit`: the logarithm of its size there.
    """

    kind = "BP"
    unit: float | None = None

    def value(self, sample: Sample) -> float:
        if self.unit is None:
            return sample.point.orientation
        sign, size = self._determinant(sample)
        return sign * math.exp(min(size - self.unit, _LARGE))

    def within(self, a: Sample, b: Sample) -> CurveTest:
        # where it is located again the function keeps its unit, of which nothing is left there
        return self if a is b else replace(self, unit=max(self._determinant(sample)[1] for sample in (a, b)))

    @staticmethod
    def _determinant(sample: Sample) -> tuple[float, float]:
        """Sign and logarithm of that of the crossing matrix, with the phase of the motion itself: that of reference may
        change along the curve.
        """
        point, state = sample.point, sample.state
        matrix, n = crossing_matrix(point), state.balance.dimension
        matrix[n] = 0.0
        matrix[n, :n] = point.weights[:n] * state.basis.derivative(state.x).ravel()
        matrix[n] /= length(matrix[n]) or 1.0
        matrix[-1] -= (matrix[-1] @ matrix[n]) * matrix[n]
        matrix[-1] /= length(matrix[-1]) or 1.0
        factor = Factor.of(matrix, overwrite=True)
        return factor.sign, factor.log_determinant

    def smooth(self, sample: Sample) -> tuple[float, float]:
        if isinstance(sample.curve.augmentation, NonlinearMode) or stands(sample, sample.curve.name):
            return self._determinant(sample)
        # what more harmonics do to a determinant is no matter of the motion; the parameter turns where it vanishes, too
        _, size = symmetric_functions(sample.others)[:, 0].tolist()
        # the square of the oscillation is in them where cycles shrink to an equilibrium
        size -= _logarithm(sample.oscillation) + _logarithm(_slope(sample, sample.curve.name))
        return sample.point.orientation, size

    def genuine(self, sample: Sample) -> bool:
        """See `CurveTest.genuine`; raises ConvergenceError where no curves cross."""
        least = float(np.linalg.svd(crossing_matrix(sample.point), compute_uv=False)[-1])
        if least > _CROSSED:
            raise ConvergenceError("the orientation changes, and no curves cross: the curve may have jumped to another")
        return True


@dataclass(frozen=True)
class Cusp(CurveTest):
    """Two limit points meet and vanish."""

    kind = "CP"

    def value(self, sample: Sample) -> float:
        return sample.bend

    def smooth(self, sample: Sample) -> tuple[float, float]:
        sign, size = super().smooth(sample)
        return sign, size - sample.brevity


@dataclass(frozen=True)
class GeneralisedDoubling(CurveTest):
    """The motions that branch off change sides; a curve of their limit points begins."""

    kind = "GPD"
    of_third_order = True

    def value(self, sample: Sample) -> float:
        # at a fold-flip c3 passes through infinity, and det J_0 through zero
        return sample.cubic * sample.fold[0]

    def smooth(self, sample: Sample) -> tuple[float, float]:
        sign, size = super().smooth(sample)
        # short contacts enter by the third derivative
        return sign, size + sample.fold[1] - 3.0 * sample.brevity


@dataclass(frozen=True)
class SidesChange(CurveTest):
    """GPF on curves of pitchforks, GH on those of Hopf points: the motions that begin there change sides, a curve of
    their limit points begins. `c3`: the coefficient that vanishes, 0 all along where it says nothing.
    """

    kind: str
    c3: Callable[[Sample], float]
    of_third_order = True

    def value(self, sample: Sample) -> float:
        return self.c3(sample)

    def smooth(self, sample: Sample) -> tuple[float, float]:
        return super().smooth(sample) if self.c3(sample) else (1.0, 0.0)


#: c3 is kept by the sample
_PITCHFORKS, _HOPF_POINTS = SidesChange("GPF", lambda s: s.pitchfork), SidesChange("GH", lambda s: s.lyapunov)


@dataclass(frozen=True)
class DoubleMultiplier(CurveTest):
    """R1 on LP curves, R2 on PD curves: a curve of Neimark-Sacker points begins."""

    kind: str

    def value(self, sample: Sample) -> float:
        return sample.twist

    def genuine(self, sample: Sample) -> bool:
        """See `CurveTest.genuine`; raises ConvergenceError where the multipliers contradict."""
        critical = 1.0 if self.kind == "R1" else -1.0
        apart = np.sort(np.abs(sample.evaluation.floquet.multipliers - critical))
        if apart[1] > _RESONANT:
            raise ConvergenceError(
                f"the equations have a double multiplier {critical:+.0f} there, the monodromy matrix has none "
                f"(the second lies {apart[1]:.2g} away): too few harmonics are kept"
            )
        return True


@dataclass(frozen=True)
class Resonance(CurveTest):
    """R3, R4 on NS curves: kappa = w0 / order."""

    kind: str
    order: int

    def value(self, sample: Sample) -> float:
        share = sample.kappa / sample.state.rate
        # beyond w0/2 the other one of the pair has the smaller kappa
        return min(share, 1.0 - share) - 1.0 / self.order


@dataclass(frozen=True)
class RealCrossing(CurveTest):
    """Another multiplier passes +1 (Kind.INTEGER) or -1 (Kind.HALF): LPPD on LP and PD curves, LPNS and PDNS on NS
    curves; between neighbours by g of that operator with fixed borders.
    """

    kind: str
    operator: Kind
    borders: NullVectors | None = None

    def value(self, sample: Sample) -> float:
        if self.borders is None:
            return sample.sign(self.operator)
        border = bordered(sample.state, self.operator, self.borders)
        # of the sign of the determinant, whichever way the null vectors point: more harmonics may turn them
        return float(border.g.real) * border.factor.sign

    def within(self, a: Sample, b: Sample) -> CurveTest:
        return replace(self, borders=null_vectors(b.state, self.operator))

    @property
    def _target(self) -> float:
        return 1.0 if self.operator is Kind.INTEGER else -1.0

    def smooth(self, sample: Sample) -> tuple[float, float]:
        # without the factor of the pair that an NS curve follows, which may pass there
        sign, size = sample.determinant(self.operator)
        critical = sample.evaluation.critical
        return sign, size if critical is None else size - 2.0 * _logarithm(abs(critical - self._target))

    def genuine(self, sample: Sample) -> bool:
        # close to R1 and R2 the pair that an NS curve follows is critical itself
        if self.kind == "LPPD":
            return True
        target, critical = self._target, sample.evaluation.critical
        apart = critical is None or abs(critical - target) > _RESONANT
        error = float(sample.evaluation.floquet.errors.max(initial=0.0))
        return apart or bool(np.any(np.abs(sample.others - target) < _CRITICAL + error))


@dataclass(frozen=True)
class FoldOfCycles(CurveTest):
    """A second multiplier of limit cycles is +1: LPPD on curves of their PD, LPNS on those of their NS. J_0, which is
    singular all along, is bordered by the phase condition and R_omega; `unit`: the logarithm of its size between
    neighbours.
    """

    kind: str
    unit: float = 0.0

    def value(self, sample: Sample) -> float:
        sign, size = sample.fold_of_cycles
        return sign * math.exp(min(size - self.unit, _LARGE))

    def within(self, a: Sample, b: Sample) -> CurveTest:
        # where it is located again the function keeps its unit
        return self if a is b else replace(self, unit=max(sample.fold_of_cycles[1] for sample in (a, b)))

    def smooth(self, sample: Sample) -> tuple[float, float]:
        sign, size = symmetric_functions(sample.others)[:, 0].tolist()
        return sign, size


@dataclass(frozen=True)
class LimitOrBranchPoint(RealCrossing):
    """LP or BP of the motions that a curve consists of: the latter where no free parameter moves the multiplier."""

    def genuine(self, sample: Sample) -> bool:
        vectors = null_vectors(sample.state, Kind.INTEGER)
        forced = all(transversality(sample.state, vectors, name) <= _TRANSVERSAL for name in sample.curve.names)
        return forced == (self.kind == "BP")


@dataclass(frozen=True)
class PairCrossing(CurveTest):
    """Another complex pair passes the unit circle: LPNS, PDNS, NSNS.

    Between neighbours by its growth: with g of J_kappa, borders fixed, and kappa such that the correction `dk = g /
    g_kappa` is imaginary, the exponent of the pair is kappa - dk to first order, and exactly where dk vanishes.
    `target` is where on the circle the pair passes.
    """

    kind: str
    target: complex | None = None
    borders: NullVectors | None = None

    def changed(self, a: Sample, b: Sample) -> bool:
        return _passing(a.others, b.others) is not None

    def within(self, a: Sample, b: Sample) -> CurveTest:
        # the target stays where none passes
        pair = _passing(a.others, b.others)
        target = self.target if pair is None else (pair[0] + pair[1]) / abs(pair[0] + pair[1])
        assert target is not None
        kappa = float(np.angle(_nearest_pair(b, target))) * b.state.rate / (2.0 * np.pi)
        return replace(self, target=target, borders=null_vectors(b.state, Kind.FREE, kappa))

    def value(self, sample: Sample) -> float:
        assert self.target is not None
        assert self.borders is not None
        rate, pair = sample.state.rate, _nearest_pair(sample, self.target)
        kappa, growth = float(np.angle(pair)) * rate / (2.0 * np.pi), math.log(abs(pair))
        start = kappa
        for _ in range(_CORRECTIONS):
            border = bordered(sample.state, Kind.FREE, self.borders, kappa)
            change = border.g / border.gradient(())[2]
            if abs(change.real) <= _KNOWN * rate:
                break
            kappa -= change.real
            if abs(kappa - start) > _STRAYED * rate:
                return growth
        exponent, critical = float(change.imag) * 2.0 * np.pi / rate, sample.evaluation.critical
        # other multipliers, the critical one among them, have zeros of g as well
        if critical is not None and abs(kappa - abs(np.angle(critical)) * rate / (2.0 * np.pi)) <= abs(kappa - start):
            return growth
        return exponent if abs(exponent - growth) <= _AGREES * max(abs(growth), _STRAYED) else growth

    def confirmed(self, sample: Sample) -> bool:
        assert self.target is not None
        result, error = sample.evaluation.floquet, 0.0
        if result.errors.size:
            error = float(result.errors[np.abs(result.multipliers - self.target).argmin()])
        pairs = sample.others[sample.others.imag > 0.0]
        return bool(pairs.size) and math.log(abs(_nearest_pair(sample, self.target))) ** 2 < (_ON_IT + error) ** 2

    def smooth(self, sample: Sample) -> tuple[float, float]:
        # it vanishes at neutral saddles as well
        sign, size = symmetric_functions(sample.others)[:, 2].tolist()
        return sign, size


def _logarithm(value: float) -> float:
    """Of the modulus; -inf of zero, and what is no number as it is."""
    return math.log(abs(value)) if value != 0.0 else -math.inf


def _nearest_pair(sample: Sample, target: complex) -> complex:
    """The complex multiplier of the upper half plane that is nearest to a target."""
    pairs = sample.others[sample.others.imag > 0.0]
    if not pairs.size:
        raise ConvergenceError("the pair of multipliers splits into two real ones")
    return complex(pairs[np.argmin(np.abs(pairs - target))])


def _passing(first: ComplexArray, last: ComplexArray) -> tuple[complex, complex] | None:
    """The complex pair that passes the unit circle between two sets of multipliers, by its upper members."""
    a, b = _census(first), _census(last)
    return crossing_pair(first, last, b[0] - a[0], abs(a[1] - b[1]) + abs(a[2] - b[2]))


def _census(mu: ComplexArray) -> tuple[int, int, int]:
    """How many multipliers lie outside the unit circle, and whether odd numbers of real ones are above +1, below -1."""
    real = mu.real[mu.imag == 0.0]
    return int((np.abs(mu) > 1.0).sum()), int((real > 1.0).sum()) % 2, int((real < -1.0).sum()) % 2


@dataclass(frozen=True)
class Doubling(RealCrossing):
    """PD of the motions that a curve consists of."""

    kind: str = "PD"
    operator: Kind = Kind.HALF

    def smooth(self, sample: Sample) -> tuple[float, float]:
        if sample.half_wave:
            return 1.0, 0.0
        # no matter of the motion are what more harmonics do to a determinant, and its poles at resonances of what is
        # eliminated
        sign, size = symmetric_functions(sample.others)[:, 1].tolist()
        return sign, size


#: on curves of motions that need no critical multiplier; of a free phase
_CROSSINGS = (Doubling(), PairCrossing("NS"))
_OF_MOTIONS = (
    LimitOrBranchPoint("LP", Kind.INTEGER),
    LimitOrBranchPoint("BP", Kind.INTEGER),
    *_CROSSINGS,
)
#: on curves of bifurcations; the first two for one DOF, which has two multipliers with a positive product: none is left
#: that could pass +1 or -1, or be one of a pair
_OF_BIFURCATIONS: dict[Kind, tuple[CurveTest, ...]] = {
    Kind.INTEGER: (Cusp(), DoubleMultiplier("R1"), RealCrossing("LPPD", Kind.HALF), PairCrossing("LPNS")),
    Kind.HALF: (
        GeneralisedDoubling(),
        DoubleMultiplier("R2"),
        RealCrossing("LPPD", Kind.INTEGER),
        PairCrossing("PDNS"),
    ),
    Kind.FREE: (
        Resonance("R3", 3),
        Resonance("R4", 4),
        RealCrossing("LPNS", Kind.INTEGER),
        RealCrossing("PDNS", Kind.HALF),
        PairCrossing("NSNS"),
    ),
}
#: the same of equilibria
_OF_EQUILIBRIA: dict[Kind, tuple[CurveTest, ...]] = {
    Kind.INTEGER: (Cusp(), DoubleMultiplier("R1"), PairCrossing("LPNS")),
    Kind.FREE: (_HOPF_POINTS, RealCrossing("LPNS", Kind.INTEGER), PairCrossing("NSNS")),
}
#: the same of limit cycles
_OF_CYCLES: dict[Kind, tuple[CurveTest, ...]] = {
    Kind.HALF: (GeneralisedDoubling(), DoubleMultiplier("R2"), FoldOfCycles("LPPD"), PairCrossing("PDNS")),
    Kind.FREE: (
        Resonance("R3", 3),
        Resonance("R4", 4),
        FoldOfCycles("LPNS"),
        RealCrossing("PDNS", Kind.HALF),
        PairCrossing("NSNS"),
    ),
}
#: of conservative modes two multipliers are -1 all along, and no pair leaves the unit circle alone
_OF_MODES: tuple[CurveTest, ...] = (FoldOfCycles("LPPD"),)


def tests_of(curve: MotionProblem) -> tuple[CurveTest, ...]:
    """What to look for along a curve, by the kind of its bifurcations."""
    turns, own = tuple(Extremum(name) for name in curve.names), curve.augmentation.own
    if own.free_phase:
        if curve.augmentation is not own:
            return turns
        if isinstance(own, FreePhaseOperator):
            return turns + (_OF_MODES if own.conservative else _OF_CYCLES[own.kind])
        if isinstance(own, NonlinearMode):
            return (*turns, CurvesCross(), *((ActionTurns(), Doubling()) if own.conservative else ()))
        return (*turns[:-1], TurningPoint(curve.name), CurvesCross(), *_CROSSINGS)
    if own.name in MOTION_KINDS:
        peaks = (PeakTurns(),) if isinstance(own, Ridge) else ()
        return (*turns, *peaks, *_OF_MOTIONS)
    if isinstance(own, BranchPointUnfolded):
        return (*turns, DoubleMultiplier("R1"), _PITCHFORKS)
    if not isinstance(own, SingularOperator):
        return turns
    known = _OF_EQUILIBRIA if curve.still else _OF_BIFURCATIONS
    return turns + known[own.kind][: 2 if curve.balance.system.n == 1 else None]
