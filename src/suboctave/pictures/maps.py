"""Maps of a plane of parameters: which stable motions coexist, by colour, with borders; where isolas exist.

The colour of a regime is that of the longest period among its motions, as in all pictures, the paler the more motions
there are beside it; motions of the load's period alone are grey, the darker the more there are. Dots say that one of
the motions lies on an isola.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any, TypeAlias

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import DOTS, Axis, Entry, Frame, Polyline, Raster, Region
from suboctave.pictures.paper import Layout, picture
from suboctave.pictures.strokes import check_count
from suboctave.pictures.style import Pen, period_colour, rgb, tinted

Motions = Sequence[tuple[int, bool]]
#: what a regime is called, its motions, what was not followed
Regime = tuple[str, Motions, Motions]
Line = tuple[str, np.ndarray, np.ndarray]
_Rank: TypeAlias = "tuple[tuple[int, bool], int, tuple[tuple[int, ...], tuple[int, ...]]]"

#: shares of white: of T alone by the number of motions, of others by how many regimes of that period there are
_GREYS = (0.93, 0.78, 0.66, 0.55)
_PALE = (0.15, 0.75)
_UNKNOWN = "#3d3d3d"
_DASHES: dict[str, style.Dash] = {"PD": (0, (3.2, 1.4)), "NS": (0, (1.0, 1.0)), "BP": (0, (5.0, 1.4, 1.0, 1.4))}


@picture((7.4, 4.6), legend="beside", grid=False)
def plot_regimes(
    cells: np.ndarray,
    regimes: Sequence[Regime],
    lines: Sequence[Line],
    ranges: tuple[tuple[float, float], tuple[float, float]],
    names: tuple[str, str],
    *,
    curves: bool = True,
    labels: Sequence[str] | None = None,
    smallest: float = 5e-4,
    missing: str = "",
) -> Layout:
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
        Of the plane, to the right, where omega is, and upwards.
    labels
        What the legend calls the regimes, in their order.
    smallest
        Regimes with a smaller share of the plane are counted in the legend, not named.
    missing
        Why the map is not complete, the first line of the legend.
    """
    check_count("labels", labels, len(regimes), "regimes")
    colours = _colours(regimes)
    isolated = np.array([any(on for own in regime[1:] for _, on in own) for regime in regimes], dtype=bool)
    across, upwards = (np.linspace(*own, count + 1) for own, count in zip(ranges, cells.shape[::-1], strict=True))
    image = np.array([rgb(colour) for colour in colours]).reshape(-1, 3)[cells]
    dotted = isolated[cells] if len(regimes) else np.zeros(cells.shape, dtype=bool)

    frame = Frame([Raster(image, across, upwards, {DOTS: dotted}, layer=0.0)])
    if missing:
        frame.entries[missing] = Entry()
    for number in sorted(range(len(regimes)), key=lambda i: (_rank(regimes[i]), isolated[i])):
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
    axes = Axis(names[0], *ranges[0], shows="omega"), Axis(names[1], *ranges[1])
    return frame, axes


# ------------------------------------------------------------------------------------------------------------- colours
def _colours(regimes: Sequence[Regime]) -> list[str]:
    """A colour for each regime; those that differ by an isola alone share theirs."""
    colours: dict[_Rank, str] = {}
    for (nu, beyond), ranks in groupby(sorted({_rank(regime) for regime in regimes}), key=itemgetter(0)):
        group = list(ranks)
        dark = "#" + "".join(f"{round(0.45 * 255.0 * part):02x}" for part in rgb(period_colour(nu)))
        for place, rank in enumerate(group):
            share = _PALE[0] + (_PALE[1] - _PALE[0]) * place / max(len(group) - 1, 1)
            colours[rank] = tinted(dark if beyond else period_colour(nu), share)
            if nu <= 1:
                colours[rank] = tinted("#000000", _GREYS[min(len(rank[2][0]), len(_GREYS)) - 1]) if nu else _UNKNOWN
    return [colours[_rank(regime)] for regime in regimes]


def _rank(regime: Regime) -> _Rank:
    """The longest period of its motions, and whether it stands for ones that were not followed; how many they are;
    their periods, and of those that were not followed.
    """
    known, beyond = (tuple(nu for nu, _ in motions) for motions in regime[1:])
    top = (max(beyond), True) if beyond else (max(known, default=0), False)
    return top, len(known) + len(beyond), (known, beyond)


# -------------------------------------------------------------------------------------------------------------- isolas
#: share of white in a region
_PALE_ISOLA = 0.72
#: its borders; a bound of the search is no border of nature
_BORDERS = {
    "birth (isola centre)": Pen("#009E73", 1.3),
    "merging": Pen("#D55E00", 1.3, style.UNSTABLE_DASH),
    "end": Pen(style.INK),
    "bounds": Pen(style.SOFT, 0.8, (0, (1.2, 1.2))),
}
_Outline = tuple[np.ndarray, np.ndarray, np.ndarray]


@picture((6.4, 4.2))
def plot_isola_map(
    regions: Sequence[tuple[str, _Outline, Sequence[Sequence[Line]]]],
    names: tuple[str, str],
    *,
    bounds: tuple[float, float],
) -> Layout:
    """Shaded regions over two design parameters, `names` to the right and upwards.

    Parameters
    ----------
    regions
        For each the period of its motions ("2T"); its outline (values to the right, lower and upper end); the pieces of
        its lower and of its upper border (what it is, to the right, upwards).
    bounds
        What is shown of the parameter to the right.
    """
    frame = Frame()
    for period, (values, low, high), borders in regions:
        colour = tinted(period_colour(1 if period == "T" else int(period[:-1])), _PALE_ISOLA)
        outline = np.array([[*values, *values[::-1]], [*low, *high[::-1]]])
        frame.add(Region(outline, colour, role="isola", layer=1.0), f"{period} isola")
        for words, x, y in (piece for pieces in borders for piece in pieces):
            frame.add(Polyline(np.array([x, y]), _BORDERS[words], role=words), words)
    upwards: Any = (None, None)
    if frame.items:
        every = [i.outline if isinstance(i, Region) else i.at for i in frame.items if isinstance(i, Region | Polyline)]
        bottom, top = (float(end(np.concatenate(every, axis=1)[1])) for end in (np.nanmin, np.nanmax))
        upwards = bottom - 0.12 * (top - bottom), top + 0.12 * (top - bottom)
    return frame, (Axis(names[0], *bounds), Axis(names[1], *upwards))
