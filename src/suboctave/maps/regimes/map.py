"""What `regime_map` gives: labels of the plane of omega and a design parameter, by the stable motions that exist."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.curves.junction import period_name
from suboctave.interruption import limited
from suboctave.maps.regimes.check import RegimeCheck, check_regimes
from suboctave.maps.regimes.strips import LabelledPlane, Regime, Strip, regime_of
from suboctave.store.columns import parameter_column
from suboctave.store.registry import Stored
from suboctave.store.table import Table

if TYPE_CHECKING:
    import pandas

__all__ = ["Regime", "RegimeMap", "Region", "Strip"]


@dataclass(frozen=True)
class Region:
    """A connected part of the plane with one regime: its share of the plane, and the ranges that it lies within."""

    regime: Regime
    share: float
    omega: tuple[float, float]
    values: tuple[float, float]


class RegimeMap(LabelledPlane, Stored):
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
        return check_regimes(self, points, seed, states, transient, progress)

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
                regime = regime_of([arc for arc, there in zip(strip.arcs, present, strict=True) if there[cell]])
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
        parts_of_plane = []
        for number, regime in enumerate(regimes):
            parts, count = ndimage.label(cells == number)
            for where, index in zip(ndimage.find_objects(parts), range(1, count + 1), strict=True):
                up, across = where
                parts_of_plane.append(
                    Region(
                        regime,
                        float(np.count_nonzero(parts[where] == index) / cells.size),
                        tuple(first + s / columns * (last - first) for s in (across.start, across.stop)),
                        tuple(low + s / rows * (high - low) for s in (up.start, up.stop)),
                    )
                )
        return tuple(sorted(parts_of_plane, key=lambda region: -region.share))

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
        labels = [(str(r).replace(" x ", " \u00d7 "), r.motions, r.beyond) for r in regimes]
        lines = list(self._lines())
        return plot_regimes(cells, labels, lines, (self.omega, self.bounds), ("omega", self.parameter), path, **options)

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
        count = sum(strip.examined for strip in self.strips)
        text = (
            f"Regimes for omega from {first:g} to {last:g}, {self.parameter} from {low:g} to {high:g}: "
            f"{len(self.regimes)} of stable motions up to {period_name(2**self.depth)}, from {len(self.curves)} curves "
            f"of bifurcations and branches at {count} values of {self.parameter}."
        )
        shares: defaultdict[Regime, float] = defaultdict(float)
        for region in self.regions:
            shares[region.regime] += region.share
        for regime, share in sorted(shares.items(), key=lambda item: -item[1]):
            text += f"\n  {100.0 * share:5.1f} %  {regime}"
        for note in self.notes:
            text += f"\nnote: {note}"
        return text
