"""What the package raises, how it helps with a misspelt name, and how it reads what users give.

Every message says what happened, where, and what to change. Wrong input is refused before any work.
"""

from __future__ import annotations

import difflib
import math
import numbers
import os
import re
import reprlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

Key = tuple[str | int, ...]

#: a degree of freedom as users give it: its number from 0, its name "1042 z", or (node, direction)
GivenDof: TypeAlias = int | str | tuple[int | str, int | str]


def printable(text: str) -> str:
    r"""A text that can be printed and saved: bytes of a file name that are no UTF-8 are written as \xe4."""
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:  # half a character that no file name has
        return text.encode("utf-8", "backslashreplace").decode("utf-8")


class SuboctaveError(Exception):
    """Anything that this package refuses or cannot do."""

    def __str__(self) -> str:
        return printable(Exception.__str__(self))


class InputError(SuboctaveError, ValueError):
    """Wrong input, refused before any work was done.

    key
        The part of the input that is wrong, from the outside in: ("elements", 2, "dof"); empty where that is all of it.
    parts
        The single mistakes of which it tells.
    """

    def __init__(self, message: str = "", key: Key = (), parts: Iterable[InputError] = ()) -> None:
        super().__init__(message)
        self.key = key
        self._parts = tuple(parts)

    @property
    def parts(self) -> tuple[InputError, ...]:
        """See the class."""
        return self._parts or (self,)


class UnknownName(InputError, KeyError):
    """A name that a mapping does not have; a KeyError too, so that `in` and `get` answer as those of a dictionary."""


def refuse_idle(why: str, **given: bool) -> None:
    """Refuse options that are given and have no effect: which, why, and what to change."""
    if names := [f"{name}=" for name, there in given.items() if there]:
        raise InputError(f"{', '.join(names)} {'have' if len(names) > 1 else 'has'} no effect: {why}")


class Refusals:
    """Collects the mistakes of an input, so that all of them are told at once."""

    def __init__(self) -> None:
        self.mistakes: list[InputError] = []

    @contextmanager
    def at(self, *key: str | int) -> Iterator[None]:
        """Keep an InputError of the block, which is about the part `key` of the input."""
        try:
            with located(*key):
                yield
        except InputError as error:
            self.mistakes += error.parts

    def refuse(self) -> None:
        """Raises InputError if there is any mistake."""
        if self.mistakes:
            text = "; ".join(dict.fromkeys(map(str, self.mistakes)))
            raise InputError(text, self.mistakes[0].key, self.mistakes)


@contextmanager
def located(*key: str | int, owner: str = "") -> Iterator[None]:
    """An InputError of the block is about the part `key` of the input, and begins with its owner, if that is named."""
    try:
        yield
    except InputError as error:
        for part in error.parts:
            part.key = (*key, *part.key)
        if owner:
            error.args = (f"{owner}: {error}",)
        raise


class NegativeDampingWarning(UserWarning):
    """A system was made whose damping, or a damper, feeds energy in: a wrong sign, or self-excitation that is meant."""


class ConvergenceError(SuboctaveError, ArithmeticError):
    """An iteration that did not arrive; the message says where on the curve and what to change."""


class FunctionError(InputError):
    """A function of the user's (of an event, a law, a measure) that failed while something was computed.

    result
        What had been computed by then, as after Ctrl-C; None for nothing.
    """

    result: Any = None


class NotFiniteError(ConvergenceError):
    """A force is not finite on a motion, or on the way to it."""


class TimeLimitError(SuboctaveError):
    """A time limit (`seconds=`) that was reached before there was anything to keep."""


def is_number(value: Any) -> bool:
    """Whether it is a finite real number that a float can hold."""
    try:
        return isinstance(value, numbers.Real) and math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def check_numbers(**given: Any) -> None:
    """Refuse what is no finite number, by its name."""
    for name, value in given.items():
        if isinstance(value, bool) or not is_number(value):
            raise InputError(f"{name}={shortened(value)}: give a finite number")


def chosen_dof(given: Any, default: int, count: int, name: str = "dof", names: Sequence[str] = ()) -> int:
    """The degree of freedom that a user has given, see `GivenDof`, or else the default; InputError where there is none.

    `name`: of the argument; `names`: of all degrees of freedom, where they have any.
    """
    dof = default if given is None else given
    if isinstance(dof, str | tuple):
        return _named_dof(dof, name, names)
    if isinstance(dof, bool) or not isinstance(dof, numbers.Integral) or not 0 <= int(dof) < count:
        raise InputError(f"{name}={shortened(dof)} is out of range: there are {count} DOFs, numbered from 0")
    return int(dof)


def dof_text(given: str | tuple[Any, ...]) -> str:
    """The name of a degree of freedom as one text."""
    return given if isinstance(given, str) else " ".join(map(str, given))


def _named_dof(given: str | tuple[Any, ...], name: str, names: Sequence[str]) -> int:
    text = dof_text(given)
    if text in names:
        return names.index(text)
    alike = [i for i, known in enumerate(names) if _plain_dof(known) == _plain_dof(text)]
    if len(alike) != 1:
        has = suggest(text, names) or ": they have no names"
        raise InputError(f"{name}={shortened(given)} is none of the degrees of freedom{has}")
    return alike[0]


def _plain_dof(text: str) -> str:
    """A name without what users write in different ways: "1042 z" for "node 1042 Z" and "1042:z"."""
    return re.sub(r"[\s:,/]+", " ", text.strip().lower()).removeprefix("node ")


_shown = reprlib.Repr()
_shown.maxstring = _shown.maxother = 60


def shortened(value: Any) -> str:
    """What a user has given, as messages show it: in one line, and only the ends of what is long."""
    return " ".join(_shown.repr(value).split())


def damage(error: Exception, most: int = 120) -> str:
    """What a reader says of a damaged file, in one line of at most so many characters; NumPy takes what is no array
    for pickled Python objects, and advises to unpickle them.
    """
    said = " ".join(str(error).split())[:most]
    return f"{type(error).__name__}: {'it holds no arrays of numbers' if 'pickle' in said else said}"


#: names that begin like an unknown one, up to which they are what it may stand for
_FEW = 3


def suggest(name: str, known: Iterable[str], limit: int = 12) -> str:
    """The tail of a message on an unknown name: the closest known names, or else all of them (at most `limit`).

    The text starts with a space, so that it can follow the message directly; it is empty when nothing is known.
    """
    names = sorted(set(known))
    if not names:
        return ""
    lower = {candidate.lower(): candidate for candidate in names}
    close = difflib.get_close_matches(str(name).lower(), list(lower), n=3, cutoff=0.6)
    if not close and name:  # an abbreviation of few
        begun = [candidate for candidate in lower if candidate.startswith(str(name).lower())]
        close = begun if len(begun) <= _FEW else []
    if close:
        return f" (did you mean {' or '.join(repr(lower[match]) for match in close)}?)"
    listed = ", ".join(names[:limit]) + (", ..." if len(names) > limit else "")
    return f"; known: {listed}"


def path_of(given: Any) -> Path:
    """The path that a user has given; InputError for what cannot be one."""
    if not isinstance(given, str | os.PathLike) or isinstance(os.fspath(given), bytes):
        raise InputError(f"a file is given by its name, a text or a Path, not by {type(given).__name__}")
    path = Path(given)
    try:
        path.exists()
    except (OSError, ValueError) as error:  # longer than names may be
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{shortened(str(path))} cannot be the name of a file: {reason}") from None
    return path
