"""The published period-doubling system as printed (Alcorta et al., Nonlinear Dynamics 98, 2019, Eq. 18 and 20).

It cannot be solved by Newton's method, which is what these functions show: see `suboctave.curves.events.alcorta`.
"""

from __future__ import annotations

import numpy as np

from suboctave.bifurcation.bordered import null_vectors
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.derivatives import Direction
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator, operator_along


def published_vector(state: BalanceState) -> tuple[ComplexArray, Array, float]:
    """phi = phi_R + i phi_I in the basis of the motion, (dimension,), and q, b of its normalisation `q . phi = i b`."""
    size, scale = state.balance.size, state.balance.scales[1]
    waves = null_vectors(state, Kind.FREE, 0.5 * state.rate).right.reshape(-1, size)
    phi = _to_basis(waves * scale).ravel()
    # turned such that phi_R and phi_I are orthogonal, phi_I the longer: q along it leaves room for the phase
    square = complex((phi**2).sum())
    phi = phi * (np.sqrt(-abs(square) / square) if square != 0.0 else 1.0)
    b = float(np.linalg.norm(phi.imag))
    return phi, phi.imag / b, b


def published_operator(state: BalanceState) -> ComplexArray:
    """N in sines and cosines, complex, (dimension, dimension)."""
    size, rows = state.balance.size, state.basis.size
    blocks = operator(state, Kind.FREE, 0.5 * state.rate).reshape(rows, size, rows, size)
    columns = np.moveaxis(_functional(np.moveaxis(blocks, 2, 0), column=True), 0, 2)
    matrix: ComplexArray = _to_basis(columns).reshape(rows * size, rows * size)
    return matrix


def equations(state: BalanceState, phi: ComplexArray, q: Array, b: float) -> Array:
    """Eq. 18: `[R; Re N phi; Im N phi; q . phi_I - b]`, (3 dimension + 1,)."""
    value = published_operator(state) @ phi
    return np.concatenate((state.residual, value.real, value.imag, [float(q @ phi.imag) - b]))


def jacobian(state: BalanceState, phi: ComplexArray, q: Array, name: str = "omega") -> Array:
    """Eq. 20: derivatives of `equations` by (X, phi_R, phi_I, omega or a parameter), square of 3 dimension + 1 rows.

    Singular at a solution, to the accuracy that the harmonics allow.
    """
    n, size, nu = state.balance.dimension, state.balance.size, state.basis.nu
    matrix = published_operator(state)
    units = np.eye(n).reshape(n, state.basis.size, size)
    directions = [Direction(unit) for unit in units] + [Direction(np.zeros_like(state.x), {name: 1.0})]
    shifts = [0.5 * a.omega / nu for a in directions]
    waves = _to_waves(phi.reshape(-1, size)).ravel()
    changes = operator_along(state, Kind.FREE, waves, directions, 0.5 * state.rate, shifts)
    by = _to_basis(changes.reshape(-1, size, n + 1)).reshape(n, n + 1)
    out = np.zeros((3 * n + 1, 3 * n + 1))
    out[:n, :n], out[:n, -1] = state.jacobian, state.residual_by(name)
    out[n : 2 * n, :n], out[2 * n : 3 * n, :n] = by[:, :n].real, by[:, :n].imag
    out[n : 2 * n, -1], out[2 * n : 3 * n, -1] = by[:, n].real, by[:, n].imag
    out[n : 3 * n, n : 3 * n] = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
    out[-1, 2 * n : 3 * n] = q
    return out


def _to_basis(waves: np.ndarray) -> ComplexArray:
    """Amplitudes of waves k = -H .. H (2 H + 1, ...) as complex coefficients of 1, cos, sin, ..."""
    high = len(waves) // 2
    ahead, back = waves[high + 1 :], waves[high - 1 :: -1] if high else waves[:0]
    out = np.empty(waves.shape, dtype=complex)
    out[0], out[1::2], out[2::2] = waves[high], ahead + back, 1j * (ahead - back)
    return out


def _to_waves(coefficients: np.ndarray) -> ComplexArray:
    """The inverse of `_to_basis`."""
    high = len(coefficients) // 2
    out = np.empty(coefficients.shape, dtype=complex)
    a, b = coefficients[1::2], coefficients[2::2]
    out[high] = coefficients[0]
    out[high + 1 :], out[high - 1 :: -1] = 0.5 * (a - 1j * b), 0.5 * (a + 1j * b)
    return out


def _functional(rows: np.ndarray, column: bool = False) -> ComplexArray:
    """A linear form of coefficients, first axis, as one of waves; `column`: of waves as one of coefficients."""
    high = len(rows) // 2
    out = np.empty(rows.shape, dtype=complex)
    if column:
        ahead, back = rows[high + 1 :], rows[high - 1 :: -1]
        out[0], out[1::2], out[2::2] = rows[high], 0.5 * (ahead + back), 0.5j * (back - ahead)
        return out
    out[high] = rows[0]
    out[high + 1 :], out[high - 1 :: -1] = rows[1::2] + 1j * rows[2::2], rows[1::2] - 1j * rows[2::2]
    return out
