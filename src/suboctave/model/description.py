"""Elements and loads as plain data, and back, bit for bit.

A part is written as `{"type": name, argument: value, ...}` with the arguments that it was made with, which a class that
derives from `Recorded` keeps by itself. Such a class is known by name as soon as it is defined: elements and loads of
the package by their plain names ("CubicSpring"), those of a user as "module:Class". Plain data are what JSON can hold:
numbers, texts, lists, mappings; floating-point numbers survive JSON unchanged. Large arrays may be kept outside, in a
mapping that the caller provides.

Nothing that a description says is executed. A user's own class is found if it is already defined in this process;
modules are imported, and Python functions looked up, only with `allow_code=True`.
"""

from __future__ import annotations

import copy
import importlib
import inspect
import math
import numbers
import pkgutil
from collections.abc import Mapping, MutableMapping
from typing import Annotated, Any, ClassVar

import numpy as np

from suboctave.arguments import READ, checked
from suboctave.errors import InputError, located, shortened, suggest
from suboctave.model.expressions.coefficients import Coefficient, restored
from suboctave.model.updated import Updated

Arrays = MutableMapping[str, np.ndarray]
_PACKAGE = "suboctave."
_KNOWN: dict[str, type[Recorded]] = {}
#: entries from which on an array is kept outside the description, where there is an outside
_LARGE = 64
#: keys that say what a mapping stands for
_MARKS = frozenset({"float", "expression", "array", "stored", "sparse", "updated", "mapping", "callable", "type"})
_DTYPES = ("|b1", *(f"{order}{kind}{size}" for order in "<>|" for kind in "iuf" for size in (1, 2, 4, 8)))
#: what a matrix in compressed-row form consists of
_SPARSE = ("data", "indices", "indptr")
_NO_CODE = "it names Python code, which is used only if you allow it (allow_code=True, or --allow-code)"


class Recorded:
    """Keeps the constructor's arguments by name in `arguments`.

    `family` says what a class is to a system ("element", "load"); it is set by the class that roots the family.
    """

    family: ClassVar[str] = ""
    arguments: Mapping[str, Any]

    def __init_subclass__(cls, family: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        if cls.__module__.startswith(_PACKAGE):
            checked(cls, methods=False, hints={"direction": Annotated[Any, READ]})
        if family:
            cls.family = family
        _KNOWN[type_name(cls)] = cls

    def __new__(cls, *positional: Any, **named: Any) -> Any:
        made = super().__new__(cls)
        try:
            bound = _signature(cls).bind(made, *positional, **named)
        except TypeError:  # unpickling passes none; what is really wrong is refused by __init__
            return made
        # copies: later changes to a list or an array that was given cannot reach them
        given = {
            name: copy.deepcopy(value) if isinstance(value, list | dict | np.ndarray | tuple) else value
            for name, value in list(bound.arguments.items())[1:]
        }
        for parameter in _signature(cls).parameters.values():
            if parameter.kind is parameter.VAR_KEYWORD:
                given |= given.pop(parameter.name, {})
        made.arguments = given
        return made

    def __repr__(self) -> str:
        """The call that makes it, texts without quotes."""
        given = {name: value for name, value in self.arguments.items() if value is not None}
        return f"{type(self).__name__}({', '.join(f'{name}={_shown(value)}' for name, value in given.items())})"


def type_name(cls: type) -> str:
    """How a class is called in files: "CubicSpring", or "module:Class" for one of a user's."""
    return cls.__name__ if cls.__module__.startswith(_PACKAGE) else f"{cls.__module__}:{cls.__qualname__}"


def known_kinds(family: str) -> dict[str, type[Recorded]]:
    """The concrete classes of a family ("element", "load") that have been defined so far, by name."""
    return {
        name: cls
        for name, cls in _KNOWN.items()
        if cls.family == family and not inspect.isabstract(cls) and not cls.__name__.startswith("_")
    }


def constructor_arguments(cls: type) -> list[str]:
    """The names of the arguments that a class takes."""
    kinds = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return [p.name for p in list(_signature(cls).parameters.values())[1:] if p.kind not in kinds]


def _signature(cls: Any) -> inspect.Signature:
    return inspect.signature(cls.__init__)


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple | np.ndarray):
        return f"({', '.join(map(_shown, value[:4]))}{', ...' * (len(value) > 4)})"
    if isinstance(value, np.generic):
        value = value.item()
    if callable(value):  # by name: where it lies in memory says nothing
        return getattr(value, "__name__", type(value).__name__)
    return value if isinstance(value, str) else value.text if isinstance(value, Coefficient) else shortened(value)


# ------------------------------------------------------------------------------------------------------------- parts
def describe_part(part: Any, arrays: Arrays | None = None) -> dict[str, Any]:
    """An element or load as `{"type": name, argument: value, ...}`."""
    kind = type(part)
    given = getattr(part, "arguments", None)
    if not isinstance(part, Recorded) or given is None:
        raise InputError(f"{part!r} cannot be written down: it does not know the arguments it was made with")
    if "<" in kind.__qualname__:
        raise InputError(f"{kind.__qualname__} cannot be written down: define it at the top of a module")
    with located(owner=repr(part)):
        return {"type": type_name(kind)} | {name: plain_value(value, arrays) for name, value in given.items()}


def build_part(
    item: Mapping[str, Any],
    family: str,
    arrays: Mapping[str, np.ndarray] | None = None,
    allow_code: bool = False,
) -> Any:
    """The element or load (`family`) of `{"type": name, argument: value, ...}`; InputError for anything wrong in it."""
    if not isinstance(item, Mapping):
        raise InputError(f"an {family} is a table with a type, not {item!r}")
    given = dict(item)
    if "type" not in given:
        raise InputError(f"the {family} has no type{suggest('', known_kinds(family))}")
    with located("type"):
        kind = _kind(given.pop("type"), family, allow_code)
    known = constructor_arguments(kind)
    for name in given:
        if name not in known:
            raise InputError(f"{kind.__name__} has no argument {name!r}{suggest(str(name), known)}", (name,))
    try:
        return kind(**{name: from_plain(value, arrays or {}, allow_code) for name, value in given.items()})
    except InputError:
        raise
    except (TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{kind.__name__}: {error}") from None


def _kind(name: Any, family: str, allow_code: bool) -> type:
    known = known_kinds(family)
    if not isinstance(name, str):
        raise InputError(f"the type of an {family} is a text, not {name!r}")
    if name not in known and ":" in name:
        if not allow_code:
            raise InputError(f"the {family} {name!r} is not defined in this process: {_NO_CODE}")
        _import(name.partition(":")[0])
        known = known_kinds(family)
    if name not in known:
        raise InputError(f"there is no {family} {name!r}{suggest(name, known)}")
    return known[name]


def _import(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except Exception as error:  # whatever happens while a user's module runs
        raise InputError(f"cannot import the module {module!r}: {type(error).__name__}: {error}") from None


# ------------------------------------------------------------------------------------------------------------ values
def plain_number(value: Any) -> Any:
    """A number, text, truth value or None as JSON holds it, `{"float": "inf"}` and the like for what it cannot hold.

    NotImplemented for anything else.
    """
    if value is None or isinstance(value, bool | str | np.bool_):
        return bool(value) if isinstance(value, np.bool_) else value
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        number = float(value)
        return number if math.isfinite(number) else {"float": repr(number)}
    return NotImplemented


def plain_value(value: Any, arrays: Arrays | None = None) -> Any:
    """An argument as plain data."""
    number = plain_number(value)
    if number is not NotImplemented:
        return number
    if isinstance(value, Coefficient):
        return {"expression": value.text, "by": list(value.by)} if value.by else {"expression": value.text}
    if isinstance(value, np.ndarray):
        return _plain_array(value, arrays)
    if isinstance(value, Updated):
        return {"updated": [plain_value(part, arrays) for part in (value.sparse, value.columns, value.weights)]}
    if hasattr(value, "tocsr"):
        rows = value.tocsr()
        parts = {name: plain_value(np.asarray(getattr(rows, name)), arrays) for name in _SPARSE}
        return {"sparse": {**parts, "shape": list(rows.shape)}}
    if isinstance(value, list | tuple):
        return [plain_value(item, arrays) for item in value]
    if isinstance(value, Mapping):
        if not all(isinstance(name, str | int) for name in value):
            raise InputError(f"cannot be written down: the keys of {value!r} are neither texts nor whole numbers")
        pairs = {str(name): plain_value(item, arrays) for name, item in value.items()}
        return {"mapping": [list(pair) for pair in pairs.items()]} if pairs.keys() & _MARKS else pairs
    if isinstance(value, Recorded):
        return describe_part(value, arrays)
    if callable(value):
        return {"callable": _place_of(value)}
    raise InputError(f"cannot be written down: an argument is a {type(value).__name__}, {value!r}")


def from_plain(value: Any, arrays: Mapping[str, np.ndarray], allow_code: bool = False) -> Any:
    """The argument that `plain_value` wrote."""
    if isinstance(value, list):
        return [from_plain(item, arrays, allow_code) for item in value]
    if not isinstance(value, Mapping):
        return value
    match dict(value):
        case {"float": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"expression": str()}:
            return restored(value["expression"], value.get("by", ()))
        case {"array": _, "dtype": _, "shape": _} | {"stored": str()} | {"sparse": Mapping()}:
            return _read_array(value, arrays)
        case {"updated": [sparse, columns, weights]}:
            return Updated(*(_read_array(part, arrays) for part in (sparse, columns, weights)))
        case {"mapping": list() as pairs}:
            return {name: from_plain(item, arrays, allow_code) for name, item in pairs}
        case {"callable": str() as place}:
            return _callable(place, allow_code)
        case {"type": str() as name}:
            family = next((f for f in ("element", "load") if name in known_kinds(f)), "element")
            return build_part(value, family, arrays, allow_code)
    return {
        int(name) if isinstance(name, str) and name.isdecimal() else name: from_plain(item, arrays, allow_code)
        for name, item in value.items()
    }


def _place_of(function: Any) -> str:
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", None)
    try:
        there = pkgutil.resolve_name(f"{module}:{name}")
    except (AttributeError, ImportError, ValueError):
        there = None
    if there is not function:
        raise InputError(f"cannot be written down: {function!r} is no function at the top of a module")
    return f"{module}:{name}"


def _callable(place: str, allow_code: bool) -> Any:
    module, _, name = place.partition(":")
    if not module or not name:
        raise InputError(f"write a Python function as 'module:function', not {place!r}")
    if not allow_code:
        raise InputError(f"the function {place!r} is not called: {_NO_CODE}")
    item = _import(module)
    for part in name.split("."):
        if not hasattr(item, part):
            raise InputError(f"the module {module!r} has no {name!r}{suggest(name, dir(item), 4)}")
        item = getattr(item, part)
    return item


def _plain_array(array: np.ndarray, arrays: Arrays | None) -> Any:
    if array.dtype.kind not in "fiub":
        return [plain_value(item, arrays) for item in array.tolist()]
    if arrays is not None and array.size > _LARGE:
        key = f"array_{len(arrays)}"
        arrays[key] = np.array(array)
        return {"stored": key}
    if not np.isfinite(array).all():
        raise InputError("cannot be written down: an array has entries that are not finite")
    return {"array": array.tolist(), "dtype": array.dtype.str, "shape": list(array.shape)}


def _read_array(value: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Any:
    """An array, or a sparse matrix."""
    try:
        if "sparse" in value:
            import scipy.sparse

            parts = tuple(_read_array(value["sparse"][name], arrays) for name in _SPARSE)
            return scipy.sparse.csr_array(parts, shape=tuple(value["sparse"]["shape"]))
        if "stored" in value:
            if value["stored"] not in arrays:
                raise InputError(f"the array {value['stored']!r} that the description refers to is missing")
            return np.array(arrays[value["stored"]])
        if value["dtype"] not in _DTYPES:
            raise ValueError(f"no array of {value['dtype']!r}")
        return np.array(value["array"], dtype=value["dtype"]).reshape(value["shape"])
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"this is not an array: {error}") from None
