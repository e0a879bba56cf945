"""Contact of curved bodies after Hertz, with the dissipation of Hunt and Crossley."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, Dof, required
from suboctave.model.elements.smoothness import CornerSampling
from suboctave.model.elements.written import WrittenElement
from suboctave.model.expressions.coefficients import Number
from suboctave.model.matrices import warn_of_negative

_SIDES = ("right", "left")


class HertzContact(WrittenElement):
    """`f = stiffness * y^(3/2) * (1 + damping * y')`, `y = u - gap` the indentation: a ball on a plane, a gear tooth.

    Nothing where y is negative; `side="left"` is the mirror image, `y = gap - u`. Units: force / length^(3/2), length,
    time / length (of Hunt and Crossley: 3/2 of the loss of restitution per impact velocity). Exact, integrated between
    the instants at which the contact closes and opens. Above y' = -1 / damping, which no impact reaches, it pushes.

    Hunt & Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Applied Mechanics 42, 1975.
    """

    coefficient_names = ("damping", "gap", "stiffness")

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

    @property
    def text(self) -> str:
        if self.side == "right":
            return "stiffness*max(x-gap, 0)**1.5*(1+damping*v)"
        return "-stiffness*max(gap-x, 0)**1.5*(1-damping*v)"

    def sampling(self, c: Array) -> CornerSampling:
        """A power of a half begins at the gap."""
        return CornerSampling(points=(float(c[1]),), rough=True)
