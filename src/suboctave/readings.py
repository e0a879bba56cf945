"""How single values and collections are read: what they must be, in words, and the value to use or `Unfit`.

`arguments` makes a `Reading` of every annotation of these.
"""

from __future__ import annotations

import collections.abc
import inspect
import math
import numbers
import os
import typing
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from suboctave.errors import suggest

#: the largest whole number that is taken: what a machine integer holds
_LARGEST = 2**63 - 1


class Rule(NamedTuple):
    """What values of an annotated type are allowed: in words, and by a function of the value; `several` of them."""

    words: str
    holds: Callable[[Any], bool]
    several: str = ""


class Unfit(Exception):
    """A value that does not fit: what it must be, itself, and its place in the argument."""

    def __init__(self, words: str, value: Any, place: tuple[Any, ...] = (), hint: str = "") -> None:
        super().__init__()
        self.words, self.value, self.place, self.hint = words, value, place, hint

    def at(self, key: Any) -> Unfit:
        """The same of a part."""
        return Unfit(self.words, self.value, (key, *self.place), self.hint)


class Reading(NamedTuple):
    """How values of an annotation are read: in words, of one and of several, and the value to use or `Unfit`."""

    words: str
    several: str
    read: Callable[[Any], Any]


# ------------------------------------------------------------------------------------------------------ single values
def _anything(value: Any) -> Any:
    return value


def _reading(words: str, fits: Callable[[Any], bool], several: str = "") -> Reading:
    def read(value: Any) -> Any:
        if fits(value):
            return value
        raise Unfit(words, value)

    return Reading(words, several or words.split(" ", 1)[-1] + "s", read)


def _is_real(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    try:
        float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False
    return True


def _is_finite(value: Any) -> bool:
    return _is_real(value) and math.isfinite(value)


def _is_text(value: Any) -> bool:
    if not isinstance(value, str):
        return False
    try:
        value.encode()
    except UnicodeEncodeError:  # half a character
        return False
    return "\0" not in value


def _whole(value: Any) -> Any:
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        if -_LARGEST <= value <= _LARGEST:
            return value
        raise Unfit(f"a whole number of at most {len(str(_LARGEST)) - 1} digits", value)
    if _is_finite(value) and float(value).is_integer():
        return _whole(int(value))
    raise Unfit("a whole number", value)


def _is_file_name(value: Any) -> bool:
    if not isinstance(value, str | os.PathLike):
        return False
    name = os.fspath(value)
    return isinstance(name, str) and "\0" not in name


def _array_of(value: Any) -> Any:
    """What NumPy makes of a value; None where that is not possible, or one object."""
    if isinstance(value, set | frozenset | Mapping | bytes) or hasattr(value, "data_vars"):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.asarray(value)
    except Exception:  # ragged lists, numbers of hundreds of digits, what other packages raise
        return None


def array_reading(words: str, allowed: str) -> Reading:
    """Arrays whose entries are of these kinds of NumPy, and lists that become such."""

    def read(value: Any) -> Any:
        array = value if isinstance(value, np.ndarray) else _array_of(value)
        if array is None or array.dtype.kind not in allowed or (array.ndim == 0 and array is not value):
            raise Unfit(words, value)
        return array

    return Reading(words, words.replace("an array", "arrays"), read)


def array_like(value: Any, kinds: str = "biufcU") -> bool:
    """Whether it is a sparse matrix, or NumPy makes an array of these kinds of it: numbers and texts, no objects."""
    if hasattr(value, "toarray"):
        return True
    array = None if isinstance(value, str) else _array_of(value)
    return array is not None and array.dtype.kind in kinds


ANYTHING = Reading("anything", "anything", _anything)
NONE = _reading("None", lambda value: value is None)
_TRUTH = _reading("True or False", lambda value: isinstance(value, bool | np.bool_), "truth values")
_WHOLE = Reading("a whole number", "whole numbers", _whole)
FINITE = _reading("a finite number", _is_finite)
NUMBER = _reading("a number", _is_real)
_COMPLEX = _reading("a number", lambda v: isinstance(v, numbers.Complex) and not isinstance(v, bool))
_TEXT = _reading("a text", _is_text)
FILE = _reading("the name of a file", _is_file_name, "names of files")
ARRAY = array_reading("an array of numbers", "biufc")
_OBJECTS = array_reading("an array", "biufcUO")
ARRAY_LIKE = _reading("an array of numbers", lambda value: array_like(value, "biuf"), "arrays of numbers")
#: kinds of NumPy from which those of an array that is asked for can be made
KINDS_OF_ARRAYS = {"f": "biuf", "c": "biufc", "i": "iu", "u": "iu", "b": "b"}
SINGLE = {
    Any: ANYTHING, object: ANYTHING, None: NONE, type(None): NONE, bool: _TRUTH, int: _WHOLE, complex: _COMPLEX,
    str: _TEXT, np.ndarray: _OBJECTS, inspect.Parameter.empty: ANYTHING,
}  # fmt: skip


def instance_reading(kind: Any) -> Reading:
    """Of a class, or of one that only type checkers import, which is known by its name."""
    name = kind.__name__
    words = f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
    if isinstance(kind, Absent):
        return _reading(words, lambda value: any(base.__name__ == name for base in type(value).__mro__))
    if typing.is_typeddict(kind):
        return mapping_reading(_TEXT, ANYTHING)
    if getattr(kind, "_is_protocol", False):
        wanted = [part for part in {*vars(kind), *vars(kind).get("__annotations__", {})} if not part.startswith("_")]
        return _reading(
            words, lambda value: not isinstance(value, type) and all(hasattr(value, part) for part in wanted)
        )
    return _reading(words, lambda value: isinstance(value, kind))


def function_reading(arguments: Any) -> Reading:
    """A callable; where the annotation lists its arguments, one that takes so many."""
    count = len(arguments) if isinstance(arguments, list) else None
    words = "a function" + (f" of {count} argument{'s' * (count != 1)}" if count is not None else "")

    def fits(value: Any) -> bool:
        if not callable(value) or isinstance(value, type):
            return False
        try:
            if count is not None:
                inspect.signature(value).bind(*range(count))
        except TypeError:
            return False
        except ValueError:  # of some built-in functions nothing is known
            pass
        return True

    return _reading(words, fits, "functions")


def literal_reading(values: tuple[Any, ...]) -> Reading:
    words = " or ".join(map(repr, values))

    def read(value: Any) -> Any:
        if type(value) in (str, int, bool) and value in values:
            return value
        raise Unfit(words, value, hint=suggest(value, map(str, values)) if isinstance(value, str) else "")

    return Reading(words, words, read)


# --------------------------------------------------------------------------------------------------------- containers
def _is_ordered(value: Any) -> bool:
    """Whether it holds things one after the other: no text, no set, no mapping."""
    if isinstance(value, str | bytes | bytearray | Mapping | collections.abc.Set):
        return isinstance(value, collections.abc.KeysView | collections.abc.ItemsView)
    if isinstance(value, type) or not (hasattr(value, "__len__") and hasattr(value, "__iter__")):
        return False
    return bool(getattr(value, "ndim", 1) == 1 or (isinstance(value, np.ndarray) and value.ndim))


def _items(value: Any, readings: Iterator[Reading]) -> Any:
    """The same collection, or a tuple where items are read otherwise than they are written."""
    read, changed = [], False
    for i, (item, reading) in enumerate(zip(value, readings, strict=False)):
        try:
            used = reading.read(item)
        except Unfit as unfit:
            raise unfit.at(i) from None
        changed |= used is not item
        read.append(used)
    return value if isinstance(value, np.ndarray) or (not changed and isinstance(value, list | tuple)) else tuple(read)


def sequence_reading(item: Reading) -> Reading:
    words = f"a list of {item.several}" if item.several != "anything" else "a list"

    def read(value: Any) -> Any:
        if not _is_ordered(value):
            raise Unfit(words, value)
        return value if item.read is _anything else _items(value, iter(lambda: item, None))

    return Reading(words, "lists", read)


def iterable_reading(item: Reading) -> Reading:
    listed = sequence_reading(item)

    def read(value: Any) -> Any:
        if _is_ordered(value):
            return listed.read(value)
        if isinstance(value, str | bytes) or not isinstance(value, collections.abc.Iterable):
            raise Unfit(listed.words, value)
        return value

    return Reading(listed.words, listed.several, read)


def tuple_reading(readings: Sequence[Reading]) -> Reading:
    """A tuple of so many items."""
    kinds = {one.several for one in readings}
    counted = {2: "two", 3: "three"}.get(len(readings), str(len(readings)))
    words = f"{counted} {kinds.pop() if len(kinds) == 1 else 'values'}" + ", (first, second)" * (len(readings) == 2)

    def read(value: Any) -> Any:
        if not _is_ordered(value) or len(value) != len(readings):
            raise Unfit(words, value)
        return _items(value, iter(readings))

    return Reading(words, words, read)


def refuse_masked(value: Any) -> None:
    if isinstance(value, np.ma.MaskedArray) and np.ma.getmaskarray(value).any():
        raise Unfit("without masked entries: fill them, or leave them out", value)


def mapping_reading(key: Reading, item: Reading) -> Reading:
    words = f"a mapping from {key.several} to {item.several}"

    def read(value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise Unfit(words, value)
        for name, part in value.items():
            try:
                key.read(name)
                refuse_masked(part)
                item.read(part)
            except Unfit as unfit:
                raise unfit.at(name) from None
        return value

    return Reading(words, "mappings", read)


def union_reading(readings: Sequence[Reading]) -> Reading:
    shown = [one for one in dict.fromkeys(readings) if one is not NONE]
    words = [one.words for one in shown]
    text = ", ".join(words[:-1]) + (", or " if " or " in words[-1] else " or ") * (len(words) > 1) + words[-1]
    optional, alternatives = len(shown) < len(readings), [one.read for one in shown]
    if any(one.read is _anything for one in shown):
        return Reading(text, text, _anything)

    def read(value: Any) -> Any:
        if optional and value is None:
            return None
        best = None
        for alternative in alternatives:
            try:
                return alternative(value)
            except Unfit as unfit:
                if best is None or len(unfit.place) > len(best.place):
                    best = unfit
        if best is not None and best.place:  # right outside, wrong inside
            raise best
        raise Unfit(text, value)

    return Reading(text, " or ".join(one.several for one in shown), read)


def with_rules(reading: Reading, rules: Sequence[Rule]) -> Reading:
    words = next((rule.words for rule in rules if rule.words), reading.words)
    several = next((rule.several for rule in rules if rule.several), "") or (
        words.split(" ", 1)[-1] + "s" if words != reading.words else reading.several
    )

    def read(value: Any) -> Any:
        try:
            used = reading.read(value)
        except Unfit as unfit:
            raise unfit if unfit.place else Unfit(words, value) from None
        for rule in rules:
            if not rule.holds(used):
                raise Unfit(rule.words, value)
        return used

    return Reading(words, several, read)


class Absent:
    """A class that only type checkers import: known by its name."""

    def __init__(self, name: str) -> None:
        self.__name__ = name

    def __getattr__(self, name: str) -> Absent:
        if name.startswith("__"):
            raise AttributeError(name)
        return Absent(name)

    def __or__(self, other: Any) -> AbsentUnion:
        return AbsentUnion([self, other])

    def __ror__(self, other: Any) -> AbsentUnion:
        return AbsentUnion([other, self])

    def __getitem__(self, arguments: Any) -> Absent:
        return self


class AbsentUnion:
    def __init__(self, parts: Sequence[Any]) -> None:
        self.parts = tuple(parts)

    def __or__(self, other: Any) -> AbsentUnion:
        return AbsentUnion([*self.parts, other])

    def __ror__(self, other: Any) -> AbsentUnion:
        return AbsentUnion([other, *self.parts])
