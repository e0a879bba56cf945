"""Response curves at several values of a parameter in space, with the curves of bifurcations that run through them.

Frequency to the right, the parameter into the depth, amplitude upwards; the curves of bifurcations once more, thin, as
their projection on the floor, which is the picture of `boundary`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.boundary import (
    SMALL,
    boundary_names,
    boundary_styles,
    chosen_axes,
    event_entries,
    event_markers,
    event_words,
    is_boundary,
    kind_of,
    plane_of,
    verdict_entries,
)
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Markers, Surface, plain
from suboctave.pictures.isolas import CENTRE, is_isolas, shade, split, surface, with_ends
from suboctave.pictures.options import Coordinates, SpaceOptions, View
from suboctave.pictures.paper import figure_of
from suboctave.pictures.response import datasets_of
from suboctave.pictures.strokes import add_strokes, checked, cut, events_of, line_through, seen_as
from suboctave.pictures.style import Pen, period_colour, period_name, period_of, tinted
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: width of a response curve beside a curve of bifurcations, and of this one
_THIN, _THICK = 0.7, 1.25
#: share of white in the projection on the floor
_SHADE = 0.55
#: opacity of the surface of an isola
_CLEAR = 0.16
#: share of the axes beyond what is drawn
_MARGIN = 0.04


@with_options(SpaceOptions)
def plot_space(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    zlabel: str | None = None,
    elevation: float = 24.0,
    azimuth: float = -58.0,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 5.0),
    **options: Unpack[SpaceOptions],
) -> Figure:
    """Response curves at several values of a parameter, and curves of bifurcations through them, in space.

    Parameters
    ----------
    curves
        Branches, tracked ones among them, or their datasets, isolas, or what has `branches`, as `suboctave.plot` takes
        them. The closed branches of an isola that are known are drawn, and the surface that they lie on.
    path
        Where the figure is saved: .png, .svg or .pdf, fonts embedded.
    x, y
        The axes to the right and into the depth: "omega" or parameters; default those in which bifurcations were
        tracked, or omega and the parameter that differs between the response curves.
    zlabel
        Text of the vertical axis; `xlabel` and `ylabel` are those of the others.
    elevation, azimuth
        From where it is seen, degrees above the floor and around the vertical axis.
    title, size
        As in `suboctave.plot`.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    view = View(**dict[str, Any](options))
    for name, angle in (("elevation", elevation), ("azimuth", azimuth)):
        if isinstance(angle, bool) or not isinstance(angle, int | float) or not np.isfinite(angle):
            raise InputError(f"{name} is an angle in degrees, not {angle!r}")
    drawing = space_drawing(datasets_of(curves, view), x=x, y=y, view=view)
    drawing.title, drawing.seen_from = plain(title or ""), (float(elevation), float(azimuth))
    if zlabel:
        drawing.axes = [*drawing.axes[:2], Axis(zlabel, drawing.axes[2].low, drawing.axes[2].high)]
    sheet = style.sheet_of(size)
    if sheet.named:  # named sizes are widths: in space more height is needed
        width = sheet.inches[0]
        sheet = style.Sheet((width, 0.8 * width if width < 5.0 else 0.62 * width), sheet.look, named=True)
    return figure_of(drawing, sheet, path)


def space_drawing(
    given: Sequence[xarray.Dataset],
    *,
    x: str | None = None,
    y: str | None = None,
    view: View | None = None,
    names: Sequence[str] | None = None,
) -> Drawing:
    """Response curves and curves of bifurcations laid out in space; `names`: of all that is given, for the browser."""
    group, heads = split(given)
    checked(group)
    axes = Coordinates((*space_axes(group, x, y), None), view or View())
    for dataset in group:
        axes.check(dataset)
    limits = axes.limits(group, _MARGIN, _MARGIN, _MARGIN, from_zero=True)
    floor = limits[2][0]
    called = dict(zip(map(id, given), names or (), strict=False))
    frame = Frame([*shade(heads, axes.names[:2], axes.factors, floor)])
    for nu, grid in _surfaces(given, axes):
        words = f"{period_name(nu)} isola"
        seen: dict[str, Any] = {"role": "isola", "layer": 2.0, "name": words, "group": words}
        frame.add(Surface(grid, period_colour(nu), _CLEAR, **seen))
        frame.entries[words] = Entry(patch=period_colour(nu), opacity=2.0 * _CLEAR)
    bounds = [(dataset, with_ends(dataset, heads)) for dataset in group if is_boundary(dataset)]
    responses = [dataset for dataset in group if not is_boundary(dataset)]
    kinds = {(kind_of(dataset), period_of(dataset)) for dataset, _ in bounds}
    dashed = _add_responses(frame, responses, axes, called, kinds)
    _add_boundaries(frame, bounds, axes, called, floor)
    if dashed:
        frame.entries["unstable"] = Entry(Pen(style.SOFT, _THIN, style.UNSTABLE_DASH))
    marks = [item.role for item in frame.items if isinstance(item, Markers)]
    short = {event_words(kind): style.kind_style(kind).name for kind, _ in kinds}
    frame.entries |= {short.get(name, name): entry for name, entry in event_entries(marks).items()}
    labels = axes.labels(group)
    return Drawing([Axis(label, *own) for label, own in zip(labels, limits, strict=True)], [frame])


def _add_responses(
    frame: Frame,
    responses: Sequence[xarray.Dataset],
    axes: Coordinates,
    called: dict[int, str],
    tracked: set[tuple[str, int]],
) -> bool:
    """Response curves from the back to the front, with markers where they meet curves of bifurcations.

    Returns whether parts of them are unstable.
    """
    depths = [float(np.nanmean(axes.of(dataset)[0][1])) for dataset in responses]
    verdicts = set[bool | None]()
    for index in np.argsort(depths, kind="stable")[::-1]:
        dataset = responses[index]
        pen, name = Pen(period_colour(period_of(dataset)), _THIN, style.UNSTABLE_DASH), called.get(id(dataset), "")
        verdicts |= add_strokes(frame, dataset, axes, pen, seen_as("response", name))
    for nu in sorted({period_of(dataset) for dataset in responses}):
        words = "response" if nu == 1 else f"response, {period_name(nu)}"
        frame.entries[words] = Entry(Pen(period_colour(nu), _THIN))
    for dataset in responses:
        met = [(str(kind), period_of(dataset)) in tracked for kind in dataset["event_kind"].to_numpy()]
        for _, look, placed in events_of(dataset, axes, np.array(met, dtype=bool)):
            frame.add(Markers(mark=look.mark(size=1.3 * SMALL), layer=6.0, name=look.name, group=look.name, **placed))
    return False in verdicts


def _add_boundaries(
    frame: Frame,
    bounds: Sequence[tuple[xarray.Dataset, xarray.Dataset]],
    axes: Coordinates,
    called: dict[int, str],
    floor: float,
) -> None:
    """Curves of bifurcations, as given and with the ends of isolas among their events, and their projections."""
    within = set[bool | None]()
    names = [plain(name) for name in boundary_names([dataset for dataset, _ in bounds])]
    pens = boundary_styles([dataset for dataset, _ in bounds], names)
    for (given, dataset), name, pen in zip(bounds, names, pens, strict=True):
        pale, thick = Pen(tinted(pen.colour, _SHADE), 0.7 * pen.width), Pen(pen.colour, _THICK * pen.width, pen.dash)
        curve = called.get(id(given), name)
        add_strokes(frame, dataset, axes, pale, seen_as("floor", curve), floor=floor, layer=1.0)
        within |= add_strokes(frame, dataset, axes, thick, seen_as("boundary", curve), layer=5.0)
        frame.entries[name] = Entry(thick.along(None))
        frame.items += event_markers(dataset, axes, np.ones(dataset.sizes["event"], dtype=bool))
    frame.entries |= verdict_entries(within, _THICK)


def _surfaces(given: Sequence[xarray.Dataset], axes: Coordinates) -> list[tuple[int, np.ndarray]]:
    """Period and grid (3, rows, columns) of the surface of each isola whose closed branches are among the datasets.

    Closed branches belong to the isolas that stand before them.
    """
    loops: dict[tuple[int, int], list[xarray.Dataset]] = {}
    heads = 0
    for dataset in given:
        heads += is_isolas(dataset)
        if "isola" in dataset.attrs and not is_boundary(dataset):
            loops.setdefault((heads - 1, int(dataset.attrs["isola"])), []).append(dataset)
    every, surfaces = split(given)[1], []
    for (which, number), closed in loops.items():
        tips = []
        for dataset in given if which >= 0 else ():
            if is_boundary(dataset):
                kinds = with_ends(dataset, [every[which].isel(isola=[number])])["event_kind"].to_numpy()
                tips += list(axes.of(dataset)[1].T[kinds == CENTRE])
        lines = [cut(dataset, line_through(dataset, *axes.of(dataset))) for dataset in closed]
        around = [np.hstack([stroke.at for stroke in strokes]) for strokes in lines]
        grid = surface(around, tips[:1])
        if grid is not None:
            surfaces.append((period_of(closed[0]), grid))
    return surfaces


def space_axes(group: Sequence[xarray.Dataset], x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """What is drawn to the right and into the depth; InputError where that must be given, or is not there."""
    pairs = {plane_of(dataset) for dataset in group if is_boundary(dataset)}
    if not pairs and (x is None or y is None):
        # parameters that are constant on each curve, or vary, and are not the same on all
        free, every = {str(dataset.attrs["free"]) for dataset in group}, group[0]["parameter"].to_numpy().astype(str)
        values = {n: np.concatenate([coordinate(data, n)[0] for data in group]) for n in every if n not in free}
        names = [name for name, value in values.items() if np.ptp(value) > 0.0]
        if len(free) == 1 and len(names) == 1:
            pairs = {(next(iter(free)), names[0])}
        elif x is None and y is not None:
            pairs = {(str(group[0].attrs["free"]), y)}
        elif len(free) == 1 and y is None:
            raise InputError(
                f"name the parameter into the depth with y=; the curves differ in {', '.join(names) or 'none'}"
            )
    return chosen_axes(group, pairs, x, y, f"is neither of {', '.join(next(iter(pairs), ()))}")
