"""What a search for isolas knows, and the range of the design parameter in which a closed branch is isolated.

As the design parameter q changes, a closed branch can change its nature only where one of its limit points meets
another (an extremum of q along their curve, or a cusp) or, for sub-harmonic motions, where period doublings of the
parent appear. From a value at which the branch is detached one goes on to the next such event, and follows the branch
again behind those that may concern it. At the end of the range it is followed once more: what no known event accounts
for is located by bisection and noted.

An isola ends in a centre, where it meets another branch, or at the bounds, nowhere else. A cusp takes two of its limit
points away and leaves the branch; a curve of limit points that could be followed no further says nothing of the branch
either. Behind both the branch is reached through another limit point, or, where none is known there, from its own
motions, each followed over q at its own frequency.

Two branches are one isola if they share a limit point at some value, or a motion: a curve of limit points that was
followed twice makes no second isola.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation.ending import EndReason
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import period_name
from suboctave.errors import ConvergenceError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import THROUGH, Catalogue, branch_through, few
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.pieces import MonotonePiece
from suboctave.results.branch import Branch

#: events that are closer, in units of the parameter's range, are met together
_TOGETHER = 1e-7
#: halvings of the interval in which a branch ceases to be detached for no known reason
_BISECTIONS = 10
#: share of the way to an event, before it, at which the branch is followed once more
_BEFORE = 1e-3
#: shares of the frequencies of a closed branch at which its motions are followed over the parameter, on both its sides
_CARRYING = (0.5, 0.25, 0.75)


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


@dataclass
class Stage:
    """A part of a search in words, at how many places it looks, and at how many it has; `leads` to limit points,
    `spare`: left out where isolas are known.
    """

    words: str
    planned: int
    done: int = 0
    leads: bool = True
    spare: bool = False

    @property
    def so_far(self) -> str:
        """What has been looked at."""
        return self.words.format(self.planned if self.done == self.planned else f"{self.done} of {self.planned}")

    @property
    def left(self) -> str:
        """What has not."""
        return self.words.format(self.planned - self.done)


class Search:
    """What a search for isolas knows: curves of bifurcations, branches at values, and the isolas so far.

    values
        Values of the design parameter at which responses are followed.
    periods
        Periods of motions that are looked for, in periods of the load.
    stages
        What the search has looked at, and what it is still to look at.
    met
        Branches that bifurcate from a response, or are one, by the value of the parameter.
    """

    def __init__(self, catalogue: Catalogue, values: Sequence[float] = (), periods: Iterable[int] = ()) -> None:
        self.catalogue = catalogue
        self.values = tuple(values)
        self.periods = set(periods)
        self.stages: list[Stage] = []
        self.met: dict[float, list[Branch]] = {}
        self.isolas: list[Isola] = []
        #: pieces that limit points of an isola lie on, and between which values
        self._held: list[tuple[Isola, MonotonePiece, float, float]] = []
        #: limit points, by value and piece, that lie on a branch that is not detached
        self._explained: set[tuple[float, MonotonePiece]] = set()

    @property
    def few(self) -> list[float]:
        """The first, the middle and the last of the values."""
        return few(self.values)

    @property
    def closer(self) -> list[float]:
        """The values, and those halfway between them."""
        return sorted({*self.values, *(0.5 * (a + b) for a, b in pairwise(self.values))})

    def at(self, where: str, part: float = 0.0) -> None:
        """Report where the search is, and which part of the place that it looks at is done."""
        done = sum(stage.done for stage in self.stages)
        left = sum(stage.planned - stage.done for stage in self.stages if not (stage.spare and self.isolas))
        self.catalogue.progress((done + part) / max(done + left, 1), where)

    def settle(self, values: Sequence[float] = (), stage: Stage | None = None) -> None:
        """The isolas that limit points known lie on: near centres, and at values at which responses were followed."""
        for piece, value in self._starts(values, stage):
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
        if not (loop.detached and loop.pieces):
            self.attach(loop)
            return
        known = self.isola_of(loop)
        if known is not None:
            known.pieces = tuple(dict.fromkeys([*known.pieces, *loop.pieces]))
            self.hold(known, loop, loop.value, loop.value)
            return
        catalogue, value = self.catalogue, loop.value
        # to begin with at a single value
        reasons = ("not followed to lower values", "not followed to higher values")
        isola = Isola(
            catalogue.system, catalogue.name, (catalogue.omega.low, catalogue.omega.high), (None, None),
            (value, value), reasons, loop.pieces, catalogue.options, (), {value: loop.branch},
        )  # fmt: skip
        low, high = (_Direction(upper, isola, self) for upper in (False, True))
        self.isolas.append(isola)
        self.at(f"closed branch at {catalogue.name} = {value:.6g}")
        for direction in (low, high):
            direction.settle(loop)

    def _starts(self, values: Sequence[float], stage: Stage | None) -> Iterator[tuple[MonotonePiece, float]]:
        """Limit points that may lie on an isola: beside centres, then those that no branch met explains."""
        done: set[int] = set()
        yield from self._centres(done)
        for value in values:
            for piece in self.catalogue.limit_points:
                unexplained = piece.contains(value) and (value, piece) not in self._explained
                if unexplained and self.isola_on(piece, value) is None:
                    yield piece, value
                    # of curves that have become known by that
                    yield from self._centres(done)
            if stage is not None:
                stage.done += 1

    def _centres(self, done: set[int]) -> Iterator[tuple[MonotonePiece, float]]:
        """Limit points beside centres that are not `done`, also of curves that become known on the way."""
        name, bounds = self.catalogue.name, self.catalogue.bounds
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
                # the curve may have been followed less far
                reach = max(beyond, piece.low) if upper else min(beyond, piece.high)
                start = 0.5 * (value + reach)
                if self.isola_on(piece, start) is None:
                    yield piece, start

    # ------------------------------------------------------------------------------------------------- what is said
    def result(self) -> Isolas:
        """The isolas and the curves that were followed, with the outcome in one sentence."""
        catalogue, isolas = self.catalogue, self.isolas
        (low, high), (first, last) = catalogue.bounds, catalogue.omega
        limit_points, doublings = ([c for c in catalogue.curves if c.kind == kind] for kind in ("LP", "PD"))
        where = f"for {catalogue.name} from {low:g} to {high:g}, omega from {first:g} to {last:g}"
        looked = _listed(stage.so_far for stage in self.stages if stage.leads and stage.done) or "nothing"
        followed = f"{len(limit_points)} curve{'s' * (len(limit_points) != 1)} of limit points from {looked}"
        count = f"{len(isolas) or 'no'} isola{'s' * (len(isolas) != 1)}"
        if catalogue.interruption is not None:
            missing = _listed(stage.left for stage in self.stages if stage.done < stage.planned)
            summary = (
                f"Incomplete, {catalogue.interruption}: {count} so far {where}; {followed}. Not searched: {missing}."
            )
        elif isolas:
            summary = f"{count} {where}; {followed}."
        else:
            known = {p.nu for p in catalogue.limit_points} | {1} | self.periods
            periods = _listed(period_name(nu) for nu in sorted(known))
            summary = f"No isola of {periods} motions was found {where}: {followed} have none."
        self._note_breaks()
        asked = catalogue.system, catalogue.name, catalogue.bounds, (first, last)
        return Isolas(isolas, *asked, limit_points, doublings, catalogue.unsettled, summary, catalogue.interruption)

    def _note_breaks(self) -> None:
        """Note where curves of limit points could be followed no further, unless another one passes there."""
        name = self.catalogue.name
        curves = [curve for curve in self.catalogue.curves if curve.kind == "LP" and len(curve)]
        for curve in curves:
            for end, ending in zip((0, -1), curve.endings, strict=False):
                orbit = curve.orbits[end]
                if not ending.early or ending.interruption is not None:
                    continue
                if any(c.nu == curve.nu and lies_on(orbit, c.points, name, True) for c in curves if c is not curve):
                    continue
                what = f"limit points of {period_name(curve.nu)} motions"
                text = (
                    f"{what} end here ({ending}), isolas beyond may be missing. "
                    "Use a smaller max_step or more harmonics"
                )
                self.catalogue.notes.append(self.catalogue.open(text, orbit.values[name], orbit.omega))

    # ------------------------------------------------------------------------------------- branches at one value
    def through(self, piece: MonotonePiece, value: float, noted: bool = True) -> Loop | None:
        """The branch through a limit point at a value; None, which is noted, where it cannot be followed."""
        catalogue = self.catalogue
        same = [other for other in catalogue.limit_points if other.curve is piece.curve]
        try:
            item = piece.solve_at(value)
            branch = branch_through(item, catalogue.omega, catalogue.name, same, catalogue.options)
        except ConvergenceError as failure:
            if noted:
                place = catalogue.open(THROUGH, value, float(piece.across(value)), "LP")
                catalogue.notes.append(replace(place, failure=str(failure)))
            return None
        pass_on(branch.interruption)
        return self.of(branch, value, piece)

    def carried(self, loop: Loop, value: float) -> Loop | None:
        """The branch at another value that motions of a loop lead to, each followed over the parameter at its own
        frequency; None where none comes there without turning back.
        """
        catalogue, name = self.catalogue, self.catalogue.name
        for orbit in _amid(loop.branch):
            with suppress(ConvergenceError):
                path = continue_branch(orbit, name, (loop.value, value), **catalogue.options)
                pass_on(path.interruption)
                reached = path.orbits[-1]
                if reached.values[name] != value or path.bifurcations["LP"]:
                    continue
                branch = continue_branch(
                    reached, "omega", catalogue.omega.holding([reached.omega]), **catalogue.options
                )
                pass_on(branch.interruption)
                return self.of(branch, value)
        return None

    def of(self, branch: Branch, value: float, *known: MonotonePiece) -> Loop:
        """A branch at a value, or the closed one that it hangs on; `known` are pieces of the given branch."""
        branch = self._whole(branch, value)
        carrier = self.catalogue.carrier(branch, value, self.met.get(value, ()))
        if carrier is None or carrier is branch:
            return Loop(value, branch, self.pieces_on(branch, value, *known), carrier is branch)
        self._explained |= {(value, piece) for piece in known}
        return Loop(value, carrier, self.pieces_on(carrier, value), True)

    def _whole(self, branch: Branch, value: float) -> Branch:
        """A branch that leaves the range, followed an octave beyond: it may close there. What is open is noted."""
        if branch.closed or branch.junctions or not len(branch):
            return branch
        catalogue = self.catalogue
        if any(ending.reason in (EndReason.RANGE_END, EndReason.LEFT_RANGE) for ending in branch.endings):
            low, high = catalogue.omega.around
            if low < branch.omega.min() or branch.omega.max() < high:
                ends = min(low, float(branch.omega.min())), max(high, float(branch.omega.max()))
                with suppress(ConvergenceError):
                    branch = continue_branch(branch.orbits[len(branch) // 2], "omega", ends, **catalogue.options)
                    pass_on(branch.interruption)
        if branch.nu > 1 and not branch.closed and not branch.junctions:
            middle = branch.orbits[len(branch) // 2]
            between = f"between omega = {branch.omega.min():.6g} and {branch.omega.max():.6g}"
            text = (
                f"this {period_name(branch.nu)} branch may be an isola, it does not close ({between}, {branch.ended}). "
                "Use a wider range of omega"
            )
            catalogue.notes.append(catalogue.open(text, value, middle.omega))
        return branch

    def pieces_on(self, branch: Branch, value: float, *known: MonotonePiece) -> tuple[MonotonePiece, ...]:
        """The pieces that a branch's limit points lie on, each once, those that are known first."""
        pieces = (self.catalogue.known(item, value) for item in branch.bifurcations["LP"])
        return tuple(dict.fromkeys([*known, *(piece for piece in pieces if piece is not None)]))

    # ----------------------------------------------------------------------------------------- which isola is which
    def hold(self, isola: Isola, loop: Loop, one: float, other: float) -> None:
        """Between two values an isola has limit points on the pieces of a loop."""
        self._held += [(isola, piece, min(one, other), max(one, other)) for piece in loop.pieces]

    def isola_on(self, piece: MonotonePiece, value: float) -> Isola | None:
        """The isola that a piece's limit point at a value lies on, as far as isolas are known."""
        held = (isola for isola, p, low, high in self._held if p is piece and low <= value <= high and value in isola)
        return next(held, None)

    def isola_of(self, loop: Loop, own: Isola | None = None) -> Isola | None:
        """The isola that a detached branch belongs to, by its limit points or by its motions; not `own`."""
        for piece in loop.pieces:
            isola = self.isola_on(piece, loop.value)
            if isola is not None and isola is not own:
                return isola
        middle = loop.branch.orbits[len(loop.branch) // 2]
        for isola in self.isolas:
            if isola is own or isola.nu != loop.branch.nu or loop.value not in isola:
                continue
            with suppress(ConvergenceError):
                branch = isola.at(loop.value)
                pass_on(branch.interruption)
                if lies_on(middle, branch.points, images=True):
                    return isola
        return None

    def absorb(self, isola: Isola, other: Isola) -> None:
        """Two isolas have turned out to be one: the first takes over from the other, which is no longer listed."""
        self.isolas.remove(other)
        isola.followed = {**other.followed, **isola.followed}
        isola.pieces = tuple(dict.fromkeys([*isola.pieces, *other.pieces]))
        isola.notes = tuple(dict.fromkeys([*isola.notes, *other.notes]))
        self._held = [(isola if one is other else one, piece, a, b) for one, piece, a, b in self._held]

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


def _listed(items: Iterable[str]) -> str:
    """Items in words: a, b and c."""
    words = list(items)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _amid(branch: Branch) -> Iterator[PeriodicOrbit]:
    """Motions of a closed branch away from its limit points: on all its sides at some frequencies between its ends."""
    omega = branch.omega
    low, high = float(omega.min()), float(omega.max())
    for share in _CARRYING:
        gap = omega - (low + share * (high - low))
        for i in np.flatnonzero(np.signbit(gap[:-1]) != np.signbit(gap[1:])):
            yield branch.orbits[int(i)]


# ---------------------------------------------------------------------------------------------- ranges of existence
class _Direction:
    """A detached branch over rising (`upper`) or falling values of the parameter."""

    def __init__(self, upper: bool, isola: Isola, search: Search) -> None:
        self.upper = upper
        self.isola = isola
        self.search = search
        self.name = search.catalogue.name
        self.bound = search.catalogue.bounds[1 if upper else 0]

    def settle(self, loop: Loop) -> None:
        """Go on from a branch within the range until it vanishes, meets another one, or the range ends."""
        ahead, since = loop, loop.value
        while (step := next(self._relevant(ahead, since), None)) is not None:
            self.search.hold(self.isola, ahead, since, step[0])
            behind = self._behind(ahead, *step)
            if behind is None:
                return
            ahead, since = behind, step[0]
        self.search.hold(self.isola, ahead, since, self.bound)
        self._cut(ahead)

    def _end(self, value: float, reason: str, event: TrackedEvent | None = None, centre: bool = False) -> None:
        """The range ends there: why, by which event, whether it shrinks to a point."""
        self._ends(value, reason, None if event is None else IsolaEnd.of(event, self.name, centre))

    def _ends(self, value: float, reason: str, place: IsolaEnd | None) -> None:
        isola = self.isola
        (low, high), (first, last), (why, reasons) = isola.range, isola.ends, isola.reasons
        isola.range = (low, value) if self.upper else (value, high)
        isola.ends = (first, place) if self.upper else (place, last)
        isola.reasons = (why, reason) if self.upper else (reason, reasons)

    def _take(self, loop: Loop) -> Loop:
        """The branch at another value, detached as well."""
        self.isola.followed[loop.value] = loop.branch
        self.isola.pieces = tuple(dict.fromkeys([*self.isola.pieces, *loop.pieces]))
        return loop

    def _open(self, value: float) -> None:
        """It could not be followed further, for a reason that is none of the branch's."""
        self.isola.notes += (
            f"beyond {self.name} = {value:.6g} it could not be followed, without a located end. Use more harmonics or "
            "a smaller max_step",
        )
        self._end(value, f"followed up to {self.name} = {value:.9g}, where its limit points were lost")

    def _reach(self, loop: Loop, value: float) -> Loop | None:
        """The branch at a value ahead: through a limit point that is known there, else from its motions."""
        for piece in loop.pieces:
            if piece.contains(value):
                there = self.search.through(piece, value, noted=False)
                if there is not None:
                    return there
        return self.search.carried(loop, value)

    def _cut(self, loop: Loop) -> None:
        """Behind the last event there is nothing but the bound."""
        name, bound = self.name, self.bound
        at_bound = loop if loop.value == bound else self._reach(loop, bound)
        if at_bound is None:
            return self._open(loop.value)
        if not at_bound.detached:
            return self._bisect(loop, at_bound)
        if at_bound is not loop:
            other = self.search.isola_of(at_bound, self.isola)
            if other is not None:
                return self._joined(other)
            self._take(at_bound)
        return self._end(bound, f"{name} = {bound:.9g}, the end of the bounds, cuts its range")

    def _behind(self, loop: Loop, value: float, events: list[TrackedEvent]) -> Loop | None:
        """The detached branch behind events at a value; None where it ends there."""
        ends = {piece: piece.end(self.upper) for piece in loop.pieces}
        own = [e for e in events if any(end is e for end in ends.values())]
        met = own or events
        # half way to what comes next, of any kind, or to the bound
        ahead = next(self.search.critical(loop.branch.nu, value, self.upper), (self.bound, []))[0]
        behind = 0.5 * (value + (min if self.upper else max)([ahead, *self._breaks(loop, value)]))
        lasting = [piece for piece in loop.pieces if piece.contains(behind)]
        centre = next((e for e in own if e.kind == "extremum" and e.isola != "isola_merging"), None)
        if not lasting and centre is not None:
            where = f"omega = {centre.omega:.9g}, {self.name} = {value:.9g}"
            self._end(value, f"shrinks to a point (isola centre) at {where}", centre, True)
            return None
        after = self._reach(self._close_to(loop, value) if not lasting else loop, behind)
        if after is None:
            self._open(value)
            return None
        event = _reconnecting(met)
        if not after.detached:
            if event is None or not (own or self._detached_before(loop, value)):
                self._bisect(loop, after)
                return None
            self._end(value, _merging(self.name, value, event, after), event)
            return None
        other = self.search.isola_of(after, self.isola)
        if other is None:
            return self._take(after)
        if value - _BEFORE * (value - loop.value) not in other:
            # one that begins here is this one; two that were both there before have merged
            self._joined(other)
            return None
        place = ", ".join(
            f"{self.name} = {float(e):.7g}" for e in other.ends if e is not None and e.kind == "isola_centre"
        )
        which = f"the isola born at {place}" if place else "another isola"
        where = f"{f'omega = {met[0].omega:.9g}, ' if met else ''}{self.name} = {value:.9g}"
        self._end(value, f"merges at {where} with {which}, as which it goes on", event)
        return None

    def _joined(self, other: Isola) -> None:
        """It goes on as an isola that is known already: the two are one."""
        side = 1 if self.upper else 0
        self.search.absorb(self.isola, other)
        self._ends(other.range[side], other.reasons[side], other.ends[side])

    def _close_to(self, loop: Loop, value: float) -> Loop:
        """The branch close before a value, where its motions lead farther; the loop itself where it is not found."""
        before = self._reach(loop, value - _BEFORE * (value - loop.value))
        return loop if before is None or not before.detached else self._take(before)

    def _detached_before(self, loop: Loop, value: float) -> bool:
        """Whether a branch is detached until just before an event that is none of its own limit points."""
        before = self._reach(loop, value - _BEFORE * (value - loop.value))
        if before is None or not before.detached:
            return False
        self._take(before)
        return True

    def _breaks(self, loop: Loop, since: float) -> Iterator[float]:
        """Values ahead at which curves of limit points end though nothing was located there."""
        sign, room = (1.0 if self.upper else -1.0), _TOGETHER * self.search.catalogue.span
        for piece in loop.pieces:
            reach = piece.high if self.upper else piece.low
            if piece.end(self.upper) is None and sign * (self.bound - reach) > room < sign * (reach - since):
                yield reach

    def _relevant(self, loop: Loop, since: float) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """What ahead may concern a branch: events of its own limit points, those that reconnect others, and where its
        limit points could not be followed further.
        """
        sign = 1.0 if self.upper else -1.0
        begin = max(loop.value, since, key=lambda value: sign * value)
        places: list[tuple[float, list[TrackedEvent]]] = [(reach, []) for reach in self._breaks(loop, begin)]
        for value, events in self.search.critical(loop.branch.nu, begin, self.upper):
            own = any(piece.end(self.upper) is e for piece in loop.pieces for e in events)
            if own or any(e.isola == "isola_merging" or e.curve == "PD" for e in events):
                places.append((value, events))
        yield from sorted(places, key=lambda place: sign * place[0])

    def _bisect(self, inside: Loop, outside: Loop) -> None:
        """Where a branch ceases to be detached though no event that is known explains it."""
        a, b = inside, outside.value
        for _ in range(_BISECTIONS):
            middle = self._reach(a, 0.5 * (a.value + b))
            if middle is None:
                break
            if middle.detached:
                a = self._take(middle)
            else:
                b = middle.value
        low, high = sorted((a.value, b))
        where = f"between {self.name} = {low:.6g} and {high:.6g}"
        self.isola.notes += (f"{where} it is no longer detached, without a located merging. Use a smaller max_step",)
        self._end(a.value, f"detached up to {self.name} = {a.value:.6g} at least, no longer at {b:.6g}")


def _reconnecting(events: list[TrackedEvent]) -> TrackedEvent | None:
    """The event that reconnects branches."""
    for event in events:
        if event.isola == "isola_merging" or event.curve == "PD" or (event.kind == "extremum" and not event.isola):
            return event
    return None


def _merging(name: str, value: float, event: TrackedEvent, after: Loop) -> str:
    where = f"omega = {event.omega:.9g}, {name} = {value:.9g}"
    met = [str(j) for j in (after.branch.departs, after.branch.arrives) if j is not None]
    if event.curve == "PD":
        return f"meets the motion whose period it doubles at {where}"
    what = f"the branch between {' and '.join(met)}" if met else "a branch that runs through the range"
    return f"merges at {where} with {what}"
