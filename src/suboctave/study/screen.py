"""What is seen in the terminal: tables of 80 columns on stdout, bars on stderr while somebody watches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS
from suboctave.curves.junction import period_name
from suboctave.maps.isolas.result import Isolas, isola_row
from suboctave.maps.stretches import stable_ranges
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram, tree_text
from suboctave.store.columns import parameter_column
from suboctave.store.layout import branch_dataset
from suboctave.store.table import Table
from suboctave.study.results import Result

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

__all__ = [
    "console",
    "event_lines",
    "print_branch",
    "print_diagram",
    "print_events",
    "print_isolas",
    "print_result",
    "print_table",
    "print_texts",
    "significant",
]

WIDTH = 80
#: columns of the widest table that is not folded
_WIDEST = 400
#: bifurcations of a diagram up to which all of them are listed below its tree
_LISTED = 40


def console(quiet: bool = False) -> Console:
    """Standard output, at most 80 columns wide; `quiet` prints nothing."""
    from rich.console import Console

    return Console(highlight=False, width=min(WIDTH, Console().width), quiet=quiet)


def print_events(
    out: Console, lines: Sequence[Sequence[str]], free: str = "omega", criticality: Sequence[str] = ()
) -> None:
    """Located bifurcations as a table, one line each; whether super- or subcritical where that is known of any."""
    if not lines:
        out.print("no bifurcation")
        return
    names: tuple[str, ...] = ("kind", "omega", "max |x|", "multiplier", "residual")
    if free != "omega":
        names += (parameter_column(free, (*names, "criticality")),)
    if any(criticality):
        names += ("criticality",)
        lines = [[*line, word] for line, word in zip(lines, criticality, strict=True)]
    print_texts(out, names, lines, left=("kind",))


def print_texts(out: Console, names: Sequence[str], lines: Sequence[Sequence[str]], left: Sequence[str] = ()) -> None:
    """A table of texts, numbers to the right; where it is wider than the console its lines are, but nothing is cut."""
    from rich import box
    from rich.table import Table as Grid

    table = Grid(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for name in names:
        last = name in left and name == names[-1]
        table.add_column(name, justify="left" if name in left else "right", no_wrap=not last, overflow="ellipsis")
    for line in lines:
        table.add_row(*(_escaped(text) for text in line))
    own = out.width
    try:
        if names[-1] not in left:
            out.width = max(own, out.measure(table, options=out.options.update(max_width=_WIDEST)).maximum)
        out.print(table, crop=False)
    finally:
        out.width = own


def print_result(out: Console, name: str, result: Result, note: str = "") -> None:
    """A branch, a diagram, isolas or a table, each in its way."""
    if isinstance(result, Branch):
        print_branch(out, name, result, note)
    elif isinstance(result, BifurcationDiagram):
        print_diagram(out, name, result, note)
    elif isinstance(result, Isolas):
        print_isolas(out, name, result, note)
    else:
        print_table(out, name, result, note)


def print_branch(out: Console, name: str, branch: Branch, note: str = "") -> None:
    """A branch: its bifurcations, how many points, why it ended, what is to be said."""
    out.print(f"\n{name}", style="bold", markup=False, end="")
    values = branch.parameter(branch.name)
    ends = (min(values), max(values)) if branch.closed else (values[0], values[-1])
    span = f"{'closed, ' if branch.closed else ''}along {branch.name}, {ends[0]:.6g} to {ends[1]:.6g}"
    out.print(f": {span}", markup=False)
    dataset = branch_dataset(branch)
    lines = [list(line) for line in event_lines(dataset)]
    met = sorted([*branch.bifurcations, *branch.grazings, *branch.events], key=lambda b: b.arclength)
    contacts = _contacts(branch)
    for line, event in zip(lines, met, strict=True):
        if branch.name != "omega":
            line[1] = f"{event.omega:.6g}"
            line.append(f"{event.parameter(branch.name):.8g}")
        if event.contact is not None and event.kind == "grazing" and len(contacts) > 1:
            line[0] += f" {contacts[event.contact.element][0]}"
    print_events(out, lines, branch.name, [str(word) for word in dataset["event_criticality"].to_numpy()])
    for number, label in contacts.values() if len(contacts) > 1 else ():
        out.print(f"grazing {number}: {label}", markup=False)
    out.print(f"{len(branch)} points, {branch.verdicts}{note}; {branch.ended}.", markup=False)
    for warning in branch.warnings:
        out.print(f"note: {warning}", markup=False)


def _contacts(branch: Branch) -> dict[int, tuple[int, str]]:
    """The elements that graze along a branch, each with a number and its label."""
    labels = {g.contact.element: g.contact.label for g in branch.grazings if g.contact is not None}
    return {element: (number, labels[element]) for number, element in enumerate(sorted(labels), 1)}


def print_diagram(out: Console, name: str, diagram: BifurcationDiagram, note: str = "") -> None:
    """A diagram: the tree of its branches, and their bifurcations as a table where these are not too many."""
    out.print(f"\n{name}", style="bold", markup=False, end="")
    count = f"{len(diagram)} branch{'es' * (len(diagram) != 1)}"
    out.print(f": along {diagram.root.branch.name}, {count}{note}\n", markup=False)
    out.print(tree_text(diagram, out.width, head=False), markup=False, soft_wrap=True)
    lines = [
        (str(node.number), *line)
        for node in diagram
        if len(node.branch)
        for line in event_lines(branch_dataset(node.branch))
        if line[0] not in CONTACT_KINDS
    ]
    if len(lines) > _LISTED:
        out.print(f"{len(lines)} bifurcations: --csv, or csv = true in [outputs], writes them all", markup=False)
    elif lines:
        names = ("branch", "kind", "omega", "max |x|", "multiplier", "residual")
        print_texts(out, names, lines, left=("kind",))
    for node in diagram:
        for warning in node.branch.warnings:
            out.print(f"note on branch {node.number}: {warning}", markup=False)


def print_isolas(out: Console, name: str, isolas: Isolas, note: str = "") -> None:
    """Isolas: the table of their ranges and ends, what happens at these in words, and what could not be settled."""
    out.print(f"\n{name}", style="bold", markup=False, end="")
    out.print(f": over {isolas.parameter}{note}\n{isolas.summary}", markup=False)
    parameter = isolas.parameter
    heads = ("", "period", f"{parameter} from", "to", "born at", "omega", "merges at", "omega")
    keys = ("from", "to", "born", "born_omega", "merges", "merges_omega")
    rows = [isola_row(isola) for isola in isolas]
    lines = [
        [str(i), period_name(row["period"]), *(f"{row[key]:.6g}" if row[key] == row[key] else "-" for key in keys)]
        for i, row in enumerate(rows)
    ]
    if lines:
        print_texts(out, heads, lines)
    for i, isola in enumerate(isolas):
        for end, reason in zip(("from", "to"), isola.reasons, strict=True):
            value = isola.range[end == "to"]
            out.print(f"isola {i}, {parameter} = {value:.7g}: {reason}", markup=False)
        for value, branch in isola.known.items():
            out.print(f"isola {i} at {parameter} = {value:.7g}: {_closed(branch)}", markup=False)
        for text in isola.notes:
            out.print(f"note on isola {i}: {text}", markup=False)
    for text in isolas.notes:
        out.print(f"note: {text}", markup=False)


def _closed(branch: Branch) -> str:
    """A closed branch in one line: where it is, and where it is stable."""
    met = [*branch.omega, *(item.omega for item in branch.bifurcations)]
    text = f"omega from {min(met):.7g} to {max(met):.7g}"
    stable = stable_ranges(branch)
    if not stable:
        return f"{text}, nowhere stable"
    return f"{text}, stable " + " and ".join(f"from {low:.7g} to {high:.7g}" for low, high in stable)


def print_table(out: Console, name: str, table: Table, note: str = "") -> None:
    """A table of results: the columns that fit, the longest texts below it."""
    out.print(f"\n{name}", style="bold", markup=False, end="")
    out.print(f": {table.title}{note}", markup=False)
    shown: list[str] = []
    texts: dict[str, list[str]] = {}
    room = out.width
    for column in table.columns:
        texts[column] = [_number(value) for value in table[column]]
        width = max([len(column), *(len(text) for text in texts[column])]) + 2
        if width <= room and width <= 40:
            shown.append(column)
            room -= width
    kinds = [name for name in shown if table[name].dtype.kind in "OU"]
    lines = [[texts[name][i] for name in shown] for i in range(len(table))]
    print_texts(out, shown, lines, left=kinds)
    left_out = [name for name in table.columns if name not in shown]
    if left_out:
        out.print(f"not shown: {', '.join(left_out)} (--csv writes everything)", markup=False)


def _number(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, complex | np.complexfloating):
        return f"{value.real:.6f}{value.imag:+.6f}i" if value.imag else f"{value.real:.6f}"
    if isinstance(value, int | np.integer):
        return str(value)
    return f"{value:.7g}" if abs(value) >= 1e-3 or value == 0.0 else f"{value:.1e}"


def _escaped(text: str) -> str:
    from rich.markup import escape

    return escape(text)


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
