"""Forces that depend on velocity: quadratic damping, smoothed dry friction."""

from __future__ import annotations

import math
from collections.abc import Mapping

from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, Dof
from suboctave.model.elements.smoothness import CornerSampling, SharpVelocitySampling
from suboctave.model.elements.written import WrittenElement
from suboctave.model.expressions.coefficients import Number
from suboctave.model.matrices import warn_of_negative


class _Damper(WrittenElement):
    """A force of the velocity alone; its first coefficient is its size."""

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
    text = "coefficient*v*abs(v)"

    def __init__(
        self, dof: Dof | None = None, coefficient: Number | None = None, *, direction: ArrayLike | None = None
    ) -> None:
        super().__init__(dof, [coefficient], direction=direction)

    def sampling(self, c: Array) -> CornerSampling:
        """Corner at rest."""
        return CornerSampling(velocities=(0.0,))


#: velocity of smoothing below which squares of its inverse leave the range of floats
_SLOWEST = 1e-100


class TanhFriction(_Damper):
    """`f = force * tanh(v / velocity)`: dry friction, smoothed over the velocity given. Units: force, velocity.

    There is no sticking: what would stick creeps with a velocity below `velocity`. The smaller that is, the closer to
    dry friction; nodes are graded towards the reversals, so that their number grows like its logarithm only.
    """

    coefficient_names = ("force", "velocity")
    text = "force*tanh(v/velocity)"

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

    def sampling(self, c: Array) -> SharpVelocitySampling:
        """Poles of tanh at `v = +- i pi / 2 velocity`."""
        return SharpVelocitySampling((0.0,), (0.5 * math.pi * float(c[1]),))
