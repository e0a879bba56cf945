"""One evaluated motion: what harmonic balance says of it, each part computed when first asked for.

    R = A X + B S,    S = F(X, omega) - P(omega),    dF/dX = T(f_x) + T(f_v) omega D,    F_omega = T(f_v) D X

in the notation of `balance`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suboctave.errors import ConvergenceError
from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray, spectrum_to_real, to_complex
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.local_force import LocalForce, LocalMotion, coefficient_force, local_force
from suboctave.harmonic.rates import coefficient_rates

if TYPE_CHECKING:
    from suboctave.harmonic.balance import HarmonicBalance

_NO_SPECTRUM = np.zeros(0, dtype=complex)


@dataclass(frozen=True)
class Group:
    """Elements that act along the same direction: they share displacement, projection and Galerkin matrix."""

    direction: Array
    dofs: np.ndarray
    values: Array
    members: tuple[int, ...]


class BalanceState:
    """One evaluated motion: residual, Jacobian and derivatives, each computed when first asked for."""

    def __init__(
        self, balance: HarmonicBalance, linear: LinearPart, x: Array, omega: float, values: Mapping[str, float]
    ) -> None:
        self.balance = balance
        self.basis = balance.basis
        self.linear = linear
        self.x = x
        self.omega = omega
        self.values = values
        self.rate = omega / balance.basis.nu

    @cached_property
    def frequencies(self) -> Array:
        """Circular frequencies of the harmonics, shape (H + 1,)."""
        return self.basis.multiples * self.omega

    @cached_property
    def blocks(self) -> ComplexArray:
        """A at the harmonics, shape (H + 1, size, size)."""
        return self.linear.stiffness(self.frequencies)

    @cached_property
    def compliance(self) -> ComplexArray | None:
        """B at the harmonics, None for the identity."""
        return self.linear.compliance(self.frequencies)

    @cached_property
    def local_motions(self) -> list[LocalMotion]:
        """Every element's relative displacement, in the order of the system's elements."""
        balance = self.balance
        coefficients, kinds = balance.coefficients(self.values)
        motions: dict[int, ComplexArray] = {}
        for group in balance.groups:
            motions |= dict.fromkeys(group.members, to_complex(self.x @ group.direction))
        return [
            LocalMotion(element, motions[i], self.rate, coefficients[i], balance.top, balance.samples[i], kinds[i])
            for i, element in enumerate(balance.elements)
        ]

    @cached_property
    def element_forces(self) -> list[LocalForce]:
        """Force and tangent spectra of every element."""
        forces = [local_force(local) for local in self.local_motions]
        for element, force in zip(self.balance.elements, forces, strict=True):
            if not np.isfinite(force.force).all() or not np.isfinite(force.stiffness).all():
                raise ConvergenceError(
                    f"{element.label} returned a force that is not finite at omega = {self.omega:.6g} "
                    f"(largest coefficient of the motion {np.abs(self.x).max():.3g})"
                )
        return forces

    @cached_property
    def spectra(self) -> list[tuple[Group, ComplexArray, ComplexArray, ComplexArray]]:
        """Per direction: group, Fourier coefficients of force, stiffness, damping (empty if none)."""
        result = []
        for group in self.balance.groups:
            parts = [self.element_forces[i] for i in group.members]
            force, stiffness = parts[0].force, parts[0].stiffness
            for part in parts[1:]:
                force, stiffness = force + part.force, stiffness + part.stiffness
            damping = [p.damping for p in parts if p.damping.size]
            result.append((group, force, stiffness, np.sum(damping, axis=0) if damping else _NO_SPECTRUM))
        return result

    @cached_property
    def force(self) -> Array:
        """Element forces F, shape (2 H + 1, size)."""
        result = np.zeros_like(self.x)
        for group, force, _, _ in self.spectra:
            result += np.multiply.outer(spectrum_to_real(force, self.basis.harmonics), group.direction)
        return result

    @cached_property
    def unbalanced(self) -> Array:
        """S = F - P, shape (2 H + 1, size)."""
        return self.force - self.balance.load(self.values, self.omega)

    @cached_property
    def _linear_term(self) -> Array:
        """A X, shape (2 H + 1, size)."""
        return apply_blocks(self.blocks, self.x)

    @cached_property
    def residual(self) -> Array:
        """R, shape (dimension,)."""
        b = self.unbalanced if self.compliance is None else apply_blocks(self.compliance, self.unbalanced)
        return (self._linear_term + b).ravel()

    @cached_property
    def force_jacobian(self) -> Array:
        """dF/dX, shape (dimension, dimension)."""
        return self._tangent_matrix(mean=True)

    def _tangent_matrix(self, mean: bool) -> Array:
        """Galerkin matrix of the tangent in the integer (mean=True) or the half-odd basis."""
        size = self.balance.size
        harmonics = self.basis.harmonics
        count = 2 * harmonics + (1 if mean else 2)
        out = np.zeros((count * size, count * size))
        doubled = 2 * np.arange(harmonics + 1) + (0 if mean else 1)
        for group, _, stiffness, damping in self.spectra:
            matrix = kernels.galerkin(stiffness, damping, self.rate, doubled, doubled, mean, mean)
            kernels.add_element(out, matrix, group.dofs, group.values, group.dofs, group.values, size)
        return out

    @cached_property
    def jacobian(self) -> Array:
        """R_X, shape (dimension, dimension)."""
        return self._with_linear(self.force_jacobian.copy(), self.blocks, self.compliance, mean=True)

    @cached_property
    def half_jacobian(self) -> Array:
        """J_half: the same operator in the half-odd basis up to H + 1/2; singular at a period doubling."""
        frequencies = self.basis.half_multiples * self.omega
        return self._with_linear(
            self._tangent_matrix(mean=False),
            self.linear.stiffness(frequencies),
            self.linear.compliance(frequencies),
            mean=False,
        )

    @property
    def linear_jacobian(self) -> Array:
        """The part of R_X that stays without elements: A on the block diagonal."""
        return self._with_linear(np.zeros((self.balance.dimension,) * 2), self.blocks, None, mean=True)

    @staticmethod
    def _with_linear(tangent: Array, blocks: ComplexArray, compliance: ComplexArray | None, mean: bool) -> Array:
        if compliance is not None:
            expanded = np.zeros_like(tangent)
            kernels.add_linear(expanded, compliance, mean)
            tangent = expanded @ tangent
        kernels.add_linear(tangent, np.ascontiguousarray(blocks), mean)
        return tangent

    def residual_by(self, name: str) -> Array:
        """R differentiated by "omega" or a parameter, shape (dimension,)."""
        linear, freq = self.linear, self.frequencies
        if name == "omega":
            m = self.basis.multiples[:, None, None]
            result = apply_blocks(linear.stiffness(freq, 1) * m, self.x)
            slope = linear.compliance(freq, 1)
            if slope is not None:
                result += apply_blocks(slope * m, self.unbalanced)
        else:
            result = np.zeros_like(self.x)
            block = linear.stiffness_by(freq, (name,))
            if block is not None:
                result += apply_blocks(block, self.x)
            slope = linear.compliance_by(freq, (name,))
            if slope is not None:
                result += apply_blocks(slope, self.unbalanced)
        change = self.unbalanced_by(name)
        if change is not None:
            result += change if self.compliance is None else apply_blocks(self.compliance, change)
        return result.ravel()

    def unbalanced_by(self, name: str) -> Array | None:
        """S differentiated by "omega" or a parameter at fixed X, shape (2 H + 1, size); None if zero."""
        load = None
        if name in self.balance.load_names:
            load = -self.balance.loads.value({**self.values, "omega": self.omega}, self.balance.size, (name,))
        force = self._force_by(name)
        if force is None:
            return load
        return force if load is None else force + load

    def _force_by(self, name: str) -> Array | None:
        """Element forces differentiated by "omega" or a parameter at fixed X, shape (2 H + 1, size); None if zero."""
        parts: list[tuple[Array, Array]] = []
        if name == "omega":
            for group, _, _, damping in self.spectra:
                if damping.size:
                    slope = self.basis.derivative(self.x @ group.direction)
                    parts.append((self.toeplitz(damping) @ slope, group.direction))
        else:
            for element, local in zip(self.balance.elements, self.local_motions, strict=True):
                rates = coefficient_rates(element, self.values, {name: 1.0})
                if rates.any():
                    spectrum = (rates @ coefficient_force(local).force)[:, None]
                    direction = self.linear.retain(element.direction(self.balance.system.n))
                    parts.append((spectrum_to_real(spectrum, self.basis.harmonics)[:, 0], direction))
        if not parts:
            return None
        total = np.zeros_like(self.x)
        for part, direction in parts:
            total += np.multiply.outer(part, direction)
        return total

    def toeplitz(self, spectrum: ComplexArray) -> Array:
        """Galerkin matrix T(g) of a periodic function in the integer basis, from its Fourier coefficients."""
        doubled = 2 * np.arange(self.basis.harmonics + 1)
        return kernels.galerkin(spectrum, _NO_SPECTRUM, 0.0, doubled, doubled, True, True)

    @cached_property
    def neglected(self) -> ComplexArray:
        """Amplitudes of the harmonics H + 1 .. 2 H + 1 that the force on the motion would excite, shape (H + 1, size).

        To first order `x_k = -A(k w0)^-1 B(k w0) f_k`, f_k the harmonics of the element forces beyond the basis.
        """
        basis, size = self.basis, self.balance.size
        high = basis.harmonics
        force = np.zeros((high + 1, size), dtype=complex)
        for group, spectrum, _, _ in self.spectra:
            force += np.multiply.outer(2.0 * spectrum[high + 1 : 2 * high + 2], group.direction)
        frequency = np.arange(high + 1, 2 * high + 2) / basis.nu * self.omega
        compliance = self.linear.compliance(frequency)
        if compliance is not None:
            force = np.einsum("kij,kj->ki", compliance, force)
        blocks = self.linear.stiffness(frequency)
        motion = force / blocks[:, :, 0] if size == 1 else np.linalg.solve(blocks, force[:, :, None])[:, :, 0]
        return -motion.astype(complex, copy=False)

    @cached_property
    def completed(self) -> BalanceState:
        """The motion together with the harmonics it neglects, in the basis of 2 H + 1 harmonics.

        It solves the equations no better within the basis, but as a function of time it lies closer to the true motion.
        """
        balance, high = self.balance.completed, self.basis.harmonics
        x = self.basis.resized(self.x, balance.basis)
        x[2 * high + 1 :: 2] = self.neglected.real
        x[2 * high + 2 :: 2] = -self.neglected.imag
        return BalanceState(balance, self.linear, x, self.omega, self.values)

    def force_scale(self) -> float:
        """Size of the forces that balance, `|A X| + |F| + |P|` with residual weights: residuals are held against it."""
        weight = self.balance.scales()[1]
        parts = (self._linear_term, self.force, self.balance.load(self.values, self.omega))
        if self.compliance is not None:
            parts = (
                self._linear_term,
                apply_blocks(self.compliance, self.force),
                apply_blocks(self.compliance, parts[2]),
            )
        return sum(math.sqrt(np.vdot(q, q)) for q in (p * weight for p in parts))


def apply_blocks(blocks: ComplexArray, x: Array) -> Array:
    """Complex matrices per harmonic (H + 1, n, n) applied to real coefficients (2 H + 1, n)."""
    c = to_complex(x)
    y = np.matmul(blocks, c[:, :, None])[:, :, 0] if blocks.shape[1] > 1 else blocks[:, :, 0] * c
    result = np.empty_like(x)
    result[0] = y[0].real
    result[1::2] = y[1:].real
    result[2::2] = -y[1:].imag
    return result
