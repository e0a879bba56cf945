"""Between which values of the design parameter a closed branch stays detached, and what happens at the two ends.

As the parameter q changes, a closed branch can change its nature only where one of its limit points meets another (an
extremum of q along their curve, or a cusp) or, for sub-harmonic motions, where period doublings of the parent appear.
From a value at which the branch is detached one goes on to the next such event, and follows the branch again behind
those that may concern it. At the end of the range it is followed once more: what no known event accounts for is located
by bisection and noted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.maps.isolas.loops import Loop, Loops
from suboctave.maps.isolas.result import IsolaEnd
from suboctave.maps.pieces import MonotonePiece

__all__ = ["Existence", "extend"]

#: halvings of the interval in which a branch ceases to be detached for no known reason
_BISECTIONS = 10
#: share of the way to an event, before it, at which the branch is followed once more
_BEFORE = 1e-3


@dataclass
class Existence:
    """The range of a detached branch: the pieces that its limit points lie on, its ends, loops that are known.

    To begin with a single value.
    """

    pieces: list[MonotonePiece]
    loops: list[Loop]
    low: float
    high: float
    ends: tuple[IsolaEnd | None, IsolaEnd | None] = (None, None)
    reasons: tuple[str, str] = ("not followed to lower values", "not followed to higher values")
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, loop: Loop) -> Existence:
        """A branch that is detached at a value."""
        return cls(list(loop.pieces), [loop], loop.value, loop.value)

    def covers(self, piece: MonotonePiece, value: float) -> bool:
        """Whether a piece's limit point at a value lies on it."""
        return piece in self.pieces and self.low <= value <= self.high

    def take(self, loop: Loop) -> None:
        """The branch at another value, detached as well."""
        self.loops.append(loop)
        self.pieces += [piece for piece in loop.pieces if piece not in self.pieces]

    def ends_at(self, event: TrackedEvent) -> bool:
        """Whether it ends at an event, whose orbit its end shares."""
        return any(end is not None and end.orbit is event.orbit for end in self.ends)


@dataclass(frozen=True)
class _End:
    """How a detached branch ends in one direction: where, why, by which event, and whether it shrinks to a point."""

    value: float
    reason: str
    event: TrackedEvent | None = None
    centre: bool = False

    def as_end(self, name: str) -> IsolaEnd | None:
        """What happens there, where that is known."""
        return None if self.event is None else IsolaEnd.of(self.event, name, self.centre)


def extend(isola: Existence, loops: Loops, others: Sequence[Existence]) -> None:
    """Find the range over which a detached branch stays so, and is none of the others."""
    name = loops.catalogue.name
    low = _Direction(False, isola, loops, others).end()
    isola.low, isola.ends, isola.reasons = low.value, (low.as_end(name), None), (low.reason, isola.reasons[1])
    high = _Direction(True, isola, loops, others).end()
    isola.high, isola.ends = high.value, (isola.ends[0], high.as_end(name))
    isola.reasons = (low.reason, high.reason)


class _Direction:
    """A detached branch over rising (`upper`) or falling values of the parameter."""

    def __init__(self, upper: bool, isola: Existence, loops: Loops, others: Sequence[Existence]) -> None:
        self.upper = upper
        self.isola = isola
        self.loops = loops
        self.others = others
        self.name = loops.catalogue.name
        self.bound = loops.catalogue.bounds[1 if upper else 0]

    def end(self) -> _End:
        """Go on until the branch vanishes, meets another one, or the range ends."""
        loop = self.isola.loops[0]
        while (step := next(self._relevant(loop), None)) is not None:
            after = self._behind(loop, *step)
            if isinstance(after, _End):
                return after
            self.isola.take(after)
            loop = after
        last = [piece for piece in loop.pieces if piece.contains(self.bound)]
        if not last:
            reach = (max if self.upper else min)(p.high if self.upper else p.low for p in loop.pieces)
            return _End(reach, f"from {self.name} = {reach:.9g} on its limit points could not be followed")
        cut = _End(self.bound, f"{self.name} = {self.bound:.9g}, the end of the bounds, cuts its range")
        if loop.value == self.bound:
            return cut
        at_bound = self.loops.through(last[0], self.bound)
        if at_bound is None:
            return _End(loop.value, f"behind {self.name} = {loop.value:.9g} it could not be followed")
        if at_bound.detached:
            self.isola.take(at_bound)
            return cut
        return self._bisected(last[0], loop, at_bound)

    def _behind(self, loop: Loop, value: float, events: list[TrackedEvent]) -> Loop | _End:
        """The detached branch behind events at a value, or how it ends there."""
        own = [e for e in events if any(piece.end(self.upper) is e for piece in loop.pieces)]
        ending = [piece for piece in loop.pieces if any(piece.end(self.upper) is e for e in own)]
        lasting = [piece for piece in loop.pieces if piece not in ending and piece.contains(value)]
        if not lasting:
            return _vanishing(value, own or events, self.name)
        behind = 0.5 * (value + self._next(loop, value))
        after = self.loops.through(lasting[0], behind)
        if after is None:
            return _End(value, f"at {self.name} = {value:.9g} it could not be followed further")
        event = _reconnecting(own or events)
        if not after.detached:
            if event is None or not (own or self._detached_before(value, lasting[0], loop)):
                return self._bisected(lasting[0], loop, after)
            return _End(value, _merging(self.name, value, event, after), event)
        other = next((o for o in self.others if any(o.covers(piece, behind) for piece in after.pieces)), None)
        return after if other is None else _End(value, _joining(self.name, value, own or events, other), event)

    def _detached_before(self, value: float, piece: MonotonePiece, loop: Loop) -> bool:
        """Whether a branch is detached until just before an event that is none of its own limit points."""
        before = self.loops.through(piece, value - _BEFORE * (value - loop.value))
        if before is None or not before.detached:
            return False
        self.isola.take(before)
        return True

    def _relevant(self, loop: Loop) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """Events ahead that may concern a branch: those of its own limit points, and those that reconnect others."""
        for value, events in self.loops.critical(loop.pieces[0].nu, loop.value, self.upper):
            own = any(piece.end(self.upper) is e for piece in loop.pieces for e in events)
            if own or any(e.isola == "isola_merging" or e.curve == "PD" for e in events):
                yield value, events

    def _next(self, loop: Loop, value: float) -> float:
        """The value of the next event of any kind behind another, or the bound."""
        return next(self.loops.critical(loop.pieces[0].nu, value, self.upper), (self.bound, []))[0]

    def _bisected(self, piece: MonotonePiece, inside: Loop, outside: Loop) -> _End:
        """Where a branch ceases to be detached though no event that is known explains it."""
        a, b = inside.value, outside.value
        for _ in range(_BISECTIONS):
            middle = self.loops.through(piece, 0.5 * (a + b))
            if middle is None:
                break
            if middle.detached:
                self.isola.take(middle)
                a = middle.value
            else:
                b = middle.value
        low, high = sorted((a, b))
        self.isola.notes.append(
            f"between {self.name} = {low:.6g} and {high:.6g} it ceases to be detached, and no event that was found "
            "says why"
        )
        return _End(a, f"detached up to {self.name} = {a:.6g} at least, no longer at {b:.6g}")


def _reconnecting(events: list[TrackedEvent]) -> TrackedEvent | None:
    """The event that reconnects branches."""
    for event in events:
        if event.isola == "isola_merging" or event.curve == "PD" or (event.kind == "extremum" and not event.isola):
            return event
    return None


def _vanishing(value: float, events: list[TrackedEvent], name: str) -> _End:
    for event in events:
        if event.kind == "extremum" and event.isola != "isola_merging":
            where = f"omega = {event.omega:.9g}, {name} = {value:.9g}"
            return _End(value, f"shrinks to a point (isola centre) at {where}", event, True)
    (event, *_) = events
    return _End(value, f"its last limit points vanish in a {event.kind} at {name} = {value:.9g}")


def _merging(name: str, value: float, event: TrackedEvent, after: Loop) -> str:
    where = f"omega = {event.omega:.9g}, {name} = {value:.9g}"
    met = [str(j) for j in (after.branch.departs, after.branch.arrives) if j is not None]
    if event.curve == "PD":
        return f"meets the motion whose period it doubles at {where}"
    what = f"the branch between {' and '.join(met)}" if met else "a branch that runs through the range"
    return f"merges at {where} with {what}"


def _joining(name: str, value: float, events: list[TrackedEvent], other: Existence) -> str:
    place = ", ".join(f"{name} = {float(e):.7g}" for e in other.ends if e is not None and e.kind == "isola_centre")
    which = f"the isola born at {place}" if place else "another isola"
    return f"merges at omega = {events[0].omega:.9g}, {name} = {value:.9g} with {which}, as which it goes on"
