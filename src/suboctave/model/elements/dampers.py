"""Forces that depend on velocity: quadratic damping, smoothed dry friction."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, Dof, Element
from suboctave.model.elements.batch_form import BatchForm, QuadraticForm, TanhForm
from suboctave.model.elements.smoothness import CornerSampling, SharpVelocitySampling
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.matrices import warn_of_negative

Number = float | str | Coefficient


class _Damper(Element):
    """A force of the velocity alone, integrated at nodes of its own; its first coefficient is its size."""

    depends_on_velocity = True
    own_nodes = True

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Say when a system is made that it is driven instead of damped."""
        if first and self.coefficients[0].value(values) < 0.0:
            warn_of_negative(f"{self.label} feeds energy into motions")


class QuadraticDamper(_Damper):
    """`f = coefficient * v |v|`: drag of a fluid, turbulent orifice. Unit: force / velocity^2.

    Dissipates `8/3 coefficient omega^2 a^3` per cycle of a motion `a cos(omega t)`. Exact: its corner at v = 0 lies
    between nodes.
    """

    coefficient_names = ("coefficient",)

    def __init__(
        self, dof: Dof | None = None, coefficient: Number | None = None, *, direction: ArrayLike | None = None
    ) -> None:
        super().__init__(dof, [coefficient], direction=direction)

    def batch_form(self, c: Array) -> BatchForm:
        return QuadraticForm()

    def sampling(self, c: Array) -> CornerSampling:
        """Corner at rest."""
        return CornerSampling(velocities=(0.0,))

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        rate = c[0] * np.abs(v)
        return rate * v, np.zeros_like(u), 2.0 * rate

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        zero = np.zeros_like(u)
        return zero, zero, 2.0 * c[0] * np.sign(v)

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array, Array]:
        """The regular part, which is zero (`f_vv` jumps by `4 coefficient` at v = 0)."""
        zero = np.zeros_like(u)
        return zero, zero, zero, zero

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        size = np.abs(v)
        return (size * v)[None], np.zeros((1, len(u))), 2.0 * size[None]

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """Zero: the force is linear in its coefficient."""
        return np.zeros((1, 1, len(u)))


#: velocity of smoothing below which squares of its inverse leave the range of floats
_SLOWEST = 1e-100


class TanhFriction(_Damper):
    """`f = force * tanh(v / velocity)`: dry friction, smoothed over the velocity given. Units: force, velocity.

    There is no sticking: what would stick creeps with a velocity below `velocity`. The smaller that is, the closer to
    dry friction; nodes are graded towards the reversals, so that their number grows like its logarithm only.
    """

    coefficient_names = ("force", "velocity")

    def __init__(
        self,
        dof: Dof | None = None,
        force: Number | None = None,
        velocity: Number | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        super().__init__(dof, [force, velocity], direction=direction)
        if self.coefficients[1].constant:
            self._check_velocity(self.coefficients[1].value({}))

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse a velocity that is not positive; say when a system is made that friction drives."""
        super().check(values, first)
        self._check_velocity(self.coefficients[1].value(values))

    def _check_velocity(self, v: float) -> None:
        if v <= 0.0:
            raise InputError(f"{self.label}: velocity must be positive (smaller is closer to dry friction), not {v:g}")
        if v < _SLOWEST:
            raise InputError(
                f"{self.label}: velocity={v:g} is below {_SLOWEST:g}: choose units in which it is nearer to 1"
            )

    def batch_form(self, c: Array) -> BatchForm:
        return TanhForm()

    def sampling(self, c: Array) -> SharpVelocitySampling:
        """Poles of tanh at `v = +- i pi / 2 velocity`."""
        return SharpVelocitySampling((0.0,), (0.5 * math.pi * float(c[1]),))

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        t = np.tanh(v / c[1])
        return c[0] * t, np.zeros_like(u), c[0] / c[1] * (1.0 - t * t)

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        t, zero = np.tanh(v / c[1]), np.zeros_like(u)
        return zero, zero, -2.0 * c[0] / c[1] ** 2 * t * (1.0 - t * t)

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array, Array]:
        t, zero = np.tanh(v / c[1]), np.zeros_like(u)
        s = 1.0 - t * t
        return zero, zero, zero, c[0] / c[1] ** 3 * s * (4.0 * t * t - 2.0 * s)

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        force, v0 = c
        y = v / v0
        t = np.tanh(y)
        s = 1.0 - t * t
        f_c = np.array([t, -force / v0 * s * y])
        return f_c, np.zeros((2, len(u))), np.array([s / v0, force / v0**2 * s * (2.0 * t * y - 1.0)])

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        force, v0 = c
        y = v / v0
        t = np.tanh(y)
        s = 1.0 - t * t
        mixed = -s * y / v0
        return np.array([[np.zeros_like(u), mixed], [mixed, 2.0 * force / v0**2 * s * y * (1.0 - t * y)]])
