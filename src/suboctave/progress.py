"""What `progress=` means: nothing, a bar on the terminal or in a notebook, or a callable."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from html import escape
from time import monotonic
from typing import Any

from suboctave.errors import InputError
from suboctave.session import in_notebook

Report = Callable[[float, str], None]


class CurveProgress:
    """Progress of a curve that is followed in one direction or both: the share of its parameter's range that it has
    covered, and in words what it costs.
    """

    def __init__(self, report: Report, bounds: tuple[float, float], located: str = "bifurcation") -> None:
        self.report = report
        self.bounds = bounds
        #: what is counted besides points
        self.located = located
        self._covered: tuple[float, float] | None = None
        #: points and bifurcations of the directions that are over, and of this one
        self._before = (0, 0)
        self._now = (0, 0)

    def begins(self) -> None:
        """Another direction is begun."""
        self._before, self._now = (self._before[0] + self._now[0], self._before[1] + self._now[1]), (0, 0)

    def at(self, value: float, where: str, points: int, bifurcations: int, harmonics: int) -> None:
        """The curve has come to a value of its parameter, with so many points and bifurcations in this direction."""
        low, high = self._covered or (value, value)
        self._covered = low, high = min(low, value), max(high, value)
        self._now = points, bifurcations
        share = min(1.0, (high - low) / (self.bounds[1] - self.bounds[0]))
        numbers = (self._before[0] + points, self._before[1] + bifurcations, harmonics)
        names = ("point", self.located, "harmonic")
        counted = [f"{n} {name}{'' if n == 1 else 's'}" for n, name in zip(numbers, names, strict=True)]
        self.report(share, ", ".join([where, *counted]) if points else where)


class PartOf:
    """Reports of one of `count` parts of a task as reports of the whole; who follows curves follows the part's."""

    def __init__(self, report: Report, number: int, count: int, title: str) -> None:
        self.report, self.number, self.count, self.title = report, number, count, title
        self.followed: Callable[[Any], None] | None = getattr(report, "followed", None)

    def __call__(self, share: float, where: str) -> None:
        self.report((self.number + share) / self.count, f"{self.title}, {where}")


class Search:
    """Reports of a search that follows curves on its way, and of each of these: its words stand behind those of the
    search, and the share stays that of the search.
    """

    def __init__(self, report: Report) -> None:
        self.report, self.share, self.where = report, 0.0, ""
        self.followed: Callable[[Any], None] | None = getattr(report, "followed", None)

    def at(self, share: float, where: str) -> None:
        """The search has come so far."""
        self.share, self.where = max(self.share, share), where
        self.report(self.share, where)

    def __call__(self, share: float, where: str) -> None:
        self.report(self.share, f"{self.where}, {where}" if self.where else where)


#: the search within which curves are followed
_SEARCH: ContextVar[Search | None] = ContextVar("_SEARCH", default=None)


@contextmanager
def searching(progress: Any, title: str) -> Iterator[Search | None]:
    """As `reporting`, of a search: curves that are followed within, silent ones, report to it."""
    with reporting(progress, title) as report:
        search = None if report is None else Search(report)
        token = _SEARCH.set(search)
        try:
            yield search
        finally:
            _SEARCH.reset(token)


@contextmanager
def reporting(progress: Any, title: str) -> Iterator[Report | None]:
    """A function (share done, where) to report to, or None.

    `progress` is None or False (silent; within a search that reports, to that), True (a bar in a notebook, or on
    standard error, silent where that is not a terminal), or a callable that takes the share done, 0 to 1, and a text.
    If that has a method `followed`, it is called after each point with the trace so far: a journal keeps it.
    """
    if progress is None or progress is False:
        yield _SEARCH.get()
    elif progress is True:
        with notebook_bar(title) if in_notebook() else bar(title) as report:
            yield report
    elif callable(progress):
        yield progress
    else:
        raise InputError(f"progress must be None, True or a callable taking (share, text), not {progress!r}")


@contextmanager
def bar(title: str) -> Iterator[Report]:
    """A bar on standard error with the text in a line below it, gone afterwards; silent where nobody watches."""
    from rich.console import Console, RenderableType
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class Lines(Progress):
        def get_renderables(self) -> Iterator[RenderableType]:
            """The bars, then what each has to say."""
            yield self.make_tasks_table(self.tasks)
            for task in self.tasks:
                yield Text(str(task.fields["where"]), overflow="ellipsis", no_wrap=True)

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=28),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Lines(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        task = shown.add_task(title, total=1.0, where="")
        furthest = 0.0

        def report(share: float, where: str = "") -> None:
            nonlocal furthest  # what is done in several parts begins each of them anew; a bar does not
            furthest = max(furthest, share)
            shown.update(task, completed=furthest, where=where)

        yield report


#: seconds between changes of a bar in a notebook
_OFTEN = 0.1


@contextmanager
def notebook_bar(title: str) -> Iterator[Report]:
    """A bar in the output of a notebook's cell with the text behind it, gone afterwards."""
    from IPython.display import HTML, display

    begin = last = monotonic()
    shown = display(HTML(""), display_id=True)
    furthest = 0.0

    def report(share: float, where: str = "") -> None:
        nonlocal furthest, last
        furthest, now = max(furthest, share), monotonic()
        if now - last >= _OFTEN:
            last = now
            words = f"{title} {100.0 * furthest:.0f} %, {now - begin:.0f} s: {where}"
            shown.update(HTML(f"<progress value='{furthest:.3f}'></progress> <small>{escape(words)}</small>"))

    try:
        yield report
    finally:
        shown.update(HTML(""))


def notebook_line() -> Callable[[str, bool], None]:
    """A line in the output of a notebook's cell that can be changed: a text, and whether a bar runs before it."""
    from IPython.display import HTML, display

    shown = display(HTML(""), display_id=True)

    def show(text: str, running: bool) -> None:
        shown.update(HTML(f"{'<progress></progress> ' if running else ''}<small>{escape(text)}</small>"))

    return show
