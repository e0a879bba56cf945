"""The flow of a piecewise-linear system between its contacts, in closed form.

While contacts stay as they are the scaled field is `z' = A z + sum_k g_k exp(mu_k tau)`, the mu_k being 0 and i times
the harmonics of the loads. With `A = S diag(lambda) S^-1`, `z = S zeta` and `g_k = S G_k`,

    zeta(tau + s) = exp(lambda s) zeta(tau) + sum_k G_k exp(mu_k tau) E_k(s),
    E_k(s) = (exp(mu_k s) - exp(lambda s)) / (mu_k - lambda).

Modes of a structure far above the load's frequency, which would take thousands of steps in one period, cost nothing
then. The derivative w with respect to `omega / W` obeys `w' = A w - c z' + sum_k c_k exp(mu_k tau)`, c = W / omega, and
is closed as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.timedomain.field import Array, Field

__all__ = ["ExactRate", "ExactSolver", "exact_rate"]

ComplexArray = NDArray[np.complex128]

#: error of the diagonal form, relative to the field, from which on it is not used: modes that are nearly the same
_DEFECTIVE = 1e-10
#: longest step, in radians of the load and of the fastest vibration: what happens within is looked at in nine points
_LOAD, _FASTEST = 2.0 * np.pi / 64.0, 8.0
#: product of a difference of exponents and a time below which a quotient is taken by its series
_NEAR = 1e-4


class ExactRate:
    """The rate of `Field.right_hand_side`, contacts frozen, of a state and, with `slope`, its derivative by frequency;
    and its solution.
    """

    def __init__(self, model: Field, active: NDArray[np.bool_], slope: bool) -> None:
        self.rate = model.right_hand_side(active, slope)
        self.model, self.slope = model, slope
        self.values, self.vectors, self.inverse = model.spectrum(active)
        constant, loads = model.constant(active), model.loads
        exponents = 1j * loads.harmonic
        self.exponents = np.concatenate([[0.0], exponents, -exponents])
        turned = np.exp(1j * loads.phase)
        push = self.inverse @ model.push.T

        def factors(amplitude: ComplexArray, still: Array) -> ComplexArray:
            """(2n, K), of complex amplitudes of the loads."""
            waves = push * (0.5 * amplitude)
            mirrored = self.inverse @ (model.push.T * np.conj(0.5 * amplitude))
            return np.concatenate([(self.inverse @ still)[:, None], waves, mirrored], axis=1)

        self.forces = factors(loads.amplitude * turned, constant)
        change = (loads.amplitude_slope + 1j * loads.amplitude * loads.phase_slope) * turned
        self.changes = model.reference * factors(change, np.zeros_like(constant))
        self.longest = min(_LOAD, _FASTEST / max(float(np.abs(self.values.imag).max()), 1e-300))

    def __call__(self, tau: float, y: Array) -> Array:
        return self.rate(tau, y)

    def at(self, begin: float, zeta: ComplexArray, s: Array) -> tuple[Array, Array | None]:
        """States (2n, N) at `begin + s` (N,) from the stacked modes (1 or 2, 2n) there, and their derivatives."""
        lam, s = self.values[:, None], np.atleast_1d(s)
        decay = np.exp(lam * s)
        state = zeta[0][:, None] * decay
        slope = zeta[1][:, None] * decay if self.slope else None
        relative = self.model.reference / self.model.omega
        if slope is not None:
            slope -= relative * lam * s * state
        for k, mu in enumerate(self.exponents):
            x, turn = mu - lam, np.exp(mu * begin)
            near = np.abs(x * s) < _NEAR
            safe = np.where(x == 0.0, 1.0, x)
            first = np.where(
                near, decay * s * (1.0 + 0.5 * x * s + (x * s) ** 2 / 6.0), (np.exp(mu * s) - decay) / safe
            )
            state += (self.forces[:, k] * turn)[:, None] * first
            if slope is not None:
                second = np.where(
                    near, decay * s**2 * (0.5 + x * s / 6.0 + (x * s) ** 2 / 24.0), (first - s * decay) / safe
                )
                slope += ((self.changes[:, k] - relative * self.forces[:, k]) * turn)[:, None] * first
                slope -= relative * lam * (self.forces[:, k] * turn)[:, None] * second
        return (self.vectors @ state).real, None if slope is None else (self.vectors @ slope).real


def exact_rate(model: Field, active: NDArray[np.bool_], slope: bool) -> Any:
    """The rate with its solution where there is one; else the rate alone."""
    if not model.closed:
        return model.right_hand_side(active, slope)
    values, vectors, inverse = model.spectrum(active)
    matrix = model.linear_rate(active)
    error = np.abs((vectors * values) @ inverse - matrix).max()
    if not error <= _DEFECTIVE * np.abs(matrix).max():
        return model.right_hand_side(active, slope)
    return ExactRate(model, active, slope)


class ExactSolver:
    """What `advance` takes of a solver of SciPy, exact: steps are as long as contacts between them can be seen."""

    def __init__(self, rate: ExactRate, begin: float, y: Array, end: float, first: float | None) -> None:
        self.rate, self.begin, self.end = rate, begin, end
        self.t = self.t_old = begin
        self.y = self.y_old = y
        self.status = "running"
        self._next = rate.longest if first is None else first
        m = 2 * rate.model.n
        self._modes = (rate.inverse @ y.reshape(-1, m).T).T

    def step(self) -> None:
        """Go on by a step."""
        self.t_old, self.y_old = self.t, self.y
        self.t = min(self.t + self._next, self.end)
        self._next = self.rate.longest
        state, slope = self.rate.at(self.begin, self._modes, np.array(self.t - self.begin))
        self.y = state[:, 0] if slope is None else np.concatenate([state[:, 0], slope[:, 0]])
        if self.t >= self.end:
            self.status = "finished"

    def dense_output(self) -> Any:
        """The states (2n,) or (2n, N) at any time of the stretch."""
        rate, begin, modes = self.rate, self.begin, self._modes

        def states(t: Any) -> Array:
            found = rate.at(begin, modes, np.asarray(t, dtype=float) - begin)[0]
            return found if np.ndim(t) else found[:, 0]

        return states
