"""What a truncated motion neglects: the answer to forces at harmonics that are no unknowns, to first order

x_k = -A(k w0)^-1 B(k w0) f_k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis

if TYPE_CHECKING:
    from suboctave.harmonic.state import BalanceState

__all__ = ["completed_coefficients", "excited"]


def excited(state: BalanceState, k: np.ndarray) -> ComplexArray:
    """The answer at harmonics k > 0 of the base frequency, shape (len(k), size)."""
    size, linear = state.balance.size, state.linear
    force = np.zeros((len(k), size), dtype=complex)
    for group, spectrum, _, _ in state.spectra:
        force += np.multiply.outer(2.0 * spectrum[k], group.direction)
    for nodal in state.nodal:
        force += np.multiply.outer(2.0 * nodal.force[k], nodal.own.out)
    frequency = k / state.basis.nu * state.omega
    compliance = linear.compliance(frequency)
    if compliance is not None:
        force = np.einsum("kij,kj->ki", compliance, force)
    blocks = linear.stiffness(frequency)
    motion = force / blocks[:, :, 0] if size == 1 else np.linalg.solve(blocks, force[:, :, None])[:, :, 0]
    return -motion.astype(complex, copy=False)


def completed_coefficients(state: BalanceState) -> tuple[HarmonicBasis, Array]:
    """The basis of 2 H + 1 harmonics, and the coefficients in it of the motion with what it neglects."""
    high = state.basis.harmonics
    basis = HarmonicBasis(state.balance.top, state.basis.nu)
    x = state.basis.resized(state.x, basis)
    x[2 * high + 1 :: 2] = state.neglected.real
    x[2 * high + 2 :: 2] = -state.neglected.imag
    if state.basis.kept is not None:
        out = state.basis.left_out
        x[2 * out - 1], x[2 * out] = state.left_out.real, -state.left_out.imag
    return basis, x
