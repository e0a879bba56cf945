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
import os
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, shortened, suggest
from suboctave.readings import (
    ANYTHING,
    ARRAY,
    ARRAY_LIKE,
    FILE,
    FINITE,
    KINDS_OF_ARRAYS,
    NUMBER,
    SINGLE,
    Absent,
    AbsentUnion,
    Reading,
    Rule,
    Unfit,
    array_like,
    array_reading,
    function_reading,
    instance_reading,
    iterable_reading,
    literal_reading,
    mapping_reading,
    refuse_masked,
    sequence_reading,
    tuple_reading,
    union_reading,
    with_rules,
)

Given = TypeVar("Given")
_PACKAGE = "suboctave."
_LENGTH, _REPLACE = len(_PACKAGE), vars(dataclasses)
#: the largest count of anything
_MOST = 100_000_000
#: names of keywords that a message lists
_LISTED = 6


#: arguments by the letters of the field that some write for them, in small letters
_SYMBOLS = {
    "m": ("mass",), "c": ("damping", "coefficient"), "k": ("stiffness", "coefficient"), "f": ("force", "amplitude"),
    "p": ("amplitude", "force"), "w": ("omega",), "mu": ("force",), "g": ("gap", "acceleration"),
}  # fmt: skip

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
#: a text in which bytes that are no UTF-8 may be escaped, as in the names of files
Title = Annotated[Any, Rule("a text", lambda value: isinstance(value, str))]
Name = Annotated[str, Rule("a text that is not empty", bool)]
#: of a frequency or a parameter
Range: TypeAlias = Annotated[tuple[float, float], Rule("two numbers (from, to)", lambda ends: True, "pairs (from, to)")]
Progress = Callable[[float, str], Any] | bool | None


# --------------------------------------------------------------------------------------------------------- annotations
def reading_of(annotation: Any, finite: bool = True) -> Reading:
    """How values of an annotation are read; `finite`: whether numbers are."""
    if isinstance(annotation, dataclasses.InitVar):
        return reading_of(annotation.type, finite)
    if annotation is float:
        return FINITE if finite else NUMBER
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        rules = [one for one in arguments[1:] if isinstance(one, Rule)]
        if READ in rules:
            return ANYTHING
        inner = reading_of(arguments[0], finite and ANY_SIZE not in rules)
        return with_rules(inner, rules) if rules else inner
    if origin in (Union, types.UnionType) or isinstance(annotation, AbsentUnion):
        return _reading_of_union(list(arguments or annotation.parts), finite)
    if annotation is _Numbers or annotation == ArrayLike:
        return ARRAY_LIKE
    if annotation is inspect.Parameter.empty or isinstance(annotation, TypeVar | str):
        return ANYTHING
    if origin is None:
        return _single(annotation)
    return _container(origin, arguments, finite)


def _reading_of_union(members: list[Any], finite: bool) -> Reading:
    if set(get_args(ArrayLike)) <= set(members):  # texts are members of it
        return ANYTHING
    if any(isinstance(one, type) and issubclass(one, os.PathLike) for one in members):
        members = [one for one in members if one is not str]
    if float in members:
        members = [one for one in members if one is not int]
    return union_reading([reading_of(one, finite) for one in members])


def _single(annotation: Any) -> Reading:
    try:
        if annotation in SINGLE:
            return SINGLE[annotation]
    except TypeError:  # not hashable
        return ANYTHING
    if isinstance(annotation, type):
        if issubclass(annotation, os.PathLike):
            return FILE
        bare: dict[Any, Reading] = {
            tuple: sequence_reading(ANYTHING),
            list: sequence_reading(ANYTHING),
            dict: mapping_reading(ANYTHING, ANYTHING),
        }
        if annotation in bare:
            return bare[annotation]
    if annotation in (Callable, typing.Callable):
        return function_reading(None)
    return instance_reading(annotation) if isinstance(annotation, type | Absent) else ANYTHING


def _container(origin: Any, arguments: tuple[Any, ...], finite: bool) -> Reading:
    if origin is Literal:
        return literal_reading(arguments)
    if origin is np.ndarray:
        kinds = [np.dtype(one).kind for part in arguments for one in get_args(part) if isinstance(one, type)]
        return array_reading("an array of numbers", KINDS_OF_ARRAYS.get(kinds[0], "biufc")) if kinds else ARRAY
    if origin is tuple and arguments[-1:] != (...,):
        return tuple_reading([reading_of(one, finite) for one in arguments])
    if origin is collections.abc.Callable:
        return function_reading(arguments[0])
    if origin in (tuple, list, collections.abc.Sequence, collections.abc.MutableSequence):
        return sequence_reading(reading_of(arguments[0], finite))
    if origin in (collections.abc.Iterable, collections.abc.Collection):
        return iterable_reading(reading_of(arguments[0], finite))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return mapping_reading(*(reading_of(one, finite) for one in arguments))
    return instance_reading(origin) if isinstance(origin, type) and origin is not type else ANYTHING


class _Numbers:
    """What annotations mean by ArrayLike: numbers, where NumPy takes texts for arrays too."""


class _Names(dict[str, Any]):
    """The names of a module for its annotations; those that only type checkers import are `Absent`."""

    def __missing__(self, name: str) -> Any:
        builtins = vars(sys.modules["builtins"])
        return builtins[name] if name in builtins else Absent(name)


def _evaluated(annotation: Any, names: Mapping[str, Any]) -> Any:
    return eval(annotation, {}, _Names(names, ArrayLike=_Numbers)) if isinstance(annotation, str) else annotation


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
        if len(given) > len(self.places) and self.rest is None:
            by_name = [f"{name}=" for name in self.readings if name not in self.places]
            listed = f": give others by name ({', '.join(by_name[:_LISTED])}{', ...' * (len(by_name) > _LISTED)})"
            raise TypeError(
                f"{self.name}() takes {', '.join(self.places) or 'nothing'} by place, not {len(given)} values"
                f"{listed if by_name else ''}"
            )
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
            used[name] = self.read(name, reading or self.more or ANYTHING, value)
        return used

    def read(self, name: str, reading: Reading, value: Any) -> Any:
        """The value to use; InputError for what does not fit."""
        try:
            if isinstance(value, np.ma.MaskedArray):
                refuse_masked(value)
            return reading.read(value)
        except Unfit as unfit:
            where = name + "".join(f"[{shortened(key)}]" for key in unfit.place)
            key = (name, *(part for part in unfit.place if isinstance(part, str | int)))
            hint = f": give an object, {unfit.value.__name__}()" if isinstance(unfit.value, type) else unfit.hint
            raise InputError(f"{where} must be {unfit.words}, not {shortened(unfit.value)}{hint}", key) from None


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
        if inside:
            frame = sys._getframe(1)
            # `dataclasses.replace` makes what its caller asks for
            frame = frame.f_back or frame if frame.f_globals is _REPLACE else frame
            if frame.f_globals.get("__name__", "")[:_LENGTH] == _PACKAGE:
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
