"""One LU factorisation serves a Newton step, the tangent, and the sign of a determinant."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from suboctave.compiled import kernel

Array = NDArray[np.float64]


@lru_cache(maxsize=1)
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


#: limits that hold: BLAS has one for the process, so several threads lift them in the order last in, first out
_limits: list[Any] = []
_changing = threading.Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """One BLAS thread inside: for matrices of some hundred rows more only wait for each other."""
    with _changing:
        _limits.append(_controller().limit(limits=1, user_api="blas").__enter__())
    try:
        yield
    finally:
        with _changing:
            # perhaps another thread's: the one that leaves last restores what the first one met
            _limits.pop().__exit__(None, None, None)


@kernel()
def length(vector):
    """Euclidean norm of all entries of a real array."""
    flat = vector.ravel()
    return math.sqrt(np.dot(flat, flat))


@kernel()
def distance(u, v, weights):
    """`|weights (u - v)|`."""
    way = np.empty(len(u))
    for i in range(len(u)):
        way[i] = weights[i] * (u[i] - v[i])
    return math.sqrt(np.dot(way, way))


# numbers out of range are an exception, not an angle
@kernel(error_model="python")
def cosine(a, b, weights):
    """Cosine of the angle between two vectors in scaled variables; ZeroDivisionError where one has no length."""
    one, other = np.empty(len(a)), np.empty(len(a))
    for i in range(len(a)):
        one[i], other[i] = weights[i] * a[i], weights[i] * b[i]
    return np.dot(one, other) / math.sqrt(np.dot(one, one) * np.dot(other, other))


@kernel(error_model="python")
def course(a, b, way, weights):
    """How a curve runs along a way with the tangents a and b at its ends, in scaled variables: the angle between these,
    radians; its squared sine where they meet beyond the end, -1 elsewhere; the distance between the unit vector along
    the way and the mean of theirs, 0 where the way is none.
    """
    turn = cosine(a, b, weights)
    first, last, chord = np.empty(len(a)), np.empty(len(a)), np.empty(len(a))
    for i in range(len(a)):
        first[i], last[i], chord[i] = weights[i] * a[i], weights[i] * b[i], weights[i] * way[i]
    sizes = math.sqrt(np.dot(first, first)), math.sqrt(np.dot(last, last)), math.sqrt(np.dot(chord, chord))
    apart = 0.0
    for i in range(len(a)):
        first[i], last[i] = first[i] / sizes[0], last[i] / sizes[1]
        if sizes[2] > 0.0:
            apart += (chord[i] / sizes[2] - 0.5 * (first[i] + last[i])) ** 2
    cosine_between = np.dot(first, last)
    overshot = np.dot(chord, last) < cosine_between * np.dot(chord, first)
    beyond = 1.0 - cosine_between**2 if overshot else -1.0
    return math.acos(min(1.0, max(-1.0, turn))), beyond, math.sqrt(apart)


@kernel()
def _sign(lu, pivots):
    """Sign of a determinant, from LU factors that are not singular."""
    sign = 1.0
    for i in range(pivots.shape[0]):
        if (lu[i, i] < 0.0) != (pivots[i] != i):
            sign = -sign
    return sign


@dataclass(eq=False, slots=True)
class Factor:
    """LU factors of a square real or complex matrix (`lapack.?getrf`), or of its transpose: of a real one that lies in
    memory row by row, which LAPACK takes for that.
    """

    lu: NDArray[Any]
    pivots: NDArray[Any]
    singular: bool
    transposed: bool = False

    @classmethod
    def of(cls, matrix: NDArray[Any], overwrite: bool = False) -> Factor:
        """Factorise; an exactly singular matrix is marked, not refused."""
        if matrix.dtype.kind == "c":
            lu, pivots, info = lapack.zgetrf(matrix, overwrite_a=overwrite)
            return cls(lu, pivots, info > 0)
        by_rows = matrix.flags.c_contiguous
        lu, pivots, info = lapack.dgetrf(matrix.T if by_rows else matrix, overwrite_a=overwrite)
        return cls(lu, pivots, info > 0, by_rows)

    def solve(self, rhs: NDArray[Any], adjoint: bool = False) -> NDArray[Any]:
        """Solve with the matrix, or with its conjugate transpose."""
        if self.lu.dtype.kind == "c":
            return lapack.zgetrs(self.lu, self.pivots, rhs, trans=2 if adjoint else 0)[0]
        return lapack.dgetrs(self.lu, self.pivots, rhs, trans=1 if adjoint != self.transposed else 0)[0]

    @property
    def sign(self) -> float:
        """Sign of the determinant of a real matrix; 0 if singular."""
        return 0.0 if self.singular else _sign(self.lu, self.pivots)

    @property
    def log_determinant(self) -> float:
        """Natural logarithm of the determinant's modulus."""
        return -math.inf if self.singular else float(np.add.reduce(np.log(np.abs(self.lu.diagonal()))))


class LeadingBlock:
    """Solves with the leading block of a real matrix from the factors of the whole: `size` rows and columns of it, all
    perhaps.

    With the last columns of the inverse, `[V; C]`, and `z` the solution for a right-hand side filled with zeros, the
    block's is `z - V C^-1 z_last`; its determinant is that of the whole times det C.
    """

    def __init__(self, whole: Factor, size: int) -> None:
        self.whole = whole
        order = len(whole.lu)
        more = order - size
        units = np.zeros((order, more), order="F")
        units[size + np.arange(more), np.arange(more)] = 1.0
        #: the last columns of the inverse: V above, C below
        self.columns = whole.solve(units) if more and not whole.singular else units
        self.size = size
        self.corner = Factor.of(self.columns[size:]) if more else None
        #: sign of the block's determinant, 0 if it is singular, and natural logarithm of the determinant's modulus
        self.sign, self.log_determinant = whole.sign, whole.log_determinant
        if self.corner is not None:
            self.sign *= self.corner.sign
            self.log_determinant += self.corner.log_determinant

    def solve(self, rhs: Array) -> Array:
        """Solve with the block."""
        filled = np.zeros(len(self.whole.lu))
        filled[: self.size] = rhs
        whole = self.whole.solve(filled)
        if self.corner is None:
            return whole
        return whole[: self.size] - self.columns[: self.size] @ self.corner.solve(whole[self.size :])


def bordered(matrix: NDArray[Any], columns: Array, border: NDArray[Any], row: NDArray[Any]) -> Factor:
    """LU factors of `[A C, border; row]`, C the diagonal matrix of `columns`; the border has as many columns (m, k) as
    the matrix lacks.
    """
    m, n = matrix.shape
    out = np.empty((m + 1, n + border.shape[1]), dtype=matrix.dtype)
    np.multiply(matrix, columns, out=out[:m, :n])
    out[:m, n:] = border
    out[m] = row
    return Factor.of(out, overwrite=True)
