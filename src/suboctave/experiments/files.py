"""Results of time integration as datasets that a file or the journal of a study can hold, and back.

The dataset of `to_xarray()`, complex numbers as pairs of variables `..._real`, `..._imag`, and besides `record`: JSON
with the system and what is no array. What follows from the numbers (attractors of sections, shares of basins) is
computed again when it is needed. docs/results.md describes the variables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.experiments.basin_attractors import BasinAttractor
from suboctave.experiments.basins import Basins
from suboctave.experiments.brute_force import BruteForceDiagram
from suboctave.experiments.common import TimeResult
from suboctave.experiments.lyapunov import LyapunovExponents, Separation, TwoTrajectories
from suboctave.experiments.lyapunov_map import LyapunovMap
from suboctave.experiments.poincare import PoincareSections
from suboctave.experiments.stepped_sine import SteppedSine
from suboctave.experiments.trajectories import Trajectory
from suboctave.model.system import System, build
from suboctave.store.plain import array_of, flat, from_json, system_arrays, to_json, written_system
from suboctave.store.registry import Codec, Datasets, register
from suboctave.timedomain.trapping import Trap

if TYPE_CHECKING:
    import xarray

_CLASSES: dict[str, type] = {"TwoTrajectories": TwoTrajectories}


def _read(kind: _Kind, groups: Datasets, allow_code: bool, linear: Any) -> TimeResult:
    """The result that `_written` wrote, equal bit for bit."""
    dataset = groups[""]
    record = from_json(str(dataset["record"].item()), _CLASSES)
    system = build(record["system"], system_arrays(dataset), allow_code)
    result: TimeResult = kind.made(**kind.arguments(_Read(dataset, record, system)), system=system)
    result.seconds = float(record["seconds"])
    return result


def _written(kind: _Kind, item: Any) -> dict[str, xarray.Dataset]:
    import xarray

    dataset = item.to_xarray()
    system, arrays = written_system(item.system)
    record = {"system": system, "seconds": float(item.seconds), **kind.more(item)}
    variables = {name: (v.dims, v.values, v.attrs) for name, v in dataset.variables.items()}
    variables["record"] = ((), np.array(to_json(record)), {"long_name": "the system and what is no array, as JSON"})
    for name, array in arrays.items():
        variables[name] = (tuple(f"{name}_{axis}" for axis in range(array.ndim)), array, {})
    stored = xarray.Dataset(dict(flat(variables)), attrs=dataset.attrs)
    return {"": stored.set_coords([name for name in dataset.coords if name in stored])}


@dataclass(frozen=True)
class _Read:
    """A dataset that is read, its record and the system in it."""

    dataset: xarray.Dataset
    record: Mapping[str, Any]
    system: System

    def __getitem__(self, name: str) -> Any:
        return array_of(self.dataset, name)

    def state(self) -> np.ndarray:
        """Displacements and velocities side by side."""
        return np.concatenate([self["displacement"], self["velocity"]], axis=-1)

    def texts(self, name: str) -> list[str]:
        """A variable of texts."""
        return [str(text) for text in self[name]]

    def parameters(self) -> dict[str, float]:
        """The values of parameters by name."""
        return dict(zip(self.texts("parameter"), self["parameters"].tolist(), strict=True))


@dataclass(frozen=True)
class _Kind:
    """A class of results: what is read besides its layout, and what the record holds."""

    made: type[Any]
    read: Callable[[_Read], dict[str, Any]] = lambda d: {}
    more: Callable[[Any], dict[str, Any]] = lambda item: {}

    def arguments(self, d: _Read) -> dict[str, Any]:
        """Arguments of the class, but the system."""
        layout, named = self.made.layout, {one.name for one in fields(self.made)}
        given = {one: d[layout.names.get(one, one)] for one in layout.arrays}
        given |= {one: kind(d.dataset.attrs[layout.names.get(one, one)]) for one, kind in layout.attributes.items()}
        if "parameters" in named:
            given["parameters"] = d.parameters()
        return given | self.read(d)


def _sections(d: _Read) -> dict[str, Any]:
    names, values = d.texts("parameter"), d["parameters"]
    return {
        "points": d.state(),
        "varied": {name: values[:, names.index(name)].copy() for name in d.record["varied"]},
    }


def _brute_force(d: _Read) -> dict[str, Any]:
    omega = d.dataset.attrs.get("omega")
    starts = tuple(d.texts("start"))
    return {"starts": starts, "points": d.state(), "omega": None if omega is None else float(omega)}


def _basins(d: _Read) -> dict[str, Any]:
    points, of, multipliers = d["points"], d["point_of"], d["multipliers"]
    known = [
        BasinAttractor(
            name, int(d["period"][i]), points[of == i], float(d["amplitude"][i]),
            multipliers[i, : d.record["multipliers"][i]].copy(), bool(d["given"][i]),
            [Trap(*trap) for trap in d.record["traps"][i]],
        )
        for i, name in enumerate(d.texts("attractor"))
    ]  # fmt: skip
    plane = (str(d.dataset.attrs["plane_x"]), str(d.dataset.attrs["plane_y"]))
    return {"attractors": known, "plane": plane}


def _of_basins(item: Basins) -> dict[str, Any]:
    return {
        "traps": [
            [(trap.point, trap.factor, trap.radius, trap.times) for trap in one.traps] for one in item.attractors
        ],
        "multipliers": [len(one.multipliers) for one in item.attractors],
    }


for _kind in (
    _Kind(Trajectory),
    _Kind(PoincareSections, _sections, lambda item: {"varied": list(item.varied)}),
    _Kind(BruteForceDiagram, _brute_force),
    _Kind(SteppedSine, lambda d: {"directions": tuple(d.texts("direction"))}),
    _Kind(LyapunovExponents),
    _Kind(LyapunovMap),
    _Kind(
        Separation,
        lambda d: {"settings": np.stack([d["value"], d["offset"]], axis=1), "method": d.record["method"]},
        lambda item: {"method": item.method},
    ),
    _Kind(Basins, _basins, _of_basins),
):
    register(Codec(_kind.made.layout.contents, _kind.made, partial(_written, _kind), partial(_read, _kind)))
