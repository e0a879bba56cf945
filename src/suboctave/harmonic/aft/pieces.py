"""Exact contact: piecewise-linear laws, integrated in closed form over the contact intervals.

A piece of stiffness k, gap b and side +-1 has the force `k (u - b) chi`, chi the indicator of `side (u - b) > 0`: no
sampling, no regularisation. f_uu is a comb of Dirac functions at the crossings, with weight `side k / |du/dtau|`. With
rates k', b' of stiffness and gap the force changes by `(k' (u - b) - k b') chi`, its slope by `k' chi - side k b' delta
(u - b)`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from suboctave.harmonic.aft.closed_form import contact_spectrum, product_spectrum
from suboctave.harmonic.aft.law import CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import crossings_of, extrema, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear

__all__ = ["Pieces"]


class Pieces(LawAlong):
    """All pieces along one direction."""

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        PackedLaws([self.members]).add_spectra(self.along.motions, out[:, None])

    @lazy
    def _turns(self) -> Array:
        """The motion's extrema."""
        grid = search_grid(self.along.high)
        turns: Array = extrema(self.along.motion, grid.zr, grid.zi)
        return turns

    @lazy
    def _corners(self) -> Array:
        return corner_weights(self.along.motion, PackedLaws([self.members]).pieces, self._turns)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        zr, zi, second, _, _ = self._corners
        return [Second(zr, zi, second[None, None])]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        zr, zi, _, third, slope = self._corners
        return [Third(zr, zi, third[None, None, None], slope[None, None, None])]

    def by_coefficients(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.by_coefficients`."""
        along, c, count, turns = self.along, member.coefficients, len(member.coefficients), self._turns
        force = np.zeros((count, along.top + 1), dtype=complex)
        tangent = np.zeros((count, 1, along.top + 1), dtype=complex)
        second = np.zeros((count, count, along.top + 1), dtype=complex)
        for piece in _pieces(member):
            i, j, gap = piece.stiffness, piece.gap, float(c[piece.gap])
            tau, above = crossings_of(along.motion, gap, turns)
            whole = contact_spectrum(tau, above, piece.side, along.top + along.high)
            chi = whole[: along.top + 1]
            zr, zi, weights, _, _ = corner_weights(along.motion, np.array([[1.0, gap, 1.0]]), turns)
            comb = piece.side * c[i] * spectra(np.ones((1, len(zr))), weights, zr, zi, along.top)[0]
            force[i] += product_spectrum(along.motion, gap, whole, along.top)
            force[j] -= c[i] * chi
            tangent[i, 0] += chi
            tangent[j, 0] -= comb
            second[i, j] -= chi
            second[j, i] -= chi
            second[j, j] += comb
        return CoefficientSpectra(force, tangent, second)

    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        c, high, top = self.along.motion, self.along.high, self.along.top
        for member in self.members:
            if member.number not in rates:
                continue
            own, by = member.coefficients.tolist(), rates[member.number].tolist()
            for piece in _pieces(member):
                gap, by_stiffness, by_gap = own[piece.gap], by[piece.stiffness], by[piece.gap]
                crossed, above = crossings_of(c, gap, self._turns)
                chi = contact_spectrum(crossed, above, piece.side, top + high)
                force = by_gap * own[piece.stiffness]
                out[0] += by_stiffness * product_spectrum(c, gap, chi, top) - force * chi[: top + 1]
                out[1] += by_stiffness * chi[: top + 1]
                if by_gap != 0.0:
                    weights = piece.side * force / (2.0 * math.pi * np.abs(_rates(c, crossed)[0]))
                    out[1] -= weights @ np.exp(-1j * np.multiply.outer(crossed, np.arange(top + 1)))


def _pieces(member: Member) -> tuple[Piece, ...]:
    assert isinstance(member.kind, PiecewiseLinear)
    return member.kind.pieces


def corner_weights(c: ComplexArray, pieces: Array, turns: Array) -> Array:
    """Instants at which the gaps of piecewise-linear pieces (stiffness, gap, side) are crossed: cosines, sines, and the
    weights there, (5, N); `f_uu` has `side stiffness / |u'|`.
    """
    corners = []
    for k, gap, side in pieces.tolist():
        tau, _ = crossings_of(c, gap, turns)
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
