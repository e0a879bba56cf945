"""Phase portraits, time histories and spectra of single motions.

A motion is a dataset (`suboctave.store.motions`), so that a picture is the same from a live orbit, from a branch and
from a file. Motions stand in frames of their own on shared axes, or all in one. A motion of nu load periods has nu
stroboscopic points, at t = 0, 2 pi / omega, ...: a period doubling doubles their number.

A spectrum shows |c_k| of `x(t) = Re sum_k c_k exp(i k omega t / nu)` over the multiples k / nu of omega.
Each component has the colour of the period of its own motion: that at k / nu = p / q, in lowest terms, repeats after q
load periods. A period doubling shows as new components halfway between the old ones. Beyond the components that were
solved for stand, hollow, those neglected, as the force of the solved motion would excite them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Guide, Markers, Polyline, Ticks, plain
from suboctave.pictures.options import DERIVATIVES, NO_DOF, HistoryOptions, MotionOptions, MotionView, SpectrumOptions
from suboctave.pictures.paper import check_path, finished
from suboctave.pictures.strokes import check_count, differing
from suboctave.pictures.style import Mark, Pen, curve_styles, period_colour, period_name, period_of, styles_of_periods

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: inches of one frame of a portrait, and of a history
_PORTRAIT, _HISTORY = (3.0, 2.9), (5.6, 2.0)
#: most frames in one row
_COLUMNS = 4
#: inches of width of a frame below which labels are cut short, and of a figure above which most columns have room
_NARROW, _WIDE = 1.9, 5.0
#: inches of a caption
_CAPTION = 0.13


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
    """
    drawn = MotionDrawing(motions, path, options, [*DERIVATIVES, "force"], _HISTORY, stacked=True)
    datasets, view = drawn.datasets, drawn.view
    # what t is multiplied by on the axis
    units = [
        1.0 if view.frequency else view.omega_reference or float(dataset.attrs["omega"]) / (2.0 * math.pi)
        for dataset in datasets
    ]
    longest = max(float(data["time"].to_numpy()[-1]) * unit for data, unit in zip(datasets, units, strict=True))
    for index in drawn.lower_first:
        data, unit = datasets[index], units[index]
        row = list(data["element"].to_numpy()).index(view.element) if view.quantity == "force" else ...
        values = data[view.quantity].to_numpy()[row] * view.factor(DERIVATIVES.get(view.quantity, 0))
        time = data["time"].to_numpy() * unit
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
        named = view.unit_of("force", datasets, NO_DOF)
        upwards = f"force of element {view.element}" + (f" ({named})" if named else "")
    else:
        upwards = view.name(datasets[0], DERIVATIVES[view.quantity])
    return drawn.figure(across, Axis(upwards))


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
        for dataset in datasets:
            view.check_time(dataset)
        overlay, labels, size = bool(given.get("overlay")), given.get("labels"), given.get("size")
        count = len(datasets)
        check_count("labels", labels, count, "motions")
        dofs = sorted({int(dataset.attrs["dof"]) for dataset in datasets})
        if len(dofs) > 1:
            raise InputError(f"the motions are of different degrees of freedom ({dofs}): choose one with dof=")
        self.datasets, self.view, self.overlay = datasets, view, overlay and count > 1
        self.title, self.path, self.options = given.get("title", ""), path, given
        self.frames = [Frame() for _ in range(1 if overlay else count)]
        self.columns, inches = _page(len(self.frames), 1 if stacked else _COLUMNS, size, cell)
        width, named = inches[0] / self.columns, isinstance(size, str)
        self.narrow = width < _NARROW
        self.sheet = style.Sheet(inches, style.PRINT if named else style.look_of(width), named)
        captions = [("\n" if self.narrow and not overlay else ", ").join(parts) for parts in _captions(datasets, view)]
        self.names = captions if labels is None else [plain(label) for label in labels]
        periods = [period_of(dataset) for dataset in datasets]
        # in frames of their own motions of one period need not differ
        pens = curve_styles(datasets, self.names) if overlay else styles_of_periods(periods, [""] * count)
        self.pens = [Pen(pen.colour, pen.width if self.overlay else 1.0) for pen in pens]
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
        pen = Pen(style.SOFT, 0.6)
        reach = 1.25 * max(float(dataset.attrs["amplitude"]) for dataset in self.datasets)
        levels = {
            (index if len(self.frames) > 1 else 0, float(level))
            for index, dataset in enumerate(self.datasets)
            for level in np.unique(dataset["gap_level"].to_numpy())
        }
        for place, level in sorted(levels):
            if abs(level) <= reach:
                self.frames[place].items.append(Guide(level * self.view.factor(), pen, upright, role="gap", layer=1.0))
                self.last.setdefault("gaps", Entry(pen))

    def figure(self, across: Axis, upwards: Axis) -> Figure:
        """The figure, saved where a path is given."""
        # beside several frames: inside one of them it would seem to be about that one
        legend = "free" if len(self.frames) == 1 else "outside"
        arranged: dict[str, Any] = {"columns": self.columns, "legend": legend, "grid": False, "small": True}
        self.frames[0].entries = self.legend | self.last
        drawing = Drawing((across, upwards), self.frames, plain(self.title), **arranged)
        return finished(drawing, self.sheet, self.path, self.options)


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


def _page(
    frames: int, most: int, size: str | tuple[float, float] | None, cell: tuple[float, float]
) -> tuple[int, tuple[float, float]]:
    """Columns, evenly filled, and width and height in inches; a named size is the width, with height for all rows."""
    width, height = (0.0, 0.0) if size is None else style.size_in_inches(size)
    if size is not None and width <= _WIDE:
        most = min(most, _COLUMNS - 1)
    rows = math.ceil(frames / most)
    columns = math.ceil(frames / rows)
    if size is None:
        width, height = 0.8 + cell[0] * columns, 0.7 + cell[1] * rows
    elif isinstance(size, str) and frames > 1:
        height = 0.55 + rows * (_CAPTION + min(height, 0.75 * cell[1], width / columns * cell[1] / cell[0]))
    return columns, (width, height)


# -------------------------------------------------------------------------------------------------------------- spectra
_CELL = (5.6, 2.4)  # inches of one frame
#: components below this share of the largest are rounding, or zero by symmetry
_NOTHING = 1e-11
#: share of the solved range that is shown beyond it
_BEYOND = 0.3
#: markers of one motion after another, in one frame
_MARKERS = ("o", "s", "^", "D", "v")
#: points of a marker, and share of that of one neglected
_SIZE, _SMALLER = 0.62 * style.MARKER_SIZE, 0.8
#: where the components that were solved for end
_END = Pen(style.SOFT, 0.9, (0, (1.0, 1.5)))


@with_options(SpectrumOptions)
def plot_spectrum(
    motions: Any,
    path: str | Path | None = None,
    *,
    highest: float | None = None,
    **options: Unpack[SpectrumOptions],
) -> Figure:
    """Draw the amplitudes of a motion's components on a logarithmic scale, one above the other or in one frame.

    Components at whole multiples of omega are those of motions of the load's period; those at multiples of omega / 2,
    omega / 3, ... have colours of their own. A dotted line ends what was solved for, hollow markers beyond it are the
    neglected components, estimated. With `frequency` the axis shows frequencies, not multiples of omega.

    Parameters
    ----------
    motions, path
        As in `plot_phase`.
    highest
        Highest multiple of omega that is shown; default all that was solved for and some of what was neglected.
    """
    if highest is not None and not (isinstance(highest, int | float) and math.isfinite(highest) and highest > 0):
        raise InputError(f"highest must be a positive multiple of omega, not {highest!r}")
    drawn = MotionDrawing(motions, path, options, list(DERIVATIVES), _CELL, stacked=True)
    datasets, view = drawn.datasets, drawn.view
    most = highest or max(_end(dataset) * (1.0 + _BEYOND) for dataset in datasets)
    nu = max(period_of(dataset) for dataset in datasets)
    # where components stand close their markers must not become one
    apart = 0.85 * 72.0 * drawn.sheet.inches[0] / (most * nu + 1.0) / drawn.sheet.look.marker
    decades = _decades(datasets, view, most)
    for index in drawn.lower_first:
        _add(drawn, index, most, min(_SIZE, max(0.8 * apart, 1.3)), decades[0] or 1e-300)
    if any(_end(dataset) + 0.5 / period_of(dataset) < most for dataset in datasets):
        drawn.last["neglected (estimated)"] = Entry(_END, Mark("o", 0.5 * style.MARKER_SIZE, "#ffffff"))
    text = r"frequency / $\omega_0$" if view.omega_reference else "frequency / forcing frequency"
    text = f"frequency ({view.frequency})" if view.frequency else text
    unit = max(_unit_of_axis(dataset, view) for dataset in datasets)
    ticks = _ticks(nu, most) if view.frequency is None and view.omega_reference is None else None
    across = Axis(text, -0.6 * unit / nu, (most + 0.3 / nu) * unit, ticks=ticks)
    upwards = view.name(datasets[0], DERIVATIVES[view.quantity]).replace("$", r"$|c_k|$ of $", 1)
    return drawn.figure(across, Axis(upwards, *decades, logarithmic=True))


def _end(dataset: xarray.Dataset) -> float:
    """Highest multiple of omega that was solved for."""
    return float(dataset["multiple"].to_numpy()[-1])


def _unit_of_axis(dataset: xarray.Dataset, view: MotionView) -> float:
    """What a multiple of omega is multiplied by on the axis."""
    omega = float(dataset.attrs["omega"])
    return 1.0 if view.frequency is None and view.omega_reference is None else omega * view.per_omega


def _components(dataset: xarray.Dataset, view: MotionView) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Multiples of omega and amplitudes of the components that were solved for, and of those neglected."""
    order, omega, parts = DERIVATIVES[view.quantity], float(dataset.attrs["omega"]), {}
    for name, multiple in (("component", "multiple"), ("neglected", "multiple_neglected")):
        at = dataset[multiple].to_numpy()
        height = np.abs(dataset[f"amplitude_of_{name}"].to_numpy()) * (at * omega) ** order * view.factor(order)
        parts[name] = at, height
    return parts


def _add(drawn: MotionDrawing, index: int, most: float, size: float, foot: float) -> None:
    """Add one motion's components to its frame, with markers of this size, and stems from `foot` on."""
    dataset, view, overlay = drawn.datasets[index], drawn.view, drawn.overlay
    items, unit, nu = drawn.frame(index).items, _unit_of_axis(dataset, view), period_of(dataset)
    parts = _components(dataset, view)
    shape = _MARKERS[index % len(_MARKERS)] if overlay else _MARKERS[0]
    hollow, rim = overlay and index > 0, min(1.0, size / _SIZE)  # so that one behind it shows
    for name, (at, height) in parts.items():
        shown = (height > _NOTHING * parts["component"][1].max()) & (at <= most * (1.0 + 1e-9))
        periods = np.array([Fraction(round(m * nu), nu).denominator for m in at])
        for q in np.unique(periods[shown]):
            chosen, colour, solved = shown & (periods == q), period_colour(int(q)), name == "component"
            x, y = at[chosen] * unit, height[chosen]
            face = colour if solved and not hollow else "none" if solved else "#ffffff"
            mark = Mark(shape, size if solved else _SMALLER * size, face, colour, rim)
            if solved and not overlay:
                gaps = np.full(x.size, np.nan)
                stems = np.array([np.ravel([x, x, gaps], "F"), np.ravel([np.full(x.size, foot), y, gaps], "F")])
                items.append(Polyline(stems, Pen(colour, 0.5 * rim), role="stem", layer=2.0))
            items.append(Markers(np.array([x, y]), mark, cut=True, role=f"{name} {q}"))
            if solved:
                words = r"at $k\,\omega$" if q == 1 else rf"at $k\,\omega/{q}$"
                drawn.last.setdefault(words, Entry(mark=replace(mark, marker="o", size=_SIZE, face=colour)))
    if overlay:
        drawn.legend.setdefault(drawn.names[index], Entry(mark=Mark(shape, size, "none" if hollow else style.INK)))
    if _end(dataset) + 0.5 / nu < most:
        items.append(Guide((_end(dataset) + 0.5 / nu) * unit, _END, upright=True, role="truncation", layer=1.0))


def _decades(datasets: Sequence[xarray.Dataset], view: MotionView, most: float) -> tuple[float | None, float | None]:
    """The limits upwards: whole decades, three at least."""
    parts = [part for dataset in datasets for part in _components(dataset, view).values()]
    every = np.concatenate([height[at <= most * (1.0 + 1e-9)] for at, height in parts])
    if every.max(initial=0.0) <= 0.0:
        return None, None
    above = every[every > _NOTHING * every.max()]
    top = math.ceil(math.log10(1.3 * above.max()))
    return 10.0 ** min(math.floor(math.log10(above.min())), top - 3), 10.0**top


def _ticks(nu: int, most: float) -> Ticks:
    """The multiples of omega, as fractions where there is room for them."""
    if nu * most <= 14.0:
        places = [Fraction(k, nu) for k in range(math.floor(nu * most) + 1)]
        return Ticks(places=[float(place) for place in places], texts=[str(place) for place in places])
    return Ticks(12, (1, 2, 5, 10), whole=True, minor=1.0 if most <= 130.0 else None)
