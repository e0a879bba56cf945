"""Polynomials of one displacement, by their coefficients."""

from __future__ import annotations

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.aft.law import Along, Member, Second, Third
from suboctave.harmonic.aft.sampled import Sampled
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import Nodes, even, uniform_nodes
from suboctave.harmonic.trigonometric import FAST, displacement, motion, spectra
from suboctave.lazy import lazy

__all__ = ["Polynomial"]


class Polynomial(Sampled):
    """`sum_p coefficients_p u^p`: what all polynomials along one direction add up to."""

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
        nodes = self.nodes
        add_polynomial(self.along.motion, self.coefficients, nodes.weights, nodes.zr, nodes.zi, out[0], out[1])

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        return [Second(self.nodes.zr, self.nodes.zi, self.along.in_displacement(self._bends[0], 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        return [Third(self.nodes.zr, self.nodes.zi, self.along.in_displacement(self._bends[1], 3), None)]


def polynomial_nodes(degree: int, high: int, top: int) -> Nodes:
    """Instants, none of whose harmonics up to `degree` times `high` alias onto those up to `top`."""
    return uniform_nodes(even(degree * high + top + 1))


@kernel(fastmath=FAST)
def add_values(coefficients, u, force, stiffness):
    """Add a polynomial of the displacement and its derivative, by Horner's rule, to force and stiffness (N,)."""
    if coefficients.shape[0] == 0:
        return
    for j in range(u.shape[0]):
        f = slope = 0.0
        for p in range(coefficients.shape[0] - 1, -1, -1):
            slope = slope * u[j] + f
            f = f * u[j] + coefficients[p]
        force[j] += f
        stiffness[j] += slope


@kernel()
def add_polynomial(c, coefficients, weights, zr, zi, force, stiffness):
    """Add the Fourier coefficients of a polynomial of the motion and of its slope to force and stiffness (top + 1,)."""
    values, u = np.zeros((2, zr.shape[0])), np.empty((1, zr.shape[0]))
    displacement(c, zr, zi, u)
    add_values(coefficients, u[0], values[0], values[1])
    sums = spectra(values, weights, zr, zi, force.shape[0] - 1)
    for q in range(force.shape[0]):
        force[q] += sums[0, q]
        stiffness[q] += sums[1, q]
