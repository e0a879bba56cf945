"""Between which values of the design parameter a closed branch stays detached, and what happens at the two ends.

As the parameter q changes, a closed branch can change its nature only where one of its limit points meets another (an
extremum of q along their curve, or a cusp) or, for sub-harmonic motions, where period doublings of the parent appear.
From a value at which the branch is detached one goes on to the next such event, and looks at the branch again behind
those that may concern it. At the end of the range it is looked at once more: what no known event accounts for is found
by bisection and said.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from suboctave.analysis.isola import IsolaEnd
from suboctave.analysis.isola_survey import Loop, Survey
from suboctave.analysis.limit_curves import Leg
from suboctave.bifurcation.tracked import TrackedEvent

__all__ = ["Life", "extend"]

_BISECTIONS = 10
#: share of the way to an event at which the branch is looked at before it
_BEFORE = 1e-3


@dataclass
class Life:
    """The range of a detached branch: the legs that its limit points lie on, its ends, loops that are known.

    To begin with a single value.
    """

    legs: list[Leg]
    loops: list[Loop]
    low: float
    high: float
    ends: tuple[IsolaEnd | None, IsolaEnd | None] = (None, None)
    reasons: tuple[str, str] = ("not followed to lower values", "not followed to higher values")
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, loop: Loop) -> Life:
        """A branch that is detached at a value."""
        return cls(list(loop.legs), [loop], loop.value, loop.value)

    def covers(self, leg: Leg, value: float) -> bool:
        """Whether a leg's limit point at a value lies on it."""
        return leg in self.legs and self.low <= value <= self.high

    def ends_at(self, event: TrackedEvent) -> bool:
        """Whether it ends at an event, whose orbit its end shares."""
        return any(end is not None and end.orbit is event.orbit for end in self.ends)


@dataclass(frozen=True)
class _End:
    """How a detached branch ends in one direction."""

    value: float
    event: TrackedEvent | None
    centre: bool
    reason: str

    def as_end(self, name: str) -> IsolaEnd | None:
        """What happens there, where that is known."""
        return None if self.event is None else IsolaEnd.of(self.event, name, self.centre)


def extend(life: Life, survey: Survey, others: Sequence[Life]) -> None:
    """Find the range over which a detached branch stays so, and is none of the others."""
    (loop,) = life.loops
    low = _extended(loop, False, survey, life, others)
    life.low, life.ends, life.reasons = low.value, (low.as_end(survey.name), None), (low.reason, life.reasons[1])
    high = _extended(loop, True, survey, life, others)
    life.high, life.ends, life.reasons = high.value, (life.ends[0], high.as_end(survey.name)), (low.reason, high.reason)


def _extended(loop: Loop, upper: bool, survey: Survey, life: Life, others: Sequence[Life]) -> _End:
    """Go on in one direction until the branch vanishes, meets another one, or the range ends."""
    name = survey.name
    bound = survey.bounds[1] if upper else survey.bounds[0]
    while True:
        step = next(iter(_relevant(loop, upper, survey)), None)
        if step is None:
            break
        value, events = step
        own = [e for e in events if any(leg.end(upper) is e for leg in loop.legs)]
        lasting = [leg for leg in loop.legs if not any(leg.end(upper) is e for e in own) and leg.contains(value)]
        if not lasting:
            return _vanishing(value, own or events, name)
        behind = _middle_behind(value, loop, upper, survey)
        after = survey.loop(lasting[0], behind)
        if after is None:
            return _End(value, None, False, f"at {name} = {value:.9g} it could not be followed further")
        if not after.detached:
            chosen = _culprit(own or events)
            if chosen is None or not (own or _detached_before(value, lasting[0], loop, survey, life)):
                return _bisected(lasting[0], loop, after, survey, life)
            return _End(value, chosen, False, _merging(name, value, chosen, after))
        other = next((o for o in others if any(o.covers(leg, behind) for leg in after.legs)), None)
        if other is not None:
            return _End(value, _culprit(own or events), False, _joining(name, value, own or events, other))
        _take(life, after)
        loop = after
    last = [leg for leg in loop.legs if leg.contains(bound)]
    if not last:
        reach = (max if upper else min)(leg.high if upper else leg.low for leg in loop.legs)
        return _End(reach, None, False, f"from {name} = {reach:.9g} on its limit points could not be followed")
    if loop.value == bound:
        return _End(bound, None, False, f"{name} = {bound:.9g}, the end of the bounds, cuts its range")
    after = survey.loop(last[0], bound)
    if after is None:
        return _End(loop.value, None, False, f"behind {name} = {loop.value:.9g} it could not be followed")
    if after.detached:
        _take(life, after)
        return _End(bound, None, False, f"{name} = {bound:.9g}, the end of the bounds, cuts its range")
    return _bisected(last[0], loop, after, survey, life)


def _detached_before(value: float, leg: Leg, loop: Loop, survey: Survey, life: Life) -> bool:
    """Whether a branch is detached until just before an event that is none of its own limit points."""
    before = survey.loop(leg, value - _BEFORE * (value - loop.value))
    if before is None or not before.detached:
        return False
    _take(life, before)
    return True


def _relevant(loop: Loop, upper: bool, survey: Survey) -> Iterable[tuple[float, list[TrackedEvent]]]:
    """Events ahead that may concern a branch: those of its own limit points, and those that reconnect others."""
    for value, events in survey.critical(loop.legs[0].nu, loop.value, upper):
        own = any(leg.end(upper) is e for leg in loop.legs for e in events)
        if own or any(e.isola == "isola_merging" or e.curve == "PD" for e in events):
            yield value, events


def _middle_behind(value: float, loop: Loop, upper: bool, survey: Survey) -> float:
    """Between an event and the next one of any kind, or the bound."""
    bound = survey.bounds[1] if upper else survey.bounds[0]
    after, _ = next(iter(survey.critical(loop.legs[0].nu, value, upper)), (bound, []))
    return 0.5 * (value + after)


def _culprit(events: list[TrackedEvent]) -> TrackedEvent | None:
    """The event that reconnects branches."""
    for event in events:
        if event.isola == "isola_merging" or event.curve == "PD" or (event.kind == "extremum" and not event.isola):
            return event
    return None


def _vanishing(value: float, events: list[TrackedEvent], name: str) -> _End:
    for event in events:
        if event.kind == "extremum" and event.isola != "isola_merging":
            where = f"omega = {event.omega:.9g}, {name} = {value:.9g}"
            return _End(value, event, True, f"shrinks to a point (isola centre) at {where}")
    (event, *_) = events
    return _End(value, None, False, f"its last limit points vanish in a {event.kind} at {name} = {value:.9g}")


def _merging(name: str, value: float, event: TrackedEvent, after: Loop) -> str:
    where = f"omega = {event.omega:.9g}, {name} = {value:.9g}"
    met = [str(j) for j in (after.branch.departs, after.branch.arrives) if j is not None]
    if event.curve == "PD":
        return f"meets the motion whose period it doubles at {where}"
    what = f"the branch between {' and '.join(met)}" if met else "a branch that runs through the range"
    return f"merges at {where} with {what}"


def _joining(name: str, value: float, events: list[TrackedEvent], other: Life) -> str:
    place = ", ".join(f"{name} = {float(e):.7g}" for e in other.ends if e is not None and e.kind == "isola_centre")
    which = f"the isola born at {place}" if place else "another isola"
    return f"merges at omega = {events[0].omega:.9g}, {name} = {value:.9g} with {which}, as which it goes on"


def _bisected(leg: Leg, inside: Loop, outside: Loop, survey: Survey, life: Life) -> _End:
    """Where a branch ceases to be detached though no event that is known explains it."""
    name = survey.name
    a, b = inside.value, outside.value
    for _ in range(_BISECTIONS):
        middle = survey.loop(leg, 0.5 * (a + b))
        if middle is None:
            break
        if middle.detached:
            _take(life, middle)
            a = middle.value
        else:
            b = middle.value
    low, high = sorted((a, b))
    life.notes.append(
        f"between {name} = {low:.6g} and {high:.6g} it ceases to be detached, and no event that was found says why"
    )
    return _End(a, None, False, f"detached up to {name} = {a:.6g} at least, no longer at {b:.6g}")


def _take(life: Life, loop: Loop) -> None:
    life.loops.append(loop)
    life.legs += [leg for leg in loop.legs if leg not in life.legs]
