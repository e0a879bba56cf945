"""How things look: one palette that colour-blind readers can tell apart, one marker for each kind of bifurcation.

The colours are those of Okabe and Ito (*Color Universal Design*, 2008). Shape carries the kind on its own, so that
a black-and-white print loses nothing: circles for limit points and triangles for period doublings, as in Alcorta
et al. (Nonlinear Dynamics 98, 2019, Figs 6 and 7), squares for Neimark-Sacker, diamonds for branch points. Grazing
contacts, which need not change the response, are crosses beneath the others. Subcritical ones are hollow. Several
curves in one frame differ in colour, in width and in the dashes of their unstable parts, and each one's markers have
its colour at the edge.

Widths of "single-column" and "double-column" are 84 mm and 174 mm, which fit the columns of the journals of the field;
letters are then 7 to 8 points high.

Each period of motions has its colour, the same in every picture.
`T` is the period of the load. A motion of period nu T has the colour of nu, wherever it is drawn; so has its part at
frequencies k omega / nu in a spectrum. Curves of one period that differ otherwise (in a parameter, or in the names that
their user gave them) differ in tint, width and dashes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.kinds import KINDS as ROWS

if TYPE_CHECKING:
    import xarray


INK = "#1a1a1a"
SOFT = "#8c8c8c"
GRID = "#d9d9d9"
CURVE_COLOURS = ("#0072B2", "#E69F00", INK, "#009E73", "#CC79A7", "#56B4E9")  # then again from the first

Dash: TypeAlias = "str | tuple[float, tuple[float, ...]]"
STABLE_DASH: Dash = "solid"
OPEN_DASH: Dash = (0, (0.7, 1.5))
UNSTABLE_DASH: Dash = (0, (3.2, 1.6))  # in line widths: begins with a dash, so the change shows where it happens

SUBCRITICAL = ", subcritical"  # in a legend, behind the kind

LINE_WIDTH = 1.5
MARKER_SIZE = 6.5
#: sub-harmonic motions branch off where their parents have a marker: theirs, on top, lets that one show
OF_SUBHARMONICS = 0.6

#: inches; the widths are 84 mm and 174 mm
SIZES = {"single-column": (3.31, 2.4), "double-column": (6.85, 3.6)}
_PRINT_BELOW = 4.2  # inches of width of one frame


@dataclass(frozen=True)
class Look:
    """Sizes of letters, lines and marker edges in points; markers as a multiple of the table's."""

    small: float
    normal: float
    large: float
    line: float
    edge: float
    marker: float


SCREEN = Look(9.0, 10.0, 11.0, LINE_WIDTH, 1.0, 1.0)
PRINT = Look(7.0, 7.5, 8.0, 1.1, 0.7, 0.72)


def size_in_inches(size: str | tuple[float, float]) -> tuple[float, float]:
    """Width and height of a named size, or those given; InputError for what is neither."""
    if isinstance(size, str):
        if size not in SIZES:
            raise InputError(f"unknown size {size!r}{suggest(size, SIZES)}; or width and height in inches")
        return SIZES[size]
    try:
        if any(isinstance(value, str | bool) for value in size):
            raise TypeError
        width, height = map(float, size)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"size is a name ({', '.join(SIZES)}) or width and height in inches, not {size!r}") from None
    if not (0.2 < width <= 100.0 and 0.2 < height <= 100.0):
        raise InputError(f"size: width and height in inches, from 0.2 to 100, not {size!r}")
    return width, height


def checked_text(text: str | None) -> str:
    """A text whose formulas between dollar signs can be drawn, "" for none; InputError where they cannot."""
    if text and "$" in text:
        from matplotlib.cbook import is_math_text
        from matplotlib.mathtext import MathTextParser

        try:
            if is_math_text(text):  # a single dollar sign is itself
                MathTextParser("agg").parse(text)
        except ValueError as error:
            reason = str(error).strip().splitlines()[-1]
            raise InputError(f"the formula in {text!r} cannot be drawn: {reason}; a plain dollar sign is \\$") from None
    return text or ""


def look_of(width: float) -> Look:
    """The look of a frame this many inches wide: that of print for the columns of a journal."""
    return PRINT if width < _PRINT_BELOW else SCREEN


@dataclass(frozen=True)
class Sheet:
    """A page to draw on: width and height in inches, sizes of what is on it, whether its size is one of a journal."""

    inches: tuple[float, float]
    look: Look
    named: bool = False


def sheet_of(size: str | tuple[float, float], frames: int = 1) -> Sheet:
    """The page of a named size, or of width and height in inches, for so many frames side by side; InputError."""
    inches, named = size_in_inches(size), isinstance(size, str)
    return Sheet(inches, PRINT if named else look_of(inches[0] / frames), named)


@dataclass(frozen=True)
class Pen:
    """How a line is drawn: colour, width as a multiple of the look's, dashes in line widths.

    The pen of a curve has the dashes of its unstable parts.
    """

    colour: str
    width: float = 1.0
    dash: Dash = STABLE_DASH

    def along(self, stable: bool | None) -> Pen:
        """The pen for a stretch of the curve: dashed where motions are unstable."""
        return self if stable is False else replace(self, dash=STABLE_DASH)

    @property
    def dotted(self) -> Pen:
        """The pen for a stretch of the curve whose stability is open."""
        return replace(self, dash=OPEN_DASH)


@dataclass(frozen=True)
class Mark:
    """How a point is marked: size in points, colours of face and edge, width of the edge in multiples of the look's."""

    marker: str | tuple[int, int, int]
    size: float
    face: str
    edge: str = INK
    rim: float = 1.0


ONE_CURVE = Pen(INK, 1.0, UNSTABLE_DASH)
_WIDTHS = (1.0, 0.65, 1.5)
_DASHES: tuple[Dash, ...] = (UNSTABLE_DASH, (0, (5.5, 1.8, 1.2, 1.8)), (0, (1.2, 1.2)))


def curve_style(index: int) -> Pen:
    """The pen of one of several curves in a frame."""
    colour = CURVE_COLOURS[index % len(CURVE_COLOURS)]
    return Pen(colour, _WIDTHS[index % len(_WIDTHS)], _DASHES[index % len(_DASHES)])


def places_among(keys: Sequence[Hashable], names: Sequence[str]) -> list[int]:
    """Of each curve the place of its name among those of the curves with the same key, in the order met."""
    seen = defaultdict[Hashable, dict[str, int]](dict)
    return [seen[key].setdefault(name, len(seen[key])) for key, name in zip(keys, names, strict=True)]


@dataclass(frozen=True)
class KindStyle:
    """How one kind of bifurcation is marked, and what it is called in a legend."""

    name: str
    marker: str | tuple[int, int, int]
    colour: str
    size: float = MARKER_SIZE

    def mark(self, edge: str = INK, size: float = 1.0, rim: float = 1.0) -> Mark:
        """Its marker, with this edge, and this multiple of its size."""
        return Mark(self.marker, size * self.size, self.colour, edge, rim)


KINDS = {
    name: KindStyle(row.legend or row.words, row.marker, row.fill, MARKER_SIZE * row.size) for name, row in ROWS.items()
}


def marks(dataset: xarray.Dataset) -> list[tuple[str, KindStyle, np.ndarray]]:
    """The events of a curve by how they are marked: kind, style, which of them. Subcritical ones are hollow."""
    kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
    hollow = [str(word) == "subcritical" for word in dataset["event_criticality"].to_numpy()]
    groups: dict[tuple[str, bool], list[int]] = {}
    for i, pair in enumerate(zip(kinds, hollow, strict=True)):
        groups.setdefault(pair, []).append(i)
    return [(kind, kind_style(kind, empty), np.array(chosen)) for (kind, empty), chosen in groups.items()]


def kind_style(kind: str, subcritical: bool = False) -> KindStyle:
    """The style of a kind; one that is not in the table (a user's own event) gets a star and its own name."""
    own = KINDS.get(kind, KindStyle(kind, "*", "#CC79A7", MARKER_SIZE * 1.4))
    return replace(own, name=f"{own.name}{SUBCRITICAL}", colour="#ffffff") if subcritical else own


def tinted(colour: str, share: float) -> str:
    """The colour with a share of white in it."""
    mixed = (round(part + share * (255 - part)) for part in bytes.fromhex(colour[1:]))
    return "#" + bytes(mixed).hex() if share else colour


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue of a colour, from 0 to 1."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red / 255.0, green / 255.0, blue / 255.0


# -------------------------------------------------------------------------------------------------------------- periods
# Okabe and Ito's; those of T, 2T, 3T, 4T and 8T stay apart for every kind of colour blindness. The last five, which
# time integration meets, are at least as far from these and each other as any two of the first
_OF_PERIODS = {
    1: INK, 2: "#0072B2", 4: "#E69F00", 8: "#56B4E9", 3: "#D55E00", 6: "#009E73", 5: "#CC79A7",
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
    return [
        replace(curve_style(place), colour=tinted(period_colour(nu), _TINTS[place % len(_TINTS)]))
        for nu, place in zip(periods, places_among(periods, names), strict=True)
    ]


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
    return [ONE_CURVE] if len(datasets) == 1 else [curve_style(index) for index in range(len(datasets))]
