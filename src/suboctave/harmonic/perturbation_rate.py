"""How J_kappa applied to a vector changes with the motion: `(J_kappa v)'[direction]`, for any number of directions.

    (J_kappa v)' = A' v + B' [f_x v + f_v v'] + B [f_uu u v + f_uv (w v + u v') + f_vv w v' + f_v (i Omega)' v],

with v' = i Omega v, u and w the changes of an element's displacement and velocity along the direction, Omega = f w0 +
kappa the frequencies of the perturbation. `perturbation.bilinear_gradient` is the adjoint: there one left vector
against all directions, here a few directions against all left vectors, as extended systems with the null vector among
their unknowns need it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from suboctave.harmonic import kernels, nodal_second
from suboctave.harmonic.basis import ComplexArray, to_complex
from suboctave.harmonic.local_force import Curvature, coefficient_force
from suboctave.harmonic.perturbation import Kind, _as_waves, _toeplitz_apply
from suboctave.harmonic.rates import coefficient_rates
from suboctave.harmonic.second import Direction
from suboctave.harmonic.state import BalanceState


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
    size, basis, linear = state.balance.size, state.basis, state.linear
    v, f = _as_waves(right, kind, size, left=False)
    frequency = f * state.rate + (kappa if kind is Kind.FREE else 0.0)
    turned = [f / basis.nu * a.omega for a in directions]
    if kind is Kind.FREE and shifts is not None:
        turned = [by + shift for by, shift in zip(turned, shifts, strict=True)]
    forces = np.zeros((len(directions), len(f), size), dtype=complex)
    drive = np.zeros_like(v)
    for (group, _, stiffness, damping), bend, motion in zip(
        state.spectra, state.curvatures, state.motions, strict=True
    ):
        ve = v @ group.direction
        rate_ve = 1j * frequency * ve
        response = _toeplitz_apply(stiffness, ve)
        if damping.size:
            response = response + _toeplitz_apply(damping, rate_ve)
        drive += np.multiply.outer(response, group.direction)
        waves = _group_along(bend, motion, state, group.direction, ve, rate_ve, directions)
        for j, turn in enumerate(turned):
            if damping.size and turn.any():
                waves[j] += _toeplitz_apply(damping, 1j * turn * ve)
        forces += waves[:, :, None] * group.direction
    for nodal in state.nodal:
        drive += np.multiply.outer(nodal_second.operator_applied(nodal, v, frequency, _toeplitz_apply), nodal.own.out)
        for j, a in enumerate(directions):
            own = nodal_second.operator_along(nodal, v, frequency, turned[j], state.values, a, _toeplitz_apply)
            forces[j] += np.multiply.outer(own, nodal.own.out)
    for element, local in zip(state.balance.elements, state.local_motions, strict=True):
        for j, a in enumerate(directions):
            change = coefficient_rates(element, state.values, a.parameters)
            if change.any():
                d = linear.retain(element.direction(state.balance.system.n))
                c, ve = coefficient_force(local), v @ d
                part = _toeplitz_apply(change @ c.stiffness, ve)
                if c.damping is not None:
                    part = part + _toeplitz_apply(change @ c.damping, 1j * frequency * ve)
                forces[j] += np.multiply.outer(part, d)
    result = _with_linear(state, frequency, turned, directions, v, drive, forces)
    return np.stack([_as_rows(column, kind) for column in result], axis=1)


def _with_linear(
    state: BalanceState,
    frequency: np.ndarray,
    turned: list[np.ndarray],
    directions: Sequence[Direction],
    v: ComplexArray,
    drive: ComplexArray,
    forces: ComplexArray,
) -> ComplexArray:
    """The changes of the elements' forces seen through the linear part, and the changes of that."""
    linear = state.linear
    compliance = linear.compliance(frequency)
    result = forces if compliance is None else np.einsum("fij,dfj->dfi", compliance, forces)
    for order_one, vector in ((linear.stiffness(frequency, 1), v), (linear.compliance(frequency, 1), drive)):
        if order_one is not None:
            turning = np.einsum("fij,fj->fi", order_one, vector)
            for j, turn in enumerate(turned):
                result[j] += turn[:, None] * turning
    for j, a in enumerate(directions):
        for name, rate in a.parameters.items():
            for block, vector in (
                (linear.stiffness_by(frequency, (name,)), v),
                (linear.compliance_by(frequency, (name,)), drive),
            ):
                if block is not None:
                    result[j] += rate * np.einsum("fij,fj->fi", block, vector)
    return result


def _group_along(
    bend: Curvature,
    motion: ComplexArray,
    state: BalanceState,
    d: np.ndarray,
    ve: ComplexArray,
    rate_ve: ComplexArray,
    directions: Sequence[Direction],
) -> ComplexArray:
    """Waves of `f_uu u v + f_uv (w v + u v') + f_vv w v'` for each direction, (directions, F)."""
    out = np.zeros((len(directions), len(ve)), dtype=complex)
    if bend.zr.size == 0:
        return out
    # the common factor exp(i f_0 tau) of all waves cancels in the projection
    waves = kernels.polynomial(np.stack((ve, rate_ve)), bend.zr, bend.zi)
    by_u = bend.uu * waves[0] if bend.uv is None else bend.uu * waves[0] + bend.uv * waves[1]
    by_v = None if bend.uv is None or bend.vv is None else bend.uv * waves[0] + bend.vv * waves[1]
    for j, a in enumerate(directions):
        u, slope = kernels.motion(to_complex(a.x @ d), bend.zr, bend.zi)
        total = by_u * u
        if by_v is not None:
            turning = kernels.motion(motion, bend.zr, bend.zi)[1] / state.basis.nu if a.omega else 0.0
            total = total + by_v * (state.rate * slope + a.omega * turning)
        parts = kernels.spectra(np.stack((total.real, total.imag)), bend.zr, bend.zi, len(ve) - 1)
        out[j] = parts[0] + 1j * parts[1]
    return out


def _as_rows(waves: ComplexArray, kind: Kind) -> np.ndarray:
    """Amplitudes of waves (F, size) as rows of the operator: real coefficients, or the waves themselves."""
    if kind is Kind.FREE:
        return waves.ravel()
    middle = len(waves) // 2
    positive = waves[middle + (kind is Kind.INTEGER) :]
    rows = np.empty((2 * len(positive), waves.shape[1]))
    rows[::2], rows[1::2] = 2.0 * positive.real, -2.0 * positive.imag
    if kind is Kind.INTEGER:
        rows = np.concatenate((waves[middle : middle + 1].real, rows))
    return rows.ravel()
