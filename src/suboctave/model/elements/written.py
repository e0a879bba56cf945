"""Laws of one displacement and its rate that one line of text says, with all their derivatives."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from suboctave.model.elements.base import Array, Element
from suboctave.model.elements.batch_form import BatchForm, WrittenForm

if TYPE_CHECKING:
    from suboctave.model.expressions.law import Law


class WrittenElement(Element):
    """A force along one direction whose law is a text in x, its rate v and the coefficients.

    SymPy differentiates it when it is first evaluated. A subclass gives `text` and `sampling`; its `coefficient_names`
    are in alphabetical order.
    """

    depends_on_velocity = True
    own_nodes = True

    @property
    @abstractmethod
    def text(self) -> str:
        """The law, such as "coefficient*v*abs(v)"."""

    @property
    def law(self) -> Law:
        """Compiled once per process."""
        from suboctave.model.expressions.law import law_of

        return law_of(self.text, ("x",), True, type(self).__name__)

    def batch_form(self, c: Array) -> BatchForm:
        return WrittenForm(self.law)

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
