"""The verdicts that a branch states: asked of the user's method where they are open, with what no method could tell.

Along a curve every motion has multipliers from `StabilityMethod.along`. Where one of them lies within its error of the
unit circle the verdict is open, and `StabilityMethod.settled` is asked once the curve is known. What it leaves open is
stated, as a stretch between the nearest motions with a clear verdict, unless a bifurcation located beside the motion
is the reason: there a multiplier has to be on the circle. Where the parameter stands still one is on it all along a
piece, which is said instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.bifurcation.measures import in_doubt
from suboctave.continuation.ending import Ending
from suboctave.continuation.linear import Factor
from suboctave.continuation.notes import Note
from suboctave.curves.trace import BranchPoint, Trace, Unsettled, joined
from suboctave.floquet.methods import StabilityMethod
from suboctave.floquet.result import FloquetResult, written
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import MOST_HARMONICS
from suboctave.interruption import Interruption
from suboctave.kinds import KINDS

#: distance, in scaled arclength and of multipliers, up to which bifurcations fall together
_AT_ONCE = 1e-5
_UNRESOLVED = (
    "multipliers are not resolved with these harmonics: stability is open, and Neimark-Sacker points are not looked for"
)
#: motions in a row that witnesses could not settle, after which they are not asked until a verdict is clear again
_PATIENCE = 3


def with_verdicts(trace: Trace, method: StabilityMethod, name: str) -> Trace:
    """A trace whose open verdicts were asked of the method whose `along` gave the multipliers of its points, and that
    says what stayed open; `name`: the free parameter.
    """
    asking = _Asking(method, not trace.interrupted)
    # right beside another branch a multiplier is as near +1 as one likes
    beside = {0} if trace.departs is not None else set()
    beside |= {len(trace.points) - 1} if trace.arrives is not None else set()
    points = _settled(trace.points, asking, beside)
    bifurcations = [_at_event(item, asking) for item in trace.bifurcations]
    events = [_at_event(item, asking) for item in trace.events]
    if asking.interruption is not None:
        trace.ends(Ending.stopped(asking.interruption, "its end, before open verdicts on stability were settled"))
    in_doubt = [i for i, p in enumerate(points) if not (p.floquet.decided or p.still)]
    # a branch that leaves or meets another does so with a multiplier at +1
    ends = [replace(item, kind="BP") for item in (trace.departs, trace.arrives) if item is not None]
    known = [*bifurcations, *ends]
    if trace.closed and points:
        # what lies at the seam lies at both ends
        whole = points[-1].arclength
        known += [replace(item, arclength=item.arclength + way) for item in bifurcations for way in (-whole, whole)]
    open_ones = [
        i
        for first, last in _runs(in_doubt)
        for i in range(first, last + 1)
        if not _explained(points[i].floquet, _reach(points, first, last, trace.closed), known)
    ]
    unsettled, notes = _stretches(points, open_ones, name)
    for probe in trace.open:
        stretch = None if probe.still else _between(probe, points, known, name, trace.closed)
        if stretch is None:
            continue
        first, last = stretch.arclength
        if not any(first < u.arclength[1] and u.arclength[0] < last for u in (*trace.audit.unsettled, *unsettled)):
            unsettled.append(stretch)
    notes += [note for item in bifurcations if (note := _doubt_beside(item, bifurcations)) is not None]
    notes += [*_standing(points, name), *_replaced(points, method, name), *_at_most(points, name)]
    return replace(
        trace,
        points=points,
        bifurcations=bifurcations,
        events=events,
        notes=[*trace.notes, *notes],
        audit=replace(trace.audit, unsettled=tuple(joined((*trace.audit.unsettled, *unsettled)))),
    )


class _Asking:
    """A method that is asked until it is interrupted; of an interrupted curve it is not asked at all."""

    def __init__(self, method: StabilityMethod, whole: bool) -> None:
        self.method = method
        self.going_on = whole
        self.interruption: Interruption | None = None

    def answer(self, state: BalanceState, known: FloquetResult, settle: bool = True) -> FloquetResult:
        """The verdict where one is open, with witnesses; or the method's multipliers in place of others."""
        if self.going_on:
            try:
                if not settle:
                    return self.method.along(state)
                signs = Factor.of(state.jacobian).sign, Factor.of(state.half_jacobian).sign
                return in_doubt(self.method.settled(state, known), *signs)
            except KeyboardInterrupt as cause:
                self.interruption, self.going_on = Interruption.of(cause), False
        return known


def _settled(points: Sequence[BranchPoint], asking: _Asking, beside: set[int]) -> list[BranchPoint]:
    settled: list[BranchPoint] = []
    in_vain = 0
    for number, point in enumerate(points):
        result = point.floquet
        if result.decided:
            in_vain = 0
        elif "harmonics" in result.checks or not result.resolved:
            # more harmonics have been asked already, or would be needed
            pass
        elif number not in beside and not point.still and in_vain < _PATIENCE:
            result = asking.answer(point.orbit.state(), result)
            in_vain = 0 if result.decided else in_vain + 1
        settled.append(point if result is point.floquet else replace(point, known=result))
    return settled


def _at_event(item: Bifurcation, asking: _Asking) -> Bifurcation:
    """A located motion with the method's multipliers; asked for a verdict only if more than the critical one is open.

    Those of the search are the monodromy matrix's.
    """
    result = item.floquet
    monodromy = asking.method.follows_monodromy
    if monodromy and not _others_open(item).any():
        return item
    state = item.orbit.state()
    if not monodromy:
        result = asking.answer(state, result, settle=False)
    if _others_open(replace(item, floquet=result)).any():
        result = asking.answer(state, result)
    return replace(item, floquet=result)


def _others_open(item: Bifurcation) -> np.ndarray:
    """The same without those that make the bifurcation."""
    within = item.floquet.open
    count = KINDS[item.kind].critical * item.multiplicity if item.kind in KINDS else 0
    if count:
        mu = item.multipliers
        critical = item.critical_multiplier()
        distance = np.minimum(np.abs(mu - critical), np.abs(mu - np.conj(critical)))
        within[np.argsort(distance, kind="stable")[:count]] = False
    return within


def _doubt_beside(item: Bifurcation, bifurcations: Sequence[Bifurcation]) -> Note | None:
    """A note if a multiplier besides the critical one leaves open what is stable on either side, and none of the
    bifurcations that fall together with it is why.
    """
    within = _others_open(item)
    for other in bifurcations:
        together = abs(other.arclength - item.arclength) <= _AT_ONCE and other.kind not in CONTACT_KINDS
        if together and other is not item:
            critical = other.critical_multiplier()
            away = np.minimum(np.abs(item.multipliers - critical), np.abs(item.multipliers - np.conj(critical)))
            within &= away > _AT_ONCE
    if item.kind in CONTACT_KINDS or not within.any():
        return None
    i = int(np.argmax(within))
    mu, error = item.multipliers[i], item.floquet.errors[i]
    value = item.parameter(item.parameter_name)
    return Note(
        f"another multiplier ({written(mu, error)}) lies within its error of the unit circle: stability on its two "
        "sides is open. Use more harmonics or so.verify",
        *(item.parameter_name, value, value, item.kind),
    )


def _reach(points: Sequence[BranchPoint], first: int, last: int, closed: bool) -> tuple[float, float]:
    """Arclengths of the neighbours of a run of points, of a closed curve beyond its seam as well."""
    low, high = points[max(first - 1, 0)].arclength, points[min(last + 1, len(points) - 1)].arclength
    if closed and len(points) > 1:
        whole = points[-1].arclength
        low = points[-2].arclength - whole if first == 0 else low
        high = points[1].arclength + whole if last == len(points) - 1 else high
    return low, high


def _explained(result: FloquetResult, reach: tuple[float, float], bifurcations: Sequence[Bifurcation]) -> bool:
    """Whether a bifurcation within reach is why a multiplier lies within its error of the circle."""
    near = {item.kind for item in bifurcations if reach[0] <= item.arclength <= reach[1]}
    within = result.open
    mu, errors = result.multipliers[within], result.errors[within]
    explained = np.zeros(len(mu), dtype=bool)
    if not result.resolved:
        # what may be anywhere is no evidence of a bifurcation
        return False
    if near & {"LP", "BP"}:
        explained |= np.abs(mu - 1.0) <= 2.0 * errors
    if "PD" in near:
        explained |= np.abs(mu + 1.0) <= 2.0 * errors
    if "NS" in near:
        explained |= np.abs(mu.imag) > errors
    return bool(explained.all())


def _stretches(points: Sequence[BranchPoint], open_ones: list[int], name: str) -> tuple[list[Unsettled], list[Note]]:
    """What stayed open, as stretches between clear verdicts, and notes on them."""
    stretches: list[Unsettled] = []
    notes: list[Note] = []
    for first, last in _runs(open_ones):
        a, b = points[max(first - 1, 0)], points[min(last + 1, len(points) - 1)]
        result = points[first].floquet
        # at a point where a pair lies on the circle the product may be one by chance
        if all(point.floquet.undamped for point in (a, points[first], b)):
            text = "the motion is undamped: its multipliers stay on the unit circle, stability is open. Add damping"
            notes.append(Note(text, name, _value(a, name), _value(b, name)))
            continue
        if not all(points[i].floquet.resolved for i in range(first, last + 1)):
            stretches.append(_stretch(a, b, name, _UNRESOLVED))
            continue
        worst = f"{_worst(result)} by {result.method}"
        reason = f"stability is open: a multiplier ({worst}) lies within its error of the unit circle"
        stretches.append(_stretch(a, b, name, reason))
    return stretches, notes


def _worst(result: FloquetResult) -> str:
    """The largest multiplier within its error of the unit circle, with that error."""
    i = int(np.argmax(result.open))
    return written(result.multipliers[i], result.errors[i])


def _stretch(a: BranchPoint, b: BranchPoint, name: str, reason: str) -> Unsettled:
    return Unsettled(name, _value(a, name), _value(b, name), (a.arclength, b.arclength), reason)


def _standing(points: Sequence[BranchPoint], name: str) -> list[Note]:
    """A note for each piece along which the parameter stands still: a linear equation has a multiple of every
    motion, up to the one whose contacts begin or cease to touch.
    """
    notes = []
    for first, last in _runs([i for i, point in enumerate(points) if point.still]):
        here = _value(points[first], name)
        around = [_value(points[i], name) - here for i in (first - 1, last + 1) if 0 <= i < len(points)]
        turns = "; the branch turns back across it" if len(around) > 1 and around[0] * around[1] > 0.0 else ""
        text = f"constant along a piece of the branch, on which motions differ in size and a multiplier is +1{turns}"
        notes.append(Note(text, name, here, here))
    return notes


def _at_most(points: Sequence[BranchPoint], name: str) -> list[Note]:
    """A note where the most harmonics that a rule allows leave out more of motions than its tolerance."""
    lacking = [point for point in points if _lacks_harmonics(point.orbit)]
    if not lacking:
        return []
    first, last, worst = lacking[0], lacking[-1], max((p.orbit for p in lacking), key=lambda orbit: orbit.truncation)
    most, rule = worst.basis.harmonics // worst.basis.nu, worst.adaptive
    assert rule is not None
    more = 2 * most + 1
    way = f"Use harmonics=so.AdaptiveHarmonics(maximum={more}), four times the time a point, or so.verify"
    text = (
        f"{most} harmonics leave out up to {worst.truncation:.0e} of the motion (tolerance {rule.tolerance:.0e}). "
        f"{way if more <= MOST_HARMONICS else 'Use so.verify'}"
    )
    return [Note(text, name, _value(first, name), _value(last, name))]


def _lacks_harmonics(orbit: PeriodicOrbit) -> bool:
    rule = orbit.adaptive
    if rule is None:
        return False
    return orbit.basis.harmonics >= rule.usual * orbit.basis.nu and orbit.truncation > rule.tolerance


def _replaced(points: Sequence[BranchPoint], method: StabilityMethod, name: str) -> list[Note]:
    """A note where the monodromy matrix had to be taken for the method that was asked for."""
    places = [i for i, p in enumerate(points) if p.floquet.stands_in]
    if not places:
        return []
    text = (
        f"stability method {method.name!r} is not applicable, multipliers are those of the monodromy matrix. "
        f"{points[places[0]].floquet.note}"
    )
    return [Note(text, name, _value(points[a], name), _value(points[b], name)) for a, b in _runs(places)]


def _between(
    probe: BranchPoint, points: Sequence[BranchPoint], bifurcations: Sequence[Bifurcation], name: str, closed: bool
) -> Unsettled | None:
    """The step in which a multiplier comes within its error of the circle, unless a located bifurcation is why."""
    result = probe.floquet
    if result.undamped:
        return None
    at = int(np.searchsorted([p.arclength for p in points], probe.arclength))
    low, high = max(at - 1, 0), min(at, len(points) - 1)
    first, last = low, high
    while first > 0 and not points[first].floquet.decided:
        first -= 1
    while last < len(points) - 1 and not points[last].floquet.decided:
        last += 1
    if _explained(result, _reach(points, first, last, closed), bifurcations):
        return None
    words = f"{_worst(result)} at {name} = {_value(probe, name):.9g}"
    reason = f"a multiplier ({words}) comes within its error of the unit circle and may pass it"
    return _stretch(points[low], points[high], name, reason)


def _runs(places: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First and last of each run of consecutive numbers."""
    for _, run in groupby(enumerate(places), lambda pair: pair[1] - pair[0]):
        first, *rest = (place for _, place in run)
        yield first, rest[-1] if rest else first


def _value(point: BranchPoint, name: str) -> float:
    return point.orbit.omega if name == "omega" else point.orbit.values[name]
