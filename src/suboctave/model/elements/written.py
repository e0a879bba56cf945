"""Laws of one displacement and its rate that one line of text says, with all their derivatives: drag, smoothed dry
friction, and contact of curved bodies after Hertz, with the dissipation of Hunt and Crossley.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, Dof, Element, required
from suboctave.model.elements.batch_form import BatchForm
from suboctave.model.elements.smoothness import CornerSampling, SharpVelocitySampling
from suboctave.model.expressions.coefficients import Number
from suboctave.model.matrices import warn_of_negative

if TYPE_CHECKING:
    from suboctave.model.expressions.law import Law

_SIDES = ("right", "left")
#: velocity of smoothing below which squares of its inverse leave the range of floats
_SLOWEST = 1e-100


class WrittenElement(Element):
    """A force along one direction whose law is a text in x, its rate v and the coefficients.

    SymPy differentiates it when it is first evaluated. A subclass gives `text` and `sampling`, and in `dissipative` the
    names of the coefficients that feed energy into motions if they are negative.
    """

    depends_on_velocity = True
    own_nodes = True
    dissipative: tuple[str, ...] = ()

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse what is no law; say when a system is made that it is driven instead of damped."""
        self._refuse(values)
        named = zip(self.coefficient_names, self.coefficients, strict=True)
        if first and any(name in self.dissipative and c.value(values) < 0.0 for name, c in named):
            warn_of_negative(f"{self.label} feeds energy into motions")

    def _refuse(self, values: Mapping[str, float]) -> None:
        """Refuse coefficients at which there is no law."""

    @property
    @abstractmethod
    def text(self) -> str:
        """The law, such as "coefficient*v*abs(v)"."""

    @property
    def law(self) -> Law:
        """Compiled once per process."""
        from suboctave.model.expressions.law import law_of

        return law_of(self.text, ("x",), True, type(self).__name__, self.coefficient_names)

    def batch_form(self, c: Array) -> BatchForm:
        return self.law.batch_form

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        f, (f_u, f_v) = self.law.tangent(np.array([u, v]), np.zeros_like(u), c)
        return f, f_u, f_v

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        """See `Element.curvature`; at corners the regular part."""
        f_qq = self.law.curvature(np.array([u, v]), np.zeros_like(u), c)
        return f_qq[0, 0], f_qq[0, 1], f_qq[1, 1]

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array, Array]:
        """See `Element.third`; at corners the regular part."""
        f_qqq = self.law.third(np.array([u, v]), np.zeros_like(u), c)
        return f_qqq[0, 0, 0], f_qqq[0, 0, 1], f_qqq[0, 1, 1], f_qqq[1, 1, 1]

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        f_c, f_qc = self.law.coefficient_tangent(np.array([u, v]), np.zeros_like(u), c)
        return f_c, f_qc[:, 0], f_qc[:, 1]

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        return self.law.coefficient_curvature(np.array([u, v]), np.zeros_like(u), c)


class QuadraticDamper(WrittenElement):
    """`f = coefficient * v |v|`: drag of a fluid, turbulent orifice. Unit: force / velocity^2.

    Dissipates `8/3 coefficient omega^2 a^3` per cycle of a motion `a cos(omega t)`. Exact: its corner at v = 0 lies
    between nodes.
    """

    glyph = "damper"
    coefficient_names = ("coefficient",)
    dissipative = coefficient_names
    text = "coefficient*v*abs(v)"

    def __init__(
        self, dof: Dof | None = None, coefficient: Number | None = None, *, direction: ArrayLike | None = None
    ) -> None:
        super().__init__(dof, [coefficient], direction=direction)

    def sampling(self, c: Array) -> CornerSampling:
        """Corner at rest."""
        return CornerSampling(velocities=(0.0,))


class TanhFriction(WrittenElement):
    """`f = force * tanh(v / velocity)`: dry friction, smoothed over the velocity given. Units: force, velocity.

    There is no sticking: what would stick creeps with a velocity below `velocity`. The smaller that is, the closer to
    dry friction; nodes are graded towards the reversals, so that their number grows like its logarithm only.
    """

    glyph = "friction"
    coefficient_names = ("force", "velocity")
    dissipative = ("force",)
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
            self._refuse({})

    def _refuse(self, values: Mapping[str, float]) -> None:
        v = self.coefficients[1].value(values)
        if v <= 0.0:
            raise InputError(f"{self.label}: velocity must be positive (smaller is closer to dry friction), not {v:g}")
        if v < _SLOWEST:
            raise InputError(
                f"{self.label}: velocity={v:g} is below {_SLOWEST:g}: choose units in which it is nearer to 1"
            )

    def sampling(self, c: Array) -> SharpVelocitySampling:
        """Poles of tanh at `v = +- i pi / 2 velocity`."""
        return SharpVelocitySampling((0.0,), (0.5 * math.pi * float(c[1]),))


class HertzContact(WrittenElement):
    """`f = stiffness * y^(3/2) * (1 + damping * y')`, `y = u - gap` the indentation: a ball on a plane, a gear tooth.

    Nothing where y is negative; `side="left"` is the mirror image, `y = gap - u`. Units: force / length^(3/2), length,
    time / length (of Hunt and Crossley: 3/2 of the loss of restitution per impact velocity). Exact, integrated between
    the instants at which the contact closes and opens. Above y' = -1 / damping, which no impact reaches, it pushes.

    Hunt & Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Applied Mechanics 42, 1975.
    """

    glyph = "stop"
    coefficient_names = ("damping", "gap", "stiffness")
    dissipative = ("damping", "stiffness")

    def __init__(
        self,
        dof: Dof | None = None,
        stiffness: Number | None = None,
        gap: Number | None = None,
        damping: Number = 0.0,
        side: Literal["right", "left"] = "right",
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("HertzContact", stiffness=stiffness, gap=gap)
        if side not in _SIDES:
            raise InputError(f"HertzContact: side is 'right' or 'left', not {side!r}{suggest(str(side), _SIDES)}")
        self.side = side
        super().__init__(dof, [damping, gap, stiffness], direction=direction)

    @property
    def text(self) -> str:
        if self.side == "right":
            return "stiffness*max(x-gap, 0)**1.5*(1+damping*v)"
        return "-stiffness*max(gap-x, 0)**1.5*(1-damping*v)"

    def sampling(self, c: Array) -> CornerSampling:
        """A power of a half begins at the gap."""
        return CornerSampling(points=(float(c[1]),), rough=True)
