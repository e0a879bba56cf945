"""Response curves of one or several parameter values in one frame, and panels of such frames side by side.

Stable motions solid, unstable ones dashed, located bifurcations marked. Figures are laid out from datasets
(`suboctave.store.layout`), so a curve looks the same live and from a file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.boundary import boundary_names, boundary_styles, plot_boundaries
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Markers, Ticks, plain, spread
from suboctave.pictures.given import datasets_of, drawn_datasets, is_boundary, is_isolas, named_within, several_of
from suboctave.pictures.options import Coordinates, CurveOptions, FrameOptions, View, symbol_of_dof
from suboctave.pictures.paper import draw, dress, finished, handles
from suboctave.pictures.strokes import (
    OPEN,
    Verdict,
    add_strokes,
    check_count,
    checked,
    differing,
    events_of,
    fixed_parameters,
    named_axis,
)
from suboctave.pictures.style import Pen, curve_styles, period_name, period_of, several_periods

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


#: shares of the axes beyond what is drawn
_MARGINS = (0.02, 0.06)


@with_options(FrameOptions)
def plot_response(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[str] | None = None,
    view: View | None = None,
    **options: Unpack[FrameOptions],
) -> Figure:
    """One or several response curves in one frame, saved to `path` where one is given (.png, .svg, .pdf).

    `x` names the horizontal axis: "omega" or a parameter (default: what the curves were followed in). `labels` tell
    several curves apart (default: the parameters in which they differ). `view`: the quantity drawn and the units
    (default: amplitude, as it is).
    """
    drawing = response_drawing(
        [checked(drawn_datasets(curves, view))], x=x, labels=None if labels is None else [labels], view=view
    )
    drawing.frames[0].title = plain(options.get("title") or "")
    return finished(drawing, style.sheet_of(options.get("size") or (6.4, 4.2)), path, options)


@with_options(FrameOptions)
def plot_panels(
    panels: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    labels: Sequence[Sequence[str]] | None = None,
    titles: Sequence[str] | None = None,
    view: View | None = None,
    **options: Unpack[FrameOptions],
) -> Figure:
    """Several frames side by side on the same axes, with one legend for all of them.

    Each entry of `panels` is one curve, or a list of those of one frame; `labels` and `titles` have one entry for each
    panel. Saved to `path` where one is given.
    """
    groups = [checked(drawn_datasets(panel, view)) for panel in panels]
    for name, given in (("labels", labels), ("titles", titles)):
        check_count(name, given, len(groups), "panels")
    wide = 6.4 if len(groups) == 1 else 1.0 + 4.2 * len(groups)
    sheet = style.sheet_of(options.get("size") or (wide, 4.2), len(groups))
    drawing = response_drawing(groups, x=x, labels=labels, view=view)
    drawing.title = plain(options.get("title") or "")
    for frame, title in zip(drawing.frames, titles or (), strict=False):
        frame.title = plain(title)
    return finished(drawing, sheet, path, options)


def response_drawing(
    groups: Sequence[Sequence[xarray.Dataset]],
    *,
    x: str | None = None,
    labels: Sequence[Sequence[str]] | None = None,
    view: View | None = None,
    names: Sequence[str] | None = None,
) -> Drawing:
    """Response curves laid out: a frame for each group; `names` in the browser, if not their labels."""
    every = [dataset for group in groups for dataset in group]
    axes = Coordinates((_common_axis(every, x), None), view or View())
    by_period = several_periods(every)
    frames = [
        response_frame(group, axes, None if labels is None else labels[index], by_period, names)
        for index, group in enumerate(groups)
    ]
    across, upwards = axes.labels(every)
    (x0, x1), (y0, y1) = axes.limits(every, *_MARGINS, from_zero=True)
    ticks = Ticks(8, (3, 4.5, 6, 9)) if axes.view.in_degrees and y1 - y0 > 67.0 else None  # degrees
    both = Axis(across, x0, x1, shows=axes.shown[0]), Axis(upwards, y0, y1, ticks=ticks, shows=axes.shown[1])
    return Drawing(both, frames, columns=len(groups), by_kind=True)


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
    group = _as_list(curves)
    coordinates = Coordinates((_common_axis(group, x), None), view or View())
    frame = response_frame(group, coordinates, labels, by_period)
    draw(axes, frame, look)
    across, upwards = coordinates.labels(group)
    dress(axes, (across, upwards), look)
    return handles(frame.entries, look)


def response_frame(
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    axes: Coordinates,
    labels: Sequence[str] | None = None,
    by_period: bool | None = None,
    called: Sequence[str] | None = None,
) -> Frame:
    """The curves of one frame laid out, in the legend only of what occurs.

    `called`: what they are called in the browser, if not by their labels.
    """
    group = _as_list(curves)
    for dataset in group:
        axes.check(dataset)
    check_count("labels", labels, len(group), "curves")
    periods = several_periods(group) if by_period is None else by_period
    names, pens = _names_and_pens(group, labels, periods)
    several = len(group) > 1
    titles = names if called is None else [plain(name) for name in called]
    # sub-harmonic motions over those that they branch off from
    order = sorted(range(len(group)), key=lambda index: period_of(group[index])) if periods else range(len(group))
    around = spread(np.concatenate([axes.of(dataset)[0] for dataset in group], axis=1))
    earlier: dict[Pen, list[np.ndarray]] = {}
    frame = Frame()
    for index in order:
        dataset, pen = group[index], pens[index]
        if labels is not None or several or periods or "called" in dataset.attrs:
            frame.entries[names[index]] = Entry(Pen(pen.colour, 1.3 * pen.width))
        curve = titles[index] if several else ""
        words = {**_ROLES, None: "motions"}
        seen = {s: (_ROLES[s], f"{curve}: {words[s]}" if curve else words[s], curve or words[s]) for s in _ROLES}
        for stable in add_strokes(frame, dataset, axes, pen, seen, earlier=earlier, spread=around) - {None}:
            # where ink is the colour of one period, the dashes are shown in a colour of none
            plain_pen = Pen(style.SOFT if periods else style.INK, 1.0, style.UNSTABLE_DASH)
            own = plain_pen.dotted if stable == OPEN else plain_pen.along(stable)
            frame.entries[_ROLES[stable]] = Entry(own)
    for index in order:  # markers after all lines: none is crossed out by another curve
        dataset, curve = group[index], titles[index] if several else ""
        # the shape tells the kind, the filling the criticality, the edge the curve, where there are several
        edge = pens[index].colour if several or periods else style.INK
        smaller = style.OF_SUBHARMONICS if curve and period_of(dataset) > 1 else 1.0
        for kind, look, placed in events_of(dataset, axes, axes.marked(dataset)):
            layer = (4.0 if kind == "grazing" else 5.0) + (0.5 if smaller < 1.0 else 0.0)
            name = f"{curve}: {look.name}" if curve else look.name
            mark = look.mark(edge, smaller, 1.5 if curve else 1.0)
            frame.add(Markers(mark=mark, layer=layer, name=name, group=curve or look.name, **placed))
            frame.entries[look.name] = Entry(mark=look.mark())
    return frame


_ROLES: dict[Verdict, str] = {None: "curve", True: "stable", False: "unstable", OPEN: "stability open"}


def _as_list(curves: xarray.Dataset | Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
    return checked(list(curves) if isinstance(curves, list | tuple) else [curves])


def _common_axis(datasets: Sequence[xarray.Dataset], x: str | None) -> str:
    if named_axis(datasets, x) is not None:
        return str(x)
    free = list(dict.fromkeys(str(dataset.attrs["free"]) for dataset in datasets))
    if len(free) > 1:
        raise InputError(f"the curves were followed in different parameters ({', '.join(free)}): choose one with x=")
    return free[0]


def _names_and_pens(
    group: Sequence[xarray.Dataset], labels: Sequence[str] | None, by_period: bool
) -> tuple[list[str], list[Pen]]:
    """Of response curves what tells them apart, and pens by period or in turn; of tracked curves their kinds'."""
    bounds, others = ([data for data in group if is_boundary(data) is kind] for kind in (True, False))
    names = [plain(label) for label in labels or ()]
    if labels is None:
        alone = ["response"] if bounds and len(others) == 1 else _tell_apart(others, by_period)
        own = {True: iter(boundary_names(bounds)), False: iter(alone)}
        names = [next(own[is_boundary(data)]) for data in group]
    known = {
        kind: [name for name, data in zip(names, group, strict=True) if is_boundary(data) is kind]
        for kind in (True, False)
    }
    pens = {
        True: iter(boundary_styles(bounds, known[True])),
        False: iter(curve_styles(others, known[False], by_period)),
    }
    return names, [next(pens[is_boundary(data)]) for data in group]


def _tell_apart(datasets: Sequence[xarray.Dataset], by_period: bool = False) -> list[str]:
    """Names such as "j = 0" from the parameters that are constant on each curve and differ between curves.

    Where periods are shown they come first: "2T", "2T, j = 0"; so does what a curve shows, where that differs. Names
    that the user gave stand for all of this, but among curves of one name.
    """
    if any("called" in dataset.attrs for dataset in datasets):
        return named_within(datasets, lambda group: _tell_apart(group, by_period))
    words = differing([fixed_parameters(dataset) for dataset in datasets])
    shown = [str(dataset.attrs.get("shows", "response")) for dataset in datasets]
    if len(set(shown)) > 1:
        words = [[what, *own] for what, own in zip(shown, words, strict=True)]
    dofs = [int(dataset.attrs.get("observed_dof", 0)) for dataset in datasets]
    if not any(words) and not by_period and len(set(dofs)) < 2:
        return [f"curve {index + 1}" for index in range(len(datasets))]
    if len(set(dofs)) > 1:
        words = [[f"${symbol_of_dof(data, dof)}$", *own] for data, dof, own in zip(datasets, dofs, words, strict=True)]
    if by_period:
        words = [[period_name(period_of(data)), *own] for data, own in zip(datasets, words, strict=True)]
    return [", ".join(own) for own in words]


# ------------------------------------------------------------------------- one call for all curves, live or from a file
@with_options(CurveOptions)
def plot(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    **options: Unpack[CurveOptions],
) -> Figure:
    """Draw one or several branches: stable parts solid, unstable ones dashed, bifurcations marked.

    Motions of period T, 2T, 4T, ... (T that of the load) have a colour for each; amplitudes are largest values over
    one period of the response. Markers of subcritical bifurcations are hollow, where that is known.

    Parameters
    ----------
    curves
        A branch, a dataset of one (`to_xarray`, or a file opened by xarray), a bifurcation diagram (all its branches),
        isolas (their curves and regions, over frequency and parameter), the results of a study, a sequence of these, or
        a dictionary of them by what the legend calls them.
    path
        Where the figure is saved: .png, .svg or .pdf, fonts embedded.
    x
        The horizontal axis: "omega" or a parameter; default what the curves were followed in.
    y
        Of curves of bifurcations (`track`), which are drawn over the plane of their two parameters: the vertical axis.
        A `quantity` that is given takes its place.
    labels
        Names of the curves in the legend.
    """
    given = several_of(curves)
    if isinstance(curves, dict) and labels is not None:
        raise InputError("the names of the dictionary are the labels: leave labels= out")
    if len(given) == 1:  # a diagram says how it is drawn
        labels = getattr(given[0], "legend", None) if labels is None else labels
        if options.get("marks") is None:
            options["marks"] = getattr(given[0], "marks", None)
    view = View.of(options).placed(given)
    datasets = datasets_of(curves, view)
    if any(is_isolas(dataset) for dataset in datasets):  # in the plane, without the closed branches
        datasets = [dataset for dataset in datasets if "isola" not in dataset.attrs]
    tracked = [is_boundary(dataset) or is_isolas(dataset) for dataset in datasets]
    frame: dict[str, Any] = {name: own for name, own in options.items() if name in FrameOptions.__optional_keys__}
    texts: dict[str, Any] = {"labels": labels, "view": view, **frame}
    if tracked and all(tracked):
        projected = options.get("quantity") is not None or options.get("harmonic") is not None
        return plot_boundaries(datasets, path, x=x, y=y, projected=projected, **texts)
    if y is not None:
        raise InputError("y= is for curves of bifurcations; of other curves quantity= says what is drawn upwards")
    if any(tracked) and x is None:
        raise InputError(
            "there are curves of bifurcations among response curves: plot_space draws them together, x= one over the "
            "other; or draw each kind by itself"
        )
    return plot_response([data for data in datasets if not is_isolas(data)], path, x=x, **texts)
