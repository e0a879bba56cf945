"""What a sweep keeps of the results of a study at one point: numbers, and lists of the first few numbers.

A quantity is named after its analysis, "response.peak_amplitude"; `MEANINGS` says what each is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from suboctave.continuation.ending import EndReason
from suboctave.maps.isolas.result import Isolas, isola_row
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.store.table import Table

Row = dict[str, float | list[float]]

#: kinds that are counted wherever they may be met, so that zero is a number and not a gap
_COUNTED = ("LP", "PD", "NS", "BP")
#: ends of a curve that say nothing against it
_REGULAR = {
    EndReason.START,
    EndReason.RANGE_END,
    EndReason.CLOSED,
    EndReason.MET_BRANCH,
    EndReason.MOTIONS_END,
    EndReason.CUT,
}
#: what each quantity is; "KIND" stands for a kind of bifurcation
MEANINGS = {
    "points": "points of the curve",
    "branches": "branches of the diagram",
    "regular": "1 where the curve ended regularly (range, closed, met another one), 0 where not",
    "closed": "1 where the curve closed on itself",
    "unstable_share": "share of the curve's length in its free parameter on which motions are unstable",
    "peak_amplitude": "largest amplitude of the observed degree of freedom at a computed point",
    "peak_omega": "frequency of the largest amplitude",
    "lowest": "lowest value of the free parameter",
    "highest": "highest value of the free parameter",
    "residual": "largest relative residual of harmonic balance",
    "neglected": "largest estimated size of the neglected harmonics, relative to the motion",
    "longest_period": "longest period of a motion, in periods of the load",
    "KIND": "how many were located",
    "KIND.omega": "frequencies of the first ones, in the order met",
    "KIND.amplitude": "amplitudes of the first ones",
    "KIND.value": "values of the free parameter at the first ones",
    "isolas": "how many isolas were found",
    "period": "period of the isola's motions, in periods of the load",
    "from": "lowest value of the design parameter at which the isola is detached",
    "to": "highest value of the design parameter at which the isola is detached",
    "born": "value of the design parameter at which the isola shrinks to a point; nan where the bounds cut that off",
    "born_omega": "frequency there",
    "merges": "value of the design parameter at which it joins another branch; nan where it does not",
    "merges_omega": "frequency there",
    "unsettled": "how many things the search could not settle (notes)",
    "rows": "rows of the table",
}


def quantities(results: Mapping[str, Any], listed: int) -> Row:
    """The quantities of all analyses; lists hold the first `listed` ones."""
    return {f"{name}.{what}": value for name, item in results.items() for what, value in _of(item, listed).items()}


@singledispatch
def _of(item: Any, listed: int) -> Row:
    raise TypeError(f"{type(item).__name__} has no quantities")


@_of.register(Branch)
def _(branch: Branch, listed: int) -> Row:
    """A curve: its size, its peak, its events, how well it is known."""
    row: Row = {"points": len(branch), "regular": _regular([branch]), "closed": float(branch.closed)}
    row |= _curves([branch])
    if len(branch) and branch.name != "omega":
        values = branch.parameter(branch.name)
        row |= {"lowest": float(values.min()), "highest": float(values.max())}
    return row | _events(branch.bifurcations.met, None if branch.name == "omega" else branch.name, listed)


@_of.register(BifurcationDiagram)
def _(diagram: BifurcationDiagram, listed: int) -> Row:
    """A diagram: the same over all its branches."""
    branches = [node.branch for node in diagram if len(node.branch)]
    row: Row = {"branches": len(diagram), "regular": _regular(branches)}
    row |= _curves(branches)
    row["longest_period"] = max((branch.nu for branch in branches), default=0)
    name = diagram.root.branch.name
    events = [event for branch in branches for event in branch.bifurcations.met]
    return row | _events(events, None if name == "omega" else name, listed)


@_of.register(Isolas)
def _(isolas: Isolas, listed: int) -> Row:
    """Isolas: how many, and range and ends of the first ones."""
    rows = [isola_row(isola) for isola in isolas][:listed]
    keys = ("period", "from", "to", "born", "born_omega", "merges", "merges_omega")
    unsettled = [note for noted in (isolas, *isolas) for note in noted.notes]
    row: Row = {"isolas": len(isolas), "unsettled": len(unsettled)}
    for key in keys:
        row[key] = [float(one[key]) for one in rows]
    return row


@_of.register(Table)
def _(table: Table, listed: int) -> Row:
    """A table: its columns of real numbers, the first rows."""
    row: Row = {"rows": len(table)}
    for name, column in table.columns.items():
        if column.dtype.kind in "iufb":
            row[name.replace("/", " per ")] = [float(value) for value in column[:listed]]
    return row


def _regular(branches: Iterable[Branch]) -> float:
    return float(all(ending.reason in _REGULAR for branch in branches for ending in branch.endings))


def _curves(branches: Sequence[Branch]) -> Row:
    """The peak of some curves, the share that is unstable, and how well they are known."""
    branches = [branch for branch in branches if len(branch)]
    if not branches:
        return {}
    highest = max(branches, key=lambda branch: branch.amplitude.max())
    peak = int(np.argmax(highest.amplitude))
    row: Row = {
        "peak_amplitude": float(highest.amplitude[peak]),
        "peak_omega": float(highest.omega[peak]),
        "residual": max(float(point.orbit.residual) for branch in branches for point in branch.points),
        "neglected": max(float(np.max(branch.truncation)) for branch in branches),
    }
    lengths = np.array([_lengths(branch) for branch in branches if not isinstance(branch, TrackedBranch)])
    if lengths.size and lengths[:, 0].any():
        whole, unstable = lengths.sum(axis=0)
        row["unstable_share"] = float(unstable / whole)
    return row


def _lengths(branch: Branch) -> tuple[float, float]:
    """Length of a curve in its free parameter, and of what of it is unstable; steps between two verdicts half each."""
    steps = np.abs(np.diff(branch.parameter(branch.name)))
    unstable = (~branch.stable).astype(float)
    return float(steps.sum()), float((steps * 0.5 * (unstable[1:] + unstable[:-1])).sum())


def _events(events: Sequence[Any], free: str | None, listed: int) -> Row:
    """How many events there are of each kind, and where the first ones lie."""
    counts = Counter(event.kind for event in events)
    row: Row = {}
    for kind in dict.fromkeys([*_COUNTED, *counts]):
        row[kind] = counts[kind]
        first = [event for event in events if event.kind == kind][:listed]
        if not first:
            continue
        row[f"{kind}.omega"] = [float(event.omega) for event in first]
        row[f"{kind}.amplitude"] = [float(event.amplitude) for event in first]
        if free is not None:
            row[f"{kind}.value"] = [float(event.parameter(free)) for event in first]
    return row
