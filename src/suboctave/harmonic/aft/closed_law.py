"""Laws in closed form along a motion: piecewise-linear pieces, polynomials of the displacement, arctan steps.

A piece of stiffness k, gap b and side +-1 has the force `k (u - b) chi`, chi the indicator of `side (u - b) > 0`: no
sampling, no regularisation. f_uu is a comb of Dirac functions at the crossings, with weight `side k / |du/dtau|`. With
rates k', b' of stiffness and gap the force changes by `(k' (u - b) - k b') chi`, its slope by `k' chi - side k b' delta
(u - b)`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from suboctave.harmonic.aft.closed_form import add_changed_pieces, add_laws
from suboctave.harmonic.aft.general import GeneralLaw
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.aft.table import PackedLaws, Weights
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import Nodes, search_grid
from suboctave.lazy import lazy
from suboctave.model.elements.smoothness import PiecewiseLinear, SharpSampling

__all__ = ["ClosedForm"]


class ClosedForm(LawAlong):
    """All laws along one direction whose smoothness class is all of them; `known` has them as arrays, with others, in
    the row `direction`, and the nodes of all.
    """

    whole = True

    def __init__(
        self,
        along: Along,
        members: Sequence[Member],
        known: tuple[PackedLaws, list[Nodes]] | None = None,
        direction: int = 0,
    ) -> None:
        super().__init__(along, members)
        if known is None:
            packed = PackedLaws([members])
            known = packed, packed.nodes(along.motions, along.top)
        self._packed, self._nodes = known
        self._direction = direction

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        motions, table = self.along.motions, np.zeros((3, 1, out.shape[1]), dtype=complex)
        add_laws(motions, PackedLaws([self.members]).closed(motions.shape[1] - 1, out.shape[1] - 1), table)
        out += table[: len(out), 0]

    @lazy
    def _weights(self) -> list[Weights]:
        return self._packed.weights(self._direction, self.along.motion, self._nodes)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        return [Second(part.zr, part.zi, part.second[None, None]) for part in self._weights]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        return [
            Third(
                part.zr,
                part.zi,
                part.third[None, None, None],
                part.slope if part.slope is None else part.slope[None, None, None],
            )
            for part in self._weights
        ]

    def by_coefficients(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.by_coefficients`."""
        kind, c = member.kind, member.coefficients
        if not isinstance(kind, PiecewiseLinear):
            return self._at_nodes(member).by_coefficients(member)
        count, top = len(c), self.along.top
        force = np.zeros((count, top + 1), dtype=complex)
        tangent = np.zeros((count, 1, top + 1), dtype=complex)
        second = np.zeros((count, count, top + 1), dtype=complex)
        for piece in kind.pieces:
            i, j = piece.stiffness, piece.gap
            row = np.array([[c[i], c[j], piece.side]])
            stiffer, shifted = (self._changed(row, np.array([rates])) for rates in ((1.0, 0.0), (0.0, 1.0)))
            force[i] += stiffer[0]
            force[j] += shifted[0]
            tangent[i, 0] += stiffer[1]
            tangent[j, 0] += shifted[1]
            second[i, j] -= stiffer[1]
            second[j, i] -= stiffer[1]
            second[j, j] -= shifted[1]
        return CoefficientSpectra(force, tangent, second)

    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        rows, changes = [], []
        for member in self.members:
            if member.number not in rates:
                continue
            if isinstance(member.kind, PiecewiseLinear):
                c, by = member.coefficients.tolist(), rates[member.number].tolist()
                for piece in member.kind.pieces:
                    rows.append((c[piece.stiffness], c[piece.gap], float(piece.side)))
                    changes.append((by[piece.stiffness], by[piece.gap]))
            else:
                self._at_nodes(member).add_change(rates, out)
        if rows:
            out[:2] += self._changed(np.array(rows), np.array(changes))

    def _at_nodes(self, member: Member) -> GeneralLaw:
        """A smooth law, evaluated at nodes."""
        sharp = isinstance(member.kind, SharpSampling)
        return GeneralLaw(
            self.along, [member], self._packed.sharp_nodes(self._direction, self._nodes) if sharp else None
        )

    def _changed(self, pieces: Array, rates: Array) -> ComplexArray:
        """What rates of stiffness and gap (P, 2) of pieces (P, 3) do to force and slope, (2, top + 1)."""
        grid, out = search_grid(self.along.high), np.zeros((2, self.along.top + 1), dtype=complex)
        add_changed_pieces(self.along.motion, pieces, rates, grid.zr, grid.zi, out)
        return out
