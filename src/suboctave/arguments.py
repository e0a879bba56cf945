"""What arguments may be, read off annotations: one mechanism for verbs, constructors and methods.

`checked` reads the annotations of a callable when it is first called. From then on every argument that is given is
compared with its annotation, before any work: `int` is a whole number, `float` a finite number, neither is a truth
value; `str` is a text; `Sequence[str]` is an ordered collection of texts, neither a text nor a set; a class is an
instance of it. What fits nowhere raises one `InputError` of one line with the name of the argument, what it must be and
what was given. An array with masked entries fits nowhere. Names of keywords that are not known raise a `TypeError` with
the closest names that are.

A range of values is said by a `Rule`, `Annotated[float, Rule("a positive number", lambda x: x > 0)]`; `READ` says that
the callable reads an argument itself. What depends on several arguments, or on the system, is the callable's business.
"""

from __future__ import annotations

import collections.abc
import dataclasses
import functools
import inspect
import math
import numbers
import os
import sys
import types
import typing
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, shortened, suggest

Given = TypeVar("Given")
_PACKAGE = "suboctave."
#: the largest whole number that is taken: what a machine integer holds
_LARGEST = 2**63 - 1
#: the largest count of anything
_MOST = 100_000_000


#: arguments by the letters of the field that some write for them, in small letters
_SYMBOLS = {
    "m": ("mass",), "c": ("damping", "coefficient"), "k": ("stiffness", "coefficient"), "f": ("force", "amplitude"),
    "p": ("amplitude", "force"), "w": ("omega",), "mu": ("force",), "g": ("gap", "acceleration"),
}  # fmt: skip


class Rule(NamedTuple):
    """What values of an annotated type are allowed: in words, and by a function of the value."""

    words: str
    holds: Callable[[Any], bool]


#: the callable reads this argument itself
READ = Rule("", lambda value: True)
#: infinity too
ANY_SIZE = Rule("a number", lambda value: True)

Positive = Annotated[float, Rule("a positive number", lambda x: x > 0.0)]
NotNegative = Annotated[float, Rule("a number of at least 0", lambda x: x >= 0.0)]
Share = Annotated[float, Rule("a number between 0 and 1", lambda x: 0.0 < x < 1.0)]
#: without an upper end
Length = Annotated[float, Rule("a positive number", lambda x: x > 0.0), ANY_SIZE]
_FEW_ENOUGH = Rule(f"at most {_MOST}", lambda n: n <= _MOST)
Count = Annotated[int, Rule("a positive whole number", lambda n: n >= 1), _FEW_ENOUGH]
Index = Annotated[int, Rule("a whole number of at least 0", lambda n: n >= 0), _FEW_ENOUGH]
#: what the callable makes a matrix of
Matrix = Annotated[Any, Rule("a matrix of numbers", lambda value: array_like(value))]
Name = Annotated[str, Rule("a text that is not empty", bool)]
Progress = Callable[[float, str], Any] | bool | None


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
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _is_finite(value: Any) -> bool:
    try:
        return _is_real(value) and math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


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


def _array(words: str, allowed: str) -> Reading:
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


_ANYTHING = Reading("anything", "anything", _anything)
_NONE = _reading("None", lambda value: value is None)
_TRUTH = _reading("True or False", lambda value: isinstance(value, bool | np.bool_), "truth values")
_WHOLE = Reading("a whole number", "whole numbers", _whole)
_FINITE = _reading("a finite number", _is_finite)
_NUMBER = _reading("a number", _is_real)
_COMPLEX = _reading("a number", lambda v: isinstance(v, numbers.Complex) and not isinstance(v, bool))
_TEXT = _reading("a text", _is_text)
_FILE = _reading("the name of a file", _is_file_name, "names of files")
_ARRAY = _array("an array of numbers", "biufc")
_OBJECTS = _array("an array", "biufcUO")
_LIKE = _reading("an array of numbers", lambda value: array_like(value, "biuf"), "arrays of numbers")
#: kinds of NumPy from which those of an array that is asked for can be made
_KINDS = {"f": "biuf", "c": "biufc", "i": "iu", "u": "iu", "b": "b"}
_SINGLE = {
    Any: _ANYTHING, object: _ANYTHING, None: _NONE, type(None): _NONE, bool: _TRUTH, int: _WHOLE, complex: _COMPLEX,
    str: _TEXT, np.ndarray: _OBJECTS, ArrayLike: _LIKE, inspect.Parameter.empty: _ANYTHING,
}  # fmt: skip


def _instance(kind: Any) -> Reading:
    """Of a class, or of one that only type checkers import, which is known by its name."""
    name = kind.__name__
    words = f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
    if isinstance(kind, _Absent):
        return _reading(words, lambda value: any(base.__name__ == name for base in type(value).__mro__))
    if typing.is_typeddict(kind):
        return _mapping(_TEXT, _ANYTHING)
    if getattr(kind, "_is_protocol", False):
        wanted = [part for part in {*vars(kind), *vars(kind).get("__annotations__", {})} if not part.startswith("_")]
        return _reading(
            words, lambda value: not isinstance(value, type) and all(hasattr(value, part) for part in wanted)
        )
    return _reading(words, lambda value: isinstance(value, kind))


def _function(arguments: Any) -> Reading:
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


def _literal(values: tuple[Any, ...]) -> Reading:
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


def _sequence(item: Reading) -> Reading:
    words = f"a list of {item.several}" if item.several != "anything" else "a list"

    def read(value: Any) -> Any:
        if not _is_ordered(value):
            raise Unfit(words, value)
        return value if item.read is _anything else _items(value, iter(lambda: item, None))

    return Reading(words, "lists", read)


def _iterable(item: Reading) -> Reading:
    listed = _sequence(item)

    def read(value: Any) -> Any:
        if _is_ordered(value):
            return listed.read(value)
        if isinstance(value, str | bytes) or not isinstance(value, collections.abc.Iterable):
            raise Unfit(listed.words, value)
        return value

    return Reading(listed.words, listed.several, read)


def _fixed(readings: Sequence[Reading]) -> Reading:
    """A tuple of so many items."""
    kinds = {one.several for one in readings}
    counted = {2: "two", 3: "three"}.get(len(readings), str(len(readings)))
    words = f"{counted} {kinds.pop() if len(kinds) == 1 else 'values'}" + ", (first, second)" * (len(readings) == 2)

    def read(value: Any) -> Any:
        if not _is_ordered(value) or len(value) != len(readings):
            raise Unfit(words, value)
        return _items(value, iter(readings))

    return Reading(words, words, read)


def _mapping(key: Reading, item: Reading) -> Reading:
    words = f"a mapping from {key.several} to {item.several}"

    def read(value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise Unfit(words, value)
        for name, part in value.items():
            try:
                key.read(name)
                _refuse_masked(part)
                item.read(part)
            except Unfit as unfit:
                raise unfit.at(name) from None
        return value

    return Reading(words, "mappings", read)


def _union(readings: Sequence[Reading]) -> Reading:
    shown = [one for one in dict.fromkeys(readings) if one is not _NONE]
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


def _with_rules(reading: Reading, rules: Sequence[Rule]) -> Reading:
    words = next((rule.words for rule in rules if rule.words), reading.words)

    def read(value: Any) -> Any:
        try:
            used = reading.read(value)
        except Unfit as unfit:
            raise unfit if unfit.place else Unfit(words, value) from None
        for rule in rules:
            if not rule.holds(used):
                raise Unfit(rule.words, value)
        return used

    return Reading(words, words.split(" ", 1)[-1] + "s" if words != reading.words else reading.several, read)


# --------------------------------------------------------------------------------------------------------- annotations
def reading_of(annotation: Any, finite: bool = True) -> Reading:
    """How values of an annotation are read; `finite`: whether numbers are."""
    if isinstance(annotation, dataclasses.InitVar):
        return reading_of(annotation.type, finite)
    if annotation is float:
        return _FINITE if finite else _NUMBER
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        rules = [one for one in arguments[1:] if isinstance(one, Rule)]
        if READ in rules:
            return _ANYTHING
        inner = reading_of(arguments[0], finite and ANY_SIZE not in rules)
        return _with_rules(inner, rules) if rules else inner
    if origin in (Union, types.UnionType) or isinstance(annotation, _AbsentUnion):
        return _reading_of_union(list(arguments or annotation.parts), finite)
    if annotation == ArrayLike:
        return _LIKE
    if annotation is inspect.Parameter.empty or isinstance(annotation, TypeVar | str):
        return _ANYTHING
    if origin is None:
        return _single(annotation)
    return _container(origin, arguments, finite)


def _reading_of_union(members: list[Any], finite: bool) -> Reading:
    if set(get_args(ArrayLike)) <= set(members):
        return _union([_LIKE, *([_NONE] if type(None) in members else [])])
    if any(isinstance(one, type) and issubclass(one, os.PathLike) for one in members):
        members = [one for one in members if one is not str]
    if float in members:
        members = [one for one in members if one is not int]
    return _union([reading_of(one, finite) for one in members])


def _single(annotation: Any) -> Reading:
    try:
        if annotation in _SINGLE:
            return _SINGLE[annotation]
    except TypeError:  # not hashable
        return _ANYTHING
    if isinstance(annotation, type):
        if issubclass(annotation, os.PathLike):
            return _FILE
        bare: dict[Any, Reading] = {
            tuple: _sequence(_ANYTHING),
            list: _sequence(_ANYTHING),
            dict: _mapping(_ANYTHING, _ANYTHING),
        }
        if annotation in bare:
            return bare[annotation]
    if annotation in (Callable, typing.Callable):
        return _function(None)
    return _instance(annotation) if isinstance(annotation, type | _Absent) else _ANYTHING


def _container(origin: Any, arguments: tuple[Any, ...], finite: bool) -> Reading:
    if origin is Literal:
        return _literal(arguments)
    if origin is np.ndarray:
        kinds = [np.dtype(one).kind for part in arguments for one in get_args(part) if isinstance(one, type)]
        return _array("an array of numbers", _KINDS.get(kinds[0], "biufc")) if kinds else _ARRAY
    if origin is tuple and arguments[-1:] != (...,):
        return _fixed([reading_of(one, finite) for one in arguments])
    if origin is collections.abc.Callable:
        return _function(arguments[0])
    if origin in (tuple, list, collections.abc.Sequence, collections.abc.MutableSequence):
        return _sequence(reading_of(arguments[0], finite))
    if origin in (collections.abc.Iterable, collections.abc.Collection):
        return _iterable(reading_of(arguments[0], finite))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _mapping(*(reading_of(one, finite) for one in arguments))
    return _instance(origin) if isinstance(origin, type) and origin is not type else _ANYTHING


class _Absent:
    """A class that only type checkers import: known by its name."""

    def __init__(self, name: str) -> None:
        self.__name__ = name

    def __getattr__(self, name: str) -> _Absent:
        if name.startswith("__"):
            raise AttributeError(name)
        return _Absent(name)

    def __or__(self, other: Any) -> _AbsentUnion:
        return _AbsentUnion([self, other])

    def __ror__(self, other: Any) -> _AbsentUnion:
        return _AbsentUnion([other, self])

    def __getitem__(self, arguments: Any) -> _Absent:
        return self


class _AbsentUnion:
    def __init__(self, parts: Sequence[Any]) -> None:
        self.parts = tuple(parts)

    def __or__(self, other: Any) -> _AbsentUnion:
        return _AbsentUnion([*self.parts, other])

    def __ror__(self, other: Any) -> _AbsentUnion:
        return _AbsentUnion([other, *self.parts])


class _Names(dict[str, Any]):
    """The names of a module for its annotations; those that only type checkers import are `_Absent`."""

    def __missing__(self, name: str) -> Any:
        builtins = vars(sys.modules["builtins"])
        return builtins[name] if name in builtins else _Absent(name)


def _evaluated(annotation: Any, names: Mapping[str, Any]) -> Any:
    return eval(annotation, {}, _Names(names)) if isinstance(annotation, str) else annotation


# ------------------------------------------------------------------------------------------------------------ callables
class Checks(NamedTuple):
    """See `checked`."""

    hints: Mapping[str, Any]
    signature: inspect.Signature | None
    result: bool


class _Table:
    """How the arguments of a callable are read; made when it is first called."""

    def __init__(self, function: Callable[..., Any], owner: type | None, options: Checks) -> None:
        self.name = owner.__name__ if owner is not None and function.__name__ == "__init__" else function.__name__
        self.readings: dict[str, Reading] = {}
        #: names of arguments by place, and of those that have no other name to their caller
        self.places: list[str] = []
        self.unnamed: set[str] = set()
        self.rest: Reading | None = None
        self.more: Reading | None = None
        signature = options.signature or inspect.signature(function)
        for parameter in list(signature.parameters.values())[owner is not None :]:
            hint = options.hints.get(parameter.name, parameter.annotation)
            reading = reading_of(_evaluated(hint, _namespace(function, owner, parameter.name)), not options.result)
            if parameter.kind is parameter.VAR_POSITIONAL:
                self.rest = reading
            elif parameter.kind is parameter.VAR_KEYWORD:
                self.more = reading
            else:
                self.readings[parameter.name] = reading
                if parameter.kind is not parameter.KEYWORD_ONLY:
                    self.places.append(parameter.name)
                if parameter.kind is parameter.POSITIONAL_ONLY:
                    self.unnamed.add(parameter.name)

    def placed(self, given: Sequence[Any]) -> list[Any]:
        """What was given by place, read."""
        named = [self.read(name, self.readings[name], value) for name, value in zip(self.places, given, strict=False)]
        more = given[len(named) :]
        return [*named, *(more if self.rest is None else (self.read("each argument", self.rest, one) for one in more))]

    def named(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """What was given by name, read; TypeError for a name that is not known."""
        used = {}
        for name, value in given.items():
            reading = None if name in self.unnamed else self.readings.get(name)
            if reading is None and self.more is None:
                known = self.readings.keys() - self.unnamed
                meant = [word for word in _SYMBOLS.get(name.lower(), ()) if word in known]
                tail = suggest(meant[0] if meant else name, known, limit=len(known))
                raise TypeError(f"{self.name}() got an unexpected keyword argument {name!r}{tail}")
            used[name] = self.read(name, reading or self.more or _ANYTHING, value)
        return used

    def read(self, name: str, reading: Reading, value: Any) -> Any:
        """The value to use; InputError for what does not fit."""
        try:
            if isinstance(value, np.ma.MaskedArray):
                _refuse_masked(value)
            return reading.read(value)
        except Unfit as unfit:
            where = name + "".join(f"[{shortened(key)}]" for key in unfit.place)
            key = (name, *(part for part in unfit.place if isinstance(part, str | int)))
            raise InputError(f"{where} must be {unfit.words}, not {shortened(unfit.value)}{unfit.hint}", key) from None


def _refuse_masked(value: Any) -> None:
    if isinstance(value, np.ma.MaskedArray) and np.ma.getmaskarray(value).any():
        raise Unfit("without masked entries: fill them, or leave them out", value)


def _namespace(function: Callable[..., Any], owner: type | None, name: str) -> Mapping[str, Any]:
    """The names that the annotation of a parameter is written in: of a field those of the class that declares it."""
    if owner is not None and dataclasses.is_dataclass(owner) and function.__name__ == "__init__":
        for base in owner.__mro__:
            if name in vars(base).get("__annotations__", {}):
                return vars(sys.modules[base.__module__])
    return getattr(inspect.unwrap(function), "__globals__", {})


def checked(
    given: Any = None,
    *,
    hints: Mapping[str, Any] | None = None,
    signature: inspect.Signature | None = None,
    result: bool = False,
    methods: bool = True,
) -> Any:
    """A verb, or a class, whose arguments are compared with their annotations before any work.

    Of a class its constructor and, unless `methods` is False, its public methods. `hints`: annotations in the place of
    those of the signature; `signature`: in the place of the callable's own. `result`: numbers need not be finite, and
    what the package itself makes and calls by the thousand is not compared, only what comes from elsewhere.
    """
    checks = Checks(hints or {}, signature, result)
    if given is None:
        return functools.partial(checked, result=result, methods=methods)
    if not isinstance(given, type):
        return _compared(given, None, checks)
    for name, member in list(vars(given).items()):
        if name != "__init__" and (name.startswith("_") or not methods):
            continue
        kind = type(member) if isinstance(member, staticmethod | classmethod) else None
        function = member.__func__ if kind else member
        owner = None if kind is staticmethod else given
        count = len(inspect.signature(function).parameters) if isinstance(function, types.FunctionType) else 0
        if count > (owner is not None):
            wrapped = _compared(function, owner, checks)
            setattr(given, name, kind(wrapped) if kind else wrapped)
    return given


def _compared(function: Any, owner: type | None, checks: Checks) -> Any:
    first, inside = int(owner is not None), checks.result
    constructs = owner is not None and function.__name__ == "__init__"
    table: _Table | None = None

    @functools.wraps(function)
    def compared(*positional: Any, **named: Any) -> Any:
        nonlocal table
        if inside and sys._getframe(1).f_globals.get("__name__", "").startswith(_PACKAGE):
            return function(*positional, **named)
        if table is None:
            table = _Table(function, owner, checks)
        try:
            used = table.named(named)
            placed = table.placed(positional[first:])
        except InputError as error:
            if constructs:
                error.args = (f"{type(positional[0]).__name__}: {error}",)
            raise
        return function(*positional[:first], *placed, **used)

    compared.__checked__ = True  # type: ignore[attr-defined]
    return compared
