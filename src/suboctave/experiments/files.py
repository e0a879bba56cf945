"""Results of time integration as datasets that a file or the journal of a study can hold, and back.

The dataset of `to_xarray()`, complex numbers as pairs of variables `..._real`, `..._imag`, and besides `record`: JSON
with the system and what is no array. What follows from the numbers (attractors of sections, shares of basins) is
computed again when it is needed. docs/results.md describes the variables.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.experiments.basin_attractors import BasinAttractor
from suboctave.experiments.basins import Basins
from suboctave.experiments.brute_force import BruteForceDiagram
from suboctave.experiments.common import TimeResult, entries_of
from suboctave.experiments.lyapunov import LyapunovExponents, Separation, TwoTrajectories
from suboctave.experiments.lyapunov_map import LyapunovMap
from suboctave.experiments.poincare import PoincareSections
from suboctave.experiments.stepped_sine import SteppedSine
from suboctave.experiments.trajectories import Trajectory
from suboctave.model.system import build
from suboctave.store.plain import array_of, flat, from_json, system_arrays, to_json, written_system
from suboctave.store.registry import Codec, Datasets, register
from suboctave.timedomain.trapping import Trap

if TYPE_CHECKING:
    import xarray

Record = dict[str, Any]


def _write(item: Any) -> dict[str, xarray.Dataset]:
    import xarray

    dataset = item.to_xarray()
    system, arrays = written_system(item.system)
    record = {"system": system, "seconds": float(item.seconds), **_RECORDS.get(type(item), lambda one: {})(item)}
    variables = {name: (v.dims, v.values, v.attrs) for name, v in dataset.variables.items()}
    variables["record"] = ((), np.array(to_json(record)), {"long_name": "the system and what is no array, as JSON"})
    for name, array in arrays.items():
        variables[name] = (tuple(f"{name}_{axis}" for axis in range(array.ndim)), array, {})
    stored = xarray.Dataset(dict(flat(variables)), attrs=dataset.attrs)
    return {"": stored.set_coords([name for name in dataset.coords if name in stored])}


def _read(made: Any, groups: Datasets, allow_code: bool, linear: Any) -> TimeResult:
    """The result that `_write` wrote, equal bit for bit."""
    dataset = groups[""]
    record = from_json(str(dataset["record"].item()), {"TwoTrajectories": TwoTrajectories})
    given: Record = {}
    for entry in entries_of(made):
        if entry.states:
            parts = (array_of(dataset, name) for name in ("displacement", "velocity"))
            given[entry.field] = np.concatenate([*parts], axis=-1)
        elif entry.axes:
            array = array_of(dataset, entry.name)
            given[entry.field] = array if array.dtype.kind not in "OU" else tuple(map(str, array))
        else:
            given[entry.field] = entry.kind(dataset.attrs[entry.name])
    if "parameters" in made.__annotations__:
        names = map(str, array_of(dataset, "parameter"))
        given["parameters"] = dict(zip(names, array_of(dataset, "parameters").tolist(), strict=True))
    given |= _OTHERS.get(made, lambda dataset, record: {})(dataset, record)
    result: TimeResult = made(**given, system=build(record["system"], system_arrays(dataset), allow_code))
    result.seconds = float(record["seconds"])
    return result


def _sections(dataset: xarray.Dataset, record: Record) -> Record:
    names, values = [str(name) for name in array_of(dataset, "parameter")], array_of(dataset, "parameters")
    return {"varied": {name: values[:, names.index(name)].copy() for name in record["varied"]}}


def _brute_force(dataset: xarray.Dataset, record: Record) -> Record:
    return {"omega": float(dataset.attrs["omega"]) if "omega" in dataset.attrs else None}


def _separation(dataset: xarray.Dataset, record: Record) -> Record:
    settings = np.stack([array_of(dataset, name) for name in ("value", "offset")], axis=1)
    return {"settings": settings, "method": record["method"]}


def _basins(dataset: xarray.Dataset, record: Record) -> Record:
    period, amplitude, given, multipliers, points, of = (
        array_of(dataset, name) for name in ("period", "amplitude", "given", "multipliers", "points", "point_of")
    )
    known = [
        BasinAttractor(
            str(name), int(period[i]), points[of == i], float(amplitude[i]), multipliers[i].copy(), bool(given[i]),
            [Trap(*trap) for trap in record["traps"][i]],
        )
        for i, name in enumerate(array_of(dataset, "attractor"))
    ]  # fmt: skip
    return {"attractors": known, "plane": (str(dataset.attrs["plane_x"]), str(dataset.attrs["plane_y"]))}


def _traps(one: BasinAttractor) -> list[Any]:
    return [(trap.point, trap.factor, trap.radius, trap.times) for trap in one.traps]


#: what the record of a class holds besides, and the fields that have no place of their own in its dataset
_RECORDS: dict[type, Callable[[Any], Record]] = {
    PoincareSections: lambda item: {"varied": list(item.varied)},
    Separation: lambda item: {"method": item.method},
    Basins: lambda item: {"traps": [_traps(one) for one in item.attractors]},
}
_OTHERS: dict[type, Callable[[Any, Record], Record]] = {
    PoincareSections: _sections,
    BruteForceDiagram: _brute_force,
    Separation: _separation,
    Basins: _basins,
}

for _made in (
    Trajectory, PoincareSections, BruteForceDiagram, SteppedSine, LyapunovExponents, LyapunovMap, Separation, Basins
):  # fmt: skip
    register(Codec(_made.contents, _made, _write, partial(_read, _made)))
