"""What `progress=` means: nothing, a bar on the terminal, or a callable."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from suboctave.errors import InputError

Report = Callable[[float, str], None]


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
