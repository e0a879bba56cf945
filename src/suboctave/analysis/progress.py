"""What `progress=` means: nothing, a bar on the terminal, or a callable."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any, ParamSpec, Protocol, TypeVar

from suboctave.errors import ConvergenceError, InputError

#: objects made between two looks of the garbage collector while a verb runs
_OBJECTS = 50_000

Report = Callable[[float, str], None]


Arguments = ParamSpec("Arguments")
Curve = TypeVar("Curve", bound="Timed")


class Timed(Protocol):
    """Something that knows how long it took."""

    seconds: float


def timed(verb: Callable[Arguments, Curve]) -> Callable[Arguments, Curve]:
    """A verb whose result says in `seconds` how long it took, and whose failures are told in words."""

    @functools.wraps(verb)
    def measured(*positional: Arguments.args, **named: Arguments.kwargs) -> Curve:
        begin = perf_counter()
        before = gc.get_threshold()
        if before[0] > 0:
            # a curve makes thousands of small objects that stay: looking through them again and again finds nothing
            gc.set_threshold(max(before[0], _OBJECTS), *before[1:])
        try:
            result = verb(*positional, **named)
        except (ZeroDivisionError, OverflowError) as failure:
            raise ConvergenceError(
                f"the numbers left the range of floating point ({failure}): look at the sizes of parameters, loads and "
                "ranges, or choose units in which they are near one"
            ) from failure
        finally:
            gc.set_threshold(*before)
        result.seconds = perf_counter() - begin
        return result

    return measured


@contextmanager
def reporting(progress: Any, title: str) -> Iterator[Report | None]:
    """A function (share done, where) to report to, or None.

    `progress` is None or False (silent), True (a bar on standard error, silent where that is not a terminal), or a
    callable that takes the share done, 0 to 1, and a text. If that has a method `found`, it is called after each point
    with the trace so far (points, bifurcations): a journal keeps it.
    """
    if progress is None or progress is False:
        yield None
    elif progress is True:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[where]}"),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
            task = bar.add_task(title, total=1.0, where="")
            yield lambda share, where: bar.update(task, completed=share, where=where)
    elif callable(progress):
        yield progress
    else:
        raise InputError(f"progress must be None, True or a callable taking (share, text), not {progress!r}")
