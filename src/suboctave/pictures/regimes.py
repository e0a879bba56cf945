"""The plane of omega and a design parameter, coloured by the stable motions that coexist, with their borders on top.

The colour is that of the longest period among the motions, as in all pictures, the paler the more motions there are
beside it; motions of the load's period alone are grey, the darker the more there are. Dots say that one of the motions
lies on an isola.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.periods import period_colour, tinted
from suboctave.pictures.response import dress
from suboctave.pictures.saving import save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_regimes"]

Motions = Sequence[tuple[int, bool]]
#: what a regime is called, its motions, what was not followed
Said = tuple[str, Motions, Motions]
Line = tuple[str, np.ndarray, np.ndarray]

#: shares of white: of T alone by the number of motions, of others by how many regimes of that period there are
_GREYS = (0.93, 0.78, 0.66, 0.55)
_PALE = (0.15, 0.75)
_UNKNOWN = "#3d3d3d"
#: millimetres between the dots of isolas, their size in points
_SPACING, _DOT = 2.6, 1.5
_DASHES: dict[str, Any] = {"PD": (0, (3.2, 1.4)), "NS": (0, (1.0, 1.0)), "BP": (0, (5.0, 1.4, 1.0, 1.4))}


def plot_regimes(
    cells: np.ndarray,
    regimes: Sequence[Said],
    lines: Sequence[Line],
    ranges: tuple[tuple[float, float], tuple[float, float]],
    names: tuple[str, str],
    path: str | Path | None = None,
    *,
    title: str | None = None,
    size: str | tuple[float, float] = (7.4, 4.6),
    curves: bool = True,
    labels: Sequence[str] | None = None,
    smallest: float = 5e-4,
    xlabel: str | None = None,
    ylabel: str | None = None,
) -> Figure:
    """Colour a raster of regimes.

    Parameters
    ----------
    cells
        Number of the regime of every cell, (rows, columns), from the lower left.
    regimes
        Of each what it is called, its motions and what was not followed: periods, and whether on an isola.
    lines
        Borders: kind of bifurcation, to the right, upwards; drawn if `curves`.
    ranges, names
        Of the plane, to the right and upwards.
    labels
        What the legend calls the regimes, in their order.
    smallest
        Regimes with a smaller share of the plane are counted in the legend, not named.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if labels is not None and len(labels) != len(regimes):
        raise InputError(f"labels: expected one for each of the {len(regimes)} regimes, got {len(labels)}")
    inches = style.size_in_inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    colours = _colours(regimes)
    image = np.array([_rgb(colour) for colour in colours])[cells]
    extent = (*ranges[0], *ranges[1])
    axes.imshow(image, origin="lower", extent=extent, aspect="auto", interpolation="nearest", zorder=0)
    handles: dict[str, Any] = {}
    dot: dict[str, Any] = {"marker": "o", "markersize": _DOT, "color": style.INK, "linestyle": "none"}
    for number in sorted(range(len(regimes)), key=lambda i: _rank(regimes[i])):
        words, known, beyond = regimes[number]
        if np.count_nonzero(cells == number) <= smallest * cells.size:
            continue
        swatch: Any = Patch(facecolor=colours[number], edgecolor=style.SOFT, linewidth=0.5)
        if _isolated(known, beyond):
            swatch = (swatch, Line2D([], [], **dot))
        handles[words if labels is None else labels[number]] = swatch
    shown = len({int(number) for number in np.unique(cells)})
    if len(handles) < shown:
        handles[f"({shown - len(handles)} smaller ones)"] = Line2D([], [], linestyle="none")
    for kind, x, y in lines if curves else ():
        drawing: dict[str, Any] = {"color": style.INK, "linewidth": 0.65 * look.line}
        drawing["linestyle"] = _DASHES.get(kind, "solid")
        axes.plot(x, y, zorder=3, **drawing)
        handles.setdefault(style.kind_style(kind).name, Line2D([], [], **drawing))
    axes.set_xlim(*ranges[0])
    axes.set_ylim(*ranges[1])
    dress(axes, xlabel or names[0], ylabel or names[1], look)
    axes.grid(False)
    if title:
        style.check_text(title)
        axes.set_title(title, fontsize=look.large, color=style.INK)
    wide = inches[0] >= 5.0
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside right upper" if wide else "outside lower center",
        ncols=1 if wide else 2,
        fontsize=look.small,
        frameon=False,
        handlelength=2.2,
        handleheight=1.1,
        handler_map={tuple: HandlerTuple(ndivide=1)},
    )
    figure.draw_without_rendering()  # places the frame, in which the dots are evenly spread
    marked = np.array([_isolated(known, beyond) for _, known, beyond in regimes], dtype=bool)
    _dots(axes, marked[cells] if len(marked) else np.zeros(cells.shape, dtype=bool), ranges, dot)
    if path is not None:
        save_figure(figure, path)
    return figure


def _dots(
    axes: Axes, inside: np.ndarray, ranges: tuple[tuple[float, float], tuple[float, float]], dot: dict[str, Any]
) -> None:
    """Dots over cells, evenly spread on paper."""
    if not inside.any():
        return
    box = axes.get_window_extent()
    per_dot = _SPACING / 25.4 * axes.figure.dpi
    columns, rows = max(8, round(box.width / per_dot)), max(8, round(box.height / per_dot))
    across, up = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    across = across + np.where(np.arange(rows) % 2, 0.25, -0.25)[:, None] / columns
    where = inside[(up * inside.shape[0]).astype(int), (across * inside.shape[1]).astype(int)]
    (first, last), (low, high) = ranges
    axes.plot(first + across[where] * (last - first), low + up[where] * (high - low), zorder=2, **dot)


# ------------------------------------------------------------------------------------------------------------- colours
def _colours(regimes: Sequence[Said]) -> list[str]:
    """A colour for each regime; those that differ by an isola alone share theirs."""
    alike = {_key(known, beyond) for _, known, beyond in regimes}
    found: dict[tuple[tuple[int, ...], tuple[int, ...]], str] = {((), ()): _UNKNOWN}
    for top in {_top(key) for key in alike if key != ((), ())}:
        group = sorted((key for key in alike if _top(key) == top), key=lambda k: (len(k[0]) + len(k[1]), k))
        for place, key in enumerate(group):
            nu, beyond = top
            if nu == 1:
                found[key] = tinted("#000000", _GREYS[min(len(key[0]), len(_GREYS)) - 1])
                continue
            share = _PALE[0] + (_PALE[1] - _PALE[0]) * place / max(len(group) - 1, 1)
            found[key] = tinted(_dark(period_colour(nu)) if beyond else period_colour(nu), share)
    return [found[_key(known, beyond)] for _, known, beyond in regimes]


def _key(known: Motions, beyond: Motions) -> tuple[tuple[int, ...], tuple[int, ...]]:
    return tuple(nu for nu, _ in known), tuple(nu for nu, _ in beyond)


def _top(key: tuple[tuple[int, ...], tuple[int, ...]]) -> tuple[int, bool]:
    """The longest period, and whether it stands for motions that were not followed."""
    known, beyond = key
    return (max(beyond), True) if beyond else (max(known, default=0), False)


def _rank(said: Said) -> tuple[Any, ...]:
    _, known, beyond = said
    key = _key(known, beyond)
    return _top(key), len(known) + len(beyond), key, _isolated(known, beyond)


def _isolated(known: Motions, beyond: Motions) -> bool:
    return any(isolated for _, isolated in (*known, *beyond))


def _dark(colour: str) -> str:
    return "#" + "".join(f"{round(0.45 * int(colour[i : i + 2], 16)):02x}" for i in (1, 3, 5))


def _rgb(colour: str) -> np.ndarray:
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
