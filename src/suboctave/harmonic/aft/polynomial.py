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

    @property
    def nodes(self) -> Nodes:
        """Instants, none of whose harmonics up to degree times H alias onto those up to `top`."""
        return uniform_nodes(even((len(self.coefficients) - 1) * self.along.high + self.along.top + 1))

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        nodes = self.nodes
        u, slope = motion(self.along.motion, nodes.zr, nodes.zi)
        return nodes.zr, nodes.zi, nodes.weights, u, slope

    @lazy
    def _values(self) -> Array:
        """The polynomial and its first three derivatives at the nodes, (4, N)."""
        values: Array = at_nodes(self.along.motion, self.coefficients, self.nodes.zr, self.nodes.zi)
        return values

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        nodes = self.nodes
        add_polynomial(self.along.motion, self.coefficients, nodes.weights, nodes.zr, nodes.zi, out)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        nodes = self.nodes
        return [Second(nodes.zr, nodes.zi, self.along.in_displacement(nodes.weights * self._values[2], 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        nodes = self.nodes
        return [Third(nodes.zr, nodes.zi, self.along.in_displacement(nodes.weights * self._values[3], 3), None)]


@kernel(fastmath=FAST)
def at_nodes(c, coefficients, zr, zi):
    """A polynomial and its first three derivatives, (4, N), by Horner's rule, of a motion at instants."""
    out = np.zeros((4, zr.shape[0]))
    u = np.empty(zr.shape[0])
    displacement(c, zr, zi, u)
    for p in range(coefficients.shape[0] - 1, -1, -1):
        for j in range(u.shape[0]):
            out[3, j] = out[3, j] * u[j] + 3.0 * out[2, j]
            out[2, j] = out[2, j] * u[j] + 2.0 * out[1, j]
            out[1, j] = out[1, j] * u[j] + out[0, j]
            out[0, j] = out[0, j] * u[j] + coefficients[p]
    return out


@kernel()
def add_polynomial(c, coefficients, weights, zr, zi, out):
    """Add the Fourier coefficients of a polynomial and its slope to `out` (>= 2, top + 1); arguments as `at_nodes`."""
    found = spectra(at_nodes(c, coefficients, zr, zi)[:2], weights, zr, zi, out.shape[1] - 1)
    for q in range(out.shape[1]):
        out[0, q] += found[0, q]
        out[1, q] += found[1, q]
