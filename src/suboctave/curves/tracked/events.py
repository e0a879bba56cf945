"""Events between two neighbours of a curve of bifurcations: bracketed, located, and located again with more harmonics.

What is looked for are the sign changes of `tests`. At a cusp the curve turns in both parameters, which makes no
extremum of either: there the tangent's components divided by the cusp's function keep their signs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import scipy

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.bifurcation.gaps import GrazingContact, levels
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, between, make_point
from suboctave.continuation.problem import Array
from suboctave.curves.kinds.extremum import LimitPointExtremal
from suboctave.curves.kinds.grazing import GrazingEquations
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.nearest import BEGINNING, nearest_point, same_discretisation, zero_along
from suboctave.curves.tracked.tests import CurveTest, Cusp, Extremum
from suboctave.errors import ConvergenceError
from suboctave.floquet.methods import StabilityMethod
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.truncation import choose_harmonics

#: way along a curve, in scaled arclength, that more harmonics may move an event
_BESIDE = 0.05
#: share of a step within which events coincide
SAME = 5e-3
#: share of a step to which an event is located, at once and where more harmonics are to follow
_RESOLVED, _ROUGH = 1e-11, 1e-3
#: share of a test's values at the ends of a step with which a zero is near enough for secants
_LITTLE = 0.05
#: the same share above which a test that has been resolved jumps there instead of vanishing
_JUMP = 0.5
#: ratio of a test's values at two ends beyond which it does not change evenly
_LARGE = 30.0


@dataclass(frozen=True)
class LocatedEvent:
    """An event between two neighbours.

    test, sample, extreme
        Its test, where it lies, and at an extremum which way the curve turns.
    rough, slope
        Where more harmonics are to locate it better; about the test's derivative by arclength.
    off
        How far it may still lie off, in scaled arclength, where nothing could locate it better.
    """

    test: CurveTest
    sample: Sample
    extreme: str = ""
    rough: _Stretch | None = None
    slope: float = 0.0
    off: float = 0.0


def events_between(
    samples: list[Sample], tests: tuple[CurveTest, ...], newton: NewtonOptions, warnings: list[str]
) -> list[LocatedEvent]:
    """Every event in a step, between its samples in order (both ends included, no test changing twice in between).

    The first one's tests count in the discretisation it was found in, as on the step before: what changes sign there
    is not lost, nor found twice, if that of the others moves it across.
    """
    events: list[LocatedEvent] = []
    for test in tests:
        own: list[LocatedEvent] = []
        for a, b in itertools.pairwise(samples):
            try:
                item = located(test, a, b, newton) if test.changed(a, b) else None
                own += [] if item is None else [item]
            except ConvergenceError as failure:
                warnings.append(f"{test.kind} near {b.where}: {failure}")
        events += own
    near = SAME * (samples[-1].place - samples[0].place)
    return sorted(_genuine(events, samples[-1].curve, near), key=lambda item: item.sample.place)


def located(test: CurveTest, low: Sample, high: Sample, newton: NewtonOptions) -> LocatedEvent | None:
    """The event between two points with a sign change, None if it is none; raises ConvergenceError."""
    own = test.within(low, high)
    same = same_discretisation(low, high, newton)
    stretch = _Stretch(same, high, own if same is low else own.within(same, high), newton)
    own = stretch.test
    if same is not low and stretch.values[0.0] * stretch.values[1.0] > 0.0:
        # in this discretisation it lies before the first
        way = high.point.arclength - low.point.arclength
        slope = (stretch.values[1.0] - stretch.values[0.0]) / way
        sample = zero_along(same.point, own.value, newton, way, slope)
        return LocatedEvent(own, sample, extreme_of(own, -slope, sample), None, slope) if own.genuine(sample) else None
    # on a curve of extrema those that others bring about are told by their distance; multipliers tell only close by
    close = high.curve.augmentation.turning or type(own).genuine is not CurveTest.genuine
    sample, slope = stretch.about(_ROUGH if close else 0.0)
    if not own.genuine(sample) or (not close and stretch.jumps_at(sample)):
        return None
    before = stretch.values[0.0] if stretch.values[0.0] != 0.0 else -slope
    # what more harmonics will move need not be known better
    finer = _finer(sample) is not None
    sample = sample if finer else stretch.zero_from(sample, slope)
    return LocatedEvent(own, sample, extreme_of(own, before, sample), stretch if finer else None, slope)


def _genuine(events: list[LocatedEvent], curve: MotionProblem, near: float) -> list[LocatedEvent]:
    """Events without those that others bring about.

    Slopes jump at a corner, and may seem to turn to and fro in it. Along a curve of extrema the extreme parameter turns
    where the third one does: w . (Y_q dq + Y_r dr) = 0, w the left null vector of M. At a cusp a symmetry may have both
    turn, which makes no extremum of either.
    """

    def beside(item: LocatedEvent, others: list[LocatedEvent]) -> bool:
        return any(o is not item and abs(item.sample.place - o.sample.place) <= near for o in others)

    turns = {name: [i for i in events if isinstance(i.test, Extremum) and i.test.name == name] for name in curve.names}
    dropped = [item for own in turns.values() for item in own if beside(item, own)]
    extreme, last = curve.augmentation.turning, curve.names[-1]
    if extreme:
        cusps = [item for item in events if isinstance(item.test, Cusp)]
        both = [item for item in turns[extreme] if beside(item, turns[last])]
        dropped += both + [item for item in turns[last] if beside(item, cusps) and beside(item, both)]
    return [item for item in events if not any(item is d for d in dropped)]


class _Stretch:
    """A test between two neighbours, by the share of the way along the chord."""

    def __init__(self, a: Sample, b: Sample, test: CurveTest, newton: NewtonOptions) -> None:
        self.a, self.b = a, b
        self.test = test
        self.newton = newton
        self.samples = {0.0: a, 1.0: b}
        self.values = {0.0: test.value(a), 1.0: test.value(b)}
        #: as in `newton.correct`: points that only lead to the zero may have the derivatives of one beside
        self.spare = 0.0

    @property
    def way(self) -> float:
        """Its length in scaled arclength."""
        return self.b.point.arclength - self.a.point.arclength

    def value(self, share: float) -> float:
        """The test's function."""
        if share not in self.values:
            sample = self.samples[share] = Sample(self._point(share))
            self.values[share] = self.test.value(sample)
        return self.values[share]

    def _point(self, share: float) -> CurvePoint:
        """As `point_between`, started from the nearest points known."""
        a, b = self.a.point, self.b.point
        low = max(s for s in self.samples if s < share)
        high = min(s for s in self.samples if s > share)
        curve, weights, origin = b.curve, b.weights, b.curve.transfer(a.u, a.curve)
        chord = b.u - origin
        row = weights * chord
        row = row / length(row)
        # a fixed plane for every share, whatever the start
        place = share * float(row @ (weights * chord)) + float(row @ (weights * origin))

        def start(u: Array, along: Array) -> Array:
            scaled = weights * along
            return u + (place - float(row @ (weights * u))) / float(row @ scaled) * along

        first, last = self.samples[low].point, self.samples[high].point
        ends = [(curve.transfer(p.u, p.curve), curve.transfer(p.tangent, p.curve)) for p in (first, last)]
        between_them = start(between(first, last, (share - low) / (high - low)), row / weights)
        if share - low > high - share:
            ends.reverse()
        # along a corner of the equations, near a grazing, neighbours may lie on both sides of it
        for guess in (between_them, *(start(*end) for end in ends)):
            try:
                solved = correct(curve, guess, row, weights, self.newton, spare=self.spare)
                break
            except ConvergenceError:
                continue
        else:
            solved = correct(curve, between_them, row, weights, replace(self.newton, iterations=30, damped=True))
        return make_point(solved, curve, chord, a.arclength + share * (b.arclength - a.arclength))

    def about(self, resolved: float) -> tuple[Sample, float]:
        """A point beside the zero, closer than a share of the way or (0) where little is left of the test's values at
        the ends, and about the test's derivative by arclength there.
        """
        first, last = self.values[0.0], self.values[1.0]
        self.spare = BEGINNING
        # components of a tangent change evenly; others may be large at one end
        if first * last > 0.0:
            raise ConvergenceError("the test does not change sign between the points about it")
        even = isinstance(self.test, Extremum)
        scaled = _even(first, last)
        start, stop = scaled(first), scaled(last)
        self.value(self._turn() if even or start == stop else start / (start - stop))
        size = max if even else min
        little = 0.0 if resolved else _LITTLE * size(abs(first), abs(last))
        share = self._root(resolved or _RESOLVED, little)
        value, way = self.value(share), self.b.point.arclength - self.a.point.arclength
        slope = last - first
        if 0.0 < share < 1.0:
            # of the parabola through all three
            slope = (value - first) / share + (last - value) / (1.0 - share) - slope
        return self.samples[share], slope / way if way > 0.0 else 0.0

    def jumps_at(self, sample: Sample) -> bool:
        """Whether the test changes sign without vanishing, as c3 does in a corner; a parameter may turn in one."""
        ends = abs(self.values[0.0]), abs(self.values[1.0])
        return not isinstance(self.test, Extremum) and abs(self.test.value(sample)) > _JUMP * min(ends)

    def _turn(self) -> float:
        """The share at which a parameter turns by its cubic interpolation; 0 if nowhere, and for other tests."""
        if not isinstance(self.test, Extremum):
            return 0.0
        a, b, name = self.a, self.b, self.test.name
        chord = float(b.point.u[b.curve.index(name)] - a.point.u[a.curve.index(name)]) / self.way
        start, stop = a.slopes[name], b.slopes[name]
        # its derivative at the share s is start + 2 half s + curve s^2
        half, curve = 3.0 * chord - 2.0 * start - stop, 3.0 * (start + stop - 2.0 * chord)
        inside = half * half - start * curve
        if inside >= 0.0 and start != 0.0:
            # the root on the side of the end whose sign is the other one
            share = -start / (half - math.copysign(math.sqrt(inside), start))
            return share if 0.0 < share < 1.0 else 0.0
        return 0.0

    def zero_from(self, sample: Sample, slope: float) -> Sample:
        """Where the test vanishes, from a point beside, by secants; by Brent's method where these leave the way."""
        low, high = self.a.point.arclength, self.b.point.arclength
        try:
            zero = zero_along(sample.point, self.test.value, self.newton, high - low, slope)
        except ConvergenceError:
            zero = None
        # tangents at the ends may be those of points a rounding away
        slack = _ROUGH * (high - low)
        if zero is not None and low - slack <= zero.point.arclength <= high + slack:
            return zero
        return self.zero(_RESOLVED)

    def zero(self, resolved: float) -> Sample:
        """Where the test vanishes, to a share of the way."""
        self.spare = 0.0
        for known in (self.samples, self.values):
            for share in [share for share in known if 0.0 < share < 1.0]:
                del known[share]
        return self.samples_at(self._root(resolved))

    def _root(self, resolved: float, little: float = 0.0) -> float:
        """The share at which the test vanishes, or its modulus is below `little`, by Brent's method.

        Secants are those of `_even`.
        """
        for low, high in itertools.pairwise(sorted(self.values)):
            first, last = self.values[low], self.values[high]
            if first * last > 0.0:
                continue
            scaled = _even(first, last)

            def value(share: float, scaled: Callable[[float], float] = scaled) -> float:
                here = self.value(share)
                return 0.0 if abs(here) <= little else scaled(here)

            return float(scipy.optimize.brentq(value, low, high, xtol=resolved, rtol=8.9e-16))
        raise ConvergenceError("the test does not change sign")

    def samples_at(self, share: float) -> Sample:
        """The point at a share."""
        self.value(share)
        return self.samples[share]


def _even(first: float, last: float) -> Callable[[float], float]:
    """What a test's values are taken as between two ends: as they are, or, where those at one end are large, about as
    their logarithm, lest secants stay at the other.
    """
    least, most = sorted((abs(first), abs(last)))
    if not 0.0 < _LARGE * least < most:
        return float
    return lambda value: math.asinh(value / least)


def _finer(sample: Sample) -> HarmonicBasis | None:
    """The basis that an event asks for, None where the present one will do."""
    curve = sample.curve
    if curve.adaptive is None:
        return None
    basis = choose_harmonics(sample.state, curve.adaptive, curve.adaptive.event_tolerance)
    return basis if basis.harmonics > curve.balance.basis.harmonics else None


def extreme_of(test: CurveTest, before: float, at: Sample) -> str:
    """Whether a parameter that turns has a maximum or a minimum, empty for other events; before: the sign before it."""
    return test.extreme(before, at) if isinstance(test, Extremum) else ""


def refined(event: LocatedEvent, newton: NewtonOptions, warnings: list[str]) -> LocatedEvent:
    """An event located again with the harmonics that events ask for."""
    sample = event.sample
    for _ in range(6):
        curve, basis = sample.curve, _finer(sample)
        if basis is None:
            break
        finer = curve.with_basis(basis)
        u = finer.transfer(sample.point.u, curve)
        try:
            # the harmonics that come in begin at what the motion so far excites
            fuller, coefficients = sample.state.completed_x
            u[: finer.balance.dimension] = fuller.resized(coefficients, basis).ravel()
            x, omega, values = finer.split(u)
            finer = replace(finer, balance=finer.balance.settle(x, omega, values))
            along = finer.transfer(sample.point.tangent, curve)
            weights = finer.weights(u, curve.size(sample.point.u))
            start = nearest_point(finer, u, weights, newton, along, BEGINNING)
            start = replace(start, arclength=sample.point.arclength)
            near = Sample(start)
            test = event.test.within(near, near)
            sample = zero_along(start, test.value, newton, _BESIDE, event.slope, factor=start.factor)
        except ConvergenceError as failure:
            words = (
                f"{event.test.kind} near {curve.where(sample.point.u)} was located with "
                f"{curve.balance.basis.harmonics} harmonics; with {basis.harmonics} it was not found again ({failure})"
            )
            if sample is event.sample and event.rough is not None:
                try:
                    sample = event.rough.zero_from(sample, event.slope)
                except ConvergenceError as again:
                    words += f", nor more closely without these ({again})"
                    event = replace(event, off=_ROUGH * event.rough.way)
            warnings.append(words)
            break
    return event if sample is event.sample else replace(event, sample=sample)


def as_event(event: LocatedEvent, method: StabilityMethod, observe: int) -> TrackedEvent:
    """An event as users get it; `observe`: the DOF whose amplitude is reported."""
    sample = event.sample
    curve, orbit = sample.curve, sample.orbit
    name = getattr(event.test, "name", curve.names[1])
    return TrackedEvent(
        event.test.kind,
        orbit,
        method.along(sample.state),
        orbit.residual,
        orbit.amplitude(observe),
        name,
        sample.vectors,
        sample.kappa,
        arclength=sample.point.arclength,
        # a parameter changes by no more than its range along a unit of arclength
        uncertainty=event.off * curve.spans[curve.names.index(name)],
        curve=curve.augmentation.name,
        names=curve.names,
        extreme=event.extreme,
        contact=_contact(sample),
        isola=_isola(event),
        turning=curve.augmentation.turning,
    )


def _contact(sample: Sample) -> GrazingContact | None:
    """What grazes along a curve of grazings."""
    equations = sample.evaluation.equations.own
    if not isinstance(equations, GrazingEquations):
        return None
    state, of = sample.state, equations.of
    local = state.local(of.element)
    time = sample.instant_or_frequency / state.rate
    value = float(sample.point.u[-1])
    return GrazingContact(of.element, local.element.label, levels(local)[of.index], time, "", value)


def _isola(event: LocatedEvent) -> str:
    """What happens to branches at an extremum along a curve of limit points."""
    curve, sample = event.sample.curve, event.sample
    if not isinstance(event.test, Extremum) or curve.augmentation.name != "LP" or curve.augmentation.turning:
        return ""
    (beside,) = set(curve.names) - {event.test.name}
    base = curve.augmentation
    assert isinstance(base, SingularOperator)
    extremal = LimitPointExtremal(base, beside, 1.0, event.test.name)
    equations = extremal.at(sample.state, sample.evaluation.extra, curve.names)
    return equations.isola
