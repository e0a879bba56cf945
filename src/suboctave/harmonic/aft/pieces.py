"""Exact contact: piecewise-linear laws, integrated in closed form over the contact intervals.

A piece of stiffness k, gap b and side +-1 has the force `k (u - b) chi`, chi the indicator of `side (u - b) > 0`: no
sampling, no regularisation. f_uu is a comb of Dirac functions at the crossings, with weight `side k / |du/dtau|`. With
rates k', b' of stiffness and gap the force changes by `(k' (u - b) - k b') chi`, its slope by `k' chi - side k b' delta
(u - b)`.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.harmonic.aft.closed_form import add_law, contact_spectrum, product_spectrum
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import crossings_of, motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.smoothness import PiecewiseLinear

__all__ = ["Pieces"]


class Pieces(LawAlong):
    """All pieces along one direction: stiffness, gap, side, (P, 3)."""

    in_closed_form = True

    def __init__(self, along: Along, members: tuple[Member, ...], pieces: Array) -> None:
        super().__init__(along, members)
        self.pieces = pieces

    def reaching(self, along: Along, members: tuple[Member, ...]) -> Pieces:
        """See `LawAlong.reaching`."""
        return Pieces(along, members, self.pieces)

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        add_law(self.along, out, pieces=self.pieces)

    @lazy
    def _corners(self) -> Array:
        grid = search_grid(self.along.high)
        return corner_weights(self.along.motion, self.pieces, motion(self.along.motion, grid.zr, grid.zi))

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        zr, zi, second, _, _ = self._corners
        return [Second(zr, zi, self.along.in_displacement(second, 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        zr, zi, _, third, slope = self._corners
        return [Third(zr, zi, self.along.in_displacement(third, 3), self.along.in_displacement(slope, 3))]

    def coefficient_spectra(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.coefficient_spectra`."""
        along, c, count = self.along, member.coefficients, len(member.coefficients)
        assert isinstance(member.kind, PiecewiseLinear)
        grid = search_grid(along.high)
        values = motion(along.motion, grid.zr, grid.zi)
        force = np.zeros((count, along.top + 1), dtype=complex)
        tangent = np.zeros((count, along.size, along.top + 1), dtype=complex)
        second = np.zeros((count, count, along.top + 1), dtype=complex)
        for piece in member.kind.pieces:
            i, j, gap = piece.stiffness, piece.gap, float(c[piece.gap])
            tau, above = crossings_of(along.motion, gap, values)
            whole = contact_spectrum(tau, above, piece.side, along.top + along.high)
            chi = whole[: along.top + 1]
            zr, zi, weights, _, _ = corner_weights(along.motion, np.array([[1.0, gap, 1.0]]), values)
            comb = piece.side * c[i] * spectra(np.ones((1, len(zr))), weights, zr, zi, along.top)[0]
            force[i] += product_spectrum(along.motion, gap, whole, along.top)
            force[j] -= c[i] * chi
            tangent[i, 0] += chi
            tangent[j, 0] -= comb
            second[i, j] -= chi
            second[j, i] -= chi
            second[j, j] += comb
        return CoefficientSpectra(force, tangent, second)

    def add_change(self, rates: dict[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        rows = []
        for member in self.members:
            if member.number in rates:
                assert isinstance(member.kind, PiecewiseLinear)
                own, by = member.coefficients.tolist(), rates[member.number].tolist()
                rows += [(own[p.stiffness], own[p.gap], p.side, by[p.stiffness], by[p.gap]) for p in member.kind.pieces]
        if rows:
            grid = search_grid(self.along.high)
            values = motion(self.along.motion, grid.zr, grid.zi)
            add_changed_pieces(self.along.motion, np.array(rows), values, out[0], out[1])


def add_changed_pieces(
    c: ComplexArray, pieces: Array, values: Array, force: ComplexArray, stiffness: ComplexArray
) -> None:
    """Add what changes of piecewise-linear laws do to the spectra of force and stiffness (top + 1,), in place.

    c: complex coefficients of the displacement (H + 1,); pieces: stiffness, gap, side, rates of stiffness and gap
    (P, 5); values: see `crossings_of`.
    """
    top, high = len(force) - 1, len(c) - 1
    for k, gap, side, by_stiffness, by_gap in pieces.tolist():
        crossed, above = crossings_of(c, gap, values)
        chi = contact_spectrum(crossed, above, side, top + high)
        force += by_stiffness * product_spectrum(c, gap, chi, top) - k * by_gap * chi[: top + 1]
        stiffness += by_stiffness * chi[: top + 1]
        if by_gap != 0.0:
            weights = side * k * by_gap / (2.0 * math.pi * np.abs(_rates(c, crossed)[0]))
            stiffness -= weights @ np.exp(-1j * np.multiply.outer(crossed, np.arange(top + 1)))


def corner_weights(c: ComplexArray, pieces: Array, values: Array) -> Array:
    """Instants at which the gaps of piecewise-linear pieces (stiffness, gap, side) are crossed: cosines, sines, and the
    weights there, (5, N); `f_uu` has `side stiffness / |u'|`.
    """
    corners = []
    for k, gap, side in pieces.tolist():
        tau, _ = crossings_of(c, gap, values)
        speed, bend = _rates(c, tau)
        weight = side * k / np.abs(speed)
        corners.append((np.cos(tau), np.sin(tau), weight, weight * bend / speed**2, -weight / speed))
    return np.concatenate(corners, axis=1)


def _rates(c: ComplexArray, tau: Array) -> tuple[Array, Array]:
    """First and second derivative of the motion, the first kept from zero where the motion grazes."""
    k = np.arange(len(c))
    waves = c * np.exp(1j * np.multiply.outer(tau, k))
    speed, least = -(waves.imag @ k), max(1e-12 * float(np.abs(c).max()), 1e-300)
    return np.where(np.abs(speed) < least, np.copysign(least, speed), speed), -(waves.real @ (k * k))
