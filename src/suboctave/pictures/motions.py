"""What pictures of single motions have in common: units, frames, captions, colours.

A motion is a dataset (`suboctave.store.motions`), so that a picture is the same from a live orbit, from a branch and
from a file. Motions stand in frames of their own on shared axes, or all in one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, path_of, suggest
from suboctave.pictures import style
from suboctave.pictures.legend import place_legend
from suboctave.pictures.periods import curve_styles, period_name, period_of, styles_of_periods
from suboctave.pictures.saving import SUFFIXES, png_bytes, save_figure
from suboctave.pictures.view import check_units

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "DERIVATIVES",
    "Frames",
    "MotionView",
    "captions",
    "check_path",
    "differing",
    "draw_gaps",
    "draw_sections",
    "lower_first",
]

#: what of a displacement may be shown: the order of its derivative by time
DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}
_DOTS = ("x", r"\dot{x}", r"\ddot{x}")
_CALLED = ("displacement", "velocity", "acceleration")
#: most frames in one row
_COLUMNS = 4
#: inches of width below which captions and labels are cut short
_NARROW = 1.9
#: inches of width of a figure above which there is room for the most columns
_WIDE = 5.0
#: inches of one line of a caption
_LINE = 0.13


@dataclass(frozen=True)
class MotionView:
    """What is drawn of a motion and in which units; the names mean what they mean for `View`.

    quantity
        "displacement", "velocity", "acceleration", or "force" with `element`.
    frequency
        "Hz" or "rad/s": the system's time is in seconds.
    omega_reference
        Frequencies are `omega / omega_reference`, time is `omega_reference t`, and velocities are derivatives by that.
    scale, unit
        Factor on lengths (of a force, on the force), and its unit.
    """

    quantity: str = "displacement"
    element: int | None = None
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None
    xlabel: str | None = None
    ylabel: str | None = None

    def __post_init__(self) -> None:
        check_units(self.frequency, self.omega_reference, self.scale)

    def check_quantity(self, known: Sequence[str]) -> None:
        """InputError for a quantity that is not among those known, or an element where none is asked for."""
        if self.quantity not in known:
            raise InputError(f"unknown quantity {self.quantity!r}{suggest(str(self.quantity), known)}")
        if self.quantity == "force":
            if isinstance(self.element, bool) or not isinstance(self.element, int | np.integer):
                raise InputError("the quantity 'force' is one of an element: give element=, its index")
        elif self.element is not None:
            raise InputError(
                f"element={self.element!r} says nothing about the quantity {self.quantity!r}; leave it out"
            )

    def factor(self, order: int = 0) -> float:
        """What a derivative of x of this order is multiplied by."""
        return float(self.scale or 1.0) / (self.omega_reference or 1.0) ** order

    def name(self, dataset: xarray.Dataset, order: int, words: bool = False) -> str:
        """A derivative of x as an axis says it: `dx/dt (mm/s)`."""
        one = int(dataset.attrs["dofs"]) == 1
        index = "" if one else f"_{{{int(dataset.attrs['dof'])}}}"
        if self.omega_reference is not None and order:
            power = "" if order == 1 else f"^{order}"
            said = rf"$d{power}x{index}/d(\omega_0 t){power}$"
        else:
            said = f"${_DOTS[order]}{index}$"
        if words:
            said = f"{_CALLED[order]} {said}"
        if self.unit:
            per = "" if not order or self.omega_reference is not None else ("/s", "/s²")[order - 1]
            per = per if self.frequency or not per else per.replace("s", "time")
            said += f" ({self.unit}{per})"
        return said

    def at_frequency(self, omega: float) -> str:
        """A frequency in words."""
        if self.frequency == "Hz":
            return f"{omega / (2.0 * math.pi):.4g} Hz"
        if self.omega_reference is not None:
            return rf"$\omega/\omega_0$ = {omega / self.omega_reference:.4g}"
        return rf"$\omega$ = {omega:.4g}" + (" rad/s" if self.frequency else "")


def differing(datasets: Sequence[xarray.Dataset]) -> list[list[str]]:
    """For each motion the parameters that differ between them, such as "p = 0.55"."""
    values = [
        dict(zip((str(n) for n in data["parameter"].to_numpy()), data["parameters"].to_numpy(), strict=True))
        for data in datasets
    ]
    shared = [name for name in values[0] if all(name in known for known in values)]
    names = [name for name in shared if len({float(known[name]) for known in values}) > 1]
    return [[f"{name} = {known[name]:.4g}" for name in names] for known in values]


def captions(datasets: Sequence[xarray.Dataset], view: MotionView) -> list[list[str]]:
    """What is said of each motion: T, 2T, ... with the kind of a bifurcation; frequency; what differs."""
    told = []
    for dataset, words in zip(datasets, differing(datasets), strict=True):
        kind = _plain(str(dataset.attrs.get("kind", "")))
        period = period_name(period_of(dataset))
        frequency = view.at_frequency(float(dataset.attrs["omega"]))
        told.append([f"{period}, {kind}" if kind else period, frequency, *words])
    return told


class Frames:
    """The frames of one figure and what is drawn in which: one for each motion on shared axes, or one for all.

    `axes`, one for each motion; `narrow`, whether there is little room for words; `looks`, the style of each motion;
    `legend` and `last`, the legend's entries, first those of single motions.
    """

    def __init__(
        self,
        datasets: Sequence[xarray.Dataset],
        view: MotionView,
        *,
        overlay: bool,
        labels: Sequence[str] | None,
        size: str | tuple[float, float] | None,
        cell: tuple[float, float],
        stacked: bool = False,
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        count = len(datasets)
        if labels is not None and len(labels) != count:
            raise InputError(f"labels: expected one for each of the {count} motions, got {len(labels)}")
        dofs = sorted({int(dataset.attrs["dof"]) for dataset in datasets})
        if len(dofs) > 1:
            raise InputError(f"the motions are of different degrees of freedom ({dofs}): choose one with dof=")
        frames = 1 if overlay else count
        self.overlay = overlay and count > 1
        columns = 1 if stacked else _columns(frames, size)
        rows = math.ceil(frames / columns)
        inches = _inches(size, columns, rows, cell)
        self.narrow = inches[0] / columns < _NARROW
        told = [("\n" if self.narrow and not overlay else ", ").join(parts) for parts in captions(datasets, view)]
        if isinstance(size, str) and not overlay and rows * columns > 1:  # room for what stands over the frames
            inches = inches[0], inches[1] + rows * _LINE * (told[0].count("\n") + (labels is not None))
        self.look = style.PRINT if isinstance(size, str) else style.look_of(inches[0] / columns)
        self.figure: Figure = Figure(figsize=inches, layout="constrained", facecolor="white")
        FigureCanvasAgg(self.figure)
        grid = self.figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        every: list[Axes] = list(grid.ravel())
        self.frames = every[:frames]
        for index in range(frames, rows * columns):
            every[index].remove()
            every[index - columns].tick_params(labelbottom=True)
        self.axes = self.frames * count if overlay else self.frames
        self.names = told if labels is None else [_plain(label) for label in labels]
        periods = [period_of(dataset) for dataset in datasets]
        # in frames of their own motions of one period need not differ
        self.looks = curve_styles(datasets, self.names) if overlay else styles_of_periods(periods, [""] * count)
        self.legend: dict[str, dict[str, Any]] = {}
        self.last: dict[str, dict[str, Any]] = {}
        if not self.overlay:
            for index, axes in enumerate(self.frames):
                above = told[index] if labels is None else f"{self.names[index]}\n{told[index]}"
                axes.set_title(above, fontsize=self.look.normal, color=style.INK)
        self._edges = (columns, frames)

    def add(self, name: str, drawing: dict[str, Any], last: bool = True) -> None:
        """An entry of the legend, motions before what is said of all of them; the first of a name stays."""
        (self.last if last else self.legend).setdefault(name, drawing)

    def finish(self, across: str, upwards: str, title: str | None, path: str | Path | None) -> Figure:
        """Labels, legend, title; saved where a path is given."""
        from matplotlib.lines import Line2D

        columns, frames = self._edges
        for index, axes in enumerate(self.frames):
            lowest = index + columns >= frames
            _dress(axes, across if lowest else "", upwards if index % columns == 0 else "", self.look)
        if title:
            self.figure.suptitle(_plain(title), fontsize=self.look.large, color=style.INK)
        entries = {name: Line2D([], [], **drawing) for name, drawing in {**self.legend, **self.last}.items()}
        # beside several frames: inside one of them it would seem to be about that one
        place_legend(self.figure, self.frames if frames == 1 else [], entries, self.look)
        if path is not None:
            save_figure(self.figure, path)
        # Notebooks show an object that has this; without pyplot nothing else would tell them to.
        setattr(self.figure, "_repr_png_", partial(png_bytes, self.figure))  # noqa: B010
        return self.figure


def lower_first(datasets: Sequence[xarray.Dataset]) -> list[int]:
    """The order of drawing: sub-harmonic motions over those of the load's period."""
    return sorted(range(len(datasets)), key=lambda index: period_of(datasets[index]))


def draw_sections(frames: Frames, index: int, x: np.ndarray, y: np.ndarray) -> None:
    """Circles on the stroboscopic points of a motion."""
    marks: dict[str, Any] = {
        "linestyle": "none",
        "marker": "o",
        "markersize": 0.9 * style.MARKER_SIZE * frames.look.marker,
        "markerfacecolor": "#ffffff",
        "markeredgewidth": 1.4 * frames.look.edge,
    }
    colour = frames.looks[index].colour
    frames.axes[index].plot(x, y, zorder=5, gid="stroboscopic", markeredgecolor=colour, clip_on=False, **marks)
    frames.add("stroboscopic points", {**marks, "markeredgecolor": style.INK})


def draw_gaps(frames: Frames, datasets: Sequence[xarray.Dataset], view: MotionView, upright: bool) -> None:
    """Thin lines at the gaps that the widest of the motions reaches, or nearly so."""
    drawing: dict[str, Any] = {"color": style.SOFT, "linewidth": 0.6 * frames.look.line}
    reach = 1.25 * max(float(dataset.attrs["amplitude"]) for dataset in datasets)
    drawn: set[tuple[int, float]] = set()
    for axes, dataset in zip(frames.axes, datasets, strict=True):
        for level in np.unique(dataset["gap_level"].to_numpy()):
            if abs(level) > reach or (id(axes), float(level)) in drawn:
                continue
            drawn.add((id(axes), float(level)))
            line = axes.axvline if upright else axes.axhline
            line(float(level) * view.factor(), zorder=1, gid="gap", **drawing)
            frames.add("gaps", drawing)


def check_path(path: str | Path | None) -> None:
    """InputError for a file of a form that figures do not have, before any work."""
    if path is not None and (suffix := path_of(path).suffix.lower()) not in SUFFIXES:
        raise InputError(f"cannot tell the form of {path_of(path).name!r} from its suffix{suggest(suffix, SUFFIXES)}")


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


def _dress(axes: Axes, across: str, upwards: str, look: style.Look) -> None:
    axes.set_xlabel(across, fontsize=look.large, color=style.INK)
    axes.set_ylabel(upwards, fontsize=look.large, color=style.INK)
    axes.tick_params(direction="in", top=True, right=True, labelsize=look.normal, color=style.INK, zorder=2)
    axes.tick_params(which="minor", direction="in", top=True, right=True, color=style.INK, zorder=2)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(style.INK)
        spine.set_linewidth(0.53 * look.line)


def _plain(text: str) -> str:
    """A name as it is: dollar signs in it do not begin mathematics."""
    return str(text).replace("$", r"\$")
