"""Curves of bifurcations in the plane of their two parameters: which side of a boundary a design lies on.

Solid where the boundary is one of stable motions (all multipliers but the critical one inside the unit circle), dashed
where motions on both sides are unstable; extrema and points of codimension two marked and named. Drawn from datasets,
like response curves; what lines look like is told in `boundary_lines`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures import style
from suboctave.pictures.annotations import annotate
from suboctave.pictures.boundary_lines import (
    Part,
    boundary_names,
    boundary_styles,
    is_boundary,
    kind_of,
    parts,
    plane_of,
    stations,
)
from suboctave.pictures.boundary_marks import event_drawing, event_words, mark_events, small_mark
from suboctave.pictures.legend import place_legend
from suboctave.pictures.periods import tinted
from suboctave.pictures.regions import CENTRE, MERGING, end_text, regions, split, with_ends
from suboctave.pictures.response import dress
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.strokes import bent, strokes, without_repeats
from suboctave.pictures.view import View
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["PALE", "Plane", "check_boundaries", "plane_axes", "plot_boundaries"]

#: what the strokes mean here
BORDER, WITHIN = "borders stable motions", "within unstable motions"
SUBCRITICAL = "subcritical"
_UPWARDS = "_upwards"
#: millimetres between the small marks along a line
_SPACING = 11.0
#: share of white in the region of an isola
PALE = 0.82
#: so many extrema are named by their values
_NAMED = 4


@dataclass(frozen=True)
class Plane:
    """The two axes of a frame: parameters, or upwards a quantity of the motions, with their units.

    `upwards` is omega, a parameter, or None for the quantity of the view.
    """

    across: str
    upwards: str | None
    view: View = field(default_factory=View)

    def prepared(self, dataset: xarray.Dataset) -> xarray.Dataset:
        """The dataset with what is drawn upwards as a variable of its own."""
        if self.upwards is None:
            self.view.check(dataset)
            values, at_events = (
                dataset[self.view.variable].to_numpy(),
                dataset[f"event_{self.view.variable}"].to_numpy(),
            )
        else:
            values, at_events = coordinate(dataset, self.upwards)
        return dataset.assign({_UPWARDS: ("point", values), f"event_{_UPWARDS}": ("event", at_events)})

    def factors(self) -> tuple[float, float]:
        """What values to the right and upwards are multiplied by; `scale` is that of what is no frequency."""
        if self.upwards is None:
            return self.view.factors(self.across)
        frequency, scale = self.view.factors("omega")[0], float(self.view.scale or 1.0)
        first = frequency if self.across == "omega" else scale if self.upwards == "omega" else 1.0
        return first, frequency if self.upwards == "omega" else scale

    def marked(self, dataset: xarray.Dataset) -> np.ndarray:
        """Which of the events of a prepared dataset get a marker, (events,), bool."""
        kinds, marks = dataset["event_kind"].to_numpy(), self.view.marks
        chosen = np.array([marks is None or str(kind) in marks for kind in kinds], dtype=bool)
        for column, limits in zip(places(dataset, self).T, (self.view.xlim, self.view.ylim), strict=True):
            if limits is not None:
                chosen &= (column >= limits[0]) & (column <= limits[1])
        return chosen

    def labels(self, dataset: xarray.Dataset) -> tuple[str, str]:
        """What the two axes say."""
        view = self.view
        if self.upwards is None:
            return view.labels(dataset, self.across)
        frequency = View(frequency=view.frequency, omega_reference=view.omega_reference).labels(dataset, "omega")[0]
        unit = f" ({view.unit})" if view.unit else ""
        first = frequency if self.across == "omega" else self.across + (unit if self.upwards == "omega" else "")
        second = frequency if self.upwards == "omega" else self.upwards + unit
        return view.xlabel or first, view.ylabel or second


def plot_boundaries(
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
    view: View | None = None,
    projected: bool = False,
) -> Figure:
    """One or several curves of bifurcations over the plane of two parameters, saved to `path` where one is given.

    Parameters
    ----------
    curves
        Their datasets; with that of isolas among them the regions of these are shaded in the plane of their
        parameters, and their ends are marked.
    x, y
        The axes, "omega" or parameters; default: the two that were free.
    labels
        Names of the curves; default: kinds and periods, and the parameters in which curves of one kind differ.
    view
        Units: `scale` and `unit` are those of the axis that is no frequency.
    projected
        The quantity of the view is drawn upwards, over `x` (default: the first of the two).

    Others as `suboctave.plot`. Raises InputError for what cannot be drawn.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    several: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    given, heads = split(several)
    group = [with_ends(dataset, heads) for dataset in check_boundaries(given)]
    if projected and y is not None:
        raise InputError("y= names a parameter; with a quantity= that is what is drawn upwards")
    horizontal, upwards = _first(group, x) if projected else plane_axes(group, x, y)
    plane = Plane(horizontal, None if projected else upwards, view or View())
    if labels is not None and len(labels) != len(group):
        raise InputError(f"labels: expected one for each of the {len(group)} curves, got {len(labels)}")
    prepared = [plane.prepared(dataset) for dataset in group]
    inches = style.size_in_inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    dress(axes, *plane.labels(group[0]), look)
    if title:
        axes.set_title(title.replace("$", r"\$"), fontsize=look.large, color=style.INK)
    _limit(axes, prepared, plane)
    if plane.view.xlim is not None:
        axes.set_xlim(*plane.view.xlim)
    if plane.view.ylim is not None:
        axes.set_ylim(*plane.view.ylim)
    names = [name.replace("$", r"\$") for name in (labels if labels is not None else boundary_names(group))]
    styles = boundary_styles(group, names)
    cut = [parts(dataset, plane.across, _UPWARDS) for dataset in prepared]
    _lines(axes, prepared, styles, plane, look)
    legend = _shade(axes, heads, plane) | _entries(prepared, cut, names, styles, plane, look)
    for dataset in prepared:
        mark_events(axes, dataset, places(dataset, plane).T, look, plane.marked(dataset))
    # a named size is a width: what stands above the frame adds height
    place_legend(figure, [axes], legend, look, grow=isinstance(size, str))
    figure.draw_without_rendering()  # the frame has its place: marks along lines are spaced on paper
    for dataset, pieces, curve in zip(prepared, cut, styles, strict=True):
        _along(figure, axes, dataset, pieces, curve, plane, look)
    _name_events(figure, axes, prepared, plane, look)
    if path is not None:
        save_figure(figure, path)
    setattr(figure, "_repr_png_", partial(png_bytes, figure))  # noqa: B010
    return figure


def check_boundaries(curves: Any) -> list[xarray.Dataset]:
    """The datasets of curves of bifurcations, at least one; InputError for anything else."""
    group: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    if not group:
        raise InputError("no curve to draw")
    for dataset in group:
        check_layout(dataset)
        if not is_boundary(dataset):
            raise InputError("this is no curve of bifurcations; plot draws responses, plot_space both together")
        if dataset.sizes.get("point", 0) == 0:
            raise InputError("a curve without points cannot be drawn")
    return group


def plane_axes(group: Sequence[xarray.Dataset], x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """The parameters to the right and upwards; default the two that were free, which must be the same of all."""
    pairs = {plane_of(dataset) for dataset in group}
    for name in (x, y):
        if name is not None:
            for dataset in group:
                coordinate(dataset, name)
    if x is not None and x == y:
        raise InputError(f"x and y are the same parameter {x!r}")
    if x is not None and y is not None:
        return x, y
    if len(pairs) != 1:
        raise InputError("the curves were followed in different parameters: choose axes with x= and y=")
    first, second = next(iter(pairs))
    given = x if x is not None else y
    if given is None:
        return first, second
    if given not in (first, second):
        raise InputError(f"{given!r} was not free on these curves{suggest(given, (first, second))}: give x= and y=")
    other = second if given == first else first
    return (given, other) if x is not None else (other, given)


def _first(group: Sequence[xarray.Dataset], x: str | None) -> tuple[str, None]:
    if x is not None:
        for dataset in group:
            coordinate(dataset, x)
        return x, None
    return plane_axes(group)[0], None


def places(prepared: xarray.Dataset, plane: Plane) -> np.ndarray:
    """Positions (events, 2) of the events in the frame."""
    at = coordinate(prepared, plane.across)[1]
    found: np.ndarray = np.column_stack([at, prepared[f"event_{_UPWARDS}"].to_numpy()]) * np.array(plane.factors())
    return found


def _limit(axes: Axes, prepared: Sequence[xarray.Dataset], plane: Plane) -> None:
    every = np.concatenate(
        [np.column_stack([coordinate(data, plane.across)[0], data[_UPWARDS].to_numpy()]) for data in prepared]
    ) * np.array(plane.factors())
    every = np.concatenate([every, *(places(data, plane) for data in prepared)])
    setters: tuple[Any, Any] = (axes.set_xlim, axes.set_ylim)
    for limits, column in zip(setters, every.T, strict=True):
        known = column[np.isfinite(column)]
        margin = 0.06 * (float(np.ptp(known)) or abs(float(known[0])) or 1.0)
        limits(float(known.min()) - margin, float(known.max()) + margin)


def _lines(
    axes: Axes,
    prepared: Sequence[xarray.Dataset],
    styles: Sequence[style.CurveStyle],
    plane: Plane,
    look: style.Look,
) -> None:
    factors = plane.factors()
    spread = tuple(abs(b - a) / f for (a, b), f in zip((axes.get_xlim(), axes.get_ylim()), factors, strict=True))
    earlier: dict[style.CurveStyle, list[np.ndarray]] = {}
    for dataset, curve in zip(prepared, styles, strict=True):
        pieces = strokes(dataset, plane.across, _UPWARDS)
        for stroke in without_repeats(pieces, earlier.setdefault(curve, []), (spread[0], spread[1])):
            x, y = bent(stroke.x, stroke.y, (spread[0], spread[1]))
            axes.plot(
                x * factors[0],
                y * factors[1],
                color=curve.colour,
                linewidth=look.line * curve.width,
                linestyle=_dash(stroke.stable, curve),
                solid_capstyle="butt",
                dash_capstyle="butt",
                solid_joinstyle="round",
                zorder=3,
                gid="curve" if stroke.stable is None else "border" if stroke.stable else "within",
            )


def _shade(axes: Axes, heads: Sequence[xarray.Dataset], plane: Plane) -> dict[str, Any]:
    """The regions of isolas, where the axes are those of their plane; their entries in the legend."""
    from matplotlib.patches import Patch

    entries: dict[str, Any] = {}
    for region in regions(heads):
        names = ["omega", region.parameter]
        if sorted(names) != sorted((plane.across, plane.upwards or "")):
            continue
        parts = dict(zip(names, region.outline, strict=True))
        (across, up), colour = plane.factors(), tinted(region.colour, PALE)
        x, y = parts[plane.across] * across, parts[str(plane.upwards)] * up
        axes.fill(x, y, facecolor=colour, linewidth=0.0, zorder=1.5, gid="isola")
        entries[region.words] = Patch(facecolor=colour, linewidth=0.0)
    return entries


def _entries(
    prepared: Sequence[xarray.Dataset],
    cut: Sequence[Sequence[Part]],
    names: Sequence[str],
    styles: Sequence[style.CurveStyle],
    plane: Plane,
    look: style.Look,
) -> dict[str, Line2D]:
    """The legend: curves, strokes and hollow marks where there are two of them, events."""
    from matplotlib.lines import Line2D

    entries: dict[str, Line2D] = {}
    for dataset, name, curve in zip(prepared, names, styles, strict=True):
        small = small_mark(kind_of(dataset), curve, look, hollow=False)
        entries[name] = Line2D([], [], color=curve.colour, linewidth=look.line * curve.width, **small)
    every = [part for pieces in cut for part in pieces]
    if any(part.stable is False for part in every):
        for stable, words in ((True, BORDER), (False, WITHIN)):
            if any(part.stable is stable for part in every):
                dash = _dash(stable, style.ONE_CURVE)
                entries[words] = Line2D([], [], color=style.SOFT, linewidth=look.line, linestyle=dash)
    if any(part.subcritical for part in every):
        hollow = small_mark("PD", style.ONE_CURVE, look, hollow=True)
        entries[SUBCRITICAL] = Line2D([], [], linestyle="none", **hollow)
    kinds = {
        kind for dataset in prepared for kind, _, which in style.marks(dataset) if plane.marked(dataset)[which].any()
    }
    order = list(style.KINDS)
    for kind in sorted(kinds, key=lambda k: (order.index(k) if k in order else len(order), k)):
        entries[event_words(kind)] = Line2D([], [], **event_drawing(style.kind_style(kind), look))
    return entries


def _dash(stable: bool | None, curve: style.CurveStyle) -> Any:
    return curve.dash if stable is False else style.STABLE_DASH


def _along(
    figure: Figure,
    axes: Axes,
    dataset: xarray.Dataset,
    pieces: Sequence[Part],
    curve: style.CurveStyle,
    plane: Plane,
    look: style.Look,
) -> None:
    """The small marks along one curve, none beneath the marker of an event."""
    spacing = _SPACING / 25.4 * figure.dpi
    events = axes.transData.transform(places(dataset, plane)) if dataset.sizes["event"] else np.empty((0, 2))
    clear = style.MARKER_SIZE * look.marker * figure.dpi / 72.0
    for part in pieces:
        on_paper = axes.transData.transform(np.column_stack([part.x, part.y]) * np.array(plane.factors()))
        spots = stations(on_paper[:, 0], on_paper[:, 1], spacing)
        found = [p for p in spots if axes.bbox.contains(*p)]
        keep = [p for p in found if not len(events) or np.hypot(*(events - p).T).min() > clear]
        if not keep:
            continue
        x, y = axes.transData.inverted().transform(np.array(keep)).T
        drawing = small_mark(kind_of(dataset), curve, look, hollow=part.subcritical)
        axes.plot(x, y, linestyle="none", zorder=3.5, gid="along-hollow" if part.subcritical else "along", **drawing)


def _name_events(
    figure: Figure, axes: Axes, prepared: Sequence[xarray.Dataset], plane: Plane, look: style.Look
) -> None:
    """Codimension-two points by their short names; extrema of what is drawn upwards and isolas' ends by values."""
    spots, texts = [], []
    ends: list[tuple[np.ndarray, str]] = []
    extrema = []
    for dataset in prepared:
        at = places(dataset, plane)
        told = dataset["event_extreme"].to_numpy() if "event_extreme" in dataset else [""] * len(at)
        kinds, marked = dataset["event_kind"].to_numpy(), plane.marked(dataset)
        for place, kind, extreme, wanted in zip(at, kinds, told, marked, strict=True):
            if not wanted:
                continue
            if kind in (CENTRE, MERGING):
                value = place[0] if plane.upwards == "omega" else None if plane.upwards is None else place[1]
                ends.append((place, end_text(str(kind), value)))
            elif str(kind) != "extremum":
                spots.append(place)
                texts.append(str(kind))
            elif plane.upwards is not None and str(extreme).endswith(f" of {plane.upwards}"):
                extrema.append((place, f"{place[1]:#.4g}"))
    if len(extrema) <= _NAMED:
        spots = [place for place, _ in extrema] + spots
        texts = [text for _, text in extrema] + texts
    spots = [place for place, _ in ends] + spots
    texts = [text for _, text in ends] + texts
    inside = [i for i, place in enumerate(spots) if math.isfinite(place[0]) and math.isfinite(place[1])]
    annotate(figure, axes, np.array([spots[i] for i in inside]), [texts[i] for i in inside], look)
