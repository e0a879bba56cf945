"""Curves as parts of a drawing: their strokes and the markers of their events, with what is said under the mouse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.drawing import Frame, Polyline
from suboctave.pictures.options import Coordinates
from suboctave.pictures.strokes import cut, line_through, without_repeats
from suboctave.pictures.style import KindStyle, Pen
from suboctave.pictures.words import Hover
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray


#: role, name and group of a stroke by its verdict
Seen: TypeAlias = "Mapping[bool | None, tuple[str, str, str]]"


def seen_as(role: str, name: str) -> Seen:
    """All strokes of a curve alike."""
    return dict.fromkeys((None, True, False), (role, name, name))


def checked(curves: Sequence[Any]) -> list[xarray.Dataset]:
    """The datasets of curves, at least one, each with points; InputError for anything else."""
    import xarray

    if not curves:
        raise InputError("no curve to draw")
    for dataset in curves:
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(f"expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()")
        check_layout(dataset)
        if "point" not in dataset.sizes:
            raise InputError(
                "this dataset is no curve; one of a motion is drawn by plot_phase, plot_spectrum, plot_history"
            )
        if dataset.sizes["point"] == 0:
            raise InputError("a curve without points cannot be drawn")
    return list(curves)


def named_axis(group: Sequence[xarray.Dataset], name: str | None) -> str | None:
    """The parameter of an axis; InputError where a curve does not have it."""
    for dataset in group if name is not None else ():
        coordinate(dataset, str(name))
    return name


def check_count(name: str, given: Sequence[Any] | None, count: int, things: str) -> None:
    """InputError where what is given by name has not one entry for each of so many things."""
    if given is not None and len(given) != count:
        raise InputError(f"{name}: expected one for each of the {count} {things}, got {len(given)}")


def add_strokes(
    frame: Frame,
    dataset: xarray.Dataset,
    axes: Coordinates,
    pen: Pen,
    seen: Seen,
    *,
    earlier: dict[Pen, list[np.ndarray]] | None = None,
    spread: tuple[float, float] = (1.0, 1.0),
    floor: float | None = None,
    layer: float = 3.0,
) -> set[bool | None]:
    """Add the strokes of a curve, or in space their projection on the floor at this height; returns their verdicts.

    In the plane strokes are smooth, and dashes are not drawn
    upon those of `earlier` curves, in a frame of width and height `spread`.
    """
    hover, strokes = Hover(dataset), cut(dataset, line_through(dataset, *axes.of(dataset)))
    if earlier is not None:
        strokes = without_repeats(strokes, earlier.setdefault(pen, []), spread)
    for stroke in strokes:
        at = stroke.at if floor is None else np.vstack([stroke.at[:2], np.full(stroke.at.shape[1], floor)])
        role, name, group = seen[stroke.stable]
        texts = partial(hover.along, stroke)
        drawn: dict[str, Any] = {"smooth": earlier is not None, "role": role, "layer": layer, "hover": texts}
        own = pen.along(stroke.stable if floor is None else None)
        frame.items.append(Polyline(at, own, name=name, group=group, **drawn))
    return {stroke.stable for stroke in strokes}


def events_of(
    dataset: xarray.Dataset, axes: Coordinates, marked: np.ndarray
) -> Iterator[tuple[str, KindStyle, dict[str, Any]]]:
    """The events of a curve by how they are marked: kind, style, and place, role and texts of their `Markers`.

    `marked`, (events,), bool: which of them.
    """
    places, hover = axes.of(dataset)[1], Hover(dataset)
    for kind, look, every in style.marks(dataset):
        which = every[marked[every]]
        if which.size:
            yield kind, look, {"at": places[:, which], "role": kind, "hover": partial(hover.of_events, which)}
