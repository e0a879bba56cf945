"""Is a mass matrix one? Symmetric and positive definite, judged without regard to units."""

from __future__ import annotations

from typing import Any

import numpy as np

from suboctave.errors import InputError

__all__ = ["check_mass"]

_ASYMMETRY = 1e-9  # of sqrt(M_ii M_jj)
_DENSE = 600  # degrees of freedom up to which eigenvalues are cheap


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
    scaled = mass * scale[:, None] * scale if isinstance(mass, np.ndarray) else _scaled_sparse(mass, scale)
    difference = abs(scaled - scaled.T)
    if difference.max() > _ASYMMETRY:
        i, j = _where_largest(difference)
        raise InputError(f"the mass is not symmetric: M[{i}, {j}] = {mass[i, j]:g}, M[{j}, {i}] = {mass[j, i]:g}")
    lowest = _lowest(scaled)
    if lowest < -1e-12:
        raise InputError("the mass is not positive definite: some motion would have negative kinetic energy")
    if lowest < len(diagonal) * np.finfo(float).eps:
        raise InputError("the mass is singular: some motion has no kinetic energy; condense it out of the model")


def _scaled_sparse(mass: Any, scale: Any) -> Any:
    import scipy.sparse

    factor = scipy.sparse.diags_array(scale)
    return (factor @ mass @ factor).tocsr()


def _where_largest(matrix: Any) -> tuple[int, int]:
    if isinstance(matrix, np.ndarray):
        i, j = np.unravel_index(int(np.argmax(matrix)), matrix.shape)
        return int(i), int(j)
    coordinates = matrix.tocoo()
    k = int(np.argmax(coordinates.data))
    return int(coordinates.row[k]), int(coordinates.col[k])


def _lowest(scaled: Any) -> float:
    """The lowest eigenvalue, or for a large matrix the smallest pivot, which has its sign."""
    if scaled.shape[0] <= _DENSE:
        return float(np.linalg.eigvalsh(scaled if isinstance(scaled, np.ndarray) else scaled.toarray())[0])
    import scipy.sparse
    from scipy.sparse.linalg import splu

    if isinstance(scaled, np.ndarray):
        try:
            return float(np.min(np.diag(np.linalg.cholesky(scaled)))) ** 2
        except np.linalg.LinAlgError:
            return float(np.linalg.eigvalsh(scaled)[0])
    try:
        # pivots on the diagonal, as in a Cholesky factorisation: all positive if and only if the matrix is definite
        factors = splu(
            scipy.sparse.csc_matrix(scaled),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        return 0.0
    if np.any(factors.perm_r != factors.perm_c):  # a zero on the diagonal had to be avoided: indefinite
        return -1.0
    return float(factors.U.diagonal().min())
