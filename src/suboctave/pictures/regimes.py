"""The plane of omega and a design parameter, coloured by the stable motions that coexist, with their borders on top.

The colour is that of the longest period among the motions, as in all pictures, the paler the more motions there are
beside it; motions of the load's period alone are grey, the darker the more there are. Dots say that one of the motions
lies on an isola.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import DOTS, Axis, Entry, Frame, Polyline, Raster
from suboctave.pictures.options import PageOptions
from suboctave.pictures.paper import single
from suboctave.pictures.strokes import check_count
from suboctave.pictures.style import Pen, period_colour, rgb, tinted

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Motions = Sequence[tuple[int, bool]]
#: what a regime is called, its motions, what was not followed
Regime = tuple[str, Motions, Motions]
Line = tuple[str, np.ndarray, np.ndarray]

#: shares of white: of T alone by the number of motions, of others by how many regimes of that period there are
_GREYS = (0.93, 0.78, 0.66, 0.55)
_PALE = (0.15, 0.75)
_UNKNOWN = "#3d3d3d"
_DASHES: dict[str, style.Dash] = {"PD": (0, (3.2, 1.4)), "NS": (0, (1.0, 1.0)), "BP": (0, (5.0, 1.4, 1.0, 1.4))}


@with_options(PageOptions)
def plot_regimes(
    cells: np.ndarray,
    regimes: Sequence[Regime],
    lines: Sequence[Line],
    ranges: tuple[tuple[float, float], tuple[float, float]],
    names: tuple[str, str],
    path: str | Path | None = None,
    *,
    curves: bool = True,
    labels: Sequence[str] | None = None,
    smallest: float = 5e-4,
    xlabel: str | None = None,
    ylabel: str | None = None,
    **page: Unpack[PageOptions],
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
    check_count("labels", labels, len(regimes), "regimes")
    colours = _colours(regimes)
    isolated = np.array([_isolated(regime) for regime in regimes], dtype=bool)
    across, upwards = (np.linspace(*own, count + 1) for own, count in zip(ranges, cells.shape[::-1], strict=True))
    image = np.array([rgb(colour) for colour in colours]).reshape(-1, 3)[cells]
    dotted = isolated[cells] if len(regimes) else np.zeros(cells.shape, dtype=bool)

    def rank(regime: Regime) -> tuple[Any, ...]:
        key = _key(regime)
        return _top(key), len(key[0]) + len(key[1]), key, _isolated(regime)

    frame = Frame([Raster(image, across, upwards, {DOTS: dotted}, layer=0.0)])
    for number in sorted(range(len(regimes)), key=lambda i: rank(regimes[i])):
        if np.count_nonzero(cells == number) > smallest * cells.size:
            hatch = DOTS if isolated[number] else ""
            words = regimes[number][0] if labels is None else labels[number]
            frame.entries[words] = Entry(patch=colours[number], edge=style.SOFT, hatch=hatch)
    unnamed = len(np.unique(cells)) - len(frame.entries)
    if unnamed > 0:
        frame.entries[f"({unnamed} smaller ones)"] = Entry()
    for kind, x, y in lines if curves else ():
        pen = Pen(style.INK, 0.65, _DASHES.get(kind, style.STABLE_DASH))
        frame.add(Polyline(np.array([x, y]), pen, role=kind), style.kind_style(kind).name)
    axes = Axis(xlabel or names[0], *ranges[0]), Axis(ylabel or names[1], *ranges[1])
    return single(frame, axes, page, path, (7.4, 4.6), legend="beside", grid=False)


# ------------------------------------------------------------------------------------------------------------- colours
def _colours(regimes: Sequence[Regime]) -> list[str]:
    """A colour for each regime; those that differ by an isola alone share theirs."""
    alike = {_key(regime) for regime in regimes}
    colours: dict[tuple[tuple[int, ...], tuple[int, ...]], str] = {((), ()): _UNKNOWN}
    for top in {_top(key) for key in alike if key != ((), ())}:
        group = sorted((key for key in alike if _top(key) == top), key=lambda k: (len(k[0]) + len(k[1]), k))
        for place, key in enumerate(group):
            nu, beyond = top
            if nu == 1:
                colours[key] = tinted("#000000", _GREYS[min(len(key[0]), len(_GREYS)) - 1])
                continue
            dark = "#" + "".join(f"{round(0.45 * 255.0 * part):02x}" for part in rgb(period_colour(nu)))
            share = _PALE[0] + (_PALE[1] - _PALE[0]) * place / max(len(group) - 1, 1)
            colours[key] = tinted(dark if beyond else period_colour(nu), share)
    return [colours[_key(regime)] for regime in regimes]


def _key(regime: Regime) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The periods of its motions, and of those that were not followed."""
    _, known, beyond = regime
    return tuple(nu for nu, _ in known), tuple(nu for nu, _ in beyond)


def _top(key: tuple[tuple[int, ...], tuple[int, ...]]) -> tuple[int, bool]:
    """The longest period, and whether it stands for motions that were not followed."""
    known, beyond = key
    return (max(beyond), True) if beyond else (max(known, default=0), False)


def _isolated(regime: Regime) -> bool:
    return any(isolated for motions in regime[1:] for _, isolated in motions)
