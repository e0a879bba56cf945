"""Structural matrices whose entries may depend on named parameters, `A(p) = A_0 + sum_i c_i(p) A_i`, and their checks.

A mass is symmetric and positive definite. The power that a damping `C` takes from a motion is `v . C v`, which its
symmetric part alone decides; a wrong sign, or self-excitation that is meant, is warned of when a system is made. Both
are judged after scaling by the diagonal of the mass, `A_ij / sqrt(M_ii M_jj)`, so that units do not matter.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from suboctave.errors import InputError, NegativeDampingWarning, located
from suboctave.lazy import lazy
from suboctave.model.elements.base import Array
from suboctave.model.expressions.coefficients import Coefficient, coefficient
from suboctave.model.modes import Modes
from suboctave.model.updated import Updated, largest_entry

#: largest asymmetry of a mass, in units of sqrt(M_ii M_jj)
_ASYMMETRY = 1e-9
#: degrees of freedom up to which eigenvalues are cheap; beyond, pivots and diagonals are taken
_DENSE = 600
#: and up to which a sparse matrix is written out
_MOST_DENSE = 12000
#: share of the largest eigenvalue of a damping below which a negative one is rounding
_ROUNDING = 1e-9


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

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The expressions in it."""
        return tuple(c for c, _ in self._terms)

    def value(self, values: Mapping[str, float]) -> Array:
        """The matrix (n, n) at these values of the parameters, as a dense array of its own."""
        if self.sparse:
            if self.n > _MOST_DENSE:
                raise InputError(
                    f"{self.what} as a dense array of {self.n} degrees of freedom takes {8e-9 * self.n**2:.0f} GB: a "
                    "system where forces act on few degrees of freedom is projected by itself, one where they act on "
                    "all cannot be this large"
                )
            return np.asarray(self.sparse_value(values).toarray(), dtype=float)
        result: Array = self._base.copy()
        for c, pattern in self._terms:
            result += c.value(values) * pattern
        return result

    def sparse_value(self, values: Mapping[str, float]) -> Any:
        """The matrix at these values of the parameters in SciPy's compressed-row form, or `Updated`."""
        result = _in_rows(self._base)
        for c, pattern in self._terms:
            result = result + c.value(values) * _in_rows(pattern)
        return result

    def compact(self, values: Mapping[str, float]) -> Any:
        """The matrix at these values as it was given, dense or sparse."""
        return self.sparse_value(values) if self.sparse else self.value(values)

    def projected(self, shapes: Array) -> MatrixCoefficient:
        """`shapes^T A shapes` for the columns of shapes (n, r), an r x r matrix in the same parameters."""
        base, *patterns = (
            np.ascontiguousarray(shapes.T @ np.asarray(part @ shapes)) for part in (self._base, *self._patterns)
        )
        return MatrixCoefficient(base, list(zip(self.coefficients, patterns, strict=True)), self.what)

    def zeros(self, what: str) -> MatrixCoefficient:
        """A matrix of zeros of this size, dense or sparse as this one."""
        import scipy.sparse

        return MatrixCoefficient(
            scipy.sparse.csr_array((self.n, self.n)) if self.sparse else 0.0 * self._base, (), what
        )

    def plus(self, matrix: Array) -> MatrixCoefficient:
        """The sum with a matrix of numbers (n, n)."""
        import scipy.sparse

        more = scipy.sparse.csr_array(matrix) if self.sparse else matrix
        return MatrixCoefficient(self._base + more, self._terms, self.what)

    def less(self, factor: str, other: MatrixCoefficient) -> MatrixCoefficient:
        """The difference from another matrix times an expression."""
        import scipy.sparse

        def like(pattern: Any) -> Any:
            if self.sparse:
                return scipy.sparse.csr_array(pattern)
            return pattern.toarray() if other.sparse else pattern

        terms = [(coefficient(f"-({factor})"), like(other._base))]
        terms += [(coefficient(f"-({factor})*({c.text})"), like(pattern)) for c, pattern in other._terms]
        return MatrixCoefficient(self._base, (*self._terms, *terms), self.what)

    @lazy
    def zero(self) -> bool:
        """Whether it is zero at any values of the parameters."""
        return not self._terms and not largest_entry(self._base)

    @property
    def _patterns(self) -> tuple[Any, ...]:
        return tuple(pattern for _, pattern in self._terms)

    def products(self, vector: Array) -> list[tuple[Coefficient, Array]]:
        """Its product with a vector (n,), as pairs of an expression and a vector that add up to it."""
        parts = [(coefficient(1.0), self._base), *self._terms]
        return [(c, np.asarray(pattern @ vector, dtype=float).ravel()) for c, pattern in parts]

    def derivative(self, name: str) -> MatrixCoefficient | None:
        """The derivative by a parameter; None if it is identically zero."""
        if name not in self._derivatives:
            slopes = [(c.derivative(name), pattern) for c, pattern in self._terms if name in c.names]
            slope = _added(self._base, slopes, f"derivative of {self.what} by {name}")
            self._derivatives[name] = slope if slope.coefficients or largest_entry(slope._base) else None
        return self._derivatives[name]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        if self.names:
            raise InputError(
                f"{self.what} depends on {', '.join(sorted(self.names))}: system.matrices() has its numbers at the "
                "system's parameters"
            )
        if copy is False:
            raise ValueError(f"{self.what} is made anew as an array: leave copy out")
        return self.value({}).astype(dtype or float)

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
    elif hasattr(source, "tocsr") or isinstance(source, Updated):
        result = MatrixCoefficient(_constant(source, what), (), what)
    else:
        result = _from_entries(source, n, what)
    if n is not None and result.n != n:
        raise InputError(f"{what} is {result.n} x {result.n}, but the mass has {n} degrees of freedom")
    return result


def _constant(source: Any, what: str) -> Any:
    """A square, finite matrix of numbers as a read-only float array, in compressed-row form, or `Updated`."""
    matrix: Any
    if isinstance(source, Updated):
        matrix, entries = source, source.data
    elif hasattr(source, "tocsr"):
        import scipy.sparse

        if np.iscomplexobj(source):
            raise InputError(f"{what} has complex entries: give the imaginary part of a stiffness as structural=")
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


def _in_rows(matrix: Any) -> Any:
    """A matrix of its own in compressed-row form, or `Updated`."""
    import scipy.sparse

    return matrix if isinstance(matrix, Updated) else scipy.sparse.csr_array(matrix, copy=True)


def _from_entries(source: Any, n: int | None, what: str) -> MatrixCoefficient:
    numbers = isinstance(source, np.ndarray) and source.dtype.kind not in "OU"
    if numbers and source.dtype.kind not in "fiu":
        raise InputError(f"{what} must hold numbers or expressions, not {source.dtype}")
    if isinstance(source, Sequence) and not isinstance(source, str):
        lengths = {len(row) for row in source if isinstance(row, Sequence | np.ndarray) and not isinstance(row, str)}
        if len(lengths) > 1:
            raise InputError(f"{what} has rows of different lengths: {sorted(lengths)}")
    array = source if numbers else np.array(source, dtype=object)
    if array.ndim == 0 and (n or 1) > 1:
        if array.item() != 0:
            raise InputError(
                f"{what} is a single value ({source}), but the mass has {n} degrees of freedom; give a matrix {n} x {n}"
            )
        array = np.zeros((n or 1, n or 1))
    array = array.reshape(1, 1) if array.ndim == 0 else array
    if array.dtype != object:
        return MatrixCoefficient(_constant(array, what), (), what)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.size == 0:
        raise InputError(f"{what} must be square, not of shape {array.shape}")
    base = np.zeros(array.shape)
    patterns: dict[Coefficient, Array] = {}
    for (i, j), entry in np.ndenumerate(array):
        with located(owner=f"{what}[{i}, {j}]"):
            read = coefficient(entry)
        if read.constant:
            base[i, j] = read.value({})
        else:
            patterns.setdefault(read, np.zeros(array.shape))[i, j] = 1.0
    return MatrixCoefficient(_constant(base, what), list(patterns.items()), what)


def _from_terms(source: Mapping[Any, Any], what: str) -> MatrixCoefficient:
    if not source:
        raise InputError(f"{what} is an empty mapping; give {{expression: matrix}}")
    read = []
    for expression, matrix in source.items():
        with located(owner=what):
            factor = coefficient(expression)
        read.append((factor, _constant(matrix, f"{what}[{expression!r}]")))
    shapes = {matrix.shape for _, matrix in read}
    if len(shapes) > 1:
        raise InputError(f"{what}: its matrices have different shapes {sorted(shapes)}")
    return _added(read[0][1], read, what)


def _added(like: Any, terms: Sequence[tuple[Coefficient, Any]], what: str) -> MatrixCoefficient:
    """The sum of terms of matrices like this one; those with constant factors are one matrix."""
    base = like * 0.0
    for factor, matrix in terms:
        if factor.constant:
            base = base + factor.value({}) * matrix
    return MatrixCoefficient(base, [(c, matrix) for c, matrix in terms if not c.constant], what)


def viscous_damping(mass: Array, structural: Array, modes: Modes) -> Array:
    """The viscous damping that stands in for a structural one S, all (n, n):

        C = M Phi diag(w)^-1/2 (Phi^T S Phi) diag(w)^-1/2 Phi^T M,        K Phi = M Phi diag(w^2),  Phi^T M Phi = 1.

    It takes from every mode at its own frequency w what S takes, and nothing from rigid-body modes.
    """
    vibrating = ~modes.rigid & (modes.squares > 0.0)
    weight = np.where(vibrating, np.where(vibrating, modes.squares, 1.0) ** -0.25, 0.0)
    momenta = mass @ modes.shapes
    inside = weight[:, None] * (modes.shapes.T @ structural @ modes.shapes) * weight
    result: Array = momenta @ inside @ momenta.T
    return result


# ------------------------------------------------------------------------------------------------------------ checks
def check_mass(mass: Any) -> None:
    """Refuse a mass (n, n), dense or sparse, that is asymmetric, singular or indefinite.

    The message names the degree of freedom at fault if one is. The matrix is judged after scaling its diagonal to one,
    so that degrees of freedom in other units do not matter.
    """
    diagonal = np.asarray(mass.diagonal(), dtype=float)
    bad = np.flatnonzero(~(diagonal > 0.0))
    if bad.size:
        i = int(bad[0])
        kind = "singular" if diagonal[i] == 0.0 else "not positive definite"
        raise InputError(
            f"the mass is {kind}: its diagonal entry at dof {i} is {diagonal[i]:g}; every degree of freedom needs "
            f"inertia (condense one without out of the model)"
        )
    scale = 1.0 / np.sqrt(diagonal)
    if not isinstance(mass, np.ndarray) and len(diagonal) <= _DENSE:
        mass = mass.toarray()
    if isinstance(mass, np.ndarray):
        scaled = mass * scale[:, None] * scale
    else:
        import scipy.sparse

        factor = scipy.sparse.diags_array(scale)
        scaled = (factor @ mass @ factor).tocsr()
    difference = abs(scaled - scaled.T)
    if difference.max() > _ASYMMETRY:
        i, j = divmod(int(difference.argmax()), len(diagonal))
        raise InputError(f"the mass is not symmetric: M[{i}, {j}] = {mass[i, j]:g}, M[{j}, {i}] = {mass[j, i]:g}")
    lowest = _lowest(scaled)
    if lowest < -1e-12:
        raise InputError("the mass is not positive definite: some motion would have negative kinetic energy")
    if lowest < len(diagonal) * np.finfo(float).eps:
        raise InputError("the mass is singular: some motion has no kinetic energy; condense it out of the model")


def _lowest(scaled: Any) -> float:
    """The lowest eigenvalue, or for a large matrix the smallest pivot, which has its sign."""
    if scaled.shape[0] <= _DENSE:
        return float(np.linalg.eigvalsh(scaled)[0])
    if isinstance(scaled, np.ndarray):
        try:
            return float(np.min(np.diag(np.linalg.cholesky(scaled)))) ** 2
        except np.linalg.LinAlgError:
            return float(np.linalg.eigvalsh(scaled)[0])
    try:
        # as in a Cholesky factorisation: all positive if and only if the matrix is definite
        factors = sparse_factors(scaled)
    except RuntimeError:  # exactly singular
        return 0.0
    if np.any(factors.perm_r != factors.perm_c):  # a zero on the diagonal had to be avoided: indefinite
        return -1.0
    return float(factors.U.diagonal().min())


def sparse_factors(matrix: Any) -> Any:
    """SuperLU factors of a sparse matrix, real or complex, with its pivots on the diagonal, which keeps them sparse.

    Raises `RuntimeError` if the matrix is exactly singular.
    """
    import scipy.sparse
    from scipy.sparse.linalg import splu

    columns = scipy.sparse.csc_matrix(matrix)
    return splu(columns, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def check_damping(matrix: MatrixCoefficient, values: Mapping[str, float], mass_diagonal: Any) -> None:
    """Warn (`NegativeDampingWarning`) of a damping that feeds energy into some motion."""
    damping = matrix.compact(values)
    scale = 1.0 / np.sqrt(np.asarray(mass_diagonal, dtype=float))
    if damping.shape[0] > _DENSE:
        rates = np.asarray(damping.diagonal(), dtype=float) * scale**2
    else:
        dense = damping if isinstance(damping, np.ndarray) else damping.toarray()
        with np.errstate(over="ignore", invalid="ignore"):
            scaled = 0.5 * (dense + dense.T) * scale[:, None] * scale
        rates = np.linalg.eigvalsh(scaled) if np.isfinite(scaled).all() else np.zeros(1)
    if rates.min() < -_ROUNDING * np.abs(rates).max():
        warn_of_negative(f"the {matrix.what} matrix feeds energy into some motions")


def warn_of_negative(what: str) -> None:
    """Say that something is damped negatively, and how to say that it is meant."""
    warnings.warn(
        f"{what}: they grow until another force limits them. If this self-excitation is meant, silence the warning "
        "with warnings.simplefilter('ignore', suboctave.NegativeDampingWarning); else change the sign",
        NegativeDampingWarning,
        stacklevel=_outside(),
    )


def _outside() -> int:
    """The stack level of the line outside the package that made the system, for a warning of the caller."""
    level, frame = 2, sys._getframe(2)
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).startswith("suboctave."):
        level, frame = level + 1, frame.f_back
    return level
