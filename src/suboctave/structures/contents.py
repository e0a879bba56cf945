"""What a file holds: matrices by their names, labels of degrees of freedom; and which matrix is the mass.

Matrices are recognised by their names, in any case: M, mass, MGG, MAA and the like; K, stiffness, KGG, KAA; C, D,
damping, BGG, BAA; structural, K4, K4GG, K4AA. Where several could be meant, a reader is told to choose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.structures.triplets import LabelledEntries

#: what the matrices are, in the order of the constructor of a structure
ROLES = ("mass", "stiffness", "damping", "structural")
#: those that a structure may have none of
OPTIONAL = ("damping", "structural")
_NAMES = {
    "mass": {"m", "mgg", "maa", "mll", "mff", "mhh", "maax", "mggx"},
    "stiffness": {"k", "kgg", "kaa", "kll", "kff", "khh", "kaax", "kggx"},
    "damping": {"c", "d", "bgg", "baa", "bll", "bff", "bhh", "baax", "bggx"},
    "structural": {"k4", "k4gg", "k4aa", "k4ll", "k4ff", "k4hh", "k4aax", "k4ggx"},
}
_BEGINNINGS = {"mass": ("mass",), "stiffness": ("stif",), "damping": ("damp",), "structural": ("struct",)}


@dataclass(frozen=True)
class Unreadable:
    """A matrix of a file that is none of a structure, such as a load: why, for whoever asks for it."""

    reason: str


@dataclass(frozen=True, eq=False)
class Contents:
    """Matrices of a file by their names, dense, sparse, `LabelledEntries` or `Unreadable`; more of a structure, as its
    arguments.
    """

    matrices: Mapping[str, Any]
    more: Mapping[str, Any] = field(default_factory=dict)


def chosen(matrices: Mapping[str, Any], names: Mapping[str, str | None], file: str) -> dict[str, Any]:
    """The matrices of a structure among those of a file: by the names that a user gives, else by their usual names.

    Raises `InputError` where mass or stiffness is missing, or several could be meant.
    """
    found = {what: matrix_of(matrices, what, names.get(what), file) for what in ROLES}
    return {what: matrix for what, matrix in found.items() if matrix is not None}


def matrix_of(matrices: Mapping[str, Any], what: str, name: str | None, file: str) -> Any:
    """The mass, stiffness or a damping (`what`) among the matrices of a file; None for a damping that is not there."""
    if name is not None:
        if name not in matrices:
            raise InputError(f"{file} holds no matrix {name!r}{suggest(name, matrices)}", (what,))
        return _readable(matrices[name], what)
    candidates = sorted(name for name, matrix in matrices.items() if _means(name, what) and _is_square(matrix))
    if len(candidates) > 1:
        how = f"choose one with {what}={candidates[0]!r}"
        raise InputError(f"{file} holds several that may be the {what}, {', '.join(candidates)}: {how}", (what,))
    if candidates:
        return _readable(matrices[candidates[0]], what)
    if what in OPTIONAL:
        return None
    if set(matrices) == {""}:
        raise InputError(f"{file} holds one matrix: give a file for each, mass= and stiffness=, and no other", (what,))
    there = ", ".join(sorted(matrices)[:12]) or "none"
    raise InputError(f"{file} has no matrix named as a {what}, it has {there}; say which it is: {what}=", (what,))


def _readable(matrix: Any, what: str) -> Any:
    if isinstance(matrix, Unreadable):
        raise InputError(matrix.reason, (what,))
    return matrix


def _means(name: str, what: str) -> bool:
    plain = name.replace("/", ".").rpartition(".")[2].lower().removesuffix("matrix").removesuffix("mat").strip("_ ")
    return plain in _NAMES[what] or plain.startswith(_BEGINNINGS[what])


def _is_square(matrix: Any) -> bool:
    if isinstance(matrix, LabelledEntries | Unreadable):
        return True
    shape = tuple(matrix.shape)
    return len(shape) == 2 and len(set(shape)) == 1


def compressed(parts: Mapping[str, Any], by_columns: bool, what: str) -> Any:
    """A sparse matrix from data, indices, indptr and shape; InputError where these do not fit each other."""
    import scipy.sparse

    data, indices, indptr = (np.asarray(parts[name]) for name in ("data", "indices", "indptr"))
    if any(array.dtype.kind not in "iu" or array.ndim != 1 for array in (indices, indptr)) or not len(indptr):
        raise InputError(f"{what}: indices and indptr of a sparse matrix are rows of whole numbers")
    lines = len(indptr) - 1
    shape = tuple(int(size) for size in np.ravel(parts["shape"])) if "shape" in parts else (lines, lines)
    if len(shape) != 2 or shape[1 if by_columns else 0] != lines:
        raise InputError(f"{what}: a sparse matrix of {lines} lines does not have the shape {shape}")
    if len(indices) and int(indices.max()) >= min(2**63, shape[0 if by_columns else 1]):
        raise InputError(f"{what}: the index {indices.max()} is outside of the shape {shape}")
    kind = scipy.sparse.csc_array if by_columns else scipy.sparse.csr_array
    matrix = kind((data, indices.astype(np.int64), indptr.astype(np.int64)), shape=shape)
    matrix.check_format(full_check=True)
    return matrix.tocsr()


def labels_of(arrays: Mapping[str, Any]) -> list[tuple[Any, Any]] | None:
    """The labels among the arrays of a file: `dof_nodes` and `dof_directions`, or `dofs` (n, 2); None without any."""
    if "dof_nodes" in arrays and "dof_directions" in arrays:
        nodes, directions = (np.ravel(arrays[name]) for name in ("dof_nodes", "dof_directions"))
        if len(nodes) != len(directions):
            raise InputError(f"dof_nodes has {len(nodes)} entries, dof_directions {len(directions)}", ("dofs",))
        return list(zip(_texts(nodes), _texts(directions), strict=True))
    pairs = np.asarray(arrays.get("dofs", np.zeros(0)))
    if pairs.ndim == 2 and pairs.shape[1] == 2:
        return list(zip(_texts(pairs[:, 0]), _texts(pairs[:, 1]), strict=True))
    return None


def _texts(values: np.ndarray) -> list[Any]:
    if values.dtype.kind == "f" and np.isfinite(values).all() and (values == np.round(values)).all():
        return [int(value) for value in values]
    return [value.decode() if isinstance(value, bytes) else value for value in values.tolist()]
