"""Isolas in pictures: their regions and ends in a plane, the surfaces that their closed branches lie on in space.

Drawn from the dataset that `suboctave.store.layout` describes, given among those of the curves. `plot_isola_map` shows
where in the plane of two design parameters isolas exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Frame, Polyline, Region, lengths
from suboctave.pictures.options import PageOptions
from suboctave.pictures.paper import single
from suboctave.pictures.style import Pen, period_colour, period_name, tinted
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: kinds that the events at the two ends of an isola have in pictures
CENTRE, MERGING = "isola_centre", "isola_merging"
#: an event within this, relative to its values, is the end itself
_SAME = 1e-8
#: share of white in the region of an isola, in a plane with curves and in a map
_PALE, _PALE_MAP = 0.82, 0.72
#: places along a loop of a surface, from its largest to its least frequency
_SAMPLES = 60


def is_isolas(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of isolas."""
    return bool(dataset.attrs.get("isolas"))


def parameter_of(dataset: xarray.Dataset) -> str:
    """The design parameter of a dataset of isolas."""
    return str(dataset.attrs["isolas"])


def split(datasets: Sequence[xarray.Dataset]) -> tuple[list[xarray.Dataset], list[xarray.Dataset]]:
    """The datasets of curves, and those of isolas."""
    heads = [dataset for dataset in datasets if is_isolas(dataset)]
    return [dataset for dataset in datasets if not is_isolas(dataset)], heads


def shade(
    heads: Sequence[xarray.Dataset], names: Sequence[str | None], factors: np.ndarray, floor: float | None = None
) -> list[Region]:
    """The regions of isolas in the plane of two axes, if it is theirs; in space on the floor, at this height."""
    shaded = []
    for head in heads:
        if set(names) != {"omega", parameter_of(head)}:
            continue
        for number, nu in enumerate(head["period"].to_numpy()):
            own, words = head["edge_isola"].to_numpy() == number, f"{period_name(int(nu))} isola"
            value, low, high = (head[f"edge_{name}"].to_numpy()[own] for name in ("value", "low", "high"))
            around = np.concatenate([low, high[::-1], low[:1]]), np.concatenate([value, value[::-1], value[:1]])
            outline = np.array([around[name != "omega"] for name in names]) * factors[:2, None]
            colour = tinted(period_colour(int(nu)), _PALE)
            if floor is None:
                shaded.append(Region(outline, colour, role="isola", layer=1.5, name=words, group=words))
            else:
                outline = np.vstack([outline, np.full(outline.shape[1], floor)])
                shaded.append(Region(outline, colour, role="isola-floor", layer=0.9))
    return shaded


def with_ends(dataset: xarray.Dataset, heads: Sequence[xarray.Dataset]) -> xarray.Dataset:
    """The dataset of a curve, the ends of isolas among its events under kinds of their own."""
    kinds = dataset["event_kind"].to_numpy().astype(object)
    ends = [
        (kind, parameter_of(head), float(omega), float(value))
        for head in heads
        for kind, name in ((CENTRE, "born"), (MERGING, "merges"))
        for omega, value in zip(head[f"{name}_omega"].to_numpy(), head[name].to_numpy(), strict=True)
        if np.isfinite(value)
    ]
    for kind, parameter, omega, value in ends:
        if parameter not in dataset["parameter"].to_numpy():
            continue
        there, at = dataset["event_omega"].to_numpy(), coordinate(dataset, parameter)[1]
        same = (np.abs(there - omega) <= _SAME * abs(omega)) & (np.abs(at - value) <= _SAME * max(abs(value), 1e-300))
        kinds[same] = kind
    return dataset.assign(event_kind=("event", kinds))


def end_text(kind: str, value: float | None) -> str:
    """What stands beside an end, with the value of the parameter where that is drawn upwards."""
    word = "born" if kind == CENTRE else "merges"
    return word if value is None else f"{word} {value:#.4g}"


# ------------------------------------------------------------------------------------------------------------- surfaces
def surface(loops: Sequence[np.ndarray], tips: Sequence[np.ndarray] = ()) -> np.ndarray | None:
    """The grid (3, rows, columns) through loops and points that they shrink to, in the order of the parameter.

    Each loop is cut at its least and its largest frequency into two arcs, and the places at equal shares of their
    lengths are joined from loop to loop. In between that is interpolation: a picture of how the loops hang together.

    `loops`, (3, vertices) each: frequency and parameter, in either order, and the quantity upwards, once around;
    `tips`, (3,) each. None where there are fewer than two rows.
    """
    if not loops or len(loops) + len(tips) < 2:
        return None
    along = 0 if np.ptp(loops[0][0]) > 0.0 else 1
    scale = np.max([np.ptp(loop, axis=1) for loop in loops], axis=0)[:, None]
    scale[scale == 0.0] = 1.0
    rows: list[np.ndarray] = []
    for loop in sorted(loops, key=lambda loop: float(loop[1 - along][0])):
        both = _arcs(loop, along, scale)
        if rows:
            far = [float(np.sum(((arcs - rows[-1]) / scale)[[along, 2]] ** 2)) for arcs in both]
        else:  # the first one begins with its upper arc
            far = [-float(np.mean(arcs[2, :_SAMPLES])) for arcs in both]
        rows.append(both[int(np.argmin(far))])
    for tip in tips:
        rows.append(np.repeat(np.asarray(tip, dtype=float)[:, None], 2 * _SAMPLES, axis=1))
    rows.sort(key=lambda row: float(row[1 - along][0]))
    return np.stack(rows, axis=1)


def _arcs(loop: np.ndarray, along: int, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The loop from its largest frequency to the least and back, (3, 2 samples), in both senses."""
    vertices = loop[:, :-1] if np.allclose(loop[:, 0], loop[:, -1]) else loop
    vertices = np.roll(vertices, -int(np.argmax(vertices[along])), axis=1)
    turn = int(np.argmin(vertices[along]))
    there, back = vertices[:, : turn + 1], np.column_stack([vertices[:, turn:], vertices[:, 0]])
    first, second = _spread(there, scale), _spread(back, scale)
    return np.hstack([first, second]), np.hstack([second[:, ::-1], first[:, ::-1]])


def _spread(arc: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Places at equal shares of the length of an arc, (3, samples)."""
    length = lengths((arc / scale).T)
    return np.array([np.interp(np.linspace(0.0, length[-1], _SAMPLES), length, row) for row in arc])


# ------------------------------------------------------------------------------------------------------------------ map
#: borders of the regions of a map; a bound of the search is no border of nature
_BORDERS = {
    "birth (isola centre)": Pen("#009E73", 1.3),
    "merging": Pen("#D55E00", 1.3, style.UNSTABLE_DASH),
    "end": Pen(style.INK),
    "bounds": Pen(style.SOFT, 0.8, (0, (1.2, 1.2))),
}
_Outline = tuple[np.ndarray, np.ndarray, np.ndarray]
_Piece = tuple[str, np.ndarray, np.ndarray]


@with_options(PageOptions)
def plot_isola_map(
    regions: Sequence[tuple[str, _Outline, Sequence[Sequence[_Piece]]]],
    names: tuple[str, str],
    path: str | Path | None = None,
    *,
    bounds: tuple[float, float],
    xlim: Sequence[float] | None = None,
    ylim: Sequence[float] | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    **page: Unpack[PageOptions],
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
    frame = Frame()
    for period, (values, low, high), borders in regions:
        colour = tinted(period_colour(1 if period == "T" else int(period[:-1])), _PALE_MAP)
        outline = np.array([[*values, *values[::-1]], [*low, *high[::-1]]])
        frame.add(Region(outline, colour, role="isola", layer=1.0), f"{period} isola")
        for words, x, y in (piece for pieces in borders for piece in pieces):
            frame.add(Polyline(np.array([x, y]), _BORDERS[words], role=words), words)
    upwards: Any = ylim
    if ylim is None and frame.items:
        every = [i.outline if isinstance(i, Region) else i.at for i in frame.items if isinstance(i, Region | Polyline)]
        bottom, top = (float(end(np.concatenate(every, axis=1)[1])) for end in (np.nanmin, np.nanmax))
        upwards = bottom - 0.12 * (top - bottom), top + 0.12 * (top - bottom)
    across = bounds if xlim is None else xlim
    axes = Axis(xlabel or names[0], across[0], across[1]), Axis(ylabel or names[1], *(upwards or (None, None)))
    return single(frame, axes, page, path, (6.4, 4.2))
