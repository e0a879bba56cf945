"""Regions of two design parameters in which isolas exist: what `isola_map` gives.

At one value s of the second parameter an isola lives between two values of the design parameter q, each an extremum of
a curve of limit points, or a bound. Both ends are followed in s. Where both reach the same turn of one curve of extrema
the range closes: beyond there is no isola. Where only one end is followed no further, what is beyond is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.curves.junction import period_name
from suboctave.errors import InputError, is_number, suggest
from suboctave.interruption import Interruption
from suboctave.maps.isolas.result import Isola
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.model.system import System
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.columns import parameter_column
from suboctave.store.registry import Stored
from suboctave.store.table import Table

if TYPE_CHECKING:
    import pandas

__all__ = ["IsolaMap", "IsolaRegion", "Probe", "Span", "spans_of"]

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
    ends: tuple[MonotonePiece | float, MonotonePiece | float]
    reasons: tuple[str, str]
    closed: tuple[bool, bool]
    settled: tuple[bool, bool]

    def contains(self, value: float) -> bool:
        """Whether it reaches a value of s."""
        return self.low <= value <= self.high

    def range(self, value: float) -> tuple[float, float]:
        """Between which values of q the isola exists at a value of s."""
        low, high = (float(e.across(value)) if isinstance(e, MonotonePiece) else e for e in self.ends)
        return low, high

    def outline(self, count: int = 241) -> tuple[Array, Array, Array]:
        """Values of s, dense towards both ends, and both ends of the range of q there."""
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
        values = self.low + share * (self.high - self.low)
        low, high = (e.across(values) if isinstance(e, MonotonePiece) else np.full(count, e) for e in self.ends)
        return values, np.asarray(low), np.asarray(high)


def spans_of(
    start: float,
    ends: tuple[MonotonePiece | float, MonotonePiece | float],
    bounds: tuple[float, float],
    second: str,
) -> Span:
    """The stretch of s around `start` over which both ends can be followed."""
    down, up = (_reached(start, ends, bounds, second, upper) for upper in (False, True))
    return Span(down[0], up[0], ends, (down[1], up[1]), (down[2], up[2]), (down[3], up[3]))


def _reached(
    start: float,
    ends: tuple[MonotonePiece | float, MonotonePiece | float],
    bounds: tuple[float, float],
    second: str,
    upper: bool,
) -> tuple[float, str, bool, bool]:
    """How far in one direction: the value of s, why no further, whether the range closes, whether that is settled."""
    bound = bounds[1] if upper else bounds[0]
    sign = 1.0 if upper else -1.0
    slack = _ROUNDING * (bounds[1] - bounds[0])
    reach = bound
    for end in ends:
        if isinstance(end, MonotonePiece):
            edge = end.high if upper else end.low
            reach = edge if sign * (edge - reach) < 0.0 else reach
    crossed = _crossing(start, reach, ends, upper)
    if crossed is not None:
        return crossed, f"the two ends of the range cross at {second} = {crossed:.7g}", True, False
    if abs(reach - bound) <= slack:
        return bound, f"{second} = {bound:.7g}, the end of the bounds", False, True
    stops = [e for e in ends if isinstance(e, MonotonePiece) and abs((e.high if upper else e.low) - reach) <= slack]
    events = [e.end(upper) for e in stops]
    if len(stops) == 2 and events[0] is not None and events[1] is not None and events[0].orbit is events[1].orbit:
        where = f"{second} = {reach:.7g}, {events[0].names[1]} = {events[0].parameter(events[0].names[1]):.7g}"
        return reach, f"born and merging meet at {where}: no isola beyond", True, True
    border = stops[0]
    ending = "turns back" if border.end(upper) is not None else f"ends ({border.curve.ended})"
    return reach, f"the curve of one end {ending} at {second} = {reach:.7g}: what is beyond is not known", False, False


def _crossing(start: float, reach: float, ends: Sequence[MonotonePiece | float], upper: bool) -> float | None:
    """The value of s nearest to `start` at which the lower end rises above the upper one, None if it does not."""
    low, high = ends
    if reach == start or (
        isinstance(low, MonotonePiece) and isinstance(high, MonotonePiece) and low.curve is high.curve
    ):
        return None
    values = np.linspace(start, reach, 400)[:-1]
    first, last = (e.across(values) if isinstance(e, MonotonePiece) else np.full(len(values), e) for e in (low, high))
    crossed = np.nonzero(np.asarray(first) > np.asarray(last))[0]
    return float(values[crossed[0]]) if len(crossed) else None


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
        natures = [_WORDS.get(end.nodes[i].isola, "end") for i in (_nearest(end, value) for value in values)]
        where = end.across(values)
        pieces: list[tuple[str, np.ndarray, np.ndarray]] = []
        first = 0
        for i in range(1, len(values) + 1):
            if i == len(values) or natures[i] != natures[first]:
                stop = min(i + 1, len(values))
                pieces.append((natures[first], values[first:stop], where[first:stop]))
                first = i
        return pieces


def _nearest(border: MonotonePiece, value: float) -> int:
    """The inner node nearest to a value: at the ends of a border both natures meet."""
    inner = np.arange(1, max(len(border.nodes) - 1, 2))
    return int(inner[np.argmin(np.abs(border.values[inner] - value))])


class IsolaMap(Stored):
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

    def __init__(
        self,
        regions: Sequence[IsolaRegion],
        system: System,
        parameter: str,
        second: str,
        within: tuple[float, float] | None,
        bounds: tuple[float, float],
        notes: Sequence[str],
        interruption: Interruption | None = None,
    ) -> None:
        self.regions = tuple(regions)
        self.system = system
        self.parameter = parameter
        self.second = second
        self.within = within
        self.bounds = bounds
        self.interruption = interruption
        doubts = [
            f"at {second} = {probe.second:.6g}, {parameter} = {probe.middle:.6g}: {probe.disagreement}"
            for region in regions
            for probe in region.probes
            if not probe.agrees
        ]
        self.notes = tuple(dict.fromkeys([*notes, *doubts]))

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
        low, high = self.bounds
        if not is_number(value) or not low <= value <= high:
            raise InputError(f"the map reaches from {self.second} = {low:g} to {high:g}, not to {value!r}")
        ranges = []
        for region in self.regions:
            span = region.span
            if span.contains(value):
                ranges.append(span.range(value))
                continue
            above = value > span.high
            if not span.settled[above]:
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
        rows: list[tuple[int, str, str, float, float]] = []
        for number, region in enumerate(self.regions):
            for upper in (False, True):
                for nature, first, second in region.border(upper):
                    side = "upper" if upper else "lower"
                    rows += [(number, side, nature, float(a), float(b)) for a, b in zip(first, second, strict=True)]
        columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else [np.zeros(0)] * 5
        own = ("region", "end", "border")
        names = (*own, *(parameter_column(name, own) for name in (self.second, self.parameter)))
        title = f"isolas over {self.second} and {self.parameter}"
        return Table(dict(zip(names, columns, strict=True)), title)

    def to_dataframe(self) -> pandas.DataFrame:
        """`to_table` as a table of pandas."""
        return self.to_table().to_dataframe()

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """The regions in the plane of both parameters, curves of birth and merging named.

        Options: `title`, `size`, `xlim`, `ylim`, `xlabel`, `ylabel`.
        """
        from suboctave.pictures.isolas import plot_isola_map

        regions = [
            (period_name(r.isola.nu), r.span.outline(), [r.border(u) for u in (False, True)]) for r in self.regions
        ]
        return plot_isola_map(regions, (self.second, self.parameter), path, bounds=self.bounds, **options)

    def __repr__(self) -> str:
        low, high = self.bounds
        count = len(self.regions)
        regions = f"{count} region{'s' * (count != 1)}"
        text = f"Isolas over {self.parameter} and {self.second} from {low:g} to {high:g}: {regions}."
        for region in self.regions:
            span = region.span
            ends = ", ".join(
                f"{self.parameter} from {a:.6g} to {b:.6g} at {self.second} = {value:.6g}"
                for value, (a, b) in ((v, span.range(v)) for v in (span.low, span.high))
            )
            text += f"\n{period_name(region.isola.nu)} isola: {ends}"
            for reason in span.reasons:
                text += f"\n  {reason}"
            if region.probes:
                agreeing = sum(probe.agrees for probe in region.probes)
                text += f"\n  {agreeing} of {len(region.probes)} closed branches followed within it agree"
        for note in self.notes:
            text += f"\nnote: {note}"
        return text
