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
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.strokes import Stroke, strokes
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

__all__ = ["draw_response", "plot_panels", "plot_response"]


def plot_response(
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[float, float] = (6.4, 4.2),
) -> Figure:
    """One or several response curves in one frame, saved to `path` where one is given (.png, .svg, .pdf).

    `x` names the horizontal axis: "omega" or a parameter (default: what the curves were followed in). `labels` tell
    several curves apart (default: the parameters in which they differ). `size` in inches.
    """
    group = _as_list(curves)
    return plot_panels(
        [group], path, x=x, labels=None if labels is None else [labels], titles=[title] if title else None, size=size
    )


def plot_panels(
    panels: Sequence[xarray.Dataset | Sequence[xarray.Dataset]],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[Sequence[str]] | None = None,
    titles: Sequence[str] | None = None,
    size: tuple[float, float] | None = None,
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

    width = 1.2 + 5.2 * len(groups) if len(groups) == 1 else 1.0 + 4.2 * len(groups)
    figure = Figure(figsize=size or (width, 4.2), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    frames = figure.subplots(1, len(groups), squeeze=False, sharex=True, sharey=True)[0]
    legend: dict[str, Line2D] = {}
    for index, (axes, group) in enumerate(zip(frames, groups, strict=True)):
        legend |= draw_response(axes, group, x=horizontal, labels=None if labels is None else labels[index])
        if titles is not None:
            axes.set_title(titles[index], fontsize=style.LARGE, color=style.INK)
        if index:
            axes.set_ylabel("")
    _set_limits(frames, groups, horizontal)
    _place_legend(figure, frames, _ordered(legend))
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
) -> dict[str, Line2D]:
    """Draws the curves into existing axes; returns the legend's entries, only of what occurs, without drawing it."""
    group = _as_list(curves)
    horizontal = _common_axis(group, x)
    if labels is not None and len(labels) != len(group):
        raise InputError(f"labels: expected one for each of the {len(group)} curves, got {len(labels)}")
    names = list(labels) if labels is not None else _tell_apart(group)
    legend: dict[str, Line2D] = {}
    for index, dataset in enumerate(group):
        colour = style.CURVE_COLOURS[index % len(style.CURVE_COLOURS)] if len(group) > 1 else style.INK
        name = names[index] if labels is not None or len(group) > 1 else ""
        legend |= _draw_line(axes, strokes(dataset, horizontal), colour, name)
    for dataset in group:  # markers after all lines: none is crossed out by another curve
        legend |= _draw_events(axes, dataset, horizontal)
    _dress(axes, group[0], horizontal)
    return legend


def _draw_line(axes: Axes, pieces: Sequence[Stroke], colour: str, name: str) -> dict[str, Line2D]:
    from matplotlib.lines import Line2D

    legend: dict[str, Line2D] = {}
    if name:
        legend[name] = Line2D([], [], color=colour, linewidth=style.LINE_WIDTH * 1.6)
    for piece in pieces:
        dash: Any = style.UNSTABLE_DASH if piece.stable is False else style.STABLE_DASH
        axes.plot(
            piece.x,
            piece.y,
            linestyle=dash,
            color=colour,
            linewidth=style.LINE_WIDTH,
            solid_capstyle="butt",
            dash_capstyle="butt",
            solid_joinstyle="round",
            zorder=3,
            gid="stable" if piece.stable else "unstable" if piece.stable is False else "curve",
        )
        if piece.stable is not None:
            key = "stable" if piece.stable else "unstable"
            legend[key] = Line2D([], [], color=style.INK, linewidth=style.LINE_WIDTH, linestyle=dash)
    return legend


def _draw_events(axes: Axes, dataset: xarray.Dataset, horizontal: str) -> dict[str, Line2D]:
    from matplotlib.lines import Line2D

    legend: dict[str, Line2D] = {}
    positions = coordinate(dataset, horizontal)[1]
    amplitudes = dataset["event_amplitude"].to_numpy()
    kinds = np.array([str(kind) for kind in dataset["event_kind"].to_numpy()])
    for kind in dict.fromkeys(kinds):
        look = style.kind_style(kind)
        drawing: dict[str, Any] = {
            "linestyle": "none",
            "marker": look.marker,
            "markersize": look.size,
            "markerfacecolor": look.colour,
            "markeredgecolor": style.INK,
            "markeredgewidth": 1.0,
        }
        chosen = kinds == kind
        axes.plot(
            positions[chosen],
            amplitudes[chosen],
            zorder=4 if kind == "grazing" else 5,
            gid=kind,
            clip_on=False,
            **drawing,
        )
        legend[look.name] = Line2D([], [], **drawing)
    return legend


def _dress(axes: Axes, dataset: xarray.Dataset, horizontal: str) -> None:
    if horizontal == "omega":
        axes.set_xlabel(r"forcing frequency $\omega$", fontsize=style.LARGE, color=style.INK)
    else:
        axes.set_xlabel(horizontal, fontsize=style.LARGE, color=style.INK)
    one = int(dataset.attrs.get("dofs", 1)) == 1
    observed = "x" if one else f"x_{{{dataset.attrs.get('observed_dof', 0)}}}"
    axes.set_ylabel(rf"amplitude $\max\,|{observed}|$", fontsize=style.LARGE, color=style.INK)
    axes.tick_params(direction="in", top=True, right=True, labelsize=style.NORMAL, color=style.INK, zorder=2)
    axes.grid(True, color=style.GRID, linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(style.INK)
        spine.set_linewidth(0.8)


def _set_limits(frames: Sequence[Axes], groups: Sequence[Sequence[xarray.Dataset]], horizontal: str) -> None:
    datasets = [dataset for group in groups for dataset in group]
    xs = np.concatenate([np.concatenate(coordinate(dataset, horizontal)) for dataset in datasets])
    ys = np.concatenate([dataset[name].to_numpy() for dataset in datasets for name in ("amplitude", "event_amplitude")])
    xs, ys = xs[np.isfinite(xs)], ys[np.isfinite(ys)]
    if xs.size == 0 or ys.size == 0:
        return
    spread = np.ptp(xs) or abs(xs[0]) or 1.0
    frames[0].set_xlim(xs.min() - 0.02 * spread, xs.max() + 0.02 * spread)
    frames[0].set_ylim(0.0, 1.06 * (ys.max() or 1.0))


def _place_legend(figure: Figure, frames: Sequence[Axes], entries: dict[str, Line2D]) -> None:
    """One legend: inside the frame that has room for it, else above all frames. It never covers a curve."""
    if not entries:
        return
    drawing: dict[str, Any] = {
        "fontsize": style.SMALL,
        "frameon": True,
        "framealpha": 1.0,
        "edgecolor": style.GRID,
        "handlelength": 2.6,
    }
    for axes in frames:
        for location in ("upper left", "upper right", "center left", "center right"):
            legend = axes.legend(entries.values(), entries.keys(), loc=location, **drawing)
            legend.set_zorder(6)
            if not _covers(figure, axes, legend):
                return
            legend.remove()
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=min(len(entries), 4), **drawing)


def _covers(figure: Figure, axes: Axes, legend: Legend) -> bool:
    figure.draw_without_rendering()
    box = legend.get_window_extent().padded(figure.dpi / 72.0 * style.MARKER_SIZE)
    for line in axes.get_lines():
        x, y = axes.transData.transform(np.column_stack([line.get_xdata(), line.get_ydata()])).T
        if x.size == 0:
            continue
        # Points every pixel or so along the line: a long piece may cross a box that holds none of its ends.
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        if line.get_linestyle() != "None" and length[-1] > 0.0:
            dense = np.linspace(0.0, length[-1], int(length[-1]) + 2)
            x, y = np.interp(dense, length, x), np.interp(dense, length, y)
        if np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)):
            return True
    return False


def _ordered(entries: dict[str, Line2D]) -> dict[str, Line2D]:
    """Curves first, then stable and unstable, then the kinds in the order of the style table, then a user's own."""
    lines, kinds = ["stable", "unstable"], [look.name for look in style.KINDS.values()]

    def rank(name: str) -> tuple[int, int]:
        if name in lines:
            return 1, lines.index(name)
        if name in kinds:
            return 2, kinds.index(name)
        return (0, 0) if entries[name].get_marker() == "None" else (3, 0)

    return {name: entries[name] for name in sorted(entries, key=rank)}


def _as_list(curves: xarray.Dataset | Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
    import xarray

    group: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    if not group:
        raise InputError("no curve to draw")
    for dataset in group:
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(f"expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()")
        check_layout(dataset)
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


def _tell_apart(datasets: Sequence[xarray.Dataset]) -> list[str]:
    """Names such as "j = 0" from the parameters that are constant on each curve and differ between curves."""
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
    if not differing:
        return [f"curve {index + 1}" for index in range(len(datasets))]
    return [", ".join(f"{name} = {values[name]:g}" for name in differing) for values in constant]
