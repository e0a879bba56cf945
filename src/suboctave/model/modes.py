"""Undamped modes, `K phi = omega^2 M phi`, and which of them are rigid-body motions.

A rigid-body motion lies in the null space of K. As the entries of K are known to rounding, its stiffness

    phi^T K phi = sum_ij phi_i K_ij phi_j

is rounding of the terms of this sum, `phi^T |K| phi`. The lowest mode of a beam of 1000 elements has 1e3 times as much,
and a mode of a chain whose other springs are 1e10 times as stiff 1e5 times: how far other modes lie does not matter.

An eigensolver for dense matrices gives all squares with an error of the rounding of the highest. Modes far below it
are therefore computed again among themselves, where the highest is one of them (Rayleigh and Ritz).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]

#: stiffness of a mode, as a share of the terms that it is the sum of, up to which it is rounding: 45 units of the last
#: digit of these
ROUNDING = 1e-14
#: share of the highest square below which squares are computed again: above it nine digits are right
_RESOLVED = 1e-6


class Modes(NamedTuple):
    """All modes of a structure in ascending order.

    squares
        Squares of circular frequencies (N,), negative where the structure is unstable.
    shapes
        Columns (N, N) of unit modal mass.
    rigid
        Which are rigid-body motions, (N,).
    """

    squares: Array
    shapes: Array
    rigid: NDArray[np.bool_]


def modes_of(mass: Array, stiffness: Array, terms: Array | None = None) -> Modes:
    """The modes of a mass, positive definite, and a stiffness, (N, N) each, or of their symmetric parts.

    terms
        Where the coordinates are those of a projection onto vectors v: `v^T |K| v` of each, (N,), with the stiffness K
        before it.
    """
    mass, stiffness = 0.5 * (mass + mass.T), 0.5 * (stiffness + stiffness.T)
    squares, shapes = _resolved(stiffness, *eigh(stiffness, mass))
    order = np.argsort(squares, kind="stable")
    squares, shapes = squares[order], shapes[:, order]
    sums = terms_of(shapes, stiffness) if terms is None else (np.abs(shapes.T) @ np.sqrt(terms)) ** 2
    return Modes(squares, shapes, is_rigid(squares, sums))


def terms_of(shapes: Array, stiffness: Any) -> Array:
    """`phi^T |K| phi` of shapes (N, r), (r,): the terms whose sum is their stiffness."""
    sizes = np.abs(shapes)
    result: Array = np.einsum("ij,ij->j", sizes, abs(stiffness) @ sizes)
    return result


def is_rigid(squares: Array, terms: Array) -> NDArray[np.bool_]:
    """Which modes of unit modal mass are rigid-body motions, from the squares of their frequencies and `terms_of`."""
    return np.abs(squares) <= ROUNDING * terms


def _resolved(stiffness: Array, squares: Array, shapes: Array) -> tuple[Array, Array]:
    """Squares and shapes, those far below the highest from the stiffness among themselves."""
    low = np.abs(squares) < _RESOLVED * np.abs(squares).max()
    if low.any():
        among = shapes[:, low]
        inner, turn = eigh(among.T @ (stiffness @ among))
        squares, shapes = squares.copy(), shapes.copy()
        squares[low], shapes[:, low] = _resolved(stiffness, inner, among @ turn)
    return squares, shapes
