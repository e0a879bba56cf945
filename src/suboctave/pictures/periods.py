"""Motions of several periods in one frame: each period has its colour, the same in every picture.

`T` is the period of the load. A motion of period nu T has the colour of nu, wherever it is drawn; so has its part at
frequencies k omega / nu in a spectrum. Curves of one period that differ otherwise (in a parameter, or in the names that
their user gave them) differ in tint, width and dashes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from suboctave.pictures import style
from suboctave.pictures.style import Pen, places_among, tinted

if TYPE_CHECKING:
    import xarray


# Okabe and Ito's; those of T, 2T, 3T, 4T and 8T stay apart for every kind of colour blindness. The last five, which
# time integration meets, are at least as far from these and each other as any two of the first
_OF_PERIODS = {
    1: style.INK, 2: "#0072B2", 4: "#E69F00", 8: "#56B4E9", 3: "#D55E00", 6: "#009E73", 5: "#CC79A7",
    7: "#6A3D9A", 9: "#7F1D1D", 10: "#808000", 12: "#B5179E", 16: "#9ACD32",
}  # fmt: skip
#: share of white in the colours of all other periods, which take turns
_OTHERS = 0.5
#: share of white in the colours of the second and third curve of one period
_TINTS = (0.0, 0.45, 0.25)


def period_name(nu: int) -> str:
    """T, 2T, 3T, ..."""
    return "T" if nu == 1 else f"{nu}T"


def period_colour(nu: int) -> str:
    """The colour of motions of nu load periods; those of one subharmonic order keep it in every picture."""
    return _OF_PERIODS.get(nu) or tinted(list(_OF_PERIODS.values())[1 + nu % (len(_OF_PERIODS) - 1)], _OTHERS)


def styles_of_periods(periods: Sequence[int], names: Sequence[str]) -> list[Pen]:
    """The styles of curves by their periods; those of one period and one name look alike."""
    styles = []
    for nu, place in zip(periods, places_among(periods, names), strict=True):
        like = style.curve_style(place)
        styles.append(Pen(tinted(period_colour(nu), _TINTS[place % len(_TINTS)]), like.width, like.dash))
    return styles


def several_periods(datasets: Sequence[xarray.Dataset]) -> bool:
    """Whether the periods of motions are to be shown: one of them is not that of the load."""
    return any(period_of(dataset) != 1 for dataset in datasets)


def period_of(dataset: xarray.Dataset) -> int:
    """Load periods in one period of the motions of a dataset."""
    return int(dataset.attrs.get("period", 1))


def curve_styles(datasets: Sequence[xarray.Dataset], names: Sequence[str], by_period: bool | None = None) -> list[Pen]:
    """The styles of the curves of one frame: by period (default: where one is not that of the load), or in turn."""
    if several_periods(datasets) if by_period is None else by_period:
        return styles_of_periods([period_of(dataset) for dataset in datasets], names)
    if len(datasets) == 1:
        return [style.ONE_CURVE]
    return [style.curve_style(index) for index in range(len(datasets))]
