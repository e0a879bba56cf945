"""What stands in space: the three axes, curves as strokes, and the surfaces of isolas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures.boundary_lines import is_boundary, plane_of
from suboctave.pictures.periods import period_of
from suboctave.pictures.regions import CENTRE, is_isolas, split, with_ends
from suboctave.pictures.strokes import strokes
from suboctave.pictures.surfaces import surface
from suboctave.pictures.view import View
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["Space", "space_axes", "strokes_in_space", "surfaces_in_space"]

_DEPTH = "_depth"


@dataclass(frozen=True)
class Space:
    """The three axes: `across`, a parameter or omega, `depth`, another one, and the quantity of the view."""

    across: str
    depth: str
    view: View = field(default_factory=View)

    def values(self, dataset: xarray.Dataset) -> tuple[np.ndarray, np.ndarray]:
        """Positions (3, points) and (3, events)."""
        factors = self.factors()
        points, events = [], []
        for name, factor in zip((self.across, self.depth), factors, strict=False):
            at, there = coordinate(dataset, name)
            points.append(at * factor)
            events.append(there * factor)
        points.append(dataset[self.view.variable].to_numpy() * factors[2])
        events.append(dataset[f"event_{self.view.variable}"].to_numpy() * factors[2])
        return np.array(points), np.array(events)

    def factors(self) -> tuple[float, float, float]:
        """What values along the three axes are multiplied by."""
        first, up = self.view.factors(self.across)
        return first, self.view.factors(self.depth)[0], up

    def labels(self, dataset: xarray.Dataset) -> tuple[str, str, str]:
        """What the three axes say; `xlabel` and `ylabel` of the view are those across and into the depth."""
        view = self.view
        plain = View(view.quantity, view.harmonic, view.element, view.dof, view.frequency, view.omega_reference)
        across, depth = (plain.labels(dataset, name)[0] for name in (self.across, self.depth))
        up = View(view.quantity, view.harmonic, view.element, view.dof, scale=view.scale, unit=view.unit)
        return view.xlabel or across, view.ylabel or depth, up.labels(dataset, self.across)[1]


def space_axes(group: Sequence[xarray.Dataset], x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """What is drawn to the right and into the depth; InputError where that has to be told, or is not there."""
    if not group:
        raise InputError("no curve to draw")
    for dataset in group:
        check_layout(dataset)
        if dataset.sizes.get("point", 0) == 0:
            raise InputError("a curve without points cannot be drawn")
        for name in (x, y):
            if name is not None:
                coordinate(dataset, name)
    if x is not None and x == y:
        raise InputError(f"x and y are the same parameter {x!r}")
    if x is not None and y is not None:
        return x, y
    pairs = {plane_of(dataset) for dataset in group if is_boundary(dataset)}
    if not pairs:
        free = {str(dataset.attrs["free"]) for dataset in group}
        names = _differing(group)
        if len(free) == 1 and len(names) == 1:
            pairs = {(next(iter(free)), names[0])}
        elif len(free) == 1 and y is None:
            raise InputError(
                f"name the parameter into the depth with y=; the curves differ in {', '.join(names) or 'none'}"
            )
    if len(pairs) != 1:
        if x is None and y is not None and not pairs:
            return str(group[0].attrs["free"]), y
        raise InputError("the curves were followed in different parameters: choose axes with x= and y=")
    pair = next(iter(pairs))
    given = x if x is not None else y
    if given is None:
        return pair
    if given not in pair:
        raise InputError(f"{given!r} is neither of {pair[0]}, {pair[1]}{suggest(given, pair)}: give x= and y=")
    other = pair[1] if given == pair[0] else pair[0]
    return (given, other) if x is not None else (other, given)


def _differing(group: Sequence[xarray.Dataset]) -> list[str]:
    """Parameters that are constant on each curve, or vary, and are not the same on all."""
    names = [str(name) for name in group[0]["parameter"].to_numpy()]
    free = {str(dataset.attrs["free"]) for dataset in group}
    values = {name: np.concatenate([coordinate(data, name)[0] for data in group]) for name in names if name not in free}
    return [name for name, value in values.items() if np.ptp(value) > 0.0]


def strokes_in_space(dataset: xarray.Dataset, space: Space) -> list[tuple[np.ndarray, bool | None]]:
    """Stretches (3, vertices) of one stability each, cut where bifurcations were located."""
    depth, at_events = coordinate(dataset, space.depth)
    prepared = dataset.assign({_DEPTH: ("point", depth), f"event_{_DEPTH}": ("event", at_events)})
    factors = space.factors()
    found = []
    variables = (space.view.variable, _DEPTH)
    for up, into in zip(*(strokes(prepared, space.across, name) for name in variables), strict=True):
        found.append((np.array([up.x * factors[0], into.y * factors[1], up.y * factors[2]]), up.stable))
    return found


def surfaces_in_space(given: Sequence[xarray.Dataset], space: Space) -> list[tuple[int, np.ndarray]]:
    """Period and grid (3, rows, columns) of the surface of each isola whose closed branches are among the datasets.

    Closed branches belong to the isolas that stand before them.
    """
    loops: dict[tuple[int, int], list[xarray.Dataset]] = {}
    heads = 0
    for dataset in given:
        heads += is_isolas(dataset)
        if "isola" in dataset.attrs and not is_boundary(dataset):
            loops.setdefault((heads - 1, int(dataset.attrs["isola"])), []).append(dataset)
    every = split(given)[1]
    found = []
    for (which, number), closed in loops.items():
        tips = []
        for dataset in given if which >= 0 else ():
            if is_boundary(dataset):
                kinds = with_ends(dataset, [every[which].isel(isola=[number])])["event_kind"].to_numpy()
                tips += list(space.values(dataset)[1].T[kinds == CENTRE])
        around = [np.hstack([piece for piece, _ in strokes_in_space(dataset, space)]) for dataset in closed]
        grid = surface(around, tips[:1])
        if grid is not None:
            found.append((period_of(closed[0]), grid))
    return found
