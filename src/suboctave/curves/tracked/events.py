"""Events along a curve of bifurcations: bracketed between two neighbours, located, and located again with more
harmonics.

What is looked for are the sign changes of `tests`. At a cusp the curve turns in both parameters, which makes no
extremum of either: there the tangent's components divided by the cusp's function keep their signs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.bifurcation.gaps import GrazingContact, level_of
from suboctave.continuation.events import Bracket
from suboctave.continuation.linear import Factor, length
from suboctave.continuation.newton import NewtonOptions, correct, null_row
from suboctave.continuation.notes import Note
from suboctave.continuation.point import (
    CurvePoint,
    crossing_matrix,
    make_point,
    point_ahead,
    solved_again,
)
from suboctave.continuation.problem import Array
from suboctave.curves.interior import contacts_between
from suboctave.curves.kinds.extremum import LimitPointExtremal
from suboctave.curves.kinds.grazing import GrazingEquations
from suboctave.curves.kinds.limit_cycle import LimitCycle
from suboctave.curves.kinds.singular import OPERATORS, SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.curves.other_branch import crossing_point
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.tests import CurvesCross, CurveTest, Cusp, Extremum
from suboctave.errors import ConvergenceError
from suboctave.floquet.methods import StabilityMethod
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.truncation import choose_harmonics, next_harmonics

#: way in scaled arclength within which derivatives count as those of a point that a search begins at
BEGINNING = 1e-5
#: way along a curve, in scaled arclength, that a zero may still be off by the last secant, and the first secant's least
_AT_ZERO, _SECANT = 1e-10, 1e-6
#: how many times as far as its slope tells a zero may lie
_ABOUT = 10.0
#: share of its first value from which on a function's secants are no rounding
_ROUNDING = 1e-3
#: shortest corrections towards a curve before a point of it is solved for
_SHORTEST = 6


def same_discretisation(a: Sample, b: Sample, newton: NewtonOptions) -> Sample:
    """The first of two neighbours solved again in the discretisation of the second, where that differs."""
    if a.curve.alike(b.curve):
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
    in `newton.correct`. Raises ConvergenceError.
    """
    row = null_row(curve, u, weights) if along is None else weights * along / length(weights * along)
    try:
        return make_point(correct(curve, u, row, weights, newton, spare=spare), row / weights, 0.0)
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
    return make_point(correct(curve, u, row, weights, newton), row / weights, 0.0)


def zero_along(
    start: CurvePoint,
    function: Callable[[Sample], float],
    newton: NewtonOptions,
    reach: float,
    slope: float = 0.0,
    iterations: int = 12,
    factor: Factor | None = None,
) -> Sample:
    """The zero of a function along a curve near one of its points, by secants in arclength; raises ConvergenceError.

    `slope`: about the derivative of the function by arclength at the zero, 0 if that is not known; `factor`: that of
    the start, if it was solved with about its tangent.
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
        last = make_point(solved, start.tangent, start.arclength + s)
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
    if slope * known < 0.0:
        # the slope was not that of the zero: it lies about as far away, on whichever side
        return zero_along(start, function, newton, _ABOUT * (abs(first / known) + _SECANT), 0.0, iterations, factor)
    raise ConvergenceError(f"no zero found beside {start.curve.where(start.u)}")


#: way along a curve, in scaled arclength, that more harmonics may move an event
_BESIDE = 0.05
#: second least singular value of a crossing matrix up to which a crossing is double but for little
_DOUBLE = 1e-4
#: way to either side of a turn, in scaled arclength, at which a parameter that turns moves
_ASIDE = 1e-4
#: share of a step within which events coincide
SAME = 5e-3
#: share of a step to which an event is located, at once and where more harmonics are to follow
_RESOLVED, _ROUGH = 1e-11, 1e-3
#: share of a step between points on both sides of a crossing of curves
_ACROSS = 1e-2
#: share of a test's values at the ends of a step above which one that has been resolved jumps instead of vanishing
_JUMP = 0.5
#: with how many other numbers of harmonics an event is compared; way in scaled arclength by which one that stays moves
_COMPARED, _STAYS = 3, 3e-7
#: halvings of the way to a grazing from either side that show whether it does
_CLOSER = 4


@dataclass(frozen=True)
class LocatedEvent:
    """An event between two neighbours: its test, where it lies, and at an extremum which way the curve turns.

    `rough`: where more harmonics are to locate it better; `slope`: about the test's derivative by arclength; `off`: how
    far it may still lie off, in scaled arclength, where nothing could locate it better; `ends`: the two neighbours.
    """

    test: CurveTest
    sample: Sample
    extreme: str = ""
    rough: Bracket | None = None
    slope: float = 0.0
    off: float = 0.0
    ends: tuple[Sample, Sample] | None = None

    def chord(self) -> Array | None:
        """The way between the neighbours, in the discretisation of the event: the direction of the curve where that of
        its own equations is not unique.
        """
        if self.ends is None:
            return None
        curve, (a, b) = self.sample.curve, self.ends
        way: Array = curve.transfer(b.point.u, b.curve) - curve.transfer(a.point.u, a.curve)
        return way


def events_between(
    samples: list[Sample],
    tests: tuple[CurveTest, ...],
    newton: NewtonOptions,
    notes: list[Note],
    crossing: LocatedEvent | None = None,
) -> list[LocatedEvent]:
    """Every event in a step, between its samples in order (both ends included, no test changing twice in between);
    `crossing`: one of curves that is known already.

    The first one's tests count in the discretisation it was found in, as on the step before: what changes sign there
    is not lost, nor found twice, if that of the others moves it across.
    """
    events: list[LocatedEvent] = []
    for test, (a, b) in itertools.product(tests, itertools.pairwise(samples)):
        if not test.changed(a, b):
            continue
        if crossing is not None and isinstance(test, CurvesCross) and a.place <= crossing.sample.place <= b.place:
            events.append(crossing)
            continue
        try:
            item = located(test, a, b, newton)
            events += [] if item is None else [item]
        except ConvergenceError as failure:
            turn = _turned(test, a, b)
            events += [] if turn is None else [turn]
            notes += [noted(test.kind, b, f"not located: {failure}")] if turn is None else []
    near = SAME * (samples[-1].place - samples[0].place)
    crossings = [item for item in events if isinstance(item.test, CurvesCross)]
    repeated = _repeated(crossings, near)
    if repeated:
        text = f"one BP is listed for {1 + len(repeated)}: curves nearly cross in one place, at the tip of a tongue"
        notes.append(noted("BP", repeated[0].sample, text))
    events = [item for item in events if not any(item is r for r in repeated)]
    return sorted(_genuine(events, samples[-1].curve, near), key=lambda item: item.sample.place)


def _repeated(crossings: list[LocatedEvent], near: float) -> list[LocatedEvent]:
    """Crossings beside one that is double but for little: two directions lead away, and rounding decides the
    orientation all around. Where motions become those of a k-th of the period, what holds the phase of the rest z
    vanishes like z^(k - 2).
    """
    if len(crossings) < 2:
        return []
    second = [float(np.linalg.svd(crossing_matrix(item.sample.point), compute_uv=False)[-2]) for item in crossings]
    repeated = []
    for item, own in zip(crossings, second, strict=True):
        beside = [s for o, s in zip(crossings, second, strict=True) if abs(o.sample.place - item.sample.place) <= near]
        if own > min(beside) and min(beside) < _DOUBLE:
            repeated.append(item)
    return repeated


def located(test: CurveTest, low: Sample, high: Sample, newton: NewtonOptions) -> LocatedEvent | None:
    """The event between two points with a sign change, None if it is none; raises ConvergenceError."""
    same = same_discretisation(low, high, newton)
    own = test.within(low, high)
    own = own if same is low else own.within(same, high)
    first, last = own.value(same), own.value(high)
    way = high.place - low.place
    if same is not low and first * last > 0.0:
        # in this discretisation it lies before the first
        slope = (last - first) / way
        sample = zero_along(same.point, own.value, newton, way, slope)
        if not own.genuine(sample):
            return None
        return LocatedEvent(own, sample, own.extreme(-slope, sample), None, slope, ends=(same, high))
    bracket = Bracket(same.point, high.point, (first, last), lambda point: own.value(Sample(point)), newton)
    if isinstance(own, CurvesCross):
        return crossing_in(bracket, LocatedEvent(own, high, ends=(same, high)))
    little = _JUMP * min(abs(first), abs(last))
    # on a curve of extrema those that others bring about are known by their distance; multipliers tell only close by
    apart = high.curve.augmentation.turning or type(own).genuine is not CurveTest.genuine or isinstance(own, Extremum)
    try:
        share = bracket.zero(_ROUGH)
    except ConvergenceError:
        if apart or not _jumps(bracket, little):
            raise
        return None
    if not apart and abs(bracket.values[share]) > little:
        share = bracket.zero(_RESOLVED)
        if abs(bracket.values[share]) > little:
            # it changes sign without vanishing, as c3 does in a corner
            return None
    sample, value = Sample(bracket.points[share]), bracket.values[share]
    if not own.genuine(sample) or (own.still(same) != own.still(high) and _begins(own, sample, newton)):
        return None
    slope = last - first
    if 0.0 < share < 1.0:
        # of the parabola through all three
        slope = (value - first) / share + (last - value) / (1.0 - share) - slope
    slope /= way
    # what more harmonics will move need not be known better
    finer = _finer(sample) is not None
    sample = sample if finer else Sample(bracket.points[bracket.zero(_RESOLVED)])
    return LocatedEvent(
        own, sample, own.extreme(first or -slope, sample), bracket if finer else None, slope, ends=(same, high)
    )


def crossing_in(bracket: Bracket, event: LocatedEvent) -> LocatedEvent:
    """An event (its sample: the far end) at which curves cross in a bracket, by equations that are regular there: those
    of a curve are singular, and what they give close by is rounding. Raises ConvergenceError, also where none cross.

    Where two directions lead away, or all but, the others are singular, too: then on the cubic between points beside.
    """
    curve = event.sample.curve
    for width in (1.0, _ACROSS):
        u = bracket.between(*bracket.narrowed(width))
        with suppress(ConvergenceError):
            sample = _crossing(event, curve, u)
            if 0.0 <= bracket.share(sample.point.u) <= 1.0:
                return _within(bracket, event, sample)
    event = _within(bracket, event, _placed(event, curve, u))
    event.test.genuine(event.sample)
    return event


def _within(bracket: Bracket, event: LocatedEvent, sample: Sample) -> LocatedEvent:
    """An event at a sample in a bracket, with its place along the curve."""
    arclength = bracket.points[0.0].arclength + bracket.share(sample.point.u) * bracket.way
    return replace(event, sample=sample.at(replace(sample.point, arclength=arclength)))


def _begins(test: CurveTest, at: Sample, newton: NewtonOptions) -> bool:
    """Whether a parameter begins to move there that stood before, or comes to stand, instead of turning: as omega of a
    mode does where a contact begins to touch.
    """
    with suppress(ConvergenceError):
        return any(test.still(Sample(point_ahead(at.point, way, newton))) for way in (-_ASIDE, _ASIDE))
    return False


def _jumps(bracket: Bracket, little: float) -> bool:
    """Whether a function jumps to the other sign where a contact grazes: on the way there from either side, as far as
    points are found, it keeps its sign and stays larger than a little.
    """
    values, ends = bracket.values, [0.0, 1.0]
    for low, high in itertools.pairwise(sorted(values)):
        if values[low] * values[high] <= 0.0:
            ends = [low, high]
    for side, _ in itertools.product((0, 1), range(_CLOSER)):
        grazes = contacts_between(*(Sample(bracket.points[share]) for share in ends)).grazes
        if grazes is None:
            return False
        share = 0.5 * (ends[side] + ends[0] + grazes * (ends[1] - ends[0]))
        with suppress(ConvergenceError):
            if bracket.value(share) * values[ends[side]] <= 0.0:
                return False
            ends[side] = share
    return 0.0 < ends[0] < ends[1] < 1.0 and min(abs(values[share]) for share in ends) > little


def _turned(test: CurveTest, a: Sample, b: Sample) -> LocatedEvent | None:
    """The extremum of a parameter between two points that nothing could locate, as in a corner: where a parameter runs
    the other way behind it there is one, smooth or not. None of a cusp's curve, where the function jumps in a corner.
    """
    if not isinstance(test, Extremum) or test.beside_cusps(a) or test.beside_cusps(b):
        return None
    nearest = min(a, b, key=lambda sample: abs(test.value(sample)))
    return LocatedEvent(test, nearest, test.extreme(test.value(a), nearest), off=b.place - a.place, ends=(a, b))


def _genuine(events: list[LocatedEvent], curve: MotionProblem, near: float) -> list[LocatedEvent]:
    """Events without those that others bring about.

    Slopes jump at a corner, and may seem to turn to and fro in it. Along a curve of extrema the extreme parameter turns
    where the third one does: w . (Y_q dq + Y_r dr) = 0, w the left null vector of M. At a cusp a symmetry may have both
    turn, which makes no extremum of either. Where a symmetry has curves cross, what is symmetric turns along one.
    """

    def beside(item: LocatedEvent, others: list[LocatedEvent]) -> bool:
        return any(o is not item and abs(item.sample.place - o.sample.place) <= near for o in others)

    turns = {name: [i for i in events if isinstance(i.test, Extremum) and i.test.name == name] for name in curve.names}
    dropped = [item for own in turns.values() for item in own if beside(item, own)]
    crossings = [item for item in events if isinstance(item.test, CurvesCross)]
    dropped += [item for item in events if item.test.at_crossings and beside(item, crossings)]
    extreme, last = curve.augmentation.turning, curve.names[-1]
    if extreme:
        cusps = [item for item in events if isinstance(item.test, Cusp)]
        both = [item for item in turns[extreme] if beside(item, turns[last])]
        dropped += both + [item for item in turns[last] if beside(item, cusps) and beside(item, both)]
    return [item for item in events if not any(item is d for d in dropped)]


def _finer(sample: Sample) -> HarmonicBasis | None:
    """The basis that an event asks for, None where the present one will do."""
    curve = sample.curve
    if curve.adaptive is None:
        return None
    basis = choose_harmonics(sample.state, curve.adaptive, curve.adaptive.event_tolerance)
    return basis if basis.harmonics > curve.balance.basis.harmonics else None


def refined(event: LocatedEvent, newton: NewtonOptions, notes: list[Note]) -> LocatedEvent:
    """An event located again with the harmonics that events ask for."""
    sample = event.sample
    # what could not be located is not found with more
    for _ in range(6 if event.off == 0.0 else 0):
        basis = _finer(sample)
        if basis is None:
            break
        try:
            sample = _with_more(event, sample, basis, newton)
        except ConvergenceError as failure:
            note = _lost(event, sample, basis, failure)
            if sample is event.sample and event.rough is not None:
                try:
                    sample = Sample(event.rough.points[event.rough.zero(_RESOLVED)])
                except ConvergenceError as again:
                    note = replace(note, text=f"{note.text}. Without these: {again}")
                    event = replace(event, off=_ROUGH * event.rough.way)
            notes.append(note)
            break
    event = event if sample is event.sample else replace(event, sample=sample)
    return _settled(event, newton, notes) if event.test.of_third_order and event.off == 0.0 else event


def _settled(event: LocatedEvent, newton: NewtonOptions, notes: list[Note]) -> LocatedEvent:
    """An event that a coefficient of third order tells of, with more harmonics until it stays, as far as they go: from
    contacts these converge like 1 / H, and unevenly. Else the larger of the last two moves is how far it may lie off.
    """
    moves: list[float] = []
    fewest, rule = event.sample, event.sample.curve.adaptive
    if rule is None:
        return event
    for _ in range(_COMPARED):
        basis = next_harmonics(event.sample.state, rule)
        more = basis.harmonics > event.sample.state.basis.harmonics
        start = event.sample if more else fewest
        if not more:
            if len(moves) > 1:
                break
            nu, high = start.state.basis.nu, start.state.basis.harmonics
            basis = HarmonicBasis(nu * math.ceil(high / (1.5 * nu)), nu)
        try:
            found = _with_more(event, start, basis, newton)
        except ConvergenceError as failure:
            notes.append(_lost(event, start, basis, failure))
            break
        k = len(found.curve.names)
        moves.append(length((found.point.u[-k:] - start.point.u[-k:]) * found.point.weights[-k:]))
        if more:
            event = replace(event, sample=found)
            if moves[-1] <= _STAYS:
                return event
        else:
            fewest = found
    return replace(event, off=max(moves[-2:], default=0.0))


def _lost(event: LocatedEvent, sample: Sample, basis: HarmonicBasis, failure: ConvergenceError) -> Note:
    """A note on an event that other harmonics do not have."""
    few, more = sample.state.basis.harmonics, basis.harmonics
    text = f"located with few harmonics ({few}), not found again with more ({more}: {failure})"
    return noted(event.test.kind, sample, f"{text}. Use more harmonics for the whole curve")


def noted(kind: str, sample: Sample, text: str) -> Note:
    """A note on an event at a motion of a tracked curve."""
    value = sample.point.parameter
    return Note(text, sample.curve.name, value, value, kind, sample.where)


def _with_more(event: LocatedEvent, sample: Sample, basis: HarmonicBasis, newton: NewtonOptions) -> Sample:
    """An event in a basis with more harmonics, beside the place that it has with fewer; raises ConvergenceError."""
    curve = sample.curve
    finer, state = curve.finer(sample.state, basis)
    u = finer.transfer(sample.point.u, curve)
    u[: finer.balance.dimension] = state.unknowns
    if isinstance(event.test, CurvesCross):
        return _crossing(event, finer, u)
    weights = finer.weights(u, curve.size(sample.point.u))
    start = nearest_point(finer, u, weights, newton, finer.transfer(sample.point.tangent, curve), BEGINNING)
    near = Sample(replace(start, arclength=sample.point.arclength))
    test = event.test.within(near, near)
    return zero_along(near.point, test.value, newton, _BESIDE, event.slope, factor=start.factor)


def _crossing(event: LocatedEvent, curve: MotionProblem, u: Array) -> Sample:
    """Where curves cross beside u, by equations that are regular there; raises ConvergenceError."""
    weights = curve.weights(u, event.sample.curve.size(event.sample.point.u))
    try:
        return _placed(event, curve, crossing_point(curve, u, weights))
    except np.linalg.LinAlgError as singular:
        raise ConvergenceError(f"no crossing of curves was found beside {curve.where(u)}") from singular


def _placed(event: LocatedEvent, curve: MotionProblem, u: Array) -> Sample:
    """A crossing of curves at u, with the direction of the curve, which its own equations do not tell there."""
    point = event.sample.point
    weights = curve.weights(u, point.curve.size(point.u))
    chord = event.chord()
    along = curve.transfer(point.tangent if chord is None else chord, point.curve)
    tangent = along / length(weights * along)
    return event.sample.at(
        replace(point, curve=curve, u=u, tangent=tangent, weights=weights, evaluation=curve.evaluate(u), factor=None)
    )


def as_event(event: LocatedEvent, method: StabilityMethod, observe: int) -> TrackedEvent:
    """An event as users get it; `observe`: the DOF whose amplitude is reported."""
    sample = event.sample
    curve, orbit = sample.curve, sample.orbit
    name = getattr(event.test, "name", curve.names[:2][-1])
    chord = event.chord() if isinstance(event.test, CurvesCross) else None
    vectors, kappa = sample.vectors, sample.kappa
    if curve.augmentation.name == LimitCycle.name and event.test.kind in ("PD", "NS"):
        vectors, kappa = sample.critical_vectors(OPERATORS[event.test.kind])
    return TrackedEvent(
        event.test.kind,
        orbit,
        sample.evaluation.floquet if curve.augmentation.no_multipliers else method.along(sample.state),
        orbit.residual,
        orbit.amplitude(observe),
        name,
        vectors,
        kappa,
        arclength=sample.point.arclength,
        # a parameter changes by no more than its range along a unit of arclength
        uncertainty=event.off * curve.spans[curve.names.index(name)] if name in curve.names else 0.0,
        tangent=None if chord is None else tuple(chord.tolist()),
        curve=curve.augmentation.name,
        names=curve.names,
        extreme=event.extreme,
        contact=_contact(sample),
        multiplicity=curve.augmentation.own.multiplicity,
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
    return GrazingContact(of.element, local.element.label, level_of(local, of.index), time, "", value)


def _isola(event: LocatedEvent) -> str:
    """What happens to branches at an extremum along a curve of limit points."""
    curve, sample = event.sample.curve, event.sample
    base = curve.augmentation
    if not isinstance(event.test, Extremum) or not isinstance(base, SingularOperator) or base.name != "LP":
        return ""
    (beside,) = set(curve.names) - {event.test.name}
    extremal = LimitPointExtremal(base, beside, 1.0, event.test.name)
    return extremal.at(sample.state, sample.evaluation.extra, curve.names).isola
