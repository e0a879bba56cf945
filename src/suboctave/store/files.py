"""Results as NetCDF files: written beside their place, synced and renamed; read back only if nothing has changed.

One curve is the file's root group; a study has a group for each analysis, a diagram one inside it for each branch.
Every group carries a digest of its content in the attribute `digest`, so that damage is noticed even where HDF5 itself
does not.

Digests are of blocks of bytes with nothing but a dataset's content, which the journal keeps, too.
A block is the length of a JSON head, the head, and the arrays one after another. The same content gives the same block,
whether it comes from memory, from the journal or from a NetCDF file: variables are sorted, texts are kept in the head,
numbers little-endian.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.atomic import replace_file
from suboctave.errors import InputError, path_of
from suboctave.store.layout import LAYOUT, check_layout
from suboctave.store.netcdf import read_group, write_group
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


_AGAIN = "run the study again, or take a copy that is whole"


def write(path: Path, groups: Mapping[str, xarray.Dataset], attributes: Mapping[str, Any]) -> None:
    """The datasets as groups of one file (the name "" is the root), with attributes on the root."""
    import h5py
    import xarray

    def make(place: Path) -> None:
        root = groups.get("", xarray.Dataset()).assign_attrs(attributes)
        with h5py.File(place, "w") as file:
            for name, dataset in {"": root, **{name: part for name, part in groups.items() if name}}.items():
                stated = dataset.assign_attrs(layout=LAYOUT, suboctave=__version__)
                group = file.require_group(name) if name else file
                write_group(group, stated.assign_attrs(digest=digest(stated)))

    replace_file(path, make)


def read(path: str | Path) -> dict[str, xarray.Dataset]:
    """The groups of a results file, by name, each whole and unchanged.

    Raises InputError for what is missing, no results file, damaged, or written by a newer version.
    """
    source = path_of(path)
    if not source.exists():
        raise InputError(f"there is no file {source}")
    if source.is_dir():
        raise InputError(f"{source} is a folder, not a results file")
    try:
        with open(source, "rb") as file:
            start = file.read(8)
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror}") from None
    if start != b"\x89HDF\r\n\x1a\n":
        what = "it is empty" if not start else "it is not a NetCDF (HDF5) file"
        raise InputError(f"{source} is no results file of suboctave: {what}")
    try:
        groups = _read_groups(source)
    except InputError:
        raise
    except Exception as error:  # what a damaged file makes of the HDF5 library is anyone's guess
        raise InputError(f"{source} is damaged or cut short ({_first_line(error)}): {_AGAIN}") from None
    for name, dataset in groups.items():
        _check(f"the part {name!r} of {source}" if name else str(source), dataset)
        dataset.attrs = {key: _scalar(value) for key, value in dataset.attrs.items()}
    return groups


def _read_groups(source: Path) -> dict[str, xarray.Dataset]:
    import h5py

    with h5py.File(source, "r") as file:
        check_layout(file.attrs, str(source))
        parts: dict[str, h5py.Group] = {"": file}
        file.visititems(lambda name, item: parts.update({name: item}) if isinstance(item, h5py.Group) else None)
        return {name: read_group(group) for name, group in parts.items()}


def _check(part: str, dataset: xarray.Dataset) -> None:
    """That the content of a part of a file is what was written."""
    stated = dataset.attrs.pop("digest", None)
    if stated is None:
        raise InputError(f"{part} has no digest: it was changed by another program; {_AGAIN}")
    try:
        computed = digest(dataset)
    except Exception as error:  # attributes and texts that no writer of ours has made
        raise InputError(f"{part} is damaged ({_first_line(error)}): {_AGAIN}") from None
    if computed != stated:
        raise InputError(f"{part} is damaged: its content is not what was written; {_AGAIN}")


def _first_line(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0][:120]}" if text else type(error).__name__


# --------------------------------------------------------------------------------------------------------------- blocks
def pack(dataset: xarray.Dataset) -> bytes:
    """The dataset's variables and attributes (numbers and texts) as bytes."""
    variables: list[dict[str, Any]] = []
    bodies: list[bytes] = []
    for name in sorted(dataset.variables, key=str):
        variable = dataset.variables[name]
        array = np.asarray(variable.values)
        entry: dict[str, Any] = {
            "name": str(name),
            "dims": [str(d) for d in variable.dims],
            "shape": list(array.shape),
            "coordinate": name in dataset.coords,
            "long_name": str(variable.attrs.get("long_name", "")),
        }
        if array.dtype.kind in "OU":
            entry["texts"] = [str(text) for text in array.ravel()]
        else:
            plain = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
            entry["dtype"] = plain.dtype.str
            bodies.append(plain.tobytes())
        variables.append(entry)
    attributes = {str(name): _scalar(dataset.attrs[name]) for name in sorted(dataset.attrs, key=str)}
    head = {"attrs": attributes, "variables": variables}
    text = json.dumps(head, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "surrogatepass")
    return b"".join([len(text).to_bytes(8, "little"), text, *bodies])


def unpack(block: bytes) -> xarray.Dataset:
    """The dataset of a block."""
    import xarray

    try:
        end = 8 + int.from_bytes(block[:8], "little")
        head = json.loads(block[8:end].decode("utf-8", "surrogatepass"))
        variables: dict[str, Any] = {}
        coordinates: dict[str, Any] = {}
        for entry in head["variables"]:
            shape = tuple(entry["shape"])
            if "texts" in entry:
                array = np.array(entry["texts"], dtype=object).reshape(shape)
            else:
                dtype = np.dtype(entry["dtype"])
                count = int(np.prod(shape, dtype=np.int64))
                array = np.frombuffer(block, dtype, count, end).reshape(shape).copy()
                end += count * dtype.itemsize
            attributes = {"long_name": entry["long_name"]} if entry["long_name"] else {}
            place = coordinates if entry["coordinate"] else variables
            place[entry["name"]] = (tuple(entry["dims"]), array, attributes)
        return xarray.Dataset(variables, coordinates, head["attrs"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"a record is damaged: {type(error).__name__}: {error}") from None


def digest(dataset: xarray.Dataset) -> str:
    """SHA-256 of the dataset's content, in hexadecimal."""
    return hashlib.sha256(pack(dataset)).hexdigest()


def _scalar(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.item()
    if not isinstance(value, str | int | float):
        raise InputError(f"an attribute must be a number or a text, not {value!r}")
    return value
