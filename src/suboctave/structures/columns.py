"""Sparse matrices from runs of values down their columns, as Nastran writes them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.contents import Unreadable

#: forms of matrices by their numbers in Nastran: one whose entries beyond the diagonal are those before it
SYMMETRIC = 6


@dataclass
class Columns:
    """A matrix in the making.

    name, rows, columns, form, type
        Of its header. Types are 1 and 2, real of single and double precision, 3 and 4, complex.
    file
        Where it stands, for messages.
    """

    name: str
    rows: int
    columns: int
    form: int
    type: int
    file: str
    _runs: list[tuple[int, int, np.ndarray]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not (self.rows > 0 and self.columns > 0 and self.type in (1, 2, 3, 4)):
            raise InputError(
                f"{self.file}: {self.name or 'a matrix'} is said to have {self.rows} rows and {self.columns} columns "
                f"of type {self.type}; types are 1 to 4"
            )

    def add(self, row: int, column: int, values: np.ndarray) -> None:
        """Values down a column, from a row on; both are counted from 1."""
        if self.type > 2:
            if len(values) % 2:
                raise InputError(f"{self.file}: half a complex number in column {column} of {self.name}")
            values = values[::2] + 1j * values[1::2]
        if not (1 <= column <= self.columns and row >= 1 and row - 1 + len(values) <= self.rows):
            raise InputError(
                f"{self.file}: {len(values)} values from row {row} of column {column} on, beyond the {self.rows} rows "
                f"and {self.columns} columns of {self.name}"
            )
        self._runs.append((row, column, values))

    def matrix(self) -> Any:
        """The matrix; a triangle is made whole where the form is symmetric."""
        import scipy.sparse

        rows = [np.arange(row - 1, row - 1 + len(values)) for row, _, values in self._runs]
        columns = [np.full(len(values), column - 1) for _, column, values in self._runs]
        values = [values for _, _, values in self._runs]
        kind = float if self.type < 3 else complex
        matrix = scipy.sparse.csr_array(
            (_joined(values, kind), (_joined(rows, int), _joined(columns, int))), shape=(self.rows, self.columns)
        )
        matrix.eliminate_zeros()
        if self.form == SYMMETRIC and self.rows == self.columns:
            lower, upper = scipy.sparse.tril(matrix, -1), scipy.sparse.triu(matrix, 1)
            if bool(lower.nnz) != bool(upper.nnz):
                return (matrix + (lower + upper).T).tocsr()
        return matrix


def by_name(found: Iterable[Columns], file: str) -> dict[str, Any]:
    """The matrices by their names; one that occurs twice is none."""
    matrices: dict[str, Any] = {}
    for one in found:
        twice = one.name in matrices
        matrices[one.name] = Unreadable(f"{file} holds {one.name} twice") if twice else one.matrix()
    return matrices


def _joined(parts: list[np.ndarray], kind: type) -> np.ndarray:
    return np.concatenate(parts).astype(kind) if parts else np.zeros(0, dtype=kind)
