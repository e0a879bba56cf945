"""The linearised motion as Fourier series: what Hill's method and the Koopman-Hill projection start from.

    y'' + C(t) y' + K(t) y = 0,    K(t) = K_0 + sum_g k_g(t) l_g r_g^T,    C(t) = C_0 + sum_g c_g(t) l_g r_g^T

in DOFs weighted by the square roots of their masses; one term per direction that elements act along, k_g and c_g the
sums of their tangents f_u and f_v along the motion. Fourier coefficients of tangents are exact to any order.

The motion itself is known up to its neglected harmonics. `refined` adds their first-order answer and what that does to
the harmonics that were solved for: near a limit point, where R_X is nearly singular, that is the larger part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState


@dataclass(frozen=True)
class Variational:
    """The linearised motion.

    damping, stiffness
        C_0, K_0, shape (n, n): those of the structure and the means of the elements' tangents.
    left, right
        l_g, r_g, shape (G, n).
    k, c
        Fourier coefficients q = 0 .. top of k_g, c_g without their means, shape (G, top + 1).
    rate
        Base frequency omega / nu.
    """

    damping: Array
    stiffness: Array
    left: Array
    right: Array
    k: ComplexArray
    c: ComplexArray
    rate: float

    @property
    def n(self) -> int:
        """Number of DOFs of the equation of motion."""
        return self.stiffness.shape[0]

    @property
    def period(self) -> float:
        """Period of the motion."""
        return 2.0 * math.pi / self.rate

    @property
    def decay(self) -> float:
        """Logarithm of the product of all multipliers, `-int trace C dt` (Liouville)."""
        return -float(np.trace(self.damping)) * self.period

    def mean_exponents(self) -> ComplexArray:
        """Characteristic exponents of the mean system `y'' + C_0 y' + K_0 y = 0`, shape (2 n,)."""
        zero, one = np.zeros((self.n, self.n)), np.eye(self.n)
        return np.linalg.eigvals(np.block([[zero, one], [-self.stiffness, -self.damping]])).astype(complex)

    @classmethod
    def of(cls, state: BalanceState, top: int) -> Variational:
        """The motion's linearisation with Fourier coefficients up to `top`."""
        mass, damping, stiffness = state.linear.equation_of_motion()
        weight = np.sqrt(np.diag(mass))
        inverse = np.linalg.inv(mass) * weight[:, None]
        damping, stiffness = inverse @ damping / weight, inverse @ stiffness / weight
        count = sum(channel.count for channel in state.channels)
        left, right = np.zeros((2, count, len(mass)))
        k, c = np.zeros((2, count, top + 1), dtype=complex)
        i = 0
        for channel in state.channels:
            reaching = channel.reaching(top)
            for j, direction in enumerate(channel.ins):
                left[i] = inverse @ state.linear.expand(channel.out)
                right[i] = state.linear.expand(direction) / weight
                k[i] = reaching.stiffness(j)
                if channel.moving:
                    c[i] = reaching.damping(j)
                i += 1
        for i in range(count):
            outer = np.outer(left[i], right[i])
            stiffness, damping = stiffness + k[i, 0].real * outer, damping + c[i, 0].real * outer
        k[:, 0] = c[:, 0] = 0.0
        return cls(damping, stiffness, left, right, k, c, state.rate)


def two_sided(spectrum: ComplexArray, harmonics: int) -> ComplexArray:
    """Toeplitz matrix of a real function between waves k = -harmonics .. harmonics: its Fourier coefficients k - l."""
    index = np.arange(2 * harmonics + 1)
    both = np.concatenate((spectrum[2 * harmonics : 0 : -1].conj(), spectrum[: 2 * harmonics + 1]))
    return both[index[:, None] - index[None, :] + 2 * harmonics]


#: relative size up to which a first-order answer of the solved harmonics is taken at its word
_ANSWER = 1e-3


def refined(state: BalanceState) -> tuple[BalanceState, BalanceState | None]:
    """The motion with 2 H + 1 harmonics, one step closer to the true one, and, if that is in doubt, another it may be.

    The solved harmonics answer to the neglected ones by `-R_X^-1 R`, R the residual that these leave. At a limit point
    that answer means nothing: there the motion moves by about the root of what disturbs it, in the same direction.
    """
    completed = state.completed
    kept = state.x.shape[0]
    balance = state.balance
    residual = completed.residual.reshape(completed.x.shape)[:kept].ravel()
    weight = state.balance.scales()[0]
    lacking = completed.x[kept:]
    size, gap = (float(np.linalg.norm(x * weight)) for x in (state.x, lacking))
    try:
        answer = np.asarray(np.linalg.solve(state.jacobian, -residual), dtype=float)
    except np.linalg.LinAlgError:
        answer = np.asarray(np.linalg.lstsq(state.jacobian, -residual)[0], dtype=float)
    answer = balance.shaped(answer)
    length = float(np.linalg.norm(answer * weight))
    if length <= _ANSWER * size:
        return _moved(completed, answer), None
    return completed, _moved(completed, answer * math.sqrt(max(gap, 1e-14 * size) * size) / length)


def _moved(completed: BalanceState, answer: Array) -> BalanceState:
    x = completed.x.copy()
    x[: len(answer)] += answer
    return BalanceState(completed.balance, completed.linear, x, completed.omega, completed.values)


def liouville(multipliers: ComplexArray, errors: Array, decay: float) -> tuple[Array, float]:
    """Errors enlarged until they cover what Liouville's formula shows to be wrong, and that defect.

    The logarithms of the multipliers add up to `decay`; to first order the relative errors of the multipliers add up to
    the defect, so that estimates whose sum is smaller are too small.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        defect = abs(float(np.log(np.abs(multipliers)).sum()) - decay)
        stated = float((errors / np.abs(multipliers)).sum())
    if not math.isfinite(defect):
        return errors, defect
    return errors * max(1.0, defect / stated if stated > 0.0 else 1.0), defect
