"""Channels: elements that act along one direction and read the same displacements, on a motion.

    F = sum over channels d_out f,    dF/dX = d_out sum_i [T(f_ui) + T(f_vi) omega D] d_i^T

with f_ui, f_vi the derivatives by the displacement along input i and by its rate. All of an element that reads one
displacement share the channel of its direction, `d_1 = d_out`; an element with several inputs, corners in its velocity
or time has its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from suboctave.harmonic.aft.closed_law import ClosedForm
from suboctave.harmonic.aft.general import GeneralLaw
from suboctave.harmonic.aft.law import Along, LawAlong, Member, Second, Third
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import Nodes
from suboctave.lazy import lazy

__all__ = ["Channel", "Group", "laws_along"]

_NO_SPECTRUM = np.zeros(0, dtype=complex)


@dataclass(frozen=True, eq=False)
class Group:
    """Elements that act along the same direction and read the same displacements, in the unknown DOFs.

    direction, inputs
        d_out (size,) and the d_i (m, size).
    members
        The elements, by their number in the system.
    moving
        Whether the force of any depends on velocity.
    """

    direction: Array
    inputs: Array
    members: tuple[int, ...]
    moving: bool


def laws_along(
    along: Along, members: Sequence[Member], known: tuple[PackedLaws, list[Nodes]] | None = None, direction: int = 0
) -> list[LawAlong]:
    """The laws of elements along a motion, those that are integrated alike together; `known` as in `ClosedForm`."""
    closed = [member for member in members if member.kind.whole]
    laws: list[LawAlong] = [ClosedForm(along, closed, known, direction)] if closed else []
    alike: dict[tuple[type, bool], list[Member]] = {}
    for member in members:
        if not member.kind.whole:
            alike.setdefault((type(member.kind), member.element.depends_on_velocity), []).append(member)
    return laws + [GeneralLaw(along, own) for own in alike.values()]


class Channel:
    """The laws of a group along a motion.

    known
        Fourier coefficients of f and f_q, (1 + Q, top + 1), where they are known.
    """

    def __init__(self, group: Group, along: Along, laws: list[LawAlong], known: ComplexArray | None = None) -> None:
        self.group, self.along, self.laws, self._known = group, along, laws, known
        self.out, self.ins = group.direction, group.inputs
        self.count, self.moving = len(group.inputs), along.moving

    @lazy
    def spectra(self) -> ComplexArray:
        """Fourier coefficients of f and f_q, (1 + Q, top + 1)."""
        if self._known is not None:
            return self._known
        out = np.zeros((1 + self.along.size, self.along.top + 1), dtype=complex)
        for law in self.laws:
            law.add_spectra(out)
        return out

    def stiffness(self, i: int) -> ComplexArray:
        """Fourier coefficients of f_ui."""
        spectrum: ComplexArray = self.spectra[1 + i]
        return spectrum

    def damping(self, i: int) -> ComplexArray:
        """Fourier coefficients of f_vi, empty for laws without velocity."""
        return self.spectra[1 + self.count + i] if self.moving else _NO_SPECTRUM

    def halves(self, weights: Array) -> tuple[float, float]:
        """Largest Fourier coefficient of stiffness, or of damping times the frequency, that differs between the two
        halves of the period, and largest of all, as squares of frequencies; weights: `HarmonicBalance.scales`.
        """
        reading = np.linalg.norm(self.ins * weights, axis=1)
        factors = np.linalg.norm(self.out * weights) * reading
        if self.moving:
            factors = np.concatenate((factors, factors * self.along.rate))
        derivatives = np.abs(self.spectra[1:]).T * factors
        return float(derivatives[1::2].max(initial=0.0)), float(derivatives.max(initial=0.0))

    @lazy
    def second(self) -> list[Second]:
        """Second derivatives."""
        parts = [part for law in self.laws for part in law.second() if len(part.zr)]
        return [Second(zr, zi, self._widened(weights, 2)) for zr, zi, weights in parts]

    @lazy
    def third(self) -> list[Third]:
        """Third derivatives."""
        parts = [part for law in self.laws for part in law.third() if len(part.zr)]
        return [
            Third(zr, zi, self._widened(weights, 3), None if slopes is None else self._widened(slopes, 3))
            for zr, zi, weights, slopes in parts
        ]

    def _widened(self, weights: Array, order: int) -> Array:
        """Weights (Q', .., N) of a law that may not read the velocity, among all entries of q, (Q, .., N)."""
        read, size = len(weights), self.along.size
        return weights if read == size else np.pad(weights, [(0, size - read)] * order + [(0, 0)])

    def change(self, rates: Mapping[int, Array]) -> ComplexArray:
        """What changes of elements' coefficients, `rates` (nc,) by element, do to f and f_q, (1 + Q, top + 1)."""
        out = np.zeros((1 + self.along.size, self.along.top + 1), dtype=complex)
        for law in self.laws:
            law.add_change(rates, out)
        return out

    def members(self) -> list[tuple[LawAlong, Member]]:
        """Every element with the law that it is part of."""
        return [(law, member) for law in self.laws for member in law.members]

    def reaching(self, top: int) -> Channel:
        """The same with Fourier coefficients up to `top`."""
        along = self.along.reaching(top)
        return Channel(self.group, along, laws_along(along, [member for _, member in self.members()]))
