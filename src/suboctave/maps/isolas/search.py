"""`find_isolas`: closed branches that no sweep leads to, over a design parameter.

1. At several values of the parameter the response is followed, with the branches that bifurcate from it
   (`_from_responses`; where that leads to no isola, responses under other loads and resonances).
2. Every limit point met is followed over the parameter, through its extrema; every period doubling as well.
3. Where the curve of limit points has a definite extremum a closed branch shrinks to a point. Limit points at the
   values of 1. that lie on none of the branches met there lie on others.
4. A branch through such a limit point is followed. If it closes, the search finds the range in which it does.

None of this depends on the value that the parameter happens to have, nor begins at an extremum of period doublings,
where sub-harmonic motions appear beside their parent (Alcorta et al., Nonlinear Dynamics 98, 2019, section 3.6, begin
there).

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
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.analysis.options import SearchOptions
from suboctave.analysis.subharmonics import Seeds, check_seeds
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import period_name
from suboctave.curves.starts import Harmonics
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import Catalogue, branch_through, checked_orders, checked_values, listed
from suboctave.maps.isolas.responses import Responses, UnderOtherLoads, followed_doublings
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.pieces import MonotonePiece
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.branch import Branch
from suboctave.workers import check_workers

#: share of the work that the responses make, for progress
_PREPARATION = 0.6
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
        #: pieces that limit points of an isola lie on, and between which values
        self._held: list[tuple[Isola, MonotonePiece, float, float]] = []
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
        if any(self.isola_on(piece, loop.value) for piece in loop.pieces):
            return
        if loop.detached and loop.pieces:
            catalogue, value = self.catalogue, loop.value
            catalogue.progress(_PREPARATION, f"closed branch at {catalogue.name} = {value:.6g}")
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
                yield piece, 0.5 * (value + beyond)

    def result(self) -> Isolas:
        """The isolas and the curves that were followed, with the outcome in one sentence."""
        catalogue, isolas = self.catalogue, self.isolas
        (low, high), (first, last) = catalogue.bounds, catalogue.omega
        limit_points, doublings = ([c for c in catalogue.curves if c.kind == kind] for kind in ("LP", "PD"))
        where = f"for {catalogue.name} from {low:g} to {high:g}, omega from {first:g} to {last:g}"
        begun = f"the responses at {len(self.values)} values of {catalogue.name}"
        followed = f"{len(limit_points)} curves of limit points from {begun}"
        if isolas:
            summary = f"{len(isolas)} isola{'s' * (len(isolas) > 1)} {where}; {followed}."
        else:
            periods = " and ".join(period_name(nu) for nu in sorted({p.nu for p in catalogue.limit_points} | {1}))
            summary = f"No isola of {periods} motions was found {where}: {followed} show none."
        asked = catalogue.system, catalogue.name, catalogue.bounds, (first, last)
        return Isolas(isolas, *asked, limit_points, doublings, catalogue.notes, summary, catalogue.interruption)

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

    def hold(self, isola: Isola, loop: Loop, one: float, other: float) -> None:
        """Between two values an isola has limit points on the pieces of a loop."""
        self._held += [(isola, piece, min(one, other), max(one, other)) for piece in loop.pieces]

    def isola_on(self, piece: MonotonePiece, value: float) -> Isola | None:
        """The isola that a piece's limit point at a value lies on, as far as isolas are known."""
        held = (isola for isola, p, low, high in self._held if p is piece and low <= value <= high and value in isola)
        return next(held, None)

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
        while (step := next(self._relevant(ahead), None)) is not None:
            self.search.hold(self.isola, ahead, since, step[0])
            behind = self._behind(ahead, *step)
            if behind is None:
                return
            ahead, since = behind, step[0]
        self.search.hold(self.isola, ahead, since, self.bound)
        self._cut(ahead)

    def _end(self, value: float, reason: str, event: TrackedEvent | None = None, centre: bool = False) -> None:
        """The range ends there: why, by which event, whether it shrinks to a point."""
        isola, place = self.isola, None if event is None else IsolaEnd.of(event, self.name, centre)
        (low, high), (first, last), (why, reasons) = isola.range, isola.ends, isola.reasons
        isola.range = (low, value) if self.upper else (value, high)
        isola.ends = (first, place) if self.upper else (place, last)
        isola.reasons = (why, reason) if self.upper else (reason, reasons)

    def _take(self, loop: Loop) -> Loop:
        """The branch at another value, detached as well."""
        self.isola.followed[loop.value] = loop.branch
        self.isola.pieces = tuple(dict.fromkeys([*self.isola.pieces, *loop.pieces]))
        return loop

    def _cut(self, loop: Loop) -> None:
        """Behind the last event there is nothing but the bound."""
        name, bound = self.name, self.bound
        last = [piece for piece in loop.pieces if piece.contains(bound)]
        if not last:
            reach = (max if self.upper else min)(p.high if self.upper else p.low for p in loop.pieces)
            return self._end(reach, f"from {name} = {reach:.9g} on its limit points could not be followed")
        at_bound = loop if loop.value == bound else self.search.through(last[0], bound)
        if at_bound is None:
            return self._end(loop.value, f"behind {name} = {loop.value:.9g} it could not be followed")
        if not at_bound.detached:
            return self._bisect(last[0], loop, at_bound)
        if at_bound is not loop:
            self._take(at_bound)
        return self._end(bound, f"{name} = {bound:.9g}, the end of the bounds, cuts its range")

    def _behind(self, loop: Loop, value: float, events: list[TrackedEvent]) -> Loop | None:
        """The detached branch behind events at a value; None where it ends there."""
        ends = {piece: piece.end(self.upper) for piece in loop.pieces}
        own = [e for e in events if any(end is e for end in ends.values())]
        met = own or events
        lasting = [p for p, end in ends.items() if not any(end is e for e in own) and p.contains(value)]
        if not lasting:
            self._vanish(value, met)
            return None
        # half way to the next event of any kind, or to the bound
        beyond, _ = next(self.search.critical(loop.pieces[0].nu, value, self.upper), (self.bound, []))
        behind = 0.5 * (value + beyond)
        after = self.search.through(lasting[0], behind)
        if after is None:
            self._end(value, f"at {self.name} = {value:.9g} it could not be followed further")
            return None
        event = _reconnecting(met)
        if not after.detached:
            if event is None or not (own or self._detached_before(value, lasting[0], loop)):
                self._bisect(lasting[0], loop, after)
                return None
            self._end(value, _merging(self.name, value, event, after), event)
            return None
        other = next((o for piece in after.pieces if (o := self.search.isola_on(piece, behind)) is not None), None)
        if other is None:
            return self._take(after)
        place = ", ".join(
            f"{self.name} = {float(e):.7g}" for e in other.ends if e is not None and e.kind == "isola_centre"
        )
        which = f"the isola born at {place}" if place else "another isola"
        where = f"omega = {met[0].omega:.9g}, {self.name} = {value:.9g}"
        self._end(value, f"merges at {where} with {which}, as which it goes on", event)
        return None

    def _vanish(self, value: float, events: list[TrackedEvent]) -> None:
        for event in events:
            if event.kind == "extremum" and event.isola != "isola_merging":
                where = f"omega = {event.omega:.9g}, {self.name} = {value:.9g}"
                return self._end(value, f"shrinks to a point (isola centre) at {where}", event, True)
        return self._end(value, f"its last limit points vanish in a {events[0].kind} at {self.name} = {value:.9g}")

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

    def _bisect(self, piece: MonotonePiece, inside: Loop, outside: Loop) -> None:
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
        self._end(a, f"detached up to {self.name} = {a:.6g} at least, no longer at {b:.6g}")


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


# ------------------------------------------------------------------------------------------------------------ the verb
@with_options(SearchOptions)
@timed
def find_isolas(
    system: System,
    omega: tuple[float, float],
    parameter: str,
    bounds: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    values: int | Sequence[float] = 5,
    depth: int = 1,
    levels: Sequence[float] | None = None,
    search: Sequence[int] | None = None,
    seeds: Seeds | None = None,
    max_curves: int = 64,
    workers: int | None = 1,
    **options: Unpack[SearchOptions],
) -> Isolas:
    """Isolated responses over a design parameter: where each is born, where it merges, the closed branch in between.

    Parameters
    ----------
    system
        What vibrates. The value that `parameter` has in it does not matter.
    omega
        Range of frequencies in which responses are followed, rad per unit time; the order is irrelevant.
    parameter, bounds
        The design parameter and its range; the order is irrelevant.
    harmonics
        As in `frequency_response`.
    values
        At how many values of the parameter, evenly spread over the bounds, responses are followed to begin with (at
        least 2); or these values themselves.
    depth
        How many bifurcations deep branches are followed there: 0 the response alone, 1 with what leaves it (2T), 2 with
        what leaves these (4T). Isolas of those periods are found.
    levels
        Other levels of the loads, in units of their own, at which responses are followed at these values as well: most
        isolas join the main branch under stronger loads. Default: where no isola was found otherwise some between
        1.5 and 5, at three of the values, until one is found; () for never.
    search
        Periods (2 for 2T, 3 for 3T, ...) of which isolas are looked for at these values among the nonlinear resonances
        of the linear modes as well (`find_subharmonics`). Default: 2 where no isola was found otherwise, at three
        of the values; () for never.
    seeds
        How finely that is done.
    max_curves
        Curves of bifurcations after which no more are followed.
    workers
        Processes (None: one for each core) among which the responses at the values, and at other levels of the loads,
        are divided; curves over the parameter and closed branches, which start from each other, are followed in this
        one. The result is the same bits.

    Returns
    -------
    Isolas
        A sequence of `Isola`, in the order of the values at which they are born; `notes` says what could not be
        settled, `limit_points` and `doublings` are the curves that were followed. Ctrl-C ends it with what was found.

    Notes
    -----
    An isola is met if one of its limit points, followed over the parameter, leads to a branch that bifurcates from the
    response at one of `values`, or if the search meets it. One that does so nowhere within the bounds may be missed:
    widen the bounds, or search for its period.
    """
    catalogue = Catalogue.checked(system, parameter, bounds, omega, harmonics, max_curves, options)
    search_at = checked_values("values", values, catalogue.bounds, least=2)
    if isinstance(search_at, int):
        search_at = np.linspace(*catalogue.bounds, search_at).tolist()
    check_count("depth", depth, 0)
    processes = check_workers(workers)
    other_levels, fine = checked_levels(levels), check_seeds(seeds)
    orders = None if search is None else checked_orders(search, 2)
    state = Search(catalogue, sorted(set(search_at)))
    with catalogue.reporting(options.get("progress"), f"isolas over {parameter}"):
        _from_responses(state, depth, processes)
        _from_load_levels(state, other_levels, depth, processes)
        _from_resonances(state, orders, fine)
    return state.result()


def checked_levels(levels: Any) -> tuple[float, ...] | None:
    """Levels of the loads at which responses are followed besides; None where the search chooses."""
    if levels is None:
        return None
    given = listed(levels)
    if not all(is_number(level) and level > 0.0 for level in given):
        raise InputError(f"levels must be positive numbers, those of the loads in units of their own, not {levels!r}")
    if any(level == 1.0 for level in given):
        raise InputError(
            "levels are other ones than 1, that of the loads themselves: responses there are followed anyway"
        )
    return tuple(float(level) for level in given)


#: levels of the loads, and periods of motions, that are tried where nothing else leads to an isola
_LEVELS, _ORDERS = (1.5, 2.2, 3.2, 4.7), (2,)


def _from_responses(search: Search, depth: int, workers: int) -> None:
    """Responses at all values, with what bifurcates from them so many bifurcations deep."""
    catalogue, count = search.catalogue, len(search.values)
    catalogue.progress(0.0, f"{catalogue.name} = {search.values[0]:.6g}")
    found = Responses(catalogue.emptied(), depth).over(list(search.values), workers, catalogue)
    for number, (value, branches) in enumerate(zip(search.values, found, strict=True), 1):
        for branch in followed_doublings(catalogue, value, branches):
            search.attach(Loop(value, branch, search.pieces_on(branch, value), False))
        if number < count:
            catalogue.progress(_PREPARATION * number / count, f"{catalogue.name} = {search.values[number]:.6g}")
    catalogue.progress(_PREPARATION, "closed branches")
    search.settle(search.values)


def _from_load_levels(search: Search, levels: Sequence[float] | None, depth: int, workers: int) -> None:
    """Responses at other levels of all loads together, in units of their own: most isolas join the main branch there.

    Limit points met there are followed over the level to the loads' own one, where they lie on branches of the system
    itself. Without levels some, as long as no isola is known, and at few values.
    """
    catalogue = search.catalogue
    for level in _LEVELS if levels is None else levels:
        if levels is None and search.isolas:
            break
        values = search.few if levels is None else list(search.values)
        found = UnderOtherLoads(catalogue.emptied(), depth, level).over(values, workers, catalogue)
        for value, orbits in zip(values, found, strict=True):
            catalogue.progress(_PREPARATION, f"{level:g} times the loads at {catalogue.name} = {value:.6g}")
            known = list(search.met.get(value, []))
            for orbit in orbits:
                if any(lies_on(orbit, branch.points, images=True) for branch in known):
                    continue
                with catalogue.noting(f"at {catalogue.name} = {value:.6g}, a limit point from stronger loads"):
                    bounds = (min(catalogue.omega.low, orbit.omega), max(catalogue.omega.high, orbit.omega))
                    known.append(continue_branch(orbit, "omega", bounds, **catalogue.options))
                    search.meet(known[-1], value)


def _from_resonances(search: Search, orders: Sequence[int] | None, seeds: Seeds | None) -> None:
    """Motions of some periods near nonlinear resonances of the linear modes (`find_subharmonics`).

    Without periods those of 2T, where no isola is known, at few values.
    """
    if orders is None and search.isolas:
        return
    for value in search.few if orders is None else search.values:
        for order in _ORDERS if orders is None else orders:
            known = [branch for branch in search.met.get(value, []) if branch.nu == order]
            for branch in search.catalogue.resonant(value, order, seeds, known, _PREPARATION):
                search.meet(branch, value)
