"""Harmonic balance: the algebraic equations of a periodic motion, their Jacobian and parameter derivatives.

    R(X, omega, parameters) = A X + B S,    S = F(X, omega) - P(omega),

with A, B from the linear part (stiffness form: A = Z, B = I, so that `R = Z X + F - P`), F the Fourier coefficients
of the element forces (Galerkin projection) and P those of the loads. With `T(g)` the Galerkin matrix of a periodic
g(t),

    dF/dX = T(f_x) + T(f_v) omega D,    F_omega = T(f_v) D X.

`HarmonicBalance` holds what is fixed along a curve, `BalanceState` is one evaluated motion. Method: Cameron & Griffin,
J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time); the closed-form integrals are derived in `local_force`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis, spectrum_to_real, to_complex
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.loads import LoadSpectrum
from suboctave.harmonic.local_force import LocalForce, LocalMotion, local_force
from suboctave.harmonic.quadrature import samples_for
from suboctave.model.element import Element
from suboctave.model.sampling import AdaptiveSampling, Sampling
from suboctave.model.system import System

_NO_SPECTRUM = np.zeros(0, dtype=complex)


@dataclass(frozen=True)
class _Group:
    """Elements that act along the same direction: they share displacement, projection and Galerkin matrix."""

    direction: Array
    dofs: np.ndarray
    values: Array
    members: tuple[int, ...]


class HarmonicBalance:
    """Equations for the coefficients X of a system's periodic motion in a basis.

    Parameters
    ----------
    system
        What vibrates.
    basis
        Harmonics and period.
    values
        Parameter values, default those of the system.
    linear
        Linear part, default the system's own matrices.
    samples
        Frozen sample counts, one per element (`settle`), None where the element knows its rule.

    Notes
    -----
    X has shape (2 H + 1, size), or flattened; `size` is the number of unknown DOFs of the linear part.
    """

    def __init__(
        self,
        system: System,
        basis: HarmonicBasis,
        values: Mapping[str, float] | None = None,
        linear: LinearPart | None = None,
        samples: tuple[int | None, ...] | None = None,
    ) -> None:
        self.system = system
        self.basis = basis
        self.values = dict(system.parameters if values is None else values)
        self.linear: LinearPart = StructuralMatrices(system, self.values) if linear is None else linear
        self.size = self.linear.size
        self.dimension = self.size * basis.size
        self.samples = samples if samples is not None else (None,) * len(system.elements)
        self._matrix_names = system.mass.names | system.damping.names | system.stiffness.names
        self._groups = self._grouped()
        shapes = [self.linear.retain(c.direction) for c in system.load_components()]
        self.loads = LoadSpectrum(system, basis, shapes)
        self._load_cache: tuple[tuple, Array] | None = None
        self._load_names = {n for c in system.load_components() for n in c.amplitude.names | c.phase.names}
        self._coefficients: tuple[tuple, tuple[list[Array], list[Sampling]]] | None = None
        #: highest Fourier coefficient of the tangent that the integer and the half-odd basis need
        self.top = 2 * basis.harmonics + 1

    def _grouped(self) -> list[_Group]:
        found: dict[bytes, tuple[Array, list[int]]] = {}
        for i, element in enumerate(self.system.elements):
            d = np.asarray(self.linear.retain(element.direction(self.system.n)), dtype=float)
            found.setdefault(d.tobytes(), (d, []))[1].append(i)
        groups = []
        for d, members in found.values():
            dofs = np.flatnonzero(d)
            groups.append(_Group(d, dofs, d[dofs].copy(), tuple(members)))
        return groups

    @property
    def elements(self) -> tuple[Element, ...]:
        """The system's elements."""
        return self.system.elements

    def with_samples(self, samples: tuple[int | None, ...]) -> HarmonicBalance:
        """The same equations with other frozen sample counts."""
        if samples == self.samples:
            return self
        return HarmonicBalance(self.system, self.basis, self.values, self.linear, samples)

    def with_basis(self, basis: HarmonicBasis) -> HarmonicBalance:
        """The same equations in another basis."""
        if basis == self.basis:
            return self
        return HarmonicBalance(self.system, basis, self.values, self.linear, self.samples)

    @cached_property
    def _completed(self) -> HarmonicBalance:
        return self.with_basis(HarmonicBasis(self.top, self.basis.nu))

    def at(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> BalanceState:
        """Evaluate at coefficients x, frequency omega and, where given, other parameter values.

        Raises
        ------
        ConvergenceError
            If an element returns a force that is not finite.
        """
        used = self.values if values is None else values
        linear = self.linear
        if used is not self.values and any(used[n] != self.values[n] for n in self._matrix_names):
            linear = self.linear.rebuilt(used)
        return BalanceState(self, linear, np.asarray(x, float).reshape(self.basis.size, self.size), float(omega), used)

    def settle(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> HarmonicBalance:
        """These equations with sample counts chosen for a motion and frozen from here on."""
        if all(s is None for s in self.samples) and not self._blind:
            return self
        state = self.at(x, omega, values)
        samples = tuple(
            samples_for(local.element, local.motion, local.rate, local.coefficients, self.top)
            for local in state.local_motions
        )
        return self.with_samples(samples)

    @cached_property
    def _blind(self) -> bool:
        """True if an element tells nothing of its law."""
        return any(isinstance(kind, AdaptiveSampling) for kind in self.coefficients(self.values)[1])

    def load(self, values: Mapping[str, float], omega: float) -> Array:
        """Load coefficients P, shape (2 H + 1, size)."""
        key = tuple(omega if n == "omega" else values[n] for n in sorted(self._load_names))
        if self._load_cache is None or self._load_cache[0] != key:
            self._load_cache = (key, self.loads.value({**values, "omega": omega}, self.size))
        return self._load_cache[1]

    def coefficients(self, values: Mapping[str, float]) -> tuple[list[Array], list[Sampling]]:
        """Coefficient values of every element, and what it tells of its law at them."""
        key = tuple(values.values())
        if self._coefficients is None or self._coefficients[0] != key:
            numbers = [e.coefficient_values(values) for e in self.system.elements]
            kinds = [e.sampling(c) for e, c in zip(self.system.elements, numbers, strict=True)]
            self._coefficients = (key, (numbers, kinds))
        return self._coefficients[1]

    @cached_property
    def _scales(self) -> tuple[Array, Array]:
        mass = self.linear.equation_of_motion()[0]
        shapes = np.array([self.linear.expand(unit) for unit in np.eye(self.size)])
        mobility = np.einsum("ij,ji->i", shapes, np.linalg.solve(mass, shapes.T))
        if not np.all(mobility > 0.0):
            raise InputError("every unknown DOF needs a mass behind it")
        weight = 1.0 / np.sqrt(mobility)
        return weight, 1.0 / weight

    def scales(self) -> tuple[Array, Array]:
        """Weights of a coefficient of displacement and of a residual entry per DOF, `sqrt(m_i)` and its inverse.

        `m_i` is the mass that a DOF shows to a sudden force, `1 / (M^-1)_ii`. The weights make norms independent of
        the units of single DOFs. Shape (size,) each.
        """
        return self._scales


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
        result: list[LocalMotion | None] = [None] * len(self.balance.elements)
        coefficients, kinds = self.balance.coefficients(self.values)
        for group in self.balance._groups:
            motion = to_complex(self.x @ group.direction)
            for i in group.members:
                result[i] = LocalMotion(
                    self.balance.elements[i],
                    motion,
                    self.rate,
                    coefficients[i],
                    self.balance.top,
                    self.balance.samples[i],
                    kinds[i],
                )
        return result  # type: ignore[return-value]

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
    def spectra(self) -> list[tuple[_Group, ComplexArray, ComplexArray, ComplexArray]]:
        """Per direction: group, Fourier coefficients of force, stiffness, damping (empty if none)."""
        result = []
        for group in self.balance._groups:
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
        from suboctave.harmonic.second import force_by

        load = None
        if name in self.balance._load_names:
            load = -self.balance.loads.value({**self.values, "omega": self.omega}, self.balance.size, (name,))
        force = force_by(self, name)
        if force is None:
            return load
        return force if load is None else force + load

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
        balance, high = self.balance._completed, self.basis.harmonics
        x = self.basis.resized(self.x, balance.basis)
        x[2 * high + 1 :: 2] = self.neglected.real
        x[2 * high + 2 :: 2] = -self.neglected.imag
        return BalanceState(balance, self.linear, x, self.omega, self.values)

    def force_scale(self) -> float:
        """Size of the forces that balance, `|A X| + |F| + |P|` with residual weights: what a residual is compared
        with.
        """
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
