"""What is seen in the terminal: tables of 80 columns on stdout, bars on stderr while somebody watches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from suboctave.store.layout import parameter_column
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

WIDTH = 80
#: columns of the widest table that is not folded
_WIDEST = 400


def console(quiet: bool = False) -> Console:
    """Standard output, at most 80 columns wide; `quiet` prints nothing."""
    from rich.console import Console

    return Console(highlight=False, markup=False, width=min(WIDTH, Console().width), quiet=quiet)


def print_events(
    out: Console,
    lines: Sequence[Sequence[str]],
    free: str = "omega",
    criticality: Sequence[str] = (),
    units: UnitSystem | None = None,
) -> None:
    """Located bifurcations as a table, one line each; whether super- or subcritical where that is known of any. With
    declared units a column more has the frequencies in cycles, Hz where time is in s.
    """
    if not lines:
        out.print("no bifurcation")
        return
    names: tuple[str, ...] = ("kind", "omega", "max |x|", "multiplier", "residual")
    if free != "omega":
        names += (parameter_column(free, (*names, "criticality")),)
    if any(criticality):
        names += ("criticality",)
        lines = [[*line, word] for line, word in zip(lines, criticality, strict=True)]
    if units is not None:
        names = (names[0], f"omega ({units.frequency})", units.cycles, f"max |x| ({units.length})", *names[3:])
        lines = [[*line[:2], significant(float(line[1]) / (2.0 * math.pi), 7), *line[2:]] for line in lines]
    print_texts(out, names, lines, left=("kind",))


def print_texts(out: Console, names: Sequence[str], lines: Sequence[Sequence[str]], left: Sequence[str] = ()) -> None:
    """A table of texts, numbers to the right; where it is wider than the console its lines are, but nothing is cut."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for name in names:
        last = name in left and name == names[-1]
        table.add_column(name, justify="left" if name in left else "right", no_wrap=not last, overflow="ellipsis")
    for line in lines:
        table.add_row(*line)
    own = out.width
    try:
        if names[-1] not in left:
            out.width = max(own, out.measure(table, options=out.options.update(max_width=_WIDEST)).maximum)
        out.print(table, crop=False)
    finally:
        out.width = own


def event_lines(dataset: xarray.Dataset) -> list[tuple[str, str, str, str, str]]:
    """The located bifurcations as text: kind, omega, max |x|, critical multiplier, residual.

    One that could only be bracketed shows the half-width of its bracket in place of a residual.
    """
    names = ("kind", "omega", "amplitude", "multiplier", "residual", "uncertainty")
    columns = (dataset[f"event_{name}"].to_numpy() for name in names)
    return [
        (
            str(kind),
            significant(omega, 9),
            significant(amplitude, 7),
            _complex_text(complex(multiplier)),
            f"± {uncertainty:.0e}" if uncertainty else f"{residual:.0e}",
        )
        for kind, omega, amplitude, multiplier, residual, uncertainty in zip(*columns, strict=True)
    ]


def significant(value: float, digits: int) -> str:
    """A number with so many significant digits, whatever its unit makes of it."""
    return f"{value:#.{digits}g}".rstrip(".")


def _complex_text(value: complex) -> str:
    if value != value:  # not computed
        return "-"
    large = abs(value) >= 1e3
    if abs(value.imag) < 5e-7 * abs(value):
        return f"{value.real:+.6e}" if large else f"{value.real:+.6f}"
    form = ".5e" if large else ".5f"
    return f"{value.real:+{form}} ± {abs(value.imag):{form}}i"
