"""One evaluated motion: what harmonic balance says of it, each part computed when first asked for.

    R = A X + B S,    S = F(X, omega) - P(omega),    dF/dX = T(f_x) + T(f_v) omega D,    F_omega = T(f_v) D X

in the notation of `balance`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suboctave.harmonic import evaluation, group_kernels, kernels
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis, spectrum_to_real, to_complex
from suboctave.harmonic.changes import changes_by
from suboctave.harmonic.closed_bends import ClosedBends, closed_bends
from suboctave.harmonic.group_force import Group, PackedLaws, curvature_of
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices, apply_blocks
from suboctave.harmonic.local_force import Curvature, LocalMotion
from suboctave.harmonic.neglected import completed_coefficients, excited
from suboctave.harmonic.nodal import NodalForce, add_tangent, nodal_forces
from suboctave.harmonic.nodal_second import force_by
from suboctave.harmonic.quadrature import graded_motion
from suboctave.lazy import lazy

if TYPE_CHECKING:
    from suboctave.harmonic.balance import HarmonicBalance

_NO_SPECTRUM = np.zeros(0, dtype=complex)


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

    @lazy
    def frequencies(self) -> Array:
        """Circular frequencies of the harmonics, shape (H + 1,)."""
        return self.basis.multiples * self.omega

    @lazy
    def blocks(self) -> ComplexArray:
        """A at the harmonics, shape (H + 1, size, size)."""
        return self.linear.stiffness(self.frequencies)

    @lazy
    def compliance(self) -> ComplexArray | None:
        """B at the harmonics, None for the identity."""
        if isinstance(self.linear, StructuralMatrices):
            return None
        return self.linear.compliance(self.frequencies)

    @lazy
    def packed(self) -> tuple[PackedLaws, Array]:
        """The laws along all directions as arrays, and points on the circle for their polynomials, (2, N)."""
        return self.balance.packed_laws(self.values)

    @lazy
    def motions(self) -> ComplexArray:
        """Complex coefficients of the displacement along each group's direction, (G, H + 1)."""
        found = np.empty((len(self.balance.groups), self.basis.harmonics + 1), dtype=complex)
        evaluation.along_directions(self.x, *self.balance.directions, found)
        return found

    @lazy
    def local_motions(self) -> list[LocalMotion]:
        """Every element's relative displacement, in the order of the system's elements."""
        balance = self.balance
        coefficients, kinds, _ = balance.coefficients(self.values)
        motions: dict[int, ComplexArray] = {}
        for group, motion in zip(balance.groups, self.motions, strict=True):
            motions |= dict.fromkeys(group.members, motion)
        return [
            LocalMotion(element, motions[i], self.rate, coefficients[i], balance.top, balance.samples[i], kinds[i])
            for i, element in enumerate(balance.elements)
        ]

    def local(self, index: int) -> LocalMotion:
        """The relative displacement of one of the system's elements (the first input, where it has several)."""
        if index < len(self.balance.elements):
            return self.local_motions[index]
        nodal = next(nodal for nodal in self.nodal if nodal.own.index == index)
        element, top = nodal.own.element, self.balance.top
        return LocalMotion(element, nodal.motions[0], self.rate, nodal.c, top, nodal.samples, nodal.kind)

    @lazy
    def nodal(self) -> list[NodalForce]:
        """The elements with nodes of their own, along the motion."""
        balance = self.balance
        if not balance.own:
            return []
        known = balance.coefficients(self.values)[:2]
        amplitudes = to_complex(self.x)
        return nodal_forces(balance.own, known, balance.samples, amplitudes, self.basis, self.omega, balance.top)

    @lazy
    def closed_bends(self) -> list[list[ClosedBends]]:
        """Second and third derivatives of every group's laws that are known in closed form."""
        laws, top = self.balance.coefficients(self.values)[2], self.balance.top
        return [
            closed_bends(law, motion, top, partial(self.told_nodes, g))
            for g, (law, motion) in enumerate(zip(laws, self.motions, strict=True))
        ]

    def told_nodes(self, g: int) -> Array:
        """The nodes of the arctan steps along a direction with the motion there (`quadrature.graded_motion`)."""
        known: tuple[int, Array] | None = self.__dict__.get("_told_nodes")
        if known is not None and known[0] == g:
            return known[1]
        law = self.balance.coefficients(self.values)[2][g]
        return graded_motion(self.motions[g], *law.told_places, self.balance.top, moving=False)

    @lazy
    def curvatures(self) -> list[Curvature]:
        """Second derivatives of every group's force, as weights at instants."""
        balance = self.balance
        laws = balance.coefficients(self.values)[2]
        return [
            curvature_of(law, closed, balance.elements, balance.samples, motion, self.rate, balance.top)
            for law, closed, motion in zip(laws, self.closed_bends, self.motions, strict=True)
        ]

    @lazy
    def spectra_table(self) -> ComplexArray:
        """Fourier coefficients 0 .. top of force, stiffness, damping along each group's direction, (3, G, top + 1)."""
        return self._evaluated[0]

    @lazy
    def _evaluated(self) -> tuple[ComplexArray, Array, Array]:
        """`spectra_table` and both of `_parts` without elements that have nodes of their own."""
        return evaluation.evaluated(self)

    @lazy
    def spectra(self) -> list[tuple[Group, ComplexArray, ComplexArray, ComplexArray]]:
        """Per direction: group, Fourier coefficients of force, stiffness, damping (empty if none)."""
        table, moving = self.spectra_table, self.balance.moving
        return [
            (group, table[0, g], table[1, g], table[2, g] if moving[g] else _NO_SPECTRUM)
            for g, group in enumerate(self.balance.groups)
        ]

    @lazy
    def _parts(self) -> tuple[Array, Array]:
        """A X, F, `A X + F - P`, and the sizes of the latter, A X, F and P with residual weights."""
        _, parts, sizes = self._evaluated
        if self.nodal:
            parts, sizes = self._with_nodal(parts, sizes)
        return (parts, sizes) if self.basis.kept is None else self._kept_only(parts, sizes)

    def _with_nodal(self, parts: Array, sizes: Array) -> tuple[Array, Array]:
        """The same with the elements that have nodes of their own."""
        for nodal in self.nodal:
            force = spectrum_to_real(nodal.force[:, None], self.basis.harmonics)[:, 0]
            parts[1:] += np.multiply.outer(force, nodal.own.out)
        weight = self.balance.scales()[1]
        sizes[0], sizes[2] = length(parts[2] * weight), length(parts[1] * weight)
        return parts, sizes

    def _kept_only(self, parts: Array, sizes: Array) -> tuple[Array, Array]:
        """The same without the equations of harmonics that are left out: nothing balances the force there."""
        out = self.basis.left_out
        parts[2][2 * out - 1] = 0.0
        parts[2][2 * out] = 0.0
        sizes[0] = length(parts[2] * self.balance.scales()[1])
        return parts, sizes

    @property
    def unknowns(self) -> Array:
        """Coefficients of the harmonics that are kept, shape (dimension,)."""
        return self.balance.packed(self.x)

    @property
    def force(self) -> Array:
        """Element forces F, shape (2 H + 1, size)."""
        return self._parts[0][1]

    @lazy
    def unbalanced(self) -> Array:
        """S = F - P, shape (2 H + 1, size)."""
        return self.force - self.balance.load(self.values, self.omega)

    @lazy
    def residual(self) -> Array:
        """R, shape (dimension,)."""
        if self.compliance is None:
            return self.balance.packed(self._parts[0][2])
        return self.balance.packed(self._parts[0][0] + apply_blocks(self.compliance, self.unbalanced))

    @lazy
    def force_jacobian(self) -> Array:
        """dF/dX for all harmonics up to H, square, with size (2 H + 1) rows."""
        return self._tangent_matrix(mean=True)

    def _tangent_matrix(self, mean: bool) -> Array:
        """Galerkin matrix of the tangent in the integer (mean=True) or the half-odd basis."""
        balance, table = self.balance, self.spectra_table
        rows = balance.size * (2 * self.basis.harmonics + (1 if mean else 2))
        out = np.zeros((rows, rows))
        group_kernels.tangent_matrix(
            out, table[1], table[2], balance.moving, self.rate, mean, *balance.directions, balance.size
        )
        add_tangent(self.nodal, out, mean, balance.size)
        return out

    @lazy
    def jacobian(self) -> Array:
        """R_X, shape (dimension, dimension)."""
        if isinstance(self.linear, StructuralMatrices):
            return self._restricted(evaluation.structural_jacobian(self, self.linear.matrices, mean=True))
        return self._restricted(
            self._with_linear(self._tangent_matrix(mean=True), self.blocks, self.compliance, mean=True)
        )

    def _restricted(self, matrix: Array) -> Array:
        """Rows and columns of the harmonics that are kept."""
        entries = self.balance.entries
        return matrix if entries is None else matrix[np.ix_(entries, entries)]

    def extended_jacobian(self, name: str) -> Array:
        """`[R_X R_name]`, shape (dimension, dimension + 1); name is "omega" or a parameter."""
        known = "jacobian" in self.__dict__
        if known or not isinstance(self.linear, StructuralMatrices) or self.basis.kept is not None:
            out = np.column_stack((self.jacobian, np.zeros(self.balance.dimension)))
            out[:, -1] = self.residual_by(name)
            return out
        out = evaluation.structural_jacobian(self, self.linear.matrices, mean=True, columns=1)
        if name != "omega":
            out[:, -1] = self.residual_by(name)
        elif not self.balance.steady:
            change = self.unbalanced_by(name)
            if change is not None:
                out[:, -1] += change.ravel()
        return out

    @lazy
    def half_jacobian(self) -> Array:
        """J_half: the same operator in the half-odd basis up to H + 1/2; singular at a period doubling."""
        if isinstance(self.linear, StructuralMatrices):
            return evaluation.structural_jacobian(self, self.linear.matrices, mean=False)
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
        return self.block_diagonal(self.blocks)

    def block_diagonal(self, blocks: ComplexArray) -> Array:
        """A linear operator given by its blocks (H + 1, size, size), one a harmonic, in the unknowns, as R_X is."""
        return self._restricted(self._with_linear(np.zeros((self.x.size,) * 2), blocks, None, mean=True))

    @staticmethod
    def _with_linear(tangent: Array, blocks: ComplexArray, compliance: ComplexArray | None, mean: bool) -> Array:
        if compliance is not None:
            expanded = np.zeros_like(tangent)
            kernels.add_linear(expanded, compliance, mean)
            tangent = expanded @ tangent
        kernels.add_linear(tangent, blocks, mean)
        return tangent

    def residual_by(self, name: str) -> Array:
        """R differentiated by "omega" or a parameter, shape (dimension,)."""
        linear, freq = self.linear, self.frequencies
        if name == "omega":
            m = self.basis.multiples
            result: Array = group_kernels.apply_scaled(linear.stiffness(freq, 1), m, self.x)
            slope = linear.compliance(freq, 1)
            if slope is not None:
                result += group_kernels.apply_scaled(slope, m, self.unbalanced)
        else:
            result = np.zeros(self.x.shape)
            if name in self.balance.matrix_names:
                block = linear.stiffness_by(freq, (name,))
                if block is not None:
                    result += apply_blocks(block, self.x)
                slope = linear.compliance_by(freq, (name,))
                if slope is not None:
                    result += apply_blocks(slope, self.unbalanced)
        change = self.unbalanced_by(name)
        if change is not None:
            result += change if self.compliance is None else apply_blocks(self.compliance, change)
        return self.balance.packed(result)

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
        total: Array | None = None
        if name == "omega":
            for group, _, _, damping in self.spectra if self.balance.any_moving else ():
                if damping.size:
                    slope = self.basis.derivative(self.x @ group.direction)
                    parts.append((self.toeplitz(damping) @ slope, group.direction))
        else:
            for group, by_name in changes_by(self, name):
                total = np.zeros(self.x.shape) if total is None else total
                group_kernels.add_along(by_name.force, group.dofs, group.values, total)
        for nodal in self.nodal:
            change = force_by(nodal, self.x, self.values, name)
            if change is not None:
                parts.append((change, nodal.own.out))
        for part, direction in parts:
            total = np.zeros(self.x.shape) if total is None else total
            total += np.multiply.outer(part, direction)
        return total

    def toeplitz(self, spectrum: ComplexArray) -> Array:
        """Galerkin matrix T(g) of a periodic function in the integer basis, from its Fourier coefficients."""
        doubled = 2 * np.arange(self.basis.harmonics + 1)
        return kernels.galerkin(spectrum, _NO_SPECTRUM, 0.0, doubled, doubled, True, True)

    @lazy
    def neglected(self) -> ComplexArray:
        """Amplitudes of the harmonics H + 1 .. 2 H + 1 that the force on the motion would excite, shape (H + 1, size).

        To first order `x_k = -A(k w0)^-1 B(k w0) f_k`, f_k the harmonics of the element forces beyond the basis.
        """
        balance, linear = self.balance, self.linear
        if balance.size == 1 and isinstance(linear, StructuralMatrices) and not self.nodal:
            found = np.empty((self.basis.harmonics + 1, 1), dtype=complex)
            evaluation.neglected_of_one(
                self.spectra_table[0], balance.directions[2], balance.beyond, self.omega, linear.matrices, found
            )
            return found
        return excited(self, np.arange(self.basis.harmonics + 1, self.balance.top + 1))

    @lazy
    def left_out(self) -> ComplexArray:
        """The same of the harmonics below H that the basis leaves out, shape (len(basis.left_out), size)."""
        return excited(self, self.basis.left_out)

    @lazy
    def tails(self) -> tuple[Array, float]:
        """Size of all harmonics above k relative to the motion, k = 0 .. 2 H + 1, and the motion's size."""
        tail = np.empty(2 * self.basis.harmonics + 2)
        return tail, float(group_kernels.tails(self.x, self.neglected, self.balance.scales()[0], tail))

    @lazy
    def completed(self) -> BalanceState:
        """The motion together with the harmonics it neglects, in the basis of 2 H + 1 harmonics.

        It solves the equations no better within the basis, but as a function of time it lies closer to the true motion.
        """
        return BalanceState(self.balance.completed, self.linear, self.completed_x[1], self.omega, self.values)

    @lazy
    def completed_x(self) -> tuple[HarmonicBasis, Array]:
        """The basis of 2 H + 1 harmonics, and the coefficients of the completed motion in it."""
        return completed_coefficients(self)

    def force_scale(self) -> float:
        """Size of the forces that balance, `|A X| + |F| + |P|` with residual weights: residuals are held against it."""
        sizes = self._parts[1]
        if self.compliance is None:
            _, linear, force, load = sizes.tolist()
            return float(linear + force + load)
        weight = self.balance.scales()[1]
        load = self.balance.load(self.values, self.omega)
        return float(sizes[1]) + sum(
            length(apply_blocks(self.compliance, part) * weight) for part in (self.force, load)
        )

    def residual_size(self) -> float:
        """Size of R with residual weights."""
        if self.compliance is None:
            return float(self._parts[1][0])
        return length(self.residual.reshape(-1, self.balance.size) * self.balance.scales()[1])


def length(vector: Array) -> float:
    """Euclidean norm of all entries."""
    flat = vector.ravel()
    return math.sqrt(flat.dot(flat))
