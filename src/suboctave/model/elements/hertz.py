"""Contact of curved bodies after Hertz, with the dissipation of Hunt and Crossley."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, Dof, Element, required
from suboctave.model.elements.batch_form import BatchForm, WrittenForm
from suboctave.model.elements.smoothness import CornerSampling
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.matrices import warn_of_negative

Number = float | str | Coefficient
_SIDES = {"right": 1.0, "left": -1.0}


class HertzContact(Element):
    """`f = stiffness * y^(3/2) * (1 + damping * y')`, `y = u - gap` the indentation: a ball on a plane, a gear tooth.

    Nothing where y is negative; `side="left"` is the mirror image, `y = gap - u`. Units: force / length^(3/2), length,
    time / length (of Hunt and Crossley: 3/2 of the loss of restitution per impact velocity). Exact, integrated between
    the instants at which the contact closes and opens. Above y' = -1 / damping, which no impact reaches, it pushes.

    Hunt & Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Applied Mechanics 42, 1975.
    """

    coefficient_names = ("damping", "gap", "stiffness")
    depends_on_velocity = True
    own_nodes = True

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

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Say when a system is made that contact feeds energy into motions, or attracts."""
        if first and min(self.coefficient_values(values)[[0, 2]]) < 0.0:
            warn_of_negative(f"{self.label} feeds energy into motions")

    def batch_form(self, c: Array) -> BatchForm:
        from suboctave.model.expressions.law import law_of

        right, left = "stiffness*max(x-gap, 0)**1.5*(1+damping*v)", "-stiffness*max(gap-x, 0)**1.5*(1-damping*v)"
        return WrittenForm(law_of(right if self.side == "right" else left, ("x",), True, self.label))

    def sampling(self, c: Array) -> CornerSampling:
        """A power of a half begins at the gap."""
        return CornerSampling(points=(float(c[1]),), rough=True)

    def _parts(self, u: Array, v: Array, c: Array) -> tuple[float, Array, Array, Array, Array]:
        """Direction, indentation, its root and one over that (0 outside of contact), and `1 + damping y'`."""
        sign = _SIDES[self.side]
        y = np.maximum(sign * (u - c[1]), 0.0)
        root = np.sqrt(y)
        inverse = np.divide(1.0, root, out=np.zeros_like(root), where=root > 0.0)
        return sign, y, root, inverse, 1.0 + sign * c[0] * v

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        sign, y, root, _, rate = self._parts(u, v, c)
        return sign * c[2] * y * root * rate, 1.5 * c[2] * root * rate, c[0] * c[2] * y * root

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        sign, _, root, inverse, rate = self._parts(u, v, c)
        return 0.75 * sign * c[2] * inverse * rate, 1.5 * sign * c[0] * c[2] * root, np.zeros_like(u)

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array, Array]:
        _, _, _, inverse, rate = self._parts(u, v, c)
        zero = np.zeros_like(u)
        return -0.375 * c[2] * inverse**3 * rate, 0.75 * c[0] * c[2] * inverse, zero, zero

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        sign, y, root, inverse, rate = self._parts(u, v, c)
        f_c = [c[2] * y * root * v, -1.5 * c[2] * root * rate, sign * y * root * rate]
        f_uc = [1.5 * sign * c[2] * root * v, -0.75 * sign * c[2] * inverse * rate, 1.5 * root * rate]
        f_vc = [c[2] * y * root, -1.5 * sign * c[0] * c[2] * root, c[0] * y * root]
        return np.array(f_c), np.array(f_uc), np.array(f_vc)

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        sign, y, root, inverse, rate = self._parts(u, v, c)
        zero = np.zeros_like(u)
        dg, dk, gk = -1.5 * sign * c[2] * root * v, y * root * v, -1.5 * root * rate
        return np.array([[zero, dg, dk], [dg, 0.75 * sign * c[2] * inverse * rate, gk], [dk, gk, zero]])
