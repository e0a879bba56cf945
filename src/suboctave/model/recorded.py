"""Objects that remember how they were made, so that a system can be written down and made again.

A class that derives from `Recorded` is known by name as soon as it is defined: elements and loads of the package by
their plain names ("CubicSpring"), those of a user as "module:Class". Nothing has to be listed anywhere.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

__all__ = ["Recorded", "known_kinds", "type_name"]

_PACKAGE = "suboctave."
_KNOWN: dict[str, type[Recorded]] = {}


class Recorded:
    """Keeps the constructor's arguments by name in `arguments`.

    `family` says what a class is to a system ("element", "load"); it is set by the class that roots the family.
    """

    family: ClassVar[str] = ""
    arguments: Mapping[str, Any]

    def __init_subclass__(cls, family: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        if family:
            cls.family = family
        _KNOWN[type_name(cls)] = cls

    def __new__(cls, *positional: Any, **named: Any) -> Any:
        made = super().__new__(cls)
        try:
            bound = _signature(cls).bind(made, *positional, **named)
        except TypeError:  # unpickling passes none; what is really wrong is refused by __init__
            return made
        given = {name: _kept(value) for name, value in list(bound.arguments.items())[1:]}
        for parameter in _signature(cls).parameters.values():
            if parameter.kind is parameter.VAR_KEYWORD:
                given |= given.pop(parameter.name, {})
        made.arguments = given
        return made


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


def _signature(cls: type) -> inspect.Signature:
    return inspect.signature(cls.__init__)  # type: ignore[misc]


def _kept(value: Any) -> Any:
    """A value that later changes to a list or an array cannot reach."""
    return copy.deepcopy(value) if isinstance(value, list | dict | np.ndarray | tuple) else value
