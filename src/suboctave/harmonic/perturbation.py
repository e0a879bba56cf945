"""The operator behind every bifurcation: J_kappa, a motion's equations for perturbations at frequencies `k w0 + kappa`.

    J_kappa[k, m] = A(k w0 + kappa) delta_km + B(k w0 + kappa) [ fx_{k-m} + i (m w0 + kappa) fv_{k-m} ],    w0 = omega
    / nu.

Its singularity at kappa = 0 is a limit or branch point, at kappa = w0 / 2 a period doubling, at any other kappa a
Neimark-Sacker point. For the first two the set of frequencies is closed under conjugation: the matrices are real
(`BalanceState.jacobian` and `BalanceState.half_jacobian`); otherwise complex, harmonics k = -H .. H.

`bilinear_gradient` gives the derivative of `left^H J_kappa right` by the motion, omega, parameters and kappa with one
pass over the sampling nodes: the adjoint gradient that bordered bifurcation systems need, without forming `(J
right)_X`. `operator_along` is the reverse: a few directions against all left vectors,

    (J_kappa v)' = A' v + B' [f_x v + f_v v'] + B [sum_rs f_rs q_r p_s + f_v (i Omega)' v],

with q the change of what a law reads along the direction, p = (v, i Omega v) the perturbation of it, Omega = f w0 +
kappa its frequencies, as extended systems with the null vector among their unknowns need it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.aft.channel import Channel
from suboctave.harmonic.assembly import apply_blocks, toeplitz
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.derivatives import Direction, change_at, second_derivative
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.trigonometric import motion, pulled, spectra, wave_sums
from suboctave.harmonic.waves import Frequencies, Kind, Waves, as_waves, fourier

__all__ = ["Gradient", "Kind", "bilinear_gradient", "operator", "operator_along", "parameter_gradient"]


@dataclass(frozen=True)
class Gradient:
    """Derivative of `left^H J_kappa right` by the coefficients (2 H + 1, size), by names, and by kappa; complex for
    Kind.FREE.
    """

    x: np.ndarray
    rates: dict[str, complex]
    kappa: complex


def operator(state: BalanceState, kind: Kind, kappa: complex = 0.0) -> np.ndarray:
    """J_kappa: real of size n (2 H + 1) or n (2 H + 2), complex of size n (2 H + 1) for Kind.FREE (kappa in rad per
    time; complex for perturbations that grow like `exp(i kappa t)`).
    """
    if kind is Kind.INTEGER:
        return state.jacobian
    if kind is Kind.HALF:
        return state.half_jacobian
    return operator_at(state, Frequencies.of(state, kind, kappa).values[None] * state.rate)[0]


def operator_at(state: BalanceState, frequency: NDArray[Any], order: int = 0) -> ComplexArray:
    """J_kappa between waves at sets of consecutive frequencies (S, F), real or complex, rad per time, or its derivative
    by a frequency that is added to all; (S, F size, F size).
    """
    sets, count = frequency.shape
    size = state.balance.size
    out = np.zeros((sets, count, size, count, size), dtype=complex)
    lag = np.arange(count)[:, None] - np.arange(count)
    for channel in state.channels:
        for i, d in enumerate(channel.ins if channel.moving or not order else ()):
            matrix: Any = 0.0 if order else _two_sided(channel.stiffness(i), lag)
            if channel.moving:
                speed = 1j if order else 1j * frequency[:, None, :]
                matrix = matrix + _two_sided(channel.damping(i), lag) * speed
            for row in np.flatnonzero(channel.out):
                for column in np.flatnonzero(d):
                    out[:, :, row, :, column] += channel.out[row] * d[column] * matrix
    index = np.arange(count)
    blocks = state.linear.stiffness(frequency.ravel(), order).reshape(sets, count, size, size)
    out[:, index, :, index, :] += blocks.transpose(1, 0, 2, 3)
    return out.reshape(sets, count * size, count * size)


def _two_sided(spectrum: ComplexArray, lag: np.ndarray) -> ComplexArray:
    """Fourier coefficients of a real function at differences of any sign."""
    both = np.concatenate((spectrum, spectrum[:0:-1].conj()))
    return both[lag]


class _Form:
    """The form `left^H J_kappa right` at a motion: both vectors as waves, and what elements make of the right one."""

    def __init__(self, state: BalanceState, kind: Kind, left: np.ndarray, right: np.ndarray, kappa: complex) -> None:
        self.state, self.kind = state, kind
        self.u = Waves.of(state, kind, left, kappa, left=True).amplitudes
        waves = Waves.of(state, kind, right, kappa)
        self.v = waves.amplitudes
        self.frequency = waves.at.values * state.rate
        free = kappa if kind is Kind.FREE else 0.0
        #: derivatives of the frequencies by omega; kappa is kept
        self.by_omega = (self.frequency - free) / state.omega

    def rows(self, channel: Channel) -> ComplexArray:
        """The right vector along what a channel reads, (Q, F)."""
        along = (self.v @ channel.ins.T).T
        return np.concatenate((along, 1j * self.frequency * along)) if channel.moving else along

    def by_frequency(self) -> ComplexArray:
        """Derivatives by the frequency of every wave, (F,)."""
        linear = self.state.linear
        total = np.add.reduce(self.u.conj() * _per_wave(linear.stiffness(self.frequency, 1), self.v), axis=1)
        for channel in self.state.channels:
            for i, d in enumerate(channel.ins if channel.moving else ()):
                pulled = applied(channel.damping(i)[None], (self.u @ channel.out)[None])
                total += pulled.conj() * 1j * (self.v @ d)
        return total

    def gradient(self, channel: Channel) -> tuple[np.ndarray, complex]:
        """Derivatives by the coefficients, (2 H + 1, size), and by omega at kept frequencies of the perturbation."""
        along, high, free = channel.along, self.state.basis.harmonics, self.kind is Kind.FREE
        # the common factor exp(i f_0 tau) of all waves cancels in conj(left) * right
        waves = np.concatenate(((self.u @ channel.out)[None], self.rows(channel)))
        parts = 2 * along.size if free else along.size
        by_state, by_omega = np.zeros((parts, 2 * high + 1)), 0.0
        for zr, zi, weights in channel.second:
            values = np.empty((parts, len(zr)))
            pulled(waves, weights, zr, zi, values, by_state)
            if channel.moving:
                product = values[: along.size] + 1j * values[along.size :] if free else values
                for i, one in enumerate(along.motions):
                    slope = motion(one, zr, zi)[1] / along.nu
                    by_omega = by_omega + (product[channel.count + i] * slope).sum() / (2.0 * np.pi)
        gx = by_state[: along.size] + 1j * by_state[along.size :] if free else by_state
        return along_inputs(channel, gx), complex(by_omega)


def along_inputs(channel: Channel, by_state: np.ndarray) -> np.ndarray:
    """Gradient by X, (2 H + 1, size), from that by the functions of time that a channel reads, (Q, 2 H + 1)."""
    count, high = channel.count, by_state.shape[1] // 2
    rows = by_state[:count]
    if channel.moving:
        k = np.arange(1, high + 1) * channel.along.rate
        rows = rows.copy()
        rows[:, 1::2] -= k * by_state[count:, 2::2]
        rows[:, 2::2] += k * by_state[count:, 1::2]
    return rows.T @ channel.ins


def applied(spectra: ComplexArray, waves: ComplexArray) -> ComplexArray:
    """Sum over rows of the products of real periodic functions with sums of waves, on the waves' frequencies, (F,)."""
    total = np.zeros(waves.shape[1], dtype=complex)
    for spectrum, wave in zip(spectra, waves, strict=True):
        full = np.convolve(np.concatenate((spectrum[:0:-1].conj(), spectrum)), wave)
        total += full[len(spectrum) - 1 : len(spectrum) - 1 + len(wave)]
    return total


def _per_wave(blocks: ComplexArray, waves: ComplexArray) -> ComplexArray:
    """Products of matrices (F, n, n), one per frequency, with waves (F, n)."""
    product: ComplexArray = np.matmul(blocks, waves[:, :, None])[:, :, 0]
    return product


def bilinear_gradient(
    state: BalanceState, kind: Kind, left: np.ndarray, right: np.ndarray, names: tuple[str, ...], kappa: float = 0.0
) -> Gradient:
    """Derivative of `left^H J_kappa right`.

    Parameters
    ----------
    left, right
        Vectors of the operator's size, kept fixed.
    names
        "omega" and parameters to differentiate by. For Kind.HALF the shift follows omega; for Kind.FREE kappa is kept.
    """
    form = _Form(state, kind, left, right, kappa)
    gx = np.zeros((state.basis.size, state.balance.size), dtype=complex if kind is Kind.FREE else float)
    by_frequency = form.by_frequency()
    by_omega, by_kappa = complex(form.by_omega @ by_frequency), complex(by_frequency.sum())
    for channel in state.channels:
        part, rate = form.gradient(channel)
        gx += part
        by_omega += rate
    rates = {name: by_omega if name == "omega" else _form_rate(form, name) for name in names}
    if kind is Kind.FREE:
        return Gradient(gx, rates, by_kappa)
    return Gradient(gx, {name: complex(rate.real) for name, rate in rates.items()}, by_kappa)


def _form_rate(form: _Form, name: str) -> complex:
    """Derivative of the form by a parameter."""
    state, linear = form.state, form.state.linear
    rate = 0j
    for channel, change in state.changes_by(name):
        rate += complex(np.vdot(form.u @ channel.out, applied(change[1:], form.rows(channel))))
    if name in state.balance.matrix_names:
        block = linear.stiffness_by(form.frequency, (name,))
        if block is not None:
            rate += complex(np.vdot(form.u, _per_wave(block, form.v)))
    return rate


def rate_by_kappa(
    state: BalanceState, kind: Kind, left: np.ndarray, right: np.ndarray, kappa: complex = 0.0
) -> complex:
    """Derivative of `left^H J_kappa right` by kappa alone."""
    return complex(_Form(state, kind, left, right, kappa).by_frequency().sum())


def rate_by_feeding(state: BalanceState, kind: Kind, left: np.ndarray, right: np.ndarray) -> complex:
    """Derivative of `left^H J_kappa right` by the rate of `LinearPart.fed`, of a real kind."""
    form = _Form(state, kind, left, right, 0.0)
    return complex(np.vdot(form.u, _per_wave(state.linear.feeding(form.frequency), form.v)))


def parameter_gradient(state: BalanceState, left: Array, name: str, names: tuple[str, ...]) -> Gradient:
    """Derivative of `left . R_name` by the coefficients and by names ("omega" or parameters); `left` of the
    residual's size.
    """
    shaped = state.balance.shaped(left)
    # A_name per harmonic, transposed in the sense of the real basis: conjugate transpose of the complex blocks
    block = state.linear_by(name)
    gx = np.zeros_like(state.x)
    if block is not None:
        gx += apply_blocks(_adjoint(block), shaped)
    if name == "omega":
        for channel in state.channels:
            if channel.moving:
                gx += _omega_gradient(state, channel, shaped @ channel.out)
    else:
        for channel, change in state.changes_by(name):
            gx += along_inputs_of_form(state, channel, change[1:], shaped @ channel.out)
    zero = np.zeros_like(state.x)
    rates = {
        other: complex(left @ second_derivative(state, Direction(zero, {name: 1.0}), Direction(zero, {other: 1.0})))
        for other in names
    }
    return Gradient(gx, rates, 0.0)


def _adjoint(blocks: ComplexArray) -> ComplexArray:
    """The conjugate transpose of every block."""
    return np.ascontiguousarray(blocks.conj().transpose(0, 2, 1))


def along_inputs_of_form(state: BalanceState, channel: Channel, change: ComplexArray, left: Array) -> Array:
    """Gradient by X, (2 H + 1, size), of `left . T(change) q`, left (2 H + 1,) along d_out, change (Q, top + 1)."""
    basis, gx = state.basis, np.zeros_like(state.x)
    for i, d in enumerate(channel.ins):
        part = toeplitz(change[i], basis.harmonics).T @ left
        if channel.moving:
            pulled = toeplitz(change[channel.count + i], basis.harmonics).T @ left
            part = part - state.omega * basis.derivative(pulled)
        gx += np.multiply.outer(part, d)
    return gx


def _omega_gradient(state: BalanceState, channel: Channel, left: Array) -> Array:
    """Gradient by X, (2 H + 1, size), of `left . F_omega`, `F_omega = T(f_v) D X`, left (2 H + 1,) along d_out."""
    basis, high = state.basis, state.basis.harmonics
    slopes = [basis.derivative(state.x @ d) for d in channel.ins]
    rows = [as_waves(left[:, None], Kind.INTEGER, True)[:, 0]]
    rows += [as_waves(slope[:, None], Kind.INTEGER, False)[:, 0] for slope in slopes]
    by_state = np.zeros((channel.along.size, 2 * high + 1))
    for zr, zi, weights in channel.second:
        values = np.empty((channel.along.size, len(zr)))
        pulled(np.array(rows), np.ascontiguousarray(weights[:, channel.count :]), zr, zi, values, by_state)
    gx = along_inputs(channel, by_state)
    for i, d in enumerate(channel.ins):
        gx += np.multiply.outer(-basis.derivative(toeplitz(channel.damping(i), high).T @ left), d)
    return gx


def operator_along(
    state: BalanceState,
    kind: Kind,
    right: np.ndarray,
    directions: Sequence[Direction],
    kappa: float = 0.0,
    shifts: Sequence[float] | None = None,
) -> np.ndarray:
    """Derivatives of `J_kappa right` along directions, `right` kept fixed; one column each, (rows, directions).

    Parameters
    ----------
    right
        Vector of the operator's size.
    directions
        Changes of coefficients, omega and parameters. For Kind.HALF the shift follows omega.
    shifts
        Changes of kappa along the directions, for Kind.FREE; default none.
    """
    form, at = _Form(state, kind, right, right, kappa), Frequencies.of(state, kind, kappa)
    linear, frequency = state.linear, form.frequency
    turning = _per_wave(linear.stiffness(frequency, 1), form.v)
    columns = []
    for j, a in enumerate(directions):
        turn = form.by_omega * a.omega
        if kind is Kind.FREE and shifts is not None:
            turn = turn + shifts[j]
        force = np.zeros_like(form.v)
        for channel in state.channels:
            force += np.multiply.outer(_channel_along(form, channel, a, turn), channel.out)
        column = force + turn[:, None] * turning
        for name, rate in a.parameters.items():
            block = linear.stiffness_by(frequency, (name,))
            if block is not None:
                column += rate * _per_wave(block, form.v)
        columns.append(Waves(column, at).vector(kind))
    return np.stack(columns, axis=1)


def operator_by_motion(state: BalanceState, right: Array) -> Array:
    """Derivative of `R_X right` by the coefficients, `right` kept fixed, (dimension, dimension).

    `R''[right, a] = B T(g) a` with `g_r = sum_s f_rs q_s` for the change q along `right` of what a law reads: an
    operator like R_X itself, g in place of the law's tangent.
    """
    basis, high, n = state.basis, state.basis.harmonics, state.balance.size
    along = Direction(state.balance.shaped(right))
    turning = state.omega * basis.derivative(np.eye(basis.size))
    out = np.zeros((basis.size, n, basis.size, n))
    for channel in state.channels:
        bent = np.zeros((channel.along.size, 2 * high + 1), dtype=complex)
        for zr, zi, weights in channel.second:
            values = np.einsum("rsn,sn->rn", weights, change_at(channel, along, zr, zi))
            bent += spectra(values, np.ones_like(zr), zr, zi, 2 * high)
        for i, d in enumerate(channel.ins):
            matrix = toeplitz(bent[i], high)
            if channel.moving:
                matrix = matrix + toeplitz(bent[channel.count + i], high) @ turning
            out += np.einsum("kl,r,s->krls", matrix, channel.out, d)
    return out.reshape(state.x.size, state.x.size)


def _channel_along(form: _Form, channel: Channel, a: Direction, turn: np.ndarray) -> ComplexArray:
    """What a channel makes of the right vector, changed along a direction, (F,); `turn`: changes of the frequencies."""
    rows = form.rows(channel)
    total = np.zeros(rows.shape[1], dtype=complex)
    for zr, zi, weights in channel.second:
        product = np.einsum("rsn,rn,sn->n", weights, change_at(channel, a, zr, zi), wave_sums(rows, zr, zi))
        total += fourier(product[None], np.ones_like(zr), zr, zi, len(total) - 1)[0]
    if channel.moving and turn.any():
        total += applied(channel.spectra[1 + channel.count :], 1j * turn * rows[: channel.count])
    for name, rate in a.parameters.items():
        for changed, change in form.state.changes_by(name):
            if changed is channel:
                total += rate * applied(change[1:], rows)
    return total
