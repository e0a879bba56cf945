"""What a report page shows of curves of bifurcations: the plane of their parameters, and space with response curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suboctave.pictures.boundary import plot_boundaries
from suboctave.pictures.boundary_lines import boundary_names, is_boundary, kind_of, plane_of
from suboctave.pictures.interactive_boundary import plane_data, space_data
from suboctave.pictures.space import plot_space

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["Shown", "boundary_figure", "boundary_overviews", "critical_multipliers", "space_figure"]

_SIZE = (6.4, 4.2)


class Shown(NamedTuple):
    """One figure: heading, traces and layout for the browser, the still picture, words for those who see neither."""

    heading: str
    told: dict[str, Any]
    still: Figure
    words: str


def boundary_figure(curves: Mapping[str, xarray.Dataset], name: str) -> Shown:
    """Boundaries in the plane of their two parameters, which is the same for all."""
    group = list(curves.values())
    first, second = plane_of(group[0])
    plane = f"{_spelt(first)} and {_spelt(second)}"
    still = plot_boundaries(group, labels=_labels(curves), size=_SIZE)
    return Shown(
        f"Boundaries over {plane}", plane_data(curves, first, second, name), still, f"{', '.join(curves)}, over {plane}"
    )


def boundary_overviews(curves: Mapping[str, xarray.Dataset]) -> list[tuple[Mapping[str, xarray.Dataset], str]]:
    """Groups of curves that belong into one figure, and what: "plane" or "space"."""
    planes: dict[tuple[str, str], dict[str, xarray.Dataset]] = {}
    for name, dataset in curves.items():
        if is_boundary(dataset):
            planes.setdefault(plane_of(dataset), {})[name] = dataset
    found: list[tuple[Mapping[str, xarray.Dataset], str]] = []
    for plane, bounds in planes.items():
        if len(bounds) > 1:
            found.append((bounds, "plane"))
        observed = {_observed(dataset) for dataset in bounds.values()}
        responses = {
            name: dataset
            for name, dataset in curves.items()
            if not is_boundary(dataset) and dataset.attrs["free"] in plane and _observed(dataset) in observed
        }
        if responses and len(observed) == 1:
            found.append(({**responses, **bounds}, "space"))
    return found


def critical_multipliers(dataset: xarray.Dataset) -> np.ndarray:
    """Which multipliers are those that make the points bifurcations, (points, multipliers), bool: one at LP, BP and PD,
    a pair at NS, none at grazings.
    """
    mu = dataset["multipliers"].to_numpy()
    found = np.zeros(mu.shape, dtype=bool)
    kind = kind_of(dataset)
    target = {"LP": 1.0, "BP": 1.0, "PD": -1.0}.get(kind)
    if target is None and kind != "NS":
        return found
    # a pair that becomes real in a resonance is at the circle still
    distance = np.abs(np.abs(mu) - 1.0) if target is None else np.abs(mu - target)
    distance = np.where(np.isnan(distance), np.inf, distance)
    rows = np.arange(len(mu))
    for place in np.argsort(distance, axis=1, kind="stable")[:, : 2 if kind == "NS" else 1].T:
        found[rows, place] = True
    return found


def space_figure(curves: Mapping[str, xarray.Dataset], name: str) -> Shown:
    """Response curves and boundaries in space."""
    first, second = next(plane_of(dataset) for dataset in curves.values() if is_boundary(dataset))
    still = plot_space(list(curves.values()), x=first, y=second, size=(6.4, 4.8))
    heading = f"Response curves and boundaries over {_spelt(first)} and {_spelt(second)}"
    return Shown(heading, space_data(curves, first, second, name), still, f"{heading}: {', '.join(curves)}")


def _labels(curves: Mapping[str, xarray.Dataset]) -> list[str]:
    kinds = boundary_names(list(curves.values()))
    return kinds if len(curves) == 1 else [f"{name}: {kind}" for name, kind in zip(curves, kinds, strict=True)]


def _observed(dataset: xarray.Dataset) -> tuple[int, int]:
    return int(dataset.attrs.get("dofs", 1)), int(dataset.attrs.get("observed_dof", 0))


def _spelt(name: str) -> str:
    return "ω" if name == "omega" else name
