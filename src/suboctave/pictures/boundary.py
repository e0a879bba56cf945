"""Curves of bifurcations: which side of a boundary a design lies on; and the regions and surfaces of isolas.

In the plane of their two parameters they are solid where the boundary is one of stable motions (all multipliers but the
critical one inside the unit circle), dashed where motions on both sides are unstable; extrema and points of codimension
two marked and named. Lines of period doublings and limit points have the colour of the period whose motions are born or
end there, so that what is blue borders motions of period 2T; the other kinds, across which no period begins, have
colours of their own. The kind is shown by shape as well, by small marks along the line: those of its kind in response
curves, hollow where period doublings are subcritical.

In space they run through response curves at several values of a parameter: frequency to the right, the parameter into
the depth, amplitude upwards; the curves of bifurcations once more, thin, as their projection on the floor, which is
their picture in the plane.

Isolas are drawn from the dataset that `suboctave.store.layout` describes, given among those of the curves.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.kinds import KINDS
from suboctave.options import with_options
from suboctave.pictures import strokes, style
from suboctave.pictures.drawing import Axis, Beads, Drawing, Entry, Frame, Label, Markers, Region, Surface, plain
from suboctave.pictures.given import datasets_of, drawn_datasets, is_boundary, is_isolas, named_within, several_of
from suboctave.pictures.options import Coordinates, FrameOptions, SpaceOptions, View
from suboctave.pictures.paper import finished
from suboctave.pictures.strokes import Seen, Verdict, add_strokes, checked, events_of, line_through, named_axis, seen_as
from suboctave.pictures.style import Mark, Pen, period_colour, period_name, period_of, places_among, tinted
from suboctave.store.layout import coordinate

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
#: share of the axes beyond what is drawn, in the plane and in space
_MARGIN, _MARGIN_IN_SPACE = 0.06, 0.04
#: share of white in the colours of those of kinds with a colour of their own, for motions of several periods
_STAGE = 0.4
#: of the second and third curve of one kind and period: share of white, width
_APART = ((0.0, 1.0), (0.45, 0.7), (0.25, 1.4))


@with_options(FrameOptions)
def plot_boundaries(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    view: View | None = None,
    projected: bool = False,
    **options: Unpack[FrameOptions],
) -> Figure:
    """One or several curves of bifurcations over the plane of two parameters, saved to `path` where one is given.

    Parameters
    ----------
    curves
        Tracked curves, or their datasets; with isolas among them the regions of these are shaded in the plane of their
        parameters, and their ends are marked.
    x, y
        The axes, "omega" or parameters; default: the two that were free.
    labels
        Names of the curves; default: kinds and periods, and the parameters in which curves of one kind differ.
    view
        Units: `scale` and `unit` are those of the axis that is no frequency.
    projected
        The quantity of the view is drawn upwards, over `x` (default: the first of the two).

    Raises InputError for what cannot be drawn.
    """
    drawing = boundary_drawing(drawn_datasets(curves, view), x=x, y=y, labels=labels, view=view, projected=projected)
    drawing.frames[0].title = plain(options.get("title") or "")
    return finished(drawing, style.sheet_of(options.get("size") or (6.4, 4.2)), path, options)


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
    if not all(is_boundary(dataset) for dataset in checked(given)):
        raise InputError("this is no curve of bifurcations; plot draws responses, plot_space both together")
    group = [with_ends(dataset, heads) for dataset in given]
    if projected and y is not None:
        raise InputError("y= names a parameter; with a quantity= that is what is drawn upwards")
    pairs, wrong = {plane_of(dataset) for dataset in group}, "was not free on these curves"
    plane: tuple[str | None, ...]
    if projected:
        plane = named_axis(group, x) or chosen_axes(group, pairs, None, None, wrong)[0], None
    else:
        plane = chosen_axes(group, pairs, x, y, wrong)
    axes = Coordinates(plane, view or View())
    strokes.check_count("labels", labels, len(group), "curves")
    for dataset in group:
        axes.check(dataset)
    names = boundary_names(group) if labels is None else [plain(label) for label in labels]
    pens = boundary_styles(group, names)
    limits = axes.limits(group, _MARGIN, _MARGIN)
    spread = (limits[0][1] - limits[0][0], limits[1][1] - limits[1][0])
    frame, verdicts, hollow = Frame(), set[Verdict](), False
    for region in shade(heads, axes.names, axes.factors):
        frame.add(region, region.name)
    earlier: dict[Pen, list[np.ndarray]] = {}
    for dataset, name, pen in zip(group, names, pens, strict=True):
        seen: Seen = {
            None: ("curve", name, name),
            True: ("border", name, name),
            False: ("within", f"{name}, {WITHIN}", name),
        }
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
    each = zip(axes.labels(group), limits, axes.shown, strict=True)
    return Drawing([Axis(label, *own, shows=shown) for label, own, shown in each], [frame])


# --------------------------------------------------------------------------------------------------------------- curves


def kind_of(dataset: xarray.Dataset) -> str:
    """The kind of bifurcation that a curve consists of."""
    return str(dataset.attrs["tracked"])


def plane_of(dataset: xarray.Dataset) -> tuple[str, str]:
    """The two parameters that were free."""
    first, second = str(dataset.attrs["plane"]).split("\n")
    return first, second


def boundary_names(group: Sequence[xarray.Dataset]) -> list[str]:
    """Kind and period of each, and the parameters in which those of one kind and period differ; names that the user
    gave stand for all of this, but among curves of one name.
    """
    if any("called" in dataset.attrs for dataset in group):
        return named_within(group, boundary_names)
    names = []
    for kind, nu in ((kind_of(dataset), period_of(dataset)) for dataset in group):
        periods = f" {period_name(nu)}→{period_name(2 * nu)}" if kind == "PD" else f" of {period_name(nu)}" * (nu > 1)
        names.append(f"{style.kind_style(kind).name}{periods}")
    full = list(names)
    for name in dict.fromkeys(names):
        alike = [index for index, other in enumerate(names) if other == name]
        words = strokes.differing([strokes.fixed_parameters(group[index]) for index in alike])
        for index, own in zip(alike, words, strict=True):
            full[index] = ", ".join([name, *own])
    return full


def boundary_styles(group: Sequence[xarray.Dataset], names: Sequence[str]) -> list[Pen]:
    """The pen of each: by kind and period, and among those by name."""
    pens, kinds = [], [(kind_of(dataset), period_of(dataset)) for dataset in group]
    for (kind, nu), place in zip(kinds, places_among(kinds, names), strict=True):
        row, (white, width) = KINDS[kind], _APART[place % len(_APART)]
        own = (
            tinted(row.line, 0.0 if nu == 1 else _STAGE) if row.line else period_colour(2 * nu if kind == "PD" else nu)
        )
        pens.append(Pen(tinted(own, white), width * row.width, style.curve_style(place).dash))
    return pens


def _subcritical(dataset: xarray.Dataset, whole: strokes.Line) -> np.ndarray:
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
    every, known = {str(kind) for kind in kinds}, list(style.KINDS)
    names = [*filter(every.__contains__, known), *sorted(every.difference(known))]  # a user's own behind the others
    return {event_words(kind): Entry(mark=style.kind_style(kind).mark()) for kind in names}


def _small_mark(kind: str, pen: Pen, *, hollow: bool) -> Mark:
    """A mark along a line."""
    own = style.kind_style(kind)
    return Mark(own.marker, SMALL * own.size, "white" if hollow else pen.colour, pen.colour)


def verdict_entries(verdicts: set[Verdict], width: float = 1.0) -> dict[str, Entry]:
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
                word = "born" if kind == CENTRE else "merges"
                ends.append(Label(place, word if value is None else f"{word} {value:#.4g}"))
            elif str(kind) != "extremum":
                points.append(Label(place, str(kind)))
            elif upwards is not None and str(extreme).endswith(f" of {upwards}"):
                extrema.append(Label(place, f"{place[1]:#.4g}"))
    return ends + (extrema if len(extrema) <= _NAMED else []) + points


# ----------------------------------------------------------------------------------------------------------------- axes
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


# ------------------------------------------------------------------------------------------------------------- in space
#: width of a response curve beside a curve of bifurcations, and of this one
_THIN, _THICK = 0.7, 1.25
#: share of white in the projection on the floor
_SHADE = 0.55
#: opacity of the surface of an isola
_CLEAR = 0.16


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
    """
    view = View.of(options).placed(several_of(curves))
    for name, angle in (("elevation", elevation), ("azimuth", azimuth)):
        if isinstance(angle, bool) or not isinstance(angle, int | float) or not np.isfinite(angle):
            raise InputError(f"{name} is an angle in degrees, not {angle!r}")
    drawing = space_drawing(datasets_of(curves, view), x=x, y=y, view=view)
    drawing.title, drawing.seen_from = plain(options.get("title") or ""), (float(elevation), float(azimuth))
    if zlabel:
        drawing.axes = [*drawing.axes[:2], Axis(zlabel, drawing.axes[2].low, drawing.axes[2].high)]
    sheet = style.sheet_of(options.get("size") or (6.4, 5.0))
    if sheet.named:  # named sizes are widths: in space more height is needed
        width = sheet.inches[0]
        sheet = style.Sheet((width, 0.8 * width if width < 5.0 else 0.62 * width), sheet.look, named=True)
    return finished(drawing, sheet, path, options)


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
    limits = axes.limits(group, *[_MARGIN_IN_SPACE] * 3, from_zero=True)
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
    each = zip(axes.labels(group), limits, axes.shown, strict=True)
    return Drawing([Axis(label, *own, shows=shown) for label, own, shown in each], [frame])


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
    verdicts = set[Verdict]()
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
    within = set[Verdict]()
    names = boundary_names([dataset for dataset, _ in bounds])
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
        lines = [strokes.cut(dataset, line_through(dataset, *axes.of(dataset))) for dataset in closed]
        around = [np.hstack([stroke.at for stroke in own]) for own in lines]
        grid = strokes.surface(around, tips[:1])
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


# --------------------------------------------------------------------------------------------------------------- isolas
#: kinds that the events at the two ends of an isola have in pictures
CENTRE, MERGING = "isola_centre", "isola_merging"
#: an event within this, relative to its values, is the end itself
_SAME = 1e-8
#: share of white in the region of an isola
_PALE = 0.82


def parameter_of(dataset: xarray.Dataset) -> str:
    """The design parameter of a dataset of isolas."""
    return str(dataset.attrs["isolas"])


def split(datasets: Sequence[xarray.Dataset]) -> tuple[list[xarray.Dataset], list[xarray.Dataset]]:
    """The datasets of curves, and those of isolas."""
    heads = [dataset for dataset in datasets if is_isolas(dataset)]
    return [dataset for dataset in datasets if not is_isolas(dataset)], heads


def shade(
    heads: Sequence[xarray.Dataset], names: Sequence[str | None], factors: np.ndarray, floor: float | None = None
) -> list[Region]:
    """The regions of isolas in the plane of two axes, if it is theirs; in space on the floor, at this height."""
    shaded = []
    for head in heads:
        if set(names) != {"omega", parameter_of(head)}:
            continue
        for number, nu in enumerate(head["period"].to_numpy()):
            own, words = head["edge_isola"].to_numpy() == number, f"{period_name(int(nu))} isola"
            value, low, high = (head[f"edge_{name}"].to_numpy()[own] for name in ("value", "low", "high"))
            around = np.concatenate([low, high[::-1], low[:1]]), np.concatenate([value, value[::-1], value[:1]])
            outline = np.array([around[name != "omega"] for name in names]) * factors[:2, None]
            colour = tinted(period_colour(int(nu)), _PALE)
            if floor is None:
                shaded.append(Region(outline, colour, role="isola", layer=1.5, name=words, group=words))
            else:
                outline = np.vstack([outline, np.full(outline.shape[1], floor)])
                shaded.append(Region(outline, colour, role="isola-floor", layer=0.9))
    return shaded


def with_ends(dataset: xarray.Dataset, heads: Sequence[xarray.Dataset]) -> xarray.Dataset:
    """The dataset of a curve, the ends of isolas among its events under kinds of their own."""
    kinds, there = dataset["event_kind"].to_numpy().astype(object), dataset["event_omega"].to_numpy()
    for head in heads:
        if parameter_of(head) not in dataset["parameter"].to_numpy():
            continue
        at = coordinate(dataset, parameter_of(head))[1]
        for kind, name in ((CENTRE, "born"), (MERGING, "merges")):
            for omega, value in zip(head[f"{name}_omega"].to_numpy(), head[name].to_numpy(), strict=True):
                near = np.abs(at - value) <= _SAME * max(abs(value), 1e-300)
                kinds[near & (np.abs(there - omega) <= _SAME * abs(omega))] = kind
    return dataset.assign(event_kind=("event", kinds))
