"""A response curve as strokes of one stability each, cut exactly where the bifurcations were located.

The points of a curve and its events form one line: point i, the events that lie after it, point i + 1. A stroke ends at
an event, not at the computed point nearest to it, so that a dash begins at the marker.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class _Vertices:
    """Vertices `at`, (axes, vertices), of which `x` and `y` are the first and the last row.

    `point` and `event`, (vertices,): the index of the point or event of the curve at each, else -1.
    """

    at: np.ndarray
    point: np.ndarray
    event: np.ndarray

    @property
    def x(self) -> np.ndarray:
        row: np.ndarray = self.at[0]
        return row

    @property
    def y(self) -> np.ndarray:
        row: np.ndarray = self.at[-1]
        return row


@dataclass(frozen=True)
class Line(_Vertices):
    """The points of a curve and its events as one line.

    `stable`, (vertices - 1,): whether the motions between two vertices are (None: not computed).
    """

    stable: np.ndarray | None


@dataclass(frozen=True)
class Stroke(_Vertices):
    """A stretch of a curve on which all motions are stable or none is (None: not computed)."""

    stable: bool | None

    def part(self, first: int, last: int) -> Stroke:
        """The vertices first .. last."""
        here = slice(first, last + 1)
        return Stroke(self.at[:, here], self.point[here], self.event[here], self.stable)


def line(dataset: xarray.Dataset, x: str, y: str = "amplitude") -> Line:
    """The curve over parameter `x`; `y` is a variable of the dataset."""
    horizontal, event_horizontal = coordinate(dataset, x)
    points, events = (horizontal, dataset[y].to_numpy()), (event_horizontal, dataset[f"event_{y}"].to_numpy())
    return line_through(dataset, np.array(points), np.array(events))


def cut(dataset: xarray.Dataset, whole: Line) -> list[Stroke]:
    """The line of a curve, cut where stability changes."""
    drawn = Stroke(whole.at, whole.point, whole.event, None)
    if whole.stable is None:
        return [drawn]
    if whole.stable.size == 0:
        return [replace(drawn, stable=bool(dataset["stable"].to_numpy().all()))]
    ends = [0, *(np.flatnonzero(np.diff(whole.stable)) + 1), whole.stable.size]
    return [replace(drawn, stable=bool(whole.stable[first])).part(first, last) for first, last in pairwise(ends)]


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
    verdict = None
    if "stable" in dataset:
        stable, stable_after = dataset["stable"].to_numpy().astype(bool), dataset["event_stable_after"].to_numpy()
        verdict = _pieces(stable, after[order], stable_after[order], position, event_position)
    return Line(at, point, event, verdict)


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
        path = piece.at.T / spread
        own = np.stack([path[:-1], path[1:]], axis=1)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        fresh = np.ones(len(own), dtype=bool)
        for i in range(len(own)):
            there = np.concatenate([*earlier, own[along[1:] < along[i] - _ANOTHER]])
            probes = np.array([own[i, 0], own[i].mean(axis=0), own[i, 1]])
            fresh[i] = not len(there) or _distance(probes, there).max() > _UPON
        earlier.append(own)
        cuts = np.flatnonzero(np.diff(np.concatenate([[False], fresh, [False]])))
        kept += [piece.part(a, b) for a, b in cuts.reshape(-1, 2)]
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
    parts = [path[:1]]
    for first, last in pairwise([0, *corners, len(path) - 1]):
        own = path[first : last + 1]
        if len(own) < 3:
            parts.append(own[1:])
            continue
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(own, axis=0).T))])
        shares = [np.linspace(a, b, 1 + math.ceil((b - a) / _PIECE))[1:] for a, b in pairwise(along)]
        drawn = Akima1DInterpolator(along, own, method="makima")(np.concatenate(shares))
        # the vertices themselves, without rounding
        drawn[np.cumsum([len(share) for share in shares]) - 1] = own[1:]
        parts.append(drawn)
    whole = np.concatenate(parts) * spread
    whole[0], whole[-1] = (x[vertices[0]], y[vertices[0]]), (x[-1], y[-1])
    return whole[:, 0], whole[:, 1]


def _distance(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Distance of each point (p, 2) from the nearest of the segments (m, 2, 2)."""
    begin, way = segments[:, 0], segments[:, 1] - segments[:, 0]
    offset = points[:, None] - begin
    length = np.maximum(np.sum(way**2, axis=1), 1e-300)
    share = np.clip(np.sum(offset * way, axis=2) / length, 0.0, 1.0)
    nearest: np.ndarray = np.linalg.norm(offset - share[:, :, None] * way, axis=2).min(axis=1)
    return nearest
