"""Which degree of freedom is which: the node and the direction of every row of the matrices.

A label is `(node, direction)`. Nodes are whole numbers (negative ones too: internal nodes of Abaqus) or texts;
directions are x, y, z, rx, ry, rz, or any other text for what is none of these. Both are read as users write them:
1042, "1042" and "node 1042"; "z", "Z", 3, "uz", "T3".
"""

from __future__ import annotations

import difflib
import operator
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, TypeAlias

import numpy as np

from suboctave.arguments import READ, checked
from suboctave.errors import InputError, shortened, suggest
from suboctave.model.elements.base import Array
from suboctave.model.loads import DIRECTIONS

Node: TypeAlias = int | str
Label: TypeAlias = tuple[Node, str]
#: a node or a direction, and labels, as users give them
GivenName: TypeAlias = Annotated[int | str, READ]
GivenLabels: TypeAlias = Annotated[Iterable[tuple[int | str, int | str]], READ]

#: other names of the directions: numbers, those of Ansys (UX, ROTX), of Nastran (T1, R1)
_OTHER_NAMES = {
    name: direction
    for i, direction in enumerate(DIRECTIONS)
    for name in (
        str(i + 1),
        direction,
        f"u{direction}" if i < 3 else f"rot{direction[1]}",
        f"t{i + 1}" if i < 3 else f"r{i - 2}",
        *((f"u{direction}",) if i >= 3 else ()),
    )
}
#: texts that name a node, not a DOF
_NODE = re.compile(r"node[\s_]+\S+|[+-]?\d+", re.IGNORECASE)
#: names shown of many
_SHOWN = 6


def node_label(given: Any) -> Node:
    """A node as it is kept: 1042 for 1042, "1042" and "node 1042"; other texts as they are."""
    if type(given) is int:
        return given
    if isinstance(given, str):
        text = re.sub(r"^node[\s_]+", "", given.strip(), flags=re.IGNORECASE)
        if re.fullmatch(r"[+-]?\d{1,18}", text):
            return int(text)
        if text:
            return text
    try:
        if not isinstance(given, bool | np.bool_):
            return operator.index(given)
    except TypeError:
        pass
    raise InputError(f"a node is a whole number or a text, not {shortened(given)}")


def direction_label(given: Any) -> str:
    """A direction as it is kept: x y z rx ry rz for these and the numbers 1 to 6, other texts in small letters."""
    text = given.strip().lower() if isinstance(given, str) else ""
    if not text and not isinstance(given, bool | np.bool_):
        try:
            text = str(operator.index(given))
        except TypeError:
            text = ""
    if not text or " " in text:
        raise InputError(
            f"a direction is one of {', '.join(DIRECTIONS)} or a number from 1 to 6, not {shortened(given)}"
        )
    return _OTHER_NAMES.get(text, text)


@checked
@dataclass(frozen=True, eq=False)
class DofMap:
    """The labels `(node, direction)` of the degrees of freedom, in the order of the matrices. Immutable.

    labels
        One for each degree of freedom, all of them different.
    fixed
        Labels of degrees of freedom that were there and have been fixed, for messages.

    Raises `InputError` for what is no label, and for labels that occur twice.
    """

    labels: tuple[Label, ...]
    fixed: frozenset[Label]

    def __init__(self, labels: GivenLabels, fixed: GivenLabels = ()) -> None:
        object.__setattr__(self, "labels", _labels(labels))
        object.__setattr__(self, "fixed", frozenset(_labels(fixed)))
        if len(self._places) < len(self.labels):
            ((twice, _),) = Counter(self.labels).most_common(1)
            raise InputError(f"the DOF map names {_text(twice)} more than once; every label is for one DOF")

    @cached_property
    def _places(self) -> dict[Label, int]:
        return {label: i for i, label in enumerate(self.labels)}

    @cached_property
    def _nodes(self) -> dict[Node, list[str]]:
        """The directions that each node has."""
        nodes: dict[Node, list[str]] = {}
        for node, direction in self.labels:
            nodes.setdefault(node, []).append(direction)
        return nodes

    @property
    def names(self) -> tuple[str, ...]:
        """The labels as texts, "1042 z"."""
        return tuple(map(_text, self.labels))

    def index(self, node: GivenName, direction: GivenName | None = None) -> int:
        """The number, from 0, of the degree of freedom of a node in a direction; or of a text like "1042 z".

        Raises `InputError` with what there is near it.
        """
        if direction is None:
            node, direction = _both(node)
        label = (node_label(node), direction_label(direction))
        if label[0] not in self._nodes and isinstance(label[0], str):
            alike = [other for other in self._nodes if str(other).lower() == label[0].lower()]
            label = (alike[0], label[1]) if len(alike) == 1 else label
        place = self._places.get(label)
        if place is None:
            raise InputError(self._missing(*label))
        return place

    def of_node(self, text: str) -> list[int]:
        """The degrees of freedom of a node, "node 1042" or "1042"; none where the text is not the name of one.

        Raises `InputError` for the form "node 1042" or a number where there is no such node.
        """
        node = node_label(text)
        if node not in self._nodes and _NODE.fullmatch(text.strip()):
            raise InputError(self._no_node(node))
        return [self._places[node, direction] for direction in self._nodes.get(node, ())]

    def places(self, given: Any) -> list[int]:
        """The degrees of freedom that a key of a direction names: one by node and direction, or "1042 z"; by a
        direction alone, "z", all of that direction.

        Raises `InputError` as `index`, and for directions that there are not.
        """
        if isinstance(given, tuple) and len(given) == 2:
            return [self.index(*given)]
        text = given.strip() if isinstance(given, str) else ""
        there = dict.fromkeys(direction for _, direction in self.labels)
        direction = direction_label(text) if text.isidentifier() else ""
        if direction in there:
            return [i for i, label in enumerate(self.labels) if label[1] == direction]
        if direction in DIRECTIONS:
            raise InputError(f"no DOF has the direction {direction!r}; there are {', '.join(there)}")
        return [self.index(given)]

    def without(self, dofs: Sequence[int]) -> DofMap:
        """The map of what is left when these degrees of freedom are fixed."""
        gone = set(dofs)
        if wrong := [dof for dof in gone if not 0 <= dof < len(self.labels)]:
            raise InputError(f"dofs: there is no degree of freedom {wrong[0]}, only 0 to {len(self.labels) - 1}")
        kept = [label for i, label in enumerate(self.labels) if i not in gone]
        return DofMap(kept, {self.labels[i] for i in gone} | self.fixed)

    def _missing(self, node: Node, direction: str) -> str:
        """Why there is no such degree of freedom."""
        if (node, direction) in self.fixed:
            return f"the DOF {_text((node, direction))} is fixed: it is no degree of freedom of this structure any more"
        if node in self._nodes:
            has = ", ".join(self._nodes[node])
            fixed = ", ".join(sorted(other for which, other in self.fixed if which == node))
            return f"node {node} has no direction {direction!r}; it has {has}" + (f" (fixed: {fixed})" if fixed else "")
        return self._no_node(node)

    def _no_node(self, node: Node) -> str:
        """Why there is no such node."""
        if any(which == node for which, _ in self.fixed):
            return f"all DOFs of node {node} are fixed: it moves no more"
        return f"there is no node {node!r}{self._near(node)}"

    def _near(self, node: Node) -> str:
        if not isinstance(node, int):
            return suggest(str(node), map(str, self._nodes))
        numbers = sorted(other for other in self._nodes if isinstance(other, int))
        if not numbers:
            return suggest(str(node), map(str, self._nodes))
        # misspelt: a digit wrong, missing or exchanged; else the numbers beside it
        alike = difflib.get_close_matches(str(node), map(str, numbers), n=2, cutoff=0.7) if len(numbers) < 20000 else []
        beside = sorted(numbers, key=lambda other: abs(other - node))[:2]
        near = list(dict.fromkeys([*alike, *map(str, beside)]))[:4]
        return f"; nearest: {', '.join(near)}; there are {len(self._nodes)} nodes, {numbers[0]} to {numbers[-1]}"

    def __len__(self) -> int:
        return len(self.labels)

    def __repr__(self) -> str:
        shown = ", ".join(map(_text, self.labels[:_SHOWN])) + ", ..." * (len(self.labels) > _SHOWN)
        return f"DofMap: {len(self.labels)} DOFs of {len(self._nodes)} nodes ({shown})"


def shown_dofs(dofs: Sequence[int], labels: DofMap | None) -> str:
    """Some degrees of freedom by their labels, or numbers, as messages show them."""
    names = [_text(labels.labels[i]) if labels is not None else str(i) for i in dofs[:_SHOWN]]
    return ", ".join(names) + (f", ... ({len(dofs)} in all)" if len(dofs) > _SHOWN else "")


def weighted(labels: DofMap, weights: Mapping[Any, Any] | str) -> Array:
    """The vector (n,) with these weights at `(node, direction)`, at texts like "1042 z", or at all DOFs of a direction,
    "z"; zero elsewhere. A direction alone has the weight 1.
    """
    weights = {weights: 1.0} if isinstance(weights, str) else weights
    if not isinstance(weights, Mapping) or not weights:
        raise InputError(f"a direction is 'x', or a mapping {{(node, direction): weight}}, not {shortened(weights)}")
    vector = np.zeros(len(labels))
    for key, weight in weights.items():
        places = labels.places(key)
        try:
            number = float(weight)
        except (TypeError, ValueError):
            number = float("nan")
        if not np.isfinite(number):
            raise InputError(f"the weight of {shortened(key)} must be a finite number, not {shortened(weight)}")
        vector[places] += number
    return vector


def _labels(given: Any) -> tuple[Label, ...]:
    try:
        pairs = [(node, direction) for node, direction in given]
    except (TypeError, ValueError):
        raise InputError(f"a DOF map is a sequence of pairs (node, direction), not {shortened(given)}") from None
    nodes: dict[Any, Node] = {}
    read = []
    for node, direction in pairs:
        # thousands of labels are the same few texts and numbers, of which nothing else is kept
        label = nodes.get(node) if type(node) in (int, str) else None
        if label is None:
            label = node_label(node)
            if type(node) in (int, str):
                nodes[node] = label
        known = _OTHER_NAMES.get(direction) if isinstance(direction, str) else None
        read.append((label, known or direction_label(direction)))
    return tuple(read)


def _both(text: Any) -> tuple[str, str]:
    """Node and direction of a text like "1042 z", "node 1042 z" or "1042:z"."""
    if not isinstance(text, str):
        raise InputError(f"a DOF is given by node and direction, or a text such as '1042 z', not by {shortened(text)}")
    match = re.fullmatch(r"(.*\S)[\s:,/]+([A-Za-z]+\d*|[1-6])", text.strip())
    if match is None or match[1].lower() == "node":
        raise InputError(f"{shortened(text)} is no DOF: write node and direction, such as '1042 z'")
    return match[1].rstrip(" :,/"), match[2]


def _text(label: Label) -> str:
    return f"{label[0]} {label[1]}"


#: what a structure has, once it is made; pairs (node, direction) are read into it
GivenDofs: TypeAlias = Annotated[DofMap | None, READ]
