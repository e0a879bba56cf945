"""Datasets in NetCDF-4 files, by HDF5 alone.

A NetCDF-4 file is an HDF5 file (NetCDF User's Guide, appendix C): a variable is a dataset, a dimension is a dimension
scale, which is the variable of its name where that lies along it and a dataset without values otherwise. What xarray
adds is kept: truth values are bytes with the attribute `dtype`, coordinates that name no dimension stand in the
attribute `coordinates` of their group. xarray reads such files itself; for the forty small variables of a curve its own
way through h5netcdf takes five times as long.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py
    import xarray

#: attributes of HDF5's dimension scales and of NetCDF, which are none of ours
_OF_NETCDF = {
    *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"),
    *("_FillValue", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_NCProperties", "_nc3_strict"),
}
#: how the scale of a dimension says that it is no variable; its length follows
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
#: what NetCDF puts before the name of a variable that is also that of a dimension it does not lie along
_NO_SCALE = "_nc4_non_coord_"
#: number of values from which on they are compressed
_COMPRESSED = 256


def write_group(group: h5py.Group, dataset: xarray.Dataset) -> None:
    """A dataset into a new group."""
    import h5py

    for name, value in dataset.attrs.items():
        group.attrs[str(name)] = value if isinstance(value, str) else np.atleast_1d(value)
    named = [str(name) for name in dataset.coords if name not in dataset.dims]
    if named:
        group.attrs["coordinates"] = " ".join(named)
    items: dict[str, h5py.Dataset] = {}
    for key, variable in dataset.variables.items():
        name, values = str(key), np.asarray(variable.values)
        attributes = {str(text): value for text, value in variable.attrs.items()}
        stored: dict[str, Any] = {}
        if values.dtype.kind in "OU":
            values, stored = values.astype(object), {"dtype": h5py.string_dtype()}
        elif values.dtype.kind == "b":
            values, attributes = values.astype(np.int8), {**attributes, "dtype": "bool"}
        if values.dtype.kind != "O" and values.size > _COMPRESSED:
            stored = {"compression": "gzip", "shuffle": True}
        along = name not in dataset.sizes or variable.dims == (name,)
        items[name] = group.create_dataset(name if along else _NO_SCALE + name, data=values, **stored)
        for text, value in attributes.items():
            items[name].attrs[text] = value
    _add_dimensions(group, dataset, items)


def _add_dimensions(group: h5py.Group, dataset: xarray.Dataset, items: Mapping[str, h5py.Dataset]) -> None:
    scales: dict[Any, h5py.Dataset] = {}
    for number, (name, size) in enumerate(dataset.sizes.items()):
        if name in dataset.variables and dataset.variables[name].dims == (name,):
            scale, meaning = items[str(name)], str(name)
        else:
            scale, meaning = group.create_dataset(str(name), (size,), ">f4"), f"{_NO_VARIABLE}{size:10d}"
        scale.make_scale(meaning)
        scale.attrs["_Netcdf4Dimid"] = np.int32(number)
        scales[name] = scale
    for name, variable in dataset.variables.items():
        if variable.dims != (name,):
            for axis, dimension in enumerate(variable.dims):
                items[str(name)].dims[axis].attach_scale(scales[dimension])


def read_group(group: h5py.Group) -> xarray.Dataset:
    """The dataset of a group; groups within it are others."""
    import h5py
    import xarray

    variables: dict[str, Any] = {}
    coordinates: set[str] = set()
    for key, item in group.items():
        if not isinstance(item, h5py.Dataset):
            continue
        held = dict(item.attrs)
        meaning = held.get("NAME", b"")
        if (meaning.decode() if isinstance(meaning, bytes) else str(meaning)).startswith(_NO_VARIABLE):
            continue
        name = key.removeprefix(_NO_SCALE)
        if "DIMENSION_LIST" in held:
            dims = [group[axis[0]].name.rpartition("/")[2] for axis in held["DIMENSION_LIST"]]
        else:
            dims = [name] * item.ndim
        attributes = _attributes(held)
        coordinates |= {name} & set(dims) | set(str(attributes.pop("coordinates", "")).split())
        if h5py.check_string_dtype(item.dtype):
            values = np.asarray(item.asstr()[()], dtype=object)
        else:
            values = item[()]
        if attributes.get("dtype") == "bool":
            del attributes["dtype"]
            values = np.asarray(values, dtype=bool)
        variables[name] = (dims, values, attributes)
    attributes = _attributes(dict(group.attrs))
    coordinates |= set(str(attributes.pop("coordinates", "")).split())
    return xarray.Dataset(variables, attrs=attributes).set_coords(coordinates)


def _attributes(held: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes of a group or a variable, of which NetCDF keeps numbers as arrays of one."""
    given = {key: value for key, value in held.items() if key not in _OF_NETCDF}
    return {key: value[0] if np.shape(value) == (1,) else value for key, value in given.items()}
