"""Options, contacts, audits and the like as plain data that JSON holds, and back without loss.

Tuples, complex numbers, numbers that are not finite, arrays and dataclasses are wrapped in a mapping of one key that
says what they are. Dataclasses come back only as one of the classes that the reader names: a file cannot choose.
"""

from __future__ import annotations

import dataclasses
import json
import numbers
from collections.abc import Mapping
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.model.description import plain_number


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
