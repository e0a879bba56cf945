"""`isola_map`: in which region of two design parameters an isola exists.

`find_isolas` says between which values of one design parameter an isola lives. Its two ends, the centre where it is
born and the point where it merges, are extrema of curves of limit points: `track` follows both in a second design
parameter. Between the two curves the isola exists. At some values of the second parameter a closed branch in the middle
of the range is followed, which no curve of extrema knows of: it must close, and the curve of its limit points must end
where the map says.

At one value s of the second parameter an isola lives between two values of the design parameter q, each an extremum of
a curve of limit points, or a bound. Both ends are followed in s. Where both reach the same turn of one curve of extrema
the range closes: beyond there is no isola. Where only one end is followed no further, what is beyond is not known.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias, Unpack

import numpy as np

from suboctave.analysis.options import SearchOptions
from suboctave.analysis.track import track
from suboctave.arguments import Positive, Range, checked
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.notes import Note, lines
from suboctave.continuation.problem import Array
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import period_name
from suboctave.curves.trace import TrackedPoint
from suboctave.errors import ConvergenceError, InputError, is_number, suggest
from suboctave.interruption import Interruption, pass_on
from suboctave.maps.catalogue import FAILURES, PlaneMap, SearchRange, Work, branch_through, carrier_of, checked_values
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.pieces import MonotonePiece, across, pieces_of
from suboctave.model.inputs import check_bounds, check_parameter, timed
from suboctave.model.system import System
from suboctave.options import ParallelOptions, with_options
from suboctave.results.branch import TrackedBranch
from suboctave.store.layout import parameter_column
from suboctave.store.table import Table
from suboctave.workers import check_workers, in_order

#: where the map is held against closed branches, in shares of the stretch of the second parameter
_PROBED = (0.1, 0.5, 0.9)
#: share of the work that following the two ends is, for progress
_ENDS = 0.5
#: so much of the range of the design parameter may the ends differ from those of a closed branch
_AGREES = 1e-3


@with_options(ParallelOptions)
@timed
def isola_map(
    isolas: Isola | Isolas | Sequence[Isola],
    parameter: str,
    bounds: Range,
    *,
    probes: int | Sequence[float] = 3,
    max_step: Positive | None = None,
    **options: Unpack[ParallelOptions],
) -> IsolaMap:
    """Where in two design parameters an isola exists: its birth and its merging followed in a second parameter.

    Parameters
    ----------
    isolas
        What `find_isolas` gave, or one isola (several of one search).
    parameter, bounds
        The second design parameter and its range, in which the value in the system lies; the order is irrelevant.
    probes
        At how many values of the second parameter each region is held against a closed branch that is followed in the
        middle of it, evenly spread; 0 for none; or these values.
    max_step
        As in `track`.

    The probes are divided among `workers`. After a time limit the map holds the curves that are complete.

    Returns
    -------
    IsolaMap
        With `contains(j=..., Kc=...)`, `ranges(value)`, `plot`, the `regions` and their curves; `notes` says what could
        not be settled. Ctrl-C ends it with the curves that are complete.

    Raises
    ------
    InputError
        Wrong input, before any work.

    Notes
    -----
    Only isolas that exist at the value that the second parameter has in the system are followed. One that exists only
    elsewhere belongs to another search.
    """
    items = _checked(isolas)
    first = items[0]
    system, name = first.system, first.parameter
    check_parameter(system, parameter)
    if parameter in (name, "omega"):
        raise InputError(f"the second parameter must be another one than {name} and omega, not {parameter!r}")
    low, high = sorted(check_bounds(system, parameter, bounds))
    here = float(system.parameters[parameter])
    if not low <= here <= high:
        raise InputError(
            f"the isola was found at {parameter} = {here:g}, outside the bounds ({low:g}, {high:g}): widen them, or "
            f"search with a system whose {parameter} lies within"
        )
    places = checked_values("probes", probes, (low, high), least=0)
    of_curves = first.options if max_step is None else {**first.options, "max_step": max_step}
    workers = check_workers(options.get("workers"))
    regions = _Regions(system, name, parameter, (low, high), of_curves, workers)
    with regions.reporting(options.get("progress"), f"isolas over {name} and {parameter}"):
        for number, isola in enumerate(items):
            regions.follow(isola, places, number, len(items))
    within = isolas.bounds if isinstance(isolas, Isolas) else None
    return IsolaMap(
        regions.regions, system, name, parameter, within, (low, high), regions.unsettled, regions.interruption
    )


def _checked(isolas: Any) -> list[Isola]:
    items = [isolas] if isinstance(isolas, Isola) else list(isolas) if isinstance(isolas, Iterable) else []
    if not items and isinstance(isolas, Isolas):
        raise InputError("there is no isola to follow: find_isolas found none")
    if not items or not all(isinstance(item, Isola) for item in items):
        raise InputError(f"isola_map takes what find_isolas gave, or an isola of it, not {type(isolas).__name__}")
    if len({(id(item.system), item.parameter) for item in items}) > 1:
        raise InputError("the isolas belong to several searches: give those of one find_isolas")
    return items


@dataclass(eq=False)
class _Regions(Work):
    """The regions of isolas of one search over a second parameter, and the curves of their ends, each once."""

    system: System
    name: str
    second: str
    bounds: tuple[float, float]
    options: SearchOptions
    workers: int
    regions: list[IsolaRegion] = field(default_factory=list)
    tracked: list[tuple[IsolaEnd, TrackedBranch]] = field(default_factory=list)

    def follow(self, isola: Isola, probes: Any, number: int, count: int) -> None:
        """The region of an isola, one of `count`, if its ends can be followed, and what closed branches within say."""

        def at(part: float, where: str) -> None:
            self.progress((number + part) / count, f"isola {number + 1} of {count}, {where}")

        name, second = self.name, self.second
        here = float(self.system.parameters[second])
        ends: list[MonotonePiece | float] = []
        curves: list[TrackedBranch] = []
        for end, value, reason in zip(isola.ends, isola.range, isola.reasons, strict=True):
            if end is None:
                ends.append(value)
                text = f"one end of the isola is no extremum ({reason}). The map keeps {name} = {value:.7g} there"
                self.notes.append(Note(text, second, here, here))
                continue
            place = name, float(end), float(end), end.kind.replace("_", " ")
            at(0.0 if not ends else _ENDS / 2.0, place[-1])
            try:
                curve = self._curve(end)
            except ConvergenceError as failure:
                self.notes.append(Note(f"could not be followed over {second}", *place, failure=str(failure)))
                return
            borders = [b for b in pieces_of(curve, second, name) if b.contains(here)]
            if not borders:
                self.notes.append(Note(f"its curve does not pass {second} = {here:g}", *place))
                return
            ends.append(min(borders, key=lambda b: abs(float(b.across(here)) - float(end))))
            if curve not in curves:
                curves.append(curve)
        both = ends[0], ends[1]
        # how far both ends can be followed to either side
        sides = (_reached(here, both, self.bounds, second, upper) for upper in (False, True))
        (low, high), reasons, closed, settled = zip(*sides, strict=True)
        span = Span(low, high, both, reasons, closed, settled)
        self.notes += [Note(reason) for reason, settled in zip(span.reasons, span.settled, strict=True) if not settled]
        at(_ENDS, "closed branches")
        looks = tuple(self._probes(isola, span, probes))
        self.regions.append(IsolaRegion(isola, second, span, tuple(curves), looks))

    def _curve(self, end: IsolaEnd) -> TrackedBranch:
        """The curve of an extremum, once for all isolas that share it."""
        for known, curve in self.tracked:
            if known.orbit is end.orbit or lies_on(end.orbit, curve.points, self.second, images=True):
                return curve
        curve = track(end, self.second, self.bounds, **self.options)
        pass_on(curve.interruption)
        self.tracked.append((end, curve))
        return curve

    def _probes(self, isola: Isola, span: Span, probes: Any) -> Iterator[Probe]:
        """What closed branches at some values of the second parameter say."""
        if isinstance(probes, int):
            shares = _PROBED if probes == len(_PROBED) else (np.arange(probes) + 0.5) / max(probes, 1)
            probes = [span.low + float(share) * (span.high - span.low) for share in shares]
        border = next((e for e in span.ends if isinstance(e, MonotonePiece)), None)
        if border is not None:
            places = [float(s) for s in probes if span.contains(float(s))]
            nodes = [border.nodes[int(np.argmin(np.abs(border.values - s)))] for s in places]
            probing = _Probing(self.system, self.name, self.second, self.options, span, isola.omega)
            yield from in_order(probing, nodes, self.workers)


@dataclass(frozen=True, eq=False)
class _Probing:
    """Follows the limit points at one value of the second parameter, and the branch in the middle of the range.

    Nothing of the curves of extrema is used but one motion to begin with.
    """

    system: System
    name: str
    second: str
    options: SearchOptions
    span: Span
    omega: tuple[float, float]

    def __call__(self, node: TrackedPoint) -> Probe:
        """What they say at a motion of a border."""
        name, options, orbit, span = self.name, self.options, node.orbit, self.span
        place = float(orbit.values[self.second])
        low, high = span.range(place)
        middle, width = 0.5 * (low + high), high - low
        context = {"system": self.system.with_parameters({self.second: place}), **options}
        start = Bifurcation("LP", orbit, node.floquet, orbit.residual, 0.0, name, context=context)
        try:
            curve = track(start, name, (low - 0.5 * width, high + 0.5 * width), **options)
            pass_on(curve.interruption)
            pieces = [piece for piece in pieces_of(curve, name) if piece.contains(middle)]
            if not pieces:
                return Probe(place, middle, (low, high), None, "no limit points there")
            nearest = min(pieces, key=lambda piece: abs(float(piece.across(middle)) - orbit.omega))
            branch = branch_through(nearest.solve_at(middle), SearchRange(*self.omega), name, pieces, options)
            pass_on(branch.interruption)
            detached = carrier_of(branch, (), options) is not None
        except FAILURES as failure:
            return Probe(place, middle, (low, high), None, str(failure))
        if not detached:
            return Probe(place, middle, (low, high), False, "the branch there is not detached")
        turns = [e.parameter(name) for e in curve.extrema if e.parameter_name == name]
        ends = [float(end.across(place)) for end in span.ends if isinstance(end, MonotonePiece)]
        missed = [end for end in ends if not any(abs(turn - end) <= _AGREES * width for turn in turns)]
        disagreement = f"its curve of limit points does not turn at {name} = {missed[0]:.7g}" if missed else ""
        return Probe(place, middle, (low, high), True, disagreement)


Ends: TypeAlias = tuple[MonotonePiece | float, MonotonePiece | float]
_WORDS = {"isola_centre": "birth (isola centre)", "isola_merging": "merging"}
#: shares of the range of s that are rounding
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Span:
    """A stretch of s over which an isola lives between two ends, each a border or a number (a bound of q).

    `reasons` says in words why it begins at its lower and ends at its upper value of s; `closed` whether the range of q
    shrinks to nothing there; `settled` whether that is all there is (the bounds of s, or closed).
    """

    low: float
    high: float
    ends: Ends
    reasons: tuple[str, str]
    closed: tuple[bool, bool]
    settled: tuple[bool, bool]

    def contains(self, value: float) -> bool:
        """Whether it reaches a value of s."""
        return self.low <= value <= self.high

    def range(self, value: float) -> tuple[float, float]:
        """Between which values of q the isola exists at a value of s."""
        low, high = (float(across(end, value)) for end in self.ends)
        return low, high

    def outline(self) -> tuple[Array, Array, Array]:
        """Values of s, dense towards both ends, and both ends of the range of q there."""
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 241))
        values = self.low + share * (self.high - self.low)
        low, high = (across(end, values) for end in self.ends)
        return values, low, high


def _reached(
    start: float, ends: Ends, bounds: tuple[float, float], second: str, upper: bool
) -> tuple[float, str, bool, bool]:
    """How far in one direction: the value of s, why no further, whether the range closes, whether that is settled."""
    bound, slack = bounds[upper], _ROUNDING * (bounds[1] - bounds[0])
    followed = [end for end in ends if isinstance(end, MonotonePiece)]
    edges = {end: end.high if upper else end.low for end in followed}
    reach = (min if upper else max)([bound, *edges.values()])
    if reach != start and not (len(followed) == 2 and followed[0].curve is followed[1].curve):
        values = np.linspace(start, reach, 400)[:-1]
        crossed = values[across(ends[0], values) > across(ends[1], values)]
        if len(crossed):
            place = float(crossed[0])
            return place, f"the two ends of the range cross at {second} = {place:.7g}", True, False
    if abs(reach - bound) <= slack:
        return bound, f"{second} = {bound:.7g}, the end of the bounds", False, True
    stops = [end for end, edge in edges.items() if abs(edge - reach) <= slack]
    events = [event for end in stops if (event := end.end(upper)) is not None]
    if len(events) == 2 and events[0].orbit is events[1].orbit:
        where = f"{second} = {reach:.7g}, {events[0].names[1]} = {events[0].parameter(events[0].names[1]):.7g}"
        return reach, f"born and merging meet at {where}: no isola beyond", True, True
    border = stops[0]
    ending = "turns back" if border.end(upper) is not None else f"ends ({border.curve.ended})"
    return reach, f"the curve of one end {ending} at {second} = {reach:.7g}: what is beyond is not known", False, False


@dataclass(frozen=True)
class Probe:
    """A closed branch followed in the middle of a region, to hold the map against.

    second, middle
        Where, in the second and in the design parameter.
    range
        What the map says of the design parameter there.
    detached
        Whether the branch closes without meeting another one; None where it could not be followed.
    disagreement
        What does not agree; empty if all does.
    """

    second: float
    middle: float
    range: tuple[float, float]
    detached: bool | None
    disagreement: str = ""

    @property
    def agrees(self) -> bool:
        """Whether the branch is an isola, and its limit points turn where the map says."""
        return bool(self.detached) and not self.disagreement


@dataclass(frozen=True, eq=False)
class IsolaRegion:
    """Where one isola exists: over the second parameter's stretch `span` between two values of the design parameter.

    `isola` is the one that it was followed from, `curves` the tracked curves of its ends, `probes` what closed branches
    within it say.
    """

    isola: Isola
    second: str
    span: Span
    curves: tuple[TrackedBranch, ...]
    probes: tuple[Probe, ...] = ()

    def border(self, upper: bool) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Its lower or upper border in pieces: what it is in words, the second parameter, the design parameter."""
        end = self.span.ends[upper]
        if not isinstance(end, MonotonePiece):
            values = np.array([self.span.low, self.span.high])
            return [("bounds", values, np.full(2, end))]
        values = np.unique(np.concatenate((np.linspace(self.span.low, self.span.high, 241), end.values)))
        values = values[(values >= self.span.low) & (values <= self.span.high)]
        # by the inner nodes: at the ends of a border both natures meet
        inner = np.arange(1, max(len(end.nodes) - 1, 2))
        nearest = inner[np.argmin(np.abs(end.values[inner] - values[:, None]), axis=1)]
        natures = [_WORDS.get(end.nodes[i].isola, "end") for i in nearest]
        where = end.across(values)
        cuts = [0, *(i for i in range(1, len(values)) if natures[i] != natures[i - 1]), len(values)]
        return [(natures[a], values[a : b + 1], where[a : b + 1]) for a, b in pairwise(cuts)]


@checked(result=True)
@dataclass(eq=False, repr=False)
class IsolaMap(PlaneMap):
    """In which regions of two design parameters isolas exist.

    Attributes
    ----------
    system, parameter, second
        What vibrates, the design parameter of the search, the second one.
    bounds
        Range of the second parameter; `within` that of the design parameter, where that is known.
    regions
        One `IsolaRegion` for each isola.
    notes
        What is not settled; empty if nothing is.
    interruption
        What stopped the work, Ctrl-C or a time limit (`seconds`); None if it came to its end.
    """

    regions: Sequence[IsolaRegion]
    system: System
    parameter: str
    second: str
    within: tuple[float, float] | None
    bounds: tuple[float, float]
    notes: Sequence[str]
    interruption: Interruption | None = None

    def __post_init__(self) -> None:
        self.regions = tuple(self.regions)
        doubts = [
            Note(
                "a closed branch that was followed here disagrees with the map",
                *(self.second, probe.second, probe.second),
                where=f"{self.second} = {probe.second:.6g}, {self.parameter} = {probe.middle:.6g}",
                failure=probe.disagreement,
            )
            for region in self.regions
            for probe in region.probes
            if not probe.agrees
        ]
        self.notes = tuple(dict.fromkeys([*self.notes, *lines(doubts)]))

    @property
    def born(self) -> list[TrackedBranch]:
        """The curves along which isolas are born, over both design parameters."""
        return self._curves("isola_centre")

    @property
    def merges(self) -> list[TrackedBranch]:
        """The curves along which they merge with other branches; one that changes its nature is among both."""
        return self._curves("isola_merging")

    @property
    def curves(self) -> list[TrackedBranch]:
        """All curves, each once."""
        return list(dict.fromkeys(curve for region in self.regions for curve in region.curves))

    def _curves(self, nature: str) -> list[TrackedBranch]:
        return [curve for curve in self.curves if nature in curve.isola]

    def ranges(self, value: float) -> list[tuple[float, float]]:
        """Between which values of the design parameter isolas exist at a value of the second one; one pair for each.

        Raises
        ------
        InputError
            Outside the bounds, and where a curve ends before it, so that nothing is known.
        """
        self._check_reach(self.second, value, self.bounds)
        ranges = []
        for region in self.regions:
            span = region.span
            if span.contains(value):
                ranges.append(span.range(value))
            elif not span.settled[above := value > span.high]:
                raise InputError(f"at {self.second} = {value:g} nothing is known: {span.reasons[above]}")
        return sorted(ranges)

    def contains(self, **values: float) -> bool:
        """Whether an isola exists at a pair of values, given by name: `contains(j=0.3, Kc=5.0)`.

        Raises
        ------
        InputError
            For other names, and as `ranges`.
        """
        both = (self.parameter, self.second)
        for name in values:
            if name not in both:
                raise InputError(f"the map has {both[0]} and {both[1]}, not {name!r}{suggest(name, both)}")
        for name in both:
            if name not in values or not is_number(values[name]):
                raise InputError(f"give both as numbers: contains({both[0]}=..., {both[1]}=...)")
        return any(low <= values[self.parameter] <= high for low, high in self.ranges(values[self.second]))

    def borders(self) -> list[MonotonePiece]:
        """All borders as functions of the second parameter, also stretches of the curves that bound no region."""
        return [b for curve in self.curves for b in pieces_of(curve, self.second, self.parameter)]

    def to_table(self) -> Table:
        """The borders of the regions, point by point: region, end, what it is, and both parameters."""
        rows = [
            (number, side, nature, float(a), float(b))
            for number, region in enumerate(self.regions)
            for upper, side in enumerate(("lower", "upper"))
            for nature, first, second in region.border(bool(upper))
            for a, b in zip(first, second, strict=True)
        ]
        own = ("region", "end", "border")
        names = (*own, *(parameter_column(name, own) for name in (self.second, self.parameter)))
        return Table.of_rows(names, rows, f"isolas over {self.second} and {self.parameter}")

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """The regions in the plane of both parameters, curves of birth and merging named.

        Options are those of every figure in a plane, such as `title` and `xlim`.
        """
        from suboctave.pictures.maps import plot_isola_map

        regions = [
            (period_name(r.isola.nu), r.span.outline(), [r.border(u) for u in (False, True)]) for r in self.regions
        ]
        return plot_isola_map(regions, (self.second, self.parameter), path=path, bounds=self.bounds, **options)

    def __repr__(self) -> str:
        low, high = self.bounds
        count = len(self.regions)
        regions = f"{count} region{'s' * (count != 1)}"
        lines = [f"Isolas over {self.parameter} and {self.second} from {low:g} to {high:g}: {regions}."]
        for region in self.regions:
            span = region.span
            ranges = ((value, *span.range(value)) for value in (span.low, span.high))
            ends = [f"{self.parameter} from {a:.6g} to {b:.6g} at {self.second} = {s:.6g}" for s, a, b in ranges]
            lines += [f"{period_name(region.isola.nu)} isola: {', '.join(ends)}", *(f"  {r}" for r in span.reasons)]
            if region.probes:
                agreeing = sum(probe.agrees for probe in region.probes)
                lines.append(f"  {agreeing} of {len(region.probes)} closed branches followed within it agree")
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])
