"""Curves as parts of a drawing: their strokes, the markers of their events, and what is said of them in words."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.drawing import Frame, Polyline
from suboctave.pictures.options import Coordinates
from suboctave.pictures.strokes import Stroke, cut, line_through, without_repeats
from suboctave.pictures.style import KindStyle, Pen
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


# ---------------------------------------------------------------------------------------------------------------- words
#: significant digits that a screen can show
DIGITS = 9


def spelt(name: str) -> str:
    """How a parameter is written."""
    return "ω" if name == "omega" else name


def fixed_parameters(dataset: xarray.Dataset) -> dict[str, float]:
    """The parameters, and omega, that do not change along a curve."""
    table = dataset["parameters"].to_numpy()
    columns = {"omega": dataset["omega"].to_numpy()}
    columns |= {str(name): table[:, i] for i, name in enumerate(dataset["parameter"].to_numpy())}
    return {spelt(name): float(column[0]) for name, column in columns.items() if np.ptp(column) == 0.0}


def differing(values: Sequence[Mapping[str, float]], digits: int = 6) -> list[list[str]]:
    """For each curve or motion what tells it from the others: "j = 0" for values that all have and that differ."""
    names = [n for n in values[0] if all(n in own for own in values) and len({own[n] for own in values}) > 1]
    return [[f"{name} = {own[name]:.{digits}g}" for name in names] for own in values]


class Hover:
    """What is said of the points and events of a curve: omega, free parameters, amplitude, a multiplier."""

    def __init__(self, dataset: xarray.Dataset) -> None:
        self._dataset = dataset

    @functools.cached_property
    def _free(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Values of the free parameters at points and events."""
        attrs = self._dataset.attrs
        plane = str(attrs.get("plane", "")).split("\n") if attrs.get("tracked") else []
        return {name: coordinate(self._dataset, name) for name in [*plane, str(attrs["free"])] if name != "omega"}

    @functools.cached_property
    def _columns(self) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Omega, amplitude and a multiplier at points and events."""
        data = self._dataset
        known = "multipliers" in data and data.sizes.get("multiplier", 0) > 0
        leading = data["multipliers"].to_numpy()[:, 0] if known else np.full(data.sizes["point"], np.nan + 0.0j)
        points = (data["omega"].to_numpy(), data["amplitude"].to_numpy(), leading)
        return points, tuple(data[f"event_{name}"].to_numpy() for name in ("omega", "amplitude", "multiplier"))

    def along(self, stroke: Stroke) -> list[str]:
        """Of every vertex of a stroke."""
        return [
            self._text(int(event), True) if event >= 0 else self._text(int(point), False)
            for point, event in zip(stroke.point, stroke.event, strict=True)
        ]

    def of_events(self, which: np.ndarray) -> list[str]:
        """Of some events, by number."""
        return [self._text(int(index), True) for index in which]

    def _text(self, index: int, at_event: bool) -> str:
        omega, amplitude, multiplier = (column[index] for column in self._columns[at_event])
        lines = [f"{spelt('omega')} = {omega:.{DIGITS}g}"]
        lines += [f"{name} = {at[at_event][index]:.{DIGITS}g}" for name, at in self._free.items()]
        lines.append(f"amplitude = {amplitude:.7g}")
        mu = complex(multiplier)
        if np.isfinite(mu):
            shown = f"{mu.real:.5g}" if abs(mu.imag) < 1e-7 else f"{mu.real:.5g} {mu.imag:+.5g}i"
            lines.append(f"{'critical' if at_event else 'leading'} multiplier = {shown}, modulus {abs(mu):.5g}")
        return "\n".join(lines)
