"""Words in a figure: the legend where it covers no curve, and short texts beside points where they cover least."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.transforms import Bbox


#: where a legend is tried inside a frame
_PLACES: tuple[Any, ...] = ("upper left", "upper right", "center left", "center right", "lower left", "lower right")
#: so that two columns fit into the width of a journal's column
_TIGHT: dict[str, Any] = {"handlelength": 2.0, "handletextpad": 0.5, "columnspacing": 1.0}
#: distances of a text from its point, nearest first; further away where everything near is taken
_DISTANCES = (1.0, 2.4, 3.8)
#: points kept clear between two texts, and, rather, between a text and the frame with its ticks
_CLEAR, _TICKS = 1.5, 4.0
_SIDES = ((1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1))


def place_legend(
    figure: Figure, frames: Sequence[Axes], entries: Mapping[str, Any], look: style.Look, *, grow: bool = False
) -> None:
    """Put the legend, names with their handles, into the first of `frames` that has room for it, else above them all.

    Where it stands above, `grow` adds its height to the figure's. Everything on the figure has its place then.
    """
    arrange(figure)  # a legend inside one of the frames moves nothing
    if not entries:
        return
    drawing = _frame_of(look, tight=grow)
    for axes in frames:
        pixels = _pixels(axes)
        legend = axes.legend(list(entries.values()), list(entries), **drawing)
        legend.set_zorder(6)
        for place in _PLACES:
            legend.set_loc(place)
            if _is_free(figure, axes, legend, pixels):
                return
        legend.remove()
    width, height = figure.get_size_inches()
    if grow:  # as high as it may become, so that the frames keep theirs while it is measured
        figure.set_size_inches(width, height + 2.0 * look.small / 72.0 * (len(entries) + 2))
    legend = fitting_legend(figure, entries, look, tight=grow, loc="outside upper center")
    if grow:
        figure.set_size_inches(width, height + legend.get_window_extent().height / figure.dpi)
        arrange(figure)


def arrange(figure: Figure) -> None:
    """Give everything on a figure its place, as drawing it would."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        engine.execute(figure)


def fitting_legend(
    figure: Figure, entries: Mapping[str, Any], look: style.Look, *, most: int = 4, tight: bool = False, **where: Any
) -> Legend:
    """The legend of a figure in as many columns as the page is wide, `most` at most; `where` as Matplotlib takes it."""
    for columns in range(max(1, min(len(entries), most)), 0, -1):
        options = _frame_of(look, tight) | where
        legend = figure.legend(list(entries.values()), list(entries), ncols=columns, **options)
        arrange(figure)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()
    return legend


def _frame_of(look: style.Look, tight: bool) -> dict[str, Any]:
    frame = {"fontsize": look.small, "frameon": True, "framealpha": 1.0, "edgecolor": style.GRID, "handlelength": 2.6}
    return frame | (_TIGHT if tight else {})


def _is_free(figure: Figure, axes: Axes, legend: Legend, pixels: np.ndarray) -> bool:
    """Whether a legend is inside the frame, leaves room for something else, and covers nothing."""
    box = legend.get_window_extent().padded(figure.dpi / 72.0 * style.MARKER_SIZE)
    frame = axes.get_window_extent()
    if box.x0 < frame.x0 - 1 or box.x1 > frame.x1 + 1 + 2 * style.MARKER_SIZE or box.height > 0.7 * frame.height:
        return False
    return not box.count_contains(pixels)


def annotate(figure: Figure, axes: Axes, places: np.ndarray, texts: Sequence[str], look: style.Look) -> None:
    """Write `texts` beside `places`, (texts, 2) in data coordinates; the same text at the same place once.

    Of the sides of a point the one is taken on which the text covers the fewest lines, markers and other texts.
    """
    if not len(texts):
        return
    points = axes.transData.transform(np.asarray(places, dtype=float))
    pixels = _pixels(axes)
    unit, window = figure.dpi / 72.0, axes.get_window_extent()
    within = window.padded(-_TICKS * unit)
    legend = axes.get_legend()
    boxes = [] if legend is None else [legend.get_window_extent()]
    gap, clear = 0.75 * style.MARKER_SIZE * look.marker, _CLEAR * unit
    done: list[tuple[str, np.ndarray]] = []
    for text, point in zip(texts, points, strict=True):
        if any(text == other and np.hypot(*(point - there)) < 3.0 * unit for other, there in done):
            continue
        done.append((text, point))
        probe = axes.text(0.0, 0.0, text, fontsize=look.small)
        size = probe.get_window_extent()
        probe.remove()
        best: tuple[float, tuple[int, int], float] | None = None
        for distance, (rank, side) in product(_DISTANCES, enumerate(_SIDES)):
            reach = distance * gap
            box = _beside(point, side, size.width, size.height, reach * unit)
            cost = 2.0 * box.count_contains(pixels) + 400.0 * box.padded(clear).count_overlaps(boxes)
            cost += 400.0 * _leaves(box, window) + 25.0 * _leaves(box, within) + 0.1 * rank + 5.0 * (distance - 1.0)
            if best is None or cost < best[0]:
                best = (cost, side, reach)
        assert best is not None
        _, side, reach = best
        boxes.append(_beside(point, side, size.width, size.height, reach * unit))
        axes.annotate(
            text,
            tuple(axes.transData.inverted().transform(point)),
            xytext=_offset(side, reach),
            textcoords="offset points",
            ha=("center", "left", "right")[side[0]],
            va=("center", "bottom", "top")[side[1]],
            fontsize=look.small,
            color=style.INK,
            zorder=7,
            annotation_clip=False,
            gid="label",
        )


def _offset(side: tuple[int, int], gap: float) -> tuple[float, float]:
    share = 0.75 if side[0] and side[1] else 1.0
    return side[0] * gap * share, side[1] * gap * share


def _beside(point: np.ndarray, side: tuple[int, int], width: float, height: float, gap: float) -> Bbox:
    """The box of a text on one side of a point."""
    from matplotlib.transforms import Bbox

    across, up = _offset(side, gap)
    x = point[0] + across - (0.5, 0.0, 1.0)[side[0]] * width
    y = point[1] + up - (0.5, 0.0, 1.0)[side[1]] * height
    return Bbox.from_bounds(x, y, width, height)


def _pixels(axes: Axes) -> np.ndarray:
    """Pixels (points, 2) along all lines and markers: a long piece may cross a box that holds none of its ends."""
    pixels = [np.empty((0, 2))]
    for item in axes.get_lines():
        data = np.column_stack([item.get_xdata(), item.get_ydata()]).astype(float)
        path = item.get_transform().transform(data[np.isfinite(data).all(axis=1)])
        if len(path) == 0:
            continue
        if item.get_linestyle() == "None":
            reach = 0.35 * item.get_markersize() * axes.figure.dpi / 72.0
            pixels += [path + reach * np.array(side) for side in ((0, 0), *_SIDES)]
            continue
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        dense = np.linspace(0.0, along[-1], int(along[-1]) + 2)
        pixels.append(np.column_stack([np.interp(dense, along, column) for column in path.T]))
    return np.concatenate(pixels)


def _leaves(box: Bbox, frame: Bbox) -> bool:
    return not (frame.contains(*box.min) and frame.contains(*box.max))
