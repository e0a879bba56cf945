"""Sweeps: quantities over one parameter, as maps over two, as a matrix of scatter plots over more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import plain
from suboctave.pictures.paper import dress, save_or_show

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: inches of a frame: over one parameter, of a map, of a scatter plot; map of colours from least to largest
_OVER_ONE, _MAP, _SCATTER = (6.4, 2.3), (4.6, 3.5), (2.4, 1.9)
_COLOURS = "viridis"


def plot_points(
    columns: Mapping[str, np.ndarray],
    parameters: Sequence[str],
    quantities: Sequence[str],
    path: str | Path | None = None,
    *,
    title: str | None = None,
    size: tuple[float, float] | str | None = None,
) -> Figure:
    """Quantities of points over parameters, both named columns (points,), saved to `path` where one is given.

    Over one parameter a frame for each quantity, over two a map of each: cells where the points are a whole grid, else
    coloured places; over more a frame for each quantity and parameter. Points without a value are crosses at the edge,
    or in a map.
    """
    rows, across, each = len(quantities), len(parameters), _SCATTER
    if across < 3:
        each = _OVER_ONE if across == 1 else _MAP
        rows, across = (rows, 1) if across == 1 or rows == 1 else ((rows + 1) // 2, 2)
    sheet = style.sheet_of((each[0] * across, each[1] * rows) if size is None else size, across)

    def fill(figure: Figure) -> None:
        figure.set_layout_engine("constrained")
        shared: dict[str, Any] = {} if len(parameters) == 2 else {"sharex": "col", "sharey": "row"}
        frames = figure.subplots(rows, across, squeeze=False, **shared)
        if title:
            figure.suptitle(plain(title), fontsize=sheet.look.large)
        if len(parameters) == 2:
            for axes, quantity in zip(frames.ravel(), quantities, strict=False):
                _map(figure, axes, columns, (parameters[0], parameters[1]), quantity, sheet.look)
            for axes in frames.ravel()[len(quantities) :]:
                axes.set_visible(False)
            return
        for row, quantity in enumerate(quantities):
            for place, parameter in enumerate(parameters):
                _over(frames[row, place], columns[parameter], columns[quantity], len(parameters) == 1)
                texts = parameter if row == rows - 1 else "", quantity if place == 0 else ""
                dress(frames[row, place], (plain(texts[0]), plain(texts[1])), _letters(sheet.look))
                frames[row, place].locator_params(nbins=8 if len(parameters) == 1 else 4)

    return save_or_show(fill, sheet, path)


def _letters(look: style.Look) -> style.Look:
    """Names of quantities are long: they are written as small as numbers."""
    return replace(look, large=look.normal)


def _over(axes: Axes, x: np.ndarray, y: np.ndarray, joined: bool) -> None:
    """Points, joined in the order of the parameter where it is the only one; crosses below where there is no value."""
    order = np.argsort(x, kind="stable")
    x, y = x[order], np.asarray(y, dtype=float)[order]
    known = np.isfinite(y)
    look: dict[str, Any] = {"color": style.CURVE_COLOURS[0]}
    axes.plot(x, y, "o-" if joined else "o", markersize=3.5, linewidth=1.0, **look)
    if not known.all():
        axes.plot(x[~known], np.zeros(np.count_nonzero(~known)), "x", color=style.SOFT, markersize=4.0,
                  transform=axes.get_xaxis_transform(), clip_on=False)  # fmt: skip


def _map(
    figure: Figure,
    axes: Axes,
    columns: Mapping[str, np.ndarray],
    parameters: tuple[str, str],
    quantity: str,
    look: style.Look,
) -> None:
    """A quantity over the plane of two parameters, with its colours."""
    from matplotlib.ticker import MaxNLocator

    x, y = (columns[name] for name in parameters)
    values = np.asarray(columns[quantity], dtype=float)
    known = np.isfinite(values)
    across, upwards = np.unique(x), np.unique(y)
    drawn: Any
    if len(across) * len(upwards) == len(x) and min(len(across), len(upwards)) > 1:
        cells = np.full((len(upwards), len(across)), np.nan)
        cells[np.searchsorted(upwards, y), np.searchsorted(across, x)] = values
        drawn = axes.pcolormesh(across, upwards, cells, cmap=_COLOURS, shading="nearest", rasterized=True)
    else:
        drawn = axes.scatter(x[known], y[known], c=values[known], cmap=_COLOURS, s=18.0)
    if not known.all():
        axes.plot(x[~known], y[~known], "x", color=style.SOFT, markersize=4.0)
    bar = figure.colorbar(drawn, ax=axes)
    bar.set_label(plain(quantity), fontsize=look.normal)
    bar.ax.tick_params(labelsize=look.small)
    if not np.any(values[known] % 1.0):  # a count
        bar.locator = MaxNLocator(nbins=6, integer=True)
        bar.update_ticks()
    dress(axes, (plain(parameters[0]), plain(parameters[1])), look, grid=False)
