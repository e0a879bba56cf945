"""Results as they are shown: for a reader in the terminal, for a machine as what JSON holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS
from suboctave.curves.junction import period_name
from suboctave.maps.isolas.result import Isolas, isola_row
from suboctave.maps.pieces import stable_ranges
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram, tree_text
from suboctave.store.layout import branch_dataset, events_met
from suboctave.store.table import Table
from suboctave.study.results import Result
from suboctave.study.screen import event_lines, print_events, print_texts
from suboctave.study.sweeps.result import Sweep

if TYPE_CHECKING:
    from rich.console import Console

#: points of a sweep that are printed
_POINTS = 20
#: bifurcations of a diagram up to which all of them are listed below its tree
_LISTED = 40


def print_result(out: Console, name: str, result: Result, note: str = "") -> None:
    """A branch, a diagram, isolas or a table, each in its way; `note`: how long it took."""
    out.print(f"\n{name}", style="bold", end="")
    _print(result, out, note)


@singledispatch
def _print(result: Any, out: Console, note: str) -> None:
    raise TypeError(f"{type(result).__name__} cannot be shown")


def _span(values: Any) -> str:
    """What a curve covers of its parameter: from its first to its last value, or where it turns back within."""
    (first, last), (low, high) = (f"{values[i]:.6g}" for i in (0, -1)), (f"{end(values):.6g}" for end in (min, max))
    if low == high:
        return f"at {low}"
    return f"{first} to {last}" if {first, last} == {low, high} else f"between {low} and {high}"


@_print.register(Branch)
def _(branch: Branch, out: Console, note: str) -> None:
    """Its bifurcations, how many points, why it ended, what is to be said."""
    values = branch.parameter(branch.name)
    out.print(f": {'closed, ' if branch.closed else ''}along {branch.name}, {_span(values)}")
    dataset = branch_dataset(branch)
    lines = [list(line) for line in event_lines(dataset)]
    contacts = _contacts(branch)
    for line, event in zip(lines, events_met(branch), strict=True):
        if branch.name != "omega":
            line[1] = f"{event.omega:.6g}"
            line.append(f"{event.parameter(branch.name):.8g}")
        if event.contact is not None and event.kind == "grazing" and len(contacts) > 1:
            line[0] += f" {contacts[event.contact.element][0]}"
    for words in branch.basis:
        out.print(words, soft_wrap=True)
    criticality = [str(word) for word in dataset["event_criticality"].to_numpy()]
    print_events(out, lines, branch.name, criticality, branch.system.units)
    for number, label in contacts.values() if len(contacts) > 1 else ():
        out.print(f"grazing {number}: {label}")
    out.print(f"{len(branch)} points, {branch.verdicts}{note}; {branch.ended}.")
    for warning in branch.warnings:
        out.print(f"note: {warning}")


def _contacts(branch: Branch) -> dict[int, tuple[int, str]]:
    """The elements that graze along a branch, each with a number and its label."""
    labels = {g.contact.element: g.contact.label for g in branch.grazings if g.contact is not None}
    return {element: (number, labels[element]) for number, element in enumerate(sorted(labels), 1)}


@_print.register(BifurcationDiagram)
def _(diagram: BifurcationDiagram, out: Console, note: str) -> None:
    """The tree of its branches, and their bifurcations as a table where these are not too many."""
    count = f"{len(diagram)} branch{'es' * (len(diagram) != 1)}"
    out.print(f": along {diagram.root.branch.name}, {count}{note}\n")
    out.print(tree_text(diagram, out.width, head=False), soft_wrap=True)
    branches = [node for node in diagram if len(node.branch)]
    events = ((str(node.number), *line) for node in branches for line in event_lines(branch_dataset(node.branch)))
    lines = [line for line in events if line[1] not in CONTACT_KINDS]
    if len(lines) > _LISTED:
        out.print(f"{len(lines)} bifurcations: --csv, or csv = true in [outputs], writes them all")
    elif lines:
        names = ("branch", "kind", "omega", "max |x|", "multiplier", "residual")
        print_texts(out, names, lines, left=("kind",))
    for node in diagram:
        for warning in node.branch.warnings:
            out.print(f"note on branch {node.number}: {warning}")


@_print.register(Isolas)
def _(isolas: Isolas, out: Console, note: str) -> None:
    """The table of their ranges and ends, what happens at these in words, and what could not be settled."""
    out.print(f": over {isolas.parameter}{note}\n{isolas.summary}")
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
            out.print(f"isola {i}, {parameter} = {value:.7g}: {reason}")
        for value, branch in isola.known.items():
            out.print(f"isola {i} at {parameter} = {value:.7g}: {_in_one_line(branch)}")
        for text in isola.notes:
            out.print(f"note on isola {i}: {text}")
    for text in isolas.notes:
        out.print(f"note: {text}")


def _in_one_line(branch: Branch) -> str:
    """A closed branch in one line: where it is, and where it is stable."""
    met = [*branch.omega, *(item.omega for item in branch.bifurcations)]
    text = f"omega from {min(met):.7g} to {max(met):.7g}"
    stable = stable_ranges(branch)
    if not stable:
        return f"{text}, nowhere stable"
    return f"{text}, stable " + " and ".join(f"from {low:.7g} to {high:.7g}" for low, high in stable)


@_print.register(Table)
def _(table: Table, out: Console, note: str) -> None:
    """The columns that fit, and which do not."""
    left_out = _fitting(table, out, note)
    if left_out:
        out.print(f"not shown: {', '.join(left_out)} (--csv writes everything)")


def _fitting(table: Table, out: Console, note: str) -> list[str]:
    """Print the columns that fit; the names of the others."""
    out.print(f": {table.title}{note}")
    shown: dict[str, list[str]] = {}
    room = out.width
    for column in table.columns:
        texts = [_number(value) for value in table[column]]
        width = max(map(len, [column, *texts])) + 2
        if width <= min(room, 40):
            shown[column] = texts
            room -= width
    kinds = [name for name in shown if table[name].dtype.kind in "OU"]
    if shown:
        print_texts(out, list(shown), list(zip(*shown.values(), strict=True)), left=kinds)
    return [name for name in table.columns if name not in shown]


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


def print_sweep(out: Console, sweep: Sweep) -> None:
    """The table of its points, of each quantity the least, median and largest value, and what failed."""
    out.print(sweep.title or "sweep", style="bold", end="")
    note = f" in {sweep.seconds:.2f} s" if sweep.seconds == sweep.seconds else ""
    table = sweep.points_table()
    shown = {name: column[:_POINTS] for name, column in table.columns.items()}
    left_out = _fitting(Table(shown, table.title), out, note)
    cut = [f"the first {_POINTS} of {len(table)} points"] * (len(table) > _POINTS)
    cut += [f"{len(left_out)} further columns in the .csv file"] * bool(left_out)
    if cut:
        out.print("; ".join(cut))
    out.print("\nquantities", style="bold", end="")
    _print(sweep.summary(), out, "")
    for line in sweep.failure_lines():
        out.print(f"failed at {line}", soft_wrap=True)


# ----------------------------------------------------------------------------------------------------- for a machine
def sweep_as_plain(sweep: Sweep) -> dict[str, Any]:
    """A sweep as numbers, texts, arrays, lists and mappings."""
    failures = [{"point": number, "failure": text} for number, text in sweep.failures.items()]
    whole = {"title": sweep.title, "parameters": list(sweep.parameters), "points": len(sweep)}
    table = {str(name): column for name, column in sweep.to_table().columns.items()}
    return whole | {"interrupted": sweep.interrupted, "failures": failures, "columns": table}


def as_plain(item: Result) -> dict[str, Any]:
    """A result as numbers, texts, arrays, lists and mappings."""
    if isinstance(item, BifurcationDiagram):
        branches = []
        for node in item:
            parent = item.parent(node)
            place: dict[str, Any] = {"branch": node.number, "label": node.label, "depth": node.depth}
            place |= {"period": node.branch.nu, "parent": None if parent is None else parent.number}
            place["not_followed"] = [{"kind": b.kind, "omega": b.omega, "reason": why} for b, why in node.failures]
            branches.append(place | as_plain(node.branch))
        return {"stopped": item.stopped, "branches": branches}
    if isinstance(item, Isolas):
        isolas = [
            isola_row(isola) | {"closed": [{"at": at} | as_plain(branch) for at, branch in isola.known.items()]}
            for isola in item
        ]
        counts = {"limit_points": len(item.limit_points), "doublings": len(item.doublings)}
        state = {"notes": item.notes, "interrupted": item.interrupted}
        return {"parameter": item.parameter, "said": item.summary, "isolas": isolas} | counts | state
    if isinstance(item, Table):
        return {"title": item.title, "rows": len(item), "columns": item.columns}
    values = item.parameter(item.name)
    return {
        "points": len(item),
        "unstable": int(np.count_nonzero(~item.stable)) if len(item) else 0,
        "along": item.name,
        "from": values[0] if len(item) else None,
        "to": values[-1] if len(item) else None,
        "closed": bool(item.closed),
        "ended": item.ended,
        "warnings": item.warnings,
        "bifurcations": item.bifurcations_frame().to_dict("records"),
    }


def to_json(content: Any) -> str:
    """What `as_plain` gives, as JSON: complex numbers as pairs, null where a number is not finite."""
    return json.dumps(_held(content), ensure_ascii=False, allow_nan=False)


def _held(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _held(part) for name, part in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_held(part) for part in value]
    if isinstance(value, complex | np.complexfloating):
        return [_held(value.real), _held(value.imag)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value
