"""How work is stopped before it is done: by its user, with Ctrl-C, by a time limit (`seconds=` of the verbs), or by a
function of the user's that fails.

Both take one path. The exception of a time limit is a `KeyboardInterrupt`, raised once, by `check_time`, wherever
Python would raise that of Ctrl-C: long loops and every Newton iteration call it. What catches it keeps what was
computed and records an `Interruption` in its result. A search that is given an interrupted result passes the
interruption on (`pass_on`); none of them is kept as complete. A failed function takes the same path within a verb,
which raises it as a `FunctionError` with the result; elsewhere nothing is kept, and it is a FunctionError at once.

A limit holds for everything that is called while it does; of two limits the nearer one counts. It belongs to its
thread.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from time import monotonic
from typing import Any, ParamSpec, TypeVar

from suboctave.errors import FunctionError, InputError, SuboctaveError, TimeLimitError, is_number

Arguments = ParamSpec("Arguments")
Given = TypeVar("Given")


class TimeLimitReached(KeyboardInterrupt):
    """The time limit of `seconds` was reached."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"the time limit of {seconds:g} s was reached")
        self.seconds = seconds


class FunctionFailed(KeyboardInterrupt):
    """A function of the user's failed."""


@dataclass(frozen=True)
class Interruption:
    """What stopped a computation: a time limit of so many `seconds`, a function that failed (`failure` says how), or
    its user.
    """

    seconds: float | None = None
    failure: str = ""

    @classmethod
    def of(cls, cause: KeyboardInterrupt) -> Interruption:
        """What an exception tells."""
        seconds = cause.seconds if isinstance(cause, TimeLimitReached) else None
        return cls(seconds, str(cause) if isinstance(cause, FunctionFailed) else "")

    def exception(self) -> KeyboardInterrupt:
        """The exception that stops whatever waits for the result."""
        if self.failure:
            return FunctionFailed(self.failure)
        return KeyboardInterrupt() if self.seconds is None else TimeLimitReached(self.seconds)

    def __str__(self) -> str:
        if self.failure:
            return self.failure
        return "interrupted" if self.seconds is None else f"the time limit of {self.seconds:g} s was reached"


def pass_on(interruption: Interruption | None) -> None:
    """Stop whoever needs a result that was interrupted."""
    if interruption is not None:
        raise interruption.exception()


@dataclass(eq=False)
class Deadline:
    """When a time limit ends, by the monotonic clock; `reached`: it was raised."""

    seconds: float
    until: float
    reached: bool = False


_DEADLINE: ContextVar[Deadline | None] = ContextVar("_DEADLINE", default=None)


def check_time() -> None:
    """Raise `TimeLimitReached` where the time limit that holds here is over: once, as Ctrl-C is raised once.

    What finishes a result after that is not stopped again.
    """
    deadline = _DEADLINE.get()
    if deadline is not None and not deadline.reached and monotonic() >= deadline.until:
        deadline.reached = True
        raise TimeLimitReached(deadline.seconds)


def time_to_wait(seconds: float) -> float:
    """So many seconds, or fewer where the time limit that holds here is over earlier."""
    deadline = _DEADLINE.get()
    if deadline is None or deadline.reached:
        return seconds
    return min(seconds, max(deadline.until - monotonic(), 0.0))


def check_seconds(seconds: Any) -> float | None:
    """A time limit in seconds, None for none; InputError for what is no positive number."""
    if seconds is None:
        return None
    if isinstance(seconds, bool) or not is_number(seconds) or seconds <= 0.0:
        raise InputError(f"seconds must be a positive number, or None for no time limit, not {seconds!r}")
    return float(seconds)


@contextmanager
def time_limit(seconds: Any) -> Iterator[Deadline | None]:
    """Work within takes at most so many seconds; None: no limit but the one that holds already.

    Gives its deadline where that is the one that counts.

    Raises
    ------
    InputError
        If `seconds` is no positive number.
    TimeLimitError
        If the limit was reached before there was anything to keep.
    """
    number = check_seconds(seconds)
    outer = _DEADLINE.get()
    if number is None or (outer is not None and outer.until <= monotonic() + number):
        yield None
        return
    deadline = Deadline(number, monotonic() + number)
    token = _DEADLINE.set(deadline)
    try:
        yield deadline
    except TimeLimitReached:
        raise TimeLimitError(
            f"the time limit of {number:g} s was reached before there was a result to keep: give more seconds="
        ) from None
    finally:
        _DEADLINE.reset(token)


@contextmanager
def unlimited() -> Iterator[None]:
    """Work within finishes a result: no time limit stops it."""
    token = _DEADLINE.set(None)
    try:
        yield
    finally:
        _DEADLINE.reset(token)


#: within a verb that keeps what was computed, how functions have failed so far, and with what exceptions
_FAILED: ContextVar[list[tuple[str, BaseException | None]] | None] = ContextVar("_FAILED", default=None)


@contextmanager
def users_function(name: str) -> Iterator[None]:
    """A function of the user's is called within, `name` says which: what it raises is one that failed.

    It may be slow: time limits are looked at.
    """
    check_time()
    try:
        yield
    except SuboctaveError:
        raise
    except Exception as failure:
        words = f"{name} failed with {type(failure).__name__}: {failure}"
        raise stopping(words, failure) from failure


def stopping(words: str, cause: BaseException | None = None) -> BaseException:
    """The exception that stops because a function failed: what the verb that is under way has computed is kept."""
    known = _FAILED.get()
    if known is None:
        return FunctionError(words)
    known.append((words, cause))
    return FunctionFailed(words)


@contextmanager
def at_once() -> Iterator[None]:
    """What is checked within is wrong input where a function of the user's fails: nothing has been computed."""
    token = _FAILED.set(None)
    try:
        yield
    finally:
        _FAILED.reset(token)


def keeping(verb: Callable[[], Given]) -> Given:
    """The result of a verb; a FunctionError that holds it where a function failed. Of verbs that call verbs the
    outermost one raises it.
    """
    if _FAILED.get() is not None:
        return verb()
    failed: list[tuple[str, BaseException | None]] = []
    token = _FAILED.set(failed)
    result = None
    try:
        result = verb()
    except FunctionFailed as stopped:
        words = str(stopped)
    else:
        words = getattr(getattr(result, "interruption", None), "failure", "")
        if not words:
            return result
    finally:
        _FAILED.reset(token)
    error = FunctionError(words)
    error.result = result
    raise error from next((cause for how, cause in failed if how in words), None)


def limited(verb: Callable[Arguments, Given]) -> Callable[Arguments, Given]:
    """A verb whose keyword `seconds` is a time limit for all that it does."""

    @functools.wraps(verb)
    def within(*positional: Arguments.args, **named: Arguments.kwargs) -> Given:
        with time_limit(named.get("seconds")):
            return keeping(functools.partial(verb, *positional, **named))

    return within
