"""The operator behind every bifurcation: J_kappa, a motion's equations for perturbations at frequencies `k w0 + kappa`.

    J_kappa[k, m] = A(k w0 + kappa) delta_km + B(k w0 + kappa) [ fx_{k-m} + i (m w0 + kappa) fv_{k-m} ],    w0 = omega
    / nu.

Its singularity at kappa = 0 is a limit or branch point, at kappa = w0 / 2 a period doubling, at any other kappa a
Neimark-Sacker point. For the first two the set of frequencies is closed under conjugation: the matrices are real
(`BalanceState.jacobian` and `BalanceState.half_jacobian`); otherwise complex, harmonics k = -H .. H.

`bilinear_gradient` gives the derivative of `left^H J_kappa right` by the motion, omega, parameters and kappa with one
pass over the sampling nodes: the adjoint gradient that bordered bifurcation systems need, without forming `(J
right)_X`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from suboctave.harmonic import free_form, kernels, nodal_second, real_form
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.changes import changes_by
from suboctave.harmonic.linear_part import apply_blocks
from suboctave.harmonic.local_force import CoefficientChange, Curvature
from suboctave.harmonic.second import Direction, second_derivative
from suboctave.harmonic.state import BalanceState


class Kind(Enum):
    """Which shift of the frequencies: none, half the base frequency, or any."""

    INTEGER = 0
    HALF = 1
    FREE = 2


@dataclass(frozen=True)
class Gradient:
    """Derivative of `left^H J_kappa right` by the coefficients (2 H + 1, size), by names, and by kappa; complex for
    Kind.FREE.
    """

    x: np.ndarray
    rates: dict[str, complex]
    kappa: complex


def operator(state: BalanceState, kind: Kind, kappa: float = 0.0) -> np.ndarray:
    """J_kappa: real of size n (2 H + 1) or n (2 H + 2), complex of size n (2 H + 1) for Kind.FREE (kappa in rad per
    time).

    Where the basis leaves harmonics out, they are missing from the first alone, which is R_X: the other two have all
    frequencies up to the motion's highest.
    """
    if kind is Kind.INTEGER:
        return state.jacobian
    if kind is Kind.HALF:
        return state.half_jacobian
    size, high = state.balance.size, state.basis.harmonics
    k = np.arange(-high, high + 1)
    frequency = np.asarray(k * state.rate + kappa, dtype=float)
    compiled = free_form.free_operator(state, frequency)
    if compiled is not None:
        return compiled
    out = np.zeros((len(k) * size, len(k) * size), dtype=complex)
    for group, _, stiffness, damping in state.spectra:
        matrix = _two_sided(stiffness, k)
        if damping.size:
            matrix = matrix + _two_sided(damping, k) * (1j * frequency)
        kernels.add_element(out, matrix, group.dofs, group.values, group.dofs, group.values, size)
    for nodal in state.nodal:
        own = nodal.own
        for matrix, packed in zip(nodal_second.two_sided(nodal, k, frequency, _two_sided), own.in_packed, strict=True):
            kernels.add_element(out, matrix, *own.out_packed, *packed, size)
    compliance = state.linear.compliance(frequency)
    shaped = out.reshape(len(k), size, -1)
    if compliance is not None:
        shaped[:] = np.matmul(compliance, shaped)
    four = out.reshape(len(k), size, len(k), size)
    index = np.arange(len(k))
    four[index, :, index, :] = four[index, :, index, :] + state.linear.stiffness(frequency)
    return out


def _two_sided(spectrum: ComplexArray, k: np.ndarray) -> ComplexArray:
    """Toeplitz matrix of a real function: entry (i, j) is its Fourier coefficient k_i - k_j."""
    lag = k[:, None] - k[None, :]
    return np.where(lag >= 0, spectrum[np.abs(lag)], spectrum[np.abs(lag)].conj())


def _as_waves(vector: np.ndarray, kind: Kind, size: int, left: bool) -> tuple[ComplexArray, np.ndarray]:
    """A vector of the operator's basis as amplitudes of `exp(i f tau)`, (F, size), and the frequencies f, ascending.

    Left vectors are scaled such that `left^H operator right` is the same number in both notations.
    """
    shaped = vector.reshape(-1, size)
    if kind is Kind.FREE:
        high = (shaped.shape[0] - 1) // 2
        return shaped.astype(complex), np.arange(-high, high + 1).astype(float)
    scale = 1.0 if left else 0.5
    if kind is Kind.INTEGER:
        positive = scale * (shaped[1::2] - 1j * shaped[2::2])
        f = np.arange(1, len(positive) + 1).astype(float)
        waves = np.concatenate((positive[::-1].conj(), shaped[:1].astype(complex), positive))
        return waves, np.concatenate((-f[::-1], [0.0], f))
    positive = scale * (shaped[::2] - 1j * shaped[1::2])
    f = np.arange(len(positive)) + 0.5
    return np.concatenate((positive[::-1].conj(), positive)), np.concatenate((-f[::-1], f))


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
    if kind is not Kind.FREE and real_form.applies(state, names):
        by_x, slope_omega, slope_kappa = real_form.real_gradient(state, kind is Kind.INTEGER, left, right)
        return Gradient(by_x, {name: complex(slope_omega) for name in names}, slope_kappa)
    size, basis = state.balance.size, state.basis
    if kind is Kind.INTEGER:
        left, right = state.balance.spread(left), state.balance.spread(right)
    u, f = _as_waves(left, kind, size, left=True)
    v, _ = _as_waves(right, kind, size, left=False)
    frequency = f * state.rate + (kappa if kind is Kind.FREE else 0.0)
    by_omega = f / basis.nu  # d frequency / d omega
    if kind is Kind.FREE and names in ((), ("omega",)):
        found = free_form.free_gradient(state, u, v, frequency, by_omega)
        if found is not None:
            return Gradient(found[0], dict.fromkeys(names, found[1]), found[2])
    linear = state.linear
    slope = linear.stiffness(frequency, 1)
    compliance = linear.compliance(frequency)
    # what the element part of the operator makes of `right`, and the left vector as the element forces see it
    u_force = u if compliance is None else np.einsum("fji,fj->fi", compliance.conj(), u)
    gx = np.zeros((basis.size, size), dtype=complex)
    rates: dict[str, complex] = dict.fromkeys(names, 0j)
    drive = np.zeros_like(v)  # T(f_x) v + T(f_v) v'
    g_kappa = 0j
    for (group, _, stiffness, damping), bend, motion in zip(
        state.spectra, state.curvatures, state.motions, strict=True
    ):
        ue, ve = u_force @ group.direction, v @ group.direction
        rate_ve = 1j * frequency * ve
        local_x, local_omega = _group_gradient(bend, motion, state.rate, ue, ve, rate_ve, basis.nu)
        gx += np.multiply.outer(local_x, group.direction)
        if damping.size:
            local_omega += _inner(ue, _toeplitz_apply(damping, 1j * by_omega * ve))
            g_kappa += _inner(ue, _toeplitz_apply(damping, 1j * ve))
        if compliance is not None:
            response = _toeplitz_apply(stiffness, ve)
            if damping.size:
                response = response + _toeplitz_apply(damping, rate_ve)
            drive += np.multiply.outer(response, group.direction)
        if "omega" in rates:
            rates["omega"] += local_omega
    for nodal in state.nodal:
        part, changes, part_kappa, response = nodal_second.form_gradient(
            nodal, u_force, v, frequency, by_omega, state.values, names, _toeplitz_apply
        )
        gx += part
        g_kappa += part_kappa
        drive += np.multiply.outer(response, nodal.own.out)
        for name, by_name in changes.items():
            rates[name] += by_name
    for name in names:
        if name == "omega":
            continue
        for group, change in changes_by(state, name):
            rates[name] += _change_of_form(change, u_force @ group.direction, v @ group.direction, frequency)
    g_kappa += _form(u, slope, v)
    compliance_slope = linear.compliance(frequency, 1)
    if compliance_slope is not None:
        g_kappa += _form(u, compliance_slope, drive)
    for name in names:
        if name == "omega":
            share = by_omega[:, None, None]
            rates[name] += _form(u, share * slope, v)
            if compliance_slope is not None:
                rates[name] += _form(u, share * compliance_slope, drive)
            continue
        for block, vector in (
            (linear.stiffness_by(frequency, (name,)), v),
            (linear.compliance_by(frequency, (name,)), drive),
        ):
            if block is not None:
                rates[name] += _form(u, block, vector)
    if kind is Kind.FREE:
        return Gradient(gx, rates, g_kappa)
    return Gradient(gx.real, {k: complex(r.real) for k, r in rates.items()}, g_kappa)


def form_rates(
    state: BalanceState, kind: Kind, left: np.ndarray, right: np.ndarray, names: tuple[str, ...], kappa: float = 0.0
) -> dict[str, complex] | None:
    """Derivatives of `left^H J_kappa right` by parameters alone, as `bilinear_gradient` gives them with all others.

    None where that takes more than the elements' coefficients and the linear part: elements with nodes of their own, a
    condensed model.
    """
    linear = state.linear
    if state.nodal or state.compliance is not None:
        return None
    size, rates = state.balance.size, dict.fromkeys(names, 0j)
    if kind is Kind.INTEGER:
        left, right = state.balance.spread(left), state.balance.spread(right)
    for name in names:
        changes = changes_by(state, name)
        direct = name in state.balance.matrix_names
        if not (changes or direct):
            continue
        if not (kind is Kind.FREE or direct or any(change.damping is not None for _, change in changes)):
            u, v = left.reshape(-1, size), right.reshape(-1, size)
            for group, change in changes:
                rates[name] += real_form.toeplitz_part(
                    u, v, kind is Kind.INTEGER, group.dofs, group.values, change.stiffness
                )
            continue
        u, f = _as_waves(left, kind, size, left=True)
        v, _ = _as_waves(right, kind, size, left=False)
        frequency = f * state.rate + (kappa if kind is Kind.FREE else 0.0)
        for group, change in changes:
            rates[name] += _change_of_form(change, u @ group.direction, v @ group.direction, frequency)
        block = linear.stiffness_by(frequency, (name,))
        if block is not None:
            rates[name] += _form(u, block, v)
    return rates if kind is Kind.FREE else {name: complex(rate.real) for name, rate in rates.items()}


def _change_of_form(c: CoefficientChange, left: ComplexArray, right: ComplexArray, frequency: Array) -> complex:
    """What a change of the forces along a direction does to the form."""
    result = complex(kernels.toeplitz_form(left, c.stiffness, right))
    if c.damping is not None:
        result += _inner(left, _toeplitz_apply(c.damping, 1j * frequency * right))
    return result


def _inner(left: ComplexArray, right: ComplexArray) -> complex:
    """`left^H right`."""
    return complex(np.vdot(left, right))


def _form(left: ComplexArray, blocks: ComplexArray, right: ComplexArray) -> complex:
    """`left^H blocks right`, one block per frequency."""
    return complex(kernels.form(left, blocks, right))


def _toeplitz_apply(spectrum: ComplexArray, waves: ComplexArray) -> ComplexArray:
    """Product of a real periodic function and a sum of waves with consecutive frequencies, on these frequencies."""
    two_sided = np.concatenate((spectrum[:0:-1].conj(), spectrum))
    centre = len(spectrum) - 1
    full = np.convolve(two_sided, waves)
    return full[centre : centre + len(waves)]


def _group_gradient(
    bend: Curvature,
    motion: ComplexArray,
    rate: float,
    left: ComplexArray,
    right: ComplexArray,
    right_rate: ComplexArray,
    nu: int,
) -> tuple[ComplexArray, complex]:
    """Gradient of `int conj(left) (f_u right + f_v right') / (2 pi)` by the real coefficients along a direction and by
    omega through v.
    """
    high = motion.shape[0] - 1
    if bend.zr.size == 0:
        return np.zeros(2 * high + 1, dtype=complex), 0.0 + 0.0j
    # the common factor exp(i f_0 tau) of all waves cancels in conj(left) * right
    waves = kernels.polynomial(np.stack((left, right, right_rate)), bend.zr, bend.zi)
    by_u = waves[0].conj() * waves[1] * bend.uu
    if bend.uv is not None and bend.vv is not None:
        by_u += waves[0].conj() * waves[2] * bend.uv
        by_v = waves[0].conj() * (waves[1] * bend.uv + waves[2] * bend.vv)
        rows = np.stack((by_u.real, by_u.imag, by_v.real, by_v.imag))
    else:
        by_v = None
        rows = np.stack((by_u.real, by_u.imag))
    s = kernels.spectra(np.ascontiguousarray(rows), bend.zr, bend.zi, high)
    result = _projection(s[0]) + 1j * _projection(s[1])
    by_omega = 0.0 + 0.0j
    if by_v is not None:
        p = _projection(s[2]) + 1j * _projection(s[3])
        k = np.arange(1, high + 1) * rate
        result[1::2] -= k * p[2::2]
        result[2::2] += k * p[1::2]
        slope = kernels.motion(motion, bend.zr, bend.zi)[1] / nu
        by_omega = complex((by_v * slope).sum() / (2.0 * np.pi))
    return result, by_omega


def _projection(spectrum: ComplexArray) -> Array:
    """`mean(g cos k tau)`, `mean(g sin k tau)` from the Fourier coefficients of g, in the order of the basis."""
    result = np.empty(2 * len(spectrum) - 1)
    result[0] = spectrum[0].real
    result[1::2] = spectrum[1:].real
    result[2::2] = -spectrum[1:].imag
    return result


def parameter_gradient(state: BalanceState, left: Array, name: str, names: tuple[str, ...]) -> Gradient:
    """Derivative of `left . R_name` by the coefficients and by names ("omega" or parameters); `left` of the
    residual's size.
    """
    linear, basis = state.linear, state.basis
    freq, m = state.frequencies, basis.multiples[:, None, None]
    shaped = state.balance.spread(left)
    # A_name and B_name per harmonic, transposed in the sense of the real basis: conjugate transpose of the complex
    # blocks
    if name == "omega":
        block: ComplexArray | None = linear.stiffness(freq, 1) * m
        slope = linear.compliance(freq, 1)
        slope = None if slope is None else slope * m
    else:
        block, slope = linear.stiffness_by(freq, (name,)), linear.compliance_by(freq, (name,))
    gx = np.zeros_like(state.x)
    if block is not None:
        gx += apply_blocks(block.conj().transpose(0, 2, 1), shaped)
    if slope is not None:
        pulled = apply_blocks(slope.conj().transpose(0, 2, 1), shaped)
        gx += (state.force_jacobian.T @ pulled.ravel()).reshape(gx.shape)
    u_force = shaped if state.compliance is None else apply_blocks(state.compliance.conj().transpose(0, 2, 1), shaped)
    if name == "omega":
        for (group, _, _, damping), bend, motion in zip(state.spectra, state.curvatures, state.motions, strict=True):
            if damping.size == 0:
                continue
            ue = u_force @ group.direction
            waves, _ = _as_waves(ue, Kind.INTEGER, 1, left=True)
            # S_omega = T(f_v) D X: its tangent by X through f_v, and T(f_v) D itself
            slope_x, _ = _as_waves(basis.derivative(state.x @ group.direction), Kind.INTEGER, 1, left=False)
            part = _velocity_gradient(bend, motion, state.rate, waves[:, 0], slope_x[:, 0])
            direct = -basis.derivative(_transposed(damping, ue, basis.harmonics))
            gx += np.multiply.outer(part + direct, group.direction)
    else:
        for group, c in changes_by(state, name):
            ue = u_force @ group.direction
            part = _transposed(c.stiffness, ue, basis.harmonics)
            if c.damping is not None:
                part = part - state.omega * basis.derivative(_transposed(c.damping, ue, basis.harmonics))
            gx += np.multiply.outer(part, group.direction)
    for nodal in state.nodal:
        found = nodal_second.parameter_form_gradient(nodal, u_force, state.x, state.values, name, _waves_of)
        if found is not None:
            gx += found
    zero = np.zeros_like(state.x)
    rates = {
        other: complex(left @ second_derivative(state, Direction(zero, {name: 1.0}), Direction(zero, {other: 1.0})))
        for other in names
    }
    return Gradient(gx, rates, 0.0)


def _waves_of(coefficients: Array, left: bool) -> ComplexArray:
    return _as_waves(coefficients, Kind.INTEGER, 1, left)[0][:, 0]


def _transposed(spectrum: ComplexArray, left: Array, harmonics: int) -> Array:
    """`T(g)^T left` in the integer basis."""
    doubled = 2 * np.arange(harmonics + 1)
    return kernels.galerkin(spectrum, np.zeros(0, dtype=complex), 0.0, doubled, doubled, True, True).T @ left


def _velocity_gradient(
    bend: Curvature, motion: ComplexArray, rate: float, left: ComplexArray, slope: ComplexArray
) -> Array:
    """Gradient of `int conj(left) f_v slope / (2 pi)` by the real coefficients along a direction, left and slope
    fixed.
    """
    high = motion.shape[0] - 1
    if bend.uv is None or bend.vv is None or bend.zr.size == 0:
        return np.zeros(2 * high + 1)
    waves = kernels.polynomial(np.stack((left, slope)), bend.zr, bend.zi)
    product = (waves[0].conj() * waves[1]).real
    s = kernels.spectra(np.stack((product * bend.uv, product * bend.vv)), bend.zr, bend.zi, high)
    result = _projection(s[0])
    p = _projection(s[1])
    k = np.arange(1, high + 1) * rate
    result[1::2] -= k * p[2::2]
    result[2::2] += k * p[1::2]
    return result
