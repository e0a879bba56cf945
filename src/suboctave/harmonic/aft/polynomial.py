"""Polynomials of one displacement, by their coefficients."""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.aft.closed_form import add_law, add_values, polynomial_nodes
from suboctave.harmonic.aft.law import Along, Member, Second, Third
from suboctave.harmonic.aft.sampled import Sampled
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import Nodes
from suboctave.harmonic.trigonometric import motion
from suboctave.lazy import lazy

__all__ = ["Polynomial"]


class Polynomial(Sampled):
    """`sum_p coefficients_p u^p`: what all polynomials along one direction add up to."""

    in_closed_form = True

    def __init__(self, along: Along, members: tuple[Member, ...], coefficients: Array) -> None:
        super().__init__(along, members)
        self.coefficients = coefficients

    def reaching(self, along: Along, members: tuple[Member, ...]) -> Polynomial:
        """See `LawAlong.reaching`."""
        return Polynomial(along, members, self.coefficients)

    @lazy
    def nodes(self) -> Nodes:
        """See `polynomial_nodes`."""
        return polynomial_nodes(len(self.coefficients) - 1, self.along.high, self.along.top)

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        nodes = self.nodes
        u, slope = motion(self.along.motion, nodes.zr, nodes.zi)
        return nodes.zr, nodes.zi, nodes.weights, u, slope

    @lazy
    def _bends(self) -> Array:
        """Weights of the second and third derivatives at the nodes, (2, N)."""
        powers = np.arange(2, len(self.coefficients))
        bends = np.zeros((2, len(self.nodes.zr)))
        add_values(self.coefficients[2:] * powers * (powers - 1), self.path[3], bends[0], bends[1])
        weighted: Array = self.nodes.weights * bends
        return weighted

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        add_law(self.along, out, polynomial=self.coefficients)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        return [Second(self.nodes.zr, self.nodes.zi, self.along.in_displacement(self._bends[0], 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        return [Third(self.nodes.zr, self.nodes.zi, self.along.in_displacement(self._bends[1], 3), None)]
