"""A labelled dataset as a block of bytes with nothing but its content: what the journal keeps and what digests are of.

A block is the length of a JSON head, the head, and the arrays one after another. The same content gives the same block,
whether it comes from memory, from the journal or from a NetCDF file: variables are sorted, texts are kept in the head,
numbers little-endian.
"""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError

if TYPE_CHECKING:
    import xarray


def pack(dataset: xarray.Dataset) -> bytes:
    """The dataset's variables and attributes (numbers and texts) as bytes."""
    head: dict[str, Any] = {"attrs": {str(k): _scalar(dataset.attrs[k]) for k in sorted(dataset.attrs, key=str)}}
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
    head["variables"] = variables
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
