"""The mesh of a structure, for pictures: points, cells and the labels of the nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.arguments import checked
from suboctave.errors import InputError, is_number, shortened
from suboctave.model.elements.base import Array
from suboctave.structures.dof_map import Node, node_label


@checked
@dataclass(frozen=True, eq=False)
class Mesh:
    """Points, cells and labels of nodes. Immutable.

    points
        Coordinates (N, 3), in the unit of length of the matrices; (N, 1) and (N, 2) are filled with zeros.
    cells
        Of each kind, in meshio's names ("line", "triangle", "quad", "tetra", "hexahedron", ...), indices (M, k) of
        points, from 0.
    nodes
        The labels (N,) of the points, whole numbers or texts; 0 to N - 1 where none are given.

    Raises `InputError` for shapes that do not fit, coordinates that are not finite, and indices of no point.
    """

    points: Array
    cells: Mapping[str, np.ndarray]
    nodes: tuple[Node, ...] = ()

    def __init__(
        self, points: ArrayLike, cells: Mapping[str, ArrayLike], nodes: Sequence[Node] | np.ndarray | None = None
    ) -> None:
        read = _points(points)
        labels = tuple(range(len(read))) if nodes is None else tuple(node_label(node) for node in nodes)
        if len(labels) != len(read) or len(set(labels)) < len(labels):
            raise InputError(f"a mesh of {len(read)} points needs {len(read)} different labels of nodes", ("nodes",))
        object.__setattr__(self, "points", read)
        object.__setattr__(self, "cells", _cells(cells, len(read)))
        object.__setattr__(self, "nodes", labels)

    def nearest(self, *place: float) -> Node:
        """The label of the node nearest to the point (x, y, z); what is left out is zero."""
        if not 1 <= len(place) <= 3 or not all(map(is_number, place)):
            raise InputError(f"nearest takes the coordinates x, y, z of a point, not {shortened(place)}")
        at = np.pad(np.array(place, dtype=float), (0, 3 - len(place)))
        return self.nodes[int(np.argmin(np.linalg.norm(self.points - at, axis=1)))]

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(rows)} {kind}" for kind, rows in self.cells.items())
        return f"Mesh: {len(self.points)} points; {counts or 'no cells'}"


def _points(given: Any) -> Array:
    try:
        points = np.array(given, dtype=float)
    except (TypeError, ValueError):
        points = np.zeros(0)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3 or not len(points):
        raise InputError(f"points of a mesh are an array (N, 3) of coordinates, not {shortened(given)}", ("points",))
    if not np.isfinite(points).all():
        raise InputError("points of a mesh: some coordinates are not finite", ("points",))
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    points.setflags(write=False)
    return points


def _cells(given: Any, count: int) -> dict[str, np.ndarray]:
    if not isinstance(given, Mapping):
        raise InputError(f"cells of a mesh are a mapping {{kind: (M, k) indices}}, not {shortened(given)}", ("cells",))
    cells = {}
    for kind, rows in given.items():
        indices = np.array(rows)
        if indices.ndim != 2 or indices.dtype.kind not in "iu":
            text = (
                f"cells {kind!r} of a mesh are whole numbers of the shape (M, k), not {indices.dtype} {indices.shape}"
            )
            raise InputError(text, ("cells", str(kind)))
        if indices.size and not (indices.min() >= 0 and indices.max() < count):
            wrong = indices.max() if indices.max() >= count else indices.min()
            raise InputError(f"cells {kind!r}: there is no point {wrong}, only 0 to {count - 1}", ("cells", str(kind)))
        indices.setflags(write=False)
        cells[str(kind)] = indices
    return cells
