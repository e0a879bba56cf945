"""The search for isolas: limit points that no branch explains lead to closed branches, these to ranges of existence.

As the design parameter q changes, a closed branch can change its nature only where one of its limit points meets
another (an extremum of q along their curve, or a cusp) or, for sub-harmonic motions, where period doublings of the
parent appear. From a value at which the branch is detached one goes on to the next such event, and follows the branch
again behind those that may concern it. At the end of the range it is followed once more: what no known event accounts
for is located by bisection and noted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.errors import ConvergenceError
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import Catalogue, branch_through
from suboctave.maps.isolas.result import Isola, IsolaEnd
from suboctave.maps.pieces import MonotonePiece
from suboctave.results.branch import Branch

#: share of the work that the responses make, for progress
PREPARATION = 0.6
#: events that are closer, in units of the parameter's range, are met together
_TOGETHER = 1e-7
#: halvings of the interval in which a branch ceases to be detached for no known reason
_BISECTIONS = 10
#: share of the way to an event, before it, at which the branch is followed once more
_BEFORE = 1e-3


@dataclass(frozen=True, eq=False)
class Loop:
    """A branch over omega at a value of the parameter, and the pieces of curves that its limit points lie on.

    `detached`: whether it closes on itself, and so do all branches that it meets at branch points, and those that they
    meet: from none of them a sweep comes to it.
    """

    value: float
    branch: Branch
    pieces: tuple[MonotonePiece, ...]
    detached: bool


class Search:
    """What a search for isolas knows: curves of bifurcations, branches at values, and the isolas so far.

    values
        Values of the design parameter at which responses are followed.
    met
        Branches that bifurcate from a response, or are one, by the value of the parameter.
    """

    def __init__(self, catalogue: Catalogue, values: Sequence[float] = ()) -> None:
        self.catalogue = catalogue
        self.values = tuple(values)
        self.met: dict[float, list[Branch]] = {}
        self.isolas: list[Isola] = []
        #: limit points, by value and piece, that lie on a branch that is not detached
        self._explained: set[tuple[float, MonotonePiece]] = set()

    @property
    def few(self) -> list[float]:
        """The first, the middle and the last of the values."""
        values = self.values
        return sorted({values[0], values[len(values) // 2], values[-1]})

    def settle(self, values: Sequence[float] = ()) -> None:
        """The isolas that limit points known lie on: near centres, and at values at which responses were followed."""
        for piece, value in self._starts(values):
            loop = self.through(piece, value)
            if loop is not None:
                self._consider(loop)

    def meet(self, branch: Branch, value: float) -> None:
        """A branch at a value that no bifurcation led to: an isola unless it is attached, or one that is known."""
        pass_on(branch.interruption)
        self._consider(self.of(branch, value))
        self.settle()

    def _consider(self, loop: Loop) -> None:
        """A branch that is detached exists over some range, unless it is known; any other is known from now on."""
        if any(_covers(isola, piece, loop.value) for isola in self.isolas for piece in loop.pieces):
            return
        if loop.detached and loop.pieces:
            catalogue, value = self.catalogue, loop.value
            catalogue.progress(PREPARATION, f"closed branch at {catalogue.name} = {value:.6g}")
            # to begin with at a single value
            reasons = ("not followed to lower values", "not followed to higher values")
            isola = Isola(
                catalogue.system, catalogue.name, (catalogue.omega.low, catalogue.omega.high), (None, None),
                (value, value), reasons, loop.pieces, catalogue.options, (), {value: loop.branch},
            )  # fmt: skip
            low, high = (_Direction(upper, isola, self) for upper in (False, True))
            self.isolas.append(isola)
            for direction in (low, high):
                direction.settle(loop)
        else:
            self.attach(loop)

    def _starts(self, values: Sequence[float]) -> Iterator[tuple[MonotonePiece, float]]:
        """Limit points that may lie on an isola: beside centres, then those that no branch met explains.

        Curves that become known on the way count as well.
        """
        name, bounds = self.catalogue.name, self.catalogue.bounds
        done: set[int] = set()
        for piece in self.catalogue.pieces:
            for upper in (False, True):
                event = piece.end(upper) if piece.kind == "LP" else None
                # where a contact grazes, the quadratic form says nothing
                if event is None or event.kind != "extremum" or event.isola == "isola_merging" or id(event) in done:
                    continue
                done.add(id(event))
                if any(end is not None and end.orbit is event.orbit for isola in self.isolas for end in isola.ends):
                    continue
                value = event.parameter(name)
                beyond, _ = next(self.critical(piece.nu, value, not upper), (bounds[0 if upper else 1], []))
                yield piece, 0.5 * (value + beyond)
        for value in values:
            for piece in self.catalogue.limit_points:
                unexplained = piece.contains(value) and (value, piece) not in self._explained
                if unexplained and not any(_covers(isola, piece, value) for isola in self.isolas):
                    yield piece, value

    # ------------------------------------------------------------------------------------- branches at one value
    def through(self, piece: MonotonePiece, value: float) -> Loop | None:
        """The branch through a limit point at a value; None where it cannot be followed."""
        catalogue = self.catalogue
        same = [other for other in catalogue.limit_points if other.curve is piece.curve]
        try:
            item = piece.solve_at(value)
            branch = branch_through(item, catalogue.omega, catalogue.name, same, catalogue.options)
        except ConvergenceError as failure:
            where = f"omega = {float(piece.across(value)):.6g}, {catalogue.name} = {value:.6g}"
            catalogue.note(f"the branch at {where} could not be followed: {failure}")
            return None
        pass_on(branch.interruption)
        return self.of(branch, value, piece)

    def of(self, branch: Branch, value: float, *known: MonotonePiece) -> Loop:
        """A branch at a value, or the closed one that it hangs on; `known` are pieces of the given branch."""
        carrier = self.catalogue.carrier(branch, value, self.met.get(value, ()))
        if carrier is None or carrier is branch:
            return Loop(value, branch, self.pieces_on(branch, value, *known), carrier is branch)
        self._explained |= {(value, piece) for piece in known}
        return Loop(value, carrier, self.pieces_on(carrier, value), True)

    def pieces_on(self, branch: Branch, value: float, *known: MonotonePiece) -> tuple[MonotonePiece, ...]:
        """The pieces that a branch's limit points lie on, each once, those that are known first."""
        pieces = (self.catalogue.known(item, value) for item in branch.bifurcations["LP"])
        return tuple(dict.fromkeys([*known, *(piece for piece in pieces if piece is not None)]))

    def attach(self, loop: Loop) -> None:
        """A branch that is not detached: its limit points at that value are explained."""
        if not loop.detached:
            self.met.setdefault(loop.value, []).append(loop.branch)
            self._explained |= {(loop.value, piece) for piece in loop.pieces}

    def critical(self, nu: int, value: float, upper: bool) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """Values ahead at which branches of motions of `nu` load periods may change, with what happens there."""
        name, near = self.catalogue.name, _TOGETHER * self.catalogue.span
        events = [end for piece in self.catalogue.limit_points if piece.nu == nu for end in piece.ends]
        for curve in self.catalogue.curves:
            if curve.kind == "PD" and 2 * curve.nu == nu:
                events += (e for e in curve.extrema if isinstance(e, TrackedEvent) and e.parameter_name == name)
        sign = 1.0 if upper else -1.0
        ahead = {id(e): e for e in events if e is not None and sign * (e.parameter(name) - value) > near}
        groups: dict[float, list[TrackedEvent]] = {}
        for event in sorted(ahead.values(), key=lambda e: sign * e.parameter(name)):
            place = event.parameter(name)
            begin = next(reversed(groups), math.inf)
            groups.setdefault(begin if abs(place - begin) <= near else place, []).append(event)
        yield from groups.items()


# ---------------------------------------------------------------------------------------------- ranges of existence
@dataclass(frozen=True)
class _End:
    """How a detached branch ends in one direction: where, why, by which event, and whether it shrinks to a point."""

    value: float
    reason: str
    event: TrackedEvent | None = None
    centre: bool = False


class _Direction:
    """A detached branch over rising (`upper`) or falling values of the parameter."""

    def __init__(self, upper: bool, isola: Isola, search: Search) -> None:
        self.upper = upper
        self.isola = isola
        self.search = search
        self.others = tuple(search.isolas)
        self.name = search.catalogue.name
        self.bound = search.catalogue.bounds[1 if upper else 0]

    def settle(self, loop: Loop) -> None:
        """Find the end of the range in this direction, from a branch within it."""
        isola, end = self.isola, self._end(loop)
        event = None if end.event is None else IsolaEnd.of(end.event, self.name, end.centre)
        (low, high), (first, last), (why, reason) = isola.range, isola.ends, isola.reasons
        isola.range = (low, end.value) if self.upper else (end.value, high)
        isola.ends = (first, event) if self.upper else (event, last)
        isola.reasons = (why, end.reason) if self.upper else (end.reason, reason)

    def _take(self, loop: Loop) -> None:
        """The branch at another value, detached as well."""
        self.isola.followed[loop.value] = loop.branch
        self.isola.pieces = tuple(dict.fromkeys([*self.isola.pieces, *loop.pieces]))

    def _end(self, loop: Loop) -> _End:
        """Go on until the branch vanishes, meets another one, or the range ends."""
        while (step := next(self._relevant(loop), None)) is not None:
            after = self._behind(loop, *step)
            if isinstance(after, _End):
                return after
            self._take(after)
            loop = after
        last = [piece for piece in loop.pieces if piece.contains(self.bound)]
        if not last:
            reach = (max if self.upper else min)(p.high if self.upper else p.low for p in loop.pieces)
            return _End(reach, f"from {self.name} = {reach:.9g} on its limit points could not be followed")
        cut = _End(self.bound, f"{self.name} = {self.bound:.9g}, the end of the bounds, cuts its range")
        if loop.value == self.bound:
            return cut
        at_bound = self.search.through(last[0], self.bound)
        if at_bound is None:
            return _End(loop.value, f"behind {self.name} = {loop.value:.9g} it could not be followed")
        if at_bound.detached:
            self._take(at_bound)
            return cut
        return self._bisected(last[0], loop, at_bound)

    def _behind(self, loop: Loop, value: float, events: list[TrackedEvent]) -> Loop | _End:
        """The detached branch behind events at a value, or how it ends there."""
        ends = {piece: piece.end(self.upper) for piece in loop.pieces}
        own = [e for e in events if any(end is e for end in ends.values())]
        lasting = [p for p, end in ends.items() if not any(end is e for e in own) and p.contains(value)]
        if not lasting:
            return _vanishing(value, own or events, self.name)
        behind = 0.5 * (value + self._next(loop, value))
        after = self.search.through(lasting[0], behind)
        if after is None:
            return _End(value, f"at {self.name} = {value:.9g} it could not be followed further")
        event = _reconnecting(own or events)
        if not after.detached:
            if event is None or not (own or self._detached_before(value, lasting[0], loop)):
                return self._bisected(lasting[0], loop, after)
            return _End(value, _merging(self.name, value, event, after), event)
        other = next((o for o in self.others if any(_covers(o, piece, behind) for piece in after.pieces)), None)
        return after if other is None else _End(value, _joining(self.name, value, own or events, other), event)

    def _detached_before(self, value: float, piece: MonotonePiece, loop: Loop) -> bool:
        """Whether a branch is detached until just before an event that is none of its own limit points."""
        before = self.search.through(piece, value - _BEFORE * (value - loop.value))
        if before is None or not before.detached:
            return False
        self._take(before)
        return True

    def _relevant(self, loop: Loop) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """Events ahead that may concern a branch: those of its own limit points, and those that reconnect others."""
        for value, events in self.search.critical(loop.pieces[0].nu, loop.value, self.upper):
            own = any(piece.end(self.upper) is e for piece in loop.pieces for e in events)
            if own or any(e.isola == "isola_merging" or e.curve == "PD" for e in events):
                yield value, events

    def _next(self, loop: Loop, value: float) -> float:
        """The value of the next event of any kind behind another, or the bound."""
        return next(self.search.critical(loop.pieces[0].nu, value, self.upper), (self.bound, []))[0]

    def _bisected(self, piece: MonotonePiece, inside: Loop, outside: Loop) -> _End:
        """Where a branch ceases to be detached though no event that is known explains it."""
        a, b = inside.value, outside.value
        for _ in range(_BISECTIONS):
            middle = self.search.through(piece, 0.5 * (a + b))
            if middle is None:
                break
            if middle.detached:
                self._take(middle)
                a = middle.value
            else:
                b = middle.value
        low, high = sorted((a, b))
        where = f"between {self.name} = {low:.6g} and {high:.6g}"
        self.isola.notes += (f"{where} it ceases to be detached, and no event that was found says why",)
        return _End(a, f"detached up to {self.name} = {a:.6g} at least, no longer at {b:.6g}")


def _covers(isola: Isola, piece: MonotonePiece, value: float) -> bool:
    """Whether a piece's limit point at a value lies on an isola."""
    return piece in isola.pieces and value in isola


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


def _joining(name: str, value: float, events: list[TrackedEvent], other: Isola) -> str:
    place = ", ".join(f"{name} = {float(e):.7g}" for e in other.ends if e is not None and e.kind == "isola_centre")
    which = f"the isola born at {place}" if place else "another isola"
    return f"merges at omega = {events[0].omega:.9g}, {name} = {value:.9g} with {which}, as which it goes on"
