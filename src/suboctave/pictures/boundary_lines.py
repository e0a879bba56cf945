"""Curves of bifurcations as lines: what each looks like, its parts, and the small marks that tell its kind along it.

Lines of period doublings and limit points have the colour of the period whose motions are born or end there, so that
what is blue borders motions of period 2T; the other kinds, across which no period begins, have colours of their own.
The kind is told by shape as well, by small marks along the line: those of its kind in response curves, hollow where
period doublings are subcritical.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.periods import period_colour, period_name, period_of, tinted
from suboctave.pictures.strokes import Line, line

if TYPE_CHECKING:
    import xarray

__all__ = ["Part", "boundary_names", "boundary_styles", "is_boundary", "kind_of", "parts", "plane_of", "stations"]

_COLOURS = {"NS": "#009E73", "BP": "#CC79A7", "grazing": style.SOFT}
_WIDTHS = {"PD": 1.35, "grazing": 0.8}
#: share of white in the colours of those of kinds with a colour of their own, for motions of several periods
_STAGE = 0.4
#: of the second and third curve of one kind and period: share of white, width
_APART = ((0.0, 1.0), (0.45, 0.7), (0.25, 1.4))


def is_boundary(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of a curve of bifurcations in two parameters."""
    return bool(dataset.attrs.get("tracked"))


def kind_of(dataset: xarray.Dataset) -> str:
    """The kind of bifurcation that a curve consists of."""
    return str(dataset.attrs["tracked"])


def plane_of(dataset: xarray.Dataset) -> tuple[str, str]:
    """The two parameters that were free."""
    first, second = str(dataset.attrs["plane"]).split("\n")
    return first, second


def _colour(kind: str, nu: int) -> str:
    if kind in _COLOURS:
        return tinted(_COLOURS[kind], 0.0 if nu == 1 else _STAGE)
    return period_colour(2 * nu if kind == "PD" else nu)


def _words(kind: str, nu: int) -> str:
    name = style.kind_style(kind).name
    if kind == "PD":
        return f"{name} {period_name(nu)}→{period_name(2 * nu)}"
    return name if nu == 1 else f"{name} of {period_name(nu)}"


def boundary_names(group: Sequence[xarray.Dataset]) -> list[str]:
    """Kind and period of each, and the parameters in which those of one kind and period differ."""
    names = [_words(kind_of(dataset), period_of(dataset)) for dataset in group]
    told = list(names)
    for name in dict.fromkeys(names):
        alike = [index for index, other in enumerate(names) if other == name]
        fixed = [_fixed(group[index]) for index in alike]
        shared = [key for key in fixed[0] if all(key in values for values in fixed)]
        differing = [key for key in shared if len({values[key] for values in fixed}) > 1]
        for index, values in zip(alike, fixed, strict=True):
            told[index] = ", ".join([name, *(f"{key} = {values[key]:g}" for key in differing)])
    return told


def _fixed(dataset: xarray.Dataset) -> dict[str, float]:
    """The parameters, and omega, that were not free."""
    names = [str(name) for name in dataset["parameter"].to_numpy()]
    table = dataset["parameters"].to_numpy()
    free = plane_of(dataset)
    values = {name: float(table[0, i]) for i, name in enumerate(names) if name not in free}
    return values if "omega" in free else {"ω": float(dataset["omega"].to_numpy()[0]), **values}


def boundary_styles(group: Sequence[xarray.Dataset], names: Sequence[str]) -> list[style.CurveStyle]:
    """The style of each: by kind and period, and among those by name."""
    seen: dict[tuple[str, int], list[str]] = {}
    styles = []
    for dataset, name in zip(group, names, strict=True):
        kind, nu = kind_of(dataset), period_of(dataset)
        alike = seen.setdefault((kind, nu), [])
        if name not in alike:
            alike.append(name)
        place = alike.index(name)
        white, width = _APART[place % len(_APART)]
        look = style.CurveStyle(
            tinted(_colour(kind, nu), white), width * _WIDTHS.get(kind, 1.0), style.curve_style(place).dash
        )
        styles.append(look)
    return styles


@dataclass(frozen=True)
class Part:
    """A stretch of a curve of bifurcations, (vertices,) each: of one stability, and wholly subcritical or not."""

    x: np.ndarray
    y: np.ndarray
    stable: bool | None
    subcritical: bool


def parts(dataset: xarray.Dataset, x: str, y: str) -> list[Part]:
    """The curve over `x`, cut where stability changes and where period doublings become sub- or supercritical.

    `y` is a variable of the dataset. Where stability changes without a located event the stretch counts as unstable.
    """
    whole = line(dataset, x, y)
    below = subcritical_pieces(dataset, whole)
    if not below.size:
        return []
    stable = np.full(below.size, -1) if whole.stable is None else whole.stable.astype(int)
    cuts = np.flatnonzero((np.diff(stable) != 0) | (np.diff(below.astype(int)) != 0)) + 1
    return [
        Part(
            whole.x[first : last + 1],
            whole.y[first : last + 1],
            None if stable[first] < 0 else bool(stable[first]),
            bool(below[first]),
        )
        for first, last in pairwise([0, *cuts, below.size])
    ]


def subcritical_pieces(dataset: xarray.Dataset, whole: Line) -> np.ndarray:
    """(vertices - 1,) whether the period doublings between two vertices of the line are subcritical.

    The sign of c3 at the points decides; it changes at a located GPD, where there is one.
    """
    none = np.zeros(max(whole.x.size - 1, 0), dtype=bool)
    if kind_of(dataset) != "PD" or "coefficient" not in dataset:
        return none
    positive = dataset["coefficient"].to_numpy() > 0.0
    kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
    result, here = none, False
    for piece in range(result.size):
        if whole.point[piece] >= 0:
            here = bool(positive[whole.point[piece]])
        elif kinds[whole.event[piece]] == "GPD":
            here = not here
        result[piece] = here
    return result


def stations(x: np.ndarray, y: np.ndarray, spacing: float) -> np.ndarray:
    """Places (marks, 2) at about equal distances along a polyline, none at its ends; at least one if it is not short.

    `x`, `y` and `spacing` in one unit of length, such as pixels.
    """
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    length = float(along[-1])
    if not np.isfinite(length) or length < 0.25 * spacing:
        return np.empty((0, 2))
    count = max(1, round(length / spacing))
    at = (np.arange(count) + 0.5) * length / count
    return np.column_stack([np.interp(at, along, x), np.interp(at, along, y)])
