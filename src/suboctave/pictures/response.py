"""Response curves: amplitude over frequency, or over any parameter that was free.

Stable motions solid, unstable ones dashed, located bifurcations marked. Figures are built from datasets
(`suboctave.store.layout`), so a curve looks the same live and from a file, and without any global plotting state.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.legend import ordered, place_legend
from suboctave.pictures.periods import curve_styles, period_name, period_of, several_periods
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.strokes import Stroke, bent, strokes, without_repeats
from suboctave.pictures.view import View
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["draw_response", "plot_panels", "plot_response"]


def plot_response(
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
    view: View | None = None,
) -> Figure:
    """One or several response curves in one frame, saved to `path` where one is given (.png, .svg, .pdf).

    `x` names the horizontal axis: "omega" or a parameter (default: what the curves were followed in). `labels` tell
    several curves apart (default: the parameters in which they differ). `size`: "single-column", "double-column", or
    width and height in inches. `view`: the quantity drawn and the units (default: amplitude, as it is).
    """
    return plot_panels(
        [_as_list(curves)],
        path,
        x=x,
        labels=None if labels is None else [labels],
        titles=[title] if title else None,
        size=size,
        view=view,
    )


def plot_panels(
    panels: Sequence[xarray.Dataset | Sequence[xarray.Dataset]],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[Sequence[str]] | None = None,
    titles: Sequence[str] | None = None,
    size: str | tuple[float, float] | None = None,
    view: View | None = None,
) -> Figure:
    """Several frames side by side on the same axes, with one legend for all of them.

    Each entry of `panels` is what `plot_response` takes; `labels` and `titles` have one entry for each panel. Saved
    to `path` where one is given.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    groups = [_as_list(panel) for panel in panels]
    for name, given in (("labels", labels), ("titles", titles)):
        if given is not None and len(given) != len(groups):
            raise InputError(f"{name}: expected one entry for each of the {len(groups)} panels, got {len(given)}")
    horizontal = _common_axis([dataset for group in groups for dataset in group], x)

    shown = view or View()
    wide = 1.2 + 5.2 * len(groups) if len(groups) == 1 else 1.0 + 4.2 * len(groups)
    inches = style.size_in_inches((wide, 4.2) if size is None else size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0] / len(groups))
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    frames = figure.subplots(1, len(groups), squeeze=False, sharex=True, sharey=True)[0]
    periods = several_periods([dataset for group in groups for dataset in group])
    legend: dict[str, Line2D] = {}
    for index, (axes, group) in enumerate(zip(frames, groups, strict=True)):
        told = None if labels is None else labels[index]
        legend |= draw_response(axes, group, x=horizontal, labels=told, view=shown, look=look, by_period=periods)
        if titles is not None:
            axes.set_title(_plain(titles[index]), fontsize=look.large, color=style.INK)
        if index:
            axes.set_ylabel("")
    _set_limits(frames, groups, horizontal, shown)
    place_legend(figure, frames, ordered(legend), look)
    if path is not None:
        save_figure(figure, path)
    # Notebooks show an object that has this; without pyplot nothing else would tell them to.
    setattr(figure, "_repr_png_", partial(png_bytes, figure))  # noqa: B010
    return figure


def draw_response(
    axes: Axes,
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    *,
    x: str | None = None,
    labels: Sequence[str] | None = None,
    view: View | None = None,
    look: style.Look = style.SCREEN,
    by_period: bool | None = None,
) -> dict[str, Line2D]:
    """Draws the curves into existing axes; returns the legend's entries, only of what occurs, without drawing it.

    `by_period`: whether colours tell the periods of the motions (default: where one is not that of the load).
    """
    group, shown = _as_list(curves), view or View()
    horizontal = _common_axis(group, x)
    for dataset in group:
        shown.check(dataset)
    if labels is not None and len(labels) != len(group):
        raise InputError(f"labels: expected one for each of the {len(group)} curves, got {len(labels)}")
    periods = several_periods(group) if by_period is None else by_period
    names = [_plain(name) for name in (labels if labels is not None else _tell_apart(group, periods))]
    several = len(group) > 1
    styles = curve_styles(group, names, periods)
    # sub-harmonic motions over those that they branch off from
    order = sorted(range(len(group)), key=lambda index: period_of(group[index])) if periods else range(len(group))
    earlier: dict[style.CurveStyle, list[np.ndarray]] = {}
    spread = _spread(group, horizontal, shown)
    legend: dict[str, Line2D] = {}
    for index in order:
        name = names[index] if labels is not None or several or periods else ""
        pieces = without_repeats(
            strokes(group[index], horizontal, shown.variable), earlier.setdefault(styles[index], []), spread
        )
        drawn = [Stroke(*bent(piece.x, piece.y, spread), piece.stable) for piece in pieces]
        legend |= _draw_line(axes, drawn, shown.factors(horizontal), styles[index], look, name, periods)
    for index in order:  # markers after all lines: none is crossed out by another curve
        edge = styles[index].colour if several or periods else style.INK
        legend |= _draw_events(axes, group[index], shown, horizontal, edge, look, several)
    dress(axes, *shown.labels(group[0], horizontal, group), look)
    return legend


def _spread(group: Sequence[xarray.Dataset], horizontal: str, view: View) -> tuple[float, float]:
    """Width and height of what is drawn, in the units of the datasets."""
    every = np.concatenate([view.values(dataset, horizontal)[1] for dataset in group])
    across, upwards = (_extent(column) for column in every.T)
    factors = view.factors(horizontal)
    return across / factors[0], upwards / factors[1]


def _extent(column: np.ndarray) -> float:
    known = column[np.isfinite(column)]
    return (float(np.ptp(known)) if known.size else 0.0) or 1.0


def _draw_line(
    axes: Axes,
    pieces: Sequence[Stroke],
    factors: tuple[float, float],
    curve: style.CurveStyle,
    look: style.Look,
    name: str,
    periods: bool,
) -> dict[str, Line2D]:
    from matplotlib.lines import Line2D

    legend: dict[str, Line2D] = {}
    width = look.line * curve.width
    if name:
        legend[name] = Line2D([], [], color=curve.colour, linewidth=1.3 * width)
    for piece in pieces:
        dash: Any = curve.dash if piece.stable is False else style.STABLE_DASH
        axes.plot(
            piece.x * factors[0],
            piece.y * factors[1],
            linestyle=dash,
            color=curve.colour,
            linewidth=width,
            solid_capstyle="butt",
            dash_capstyle="butt",
            solid_joinstyle="round",
            zorder=3,
            gid="stable" if piece.stable else "unstable" if piece.stable is False else "curve",
        )
        if piece.stable is not None:
            key = "stable" if piece.stable else "unstable"
            drawn: Any = style.STABLE_DASH if piece.stable else style.UNSTABLE_DASH
            # where ink is the colour of one period, the dashes are shown in a colour of none
            said = style.SOFT if periods else style.INK
            legend[key] = Line2D([], [], color=said, linewidth=look.line, linestyle=drawn)
    return legend


def _draw_events(
    axes: Axes, dataset: xarray.Dataset, view: View, horizontal: str, edge: str, look: style.Look, several: bool
) -> dict[str, Line2D]:
    """Markers: the shape tells the kind, the filling the criticality; the edge the curve, where there are several."""
    from matplotlib.lines import Line2D

    legend: dict[str, Line2D] = {}
    smaller = style.OF_SUBHARMONICS if several and period_of(dataset) > 1 else 1.0
    positions, seen = view.values(dataset, horizontal)[0], view.marked(dataset, horizontal)
    for kind, mark, which in style.marks(dataset):
        chosen = positions[[i for i in which if seen[i]]]
        if not len(chosen):
            continue
        drawing: dict[str, Any] = {
            "linestyle": "none",
            "marker": mark.marker,
            "markersize": mark.size * look.marker * smaller,
            "markerfacecolor": mark.colour,
            "markeredgecolor": edge,
            "markeredgewidth": look.edge * (1.5 if several else 1.0),
        }
        axes.plot(
            chosen[:, 0],
            chosen[:, 1],
            zorder=(4 if kind == "grazing" else 5) + (0.5 if smaller < 1.0 else 0.0),
            gid=kind,
            clip_on=False,
            **drawing,
        )
        plain = {"markeredgecolor": style.INK, "markeredgewidth": look.edge, "markersize": mark.size * look.marker}
        legend[mark.name] = Line2D([], [], **{**drawing, **plain})
    return legend


def dress(axes: Axes, across: str, upwards: str, look: style.Look) -> None:
    axes.set_xlabel(across, fontsize=look.large, color=style.INK)
    axes.set_ylabel(upwards, fontsize=look.large, color=style.INK)
    axes.tick_params(direction="in", top=True, right=True, labelsize=look.normal, color=style.INK, zorder=2)
    axes.grid(True, color=style.GRID, linewidth=0.4 * look.line, zorder=0)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(style.INK)
        spine.set_linewidth(0.53 * look.line)


def _set_limits(
    frames: Sequence[Axes], groups: Sequence[Sequence[xarray.Dataset]], horizontal: str, view: View
) -> None:
    every = np.concatenate([part for group in groups for data in group for part in view.values(data, horizontal)])
    if view.xlim is not None:
        every = every[(every[:, 0] >= view.xlim[0]) & (every[:, 0] <= view.xlim[1])]
    xs, ys = (column[np.isfinite(column)] for column in every.T)
    if xs.size == 0 or ys.size == 0:
        _clip(frames, view)
        return
    spread = np.ptp(xs) or abs(xs[0]) or 1.0
    frames[0].set_xlim(xs.min() - 0.02 * spread, xs.max() + 0.02 * spread)
    if ys.min() >= 0.0:
        frames[0].set_ylim(0.0, 1.06 * (ys.max() or 1.0))
    else:
        height = np.ptp(ys) or abs(ys[0])
        frames[0].set_ylim(ys.min() - 0.06 * height, ys.max() + 0.06 * height)
    if view.quantity == "phase" and view.scale is None and np.ptp(ys) > 60.0:
        frames[0].yaxis.set_major_locator(_degrees())
    _clip(frames, view)


def _clip(frames: Sequence[Axes], view: View) -> None:
    """The part of the axes that was asked for."""
    if view.xlim is not None:
        frames[0].set_xlim(*view.xlim)
    if view.ylim is not None:
        frames[0].set_ylim(*view.ylim)


def _degrees() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=8, steps=[3, 4.5, 6, 9])


def _plain(text: str) -> str:
    """A name as it is: dollar signs in it do not begin mathematics."""
    return str(text).replace("$", r"\$")


def _as_list(curves: xarray.Dataset | Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
    import xarray

    group: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    if not group:
        raise InputError("no curve to draw")
    for dataset in group:
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(f"expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()")
        check_layout(dataset)
        if "point" not in dataset.sizes:
            raise InputError(
                "this dataset is no curve; one of a motion is drawn by plot_phase, plot_spectrum, plot_history"
            )
        if dataset.sizes["point"] == 0:
            raise InputError("a curve without points cannot be drawn")
    return group


def _common_axis(datasets: Sequence[xarray.Dataset], x: str | None) -> str:
    if x is not None:
        for dataset in datasets:
            coordinate(dataset, x)
        return x
    free = list(dict.fromkeys(str(dataset.attrs["free"]) for dataset in datasets))
    if len(free) > 1:
        raise InputError(f"the curves were followed in different parameters ({', '.join(free)}): choose one with x=")
    return free[0]


def _tell_apart(datasets: Sequence[xarray.Dataset], by_period: bool = False) -> list[str]:
    """Names such as "j = 0" from the parameters that are constant on each curve and differ between curves.

    Where the period is to be told it comes first: "2T", "2T, j = 0"; so does what a curve shows, where that differs.
    """
    constant: list[dict[str, float]] = []
    for dataset in datasets:
        table = dataset["parameters"].to_numpy()
        names = [str(name) for name in dataset["parameter"].to_numpy()]
        omega = dataset["omega"].to_numpy()
        values = {name: float(table[0, i]) for i, name in enumerate(names) if np.ptp(table[:, i]) == 0.0}
        if np.ptp(omega) == 0.0:
            values["ω"] = float(omega[0])
        constant.append(values)
    shared = [name for name in constant[0] if all(name in values for values in constant)]
    differing = [name for name in shared if len({values[name] for values in constant}) > 1]
    dofs = [int(dataset.attrs.get("observed_dof", 0)) for dataset in datasets]
    if not differing and not by_period and len(set(dofs)) < 2:
        return [f"curve {index + 1}" for index in range(len(datasets))]
    told = [[f"{name} = {values[name]:g}" for name in differing] for values in constant]
    if len(set(dofs)) > 1:
        told = [[f"$x_{{{dof}}}$", *words] for dof, words in zip(dofs, told, strict=True)]
    if by_period:
        told = [[period_name(period_of(data)), *words] for data, words in zip(datasets, told, strict=True)]
    return [", ".join(words) for words in told]
