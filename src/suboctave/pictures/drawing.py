"""What a figure shows, whoever draws it: strokes, markers, regions, labels and a legend, in the units of its axes.

A kind of figure is laid out once, as a `Drawing` made from datasets. `paper` draws it with Matplotlib, `browser` writes
it down for Plotly. Texts are those of Matplotlib, with formulas between dollar signs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.style import Mark, Pen

#: millimetres between beads along a line, and between one and a marker
_SPACING, _CLEAR = 11.0, 2.3


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """What everything that is drawn has.

    `role`: what it is, in one word; `layer`: higher ones cover lower ones; `name`, `group`: its entry in a legend of
    the browser, and what is hidden with it; `curve`, `vertices`: the number that the curve has on a page (its attribute
    `number`), -1 without one, and which point each vertex is, or -1 - e for event e, (vertices,).
    """

    role: str = ""
    layer: float = 3.0
    name: str = ""
    group: str = ""
    curve: int = -1
    vertices: np.ndarray | None = None


@dataclass(frozen=True)
class Polyline(_Seen):
    """A line through vertices, (axes, vertices), `smooth` but for its corners, or straight between them."""

    at: np.ndarray
    pen: Pen
    smooth: bool = False


@dataclass(frozen=True)
class Markers(_Seen):
    """One marker at each of some places, (axes, places); `cut` where the frame ends, or beyond it too."""

    at: np.ndarray
    mark: Mark
    cut: bool = False


@dataclass(frozen=True)
class Beads(_Seen):
    """Markers at about equal distances along a line, (axes, vertices), none beside places `clear`, (axes, places)."""

    at: np.ndarray
    mark: Mark
    clear: np.ndarray

    def places(self, low: np.ndarray, high: np.ndarray, size: tuple[float, float]) -> np.ndarray:
        """Where they are, (axes, places), in a frame from `low` to `high` that is so many millimetres wide and high."""
        per_unit = (np.array(size) / (high - low))[:, None]
        path = (self.at - low[:, None]) * per_unit
        along = lengths(path.T)
        if not np.isfinite(along[-1]) or along[-1] < 0.25 * _SPACING:
            return np.empty((2, 0))
        count = max(1, round(along[-1] / _SPACING))  # none at the ends
        spots = np.array([np.interp((np.arange(count) + 0.5) * along[-1] / count, along, row) for row in path])
        inside = np.all((spots >= 0.0) & (spots <= np.array(size)[:, None]), axis=0)
        near = (self.clear - low[:, None]) * per_unit
        distance = np.linalg.norm(spots[:, :, None] - near[:, None, :], axis=0).min(axis=1, initial=np.inf)
        return spots[:, inside & (distance > _CLEAR)] / per_unit + low[:, None]


@dataclass(frozen=True)
class Region(_Seen):
    """What is inside an outline, (axes, vertices)."""

    outline: np.ndarray
    colour: str


@dataclass(frozen=True)
class Surface(_Seen):
    """A surface in space through a grid, (3, rows, columns)."""

    grid: np.ndarray
    colour: str
    opacity: float = 1.0


@dataclass(frozen=True)
class Guide(_Seen):
    """A straight line through the whole frame at a value, of the first axis (`upright`) or of the second."""

    value: float
    pen: Pen
    upright: bool = False


@dataclass(frozen=True)
class Band(_Seen):
    """What lies between two values of the second axis."""

    low: float
    high: float
    colour: str


@dataclass(frozen=True)
class Raster(_Seen):
    """Cells of one colour each, (rows, columns, 3), from the lower left, between ascending edges.

    `hatches`: patterns of Matplotlib and which cells have them besides, (rows, columns), bool. `scale`: colours with
    their values, lowest and highest, and what they mean.
    """

    cells: np.ndarray
    across: np.ndarray
    upwards: np.ndarray
    hatches: Mapping[str, np.ndarray] = field(default_factory=dict)
    scale: tuple[Sequence[str], float, float, str] | None = None


Item: TypeAlias = Polyline | Markers | Beads | Region | Surface | Guide | Band | Raster


@dataclass(frozen=True)
class Label:
    """A short text beside a place, (axes,)."""

    at: np.ndarray
    text: str


@dataclass(frozen=True)
class Entry:
    """How a name is shown in the legend: a line, a marker or both, or a patch, perhaps hatched."""

    pen: Pen | None = None
    mark: Mark | None = None
    patch: str | None = None
    edge: str | None = None
    opacity: float = 1.0
    hatch: str = ""

    @property
    def colour(self) -> str:
        """The colour of a patch, or of a square that stands for one; else empty."""
        if self.patch is not None:
            return self.patch
        return self.mark.face if self.mark is not None and self.mark.marker == "s" else ""


@dataclass(frozen=True)
class Ticks:
    """Where an axis has ticks: at most so many, at multiples of `steps`; or at `places` with these texts."""

    most: int = 9
    steps: tuple[float, ...] = (1, 2, 5, 10)
    whole: bool = False
    minor: float | None = None
    places: Sequence[float] = ()
    texts: Sequence[str] = ()


@dataclass(frozen=True)
class Axis:
    """One axis: what it says, from where to where (None: what is drawn decides), its scale and ticks; `shows`: "omega",
    a parameter, or "quantity" of curves.
    """

    label: str
    low: float | None = None
    high: float | None = None
    logarithmic: bool = False
    ticks: Ticks | None = None
    shows: str = ""


@dataclass
class Frame:
    """What stands in one frame, with a text above, and its entries in the legend."""

    items: list[Item] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    title: str = ""
    entries: dict[str, Entry] = field(default_factory=dict)

    def add(self, item: Item, legend: str = "") -> None:
        """Add an item, with a name in the legend where it has one there: shown as the item is drawn."""
        named = replace(item, name=legend, group=legend) if legend and not item.name else item
        self.items.append(named)
        if not legend:
            return
        match item:
            case Region() | Band():
                self.entries[legend] = Entry(patch=item.colour)
            case Polyline() | Guide():
                self.entries[legend] = Entry(item.pen)
            case Markers() | Beads():
                self.entries[legend] = Entry(mark=item.mark)


@dataclass
class Drawing:
    """One or several frames on the same axes, with one legend.

    `legend`: "free" is inside the frame where there is room, else above; "outside" above in any case; "beside" and
    "below" the frame, without a box. `by_kind`: its order. `title` stands above all frames; titles of frames are
    `small` where they are captions.
    """

    axes: Sequence[Axis]
    frames: list[Frame]
    title: str = ""
    columns: int = 1
    legend: str = "free"
    by_kind: bool = False
    grid: bool = True
    small: bool = False
    #: of a drawing in space: degrees above the floor, and around the vertical axis
    seen_from: tuple[float, float] = (24.0, -58.0)

    @property
    def entries(self) -> dict[str, Entry]:
        """What the legend shows, by name; by kind: curves first, stable and unstable, kinds, then a user's own."""
        every = {name: entry for frame in self.frames for name, entry in frame.entries.items()}
        if not self.by_kind:
            return every
        lines = ["stable", "unstable", "stability open"]
        kinds = [name for look in style.KINDS.values() for name in (look.name, f"{look.name}{style.SUBCRITICAL}")]

        def rank(name: str) -> tuple[int, int]:
            if name in lines:
                return 1, lines.index(name)
            if name in kinds:
                return 2, kinds.index(name)
            return (0, 0) if every[name].mark is None else (3, 0)

        return {name: every[name] for name in sorted(every, key=rank)}


def spread(at: np.ndarray) -> tuple[float, float]:
    """Width and height of places, (axes, places); 1 for none."""
    known = [row[np.isfinite(row)] for row in at[:2]]
    width, height = ((float(np.ptp(row)) if row.size else 0.0) or 1.0 for row in known)
    return width, height


def lengths(path: np.ndarray) -> np.ndarray:
    """Lengths along a polyline (vertices, axes) from its beginning to each vertex."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


#: hatches of cells whose motion does not repeat, or lies on an isola, and their colours
STROKES, DOTS = "////", ".."
HATCHES = {STROKES: style.SOFT, DOTS: style.INK}


def dot(colour: str, size: float = 4.0) -> Mark:
    """A point of one colour, without an edge."""
    return Mark("o", size, colour, colour, 0.0)


def plain(text: str) -> str:
    """A name as it is: dollar signs in it do not begin mathematics."""
    return str(text).replace("$", r"\$")
