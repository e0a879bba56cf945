"""Smoothness classes of element laws. The class decides the quadrature rule.

Those of one displacement that may be all of a law (`whole`) evaluate it: `tangent` (f and f_u), `curvature` and `third`
take u (N,) and the element's coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class PolynomialSampling:
    """A polynomial in `(u, v)` of this total degree: a uniform grid of enough samples integrates it exactly.

    A polynomial in u alone may tell its coefficients too, those of u^0, u^1, ..., u^degree (unit of the p-th: force /
    length^p): it is then evaluated without asking the element.
    """

    degree: int
    coefficients: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.coefficients is not None and len(self.coefficients) != self.degree + 1:
            raise InputError(
                f"a polynomial of degree {self.degree} has {self.degree + 1} coefficients, not {len(self.coefficients)}"
            )

    @property
    def whole(self) -> bool:
        """Whether its coefficients are given."""
        return self.coefficients is not None

    def _derivative(self, order: int, u: Array) -> Array:
        factors = [math.perm(p, order) * factor for p, factor in enumerate(self.coefficients or ())]
        *lower, top = factors[order:] or [0.0]
        value = np.full_like(u, top)
        for factor in reversed(lower):
            value = value * u + factor if factor else value * u
        return value

    def tangent(self, u: Array, c: Array) -> tuple[Array, Array]:
        """`f, f_u`."""
        return self._derivative(0, u), self._derivative(1, u)

    def curvature(self, u: Array, c: Array) -> Array:
        """`f_uu`."""
        return self._derivative(2, u)

    def third(self, u: Array, c: Array) -> Array:
        """`f_uuu`."""
        return self._derivative(3, u)


@dataclass(frozen=True)
class SharpSampling:
    """Analytic on the real axis, with complex singularities at `u = points[i] +- 1j * widths[i]` (unit: length).

    A law that is a sum of arctan steps of its stiffness may tell them: it is then evaluated without asking the element,

        f = constant + slope u + sum_i steps_i / pi [y_i atan(y_i / w_i) - w_i / 2 ln(1 + (y_i / w_i)^2)]

    with y_i = u - points_i, w_i = widths_i.

    constant
        Unit: force; `slope` and `steps` are stiffnesses.
    """

    points: tuple[float, ...]
    widths: tuple[float, ...]
    constant: float = 0.0
    slope: float = 0.0
    steps: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if len(self.points) != len(self.widths) or len(self.steps or self.points) != len(self.points):
            raise InputError("a sharp law has as many widths (and steps, if it tells them) as points")

    @property
    def whole(self) -> bool:
        """Whether its steps are given."""
        return self.steps is not None

    def tangent(self, u: Array, c: Array) -> tuple[Array, Array]:
        """`f, f_u`."""
        force, stiffness = self.constant + self.slope * u, np.full_like(u, self.slope)
        for ratio, width, step in self._steps(u):
            angle = step / math.pi * np.arctan(ratio)
            force += width * (ratio * angle - 0.5 * step / math.pi * np.log1p(ratio * ratio))
            stiffness += angle
        return force, stiffness

    def curvature(self, u: Array, c: Array) -> Array:
        """`f_uu`."""
        return sum((step / (math.pi * w * (1.0 + r * r)) for r, w, step in self._steps(u)), np.zeros_like(u))

    def third(self, u: Array, c: Array) -> Array:
        """`f_uuu`."""
        steps = self._steps(u)
        return sum((-2.0 * step * r / (math.pi * (w * (1.0 + r * r)) ** 2) for r, w, step in steps), np.zeros_like(u))

    def _steps(self, u: Array) -> list[tuple[Array, float, float]]:
        """y_i / w_i (N,), w_i and step of each."""
        numbers = zip(self.points, self.widths, self.steps or (), strict=True)
        return [((u - point) / width, width, step) for point, width, step in numbers]


@dataclass(frozen=True)
class Piece:
    """One half-line of a piecewise-linear law: indices of its stiffness and gap among the element's coefficients.

    Its force is `c[stiffness] * (u - c[gap])` where `side * (u - c[gap]) > 0` and zero elsewhere.
    """

    stiffness: int
    gap: int
    side: int


@dataclass(frozen=True)
class PiecewiseLinear:
    """The law is the sum of its pieces and nothing else, so that it can be integrated in closed form.

    Derivatives are their regular parts.
    """

    pieces: tuple[Piece, ...]
    whole = True

    def tangent(self, u: Array, c: Array) -> tuple[Array, Array]:
        """`f, f_u`."""
        force, stiffness = np.zeros_like(u), np.zeros_like(u)
        for piece in self.pieces:
            beyond = u - c[piece.gap]
            slope = c[piece.stiffness] * (piece.side * beyond > 0.0)
            force += slope * beyond
            stiffness += slope
        return force, stiffness

    def curvature(self, u: Array, c: Array) -> Array:
        """`f_uu`."""
        return np.zeros_like(u)

    third = curvature


@dataclass(frozen=True)
class AdaptiveSampling:
    """Nothing is known: samples are added until force and tangent stop moving."""

    whole = False


@dataclass(frozen=True)
class CornerSampling:
    """A continuous force that is smooth but for corners at `u = points[i]` and at `v = velocities[i]`.

    Only its derivatives may jump there. It is integrated between the instants at which a motion reaches these places,
    with as many nodes as force and tangent need to settle. For elements with `own_nodes`; of a coupled element, the
    places are those of its first input, and there may be corners where other functions of all that it reads vanish, so
    many `surfaces`, of which the element tells by `surface` (`CoupledElement.surface`). `rough`: powers of a half begin
    at a corner (contact after Hertz), of which none may be a surface.
    """

    points: tuple[float, ...] = ()
    velocities: tuple[float, ...] = ()
    rough: bool = False
    surfaces: int = 0
    whole = False

    def __post_init__(self) -> None:
        if self.rough and self.surfaces:
            raise InputError("powers of a half may begin at points and velocities, not at surfaces")


class Surface(NamedTuple):
    """A function of what a law reads, phi(q, theta; c), that vanishes where the law has a corner, at N states.

    value
        phi, (N,).
    normal, bend
        phi_q (Q, N) and phi_qq (Q, Q, N).
    by_phase, normal_by_phase
        phi_theta (N,) and phi_q theta (Q, N).
    by_coefficients
        phi_c, (nc, N).
    """

    value: Array
    normal: Array
    bend: Array
    by_phase: Array
    normal_by_phase: Array
    by_coefficients: Array


@dataclass(frozen=True)
class SharpVelocitySampling:
    """Analytic on the real axis, with complex singularities at `v = velocities[i] +- 1j * widths[i]` (length / time).

    For elements with `own_nodes`: nodes are graded towards the instants at which the velocity passes there; of a
    coupled element it is that of its first input. `degree`: of the polynomial in `(u, v)` that multiplies sharp steps.
    """

    velocities: tuple[float, ...]
    widths: tuple[float, ...]
    degree: int = 0
    whole = False

    def __post_init__(self) -> None:
        if len(self.widths) != len(self.velocities):
            raise InputError("a sharp law has as many widths as velocities")


#: classes that may be all of a law of one displacement
WholeLaw: TypeAlias = PolynomialSampling | SharpSampling | PiecewiseLinear
Sampling: TypeAlias = WholeLaw | AdaptiveSampling | CornerSampling | SharpVelocitySampling


def widths_of(kind: Sampling) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Over which displacements, and over which velocities, a sharp law changes."""
    sharp, slow = (kind.widths if isinstance(kind, one) else () for one in (SharpSampling, SharpVelocitySampling))
    return sharp, slow


def switches(sampling: Sampling, c: Array) -> list[tuple[float, int, float | None]]:
    """Displacements at which a law changes or is sharp: (place, side, stiffness of the piece beyond it).

    A piece acts while `side (u - place) > 0`; without a stiffness the law is smooth but for the place itself.
    """
    if isinstance(sampling, PiecewiseLinear):
        return [(float(c[piece.gap]), piece.side, float(c[piece.stiffness])) for piece in sampling.pieces]
    if isinstance(sampling, SharpSampling | CornerSampling):
        return [(float(place), 1, None) for place in sampling.points]
    return []


def levels(kind: Sampling, coefficients: Array) -> tuple[float, ...]:
    """Displacements at which a law has a corner, or is sharp, at these coefficients."""
    return tuple(place for place, _, _ in switches(kind, coefficients))
