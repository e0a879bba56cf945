"""Structural matrices whose entries may depend on named parameters: `A(p) = A_0 + sum_i c_i(p) A_i`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.model.element import Array
from suboctave.model.expression import Coefficient, coefficient

__all__ = ["MatrixCoefficient", "matrix_coefficient"]


class MatrixCoefficient:
    """An n x n matrix `base + sum_i coefficient_i * pattern_i`. Immutable; made by `matrix_coefficient`.

    `n` its size, `names` the parameters in it, `sparse` whether it was given as a sparse matrix.
    """

    def __init__(self, base: Any, terms: Sequence[tuple[Coefficient, Any]] = (), what: str = "matrix") -> None:
        self._base = base
        self._terms = tuple(terms)
        self.what = what
        self.n = int(base.shape[0])
        self.sparse = not isinstance(base, np.ndarray)
        self.names: frozenset[str] = frozenset().union(*(c.names for c, _ in self._terms))
        self._derivatives: dict[str, MatrixCoefficient | None] = {}
        self._dense = None if self.sparse else (base, [pattern for _, pattern in self._terms])

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The expressions in it."""
        return tuple(c for c, _ in self._terms)

    def value(self, values: Mapping[str, float]) -> Array:
        """The matrix (n, n) at these values of the parameters, as a dense array of its own."""
        if self._dense is None:
            return np.asarray(self.sparse_value(values).toarray(), dtype=float)
        base, patterns = self._dense
        result = base.copy()
        for (c, _), pattern in zip(self._terms, patterns, strict=True):
            result += c.value(values) * pattern
        return result

    def sparse_value(self, values: Mapping[str, float]) -> Any:
        """The matrix at these values of the parameters in SciPy's compressed-row form."""
        import scipy.sparse

        result = scipy.sparse.csr_array(self._base, copy=True)
        for c, pattern in self._terms:
            result = result + c.value(values) * scipy.sparse.csr_array(pattern)
        return result

    def products(self, vector: Array) -> list[tuple[Coefficient, Array]]:
        """Its product with a vector (n,), as pairs of an expression and a vector that add up to it."""
        parts = [(coefficient(1.0), self._base), *self._terms]
        return [(c, np.asarray(pattern @ vector, dtype=float).ravel()) for c, pattern in parts]

    def derivative(self, name: str) -> MatrixCoefficient | None:
        """The derivative by a parameter; None if it is identically zero."""
        if name not in self._derivatives:
            self._derivatives[name] = self._differentiate(name)
        return self._derivatives[name]

    def _differentiate(self, name: str) -> MatrixCoefficient | None:
        slopes = [(c.derivative(name), pattern) for c, pattern in self._terms if name in c.names]
        base = self._base * 0.0
        terms = []
        for slope, pattern in slopes:
            if slope.constant:
                base = base + slope.value({}) * pattern
            else:
                terms.append((slope, pattern))
        if not terms and not abs(base).max():
            return None
        return MatrixCoefficient(base, terms, f"derivative of {self.what} by {name}")

    def __repr__(self) -> str:
        kind = "sparse" if self.sparse else "dense"
        inside = f" in {', '.join(sorted(self.names))}" if self.names else ""
        return f"MatrixCoefficient({self.n} x {self.n}, {kind}{inside})"


def matrix_coefficient(source: Any, n: int | None = None, what: str = "matrix") -> MatrixCoefficient:
    """Read a matrix: a number or an expression (n = 1), nested lists or an array mixing numbers and expressions, a
    sparse matrix, or a mapping `{expression: matrix}` for the sum of expression times matrix.

    `n` is the size it must have, if that is known (the number 0 then stands for a matrix of zeros); `what` names it in
    messages.
    """
    if isinstance(source, MatrixCoefficient):
        result = source
    elif isinstance(source, Mapping):
        result = _from_terms(source, what)
    elif hasattr(source, "tocsr"):
        result = MatrixCoefficient(_constant(source, what), (), what)
    else:
        result = _from_entries(source, n, what)
    if n is not None and result.n != n:
        raise InputError(f"{what} is {result.n} x {result.n}, but the mass has {n} degrees of freedom")
    return result


def _constant(source: Any, what: str) -> Any:
    """A square, finite matrix of numbers as a read-only float array, or in compressed-row form."""
    matrix: Any
    if hasattr(source, "tocsr"):
        import scipy.sparse

        if np.iscomplexobj(source):
            raise InputError(f"{what} has complex entries; an equation of motion in time needs real ones")
        matrix = scipy.sparse.csr_array(source, dtype=float)
        entries = matrix.data
    else:
        try:
            matrix = entries = np.array(source, dtype=float)
        except OverflowError:  # a whole number of hundreds of digits
            raise InputError(f"{what} has entries that are not finite") from None
        matrix.setflags(write=False)
    if len(matrix.shape) != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise InputError(f"{what} must be square, not of shape {tuple(matrix.shape)}")
    if not np.all(np.isfinite(entries)):
        raise InputError(f"{what} has entries that are not finite")
    return matrix


def _from_entries(source: Any, n: int | None, what: str) -> MatrixCoefficient:
    if isinstance(source, str | Coefficient) or np.ndim(_object_array(source, what)) == 0:
        if n is not None and n > 1:
            if not isinstance(source, str | Coefficient) and source == 0:
                return MatrixCoefficient(_constant(np.zeros((n, n)), what), (), what)
            raise InputError(
                f"{what} is a single value ({source}), but the mass has {n} degrees of freedom; give a matrix {n} x {n}"
            )
        source = [[source]]
    array = _object_array(source, what)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.size == 0:
        raise InputError(f"{what} must be square, not of shape {array.shape}")
    if array.dtype != object:
        return MatrixCoefficient(_constant(array, what), (), what)
    base = np.zeros(array.shape)
    patterns: dict[Coefficient, Array] = {}
    for (i, j), entry in np.ndenumerate(array):
        try:
            read = coefficient(entry)
        except InputError as error:
            raise InputError(f"{what}[{i}, {j}]: {error}") from None
        if read.constant:
            base[i, j] = read.value({})
        else:
            patterns.setdefault(read, np.zeros(array.shape))[i, j] = 1.0
    return MatrixCoefficient(_constant(base, what), list(patterns.items()), what)


def _object_array(source: Any, what: str) -> Any:
    if isinstance(source, np.ndarray):
        if source.dtype.kind in "fiu":  # numbers only: no need to look at every entry
            return source
        if source.dtype.kind not in "OU":
            raise InputError(f"{what} must hold numbers or expressions, not {source.dtype}")
        return source.astype(object)
    if not isinstance(source, Sequence) or isinstance(source, str):
        return np.array(source, dtype=object)
    lengths = {len(row) for row in source if isinstance(row, Sequence | np.ndarray) and not isinstance(row, str)}
    if len(lengths) > 1:
        raise InputError(f"{what} has rows of different lengths: {sorted(lengths)}")
    return np.array(source, dtype=object)


def _from_terms(source: Mapping[Any, Any], what: str) -> MatrixCoefficient:
    if not source:
        raise InputError(f"{what} is an empty mapping; give {{expression: matrix}}")
    read = []
    for expression, matrix in source.items():
        try:
            factor = coefficient(expression)
        except InputError as error:
            raise InputError(f"{what}: {error}") from None
        read.append((factor, _constant(matrix, f"{what}[{expression!r}]")))
    shapes = {matrix.shape for _, matrix in read}
    if len(shapes) > 1:
        raise InputError(f"{what}: its matrices have different shapes {sorted(shapes)}")
    base = read[0][1] * 0.0
    for factor, matrix in read:
        if factor.constant:
            base = base + factor.value({}) * matrix
    return MatrixCoefficient(base, [(c, matrix) for c, matrix in read if not c.constant], what)
