"""Coordinates eliminated from a linear part, frequency by frequency.

With Z the dynamic stiffness in coordinates (q, z), which `condensed` explains,

    A = Z_qq - Z_qz Z_zz^-1 Z_zq = [1 -left^T] Z [1; -right],    right = Z_zz^-1 Z_zq,    left^T = Z_qz Z_zz^-1,

and what a change of Z does to A is the same form of that change, as neither side moves it to first order; two changes a
and b add `- (a_qz - left^T a_zz) Z_zz^-1 (b_zq - b_zz right)` and the same with a and b exchanged.

Where Z_zz is a diagonal all this costs nothing. Where damping couples the vibrations z their 2 s complex modes take
their place: with `lambda^2 x + lambda C_zz x + K_zz x = 0`

    Z_zz^-1 = X (i Omega - Lambda)^-1 Y,

X (s, 2 s) and Y (2 s, s), so that `Z_qz X` and `Y Z_zq` couple with coordinates whose Z is the diagonal `i Omega -
Lambda`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.linear_part import factors

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
#: entries of a matrix relative to its diagonal that are rounding
_ROUNDING, _BESIDE = 1e-12, 1e-9
#: condition of complex modes beyond which they cost digits
_PARALLEL = 1e4
#: least frequency that scales a state, relative to the largest
_LEAST = 1e-6
#: equations that are eliminated one by one, before all those behind them follow at once
_BLOCK = 24
#: no derivative by Omega, as a number that kernels are not compiled for once more
_NONE = np.int64(0)


class Stack(NamedTuple):
    """M, C, K, S in the coordinates (q, z) with loads' columns, all entries in a row, (4, .), complex for one kind of
    kernels; how many q, z and columns with those of q; if zz is a diagonal.
    """

    entries: ComplexArray
    sizes: tuple[int, int, int]
    diagonal: bool

    @classmethod
    def of(cls, parts: Sequence[tuple[NDArray[Any], ...]]) -> Stack:
        """From qq, qz, zq, zz of each."""
        diagonal = all(_is_diagonal(part[3]) for part in parts)
        if diagonal:
            parts = [(*part[:3], part[3].diagonal()) for part in parts]
        rows = [np.concatenate([one.ravel() for one in part]) for part in parts]
        return cls(np.array(rows, dtype=complex), (*parts[0][1].shape, parts[0][0].shape[1]), diagonal)

    def between(self, frequency: NDArray[Any], order: int, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        """`[1 -left^T] Z [1; -right]` of the dynamic stiffness Z, differentiated by Omega, at frequencies, (F, m, m +
        l); left (F, s, m), right (F, s, m + l).
        """
        out = np.empty((len(frequency), self.sizes[0], self.sizes[2]), dtype=complex)
        between(self.entries, self.diagonal, frequency.astype(complex), order, left, right, out)
        return out

    def eliminated(self, frequency: NDArray[Any]) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """`Z_zz^-1 Z_zq` (F, s, m + l) at frequencies, the transpose of `Z_qz Z_zz^-1` (F, s, m), and what is left of Z
        at q, (F, m, m + l).
        """
        (m, s, columns), count = self.sizes, len(frequency)
        right, left = np.empty((count, s, columns), dtype=complex), np.empty((count, s, m), dtype=complex)
        out = np.empty((count, m, columns), dtype=complex)
        eliminated(self.entries, self.diagonal, frequency.astype(complex), right, left, out)
        return right, left, out

    def answered(
        self, frequency: NDArray[Any], a: Stack, b: Stack, orders: tuple[int, int], left: ComplexArray,
        right: ComplexArray,
    ) -> ComplexArray:  # fmt: skip
        """What the eliminated coordinates make of two changes of Z, those of a and b, differentiated by Omega:
        `(a_qz - left^T a_zz) Z_zz^-1 (b_zq - b_zz right)`, and the same with a and b exchanged, (F, m, m + l).
        """
        out = np.empty((len(frequency), self.sizes[0], self.sizes[2]), dtype=complex)
        answered(
            self.entries, self.diagonal, frequency.astype(complex), a.entries, a.diagonal, orders[0], b.entries,
            b.diagonal, orders[1], left, right, out,
        )  # fmt: skip
        return out


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _behind(a, b, begin, end, n):
    """The equations behind those from begin to end, n in all, without the unknowns of these, in place: b too."""
    rows, more, columns = n - end, n - end, b.shape[1]
    factors, known = (
        np.empty((rows, end - begin), dtype=a.dtype),
        np.empty((end - begin, more + columns), dtype=a.dtype),
    )
    for k in range(end - begin):
        for i in range(rows):
            factors[i, k] = a[end + i, begin + k]
        for j in range(more):
            known[k, j] = a[begin + k, end + j]
        for j in range(columns):
            known[k, more + j] = b[begin + k, j]
    taken = np.dot(factors, known)
    for i in range(rows):
        for j in range(more):
            a[end + i, end + j] -= taken[i, j]
        for j in range(columns):
            b[end + i, j] -= taken[i, more + j]


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _before(a, b, begin, end):
    """Take what is known of the unknowns from begin to end from the right sides b of those before, in place."""
    columns = b.shape[1]
    factors, known = np.empty((begin, end - begin), dtype=a.dtype), np.empty((end - begin, columns), dtype=a.dtype)
    for k in range(end - begin):
        for i in range(begin):
            factors[i, k] = a[i, begin + k]
        for j in range(columns):
            known[k, j] = b[begin + k, j]
    taken = np.dot(factors, known)
    for i in range(begin):
        for j in range(columns):
            b[i, j] -= taken[i, j]


@kernel(forceinline=True, fastmath=_FAST, error_model="numpy")
def eliminate(a, b, n):
    """Solve `a x = b`, n equations, for the columns of b, in place, by Gauss's elimination with pivots, block by block;
    zeros within a block cost nothing.
    """
    columns, last = b.shape[1], (n - 1) // _BLOCK
    for block in range(last + 1):
        begin, end = block * _BLOCK, min(n, (block + 1) * _BLOCK)
        for k in range(begin, end):
            best = k
            for i in range(k + 1, n):
                if abs(a[i, k]) > abs(a[best, k]):
                    best = i
            if best != k:
                for j in range(begin, n):
                    a[k, j], a[best, j] = a[best, j], a[k, j]
                for j in range(columns):
                    b[k, j], b[best, j] = b[best, j], b[k, j]
            for i in range(k + 1, n):
                if a[i, k] != 0.0:
                    a[i, k] /= a[k, k]
                    for j in range(k + 1, end):
                        a[i, j] -= a[i, k] * a[k, j]
        for i in range(begin, end):
            for k in range(begin, i):
                if a[i, k] != 0.0:
                    for j in range(end, n):
                        a[i, j] -= a[i, k] * a[k, j]
                    for j in range(columns):
                        b[i, j] -= a[i, k] * b[k, j]
        if end < n:
            _behind(a, b, begin, end, n)
    for block in range(last, -1, -1):
        begin, end = block * _BLOCK, min(n, (block + 1) * _BLOCK)
        for i in range(end - 1, begin - 1, -1):
            for k in range(i + 1, end):
                if a[i, k] != 0.0:
                    for j in range(columns):
                        b[i, j] -= a[i, k] * b[k, j]
            for j in range(columns):
                b[i, j] /= a[i, i]
        if begin > 0:
            _before(a, b, begin, end)


@kernel(inner=True, fastmath={"contract"})
def _dynamic(entries, frequency, order, z):
    """All entries of Z, or of its derivative by Omega, into z (.,)."""
    by = factors(frequency, order)
    for i in range(len(z)):
        z[i] = by[0] * entries[0, i] + by[1] * entries[1, i] + by[2] * entries[2, i] + by[3] * entries[3, i]


@kernel(inner=True, fastmath={"contract"})
def _beside(z, diagonal, left, right, across, along):
    """The transpose of `Z_qz - left^T Z_zz` into across (s, m), or nothing if that has no columns, and `Z_zq - Z_zz
    right` into along (s, m + l).
    """
    (s, columns), m = right.shape, left.shape[1]
    coupling = m * columns
    back = coupling + m * s
    inner = back + s * columns
    for k in range(s):
        for j in range(columns):
            along[k, j] = z[back + k * columns + j]
        for i in range(across.shape[1]):
            across[k, i] = z[coupling + i * s + k]
        for l in range(k if diagonal else 0, k + 1 if diagonal else s):
            own, turned = (z[inner + k], z[inner + k]) if diagonal else (z[inner + k * s + l], z[inner + l * s + k])
            for j in range(columns):
                along[k, j] -= own * right[l, j]
            for i in range(across.shape[1]):
                across[k, i] -= turned * left[l, i]


@kernel(fastmath={"contract"})
def between(entries, diagonal, frequency, order, left, right, out):
    """See `Stack.between`."""
    (s, columns), m = right.shape[1:], left.shape[2]
    z, along = np.empty(entries.shape[1], dtype=np.complex128), np.empty((s, columns), dtype=np.complex128)
    across = np.empty((s, 0), dtype=np.complex128)
    for f in range(frequency.shape[0]):
        _dynamic(entries, frequency[f], order, z)
        _beside(z, diagonal, left[f], right[f], across, along)
        for i in range(m):
            for j in range(columns):
                out[f, i, j] = z[i * columns + j]
        for k in range(s):
            for i in range(m):
                for j in range(columns):
                    out[f, i, j] -= z[m * columns + i * s + k] * right[f, k, j] + left[f, k, i] * along[k, j]


@kernel(fastmath={"contract"}, error_model="numpy")
def eliminated(entries, diagonal, frequency, right, left, out):
    """See `Stack.eliminated`."""
    (s, columns), m = right.shape[1:], left.shape[2]
    coupling = m * columns
    back = coupling + m * s
    inner = back + s * columns
    z = np.empty(entries.shape[1], dtype=np.complex128)
    for f in range(frequency.shape[0]):
        _dynamic(entries, frequency[f], _NONE, z)
        if diagonal:
            for k in range(s):
                flexible = 1.0 / z[inner + k]
                for j in range(columns):
                    right[f, k, j] = flexible * z[back + k * columns + j]
                for i in range(m):
                    left[f, k, i] = flexible * z[coupling + i * s + k]
        else:
            for k in range(s):
                for j in range(columns):
                    right[f, k, j] = z[back + k * columns + j]
                for i in range(m):
                    left[f, k, i] = z[coupling + i * s + k]
            eliminate(z[inner:].reshape(s, s).copy(), right[f], s)
            eliminate(z[inner:].reshape(s, s).T.copy(), left[f], s)
        for i in range(m):
            for j in range(columns):
                out[f, i, j] = z[i * columns + j]
            for k in range(s):
                for j in range(columns):
                    out[f, i, j] -= z[coupling + i * s + k] * right[f, k, j]


@kernel(fastmath={"contract"}, error_model="numpy")
def answered(entries, diagonal, frequency, a, a_diagonal, a_order, b, b_diagonal, b_order, left, right, out):
    """See `Stack.answered`."""
    (s, columns), m = right.shape[1:], left.shape[2]
    inner = m * columns + m * s + s * columns
    z, by_a = np.empty(entries.shape[1], dtype=np.complex128), np.empty(a.shape[1], dtype=np.complex128)
    by_b = np.empty(b.shape[1], dtype=np.complex128)
    across, along = np.empty((2, s, m), dtype=np.complex128), np.empty((2, s, columns), dtype=np.complex128)
    for f in range(frequency.shape[0]):
        _dynamic(entries, frequency[f], _NONE, z)
        _dynamic(a, frequency[f], a_order, by_a)
        _dynamic(b, frequency[f], b_order, by_b)
        _beside(by_a, a_diagonal, left[f], right[f], across[0], along[1])
        _beside(by_b, b_diagonal, left[f], right[f], across[1], along[0])
        if diagonal:
            for k in range(s):
                for side in range(2):
                    for j in range(columns):
                        along[side, k, j] /= z[inner + k]
        else:
            for side in range(2):
                eliminate(z[inner:].reshape(s, s).copy(), along[side], s)
        for i in range(m):
            for j in range(columns):
                out[f, i, j] = 0.0
            for side in range(2):
                for k in range(s):
                    for j in range(columns):
                        out[f, i, j] += across[side, k, i] * along[side, k, j]


class ComplexModes(NamedTuple):
    """X (s, 2 s), Y (2 s, s) and Lambda (2 s,) of vibrations, see the module."""

    columns: ComplexArray
    rows: ComplexArray
    exponents: ComplexArray


def complex_modes(damping: Array, stiffness: Array) -> ComplexModes | None:
    """Of vibrations with unit mass; None where damping couples none of them, or two are nearly parallel."""
    s = len(damping)
    if _is_diagonal(damping) and _is_diagonal(stiffness):
        return None
    scale = np.sqrt(np.abs(stiffness.diagonal()))
    scale = np.maximum(scale, _LEAST * scale.max())
    exponents, right = np.linalg.eig(np.block([[np.zeros((s, s)), np.diag(scale)], [-stiffness / scale, -damping]]))
    if not np.linalg.cond(right) < _PARALLEL:
        return None
    columns, rows = right[:s] / scale[:, None], np.linalg.inv(right)[:, s:]
    alike = np.sqrt(np.linalg.norm(columns, axis=0) / np.linalg.norm(rows, axis=1))
    return ComplexModes(columns / alike, alike[:, None] * rows, exponents)


def _is_diagonal(matrix: NDArray[Any]) -> bool:
    size = np.sqrt(np.abs(np.multiply.outer(matrix.diagonal(), matrix.diagonal())))
    beside = np.abs(matrix - np.diag(matrix.diagonal()))
    return bool(np.all(beside <= _BESIDE * np.maximum(size, np.abs(matrix).max() * _ROUNDING)))
