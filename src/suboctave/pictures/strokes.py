"""Curves as strokes of one stability each, cut exactly where the bifurcations were located; and as parts of a drawing:
strokes, markers of their events, and what is said of them in words.

The points of a curve and its events form one line: point i, the events that lie after it, point i + 1. A stroke ends at
an event, not at the computed point nearest to it, so that a dash begins at the marker.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.drawing import Frame, Polyline, lengths
from suboctave.pictures.options import Coordinates
from suboctave.pictures.style import KindStyle, Pen
from suboctave.store.layout import check_layout, coordinate, open_points

if TYPE_CHECKING:
    import xarray


#: the verdict of motions whose multipliers have errors as large as themselves
OPEN: Literal["open"] = "open"
Verdict: TypeAlias = bool | Literal["open"] | None
_VERDICTS: tuple[Verdict, ...] = (False, True, OPEN)


@dataclass(frozen=True)
class Line:
    """The points of a curve and its events as one line, or a stroke of it.

    at
        Its vertices, (axes, vertices), of which `x` and `y` are the first and the last row.
    point, event
        The index of the point or event of the curve at each, else -1, (vertices,).
    stable
        Whether the motions between two vertices are, (vertices - 1,); of a stroke one verdict, OPEN where the errors of
        multipliers leave none. None: not computed.
    open
        Where they leave none, (vertices - 1,).
    """

    at: np.ndarray
    point: np.ndarray
    event: np.ndarray
    stable: Any
    open: Any = False

    @property
    def x(self) -> np.ndarray:
        return np.asarray(self.at[0])

    @property
    def y(self) -> np.ndarray:
        return np.asarray(self.at[-1])

    def stroke(self, first: int, last: int, stable: Verdict) -> Line:
        """The vertices first .. last, of one verdict."""
        here = slice(first, last + 1)
        return Line(self.at[:, here], self.point[here], self.event[here], stable)


def line(dataset: xarray.Dataset, x: str, y: str = "amplitude") -> Line:
    """The curve over parameter `x`; `y` is a variable of the dataset."""
    horizontal, event_horizontal = coordinate(dataset, x)
    points, events = (horizontal, dataset[y].to_numpy()), (event_horizontal, dataset[f"event_{y}"].to_numpy())
    return line_through(dataset, np.array(points), np.array(events))


def cut(dataset: xarray.Dataset, whole: Line) -> list[Line]:
    """The line of a curve, cut where stability changes."""
    if whole.stable is None:
        return [whole]
    if whole.stable.size == 0:
        return [replace(whole, stable=bool(dataset["stable"].to_numpy().all()))]
    verdicts = np.where(whole.open, 2, whole.stable)
    ends = [0, *(np.flatnonzero(np.diff(verdicts)) + 1), verdicts.size]
    return [whole.stroke(first, last, _VERDICTS[verdicts[first]]) for first, last in pairwise(ends)]


def line_through(dataset: xarray.Dataset, points: np.ndarray, events: np.ndarray) -> Line:
    """The line through points (axes, points) and events (axes, events) of a curve, with the verdict on every piece.

    A piece between two neighbours is stable when both ends say so. An event takes the stability of the side in
    question: that of the preceding point before it, of the following point after it. Between two events of the same
    step `event_stable_after` says it; where it does not, and where stability changes with no located event, the piece
    counts as unstable: a picture must not promise more than was found.
    """
    count, after = points.shape[1], dataset["event_after"].to_numpy()
    order = np.argsort(after, kind="stable")
    # Position on the line: all points, each followed by its events.
    position = np.searchsorted(after[order], np.arange(count)) + np.arange(count)
    event_position = after[order] + 1 + np.arange(order.size)
    at = np.empty((len(points), count + order.size))
    at[:, position], at[:, event_position] = points, events[:, order]
    point, event = np.full((2, at.shape[1]), -1)
    point[position] = np.arange(count)
    event[event_position] = order
    if "stable" not in dataset:
        return Line(at, point, event, None)
    here = np.zeros(len(point), dtype=bool)  # the verdict at a point, or right after an event
    here[position] = dataset["stable"].to_numpy().astype(bool)
    here[event_position] = dataset["event_stable_after"].to_numpy()[order] == 1
    first, last, between = here[:-1], here[1:], event[1:] >= 0
    stable = np.where(event[:-1] >= 0, np.where(between, first, last), first & (between | last))
    vague = open_points(dataset)
    # at events what lies before them in the order of the points tells
    number = np.maximum.accumulate(point)
    return Line(at, point, event, stable, vague[number[:-1]] | vague[np.minimum(number[:-1] + 1, count - 1)])


#: in units of the frame: nearer than this two lines are one, and so far along a line a part of it is another part
_UPON, _ANOTHER = 4e-3, 3e-2


def without_repeats(pieces: Sequence[Line], earlier: list[np.ndarray], spread: tuple[float, float]) -> list[Line]:
    """The strokes without unstable parts that lie upon earlier ones: dashes upon dashes would look like a solid line.

    A branch that goes through its parent comes back as the same motion, shifted, at the same amplitude. `spread`: width
    and height of the frame. `earlier`, places (m, 2) along those drawn before in units of these, is added to.
    """
    kept: list[Line] = []
    for piece in pieces:
        if piece.stable is not False or piece.x.size < 2:
            kept.append(piece)
            continue
        path = piece.at.T / spread
        along = lengths(path)
        at = np.linspace(0.0, along[-1], 2 + math.ceil(along[-1] / _UPON))
        own = np.array([np.interp(at, along, row) for row in path.T]).T
        fresh = np.ones(len(path) - 1, dtype=bool)
        for i, probes in enumerate(zip(path[:-1], 0.5 * (path[:-1] + path[1:]), path[1:], strict=True)):
            there = np.concatenate([*earlier, own[at < along[i] - _ANOTHER]])
            fresh[i] = not len(there) or _farthest(probes, there) > _UPON
        earlier.append(own)
        cuts = np.flatnonzero(np.diff(np.concatenate([[False], fresh, [False]])))
        kept += [piece.stroke(a, b, False) for a, b in cuts.reshape(-1, 2)]
    return kept


def _farthest(probes: Sequence[np.ndarray], places: np.ndarray) -> float:
    """How far the farthest of some points is from the nearest of some places (m, 2)."""
    return max(float(np.hypot(*(places - point).T).min()) for point in probes)


#: angle between two pieces that is a corner; in units of the frame, nearest vertices that are two, and length of the
#: pieces that are drawn
_CORNER, _SAME, _PIECE = 0.8, 1e-5, 5e-3


def bent(x: np.ndarray, y: np.ndarray, spread: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A line through vertices as it is drawn: through all of them, and smooth but for its corners (modified Akima).

    `spread`: width and height of the frame, in the units of x and y.
    """
    path = np.column_stack([x / spread[0], y / spread[1]])
    if len(path) < 3 or not np.isfinite(path).all():
        return x, y
    way = np.hypot(*np.diff(path, axis=0).T)
    # one of those that lie upon each other, the last of all among them
    kept = np.append(way > _SAME, True)
    kept[0] = kept[0] or not np.any(kept[:-1])
    path, vertices = path[kept], np.flatnonzero(kept)
    steps = np.diff(path, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    corners = np.flatnonzero(np.abs(np.diff(heading)) > _CORNER) + 1
    parts = [path[:1]]
    for first, last in pairwise([0, *corners, len(path) - 1]):
        own = path[first : last + 1]
        if len(own) < 3:
            parts.append(own[1:])
            continue
        along = lengths(own)
        shares = [np.linspace(a, b, 1 + math.ceil((b - a) / _PIECE))[1:] for a, b in pairwise(along)]
        drawn = smooth(along, own, np.concatenate(shares))
        # the vertices themselves, without rounding
        drawn[np.cumsum([len(share) for share in shares]) - 1] = own[1:]
        parts.append(drawn)
    whole = np.concatenate(parts) * spread
    whole[0], whole[-1] = (x[vertices[0]], y[vertices[0]]), (x[-1], y[-1])
    return whole[:, 0], whole[:, 1]


def smooth(along: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubics through three or more values (knots, axes) with the slopes of modified Akima interpolation, (at, axes).

    `scipy.interpolate` has them as well; to import it takes as long as to draw a curve.
    """
    widths = np.diff(along)[:, np.newaxis]
    secants = np.diff(values, axis=0) / widths
    before, behind = 2.0 * secants[0] - secants[1], 2.0 * secants[-1] - secants[-2]
    m = np.array([2.0 * before - secants[0], before, *secants, behind, 2.0 * behind - secants[-1]])
    weights = np.abs(np.diff(m, axis=0)) + 0.5 * np.abs(m[1:] + m[:-1])
    whole = weights[2:] + weights[:-2]
    share = np.divide(weights[:-2], whole, where=whole > 1e-9 * whole.max(initial=0.0), out=np.full(whole.shape, 0.5))
    slopes = m[1:-2] + share * (m[2:-1] - m[1:-2])
    piece = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(along) - 2)
    u = (at - along[piece])[:, np.newaxis] / widths[piece]
    rise, one, other = ((part * widths)[piece] for part in (secants, slopes[:-1], slopes[1:]))
    return np.asarray(values[piece] + u * (one + u * (3.0 * rise - 2.0 * one - other + u * (one + other - 2.0 * rise))))


#: places along a loop of a surface, from its largest to its least frequency
_SAMPLES = 60


def surface(loops: Sequence[np.ndarray], tips: Sequence[np.ndarray] = ()) -> np.ndarray | None:
    """The grid (3, rows, columns) through loops and points that they shrink to, in the order of the parameter.

    Each loop is cut at its least and its largest frequency into two arcs, and the places at equal shares of their
    lengths are joined from loop to loop. In between that is interpolation: a picture of how the loops hang together.

    `loops`, (3, vertices) each: frequency and parameter, in either order, and the quantity upwards, once around;
    `tips`, (3,) each. None where there are fewer than two rows.
    """
    if not loops or len(loops) + len(tips) < 2:
        return None
    along = 0 if np.ptp(loops[0][0]) > 0.0 else 1
    scale = np.max([np.ptp(loop, axis=1) for loop in loops], axis=0)[:, None]
    scale[scale == 0.0] = 1.0
    rows: list[np.ndarray] = []
    for loop in sorted(loops, key=lambda loop: float(loop[1 - along][0])):
        both = _arcs(loop, along, scale)
        if rows:
            far = [float(np.sum(((arcs - rows[-1]) / scale)[[along, 2]] ** 2)) for arcs in both]
        else:  # the first one begins with its upper arc
            far = [-float(np.mean(arcs[2, :_SAMPLES])) for arcs in both]
        rows.append(both[int(np.argmin(far))])
    for tip in tips:
        rows.append(np.repeat(np.asarray(tip, dtype=float)[:, None], 2 * _SAMPLES, axis=1))
    rows.sort(key=lambda row: float(row[1 - along][0]))
    return np.stack(rows, axis=1)


def _arcs(loop: np.ndarray, along: int, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The loop from its largest frequency to the least and back, (3, 2 samples), in both senses."""
    vertices = loop[:, :-1] if np.allclose(loop[:, 0], loop[:, -1]) else loop
    vertices = np.roll(vertices, -int(np.argmax(vertices[along])), axis=1)
    turn = int(np.argmin(vertices[along]))
    there, back = vertices[:, : turn + 1], np.column_stack([vertices[:, turn:], vertices[:, 0]])
    first, second = _spread(there, scale), _spread(back, scale)
    return np.hstack([first, second]), np.hstack([second[:, ::-1], first[:, ::-1]])


def _spread(arc: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Places at equal shares of the length of an arc, (3, samples)."""
    length = lengths((arc / scale).T)
    return np.array([np.interp(np.linspace(0.0, length[-1], _SAMPLES), length, row) for row in arc])


# --------------------------------------------------------------------------------------------------- parts of a drawing
#: role, name and group of a stroke by its verdict
Seen: TypeAlias = "Mapping[Verdict, tuple[str, str, str]]"


def seen_as(role: str, name: str) -> Seen:
    """All strokes of a curve alike."""
    verdicts: tuple[Verdict, ...] = (None, True, False, OPEN)
    return dict.fromkeys(verdicts, (role, name, name))


def checked(curves: Sequence[Any]) -> list[xarray.Dataset]:
    """The datasets of curves, at least one, each with points; InputError for anything else."""
    import xarray

    if not curves:
        raise InputError("no curve to draw")
    for dataset in curves:
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(f"expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()")
        check_layout(dataset.attrs)
        if "point" not in dataset.sizes:
            raise InputError(
                "this dataset is no curve; one of a motion is drawn by plot_phase, plot_spectrum, plot_history"
            )
        if dataset.sizes["point"] == 0:
            raise InputError("a curve without points cannot be drawn")
    return list(curves)


def named_axis(group: Sequence[xarray.Dataset], name: str | None) -> str | None:
    """The parameter of an axis; InputError where a curve does not have it."""
    for dataset in group if name is not None else ():
        coordinate(dataset, str(name))
    return name


def check_count(name: str, given: Sequence[Any] | None, count: int, things: str) -> None:
    """InputError where what is given by name has not one entry for each of so many things."""
    if given is not None and len(given) != count:
        raise InputError(f"{name}: expected one for each of the {count} {things}, got {len(given)}")


def add_strokes(
    frame: Frame,
    dataset: xarray.Dataset,
    axes: Coordinates,
    pen: Pen,
    seen: Seen,
    *,
    earlier: dict[Pen, list[np.ndarray]] | None = None,
    spread: tuple[float, float] = (1.0, 1.0),
    floor: float | None = None,
    layer: float = 3.0,
) -> set[Verdict]:
    """Add the strokes of a curve, or in space their projection on the floor at this height; returns their verdicts.

    In the plane strokes are smooth, and dashes are not drawn
    upon those of `earlier` curves, in a frame of width and height `spread`.
    """
    strokes = cut(dataset, line_through(dataset, *axes.of(dataset)))
    if earlier is not None:
        strokes = without_repeats(strokes, earlier.setdefault(pen, []), spread)
    for stroke in strokes:
        at = stroke.at if floor is None else np.vstack([stroke.at[:2], np.full(stroke.at.shape[1], floor)])
        role, name, group = seen[stroke.stable]
        drawn: dict[str, Any] = {"smooth": earlier is not None, "role": role, "layer": layer}
        drawn |= {"curve": number_of(dataset), "vertices": np.where(stroke.event >= 0, -1 - stroke.event, stroke.point)}
        own = (pen.dotted if stroke.stable == OPEN else pen.along(stroke.stable)) if floor is None else pen.along(None)
        frame.items.append(Polyline(at, own, name=name, group=group, **drawn))
    return {stroke.stable for stroke in strokes}


def events_of(
    dataset: xarray.Dataset, axes: Coordinates, marked: np.ndarray
) -> Iterator[tuple[str, KindStyle, dict[str, Any]]]:
    """The events of a curve by how they are marked: kind, style, and place and role of their `Markers`.

    `marked`, (events,), bool: which of them.
    """
    places = axes.of(dataset)[1]
    for kind, look, every in style.marks(dataset):
        which = every[marked[every]]
        if which.size:
            placed = {"at": places[:, which], "role": kind}
            yield kind, look, {**placed, "curve": number_of(dataset), "vertices": -1 - which}


def number_of(dataset: xarray.Dataset) -> int:
    """The number of a curve on the page that it is drawn for; -1 elsewhere."""
    return int(dataset.attrs.get("number", -1))


# ---------------------------------------------------------------------------------------------------------------- words
#: significant digits that a screen can show
DIGITS = 9


def spelt(name: str) -> str:
    """How a parameter is written."""
    return "ω" if name == "omega" else name


def fixed_parameters(dataset: xarray.Dataset) -> dict[str, float]:
    """The parameters, and omega, that do not change along a curve."""
    table = dataset["parameters"].to_numpy()
    columns = {"omega": dataset["omega"].to_numpy()}
    columns |= {str(name): table[:, i] for i, name in enumerate(dataset["parameter"].to_numpy())}
    return {spelt(name): float(column[0]) for name, column in columns.items() if np.ptp(column) == 0.0}


def differing(values: Sequence[Mapping[str, float]], digits: int = 6) -> list[list[str]]:
    """For each curve or motion what tells it from the others: "j = 0" for values that all have and that differ."""
    names = [n for n in values[0] if all(n in own for own in values) and len({own[n] for own in values}) > 1]
    return [[f"{name} = {own[name]:.{digits}g}" for name in names] for own in values]
