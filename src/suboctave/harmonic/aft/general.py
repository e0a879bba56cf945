"""Laws that are asked at nodes: of several inputs, of time, with corners, sharp, smooth: all but piecewise-linear ones.

A coupled element acts along d_out with `f(q, theta)` (`model.elements.coupled`); an element with one input is the case
d_1 = d_out. Time is `theta = nu tau`: at fixed coefficients it does not change with omega. A force with corners has
derivatives that are Dirac functions there, as those of a contact: see `corners`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from suboctave.errors import ConvergenceError, InputError, NotFiniteError
from suboctave.harmonic.aft.corners import Comb, Corner, by_coefficients, combs, corners_along, finite_part, third_at
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.aft.poles import POINTS, unbounded
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import (
    FEWEST,
    GAUSS,
    MOST,
    Nodes,
    between_corners,
    graded_nodes,
    polynomial_nodes,
    uniform_nodes,
)
from suboctave.harmonic.trigonometric import motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    CornerSampling,
    PolynomialSampling,
    SharpSampling,
    SharpVelocitySampling,
    Surface,
)

__all__ = ["GeneralLaw", "Smoothness"]

#: how far beyond a motion, as a share of its size, the place is looked for that makes its force too sharp for samples
_BEYOND = 0.1


class Smoothness(NamedTuple):
    """How smooth a law is: whether powers of a half begin at its corners; places and widths of its singularities in
    velocity; whether it is sharp at all; its degree, if it is a polynomial, or 0; whether it is smooth only between
    corners; whether all that is unknown.
    """

    rough: bool = False
    sharp_velocities: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    sharp: bool = False
    degree: int = 0
    cornered: bool = False
    unknown: bool = False


class GeneralLaw(LawAlong):
    """Elements along a motion whose laws are of one smoothness class; those with corners, and all that read several
    displacements, time or a velocity in which they are sharp, come alone.
    """

    def __init__(self, along: Along, members: Sequence[Member], nodes: Nodes | None = None) -> None:
        super().__init__(along, members)
        self._given = nodes
        _, self.element, self.kind, self.c, _ = members[0]
        self.count = len(along.motions)
        self.moving = self.element.depends_on_velocity
        self.harmonic = 0 if self.kind.whole else as_coupled(self.element).time_harmonic

    @property
    def samples(self) -> int:
        """Number of samples of laws of unknown smoothness."""
        return max(member.samples or FEWEST for member in self.members)

    @property
    def smoothness(self) -> Smoothness:
        """How smooth the laws are, in numbers."""
        kind = self.kind
        if isinstance(kind, CornerSampling):
            return Smoothness(kind.rough, cornered=True)
        if isinstance(kind, SharpVelocitySampling):
            return Smoothness(sharp_velocities=(kind.velocities, kind.widths), sharp=True, degree=1 + kind.degree)
        if isinstance(kind, PolynomialSampling):
            return Smoothness(degree=self._degree)
        return Smoothness(sharp=isinstance(kind, SharpSampling), unknown=isinstance(kind, AdaptiveSampling))

    @property
    def _degree(self) -> int:
        return max([m.kind.degree for m in self.members if isinstance(m.kind, PolynomialSampling)], default=0)

    def state_at(self, zr: Array, zi: Array) -> tuple[Array, Array]:
        """q (Q', N) and theta (N,) at instants."""
        along = self.along
        values = [motion(one, zr, zi) for one in along.motions]
        q = np.array([u for u, _ in values] + [along.rate * v for _, v in values if self.moving])
        return q, along.nu * np.arctan2(zi, zr) if self.harmonic else np.zeros_like(zr)

    @lazy
    def nodes(self) -> Nodes:
        """Instants and weights chosen for the law, if none were given."""
        if self._given is not None:
            return self._given
        kind, along = self.kind, self.along
        varying = self.harmonic * along.nu
        if isinstance(kind, PolynomialSampling):
            return polynomial_nodes(self._degree * along.high + varying, along.top)
        if isinstance(kind, SharpVelocitySampling):
            highest = along.top + kind.degree * along.high
            if not self.velocity.any():
                return polynomial_nodes(highest + 1, along.top)
            return graded_nodes(self.velocity, np.array(kind.velocities), np.array(kind.widths), highest)
        if isinstance(kind, SharpSampling):
            sharp = [m.kind for m in self.members if isinstance(m.kind, SharpSampling)]
            points, widths = (
                np.concatenate(parts) for parts in zip(*[(k.points, k.widths) for k in sharp], strict=True)
            )
            return graded_nodes(along.motion, points, widths, along.top)
        fewest = 1 << math.ceil(math.log2(2 * along.top + 2 + 2 * varying))
        count = max(self.samples, fewest)
        corners = np.unique(
            np.mod(np.concatenate([np.zeros(0), *(corner.at for corner in self.corners)]), 2.0 * math.pi)
        )
        if not len(corners):
            return uniform_nodes(count)
        # twice as many nodes are so between all corners: else those of one interval might seem to have settled
        return between_corners(corners, 2.0 * math.pi * len(GAUSS[0]) / fewest, count // fewest)

    @lazy
    def velocity(self) -> ComplexArray:
        """Complex coefficients of the first input's rate, (H + 1,)."""
        series: ComplexArray = 1j * self.along.rate * np.arange(self.along.high + 1) * self.along.motion
        return series

    @lazy
    def corners(self) -> list[Corner]:
        """Every corner of the law."""
        return corners_along(self)

    def surface(self, which: int, q: Array, theta: Array) -> Surface:
        """What the function of a surface at which the law has corners does at states."""
        return as_coupled(self.element).surface(which, q, theta, self.c)

    def surface_slopes(self, which: int, q: Array, theta: Array) -> tuple[Array, Array, Array]:
        """That function with its first derivatives by the state and the phase."""
        return as_coupled(self.element).surface_slopes(which, q, theta, self.c)

    @lazy
    def path(self) -> tuple[Array, Array]:
        """q (Q', N) and theta (N,) at the nodes."""
        return self.state_at(self.nodes.zr, self.nodes.zi)

    def project(self, values: Array) -> ComplexArray:
        """Fourier coefficients (..., top + 1) of functions given at the nodes (..., N)."""
        nodes, top = self.nodes, self.along.top
        flat = np.ascontiguousarray(np.reshape(values, (-1, len(nodes.weights))), dtype=float)
        coefficients: ComplexArray = spectra(flat, nodes.weights, nodes.zr, nodes.zi, top)
        return coefficients.reshape(np.shape(values)[:-1] + (top + 1,))

    def tangent(self, q: Array, theta: Array) -> tuple[Array, Array]:
        """f (N,) and f_q (Q', N) at states."""
        force, slopes = np.zeros_like(theta), np.zeros_like(q)
        for member in self.members:
            f, f_q = as_coupled(member.element).tangent(q, theta, member.coefficients)
            if np.shape(f) != theta.shape or np.shape(f_q) != q.shape:
                label = member.element.label
                raise InputError(f"{label}: tangent must return arrays of shape {theta.shape} and {q.shape}")
            force += f
            slopes += f_q
        return force, slopes

    def curvature(self, q: Array, theta: Array) -> Array:
        """f_qq (Q', Q', N) at states, its regular part."""
        parts = [as_coupled(m.element).curvature(q, theta, m.coefficients) for m in self.members]
        return sum(parts[1:], parts[0])

    def third_derivative(self, q: Array, theta: Array) -> Array:
        """f_qqq (Q', Q', Q', N) at states, its regular part."""
        parts = [as_coupled(m.element).third(q, theta, m.coefficients) for m in self.members]
        return sum(parts[1:], parts[0])

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        f, f_q = self.tangent(*self.path)
        out[: 1 + len(f_q)] += self.project(np.concatenate((f[None], f_q)))

    def by_coefficients(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.by_coefficients`."""
        law = as_coupled(member.element)
        f_c, f_qc = law.coefficient_tangent(*self.path, member.coefficients)
        f_cc = law.coefficient_curvature(*self.path, member.coefficients)
        derivatives = CoefficientSpectra(self.project(f_c), self.project(f_qc), self.project(f_cc))
        for comb, by in self._moving_combs:
            normal = comb.surface.normal
            derivatives.tangent[:, : len(normal)] += self._at_corner(comb, np.einsum("cn,rn->crn", by, normal))
            derivatives.curvature[:] += self._at_corner(comb, np.einsum("cn,dn->cdn", by, by))
        return derivatives

    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        changed = [member for member in self.members if member.number in rates]
        if not changed:
            return
        q, theta = self.path
        total = np.zeros((1 + len(q), len(theta)))
        for member in changed:
            rate, law = rates[member.number], as_coupled(member.element)
            f_c, f_qc = law.coefficient_tangent(q, theta, member.coefficients)
            total[0] += rate @ f_c
            total[1:] += (rate @ f_qc.reshape(len(rate), -1)).reshape(q.shape)
        out[: len(total)] += self.project(total)
        for comb, by in self._moving_combs:
            moved = rates[self.members[0].number] @ by
            out[1 : 1 + len(q)] += self._at_corner(comb, moved * comb.surface.normal)

    def _at_corner(self, comb: Comb, values: Array) -> ComplexArray:
        """Fourier coefficients (..., top + 1) of the Dirac functions of a corner times values (..., N) there."""
        flat, top = np.ascontiguousarray(values.reshape(-1, len(comb.zr))), self.along.top
        coefficients: ComplexArray = spectra(flat, comb.weights, comb.zr, comb.zi, top)
        return coefficients.reshape((*values.shape[:-1], top + 1))

    @lazy
    def _combs(self) -> list[Comb]:
        return combs(self)

    @lazy
    def _moving_combs(self) -> list[tuple[Comb, Array]]:
        """Those with phi_c."""
        return [part for comb in self._combs for part in by_coefficients(self, comb)]

    def by_state_and_coefficients(self, q: Array, theta: Array) -> Array:
        """`f_q` and `f_c` of the one law with corners, (Q + nc, N)."""
        law = as_coupled(self.element)
        return np.concatenate((law.tangent(q, theta, self.c)[1], law.coefficient_tangent(q, theta, self.c)[0]))

    @property
    def rough(self) -> bool:
        """Whether powers of a half begin at its corners."""
        return isinstance(self.kind, CornerSampling) and self.kind.rough

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        nodes = self.nodes
        parts = [Second(nodes.zr, nodes.zi, nodes.weights * self.curvature(*self.path))]
        for comb in self._combs:
            normal = comb.surface.normal
            parts.append(Second(comb.zr, comb.zi, np.einsum("an,bn,n->abn", normal, normal, comb.weights)))
        return parts

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        nodes = self.nodes
        parts = [Third(nodes.zr, nodes.zi, nodes.weights * self.third_derivative(*self.path), None)]
        for corner in self.corners:
            if len(corner.at):
                parts.append(third_at(self, corner))
                if self.rough:
                    parts.append(finite_part(self, corner))
        return parts

    def settled_samples(self, member: Member, settled: Callable[[ComplexArray, ComplexArray], bool]) -> int | None:
        """See `LawAlong.settled_samples`.

        Raises
        ------
        ConvergenceError
            If even 32768 do not suffice.
        """
        if not isinstance(member.kind, AdaptiveSampling | CornerSampling):
            return None
        along = self.along
        count = max(FEWEST, 1 << math.ceil(math.log2(2 * along.top + 2)))
        previous: ComplexArray | None = None
        while count <= MOST:
            current = np.zeros((1 + along.size, along.top + 1), dtype=complex)
            law = GeneralLaw(along, [member._replace(samples=count)])
            # the same at all numbers
            vars(law)["corners"] = self.corners
            law.add_spectra(current)
            if previous is not None and settled(previous, current):
                return count // 2
            previous, count = current, 2 * count
        self._require_room(member)
        raise ConvergenceError(
            f"{member.element.label}: {MOST} samples per period do not resolve the force, it is too sharp. Write it as "
            "an Expression with abs, max, tanh or atan, use ElasticStop, Freeplay or TanhFriction, or return "
            "SharpSampling(points, widths) or CornerSampling from `sampling` of your class"
        )

    def unbounded_at(self, member: Member) -> float | None:
        """A displacement, along the first input, at which the force of one of its elements is not finite on the motion;
        None if it is finite all along.
        """

        def force(tau: Array) -> Array:
            return force_of(member, *self.state_at(np.cos(tau), np.sin(tau)))

        tau = unbounded(force, np.linspace(0.0, 2.0 * np.pi, max(FEWEST, 4 * self.along.high) + 1))
        return None if tau is None else float(self.state_at(np.cos([tau]), np.sin([tau]))[0][0, 0])

    def _require_room(self, member: Member) -> None:
        """Refuse a motion whose force is so sharp because it is not finite there, or right beyond; NotFiniteError."""
        place, near = self.unbounded_at(member), ""
        if place is None:
            q, theta = self.path
            slopes = np.abs(as_coupled(member.element).tangent(q, theta, member.coefficients)[1]).max(axis=0)
            at = int(np.argmax(np.where(np.isfinite(slopes), slopes, np.inf)))
            way = _BEYOND * (q[:, at] - q.mean(axis=1))

            def force(share: Array) -> Array:
                beyond = q[:, at, None] + way[:, None] * share
                return force_of(member, beyond, np.full(len(share), theta[at]))

            share = unbounded(force, np.linspace(0.0, 1.0, POINTS))
            if share is None:
                return
            place = float(q[0, at] + share * way[0])
            near = f", and the motion comes closer to that than {MOST} samples per period show"
        raise NotFiniteError(f"{not_finite(member, place)}{near}")


def force_of(member: Member, q: Array, theta: Array) -> Array:
    """The force of an element at states, finite or not."""
    return np.asarray(as_coupled(member.element).tangent(q, theta, member.coefficients)[0], dtype=float)


def not_finite(member: Member, place: float) -> str:
    """That the force of an element is not finite at a displacement."""
    return f"the force of {member.element.label} is not finite (at a displacement of {place:.6g})"
