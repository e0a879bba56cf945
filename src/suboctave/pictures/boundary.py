"""Curves of bifurcations in the plane of their two parameters: which side of a boundary a design lies on.

Solid where the boundary is one of stable motions (all multipliers but the critical one inside the unit circle), dashed
where motions on both sides are unstable; extrema and points of codimension two marked and named.

Lines of period doublings and limit points have the colour of the period whose motions are born or end there, so that
what is blue borders motions of period 2T; the other kinds, across which no period begins, have colours of their own.
The kind is shown by shape as well, by small marks along the line: those of its kind in response curves, hollow where
period doublings are subcritical.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.kinds import KINDS
from suboctave.pictures import style
from suboctave.pictures.drawing import (
    Axis,
    Beads,
    Drawing,
    Entry,
    Frame,
    Label,
    Markers,
    event_rank,
    plain,
)
from suboctave.pictures.isolas import CENTRE, MERGING, end_text, shade, split, with_ends
from suboctave.pictures.options import Coordinates, View
from suboctave.pictures.paper import figure_of
from suboctave.pictures.strokes import (
    Line,
    add_strokes,
    check_count,
    checked,
    differing,
    events_of,
    fixed_parameters,
    line_through,
    named_axis,
)
from suboctave.pictures.style import Mark, Pen, period_colour, period_name, period_of, places_among, tinted

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: what the strokes mean here
BORDER, WITHIN = "borders stable motions", "within unstable motions"
SUBCRITICAL = "subcritical"
#: how large the small marks along a line are beside the others
SMALL = 0.55
#: so many extrema are named by their values
_NAMED = 4
#: share of the axes beyond what is drawn
_MARGIN = 0.06
#: share of white in the colours of those of kinds with a colour of their own, for motions of several periods
_STAGE = 0.4
#: of the second and third curve of one kind and period: share of white, width
_APART = ((0.0, 1.0), (0.45, 0.7), (0.25, 1.4))


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
    several: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    drawing = boundary_drawing(several, x=x, y=y, labels=labels, view=view, projected=projected)
    drawing.frames[0].title = plain(title or "")
    return figure_of(drawing, style.sheet_of(size), path)


def boundary_drawing(
    curves: Sequence[xarray.Dataset],
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    view: View | None = None,
    projected: bool = False,
) -> Drawing:
    """Curves of bifurcations laid out over the plane of two parameters, with the regions of isolas behind."""
    given, heads = split(curves)
    group = [with_ends(dataset, heads) for dataset in _checked(given)]
    if projected and y is not None:
        raise InputError("y= names a parameter; with a quantity= that is what is drawn upwards")
    axes = Coordinates(
        (named_axis(group, x) or plane_axes(group)[0], None) if projected else plane_axes(group, x, y), view or View()
    )
    check_count("labels", labels, len(group), "curves")
    for dataset in group:
        axes.check(dataset)
    names = [plain(name) for name in (labels if labels is not None else boundary_names(group))]
    pens = boundary_styles(group, names)
    limits = axes.limits(group, _MARGIN, _MARGIN)
    spread = (limits[0][1] - limits[0][0], limits[1][1] - limits[1][0])
    frame, verdicts, hollow = Frame(), set[bool | None](), False
    for region in shade(heads, axes.names, axes.factors):
        frame.add(region, region.name)
    earlier: dict[Pen, list[np.ndarray]] = {}
    for dataset, name, pen in zip(group, names, pens, strict=True):
        seen = {None: ("curve", name, name), True: ("border", name, name), False: ("within", f"{name}, {WITHIN}", name)}
        verdicts |= add_strokes(frame, dataset, axes, pen, seen, earlier=earlier, spread=spread)
        points, places = axes.of(dataset)
        whole = line_through(dataset, points, places)
        below = _subcritical(dataset, whole)
        hollow = hollow or bool(below.any())
        for first, last in _runs(below, whole.stable):
            mark = _small_mark(kind_of(dataset), pen, hollow=bool(below[first]))
            role, words = ("along-hollow", f"{name}, {SUBCRITICAL}") if below[first] else ("along", "")
            line = whole.at[:, first : last + 1]
            frame.items.append(Beads(line, mark, places, role=role, name=words, group=name))
        frame.entries[name] = Entry(pen.along(None), _small_mark(kind_of(dataset), pen, hollow=False))
    frame.entries |= verdict_entries(verdicts)
    if hollow:
        frame.entries[SUBCRITICAL] = Entry(mark=_small_mark("PD", style.ONE_CURVE, hollow=True))
    for dataset in group:
        frame.items += event_markers(dataset, axes, axes.marked(dataset))
    frame.entries |= event_entries(kind for data in group for kind in data["event_kind"].to_numpy()[axes.marked(data)])
    frame.labels = _names_of_events(group, axes)
    lows_and_highs = zip(axes.labels(group), limits, strict=True)
    return Drawing([Axis(label, *own) for label, own in lows_and_highs], [frame])


# --------------------------------------------------------------------------------------------------------------- curves
def is_boundary(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of a curve of bifurcations in two parameters."""
    return bool(dataset.attrs.get("tracked"))


def kind_of(dataset: xarray.Dataset) -> str:
    """The kind of bifurcation that a curve consists of."""
    return str(dataset.attrs["tracked"])


def plane_of(dataset: xarray.Dataset) -> tuple[str, str]:
    """The two parameters that were free."""
    first, second = str(dataset.attrs["plane"]).split("\n")
    return first, second


def boundary_names(group: Sequence[xarray.Dataset]) -> list[str]:
    """Kind and period of each, and the parameters in which those of one kind and period differ."""
    names = []
    for kind, nu in ((kind_of(dataset), period_of(dataset)) for dataset in group):
        periods = f" {period_name(nu)}→{period_name(2 * nu)}" if kind == "PD" else f" of {period_name(nu)}" * (nu > 1)
        names.append(f"{style.kind_style(kind).name}{periods}")
    full = list(names)
    for name in dict.fromkeys(names):
        alike = [index for index, other in enumerate(names) if other == name]
        words = differing([fixed_parameters(group[index]) for index in alike])
        for index, own in zip(alike, words, strict=True):
            full[index] = ", ".join([name, *own])
    return full


def boundary_styles(group: Sequence[xarray.Dataset], names: Sequence[str]) -> list[Pen]:
    """The pen of each: by kind and period, and among those by name."""
    pens, kinds = [], [(kind_of(dataset), period_of(dataset)) for dataset in group]
    for (kind, nu), place in zip(kinds, places_among(kinds, names), strict=True):
        white, width = _APART[place % len(_APART)]
        pens.append(Pen(tinted(_colour(kind, nu), white), width * KINDS[kind].width, style.curve_style(place).dash))
    return pens


def _colour(kind: str, nu: int) -> str:
    if KINDS[kind].line:
        return tinted(KINDS[kind].line, 0.0 if nu == 1 else _STAGE)
    return period_colour(2 * nu if kind == "PD" else nu)


def _subcritical(dataset: xarray.Dataset, whole: Line) -> np.ndarray:
    """(vertices - 1,) whether the period doublings between two vertices of the line are subcritical.

    The sign of c3 at the points decides; it changes at a located GPD, where there is one.
    """
    result = np.zeros(max(whole.x.size - 1, 0), dtype=bool)
    if kind_of(dataset) != "PD" or "coefficient" not in dataset:
        return result
    positive, here = dataset["coefficient"].to_numpy() > 0.0, False
    kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
    for piece in range(result.size):
        if whole.point[piece] >= 0:
            here = bool(positive[whole.point[piece]])
        elif kinds[whole.event[piece]] == "GPD":
            here = not here
        result[piece] = here
    return result


def _runs(below: np.ndarray, stable: np.ndarray | None) -> list[tuple[int, int]]:
    """First and last vertex of every stretch of a line of one stability that is wholly subcritical or not."""
    if not below.size:
        return []
    verdict = below if stable is None else stable
    changes = np.flatnonzero((np.diff(below.astype(int)) != 0) | (np.diff(verdict.astype(int)) != 0)) + 1
    return list(zip([0, *changes], [*changes, below.size], strict=True))


# --------------------------------------------------------------------------------------------------------------- events
def event_words(kind: str) -> str:
    """What a legend says of a kind of event; the short name is the one written beside it."""
    name = style.kind_style(kind).name
    return name if kind in ("extremum", name) or kind.startswith("isola") else f"{kind}: {name}"


def event_markers(dataset: xarray.Dataset, axes: Coordinates, marked: np.ndarray) -> list[Markers]:
    """Markers of extrema and points of codimension two; `marked`, (events,): which of them."""
    return [
        Markers(mark=look.mark(), layer=5.5 if kind.startswith("isola") else 5.0, name=words, group=words, **placed)
        for kind, look, placed in events_of(dataset, axes, marked)
        for words in [event_words(kind)]
    ]


def event_entries(kinds: Iterable[Any]) -> dict[str, Entry]:
    """What the legend says of kinds of events."""
    names = sorted({str(kind) for kind in kinds}, key=event_rank)
    return {event_words(kind): Entry(mark=style.kind_style(kind).mark()) for kind in names}


def _small_mark(kind: str, pen: Pen, *, hollow: bool) -> Mark:
    """A mark along a line."""
    own = style.kind_style(kind)
    return Mark(own.marker, SMALL * own.size, "white" if hollow else pen.colour, pen.colour)


def verdict_entries(verdicts: set[bool | None], width: float = 1.0) -> dict[str, Entry]:
    """What the legend says of strokes, where there are dashed ones."""
    pen, words = Pen(style.SOFT, width, style.UNSTABLE_DASH), {True: BORDER, False: WITHIN}
    return {words[s]: Entry(pen.along(s)) for s in words if s in verdicts} if False in verdicts else {}


def _names_of_events(group: Sequence[xarray.Dataset], axes: Coordinates) -> list[Label]:
    """Codimension-two points by their short names; extrema of what is drawn upwards and isolas' ends by values."""
    ends, extrema, points = [], [], []
    upwards = axes.names[1]
    for dataset in group:
        places = axes.of(dataset)[1].T
        extremes = dataset["event_extreme"].to_numpy() if "event_extreme" in dataset else [""] * len(places)
        kinds, marked = dataset["event_kind"].to_numpy(), axes.marked(dataset)
        for place, kind, extreme in zip(places[marked], kinds[marked], np.array(extremes)[marked], strict=True):
            if kind in (CENTRE, MERGING):
                value = place[0] if upwards == "omega" else None if upwards is None else place[1]
                ends.append(Label(place, end_text(str(kind), value)))
            elif str(kind) != "extremum":
                points.append(Label(place, str(kind)))
            elif upwards is not None and str(extreme).endswith(f" of {upwards}"):
                extrema.append(Label(place, f"{place[1]:#.4g}"))
    return ends + (extrema if len(extrema) <= _NAMED else []) + points


# ----------------------------------------------------------------------------------------------------------------- axes
def _checked(curves: Sequence[Any]) -> list[xarray.Dataset]:
    """The datasets of curves of bifurcations, at least one; InputError for anything else."""
    group = checked(curves)
    if not all(is_boundary(dataset) for dataset in group):
        raise InputError("this is no curve of bifurcations; plot draws responses, plot_space both together")
    return group


def plane_axes(group: Sequence[xarray.Dataset], x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """The parameters to the right and upwards; default the two that were free, which must be the same of all."""
    return chosen_axes(group, {plane_of(dataset) for dataset in group}, x, y, "was not free on these curves")


def chosen_axes(
    group: Sequence[xarray.Dataset], pairs: set[tuple[str, str]], x: str | None, y: str | None, wrong: str
) -> tuple[str, str]:
    """The axes given, or those of the one pair there is; `wrong`: what an axis that is none of this pair is not."""
    x, y = named_axis(group, x), named_axis(group, y)
    if x is not None and x == y:
        raise InputError(f"x and y are the same parameter {x!r}")
    if x is not None and y is not None:
        return x, y
    if len(pairs) != 1:
        raise InputError("the curves were followed in different parameters: choose axes with x= and y=")
    pair = next(iter(pairs))
    given = x if x is not None else y
    if given is None:
        return pair
    if given not in pair:
        raise InputError(f"{given!r} {wrong}{suggest(given, pair)}: give x= and y=")
    other = pair[1] if given == pair[0] else pair[0]
    return (given, other) if x is not None else (other, given)
