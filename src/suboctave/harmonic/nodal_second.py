"""Second derivatives of elements that are integrated at nodes of their own (`nodal`), as `second` and `perturbation`
need them.

With `q_a` the change of an element's state along a direction a (displacements `u_a`, rates `omega D u_a + omega_a D
u`), `F''[a, b] = < sum_rs f_rs q_a,r q_b,s + sum_i f_vi (omega_a D u_b + omega_b D u_a)_i >` plus terms with the
element's coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray, spectrum_to_real, to_complex
from suboctave.harmonic.nodal import NodalForce, rates_of
from suboctave.harmonic.rates import coefficient_curvature, coefficient_rates

Apply = Callable[[ComplexArray, ComplexArray], ComplexArray]


class _Direction(Protocol):
    @property
    def x(self) -> Array: ...

    @property
    def omega(self) -> float: ...

    @property
    def parameters(self) -> dict[str, float]: ...


def _toeplitz(force: NodalForce, spectrum: ComplexArray) -> Array:
    doubled = 2 * np.arange(force.basis.harmonics + 1)
    matrix: Array = kernels.galerkin(spectrum, np.zeros(0, dtype=complex), 0.0, doubled, doubled, True, True)
    return matrix


def _changed(force: NodalForce, a: _Direction, zr: Array, zi: Array) -> Array:
    """Change of q along a direction at instants, (Q, N)."""
    values = np.array([kernels.motion(to_complex(a.x @ d), zr, zi) for d in force.own.ins])
    if not force.own.moving:
        return values[:, 0]
    slope = np.array([kernels.motion(motion, zr, zi)[1] for motion in force.motions]) / force.basis.nu
    return np.concatenate((values[:, 0], force.rate * values[:, 1] + a.omega * slope))


def force_by(force: NodalForce, x: Array, values: Mapping[str, float], name: str) -> Array | None:
    """The force along d_out differentiated by "omega" or a parameter at fixed X, (2 H + 1,); None if zero."""
    own, basis = force.own, force.basis
    if name == "omega":
        if not own.moving:
            return None
        slopes = [basis.derivative(x @ d) for d in own.ins]
        return sum((_toeplitz(force, force.damping(i)) @ s for i, s in enumerate(slopes)), np.zeros(basis.size))
    rates = rates_of(own, values, name)
    if rates is None:
        return None
    return spectrum_to_real((rates @ force.by_coefficients[0])[:, None], basis.harmonics)[:, 0]


def second(force: NodalForce, x: Array, values: Mapping[str, float], a: _Direction, b: _Direction) -> Array:
    """F''[a, b] along d_out, (2 H + 1,)."""
    own, basis, bend = force.own, force.basis, force.bend
    high, omega = basis.harmonics, force.rate * basis.nu
    q_a, q_b = (_changed(force, one, bend.zr, bend.zi) for one in (a, b))
    total = np.einsum("rsn,rn,sn->n", bend.weights, q_a, q_b)
    result = spectrum_to_real(kernels.spectra(total[None, :], bend.zr, bend.zi, high).T, high)[:, 0]
    if own.moving and (a.omega or b.omega):
        for i, d in enumerate(own.ins):
            change = basis.derivative(a.omega * (b.x @ d) + b.omega * (a.x @ d))
            result += _toeplitz(force, force.damping(i)) @ change
    rates_a, rates_b = (coefficient_rates(own.element, values, one.parameters) for one in (a, b))
    if not (rates_a.any() or rates_b.any()):
        return result
    f_c, f_qc, f_cc = force.by_coefficients
    for rates, other in ((rates_a, b), (rates_b, a)):
        if not rates.any():
            continue
        for i, d in enumerate(own.ins):
            result += _toeplitz(force, rates @ f_qc[:, i]) @ (other.x @ d)
            if own.moving:
                change = omega * basis.derivative(other.x @ d) + other.omega * basis.derivative(x @ d)
                result += _toeplitz(force, rates @ f_qc[:, own.count + i]) @ change
    spectrum = np.einsum("i,j,ijq->q", rates_a, rates_b, f_cc)
    spectrum = spectrum + coefficient_curvature(own.element, values, a.parameters, b.parameters) @ f_c
    return result + spectrum_to_real(spectrum[:, None], high)[:, 0]


def two_sided(force: NodalForce, k: np.ndarray, frequency: Array, toeplitz: Callable[..., ComplexArray]) -> list:
    """The part of J_kappa that couples every input to d_out: matrices between the waves k."""
    found = []
    for i in range(force.own.count):
        matrix = toeplitz(force.stiffness(i), k)
        if force.own.moving:
            matrix = matrix + toeplitz(force.damping(i), k) * (1j * frequency)
        found.append(matrix)
    return found


def _gradient(force: NodalForce, by: np.ndarray, zr: Array, zi: Array) -> np.ndarray:
    """Gradient by the coefficients X (2 H + 1, size) of `int sum_r by_r q_r`, by (Q, N) weights at instants."""
    own, high = force.own, force.basis.harmonics
    parts = [by.real, by.imag] if np.iscomplexobj(by) else [by]
    spectra = [kernels.spectra(np.ascontiguousarray(part), zr, zi, high) for part in parts]
    result = np.zeros((2 * high + 1, own.ins.shape[1]), dtype=by.dtype)
    k = np.arange(1, high + 1) * force.rate
    for i, d in enumerate(own.ins):
        along = np.zeros(2 * high + 1, dtype=by.dtype)
        for spectrum, unit in zip(spectra, (1.0, 1j), strict=False):
            share = _projection(spectrum[i])
            if own.moving:
                p = _projection(spectrum[own.count + i])
                share[1::2] -= k * p[2::2]
                share[2::2] += k * p[1::2]
            along += unit * share
        result += np.multiply.outer(along, d)
    return result


def _projection(spectrum: ComplexArray) -> Array:
    result = np.empty(2 * len(spectrum) - 1)
    result[0] = spectrum[0].real
    result[1::2] = spectrum[1:].real
    result[2::2] = -spectrum[1:].imag
    return result


def form_gradient(
    force: NodalForce,
    left: ComplexArray,
    right: ComplexArray,
    frequency: Array,
    by_omega: Array,
    values: Mapping[str, float],
    names: tuple[str, ...],
    apply: Apply,
) -> tuple[np.ndarray, dict[str, complex], complex, ComplexArray]:
    """What the element adds to the gradient of `left^H J_kappa right` (see `perturbation.bilinear_gradient`).

    left, right (F, size): waves, left as the element forces see it. Returns the gradient by X (2 H + 1, size), by names
    and by kappa, and what the element makes of `right` along d_out, (F,).
    """
    own, bend, basis = force.own, force.bend, force.basis
    ue = left @ own.out
    along = [right @ d for d in own.ins]
    rows = np.array(along + ([1j * frequency * ve for ve in along] if own.moving else []))
    waves = kernels.polynomial(np.concatenate((ue[None], rows)), bend.zr, bend.zi)
    by = waves[0].conj() * np.einsum("rsn,sn->rn", bend.weights, waves[1:])
    gx = _gradient(force, by, bend.zr, bend.zi)
    rates: dict[str, complex] = {}
    response, kappa, omega = np.zeros_like(ue), 0j, 0j
    for i, ve in enumerate(along):
        response = response + apply(force.stiffness(i), ve)
        if own.moving:
            damping = force.damping(i)
            response = response + apply(damping, rows[own.count + i])
            kappa += complex(np.vdot(ue, apply(damping, 1j * ve)))
            slope = kernels.motion(force.motions[i], bend.zr, bend.zi)[1] / basis.nu
            omega += complex((by[own.count + i] * slope).sum() / (2.0 * np.pi))
            omega += complex(np.vdot(ue, apply(damping, 1j * by_omega * ve)))
    for name in names:
        change = None if name == "omega" else rates_of(own, values, name)
        if change is not None:
            f_qc = np.einsum("c,cqk->qk", change, force.by_coefficients[1])
            rates[name] = sum((complex(np.vdot(ue, apply(f_qc[r], row))) for r, row in enumerate(rows)), 0j)
    if "omega" in names:
        rates["omega"] = omega
    return gx, rates, kappa, response


def operator_applied(force: NodalForce, right: ComplexArray, frequency: Array, apply: Apply) -> ComplexArray:
    """What the element makes of a perturbation of waves (F, size), along d_out, (F,)."""
    response = np.zeros(len(right), dtype=complex)
    for i, d in enumerate(force.own.ins):
        ve = right @ d
        response = response + apply(force.stiffness(i), ve)
        if force.own.moving:
            response = response + apply(force.damping(i), 1j * frequency * ve)
    return response


def operator_along(
    force: NodalForce,
    right: ComplexArray,
    frequency: Array,
    turn: Array,
    values: Mapping[str, float],
    a: _Direction,
    apply: Apply,
) -> ComplexArray:
    """How that changes along a direction with the perturbation kept, (F,); `turn`: changes of the frequencies."""
    own, bend = force.own, force.bend
    along = [right @ d for d in own.ins]
    rows = np.array(along + ([1j * frequency * ve for ve in along] if own.moving else []))
    waves = kernels.polynomial(rows, bend.zr, bend.zi)
    total = np.einsum("rsn,rn,sn->n", bend.weights, _changed(force, a, bend.zr, bend.zi), waves)
    parts = kernels.spectra(np.stack((total.real, total.imag)), bend.zr, bend.zi, len(right) - 1)
    result: ComplexArray = parts[0] + 1j * parts[1]
    if own.moving:
        for i, ve in enumerate(along):
            result = result + apply(force.damping(i), 1j * turn * ve)
    change = coefficient_rates(own.element, values, a.parameters)
    if change.any():
        f_qc = np.einsum("c,cqk->qk", change, force.by_coefficients[1])
        for r, row in enumerate(rows):
            result = result + apply(f_qc[r], row)
    return result


def parameter_form_gradient(
    force: NodalForce,
    left: Array,
    x: Array,
    values: Mapping[str, float],
    name: str,
    waves_of: Callable[..., ComplexArray],
) -> Array | None:
    """Gradient of `left . F_name` by X, (2 H + 1, size), left (2 H + 1, size) as the element forces see it.

    waves_of: real coefficients as amplitudes of waves, with `left` for the scaling.
    """
    own, basis = force.own, force.basis
    ue = left @ own.out
    gx = np.zeros_like(x)
    if name == "omega":
        if not own.moving:
            return None
        bend = force.bend
        slopes = [basis.derivative(x @ d) for d in own.ins]
        stack = np.stack([waves_of(ue, left=True)] + [waves_of(slope, left=False) for slope in slopes])
        waves = kernels.polynomial(stack, bend.zr, bend.zi)
        product = (waves[0].conj() * waves[1:]).real
        by = np.einsum("rin,in->rn", bend.weights[:, own.count :], product)
        gx += _gradient(force, by, bend.zr, bend.zi)
        for i, d in enumerate(own.ins):
            gx += np.multiply.outer(-basis.derivative(_toeplitz(force, force.damping(i)).T @ ue), d)
        return gx
    change = rates_of(own, values, name)
    if change is None:
        return None
    f_qc = np.einsum("c,cqk->qk", change, force.by_coefficients[1])
    omega = force.rate * basis.nu
    for i, d in enumerate(own.ins):
        part = _toeplitz(force, f_qc[i]).T @ ue
        if own.moving:
            part = part - omega * basis.derivative(_toeplitz(force, f_qc[own.count + i]).T @ ue)
        gx += np.multiply.outer(part, d)
    return gx
