"""A sparse matrix with an update of low rank, `A = S + U diag(w) U^T`, U of few columns: what modal damping of a large
structure is. It is never written out, and behaves like a sparse matrix where these are added, scaled and multiplied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Updated:
    """S (n, n), sparse, U (n, k) and w (k,)."""

    sparse: Any
    columns: Array
    weights: NDArray[Any]

    #: NumPy leaves operators to this class
    __array_ufunc__ = None

    def __post_init__(self) -> None:
        if self.sparse.shape != self.shape or self.columns.shape != (len(self.columns), *self.weights.shape):
            parts = self.sparse.shape, self.columns.shape, self.weights.shape
            raise ValueError(f"the shapes of the parts do not fit: {parts}")

    @property
    def shape(self) -> tuple[int, int]:
        """As of an array."""
        return (len(self.columns), len(self.columns))

    @property
    def data(self) -> NDArray[Any]:
        """All its numbers in a row."""
        return np.concatenate((self.sparse.data, self.weights, self.columns.ravel()))

    @property
    def nnz(self) -> int:
        """How many numbers it is kept as."""
        return len(self.data)

    @property
    def T(self) -> Updated:
        """Its transpose."""
        return replace(self, sparse=self.sparse.T)

    def __matmul__(self, other: Any) -> Any:
        return self.sparse @ other + self.columns @ (self.weights * (self.columns.T @ other).T).T

    def __rmatmul__(self, other: Any) -> Any:
        return (self.T @ other.T).T

    def __mul__(self, factor: complex) -> Updated:
        return replace(self, sparse=factor * self.sparse, weights=factor * self.weights)

    __rmul__ = __mul__

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, Updated):
            return replace(self, sparse=self.sparse + other)
        if other.columns is self.columns:
            weights = self.weights + other.weights
            sparse = self.sparse + other.sparse
            return replace(self, sparse=sparse, weights=weights) if weights.any() else sparse
        columns = np.concatenate((self.columns, other.columns), axis=1)
        return Updated(self.sparse + other.sparse, columns, np.concatenate((self.weights, other.weights)))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -1.0 * other

    def __rsub__(self, other: Any) -> Any:
        return -1.0 * self + other

    def diagonal(self) -> NDArray[Any]:
        """Its diagonal (n,)."""
        result: NDArray[Any] = self.sparse.diagonal() + self.columns**2 @ self.weights
        return result

    def toarray(self) -> NDArray[Any]:
        """As a dense array."""
        result: NDArray[Any] = self.sparse.toarray() + (self.columns * self.weights) @ self.columns.T
        return result

    def largest(self) -> float:
        """A bound of its largest entry: entries of U diag(|w|) U^T are no larger than those on the diagonal."""
        return float(abs(self.sparse).max()) + float((self.columns**2 @ np.abs(self.weights)).max())

    def factorised(self, factors: Any) -> Any:
        """What solves its equations; factors: of S, with `solve`."""
        kept = self.weights != 0.0
        if not kept.any():
            return factors
        columns = self.columns[:, kept].astype(np.result_type(self.sparse.dtype, self.weights))
        answers = factors.solve(np.ascontiguousarray(columns))
        inside = np.diag(1.0 / self.weights[kept]) + columns.T @ answers
        return UpdatedFactors(factors, columns, answers, inside)


@dataclass(frozen=True, eq=False)
class UpdatedFactors:
    """Solves equations by Woodbury's formula,

    A^-1 b = x - Y (diag(w)^-1 + U^T Y)^-1 U^T x,    x = S^-1 b,  Y = S^-1 U.
    """

    sparse: Any
    columns: NDArray[Any]
    answers: NDArray[Any]
    inside: NDArray[Any]

    def solve(self, right: NDArray[Any]) -> NDArray[Any]:
        """The solution for columns (n, .)."""
        alone = self.sparse.solve(right)
        result: NDArray[Any] = alone - self.answers @ np.linalg.solve(self.inside, self.columns.T @ alone)
        return result


def largest_entry(matrix: Any) -> float:
    """The largest modulus of the entries of a matrix, dense or sparse, or a bound of it."""
    return matrix.largest() if isinstance(matrix, Updated) else float(abs(matrix).max())


def part_of(matrix: Any, kept: np.ndarray) -> Any:
    """The rows and columns of a sparse matrix, or an updated one, that are kept."""
    if isinstance(matrix, Updated):
        return Updated(part_of(matrix.sparse, kept), matrix.columns[kept], matrix.weights)
    return matrix[kept][:, kept]


def block_diagonal(blocks: Sequence[Any]) -> Any:
    """Matrices one after the other along the diagonal of a sparse one."""
    from scipy.sparse import block_diag

    sparse = block_diag([block.sparse if isinstance(block, Updated) else block for block in blocks], format="csr")
    ends = np.cumsum([0, *(block.shape[0] for block in blocks)])
    updates = [(first, block) for first, block in zip(ends, blocks, strict=False) if isinstance(block, Updated)]
    if not updates:
        return sparse
    columns = np.zeros((int(ends[-1]), sum(len(block.weights) for _, block in updates)))
    at = 0
    for first, block in updates:
        n, k = block.columns.shape
        columns[first : first + n, at : at + k] = block.columns
        at += k
    return Updated(sparse, columns, np.concatenate([block.weights for _, block in updates]))
