"""Regions of two design parameters in which isolas exist: shaded, between the curves of birth and of merging."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.legend import place_legend
from suboctave.pictures.periods import period_colour, tinted
from suboctave.pictures.response import dress
from suboctave.pictures.saving import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_isola_map"]

Outline = tuple[np.ndarray, np.ndarray, np.ndarray]
Piece = tuple[str, np.ndarray, np.ndarray]

#: colour, width and dash of borders; a bound of the search is no border of nature
_LINES = {
    "birth (isola centre)": ("#009E73", 1.3, "solid"),
    "merging": ("#D55E00", 1.3, style.UNSTABLE_DASH),
    "end": (style.INK, 1.0, "solid"),
    "bounds": (style.SOFT, 0.8, (0, (1.2, 1.2))),
}
_SHADE = 0.72


def plot_isola_map(
    regions: Sequence[tuple[str, Outline, Sequence[Sequence[Piece]]]],
    names: tuple[str, str],
    path: str | Path | None = None,
    *,
    bounds: tuple[float, float],
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
    xlim: Sequence[float] | None = None,
    ylim: Sequence[float] | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
) -> Figure:
    """Shaded regions over two design parameters, `names` to the right and upwards.

    Parameters
    ----------
    regions
        For each the period of its motions ("2T"); its outline (values to the right, lower and upper end); the pieces of
        its lower and of its upper border (what it is, to the right, upwards).
    bounds
        What is shown of the parameter to the right, unless `xlim` says otherwise.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    inches = style.size_in_inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    entries: dict[str, Any] = {}
    for period, (values, low, high), borders in regions:
        colour = tinted(period_colour(1 if period == "T" else int(period[:-1])), _SHADE)
        axes.fill_between(values, low, high, color=colour, linewidth=0.0, zorder=1)
        entries[f"{period} isola"] = Patch(facecolor=colour, edgecolor="none")
        for pieces in borders:
            for words, x, y in pieces:
                ink, width, dash = _LINES[words]
                line: dict[str, Any] = {"color": ink, "linewidth": width * look.line, "linestyle": dash}
                axes.plot(x, y, zorder=3, **line)
                entries[words] = Line2D([], [], **line)
    axes.set_xlim(*(bounds if xlim is None else xlim))
    if ylim is not None:
        axes.set_ylim(*ylim)
    else:
        axes.margins(y=0.12)
    dress(axes, xlabel or names[0], ylabel or names[1], look)
    if title:
        style.check_text(title)
        axes.set_title(title, fontsize=look.large, color=style.INK)
    place_legend(figure, [axes], entries, look)
    if path is not None:
        save_figure(figure, path)
    return figure
