"""A response with the branches that bifurcate from it, as a tree: what `bifurcation_diagram` gives."""

from __future__ import annotations

import textwrap
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.junction import period_name
from suboctave.errors import InputError
from suboctave.interruption import Interruption
from suboctave.model.system import System
from suboctave.results.branch import Branch, CurveTables
from suboctave.results.readings import Readings, shared
from suboctave.store.layout import led_by

if TYPE_CHECKING:
    import pandas
    import xarray


#: characters of a line of a printed diagram
WIDTH = 88
#: characters left for words, however deep a branch lies
_LEAST = 30
_SHORT = {"supercritical": "super", "subcritical": "sub"}
#: a space at which no line is broken
_JOINED = "\u00a0"


@dataclass(eq=False, repr=False)
class DiagramBranch:
    """A branch of a diagram with those that leave it.

    Attributes
    ----------
    branch
        The curve.
    origin
        The bifurcation of the parent that it leaves at; None for the response itself, and for that from the other end
        of the range.
    depth
        0 for the response, 1 for what leaves it, ...
    number
        Its number in the diagram: 0 for the response, then in the order in which they were found.
    children
        The branches that leave it, in the order in which it meets them.
    failures
        Bifurcations whose other branch could not be followed, and why.
    left
        Bifurcations that were not switched at, since the depth or the budget was reached.
    met
        The parent's branch points, some of which it may pass through.
    crossings
        How many of the bifurcations on the way to it are branch points.
    """

    branch: Branch
    origin: Bifurcation | None = None
    depth: int = 0
    number: int = 0
    children: list[DiagramBranch] = field(default_factory=list)
    failures: list[tuple[Bifurcation, str]] = field(default_factory=list)
    left: list[Bifurcation] = field(default_factory=list)
    met: list[Bifurcation] = field(default_factory=list)
    crossings: int = 0

    def __iter__(self) -> Iterator[DiagramBranch]:
        """This one and all below it, in the order in which they were found."""
        waiting = deque([self])
        while waiting:
            node = waiting.popleft()
            waiting.extend(node.children)
            yield node

    @property
    def label(self) -> str:
        """Its period and where it begins and ends: "2T, PD 4.1 to PD 2.5"."""
        branch = self.branch
        text = period_name(branch.nu)
        name = branch.name
        if not len(branch):
            return f"{text}, empty"
        if branch.closed:
            origin = self.origin
            through = "" if origin is None else f" through {origin.kind} {origin.parameter(name):.7g}"
            return f"{text}, closed{through}"
        ends = [
            f"{j.kind} {j.parameter:.7g}" if j is not None else f"{name} {branch.parameter(name)[i]:.7g}"
            for j, i in ((branch.departs, 0), (branch.arrives, -1))
        ]
        return f"{text}, {ends[0]} to {ends[1]}"

    def __repr__(self) -> str:
        count = len(self.children)
        return f"<branch {self.number}: {self.label}, {len(self.branch)} points, {count} branches leave it>"


@checked(result=True)
class BifurcationDiagram(CurveTables):
    """A response and the branches that bifurcate from it, as a tree; print it to see all of it.

    `diagram[2]` is the place of branch 2 in the tree, `diagram["4T"]` that of the one branch whose label begins so;
    `diagram[2].branch` the curve.

    Attributes
    ----------
    root
        The response, with `children` at every level (`DiagramBranch`). A response from the other end of the range,
        which one that folds back and leaves the range where it began does not reach, is the first of them.
    stopped
        Why not all branches were followed, in words; empty if they were.
    seconds
        How long it took.
    """

    def __init__(self, root: DiagramBranch, stopped: str = "", interruption: Interruption | None = None) -> None:
        self.root = root
        self.stopped = stopped
        self.interruption = interruption
        for number, node in enumerate(root):
            node.number = number

    def __iter__(self) -> Iterator[DiagramBranch]:
        """Every branch with its place in the tree, by number: the response, what leaves it, what leaves that, ..."""
        return iter(self.root)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __getitem__(self, which: int | str) -> DiagramBranch:
        nodes = list(self)
        if isinstance(which, str):
            matching = [node for node in nodes if node.label.startswith(which)]
            if len(matching) == 1:
                return matching[0]
            if not matching:
                listed = "; ".join(f"{node.number}: {node.label}" for node in nodes[:12])
                more = "; ..." if len(nodes) > 12 else ""
                raise InputError(f"no branch of the diagram has a label that begins with {which!r} ({listed}{more})")
            several = "; ".join(f"{node.number}: {node.label}" for node in matching)
            raise InputError(f"{len(matching)} branches have a label that begins with {which!r}: {several}")
        if isinstance(which, bool) or not isinstance(which, int | np.integer):
            raise InputError(f"a branch of a diagram is chosen by its number or its label, not by {which!r}")
        if not -len(nodes) <= which < len(nodes):
            raise InputError(f"the diagram has {len(nodes)} branches, numbered from 0, so that there is no {which}")
        return nodes[which]

    @property
    def branches(self) -> list[Branch]:
        """All curves, by number."""
        return [node.branch for node in self]

    @property
    def responses(self) -> list[Branch]:
        """The curves that begin at an end of the range: the response, and that from the other end if it is another."""
        return [node.branch for node in self if node.origin is None]

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """All located bifurcations, branch by branch."""
        return [item for branch in self.branches for item in branch.bifurcations]

    def of_period(self, nu: int) -> list[Branch]:
        """The branches of motions of `nu` load periods."""
        return [branch for branch in self.branches if branch.nu == nu]

    def parent(self, node: DiagramBranch) -> DiagramBranch | None:
        """The branch that one leaves; None for the response."""
        return next((other for other in self if any(child is node for child in other.children)), None)

    @property
    def legend(self) -> list[str] | None:
        """What a figure calls its curves (those with points); None where their periods tell them apart."""
        drawn = [node for node in self if len(node.branch)]
        if len({node.branch.nu for node in drawn}) > 1:
            return None
        several = len(self.responses) > 1
        return [_named(node, several) for node in drawn]

    @property
    def marks(self) -> list[str]:
        """What a figure marks: everything that its branches meet but contacts, which would hide the rest."""
        met = (item for branch in self.branches for item in (*branch.bifurcations, *branch.events))
        return list(dict.fromkeys(item.kind for item in met))

    @property
    def _observed(self) -> tuple[System, int]:
        return self.root.branch.system, self.root.branch.observe

    def to_dataframe(self, readings: Readings = False) -> pandas.DataFrame:
        """One row per point: the number, period and depth of its branch, then what `Branch.to_dataframe` has.

        A read-off such as "harmonic_0.5" is nan on branches whose motions have no such component.
        """
        chosen = shared(readings, [node.branch.nu for node in self])
        return self._joined([node.branch.to_dataframe(names) for node, names in zip(self, chosen, strict=True)])

    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation: the number, period and depth of its branch, kind, place, amplitude."""
        return self._joined([node.branch.bifurcations_frame() for node in self])

    def _joined(self, frames: list[pandas.DataFrame]) -> pandas.DataFrame:
        import pandas as pd

        frames = [
            led_by(frame, {"branch": node.number, "nu": node.branch.nu, "depth": node.depth})
            for node, frame in zip(self, frames, strict=True)
        ]
        return pd.concat([frame for frame in frames if len(frame)] or frames[:1], ignore_index=True)

    def to_xarray(self, readings: Readings = False, motions: bool = False) -> dict[str, xarray.Dataset]:
        """The datasets of all branches (`Branch.to_xarray`) by number and label: "1: 2T, PD 3.99 to PD 2.30".

        A read-off such as "harmonic_0.5" is left out of branches whose motions have no such component.
        """
        nodes = [node for node in self if len(node.branch)]
        chosen = shared(readings, [node.branch.nu for node in nodes])
        return {
            f"{node.number}: {node.label}": node.branch.to_xarray(names, motions)
            for node, names in zip(nodes, chosen, strict=True)
        }

    def __repr__(self) -> str:
        return tree_text(self)


def _named(node: DiagramBranch, several: bool) -> str:
    """A branch by where it comes from; `several`: there are responses from both ends."""
    name = node.branch.name
    if node.origin is not None:
        return f"from {node.origin.kind} {node.origin.parameter(name):.4g}"
    return f"response from {name} = {float(node.branch.parameter(name)[0]):.4g}" if several else "response"


def tree_text(diagram: BifurcationDiagram, width: int = WIDTH, head: bool = True) -> str:
    """The tree in lines of at most `width` characters, as long as there is room; `head`: with a line above it.

    0  T, omega 4.5 to omega 1.3: 123 points, 30 unstable
    │  PD 3.9816, 2.39144
    └─ 1  2T, PD 3.981602 to PD 2.39144: 99 points, 34 unstable
          LP 3.07344, 3.65104
    """
    count = len(diagram)
    title = f"Bifurcation diagram along {diagram.root.branch.name}: {count} branch{'es' * (count != 1)}"
    lines = [title] if head else []
    lines += _drawn(diagram.root, "", "", width)
    if diagram.stopped:
        lines += textwrap.wrap(diagram.stopped, width)
    return "\n".join(lines)


def _drawn(node: DiagramBranch, first: str, rest: str, width: int) -> Iterator[str]:
    """The lines of a branch and those below it; the first begins with `first`, the others with `rest`."""
    branch = node.branch
    number = f"{node.number}  "
    entries: list[DiagramBranch | tuple[Bifurcation, str]] = [*node.children, *node.failures]
    bar = "│".ljust(len(number)) if entries else " " * len(number)
    title = f"{node.label}: {len(branch)} points, {branch.verdicts}"
    yield from _wrapped(title, first + number, rest + bar, width)
    met = _met(branch.name, list(branch.bifurcations))
    if met:
        yield from _wrapped(met, rest + bar, rest + bar, width)
    for place, entry in enumerate(entries):
        head, tail = ("└─ ", "   ") if place == len(entries) - 1 else ("├─ ", "│  ")
        if isinstance(entry, tuple):
            item, why = entry
            words = f"{item.kind}{_JOINED}{item.parameter(branch.name):.6g} not followed: {why}"
            yield from _wrapped(words, rest + head, rest + tail, width)
        else:
            yield from _drawn(entry, rest + head, rest + tail, width)


def _met(name: str, items: list[Bifurcation]) -> str:
    """Bifurcations by kind, in the order met, with their criticality where it is known."""
    kinds = dict.fromkeys(item.kind for item in items)
    parts = []
    for kind in kinds:
        met = [(f"{i.parameter(name):.6g}", _SHORT.get(i.criticality or "", "")) for i in items if i.kind == kind]
        places = [place + (f"{_JOINED}({sense})" if sense else "") for place, sense in met]
        parts.append(f"{kind}{_JOINED}" + ", ".join(places))
    return "; ".join(parts)


def _wrapped(text: str, first: str, rest: str, width: int) -> list[str]:
    room = max(width, len(first) + _LEAST)
    lines = textwrap.wrap(text, room, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    return [line.replace(_JOINED, " ").rstrip() for line in lines]
