"""What every verb has in common: a time limit, the seconds that it took, and units that floating point cannot bear."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import Any, ParamSpec, Protocol, TypeVar

import numpy as np

from suboctave.errors import ConvergenceError
from suboctave.interruption import time_limit
from suboctave.model.system import System

__all__ = ["timed"]

#: modulus of a number whose fourth power is no float; the inverse of one
_EXTREME = 1e77

Arguments = ParamSpec("Arguments")
Curve = TypeVar("Curve", bound="Timed")


class Timed(Protocol):
    """Something that knows how long it took."""

    seconds: float


def timed(verb: Callable[Arguments, Curve]) -> Callable[Arguments, Curve]:
    """A verb with a time limit, `seconds`, whose result says in `seconds` how long it took, and whose failures are put
    in words.
    """

    @functools.wraps(verb)
    def measured(*positional: Arguments.args, **named: Arguments.kwargs) -> Curve:
        begin = perf_counter()
        try:
            with time_limit(named.get("seconds")):
                result = verb(*positional, **named)
        except (ZeroDivisionError, OverflowError, ConvergenceError) as failure:
            extreme = extreme_number(*positional, *named.values())
            if extreme is None or hasattr(failure, "__notes__"):  # a mistake of ours, or of a user's function
                raise
            raise ConvergenceError(
                f"the numbers left the range of floating point ({failure}), with {extreme} among them: choose units in "
                "which sizes are nearer to 1"
            ) from failure
        result.seconds = perf_counter() - begin
        return result

    return measured


def extreme_number(*given: Any) -> str | None:
    """The first number among a verb's arguments, those of its system included, whose powers leave the range of floats;
    with its name.
    """
    for item in given:
        for name, value in _numbers(item):
            if value and not 1.0 / _EXTREME <= abs(value) <= _EXTREME:
                return f"{name} = {value:g}"
    return None


def _numbers(item: Any) -> Iterator[tuple[str, float]]:
    system = getattr(getattr(item, "orbit", item), "system", item)
    if isinstance(system, System):
        yield from system.parameters.items()
        for name, matrix in zip(("mass", "damping", "stiffness"), system.matrices(), strict=True):
            yield from ((name, float(entry)) for entry in matrix.ravel())
        for where, source, _ in system.expressions():
            yield where, source.value({**system.parameters, "omega": 1.0})
    elif isinstance(item, int | float | np.floating):
        yield "an argument", float(item)
    elif isinstance(item, tuple | list | np.ndarray):
        for part in item:
            yield from _numbers(part)
