"""A response curve as strokes of one stability each, cut exactly where the bifurcations were located.

The points of a curve and its events form one line: point i, the events that lie after it, point i + 1. A stroke ends at
an event, not at the computed point nearest to it, so that a dash begins at the marker.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["Line", "Stroke", "bent", "line", "repeated", "strokes", "without_repeats"]


@dataclass(frozen=True)
class Stroke:
    """A stretch of the curve, (vertices,) each, on which all motions are stable or none is (None: not computed)."""

    x: np.ndarray
    y: np.ndarray
    stable: bool | None


@dataclass(frozen=True)
class Line:
    """The points of a curve and its events as one line of vertices.

    `x`, `y`, (vertices,); `point` and `event`, (vertices,), the index of the point or event at each, else -1; `stable`,
    (vertices - 1,), whether the motions between two vertices are (None: not computed).
    """

    x: np.ndarray
    y: np.ndarray
    point: np.ndarray
    event: np.ndarray
    stable: np.ndarray | None


def strokes(dataset: xarray.Dataset, x: str, y: str = "amplitude") -> list[Stroke]:
    """The curve over parameter `x`, cut where stability changes; `y` is a variable of the dataset.

    A piece between two neighbours of the line is stable when both ends say so. An event takes the stability of the side
    in question: that of the preceding point before it, of the following point after it. Between two events of the same
    step `event_stable_after` tells; where it does not, and where stability changes with no located event,
    the piece counts as unstable: a picture must not promise more than was found.
    """
    drawn = line(dataset, x, y)
    if drawn.stable is None:
        return [Stroke(drawn.x, drawn.y, None)]
    if drawn.stable.size == 0:
        return [Stroke(drawn.x, drawn.y, bool(dataset["stable"].to_numpy().all()))]
    cuts = [0, *(np.flatnonzero(np.diff(drawn.stable)) + 1), drawn.stable.size]
    return [
        Stroke(drawn.x[first : last + 1], drawn.y[first : last + 1], bool(drawn.stable[first]))
        for first, last in pairwise(cuts)
    ]


def line(dataset: xarray.Dataset, x: str, y: str = "amplitude") -> Line:
    """The curve over parameter `x` as one line, with the verdict on every piece as `strokes` describes it."""
    horizontal, event_horizontal = coordinate(dataset, x)
    vertical, event_vertical = dataset[y].to_numpy(), dataset[f"event_{y}"].to_numpy()
    after = dataset["event_after"].to_numpy()
    order = np.argsort(after, kind="stable")
    # Position on the line: all points, each followed by its events.
    position = np.searchsorted(after[order], np.arange(vertical.size)) + np.arange(vertical.size)
    event_position = after[order] + 1 + np.arange(order.size)
    line_x = np.empty(vertical.size + order.size)
    line_y = np.empty_like(line_x)
    line_x[position], line_y[position] = horizontal, vertical
    line_x[event_position], line_y[event_position] = event_horizontal[order], event_vertical[order]
    point, event = np.full((2, line_x.size), -1)
    point[position] = np.arange(vertical.size)
    event[event_position] = order
    verdict = None
    if "stable" in dataset:
        verdict = _pieces(
            dataset["stable"].to_numpy().astype(bool),
            after[order],
            dataset["event_stable_after"].to_numpy()[order],
            position,
            event_position,
        )
    return Line(line_x, line_y, point, event, verdict)


def _pieces(
    stable: np.ndarray, after: np.ndarray, stable_after: np.ndarray, position: np.ndarray, event_position: np.ndarray
) -> np.ndarray:
    """(vertices - 1,) whether each piece of the line is stable."""
    count = stable.size + after.size
    is_event = np.zeros(count, dtype=bool)
    is_event[event_position] = True
    here = np.zeros(count, dtype=bool)  # the verdict at a point, or right after an event
    here[position] = stable
    here[event_position] = stable_after == 1

    verdict = np.zeros(count - 1, dtype=bool)
    for piece in range(count - 1):
        if is_event[piece]:
            verdict[piece] = here[piece] if is_event[piece + 1] else here[piece + 1]
        else:
            verdict[piece] = here[piece] and (is_event[piece + 1] or here[piece + 1])
    return verdict


#: in units of the frame: nearer than this two lines are one, and so far along a line a part of it is another part
_UPON, _ANOTHER = 4e-3, 3e-2


def without_repeats(pieces: Sequence[Stroke], earlier: list[np.ndarray], spread: tuple[float, float]) -> list[Stroke]:
    """The strokes without unstable parts that lie upon earlier ones: dashes upon dashes would look like a solid line.

    A branch that goes through its parent comes back as the same motion, shifted, at the same amplitude. `spread`: width
    and height of the frame. `earlier`, segments (m, 2, 2) drawn before in units of these, is added to.
    """
    kept: list[Stroke] = []
    for piece in pieces:
        if piece.stable is not False or piece.x.size < 2:
            kept.append(piece)
            continue
        own, fresh = _fresh(piece.x / spread[0], piece.y / spread[1], np.ones(piece.x.size - 1, dtype=bool), earlier)
        earlier.append(own)
        cuts = np.flatnonzero(np.diff(np.concatenate([[False], fresh, [False]])))
        kept += [Stroke(piece.x[a : b + 1], piece.y[a : b + 1], False) for a, b in cuts.reshape(-1, 2)]
    return kept


#: angle between two pieces that is a corner; in units of the frame, nearest vertices that are two, and length of the
#: pieces that are drawn
_CORNER, _SAME, _PIECE = 0.8, 1e-5, 5e-3


def bent(x: np.ndarray, y: np.ndarray, spread: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A line through vertices as it is drawn: through all of them, and smooth but for its corners (modified Akima).

    `spread`: width and height of the frame, in the units of x and y.
    """
    from scipy.interpolate import Akima1DInterpolator

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
    found = [path[:1]]
    for first, last in pairwise([0, *corners, len(path) - 1]):
        own = path[first : last + 1]
        if len(own) < 3:
            found.append(own[1:])
            continue
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(own, axis=0).T))])
        shares = [np.linspace(a, b, 1 + math.ceil((b - a) / _PIECE))[1:] for a, b in pairwise(along)]
        drawn = Akima1DInterpolator(along, own, method="makima")(np.concatenate(shares))
        # the vertices themselves, without rounding
        drawn[np.cumsum([len(share) for share in shares]) - 1] = own[1:]
        found.append(drawn)
    whole = np.concatenate(found) * spread
    whole[0], whole[-1] = (x[vertices[0]], y[vertices[0]]), (x[-1], y[-1])
    return whole[:, 0], whole[:, 1]


def repeated(whole: Line) -> np.ndarray:
    """(vertices - 1,) whether a piece of the line is unstable and lies upon an earlier one that is."""
    if whole.stable is None or whole.stable.size == 0:
        return np.zeros(max(whole.x.size - 1, 0), dtype=bool)
    x, y = (v / ((np.nanmax(v) - np.nanmin(v)) or 1.0) for v in (whole.x, whole.y))
    result: np.ndarray = ~whole.stable & ~_fresh(x, y, ~whole.stable, [])[1]
    return result


def _fresh(
    x: np.ndarray, y: np.ndarray, dashed: np.ndarray, earlier: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The segments (m, 2, 2) of a line, and whether each lies apart from `earlier` ones and its own earlier dashed."""
    path = np.column_stack([x, y])
    own = np.stack([path[:-1], path[1:]], axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    fresh = np.ones(len(own), dtype=bool)
    for i in np.flatnonzero(dashed):
        there = np.concatenate([*earlier, own[dashed & (along[1:] < along[i] - _ANOTHER)]])
        probes = np.array([own[i, 0], own[i].mean(axis=0), own[i, 1]])
        fresh[i] = not len(there) or _distance(probes, there).max() > _UPON
    return own, fresh


def _distance(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Distance of each point (p, 2) from the nearest of the segments (m, 2, 2)."""
    begin, way = segments[:, 0], segments[:, 1] - segments[:, 0]
    offset = points[:, None] - begin
    length = np.maximum(np.sum(way**2, axis=1), 1e-300)
    share = np.clip(np.sum(offset * way, axis=2) / length, 0.0, 1.0)
    nearest: np.ndarray = np.linalg.norm(offset - share[:, :, None] * way, axis=2).min(axis=1)
    return nearest
