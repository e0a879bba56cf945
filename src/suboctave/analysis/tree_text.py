"""A bifurcation diagram as text: the tree of its branches, each with its number, label and bifurcations.

0  T, omega 4.5 to omega 1.3: 123 points, 30 unstable
│  PD 3.9816, 2.39144
└─ 1  2T, PD 3.981602 to PD 2.39144: 99 points, 34 unstable
      LP 3.07344, 3.65104
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

from suboctave.bifurcation import Bifurcation

if TYPE_CHECKING:
    from suboctave.analysis.tree import BifurcationDiagram, DiagramBranch

__all__ = ["WIDTH", "tree_text"]

WIDTH = 88
#: least room for words, however deep a branch lies
_LEAST = 30
_SHORT = {"supercritical": "super", "subcritical": "sub"}
_JOINED = "\u00a0"  # no line is broken here


def tree_text(diagram: BifurcationDiagram, width: int = WIDTH, head: bool = True) -> str:
    """The tree in lines of at most `width` characters, as long as there is room; `head`: with a line above it."""
    count = len(diagram)
    said = f"Bifurcation diagram along {diagram.root.branch.name}: {count} branch{'es' * (count != 1)}"
    lines = [said] if head else []
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
    said = f"{node.label}: {len(branch)} points, {branch.verdicts}"
    yield from _wrapped(said, first + number, rest + bar, width)
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
        places = [_place(name, item) for item in items if item.kind == kind]
        parts.append(f"{kind}{_JOINED}" + ", ".join(places))
    return "; ".join(parts)


def _place(name: str, item: Bifurcation) -> str:
    sense = _SHORT.get(item.criticality or "", "")
    return f"{item.parameter(name):.6g}" + (f"{_JOINED}({sense})" if sense else "")


def _wrapped(text: str, first: str, rest: str, width: int) -> list[str]:
    room = max(width, len(first) + _LEAST)
    lines = textwrap.wrap(text, room, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    return [line.replace(_JOINED, " ").rstrip() for line in lines]
