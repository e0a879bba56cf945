"""What files hold as JSON and as arrays: options, contacts, audits and the like as plain data, and back without loss;
complex arrays as pairs of real variables; systems with their large arrays as variables.

Tuples, complex numbers, numbers that are not finite, arrays and dataclasses are wrapped in a mapping of one key that
says what they are. Dataclasses come back only as one of the classes that the reader names: a file cannot choose.
"""

from __future__ import annotations

import dataclasses
import json
import numbers
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.model.description import plain_number
from suboctave.model.projected import Recovered
from suboctave.model.system import System, build, describe

if TYPE_CHECKING:
    import xarray


def to_json(value: Any) -> str:
    """A value as JSON text; InputError for what cannot be written."""
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def from_json(text: str, classes: Mapping[str, type] | None = None) -> Any:
    """The value that `to_json` wrote; `classes` are the dataclasses that may occur, by name."""
    try:
        return _value(json.loads(text), classes or {})
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise InputError(f"this is no record of suboctave: {type(error).__name__}: {error}") from None


def _plain(value: Any) -> Any:
    number = plain_number(value)
    if number is not NotImplemented:
        return number
    if isinstance(value, numbers.Complex):
        pair = complex(value)
        return {"complex": [_plain(pair.real), _plain(pair.imag)]}
    if isinstance(value, tuple):
        return {"tuple": [_plain(item) for item in value]}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return {"ndarray": [value.dtype.str, list(value.shape), _plain(value.ravel().tolist())]}
    if isinstance(value, Mapping):
        if all(isinstance(name, str) for name in value) and len(value) != 1:
            return {name: _plain(item) for name, item in value.items()}
        return {"items": [[_plain(name), _plain(item)] for name, item in value.items()]}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
        return {"object": [type(value).__name__, fields]}
    raise InputError(f"{type(value).__name__} cannot be written to a file: {value!r}")


def _value(plain: Any, classes: Mapping[str, type]) -> Any:
    if isinstance(plain, list):
        return [_value(item, classes) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if len(plain) == 1:
        ((what, inside),) = plain.items()
        match what:
            case "float":
                return float(inside)
            case "complex":
                return complex(*(_value(part, classes) for part in inside))
            case "tuple":
                return tuple(_value(item, classes) for item in inside)
            case "ndarray":
                dtype, shape, flat = inside
                return np.array(_value(flat, classes), dtype=np.dtype(dtype)).reshape(shape)
            case "items":
                return {_value(name, classes): _value(item, classes) for name, item in inside}
            case "object":
                name, fields = inside
                return classes[name](**{key: _value(item, classes) for key, item in fields.items()})
    return {name: _value(item, classes) for name, item in plain.items()}


# --------------------------------------------------------------------------------------------------------------- arrays
_PARTS = ("real", "imag")


def flat(variables: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    """Variables (dimensions, values, ...) with complex ones as pairs `..._real`, `..._imag`, objects as texts.

    What is recovered from coordinates stays so until it is read.
    """
    for name, (dims, values, *attributes) in variables.items():
        if isinstance(values, Recovered):
            yield from _read_later(str(name), dims, values, attributes)
            continue
        array = np.asarray(values)
        if array.dtype.kind == "c":
            for part in _PARTS:
                yield f"{name}_{part}", (dims, getattr(array, part), *attributes)
        else:
            yield str(name), (dims, array.astype(str) if array.dtype.kind == "O" else array, *attributes)


def _read_later(name: str, dims: Any, values: Recovered, attributes: Any) -> Iterator[tuple[str, Any]]:
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Later(BackendArray):
        """What an index of a variable asks for."""

        def __init__(self, source: Recovered) -> None:
            self.source, self.shape, self.dtype = source, source.shape, source.dtype

        def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
            support = indexing.IndexingSupport.BASIC
            return indexing.explicit_indexing_adapter(key, self.shape, support, self.source.__getitem__)

    parts = {name: values}
    if values.dtype.kind == "c":
        parts = {f"{name}_{part}": Recovered(getattr(values.coordinates, part), values.shapes) for part in _PARTS}
    for own, part in parts.items():
        yield own, (dims, indexing.LazilyIndexedArray(Later(part)), *attributes)


def array_of(dataset: xarray.Dataset, name: str) -> np.ndarray:
    """A variable that `flat` wrote, complex again if it was."""
    if name in dataset:
        return np.asarray(dataset[name].values)
    real, imag = (np.asarray(dataset[f"{name}_{part}"].values) for part in _PARTS)
    # arithmetic would change zeros and spread what is not finite
    joined = np.empty(real.shape, dtype=complex)
    joined.real, joined.imag = real, imag
    return joined


def padded(rows: Sequence[Any], kind: type) -> np.ndarray:
    """Rows of several lengths as a table, nan behind the shorter ones."""
    table: np.ndarray = np.full((len(rows), max((len(row) for row in rows), default=0)), np.nan, dtype=kind)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


# ---------------------------------------------------------------------------------- datasets with a record and systems
def written_system(system: System) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """A system as plain data, and its large arrays."""
    arrays: dict[str, np.ndarray] = {}
    return describe(system, arrays), arrays


def system_arrays(dataset: xarray.Dataset) -> dict[str, np.ndarray]:
    """The large arrays of systems among the variables of a file, by the names that descriptions have for them."""
    return {
        str(name)[len("system_") :]: np.asarray(variable.values)
        for name, variable in dataset.variables.items()
        if str(name).startswith("system_array_")
    }


def recorded(
    dataset: xarray.Dataset,
    record: Mapping[str, Any],
    meaning: str,
    arrays: Mapping[str, np.ndarray] | None = None,
    variables: Mapping[str, Any] | None = None,
) -> xarray.Dataset:
    """A dataset as a file can hold it: with further `variables`, and what is no array as JSON in `record`.

    `meaning`: of the record; `arrays`: the large ones of the systems in it (`describe`).
    """
    import xarray

    every = {str(name): (v.dims, v.values, v.attrs) for name, v in dataset.variables.items()} | dict(variables or {})
    every["record"] = ((), np.array(to_json(record), dtype=object), {"long_name": meaning})
    for name, array in (arrays or {}).items():
        every[f"system_{name}"] = (tuple(f"system_{name}_{i}" for i in range(array.ndim)), array)
    # a parameter that bears the name of a variable is in `parameters` all the same
    coordinates = [name for name in dataset.coords if name not in (variables or ())]
    stored = xarray.Dataset(dict(flat(every)), attrs=dataset.attrs)
    return stored.set_coords([name for name in coordinates if name in stored])


class Recorded:
    """A dataset that `recorded` wrote: its `record`, its arrays by name, and the systems in it."""

    def __init__(self, dataset: xarray.Dataset, allow_code: bool, classes: Mapping[str, type] | None = None) -> None:
        self.dataset = dataset
        self.record: dict[str, Any] = from_json(str(dataset["record"].item()), classes)
        self._allow_code = allow_code
        self._arrays: dict[str, np.ndarray] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        """A variable, complex where it was; each put together once."""
        if name not in self._arrays:
            self._arrays[name] = array_of(self.dataset, name)
        return self._arrays[name]

    def system(self, described: Mapping[str, Any]) -> System:
        """A system of the record."""
        return build(described, system_arrays(self.dataset), self._allow_code)
