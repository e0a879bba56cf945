"""What `regime_map` gives: labels of the plane of omega and a design parameter, by the stable motions that exist."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.checks import is_number
from suboctave.analysis.junction import period_name
from suboctave.analysis.regime_arcs import Arc
from suboctave.analysis.regime_atlas import Atlas
from suboctave.analysis.regime_motions import motion_at
from suboctave.analysis.regime_slices import Slice
from suboctave.analysis.results import Table
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.errors import InputError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import limited
from suboctave.store.columns import parameter_column

if TYPE_CHECKING:
    import pandas

    from suboctave.analysis.regime_check import RegimeCheck

__all__ = ["Regime", "RegimeMap", "Region", "Strip"]


@dataclass(frozen=True)
class Regime:
    """The stable motions that coexist: of each its period in periods of the load, and whether it lies on an isola.

    `beyond`: the same of what leaves the deepest branches at period doublings, with the period of the first such
    motions. It was not followed: it may double again, or be chaotic.
    """

    motions: tuple[tuple[int, bool], ...] = ()
    beyond: tuple[tuple[int, bool], ...] = ()

    @property
    def count(self) -> int:
        """How many stable motions are known; two that differ by a shift in time only are one, mirror images two."""
        return len(self.motions)

    @property
    def periods(self) -> tuple[int, ...]:
        """Their periods in periods of the load, ascending, one for each motion."""
        return tuple(nu for nu, _ in self.motions)

    @property
    def isolated(self) -> bool:
        """Whether one of them lies on an isola."""
        return any(isolated for _, isolated in (*self.motions, *self.beyond))

    def __str__(self) -> str:
        parts = []
        for group, words in ((self.motions, ""), (self.beyond, " or more")):
            for (nu, isolated), number in sorted(Counter(group).items()):
                name = f"{period_name(nu)}{words}{' on an isola' if isolated else ''}"
                parts.append(name if number == 1 else f"{number} x {name}")
        return " + ".join(parts) or "no stable motion known"


@dataclass(frozen=True, eq=False)
class Strip:
    """Values of the parameter from `low` to `high`, the slice that tells its regimes, and whether that lies within."""

    low: float
    high: float
    seen: Slice | None
    looked_at: bool

    @property
    def arcs(self) -> list[Arc]:
        """The stable arcs."""
        return [] if self.seen is None else self.seen.arcs

    @property
    def value(self) -> float:
        """The value of the parameter that was looked at."""
        return 0.5 * (self.low + self.high) if self.seen is None else self.seen.value


@dataclass(frozen=True)
class Region:
    """A connected part of the plane with one regime: its share of the plane, and the ranges that it lies within."""

    regime: Regime
    share: float
    omega: tuple[float, float]
    values: tuple[float, float]


class RegimeMap:
    """Which stable motions exist over omega and a design parameter.

    Attributes
    ----------
    system, parameter, omega, bounds
        What vibrates, the design parameter, both ranges (ascending).
    depth
        How many period doublings deep branches were followed.
    curves
        The curves of bifurcations that the labels rest on.
    strips
        The stretches of the parameter within which the order of the regimes is the same.
    notes
        What could not be settled; empty if nothing was left open.
    interruption
        What stopped the work, Ctrl-C or a time limit (`seconds`); None if it came to its end.
    """

    def __init__(self, atlas: Atlas, strips: Sequence[Strip], depth: int, resolution: float) -> None:
        self.system = atlas.system
        self.parameter = atlas.name
        self.omega = atlas.omega
        self.bounds = atlas.bounds
        self.options = dict(atlas.options)
        self.curves: tuple[TrackedBranch, ...] = tuple(atlas.curves)
        self.strips = tuple(strips)
        self.depth = depth
        self.resolution = resolution
        self.notes = tuple(atlas.notes)
        self.interruption = atlas.interruption
        self.seconds = float("nan")

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C or a time limit stopped it."""
        return self.interruption is not None

    def strip(self, value: float) -> Strip:
        """The strip that a value of the parameter lies in; InputError outside the bounds."""
        low, high = self.bounds
        if not is_number(value) or not low <= value <= high:
            raise InputError(f"the map reaches from {self.parameter} = {low:g} to {high:g}, not to {value!r}")
        return next(s for s in self.strips if value <= s.high or s is self.strips[-1])

    def arcs(self, omega: float, value: float) -> list[Arc]:
        """The stable arcs that have a motion at a point of the plane; InputError outside the map."""
        low, high = self.omega
        if not is_number(omega) or not low <= omega <= high:
            raise InputError(f"the map reaches from omega = {low:g} to {high:g}, not to {omega!r}")
        found = []
        for arc in self.strip(value).arcs:
            first, last = (float(v) for v in arc.range(value))
            if first <= omega <= last:
                found.append(arc)
        return found

    def motions(self, omega: float, value: float) -> list[PeriodicOrbit]:
        """The stable motions themselves at a point of the plane, solved there; those beyond the depth are left out.

        Raises
        ------
        ConvergenceError
            If one is not found again, which may happen next to a border.
        """
        strip = self.strip(value)
        return [
            motion_at(arc, strip.value, self.system, self.parameter, self.omega, omega, value)
            for arc in self.arcs(omega, value)
            if arc.followed
        ]

    @limited
    def check(
        self,
        points: int = 200,
        seed: int = 0,
        *,
        states: int = 4,
        transient: int = 400,
        progress: Any = None,
        seconds: float | None = None,
    ) -> RegimeCheck:
        """Integrate in time at points of the plane drawn at random, and compare what is reached with the labels.

        Parameters
        ----------
        points, seed
            How many points, drawn evenly from the plane with this seed.
        states
            From how many states, drawn at random from all orders of magnitude between the smallest motion of the map
            and twice the largest, or the linear response in resonance; the known stable motions, slightly disturbed,
            are starts as well.
        transient
            Periods of the load before a motion is recognised; those that have not settled get ten times as many.
        seconds
            Time limit; what is not complete then is no check, and a TimeLimitError says so.
        """
        from suboctave.analysis.regime_check import check_regimes

        return check_regimes(self, points, seed, states, transient, progress)

    def label(self, omega: float, value: float) -> Regime:
        """The stable motions known at a point of the plane.

        Raises
        ------
        InputError
            Outside the map.
        """
        return _regime(self.arcs(omega, value))

    def raster(self, columns: int = 400, rows: int = 300) -> tuple[np.ndarray, tuple[Regime, ...]]:
        """The labels at the centres of cells: numbers (rows, columns), the parameter growing with the row; the regimes.

        A regime's place in the tuple, which is in order of the area, is its number.
        """
        (low, high), (first, last) = self.bounds, self.omega
        values = low + (np.arange(rows) + 0.5) / rows * (high - low)
        omega = first + (np.arange(columns) + 0.5) / columns * (last - first)
        cells = np.empty((rows, columns), dtype=int)
        regimes: dict[Regime, int] = {}
        for strip in self.strips:
            chosen = np.nonzero((values > strip.low) & (values <= strip.high))[0]
            if not len(chosen):
                continue
            ranges = [arc.range(values[chosen]) for arc in strip.arcs]
            present = [((omega >= a[:, None]) & (omega <= b[:, None])).ravel() for a, b in ranges]
            numbers = np.zeros(len(chosen) * columns, dtype=int)
            for there in present:  # cells with the same arcs so far have the same number
                numbers = np.unique(2 * numbers + there, return_inverse=True)[1]
            labels = []
            for cell in np.unique(numbers, return_index=True)[1]:
                regime = _regime([arc for arc, there in zip(strip.arcs, present, strict=True) if there[cell]])
                labels.append(regimes.setdefault(regime, len(regimes)))
            cells[chosen] = np.array(labels)[numbers].reshape(len(chosen), columns)
        known = list(regimes)
        order = sorted(range(len(known)), key=lambda i: -np.count_nonzero(cells == i))
        return np.argsort(order)[cells], tuple(known[i] for i in order)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The connected regions of the plane, the largest first; those smaller than a cell of `raster` are left out."""
        from scipy import ndimage

        cells, regimes = self.raster()
        rows, columns = cells.shape
        (low, high), (first, last) = self.bounds, self.omega
        found = []
        for number, regime in enumerate(regimes):
            parts, count = ndimage.label(cells == number)
            for where, index in zip(ndimage.find_objects(parts), range(1, count + 1), strict=True):
                up, across = where
                found.append(
                    Region(
                        regime,
                        float(np.count_nonzero(parts[where] == index) / cells.size),
                        tuple(first + s / columns * (last - first) for s in (across.start, across.stop)),
                        tuple(low + s / rows * (high - low) for s in (up.start, up.stop)),
                    )
                )
        return tuple(sorted(found, key=lambda region: -region.share))

    @property
    def regimes(self) -> tuple[Regime, ...]:
        """The regimes that occur, that of the largest area first."""
        return tuple(dict.fromkeys(region.regime for region in self.regions))

    def to_table(self) -> Table:
        """The borders of stable arcs, point by point: arc, period, whether on an isola, kind, parameter, both ends."""
        own = ("strip", "arc", "period", "isola", "from kind", "to kind")
        names = (*own, parameter_column(self.parameter, own), "from omega", "to omega")
        rows = list(self._rows())
        columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else [np.zeros(0)] * len(names)
        title = f"stable motions over omega and {self.parameter}"
        return Table(dict(zip(names, columns, strict=True)), title)

    def _rows(self, count: int = 33) -> Iterator[tuple[Any, ...]]:
        for number, strip in enumerate(self.strips):
            values = np.linspace(strip.low, strip.high, count)
            for which, arc in enumerate(strip.arcs):
                kinds = [edge.kind or ("range" if edge.bound else "end of branch") for edge in arc.edges]
                first, last = (np.clip(side, *self.omega) for side in arc.range(values))
                for value, a, b in zip(values, first, last, strict=True):
                    if b > a:
                        yield (number, which, arc.nu, arc.isolated, *kinds, float(value), float(a), float(b))

    def to_dataframe(self) -> pandas.DataFrame:
        """`to_table` as a table of pandas."""
        return self.to_table().to_dataframe()

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """The plane coloured by regime, with the borders; options are those of `pictures.regimes.plot_regimes`."""
        from suboctave.pictures.regimes import plot_regimes

        cells, regimes = self.raster(900, 700)
        said = [(str(r).replace(" x ", " \u00d7 "), r.motions, r.beyond) for r in regimes]
        lines = list(self._lines())
        return plot_regimes(cells, said, lines, (self.omega, self.bounds), ("omega", self.parameter), path, **options)

    def _lines(self) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """The stretches of borders that stable motions end at, in the strips in which they do: kind, omega, values."""
        drawn: set[tuple[int, int]] = set()
        for number, strip in enumerate(self.strips):
            values = strip.low + 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 121))) * (strip.high - strip.low)
            for edge in (edge for arc in strip.arcs for edge in arc.edges):
                if edge.border is not None and (number, id(edge.border)) not in drawn:
                    drawn.add((number, id(edge.border)))
                    yield edge.kind, edge.across(values), values

    def __repr__(self) -> str:
        (first, last), (low, high) = self.omega, self.bounds
        looked = sum(strip.looked_at for strip in self.strips)
        text = (
            f"Regimes for omega from {first:g} to {last:g}, {self.parameter} from {low:g} to {high:g}: "
            f"{len(self.regimes)} of stable motions up to {period_name(2**self.depth)}, from {len(self.curves)} curves "
            f"of bifurcations and branches at {looked} values of {self.parameter}."
        )
        shares: defaultdict[Regime, float] = defaultdict(float)
        for region in self.regions:
            shares[region.regime] += region.share
        for regime, share in sorted(shares.items(), key=lambda item: -item[1]):
            text += f"\n  {100.0 * share:5.1f} %  {regime}"
        for note in self.notes:
            text += f"\nnote: {note}"
        return text


def _regime(arcs: Sequence[Arc]) -> Regime:
    known, beyond = ([(a.nu, a.isolated) for a in arcs if a.followed is followed] for followed in (True, False))
    return Regime(tuple(sorted(known)), tuple(sorted(beyond)))
