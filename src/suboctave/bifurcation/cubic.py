"""The cubic coefficient of a period doubling, along curves of them: the number of `normal_form_real`, sooner.

    c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),    J_0 X2 = -R''[phi, phi] / 2.

For laws of displacements alone phi and psi are real functions of time, `psi.R'''` is one sum over the instants at
which f_uuu is known, and `psi.R''[phi, .]` is the gradient that a located point has already. Everything else takes the
general way.
"""

from __future__ import annotations

import numpy as np

from suboctave.bifurcation.normal_form_real import Expansion
from suboctave.continuation.linear import Factor
from suboctave.harmonic import kernels, real_form
from suboctave.harmonic.basis import Array, ComplexArray, spectrum_to_real
from suboctave.harmonic.bends import bends_of
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.third import Multilinear


def cubic_coefficient(state: BalanceState, phi: Array, psi: Array, by_motion: Array, factor: Factor) -> float:
    """c3 of a period doubling.

    Parameters
    ----------
    phi, psi
        Right and left null vectors of J_half, in the coefficients' own units.
    by_motion
        Gradient of `psi.J_half phi` by the motion, shape (2 H + 1, size).
    factor
        Factors of J_0.
    """
    moving = any(e.depends_on_velocity for e in state.balance.elements)
    if state.nodal or moving or state.compliance is not None:
        own = Expansion(state, Kind.HALF, phi, psi, 0.0, 0.0, by_motion, 0.0, Multilinear(state))
        return own.cubic(factor.solve(-0.5 * own.squared()))[0]
    size = state.balance.size
    right, left = (_waves(v.reshape(-1, size)) for v in (phi, psi))
    second = np.zeros_like(state.x)
    third = 0.0
    for bend in bends_of(state):
        along = np.ascontiguousarray(np.stack((right @ bend.out, 2.0 * (left @ bend.out))))
        zr, zi, weights = bend.second
        if len(zr):
            p = _values(along[:1], zr, zi)[0]
            spectrum = kernels.spectra((weights[0, 0] * p * p)[None], zr, zi, state.basis.harmonics)[0]
            second += np.multiply.outer(spectrum_to_real(spectrum[:, None], state.basis.harmonics)[:, 0], bend.out)
        for part in bend.third:
            if not len(part.zr):
                continue
            p, q = _values(along, part.zr, part.zi)
            square = p * p
            total = float((part.weights[0, 0, 0] * square) @ (p * q))
            if part.slopes is not None:
                k = 1j * (np.arange(along.shape[1]) + 0.5)
                dp, dq = _values(np.ascontiguousarray(k * along), part.zr, part.zi)
                total += float((part.slopes[0, 0, 0] * square) @ (3.0 * dp * q + p * dq))
            third += total / (2.0 * np.pi)
    bent = factor.solve(-0.5 * second.ravel())
    return float(by_motion.ravel() @ bent) + third / 6.0


def _waves(vector: Array) -> ComplexArray:
    """Amplitudes of `Re sum_k c_k exp(i (k + 1/2) tau)`, shape (H + 1, size)."""
    waves: ComplexArray = vector[::2] - 1j * vector[1::2]
    return waves


def _values(waves: ComplexArray, zr: Array, zi: Array) -> Array:
    """These functions at instants, up to a sign that all of them share."""
    result: Array = real_form.half_odd_values(waves, zr, zi)
    return result
