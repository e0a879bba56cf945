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

from suboctave.compiled import kernel
from suboctave.harmonic.aft.closed_form import contact_spectrum, product_spectrum
from suboctave.harmonic.aft.law import CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import crossings_of, extrema, jet, spectra
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
        return self._at(
            [
                (float(member.coefficients[piece.stiffness]), float(member.coefficients[piece.gap]), piece.side)
                for member in self.members
                for piece in _pieces(member)
            ]
        )

    def _at(self, pieces: list[tuple[float, float, float]]) -> Array:
        """The crossings of pieces (stiffness, gap, side): see `corner_weights`."""
        corners: Array = corner_weights(self.along.motion, np.array(pieces), self._turns)
        return corners

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
        along, c, count = self.along, member.coefficients, len(member.coefficients)
        force = np.zeros((count, along.top + 1), dtype=complex)
        tangent = np.zeros((count, 1, along.top + 1), dtype=complex)
        second = np.zeros((count, count, along.top + 1), dtype=complex)
        for piece in _pieces(member):
            i, j, gap = piece.stiffness, piece.gap, float(c[piece.gap])
            product, chi = self._contact(gap, piece.side)
            comb = c[i] * self._comb(gap, piece.side)
            force[i] += product
            force[j] -= c[i] * chi
            tangent[i, 0] += chi
            tangent[j, 0] -= comb
            second[i, j] -= chi
            second[j, i] -= chi
            second[j, j] += comb
        return CoefficientSpectra(force, tangent, second)

    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        for member in self.members:
            if member.number not in rates:
                continue
            own, by = member.coefficients.tolist(), rates[member.number].tolist()
            for piece in _pieces(member):
                gap, by_stiffness, by_gap = own[piece.gap], by[piece.stiffness], by[piece.gap]
                product, chi = self._contact(gap, piece.side)
                out[0] += by_stiffness * product - by_gap * own[piece.stiffness] * chi
                out[1] += by_stiffness * chi
                if by_gap != 0.0:
                    out[1] -= by_gap * own[piece.stiffness] * self._comb(gap, piece.side)

    def _contact(self, gap: float, side: int) -> tuple[ComplexArray, ComplexArray]:
        """Fourier coefficients of `(u - gap) chi`, and of chi."""
        c, top = self.along.motion, self.along.top
        crossed, above = crossings_of(c, gap, self._turns)
        chi = contact_spectrum(crossed, above, side, top + self.along.high)
        return product_spectrum(c, gap, chi, top), chi[: top + 1]

    def _comb(self, gap: float, side: int) -> ComplexArray:
        """Fourier coefficients of `side delta(u - gap)`."""
        zr, zi, weights, _, _ = self._at([(1.0, gap, side)])
        comb: ComplexArray = spectra(np.ones((1, len(zr))), weights, zr, zi, self.along.top)[0]
        return comb


def _pieces(member: Member) -> tuple[Piece, ...]:
    assert isinstance(member.kind, PiecewiseLinear)
    return member.kind.pieces


@kernel()
def corner_weights(c, pieces, turns):
    """Instants at which a motion crosses the gaps of piecewise-linear pieces (stiffness, gap, side): cosines, sines,
    and the weights there of the second derivative, and of the third: regular, and along its slope; (5, N). `f_uu` has
    `side stiffness / |u'|`, u' kept from zero where the motion grazes.
    """
    least = 0.0
    for k in range(c.shape[0]):
        least = max(least, abs(c[k]))
    least = max(1e-12 * least, 1e-300)
    out, count = np.empty((5, pieces.shape[0] * turns.shape[1])), 0
    for p in range(pieces.shape[0]):
        at, _above = crossings_of(c, pieces[p, 1], turns)
        for tau in at:
            zr, zi = math.cos(tau), math.sin(tau)
            _x, speed, bend = jet(c, zr, zi)
            if abs(speed) < least:
                speed = math.copysign(least, speed)
            weight = pieces[p, 2] * pieces[p, 0] / abs(speed)
            out[0, count], out[1, count], out[2, count] = zr, zi, weight
            out[3, count], out[4, count] = weight * bend / speed**2, -weight / speed
            count += 1
    return out[:, :count].copy()
