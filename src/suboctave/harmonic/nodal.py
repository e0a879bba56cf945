"""Elements that are integrated at nodes of their own: laws with corners, or sharp in velocity, or of several inputs.

A coupled element acts along d_out with `f(q, theta)`, q the displacements along its inputs d_i and their rates
(`model.coupled`); an element with one input is the case d_1 = d_out. Its force is a Fourier series like any other, and

    dF/dX = d_out sum_i [T(f_ui) + T(f_vi) omega D] d_i^T,    F_omega = d_out sum_i T(f_vi) D X_i.

Time is `theta = nu tau`: at fixed coefficients it does not change with omega. A force with corners has second
derivatives that are Dirac functions there, as those of a contact: `int f_uu h dtau` has the terms `[f_u] h / |du/dtau|`
at the instants at which the motion reaches a corner, with the jump `[f_u]`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic import instants, kernels
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.quadrature import FEWEST, Nodes, even, graded_nodes, search_grid, uniform_nodes
from suboctave.harmonic.rates import coefficient_rates, level_rates
from suboctave.lazy import lazy
from suboctave.model.coupled import as_coupled
from suboctave.model.element import BaseElement
from suboctave.model.sampling import (
    AdaptiveSampling,
    CornerSampling,
    PolynomialSampling,
    Sampling,
    SharpSampling,
    SharpVelocitySampling,
)

if TYPE_CHECKING:
    from suboctave.model.system import System

_NOTHING = np.zeros(0, dtype=complex)
_NO_INSTANTS = np.zeros(0)
#: Gauss-Legendre nodes on every panel between corners
_ORDER = 16
GAUSS = np.polynomial.legendre.leggauss(_ORDER)
#: most nodes of laws that do not tell how many they need, and the relative change at which these have settled
_MOST, _SETTLED = 1 << 15, 1e-11
#: how far on either side of a corner its jump is looked at, in units of the motion
BESIDE = 1e-9


class OwnElement:
    """An element with nodes of its own, in the unknown DOFs: where it acts and what it reads."""

    def __init__(self, element: BaseElement, index: int, system: System, linear: LinearPart) -> None:
        self.element, self.index = element, index
        self.law = as_coupled(element)
        self.out = np.asarray(linear.retain(element.direction(system.n)), dtype=float)
        self.ins = np.array([linear.retain(d) for d in self.law.inputs(system.n)], dtype=float)
        self.count = len(self.ins)
        self.moving = element.depends_on_velocity
        self.harmonic = self.law.time_harmonic
        self.out_packed = _packed(self.out)
        self.in_packed = [_packed(d) for d in self.ins]


def _packed(direction: Array) -> tuple[np.ndarray, Array]:
    dofs = np.flatnonzero(direction)
    return dofs, direction[dofs].copy()


@dataclass(frozen=True)
class Bend:
    """Second derivatives as weights (Q, Q, N) at instants `z = exp(i tau)`."""

    zr: Array
    zi: Array
    weights: Array


@dataclass(frozen=True)
class Comb:
    """Dirac functions at a corner: its number, its row of q, the instants and the weights `[f_q] / |dq/dtau|`."""

    number: int
    row: int
    zr: Array
    zi: Array
    weights: Array


class NodalForce:
    """One of these elements along a motion; each part is computed when first asked for.

    motions
        Complex coefficients (H + 1,) of its inputs.
    """

    def __init__(
        self,
        own: OwnElement,
        kind: Sampling,
        coefficients: Array,
        motions: list[ComplexArray],
        basis: HarmonicBasis,
        omega: float,
        top: int,
        samples: int | None,
    ) -> None:
        self.own, self.kind, self.c = own, kind, coefficients
        self.motions, self.basis, self.top, self.samples = motions, basis, top, samples
        self.rate = omega / basis.nu

    def reaching(self, top: int) -> NodalForce:
        """The same with Fourier coefficients up to `top`."""
        parts = (self.own, self.kind, self.c, self.motions, self.basis, self.rate * self.basis.nu)
        return NodalForce(*parts, top, self.samples)

    def state_at(self, zr: Array, zi: Array) -> tuple[Array, Array]:
        """q (Q, N) and theta (N,) at instants."""
        values = np.array([kernels.motion(motion, zr, zi) for motion in self.motions])
        q = np.concatenate((values[:, 0], self.rate * values[:, 1])) if self.own.moving else values[:, 0]
        theta = self.basis.nu * np.arctan2(zi, zr) if self.own.harmonic else np.zeros_like(zr)
        return np.ascontiguousarray(q), theta

    @lazy
    def nodes(self) -> Nodes:
        """Instants and weights chosen for the law."""
        kind, motion = self.kind, self.motions[0]
        high = motion.shape[0] - 1
        varying = self.own.harmonic * self.basis.nu
        if isinstance(kind, PolynomialSampling):
            return uniform_nodes(even(kind.degree * high + varying + self.top + 1))
        if isinstance(kind, SharpVelocitySampling):
            velocity = 1j * self.rate * np.arange(high + 1) * motion
            if not velocity.any():
                return uniform_nodes(even(2 * self.top + 2))
            return graded_nodes(velocity, np.array(kind.velocities), np.array(kind.widths), self.top)
        if isinstance(kind, SharpSampling):
            return graded_nodes(motion, np.array(kind.points), np.array(kind.widths), self.top)
        fewest = 1 << math.ceil(math.log2(2 * self.top + 2 + 2 * varying))
        count = max(self.samples or FEWEST, fewest)
        corners = self.corners
        if not len(corners):
            return uniform_nodes(count)
        # twice as many nodes are so between all corners: else those of one interval might seem to have settled
        return _between(corners, 2.0 * math.pi * _ORDER / fewest, count // fewest)

    @lazy
    def corner_rows(self) -> list[tuple[int, float, Array]]:
        """Row of q, place, instants at which the motion reaches it, for every corner of the law."""
        kind = self.kind
        if not isinstance(kind, CornerSampling):
            return []
        motion = self.motions[0]
        high = motion.shape[0] - 1
        grid = search_grid(high)
        velocity = 1j * self.rate * np.arange(high + 1) * motion
        found = []
        for row, series, levels in ((0, motion, kind.points), (self.own.count, velocity, kind.velocities)):
            for level in levels:
                # a velocity that is zero throughout rests in its corner
                resting = not series[1:].any()
                at = _NO_INSTANTS if resting else instants.crossings(series, float(level), grid.zr, grid.zi)[0]
                found.append((row, float(level), np.asarray(at)))
        return found

    @property
    def corners(self) -> Array:
        """Instants at which the motion reaches corners of the law, ascending."""
        return np.unique(np.concatenate([_NO_INSTANTS] + [at for _, _, at in self.corner_rows]))

    @lazy
    def path(self) -> tuple[Array, Array]:
        """q (Q, N) and theta (N,) at the nodes."""
        return self.state_at(self.nodes.zr, self.nodes.zi)

    @lazy
    def tangent(self) -> tuple[Array, Array]:
        """f (N,) and f_q (Q, N) at the nodes."""
        q, theta = self.path
        f, f_q = self.own.law.tangent(q, theta, self.c)
        if np.shape(f) != theta.shape or np.shape(f_q) != q.shape:
            raise InputError(
                f"{self.own.element.label}: tangent must return arrays of shape {theta.shape} and {q.shape}"
            )
        return f, f_q

    def project(self, values: Array) -> ComplexArray:
        """Fourier coefficients (..., top + 1) of functions given at the nodes (..., N)."""
        nodes = self.nodes
        flat = np.ascontiguousarray((values * nodes.weights).reshape(-1, len(nodes.weights)), dtype=float)
        spectra: ComplexArray = kernels.spectra(flat, nodes.zr, nodes.zi, self.top)
        return spectra.reshape(np.shape(values)[:-1] + (self.top + 1,))

    @lazy
    def spectra(self) -> ComplexArray:
        """Fourier coefficients of f and of f_q, (1 + Q, top + 1)."""
        f, f_q = self.tangent
        spectra = self.project(np.concatenate((f[None], f_q)))
        if not np.isfinite(spectra).all():
            raise ConvergenceError(
                f"{self.own.element.label} returned a force that is not finite (largest displacement "
                f"{np.abs(self.path[0][: self.own.count]).max():.3g})"
            )
        return spectra

    @property
    def force(self) -> ComplexArray:
        """Fourier coefficients of f, (top + 1,)."""
        return self.spectra[0]

    def stiffness(self, i: int) -> ComplexArray:
        """Fourier coefficients of f_ui."""
        return self.spectra[1 + i]

    def damping(self, i: int) -> ComplexArray:
        """Fourier coefficients of f_vi, empty for a law without velocity."""
        return self.spectra[1 + self.own.count + i] if self.own.moving else _NOTHING

    @lazy
    def by_coefficients(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Fourier coefficients of f_c (nc, top + 1), f_qc (nc, Q, top + 1), f_cc (nc, nc, top + 1)."""
        q, theta = self.path
        law = self.own.law
        f_c, f_qc = law.coefficient_tangent(q, theta, self.c)
        parts = self.project(f_c), self.project(f_qc), self.project(law.coefficient_curvature(q, theta, self.c))
        for comb in self._combs:
            # a corner that moves with a coefficient takes its Dirac function along
            spectrum = kernels.spectra(comb.weights[None], comb.zr, comb.zi, self.top)[0]
            rates = self._corner_rates[comb.number]
            parts[1][:, comb.row] -= np.multiply.outer(rates, spectrum)
            parts[2][:] += np.multiply.outer(np.multiply.outer(rates, rates), spectrum)
        return parts

    @lazy
    def _corner_rates(self) -> Array:
        """Derivatives of the corners' places by the coefficients, (corners, nc)."""
        return level_rates(self.own.element, self.c)

    @lazy
    def _combs(self) -> list[Comb]:
        """The jumps of the force's slope at every corner, as Dirac functions along the motion."""
        found = []
        for number, (row, level, at) in enumerate(self.corner_rows):
            if not len(at):
                continue
            zr, zi = np.cos(at), np.sin(at)
            there, phase = self.state_at(zr, zi)
            motion = self.motions[0]
            if row:
                motion = 1j * self.rate * np.arange(len(motion)) * motion
            rates = kernels.motion(motion, zr, zi)[1]
            # the rate is kept from zero where the motion only touches the corner
            weights = self.jump(row, level, there, phase) / np.maximum(np.abs(rates), 1e-12 * self.size(row))
            found.append(Comb(number, row, zr, zi, weights))
        return found

    def size(self, row: int) -> float:
        """Largest value that a row of q takes along the motion."""
        return float(np.abs(self.path[0][row]).max()) or 1.0

    def jump(self, row: int, level: float, q: Array, theta: Array) -> Array:
        """Jump of `f_r` where row r of q passes a corner; q (Q, N), theta (N,) at the instants of passing."""

        def across(distance: float) -> Array:
            sides = []
            for sign in (1.0, -1.0):
                there = q.copy()
                there[row] = level + sign * distance * self.size(row)
                sides.append(self.own.law.tangent(there, theta, self.c)[1][row])
            jump: Array = sides[0] - sides[1]
            return jump

        near = across(BESIDE)
        # half powers that begin at the corner are no jump
        return 2.0 * near - across(4.0 * BESIDE) if getattr(self.kind, "rough", False) else near

    @lazy
    def bend(self) -> Bend:
        """Second derivatives as weights at instants, those at corners included."""
        nodes = self.nodes
        q, theta = self.path
        parts = [(nodes.zr, nodes.zi, nodes.weights * self.own.law.curvature(q, theta, self.c))]
        for comb in self._combs:
            weights = np.zeros((len(q), len(q), len(comb.zr)))
            weights[comb.row, comb.row] = comb.weights
            parts.append((comb.zr, comb.zi, weights))
        zr, zi, weights = (np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True))
        return Bend(zr, zi, weights)

    def settled(self) -> int | None:
        """Number of nodes with which force and tangent have settled; None where the law knows its rule.

        Raises
        ------
        ConvergenceError
            If even 32768 do not suffice.
        """
        if not isinstance(self.kind, AdaptiveSampling | CornerSampling):
            return None
        count = max(FEWEST, 1 << math.ceil(math.log2(2 * self.top + 2)))
        previous: ComplexArray | None = None
        while count <= _MOST:
            parts = (self.own, self.kind, self.c, self.motions, self.basis, self.rate * self.basis.nu, self.top)
            current = NodalForce(*parts, count).spectra
            if previous is not None:
                size = np.maximum(np.abs(current).max(axis=1), np.finfo(float).tiny)
                if float((np.abs(current - previous).max(axis=1) / size).max()) < _SETTLED:
                    return count // 2
            previous, count = current, 2 * count
        raise ConvergenceError(
            f"{self.own.element.label}: the force does not settle with {_MOST} nodes per period: it is too sharp to be "
            "sampled blindly. Tell where its law is sharp or has corners (sampling), or use an element that does"
        )


def _between(corners: Array, longest: float, parts: int) -> Nodes:
    """Gauss-Legendre panels between neighbouring corners, `parts` for every one that is no longer than `longest`.

    Next to a corner instants run like the square of the variable, in which powers of one half are analytic too.
    """
    gaps = np.append(np.diff(corners), corners[0] + 2.0 * math.pi - corners[-1])
    pieces = parts * np.maximum(2, np.ceil(gaps / longest)).astype(np.int64)
    first = np.cumsum(pieces) - pieces
    whole = np.repeat(gaps / pieces, pieces)
    number = np.arange(len(whole)) - np.repeat(first, pieces)
    low = np.repeat(corners, pieces) + number * whole
    y, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    low, whole = low[:, None], whole[:, None]
    at, weights = np.tile(y, (len(whole), 1)), whole * share
    last = first + pieces - 1
    at[first], at[last] = y * y, 1.0 - (1.0 - y) ** 2
    weights[first] *= 2.0 * y
    weights[last] *= 2.0 * (1.0 - y)
    tau = low + whole * at
    return Nodes(np.cos(tau).ravel(), np.sin(tau).ravel(), weights.ravel())


def add_tangent(forces: list[NodalForce], out: Array, mean: bool, size: int) -> None:
    """Add these elements' part of dF/dX to `out`, in the integer basis (mean=True) or the half-odd one."""
    for force in forces:
        own, high = force.own, force.basis.harmonics
        doubled = 2 * np.arange(high + 1) + (0 if mean else 1)
        for i in range(own.count):
            matrix = kernels.galerkin(force.stiffness(i), force.damping(i), force.rate, doubled, doubled, mean, mean)
            kernels.add_element(out, matrix, *own.out_packed, *own.in_packed[i], size)


def own_elements(system: System, linear: LinearPart) -> list[OwnElement]:
    """Those of a system's elements that have nodes of their own."""
    return [OwnElement(e, i, system, linear) for i, e in enumerate(system.elements) if e.own_nodes]


def nodal_forces(
    owns: list[OwnElement],
    known: tuple[list[Array], list[Sampling]],
    samples: tuple[int | None, ...],
    amplitudes: ComplexArray,
    basis: HarmonicBasis,
    omega: float,
    top: int,
) -> list[NodalForce]:
    """These elements along a motion of complex amplitudes (H + 1, size); `known`: coefficients and kinds of all."""
    result = []
    for own in owns:
        motions = [np.ascontiguousarray(amplitudes @ d) for d in own.ins]
        i = own.index
        result.append(NodalForce(own, known[1][i], known[0][i], motions, basis, omega, top, samples[i]))
    return result


def rates_of(own: OwnElement, values: Mapping[str, float], name: str) -> Array | None:
    """First change of an element's coefficients with a parameter, (nc,); None if there is none."""
    rates = coefficient_rates(own.element, values, {name: 1.0})
    return rates if rates.any() else None
