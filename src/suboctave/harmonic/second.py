"""Directional derivatives of the harmonic-balance equations, analytic, to second order.

A direction is a change of the coefficients together with changes of omega and of parameters. With `v = omega D u`,
the change of an element's velocity along a direction a is `v_a = omega D u_a + omega_a D u`, and to second order
`v_ab = omega_a D u_b + omega_b D u_a`; hence

    F''[a, b] = < f_uu u_a u_b + f_uv (u_a v_b + v_a u_b) + f_vv v_a v_b + f_v v_ab >  + terms with the element's
    coefficients, R''[a, b] = A''[a, b] X + A'[a] X_b + A'[b] X_a + B''[a, b] S + B'[a] S'[b] + B'[b] S'[a] + B S''[a,
    b].

For piecewise-linear laws `f_uu` is a Dirac comb at the crossings of the gap: the integrals become boundary terms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray, spectrum_to_real, to_complex
from suboctave.harmonic.local_force import Curvature, LocalMotion, coefficient_force
from suboctave.harmonic.nodal_second import second as nodal_second
from suboctave.harmonic.rates import coefficient_curvature, coefficient_rates
from suboctave.harmonic.state import BalanceState, apply_blocks


@dataclass(frozen=True)
class Direction:
    """A direction in which motion, omega and parameters change.

    x
        Change of the coefficients, shape (2 H + 1, size).
    rates
        Changes of "omega" and of parameters, by name; absent means zero.
    """

    x: Array
    rates: Mapping[str, float] = field(default_factory=dict)

    @property
    def omega(self) -> float:
        """Change of omega."""
        return self.rates.get("omega", 0.0)

    @property
    def parameters(self) -> dict[str, float]:
        """Changes of the parameters that are not zero."""
        return {k: r for k, r in self.rates.items() if k != "omega" and r != 0.0}


def unbalanced_along(state: BalanceState, a: Direction) -> Array:
    """S'[a], shape (2 H + 1, size)."""
    result = (state.force_jacobian @ a.x.ravel()).reshape(a.x.shape)
    for name, rate in a.rates.items():
        if rate != 0.0:
            change = state.unbalanced_by(name)
            if change is not None:
                result = result + rate * change
    return result


def unbalanced_second(state: BalanceState, a: Direction, b: Direction) -> Array:
    """S''[a, b], shape (2 H + 1, size)."""
    result = np.zeros_like(state.x)
    for (group, _, _, damping), bend, motion in zip(state.spectra, state.curvatures, state.motions, strict=True):
        result += np.multiply.outer(_group_second(state, group.direction, damping, bend, motion, a, b), group.direction)
    for element, local in zip(state.balance.elements, state.local_motions, strict=True):
        rates_a = coefficient_rates(element, state.values, a.parameters)
        rates_b = coefficient_rates(element, state.values, b.parameters)
        if rates_a.any() or rates_b.any():
            d = state.linear.retain(element.direction(state.balance.system.n))
            result += np.multiply.outer(_coefficient_second(state, local, a, b, rates_a, rates_b, d), d)
    for nodal in state.nodal:
        result += np.multiply.outer(nodal_second(nodal, state.x, state.values, a, b), nodal.own.out)
    for first, one in a.rates.items():
        for second, two in b.rates.items():
            if one * two != 0.0:
                values = {**state.values, "omega": state.omega}
                result -= one * two * state.balance.loads.value(values, state.balance.size, (first, second))
    return result


def _group_second(
    state: BalanceState,
    d: Array,
    damping: ComplexArray,
    bend: Curvature,
    motion: ComplexArray,
    a: Direction,
    b: Direction,
) -> Array:
    """F''[a, b] of the elements along a direction at fixed coefficients, shape (2 H + 1,)."""
    basis, high = state.basis, state.basis.harmonics
    ua, ub = a.x @ d, b.x @ d
    x_a, dx_a = kernels.motion(to_complex(ua), bend.zr, bend.zi)
    x_b, dx_b = kernels.motion(to_complex(ub), bend.zr, bend.zi)
    total = bend.uu * x_a * x_b
    if bend.uv is not None and bend.vv is not None:
        slope = kernels.motion(motion, bend.zr, bend.zi)[1] / basis.nu
        v_a = state.rate * dx_a + a.omega * slope
        v_b = state.rate * dx_b + b.omega * slope
        total = total + bend.uv * (x_a * v_b + v_a * x_b) + bend.vv * v_a * v_b
    result = spectrum_to_real(kernels.spectra(total[None, :], bend.zr, bend.zi, high).T, high)[:, 0]
    if damping.size and (a.omega or b.omega):
        result += state.toeplitz(damping) @ basis.derivative(a.omega * ub + b.omega * ua)
    return result


def _coefficient_second(
    state: BalanceState, local: LocalMotion, a: Direction, b: Direction, rates_a: Array, rates_b: Array, d: Array
) -> Array:
    """What changes of an element's coefficients add to F''[a, b], along its direction, shape (2 H + 1,)."""
    basis, high = state.basis, state.basis.harmonics
    u, ua, ub = state.x @ d, a.x @ d, b.x @ d
    by = coefficient_force(local)
    result = np.zeros(basis.size)
    for rates, other, omega in ((rates_a, ub, b.omega), (rates_b, ua, a.omega)):
        if not rates.any():
            continue
        result += state.toeplitz(rates @ by.stiffness) @ other
        if by.damping is not None:
            change = local.rate * basis.nu * basis.derivative(other) + omega * basis.derivative(u)
            result += state.toeplitz(rates @ by.damping) @ change
    spectrum = np.einsum("i,j,ijq->q", rates_a, rates_b, by.curvature)
    element = local.element
    spectrum = spectrum + coefficient_curvature(element, state.values, a.parameters, b.parameters) @ by.force
    return result + spectrum_to_real(spectrum[:, None], high)[:, 0]


def _linear_change(state: BalanceState, a: Direction, compliance: bool) -> ComplexArray | None:
    """A'[a] or B'[a] per harmonic, None if zero."""
    linear, freq = state.linear, state.frequencies
    by = linear.compliance_by if compliance else linear.stiffness_by
    plain = linear.compliance if compliance else linear.stiffness
    total = None
    if a.omega:
        slope = plain(freq, 1)
        if slope is not None:
            total = a.omega * state.basis.multiples[:, None, None] * slope
    for name, rate in a.parameters.items():
        block = by(freq, (name,))
        if block is not None:
            total = rate * block if total is None else total + rate * block
    return total


def _linear_second(state: BalanceState, a: Direction, b: Direction, compliance: bool) -> ComplexArray | None:
    """A''[a, b] or B''[a, b] per harmonic, None if zero."""
    linear, freq = state.linear, state.frequencies
    m = state.basis.multiples[:, None, None]
    by = linear.compliance_by if compliance else linear.stiffness_by
    plain = linear.compliance if compliance else linear.stiffness
    total = None

    def add(block: ComplexArray | None, factor: float | Array) -> None:
        nonlocal total
        if block is not None:
            total = factor * block if total is None else total + factor * block

    if a.omega and b.omega:
        add(plain(freq, 2), a.omega * b.omega * m**2)
    for one, other in ((a, b), (b, a)):
        if one.omega:
            for name, rate in other.parameters.items():
                add(by(freq, (name,), 1), one.omega * rate * m)
    for first, rate in a.parameters.items():
        for second, other_rate in b.parameters.items():
            add(by(freq, (first, second)), rate * other_rate)
    return total


def second_derivative(state: BalanceState, a: Direction, b: Direction) -> Array:
    """R''[a, b], shape (dimension,)."""
    result = np.zeros_like(state.x)
    for block, vector in (
        (_linear_second(state, a, b, False), state.x),
        (_linear_change(state, a, False), b.x),
        (_linear_change(state, b, False), a.x),
    ):
        if block is not None:
            result += apply_blocks(block, vector)
    s_ab = unbalanced_second(state, a, b)
    if state.compliance is None:
        return state.balance.packed(result + s_ab)
    result += apply_blocks(state.compliance, s_ab)
    second = _linear_second(state, a, b, True)
    if second is not None:
        result += apply_blocks(second, state.unbalanced)
    for one, other in ((a, b), (b, a)):
        block = _linear_change(state, one, True)
        if block is not None:
            result += apply_blocks(block, unbalanced_along(state, other))
    return state.balance.packed(result)
