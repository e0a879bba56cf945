"""Where legends and texts stand on paper: a legend where it covers no curve, texts where they cover least."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import Frame, Label, Markers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.transforms import Bbox


#: so many events whose markers lie upon each other are counted beside them
_CROWD = 4
#: where a legend is tried inside a frame
_PLACES: tuple[Any, ...] = ("upper left", "upper right", "center left", "center right", "lower left", "lower right")
#: share of a frame's height from which a legend stands above it
_TALL = 0.7
#: so that two columns fit into the width of a journal's column
_TIGHT: dict[str, Any] = {"handlelength": 2.0, "handletextpad": 0.5, "columnspacing": 1.0}
#: distances of a text from its point, nearest first; further away where everything near is taken
_DISTANCES = (1.0, 2.4, 3.8, 5.2)
#: points kept clear between two texts, and, rather, between a text and the frame with its ticks
_CLEAR, _TICKS = 1.5, 4.0
_SIDES = ((1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1))


def arrange(figure: Figure) -> None:
    """Give everything on a figure its place, as drawing it would."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        engine.execute(figure)


def fitting_legend(
    figure: Figure, entries: Mapping[str, Any], sheet: style.Sheet, *, most: int = 4, **where: Any
) -> Legend:
    """The legend of a figure in as many columns as the page is wide, `most` at most; `where` as Matplotlib takes it."""
    for columns in range(max(1, min(len(entries), most)), 0, -1):
        legend = figure.legend(list(entries.values()), list(entries), ncols=columns, **box_of(sheet) | where)
        arrange(figure)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()
    return legend


def grow(figure: Figure, entries: Mapping[str, Any], sheet: style.Sheet) -> None:
    """Add the height of the legend to that of the figure: a named size is a width."""
    width, height = figure.get_size_inches()
    legend = fitting_legend(figure, entries, sheet)
    figure.set_size_inches(width, height + legend.get_window_extent().height / figure.dpi)
    legend.remove()


def legend_inside(axes: Axes, entries: Mapping[str, Any], sheet: style.Sheet) -> bool:
    """Whether there is a place for the legend inside a frame where it covers nothing; it stands there then."""
    if not entries:
        return True
    legend, frame = axes.legend(list(entries.values()), list(entries), **box_of(sheet)), axes.get_window_extent()
    legend.set_zorder(6)
    for place in _PLACES:
        legend.set_loc(place)
        box = legend.get_window_extent()
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and box.height < _TALL * frame.height
        if inside and not _covered(axes, box.padded(axes.figure.dpi / 72.0 * style.MARKER_SIZE)):
            return True
    legend.remove()
    return False


def box_of(sheet: style.Sheet) -> dict[str, Any]:
    frame = {"frameon": True, "framealpha": 1.0, "edgecolor": style.GRID, "handlelength": 2.6}
    return {"fontsize": sheet.look.small, **frame, **(_TIGHT if sheet.named else {})}


def annotate(axes: Axes, labels: Sequence[Label], look: style.Look) -> None:
    """Write texts beside their places; the same text at the same place once.

    Of the sides of a place the one is taken where the text is nearest and not nearer to the place of another text.
    Where it would cover a line, a marker or another text on every side, or leave the frame, it is left out: the marker
    and the legend say what is there.
    """
    unit, window, legend = axes.figure.dpi / 72.0, axes.get_window_extent(), axes.get_legend()
    taken = [] if legend is None else [legend.get_window_extent()]
    gap = 0.75 * style.MARKER_SIZE * look.marker
    looks: dict[str, Any] = {"fontsize": look.small, "color": style.INK, "zorder": 7, "gid": "label"}
    done: list[tuple[str, np.ndarray]] = []
    points = [axes.transData.transform(label.at) for label in labels]
    for label, point in zip(labels, points, strict=True):
        others = [there for other, there in zip(labels, points, strict=True) if other.text != label.text]
        again = any(label.text == text and np.hypot(*(point - there)) < 3.0 * unit for text, there in done)
        if again or not np.isfinite(point).all():
            continue
        done.append((label.text, point))
        at: dict[str, Any] = {"xy": label.at, "textcoords": "offset points", "annotation_clip": False}
        costs: dict[Any, float] = {}
        for distance, (rank, (across, up)) in product(_DISTANCES, enumerate(_SIDES)):
            reach = distance * gap * (0.75 if across and up else 1.0)
            sides: dict[str, Any] = {"ha": ("center", "left", "right")[across], "va": ("center", "bottom", "top")[up]}
            note = axes.annotate(label.text, xytext=(reach * across, reach * up), **at, **sides, **looks)
            box = note.get_window_extent()
            overlaps = box.padded(_CLEAR * unit).count_overlaps(taken)
            covers = bool(_covered(axes, box) or overlaps or _leaves(box, window))
            own = _distance(box, point)
            nearer = 200.0 * any(_distance(box, there) < own for there in others)
            at_ticks = 25.0 * _leaves(box, window.padded(-_TICKS * unit))
            costs[note] = math.inf if covers else nearer + at_ticks + 0.1 * rank + 5.0 * distance
        best = min(costs, key=lambda note: costs[note])
        for note in costs:
            if note is not best or math.isinf(costs[note]):
                note.remove()
        if math.isfinite(costs[best]):
            taken.append(best.get_window_extent())


def _distance(box: Bbox, point: np.ndarray) -> float:
    """From a point to a box, in pixels; zero inside."""
    return float(np.hypot(*np.maximum(np.maximum(box.min - point, point - box.max), 0.0)))


def _covered(axes: Axes, box: Bbox) -> int:
    """How many lines cross a box, in pixels, and markers lie in it."""
    count = 0
    for item in axes.get_lines():
        path = item.get_transform().transform_path(item.get_path())
        if item.get_linestyle() != "None":
            count += path.intersects_bbox(box, filled=False)
        else:
            reach = 0.35 * item.get_markersize() * axes.figure.dpi / 72.0
            count += box.padded(reach).count_contains(path.vertices)
    return count


def _leaves(box: Bbox, frame: Bbox) -> bool:
    return not (frame.contains(*box.min) and frame.contains(*box.max))


def crowds(axes: Axes, frame: Frame) -> list[Label]:
    """How many events there are at places where their markers hide each other."""
    from scipy.sparse.csgraph import connected_components

    seen = [item.at for item in frame.items if isinstance(item, Markers) and item.vertices is not None]
    every = np.concatenate(seen, axis=1).T if seen else np.empty((0, 2))
    every = every[np.isfinite(every).all(axis=1)]
    if len(every) < _CROWD:
        return []
    near = 0.5 * style.MARKER_SIZE * axes.figure.dpi / 72.0
    pixels = axes.transData.transform(every)
    count, groups = connected_components(np.hypot(*(pixels[:, np.newaxis] - pixels).T) <= near)
    crowds = [every[groups == number] for number in range(count)]
    return [
        Label(place, f"{len(own)} events at {place[0]:.4g}")
        for own in crowds
        if len(own) >= _CROWD
        for place in [own.mean(axis=0)]
    ]
