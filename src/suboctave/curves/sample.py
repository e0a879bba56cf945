"""A point of a curve with what is looked for along it.

Along responses: multipliers, signs of determinants, gaps, test functions. Along curves of bifurcations: null vectors,
normal-form coefficients, other determinants.
"""

from __future__ import annotations

import math
import weakref
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from suboctave.bifurcation import measures
from suboctave.bifurcation.bordered import NullVectors, null_vectors
from suboctave.bifurcation.gaps import GapExtrema, crossing_speeds, gap_extrema
from suboctave.bifurcation.normal_form import cubic_coefficient, pitchfork_coefficient, responding, torus
from suboctave.continuation.linear import Factor, LeadingBlock, length
from suboctave.continuation.newton import NewtonOptions, closely
from suboctave.continuation.point import CurvePoint, point_ahead, solved_again
from suboctave.curves.augmentation import PLAIN
from suboctave.curves.finer import FinerMotion, resolved_beside
from suboctave.curves.kinds.branch_point import BranchPointEquations
from suboctave.curves.kinds.extremum import ExtremalEquations
from suboctave.curves.kinds.free_phase import FreePhaseEquations, FreePhaseOperator
from suboctave.curves.kinds.grazing import GrazingEquations
from suboctave.curves.kinds.limit_cycle import oscillating
from suboctave.curves.kinds.multiple import MultipleEquations
from suboctave.curves.kinds.nonlinear_mode import ModeEquations
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.curves.still import at_rest
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError
from suboctave.floquet.held import Grip, grip
from suboctave.floquet.methods import Monodromy, StabilityMethod
from suboctave.floquet.result import FloquetResult, Spectrum
from suboctave.floquet.symmetric import symmetric_functions
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.energy import action_along, action_gradient
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import next_harmonics, truncation
from suboctave.lazy import lazy

_MONODROMY = Monodromy()
#: excursions across a gap: heights of its extrema, by their number
Excursions = dict[int, float]
#: height, in units of the largest relative displacement, up to which an excursion may end soon
YOUNG = 0.05
#: height of an extremum over its gap that is rounding along a curve of grazings, in units of the motion
_GRAZING = 1e-8
#: odd Fourier coefficients of stiffness and damping, as a share of the largest, that are rounding
_ROUNDING = 1e-8
#: coefficient of a double multiplier, in units of omega, below which rounding has its say (an undamped structure)
_NOTHING = 1e-9
#: component of the unit tangent along the free parameter, in scaled arclength, up to which it may be rounding, and that
#: up to which it may be what a point's tolerance makes of it; way to points beside one that tell a piece from a turn
_LEVEL, _TOLERATED, _ASIDE = 1e-9, 1e-6, 1e-3
_CLOSELY = closely(NewtonOptions())


class Sample:
    """A solved point; `place` is its arclength, `method` gives its multipliers."""

    #: with another sample, and the kinds whose tests have changed between the two (`monitors.changes`)
    comparison: Comparison | None = None
    compared: tuple[weakref.ref[Sample], tuple[Any, ...]] | None = None

    def __init__(self, point: CurvePoint, method: StabilityMethod = _MONODROMY) -> None:
        assert isinstance(point.curve, MotionProblem)
        assert isinstance(point.evaluation, MotionEvaluation)
        self.point = point
        self.method = method
        self.place = point.arclength
        self.curve = point.curve
        self.evaluation = point.evaluation
        self.state: BalanceState = point.evaluation.state
        self._young: dict[int, Excursions] = {}

    def at(self, point: CurvePoint) -> Sample:
        """Another point, with multipliers by the same method."""
        return Sample(point, self.method)

    def as_point(self, result: FloquetResult) -> BranchPoint:
        """The point with multipliers as a branch keeps it."""
        return BranchPoint(self.orbit, result, self.place, self.point.iterations, still=self.still)

    @property
    def where(self) -> str:
        """The place on the curve in words."""
        return self.curve.where(self.point.u)

    @lazy
    def orbit(self) -> PeriodicOrbit:
        """The motion."""
        state, evaluation = self.state, self.evaluation
        known = dict(state.values), evaluation.error, truncation(state), self.curve.adaptive
        return PeriodicOrbit(state.balance, state.x.copy(), state.omega, *known, zeta=self.curve.zeta(evaluation.extra))

    # ------------------------------------------------------------------------------------------ along responses
    @lazy
    def _spectrum(self) -> Spectrum:
        return self.method.spectrum(self.state)

    @lazy
    def standing(self) -> FloquetResult:
        """Multipliers of the motion as it stands, or with more harmonics, see `floquet`."""
        if self._at_most_harmonics:
            known = self.floquet
            if self.finer is not None:
                return known
        return self._spectrum.standing

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers and their errors, of the motion completed by what its harmonics leave out: of that with more
        harmonics where those of the curve are the most that it may have and leave multipliers unresolved.
        """
        result = self._spectrum.completed
        if result.vagueness <= 1.0 or not self._at_most_harmonics:
            return result
        finer = resolved_beside(self.curve, self.state, self.point.tangent, result)
        if finer is None:
            return result.unknown()
        self.finer, result = finer
        return replace(result, checks={**result.checks, "harmonics": float(self.finer.harmonics)})

    @property
    def completed_is_known(self) -> bool:
        """Whether the multipliers of the completed motion have been asked for: where tests compare these."""
        return "floquet" in self.__dict__

    @lazy
    def resolved(self) -> bool:
        """Whether the multipliers of the completed motion tell on which side of the circle they lie, or how near."""
        return self.floquet.resolved

    #: the motion with more harmonics that the multipliers are those of, None where they are the curve's own
    finer: FinerMotion | None = None

    @property
    def _at_most_harmonics(self) -> bool:
        """Whether the curve may not have more harmonics than here, and the monodromy matrix gives its multipliers."""
        rule, state = self.curve.adaptive, self.state
        if rule is None or not self.method.follows_monodromy or self.curve.augmentation is not PLAIN:
            return False
        return next_harmonics(state, rule).size <= state.basis.size

    @lazy
    def doubt(self) -> float:
        """How far off a multiplier may be that may lie on either side of the unit circle; 0 if there is none."""
        result = self.floquet
        if self.at_rest or result.undamped or result.decided:
            return 0.0
        return float(result.errors[result.open].max(initial=0.0))

    @lazy
    def verdict(self) -> FloquetResult:
        """Multipliers whose errors cover what det J_0 and det J_half say of them."""
        known = self.floquet
        if self.at_rest or self.finer is not None:
            return known
        result = measures.in_doubt(known, self._integer_sign, self.half_sign)
        return measures.neutral(result) if self.still else result

    @property
    def _integer_sign(self) -> float:
        """Sign of det J_0; 0 where that vanishes all along the curve."""
        return 0.0 if self.still else self.point.orientation * self.slope

    @lazy
    def at_rest(self) -> bool:
        """Whether the motion counts as rest, where its curve can tell."""
        return self.evaluation.at_rest

    @lazy
    def outside(self) -> int:
        """Number of multipliers outside the unit circle, real ones on the side on which det J_0 and det J_half have
        them: the count and the tests of LP, BP and PD then change together.
        """
        known = self.floquet
        count = known.unstable
        if not (self.at_rest or self.finer is not None):
            for which, _ in measures.contradicted(known, self._integer_sign, self.half_sign):
                count += 1 if abs(known.multipliers[which]) <= 1.0 else -1
        return count

    @property
    def beyond(self) -> int:
        """Beyond how many of +1 and -1 an odd number of real multipliers lies, as det J_0 and det J_half have it."""
        return (self._integer_sign < 0.0) + (self.half_sign < 0.0)

    @lazy
    def signs(self) -> tuple[bool, bool, bool]:
        """What the tests of BP, LP and PD look at."""
        return self.point.orientation > 0.0, self.slope > 0.0, self.half_sign > 0.0

    @lazy
    def half_sign(self) -> float:
        """Sign of det J_half, or, where it is known with more harmonics, that of prod (1 + mu)."""
        known = self.standing
        if self.finer is not None:
            return float(known.symmetric[0, 1])
        return Factor.of(self.state.half_jacobian).sign

    @lazy
    def gaps(self) -> tuple[GapExtrema, ...]:
        """The elements' gaps with the extrema of the motion there; what grazes all along a curve is at its gap itself:
        on which side of that is rounding.
        """
        found = gap_extrema(self.state)
        if self.curve.augmentation is PLAIN or not isinstance(
            equations := self.evaluation.equations.own, GrazingEquations
        ):
            return found
        near = _GRAZING * equations.of.unit
        return tuple(
            replace(gap, value=np.where(np.abs(gap.value - gap.level) <= near, gap.level, gap.value)) for gap in found
        )

    def young(self, which: int) -> Excursions:
        """Of one of the gaps the excursions across it that may end soon."""
        if which not in self._young:
            gap, heights = self.gaps[which], Excursions()
            # there are few extrema: numbers are quicker than arrays
            values, level = gap.value.tolist(), gap.level
            most = YOUNG * max(map(abs, values), default=0.0)
            for i, (value, curve) in enumerate(zip(values, gap.curve.tolist(), strict=True)):
                height = level - value if curve > 0.0 else value - level
                if 0.0 < height < most:
                    heights[i] = height
            self._young[which] = heights
        return self._young[which]

    @lazy
    def brevity(self) -> float:
        """Logarithm of how much second derivatives grow with the contacts that are about to end: mean over the two ends
        of each of `1 / |du/dtau|`, which is as large as the contact is short, multiplied. Third ones grow as its cube.
        """
        return -0.5 * float(np.log(crossing_speeds(self.state)).sum())

    @lazy
    def slope(self) -> float:
        """Component of the tangent along the free parameter."""
        return float(self.point.tangent[self.point.curve.parameter])

    @lazy
    def still(self) -> bool:
        """Whether the free parameter stays as it is along the curve, but for rounding, and does not only turn here: J_0
        is singular all along such a piece, which a multiplier at +1 belongs to.
        """
        if _turn(self.point) > _TOLERATED or self.at_rest:
            return False
        here, beside = self.point, [0.0]
        with suppress(ConvergenceError):
            here = solved_again(here, self.curve, here.weights, _CLOSELY)
        if _turn(here) > _LEVEL:
            return False
        for way in (-_ASIDE, _ASIDE):
            with suppress(ConvergenceError):
                beside.append(_turn(point_ahead(here, way, _CLOSELY)))
        return len(beside) > 1 and min(beside[1:]) <= _LEVEL

    @lazy
    def measures(self) -> Array:
        """turn, fold, double, torus of `bifurcation.measures`: signs and logarithms of their moduli, shape (2, 4).

        Where the parameter stands still those of the multipliers but the one at +1.
        """
        point, known = self.point, self.floquet
        tests = measures.measured(point.tangent, point.weights, point.curve.parameter, known)
        if self.still:
            tests[:, 0] = 1.0, math.log(_LEVEL)
            tests[:, 1:] = symmetric_functions(_without(known.multipliers, 1.0 + 0.0j, several=False))
        return tests

    @lazy
    def grip(self) -> Grip:
        """What elements may do to the vibrations of the structure."""
        return grip(self.state, self.standing.multipliers)

    # ---------------------------------------------------------------------------------- along curves of bifurcations
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
    def oscillation(self) -> float:
        """Size of the motion but its mean, in scaled arclength: as slopes do, it vanishes where cycles shrink to an
        equilibrium. Equilibria have none.
        """
        if self.curve.still:
            return 0.0
        return length(oscillating(self.state)) / self.curve.unit(self.point.weights)

    @property
    def kappa(self) -> float:
        """Frequency of the critical perturbation at an NS, else 0."""
        equations = self.evaluation.equations.own
        return equations.kappa if isinstance(equations, SingularEquations | MultipleEquations) else 0.0

    @property
    def instant_or_frequency(self) -> float:
        """The instant tau in (0, 2 pi) of a grazing, kappa of an NS, zeta of a mode, else 0."""
        equations = self.evaluation.equations.own
        if isinstance(equations, SingularEquations):
            return equations.kappa
        if isinstance(equations, GrazingEquations):
            return equations.tau % (2.0 * math.pi)
        if isinstance(equations, ModeEquations):
            return equations.zeta
        if isinstance(equations, FreePhaseEquations) and isinstance(equations.family, ModeEquations):
            return equations.family.zeta
        return self.kappa

    @property
    def vectors(self) -> NullVectors | None:
        """Null vectors of the singular operator, None where there is none."""
        border = getattr(self.evaluation.equations.own, "bordered", None)
        return None if border is None else border.vectors

    def critical_vectors(self, operator: Kind) -> tuple[NullVectors, float]:
        """Null vectors of another operator that is singular here, and kappa of the pair next to the unit circle."""
        kappa = 0.0
        if operator is Kind.FREE:
            pairs = self.others[self.others.imag > 0.0]
            pair = pairs[np.argmin(np.abs(np.abs(pairs) - 1.0))]
            kappa = float(np.angle(pair)) * self.state.rate / (2.0 * np.pi)
        return null_vectors(self.state, operator, kappa), kappa

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
    def action_slope(self) -> float:
        """Change of the action along the curve, relative to it, of modes."""
        point, n = self.point, self.curve.balance.dimension
        return action_along(self.state, point.tangent[:n], float(point.tangent[-1]))

    @lazy
    def cubic(self) -> float:
        """c3 of a PD, see `bifurcation.normal_form`; psi is not turned, so that it is smooth along the curve."""
        b, (by_x, rates, _) = self.equations.bordered, self.equations.gradient
        free = self.curve.augmentation.free_phase
        by_motion, by_omega = -by_x.real.reshape(self.state.x.shape), -rates["omega"].real if free else 0.0
        solve = responding(self.state) if free else self._responding
        return cubic_coefficient(self.state, b.right, b.left, by_motion, by_omega, solve)

    @lazy
    def pitchfork(self) -> float:
        """c3 of a branch point, psi not turned; 0 where no symmetry breaks."""
        assert self.vectors is not None
        return pitchfork_coefficient(self.state, self.vectors, self.curve.name)

    @lazy
    def lyapunov(self) -> float:
        """The real part of c3 of a Hopf point, see `bifurcation.normal_form`: its first Lyapunov coefficient."""
        assert self.vectors is not None
        # what rounding leaves of an oscillation is no motion to differentiate along
        still = at_rest(self.state, self.state.omega)
        return torus(still, self.vectors, self.curve.name, self.kappa).coefficients["c3"]

    def _responding(self, rhs: Array) -> tuple[Array, float]:
        """See `normal_form.responding`: by the factors that the point was solved with."""
        return self._plain.solve(rhs) / self.point.weights[: self.state.x.size], 0.0

    @lazy
    def coefficient(self) -> float:
        """What decides the normal form: psi . R''[phi, phi] / 2 of an LP, c3 of a PD, psi turned; nan for others."""
        augmentation = self.curve.augmentation.own
        kind = augmentation.kind if isinstance(augmentation, SingularOperator) else Kind.FREE
        if kind is Kind.FREE or (isinstance(augmentation, FreePhaseOperator) and augmentation.conservative):
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
            sign, logarithm = self._plain.sign, self._plain.log_determinant
            logarithm += n * math.log(float(self.point.weights[0]) / float(state.balance.scales[0][0]))
            masses = state.balance.logarithm_of_masses(n)
        else:
            n = len(self._half.lu)
            sign, logarithm = self._half.sign, self._half.log_determinant
            masses = 2.0 * state.balance.logarithm_of_masses(n)
        units = 2.0 * n * math.log(state.rate) + _frequencies(n, size, operator is Kind.INTEGER) + masses
        return sign, logarithm - units

    @lazy
    def half_wave(self) -> bool:
        """Whether perturbations meet the same stiffness and damping in both halves of the period. Those of half-odd
        harmonics are two sets then, conjugates of each other, and det J_half is the square of a modulus: pairs on the
        unit circle pass -1 (Swift & Wiesenfeld, Physical Review Letters 52, 1984).
        """
        weights = self.state.balance.scales[1]
        odd, largest = np.max([channel.halves(weights) for channel in self.state.channels] or [(0.0, 0.0)], axis=0)
        return bool(odd <= _ROUNDING * largest)

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

    @lazy
    def others(self) -> ComplexArray:
        """Multipliers but the one, or the pair, that is critical all along the curve, and of bifurcations of motions of
        a free phase those that are +1 by themselves.
        """
        mu, critical = self.evaluation.floquet.multipliers, self.evaluation.critical
        if critical is None:
            return mu
        augmentation = self.curve.augmentation
        if augmentation.free_phase and augmentation.own.name in ("PD", "NS"):
            mu = _without(mu, 1.0 + 0.0j, augmentation.trivial == 2)
        return _without(mu, critical, augmentation.name == "NS" or augmentation.trivial == 2)

    @lazy
    def fold(self) -> tuple[float, float]:
        """Sign and logarithm of the determinant that vanishes where another multiplier is +1."""
        return self.fold_of_cycles if self.curve.augmentation.free_phase else self.determinant(Kind.INTEGER)

    @lazy
    def fold_of_cycles(self) -> tuple[float, float]:
        """Sign and logarithm of the determinant of `[R_X R_omega; phase condition]`, rows of unit length: zero where
        the family of limit cycles over the other parameters turns, or crosses another. Of conservative modes, which are
        a family without these, bordered by R_zeta and the derivatives of the action.
        """
        point, state, n = self.point, self.state, self.state.balance.dimension
        equations = self.evaluation.equations.own
        assert isinstance(equations, FreePhaseEquations)
        weights = np.append(point.weights[:n], 1.0 / state.omega)
        turning = state.basis.derivative(state.x).ravel() * point.weights[:n]
        matrix = np.vstack((state.extended_jacobian("omega") / weights, np.append(turning, 0.0)))
        if equations.column is not None:
            matrix = np.vstack((matrix, action_gradient(state) / weights))
            matrix = np.column_stack((matrix, np.append(equations.column, [0.0, 0.0])))
        sign, size = np.linalg.slogdet(matrix / np.linalg.norm(matrix, axis=1)[:, None])
        return float(sign), float(size)


def _turn(point: CurvePoint) -> float:
    """Modulus of the component of the unit tangent along the free parameter, in scaled arclength."""
    at = point.curve.parameter
    return abs(float(point.weights[at] * point.tangent[at]))


def _without(mu: ComplexArray, critical: complex, several: bool) -> ComplexArray:
    """Multipliers but the critical one, or pair."""
    distance = np.minimum(np.abs(mu - critical), np.abs(mu - np.conj(critical)))
    nearest = np.argsort(distance, kind="stable")
    if several or mu[nearest[0]].imag == 0.0:
        return np.delete(mu, nearest[: 2 if several else 1])
    # two that are nearly the same came out as a pair, whose sum is known better than either
    pair = np.abs(mu - np.conj(mu[nearest[0]])).argmin()
    return np.append(np.delete(mu, [nearest[0], pair]), 2.0 * mu[nearest[0]].real - critical)


@lru_cache(maxsize=64)
def _frequencies(rows: int, size: int, mean: bool) -> float:
    """Sum of `log (1 + f^2)` over the rows of an operator, f the harmonic of each, whole (mean) or half-odd."""
    k = np.arange(rows) // size
    f = (k + 1) // 2 if mean else k // 2 + 0.5
    return float(np.log(1.0 + f**2).sum())


class Comparison(NamedTuple):
    """What the multipliers of two neighbours say of the way between them.

    first
        The first of the two.
    change
        How many more are outside the unit circle at the second.
    """

    first: weakref.ref[Sample]
    change: int


def resolved(*samples: Sample) -> bool:
    """Whether multipliers tell what happens between samples: where those of all are resolved. Elsewhere what completes
    motions is as large as what it completes, and jumps from one to the next.
    """
    for sample in samples:  # noqa: SIM110 - `all` takes three times as long
        if not sample.resolved:
            return False
    return True


def compare(a: Sample, b: Sample) -> Comparison:
    """The comparison of two neighbours, which several ask for."""
    known = b.comparison
    if known is None or known.first() is not a:
        change = b.outside - a.outside if resolved(a, b) else b.beyond - a.beyond
        b.comparison = known = Comparison(weakref.ref(a), change)
    return known
