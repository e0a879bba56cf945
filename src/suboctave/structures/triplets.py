"""Matrices from lists of entries: halves of symmetric ones made whole, labelled ones of several files put together.

Programs write symmetric matrices by one triangle, in the order of their own numbering, or by all entries. Which of
these a file holds shows in it: with one triangle no entry off the diagonal has its mirror image.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.model.elements.base import Array
from suboctave.structures.dof_map import DofMap, Label, direction_label

#: numbers of directions beyond which a label is none; Abaqus counts up to 40
_MOST_DIRECTIONS = 64
#: labels shown of many
_SHOWN = 4


@dataclass(frozen=True, eq=False)
class LabelledEntries:
    """Entries of one matrix by node and number of the direction.

    rows, columns
        Whole numbers (m, 2), node and direction.
    values
        Entries (m,).
    """

    rows: np.ndarray
    columns: np.ndarray
    values: Array


def from_triplets(rows: Any, columns: Any, values: Any, n: int, what: str) -> Any:
    """The matrix (n, n) of entries at rows and columns from 0, a triangle made whole; `what` names the file.

    Raises `InputError` for rows or columns that are none of 0 to n - 1, and for entries that occur twice.
    """
    import scipy.sparse

    rows, columns = np.asarray(rows, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    values = np.asarray(values, dtype=float)
    for places in (rows, columns):
        wrong = places[(places < 0) | (places >= n)]
        if wrong.size:
            raise InputError(f"{what}: an entry stands in row or column {wrong[0] + 1}; there are {n}")
    codes = rows * n + columns
    if len(np.unique(codes)) < len(codes):
        order = np.sort(codes)
        row, column = divmod(int(order[:-1][order[:-1] == order[1:]][0]), n)
        raise InputError(f"{what}: the entry of row {row + 1}, column {column + 1} is given twice")
    off = rows != columns
    if off.any() and not np.isin(columns[off] * n + rows[off], codes).any():
        rows, columns = np.append(rows, columns[off]), np.append(columns, rows[off])
        values = np.append(values, values[off])
    return scipy.sparse.csr_array((values, (rows, columns)), shape=(n, n))


def mirrored(matrix: Any, symmetry: str, file: str) -> Any:
    """A matrix, sparse or dense, whose header says "symmetric", "skew-symmetric" or "hermitian", from one triangle; one
    that is "general" as it is.

    Raises `InputError` where both triangles have entries.
    """
    import scipy.sparse

    if symmetry == "general":
        return matrix
    sparse = scipy.sparse.issparse(matrix)
    lower, upper = (scipy.sparse.tril, scipy.sparse.triu) if sparse else (np.tril, np.triu)
    below, above = lower(matrix, -1), upper(matrix, 1)
    if matrix.shape[0] != matrix.shape[1]:
        raise InputError(
            f"{file} says that it is {symmetry}, but has {matrix.shape[0]} rows and {matrix.shape[1]} columns"
        )
    if abs(below).sum() and abs(above).sum():
        raise InputError(f"{file} says that it is {symmetry}, but has entries on both sides of the diagonal")
    off = (below + above).T
    other = {"symmetric": off, "skew-symmetric": -off, "hermitian": off.conj()}[symmetry]
    return (matrix + other).tocsr() if sparse else matrix + other


def put_together(
    given: Mapping[str, LabelledEntries], files: Mapping[str, str], order: DofMap | None
) -> tuple[dict[str, Any], Sequence[Label]]:
    """Matrices by what they are (mass, stiffness, damping) over the same labels, and these.

    Degrees of freedom are sorted by node and direction, or as `order` says. Those that the mass does not name have no
    inertia. Raises `InputError` where mass or damping name some that the stiffness does not: a file was cut off.
    """
    codes = {what: (_codes(entries.rows), _codes(entries.columns)) for what, entries in given.items()}
    named = {what: np.union1d(*pair) for what, pair in codes.items()}
    if "stiffness" in named:
        for what, known in named.items():
            beyond = np.setdiff1d(known, named["stiffness"])
            if beyond.size:
                shown = ", ".join(_text(code) for code in beyond[:_SHOWN])
                raise InputError(
                    f"{files[what]} names {beyond.size} DOFs that {files['stiffness']} does not ({shown}): one of the "
                    "files may be cut off, or they belong to different models"
                )
    known = np.unique(np.concatenate(list(named.values())))
    if order is None:
        labels: Sequence[Label] = [_label(code) for code in known.tolist()]
        place = {code: i for i, code in enumerate(known.tolist())}
    else:
        labels = order.labels
        place = {code: order.index(*_label(code)) for code in known.tolist()}
    positions = np.array([place[code] for code in known.tolist()], dtype=np.int64)
    matrices = {}
    for what, (rows, columns) in codes.items():
        i, j = (positions[np.searchsorted(known, one)] for one in (rows, columns))
        matrices[what] = from_triplets(i, j, given[what].values, len(labels), files[what])
    return matrices, labels


def _codes(labels: np.ndarray) -> np.ndarray:
    directions = labels[:, 1]
    if labels.size and not (directions.min() >= 0 and directions.max() < _MOST_DIRECTIONS):
        raise InputError(
            f"there is no direction number {directions.max()}: columns are node, direction, node, direction"
        )
    return labels[:, 0].astype(np.int64) * _MOST_DIRECTIONS + directions


def _label(code: int) -> Label:
    node, direction = divmod(code, _MOST_DIRECTIONS)
    return node, direction_label(str(direction))


def _text(code: int) -> str:
    node, direction = _label(int(code))
    return f"{node} {direction}"
