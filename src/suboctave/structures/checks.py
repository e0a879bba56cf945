"""What matrices of a structure must be: square, real, finite, of one size; mass and stiffness symmetric.

Symmetry is judged after scaling, `|A_ij - A_ji| / sqrt(s_i s_j)` with the largest entry s_i of row and column i, so
that rotations beside displacements do not matter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suboctave.errors import InputError, shortened
from suboctave.model.elements.base import Array
from suboctave.model.updated import Updated
from suboctave.structures.dof_map import DofMap, shown_dofs

#: largest asymmetry of scaled entries
_ASYMMETRY = 1e-9
#: asymmetry up to which the digits of a file may be the cause, not a wrong entry
_ROUNDED = 1e-4


def square_matrix(given: Any, what: str, n: int | None = None) -> Any:
    """A square, real, finite matrix (n, n), if n is known, in compressed-row form; `what` names it in messages."""
    import scipy.sparse

    if given is None:
        raise InputError(f"the {what} is missing", (what,))
    if isinstance(given, Updated):
        return replace(given, sparse=square_matrix(given.sparse, what, n))
    if not hasattr(given, "tocsr"):
        given = np.asarray(given)
        if given.dtype.kind not in "fiuc" or given.ndim != 2:
            kind = f"of shape {given.shape}" if given.dtype.kind in "fiuc" else shortened(given)
            raise InputError(f"the {what} must be a matrix of numbers, not {kind}", (what,))
    if np.iscomplexobj(given):
        raise InputError(
            f"the {what} is complex: give its real part, and structural (hysteretic) damping, the imaginary part of a "
            "stiffness, as structural=",
            (what,),
        )
    _check_places(given, what)
    matrix = scipy.sparse.csr_array(given, dtype=float, copy=True)
    if matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise InputError(f"the {what} must be square, not {matrix.shape[0]} x {matrix.shape[1]}", (what,))
    if n is not None and matrix.shape[0] != n:
        raise InputError(f"the {what} is {matrix.shape[0]} x {matrix.shape[0]}, the mass {n} x {n}", (what,))
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        place = int(np.flatnonzero(~np.isfinite(matrix.data))[0])
        row = int(np.searchsorted(matrix.indptr, place, side="right")) - 1
        where = f"[{row}, {matrix.indices[place]}]"
        raise InputError(f"the {what} has entries that are not finite: {where} is {matrix.data[place]}", (what,))
    return matrix


def _check_places(given: Any, what: str) -> None:
    """Refuse compressed rows or columns with indices outside of the matrix, which would end the process in SciPy."""
    if hasattr(given, "check_format"):
        try:
            given.check_format(full_check=True)
        except ValueError as error:
            raise InputError(f"the {what} is no sparse matrix: {error}", (what,)) from None


def symmetric_matrix(matrix: Any, what: str, labels: DofMap | None) -> Any:
    """The matrix, exactly symmetric; InputError where it is not symmetric but for rounding."""
    difference = (matrix - matrix.T).tocoo()
    off = np.abs(difference.data)
    if not off.size or not off.max():
        return matrix
    scale = _scale(matrix)
    i, j = difference.coords
    relative = off / np.sqrt(scale[i]) / np.sqrt(scale[j])
    worst = int(np.argmax(relative))
    if relative[worst] > _ASYMMETRY:
        row, column = sorted((int(i[worst]), int(j[worst])))
        names = f" (DOFs {shown_dofs((row, column), labels)})" if labels is not None else ""
        apart = abs(float(matrix[row, column] - matrix[column, row]))
        raise InputError(
            f"the {what} is not symmetric: [{row}, {column}] is {matrix[row, column]:g}, [{column}, {row}] is "
            f"{matrix[column, row]:g}{names}, {apart:.3g} apart; {_rounding(relative[worst]) or _half(matrix)}",
            (what,),
        )
    return ((matrix + matrix.T) * 0.5).tocsr()


def _rounding(relative: float) -> str:
    """What to do about a small asymmetry, relative to the largest entries of row and column."""
    if relative > _ROUNDED:
        return ""
    return (
        f"that is {relative:.0e} of the largest entries there: if it comes of writing few digits, give the symmetric "
        "part, 0.5 * (A + A.T)"
    )


def _half(matrix: Any) -> str:
    """Whether only one half of a symmetric matrix is there, and what to do."""
    i, j = matrix.tocoo().coords
    off = (i != j) & (matrix.tocoo().data != 0)
    lower, upper = bool(np.any((i > j) & off)), bool(np.any((i < j) & off))
    if lower and upper:
        return "the file or its parts may have been put together wrongly"
    half = "lower" if lower else "upper"
    return (
        f"only the {half} triangle has entries: one half of a symmetric matrix was read as all of it. The whole is "
        "A + A.T - diag(A)"
    )


def _scale(matrix: Any) -> Array:
    """The largest entry of each row and column."""
    rows = np.asarray(abs(matrix).max(axis=1).toarray()).ravel()
    columns = np.asarray(abs(matrix).max(axis=0).toarray()).ravel()
    return np.maximum(np.maximum(rows, columns), np.finfo(float).tiny)


def inertia_checked(mass: Any, labels: DofMap | None) -> Any:
    """The mass; InputError where a degree of freedom has less than no inertia, or none has any."""
    diagonal = mass.diagonal()
    negative = np.flatnonzero(diagonal < 0.0)
    if negative.size:
        where = shown_dofs(negative.tolist(), labels)
        raise InputError(f"the mass is not positive definite: its diagonal is negative at the DOFs {where}", ("mass",))
    if not np.any(diagonal > 0.0):
        raise InputError("the mass is zero: no DOF has inertia", ("mass",))
    return mass
