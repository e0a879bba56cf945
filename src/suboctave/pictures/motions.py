"""Phase portraits and time histories of single motions.

A motion is a dataset (`suboctave.store.motions`), so that a picture is the same from a live orbit, from a branch and
from a file. Motions stand in frames of their own on shared axes, or all in one. A motion of nu load periods has nu
stroboscopic points, at t = 0, 2 pi / omega, ...: a period doubling doubles their number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Guide, Markers, Polyline, Ticks, plain
from suboctave.pictures.layers import check_count
from suboctave.pictures.options import DERIVATIVES, HistoryOptions, MotionOptions, MotionView
from suboctave.pictures.paper import check_path, figure_of
from suboctave.pictures.periods import curve_styles, period_name, period_of, styles_of_periods
from suboctave.pictures.style import Mark, Pen
from suboctave.pictures.words import differing

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: inches of one frame of a portrait, and of a history
_PORTRAIT, _HISTORY = (3.0, 2.9), (5.6, 2.0)
#: most frames in one row
_COLUMNS = 4
#: inches of width below which captions and labels are cut short
_NARROW = 1.9
#: inches of width of a figure above which there is room for the most columns
_WIDE = 5.0
#: inches of one line of a caption
_LINE = 0.13


@with_options(MotionOptions)
def plot_phase(motions: Any, path: str | Path | None = None, **options: Unpack[MotionOptions]) -> Figure:
    """Draw phase portraits, dx/dt over x along one response period, side by side or in one frame.

    The colour tells the period, T, 2T, ...; circles are the stroboscopic points t = 0, 2 pi / omega, ..., thin lines
    the gaps of elements that act on the degree of freedom alone.

    Parameters
    ----------
    motions
        An orbit, a bifurcation, a point of a branch, a branch with `points`, a dataset of a motion, or a sequence of
        these.
    path
        Where the figure is saved: .png, .svg or .pdf, fonts embedded.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    drawn = MotionDrawing(motions, path, options, ["displacement"], _PORTRAIT)
    datasets, view = drawn.datasets, drawn.view
    factors = np.array([[view.factor(0)], [view.factor(1)]])
    for index in drawn.lower_first:
        data = datasets[index]
        at, sections = (
            np.array([data[f"{prefix}{name}"].to_numpy() for name in ("displacement", "velocity")]) * factors
            for prefix in ("", "section_")
        )
        drawn.add_motion(index, at, sections)
    drawn.add_gaps(upright=True)
    texts = [view.name(datasets[0], order, words=not drawn.narrow) for order in (0, 1)]
    return drawn.figure(Axis(texts[0]), Axis(texts[1]))


@with_options(HistoryOptions)
def plot_history(motions: Any, path: str | Path | None = None, **options: Unpack[HistoryOptions]) -> Figure:
    """Draw motions, or the force of an element along them, over one response period.

    Time is counted in load periods from phase zero of the load, with `frequency` in seconds; beside a motion of longer
    period others go on, thin. Circles are the stroboscopic instants, thin grey lines the gaps of elements that act on
    the degree of freedom alone. `quantity` may be "force", too.

    Parameters
    ----------
    motions, path
        As in `plot_phase`.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    drawn = MotionDrawing(motions, path, options, [*DERIVATIVES, "force"], _HISTORY, stacked=True)
    datasets, view = drawn.datasets, drawn.view
    units = [_unit_of_time(dataset, view) for dataset in datasets]
    longest = max(float(data["time"].to_numpy()[-1]) * unit for data, unit in zip(datasets, units, strict=True))
    for index in drawn.lower_first:
        data, unit = datasets[index], units[index]
        time, values = data["time"].to_numpy() * unit, _values(data, view)
        at = data["section_time"].to_numpy() * unit
        drawn.add_motion(index, np.array([time, values]), np.array([at, np.interp(at, time, values)]))
        for repeated in range(1, math.ceil(longest / time[-1] - 1e-9)):
            again = Pen(drawn.pens[index].colour, 0.5)
            line = Polyline(np.array([time + repeated * time[-1], values]), again, role="repeated", layer=2.5)
            drawn.frame(index).items.append(line)
    if view.quantity == "displacement":
        drawn.add_gaps(upright=False)
    in_periods = view.frequency is None and view.omega_reference is None
    ticks = Ticks(9, (1, 2, 5, 10)) if in_periods and longest > 1.5 else None
    text = "time (s)" if view.frequency else r"time in load periods, $t/T$" if in_periods else r"time $\omega_0 t$"
    across = Axis(text, -0.02 * longest, 1.02 * longest, ticks=ticks)
    if view.quantity == "force":
        upwards = f"force of element {view.element}" + (f" ({view.unit})" if view.unit else "")
    else:
        upwards = view.name(datasets[0], DERIVATIVES[view.quantity])
    return drawn.figure(across, Axis(upwards))


def _values(dataset: xarray.Dataset, view: MotionView) -> np.ndarray:
    if view.quantity == "force":
        row = list(dataset["element"].to_numpy()).index(view.element)
        return np.asarray(dataset["force"].to_numpy()[row] * view.factor())
    return np.asarray(dataset[view.quantity].to_numpy() * view.factor(DERIVATIVES[view.quantity]))


def _unit_of_time(dataset: xarray.Dataset, view: MotionView) -> float:
    """What t is multiplied by on the axis."""
    if view.frequency is not None:
        return 1.0
    return view.omega_reference or float(dataset.attrs["omega"]) / (2.0 * math.pi)


class MotionDrawing:
    """The frames of one figure of motions: one for each motion on shared axes, or one for all.

    `options` are those of the verb, `quantities` what it can draw, `cell` width and height of a frame in inches;
    `stacked`: one frame above the other. `narrow`, whether there is little room for words; `names` and `pens` of the
    motions; `legend` and `last`, the legend's entries, first those of single motions.
    """

    def __init__(
        self,
        motions: Any,
        path: str | Path | None,
        options: Mapping[str, Any],
        quantities: Sequence[str],
        cell: tuple[float, float],
        stacked: bool = False,
    ) -> None:
        from suboctave.store.motions import motion_datasets  # loads kernels, which curves from files need not

        given = {name: value for name, value in options.items() if value is not None}
        view = MotionView(**{f.name: given[f.name] for f in fields(MotionView) if f.name in given})
        view.check_quantity(quantities)
        check_path(path)
        elements = () if view.element is None else (view.element,)
        datasets = motion_datasets(motions, given.get("points"), given.get("dof"), elements)
        overlay, labels, size = bool(given.get("overlay")), given.get("labels"), given.get("size")
        count = len(datasets)
        check_count("labels", labels, count, "motions")
        dofs = sorted({int(dataset.attrs["dof"]) for dataset in datasets})
        if len(dofs) > 1:
            raise InputError(f"the motions are of different degrees of freedom ({dofs}): choose one with dof=")
        self.datasets, self.view, self.overlay = datasets, view, overlay and count > 1
        self.title, self.path = given.get("title", ""), path
        frames = 1 if overlay else count
        self.columns = 1 if stacked else _columns(frames, size)
        rows = math.ceil(frames / self.columns)
        inches = _inches(size, self.columns, rows, cell)
        self.narrow = inches[0] / self.columns < _NARROW
        captions = [("\n" if self.narrow and not overlay else ", ").join(parts) for parts in _captions(datasets, view)]
        named = isinstance(size, str)
        if named and not overlay and rows * self.columns > 1:  # room for what stands over the frames
            inches = inches[0], inches[1] + rows * _LINE * (captions[0].count("\n") + (labels is not None))
        self.sheet = style.Sheet(inches, style.PRINT if named else style.look_of(inches[0] / self.columns), named)
        self.names = captions if labels is None else [plain(label) for label in labels]
        periods = [period_of(dataset) for dataset in datasets]
        # in frames of their own motions of one period need not differ
        pens = curve_styles(datasets, self.names) if overlay else styles_of_periods(periods, [""] * count)
        self.pens = [Pen(pen.colour, pen.width if self.overlay else 1.0) for pen in pens]
        self.frames = [Frame() for _ in range(frames)]
        if not self.overlay:
            for frame, name, caption in zip(self.frames, self.names, captions, strict=True):
                frame.title = caption if labels is None else f"{name}\n{caption}"
        self.legend: dict[str, Entry] = {}
        self.last: dict[str, Entry] = {}

    @property
    def lower_first(self) -> list[int]:
        """The order of drawing: sub-harmonic motions over those of the load's period."""
        return sorted(range(len(self.datasets)), key=lambda index: period_of(self.datasets[index]))

    def frame(self, index: int) -> Frame:
        """The frame of a motion."""
        return self.frames[index if len(self.frames) > 1 else 0]

    def add_motion(self, index: int, at: np.ndarray, sections: np.ndarray) -> None:
        """Add a motion as a line, (2, instants), and circles on its stroboscopic points, (2, points)."""
        pen = self.pens[index]
        circle = Mark("o", 0.9 * style.MARKER_SIZE, "#ffffff", pen.colour, 1.4)
        circles = Markers(sections, circle, role="stroboscopic", layer=5.0)
        self.frame(index).items += [Polyline(at, pen, role="motion"), circles]
        self.last.setdefault("stroboscopic points", Entry(mark=replace(circle, edge=style.INK)))
        if self.overlay:
            self.legend.setdefault(self.names[index], Entry(pen))

    def add_gaps(self, upright: bool) -> None:
        """Add thin lines at the gaps that the widest of the motions reaches, or nearly so."""
        pen, drawn = Pen(style.SOFT, 0.6), set()
        reach = 1.25 * max(float(dataset.attrs["amplitude"]) for dataset in self.datasets)
        for index, dataset in enumerate(self.datasets):
            for level in np.unique(dataset["gap_level"].to_numpy()):
                if abs(level) > reach or (id(self.frame(index)), float(level)) in drawn:
                    continue
                drawn.add((id(self.frame(index)), float(level)))
                line = Guide(float(level) * self.view.factor(), pen, upright, role="gap", layer=1.0)
                self.frame(index).items.append(line)
                self.last.setdefault("gaps", Entry(pen))

    def figure(self, across: Axis, upwards: Axis) -> Figure:
        """The figure, saved where a path is given."""
        own = (self.view.xlabel, self.view.ylabel)
        axes = [replace(a, label=text or a.label) for a, text in zip((across, upwards), own, strict=True)]
        # beside several frames: inside one of them it would seem to be about that one
        legend = "free" if len(self.frames) == 1 else "outside"
        arranged: dict[str, Any] = {"columns": self.columns, "legend": legend, "grid": False, "small": True}
        entries = {**self.legend, **self.last}
        drawing = Drawing(axes, self.frames, entries, plain(self.title), **arranged)
        return figure_of(drawing, self.sheet, self.path)


def _captions(datasets: Sequence[xarray.Dataset], view: MotionView) -> list[list[str]]:
    """What stands over each motion: T, 2T, ... with the kind of a bifurcation; frequency; what differs."""
    values = [
        dict(zip((str(n) for n in data["parameter"].to_numpy()), data["parameters"].to_numpy().tolist(), strict=True))
        for data in datasets
    ]
    captions = []
    for dataset, words in zip(datasets, differing(values, digits=4), strict=True):
        kind = plain(str(dataset.attrs.get("kind", "")))
        period = period_name(period_of(dataset))
        frequency = view.at_frequency(float(dataset.attrs["omega"]))
        captions.append([f"{period}, {kind}" if kind else period, frequency, *words])
    return captions


def _columns(frames: int, size: str | tuple[float, float] | None) -> int:
    """As few rows as fit, evenly filled."""
    most = _COLUMNS if size is None or style.size_in_inches(size)[0] > _WIDE else _COLUMNS - 1
    return math.ceil(frames / math.ceil(frames / most))


def _inches(
    size: str | tuple[float, float] | None, columns: int, rows: int, cell: tuple[float, float]
) -> tuple[float, float]:
    """Width and height of the figure: a named size gives the width, and height for its rows."""
    if size is None:
        return 0.8 + cell[0] * columns, 0.7 + cell[1] * rows
    width, height = style.size_in_inches(size)
    if isinstance(size, str) and max(columns, rows) > 1:
        return width, 0.55 + rows * min(height, 0.75 * cell[1], width / columns * cell[1] / cell[0])
    return width, height
