"""What pictures of a structure are drawn from: displacements of nodes, the surface and the outline of a mesh."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError

if TYPE_CHECKING:
    from suboctave.structures.structure import Structure

#: sides of cells, by corners; kinds with nodes on their edges ("quad8") have the same
_SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}
_SOLID = ("tetra", "hexahedron", "wedge", "pyramid")
#: cosine of the angle between two faces, 30 degrees, from which their common edge belongs to the outline
_SHARP = 0.866


def nodal_displacements(structure: Structure, fields: Any) -> np.ndarray:
    """Displacements x, y, z of the nodes, (N, 3) of one field (n,), (T, N, 3) of several (T, n).

    Zero where a direction is fixed; rotations and what is no direction in space are left out. Raises `InputError` for
    arrays of another shape, and for structures without mesh or labels.
    """
    if structure.mesh is None or structure.dofs is None:
        missing = "mesh" if structure.mesh is None else "labels of its DOFs"
        raise InputError(f"this structure has no {missing}: there is nothing to draw")
    try:
        values = np.asarray(fields)
        if values.dtype.kind not in "fiu":
            raise TypeError
    except (TypeError, ValueError):
        raise InputError("a field is an array of real numbers, one for each DOF") from None
    if values.ndim not in (1, 2) or values.shape[-1] != structure.n or not values.size:
        hint = ", transposed" if values.ndim == 2 and values.shape[0] == structure.n else ""
        raise InputError(f"a field has {structure.n} values, several are (T, {structure.n}){hint}, not {values.shape}")
    if not np.isfinite(values).all():
        raise InputError("a field has values that are not finite")
    places = {node: place for place, node in enumerate(structure.mesh.nodes)}
    axes = {"x": 0, "y": 1, "z": 2}
    rows = [
        (dof, places[node], axes[direction])
        for dof, (node, direction) in enumerate(structure.dofs.labels)
        if direction in axes and node in places
    ]
    if not rows:
        raise InputError("no DOF is a displacement x, y or z of a node of the mesh")
    dof, place, axis = np.array(rows).T
    moved = np.zeros((*values.shape[:-1], len(places), 3))
    moved[..., place, axis] = values[..., dof]
    return moved


def surface(cells: Any) -> list[np.ndarray]:
    """The faces that are seen, arrays (F, 3) and (F, 4) of points: all faces of shells, outer ones of solids."""
    shells, solids = defaultdict[int, list[np.ndarray]](list), defaultdict[int, list[np.ndarray]](list)
    for kind, rows in cells.items():
        base = kind.rstrip("0123456789")
        for side in _SIDES.get(base, ()):
            (solids if base in _SOLID else shells)[len(side)].append(np.asarray(rows)[:, side])
    faces = []
    for corners in sorted({*shells, *solids}):
        parts = [*shells[corners]]
        if solids[corners]:
            every = np.concatenate(solids[corners])
            _, first, count = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
            parts.append(every[np.sort(first[count == 1])])
        faces.append(np.concatenate(parts))
    return [face for face in faces if len(face)]


def segments(cells: Any) -> np.ndarray:
    """The ends (S, 2) of all lines."""
    parts = [np.asarray(rows)[:, :2] for kind, rows in cells.items() if kind.rstrip("0123456789") == "line"]
    return np.concatenate(parts) if parts else np.zeros((0, 2), dtype=int)


def outline(points: np.ndarray, faces: list[np.ndarray]) -> np.ndarray:
    """The ends (E, 2) of the edges of a surface: those of one face, and those where two faces meet at an angle."""
    edges, normals = [], []
    for face in faces:
        first, second = points[face[:, 2]] - points[face[:, 0]], points[face[:, -1]] - points[face[:, 1]]
        normal = np.cross(first, second)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
        for start in range(face.shape[1]):
            edges.append(face[:, [start, (start + 1) % face.shape[1]]])
            normals.append(normal)
    if not edges:
        return np.zeros((0, 2), dtype=int)
    ends, directions = np.sort(np.concatenate(edges), axis=1), np.concatenate(normals)
    unique, group, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(unique), 3))
    np.add.at(total, group.ravel(), directions)
    # two unit normals at the angle phi add up to 2 cos(phi / 2)
    blunt = (count == 2) & (np.linalg.norm(total, axis=1) > 2.0 * np.sqrt(0.5 * (1.0 + _SHARP)))
    return unique[~blunt]
