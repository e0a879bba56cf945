"""The one legend of a figure: inside the frame that has room for it, else above all frames; it covers no curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

__all__ = ["TIGHT", "ordered", "place_legend"]

#: so that two columns fit into the width of a journal's column
TIGHT: dict[str, Any] = {"handlelength": 2.0, "handletextpad": 0.5, "columnspacing": 1.0}


def place_legend(
    figure: Figure, frames: Sequence[Axes], entries: dict[str, Line2D], look: style.Look, *, grow: bool = False
) -> None:
    """Put the legend where there is room for it; where it stands above the frames, `grow` adds its height to theirs."""
    if not entries:
        return
    drawing: dict[str, Any] = {
        "fontsize": look.small,
        "frameon": True,
        "framealpha": 1.0,
        "edgecolor": style.GRID,
        "handlelength": 2.6,
    }
    if grow:
        drawing |= TIGHT
    figure.draw_without_rendering()  # places the frames; a legend inside one of them moves nothing
    for axes in frames:
        for location in ("upper left", "upper right", "center left", "center right", "lower left", "lower right"):
            legend = axes.legend(entries.values(), entries.keys(), loc=location, **drawing)
            legend.set_zorder(6)
            if not _covers(figure, axes, legend):
                return
            legend.remove()
    columns = min(len(entries), 4)
    width, height = figure.get_size_inches()
    while True:
        if grow:  # as high as it may become, so that the frames keep theirs while it is measured
            figure.set_size_inches(width, height + 2.0 * look.small / 72.0 * (len(entries) // columns + 2))
        legend = figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=columns, **drawing)
        figure.draw_without_rendering()
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            if grow:
                figure.set_size_inches(width, height + legend.get_window_extent().height / figure.dpi)
            return
        legend.remove()
        columns -= 1


def _covers(figure: Figure, axes: Axes, legend: Legend) -> bool:
    box = legend.get_window_extent().padded(figure.dpi / 72.0 * style.MARKER_SIZE)
    frame = axes.get_window_extent()
    if box.x0 < frame.x0 - 1 or box.x1 > frame.x1 + 1 + 2 * style.MARKER_SIZE or box.height > 0.7 * frame.height:
        return True  # it would stick out, or leave no room for anything else
    for line in axes.get_lines():
        x, y = line.get_transform().transform(np.column_stack([line.get_xdata(), line.get_ydata()])).T
        if x.size == 0:
            continue
        # Points every pixel or so along the line: a long piece may cross a box that holds none of its ends.
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        if line.get_linestyle() != "None" and length[-1] > 0.0:
            dense = np.linspace(0.0, length[-1], int(length[-1]) + 2)
            x, y = np.interp(dense, length, x), np.interp(dense, length, y)
        if np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)):
            return True
    return False


def ordered(entries: dict[str, Line2D]) -> dict[str, Line2D]:
    """Curves first, then stable and unstable, then the kinds in the order of the style table, then a user's own."""
    lines = ["stable", "unstable"]
    kinds = [name for look in style.KINDS.values() for name in (look.name, f"{look.name}{style.SUBCRITICAL}")]

    def rank(name: str) -> tuple[int, int]:
        if name in lines:
            return 1, lines.index(name)
        if name in kinds:
            return 2, kinds.index(name)
        return (0, 0) if entries[name].get_marker() == "None" else (3, 0)

    return {name: entries[name] for name in sorted(entries, key=rank)}
