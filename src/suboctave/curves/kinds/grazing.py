"""Grazings: an extremum of an element's relative displacement u reaches one of its gaps.

u(tau) = gap,    du/dtau(tau) = 0,    the instant tau unknown
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.gaps import basis_rows, level_rate, levels, read_direction
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.truncation import motion_size
from suboctave.lazy import lazy


@dataclass(frozen=True)
class GrazingContactEquations(Augmentation):
    """An extremum of an element's relative displacement reaches one of its gaps, at an instant tau of the period.

    `unit` is a displacement, the size of the motion.
    """

    element: int
    index: int
    unit: float

    @classmethod
    def of(cls, state: BalanceState, element: int, index: int) -> GrazingContactEquations:
        """With the unit of a motion."""
        return cls(element, index, motion_size(state) / float(np.max(state.balance.scales()[0])) or 1.0)

    @classmethod
    def through(
        cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]
    ) -> tuple[GrazingContactEquations, Array]:
        """See `Augmentation.through`: of its contact."""
        assert item.contact is not None
        places = np.array(levels(state.local(item.contact.element)))
        index = int(np.argmin(np.abs(places - item.contact.gap)))
        return cls.of(state, item.contact.element, index), np.array([item.contact.time * state.rate])

    name = "grazing"
    extras = 1

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> GrazingEquations:
        return GrazingEquations(self, state, float(extra[0]), names)

    def spans(self, rate: float) -> Array:
        """tau in periods."""
        return np.array([2.0 * math.pi])

    def shifted(self, extra: Array, angle: float) -> Array:
        return extra - angle

    def unwrapped(self, extra: Array, near: Array) -> Array:
        """See `Augmentation.unwrapped`: instants count modulo the period of the motion."""
        return extra - 2.0 * math.pi * np.round((extra - near) / (2.0 * math.pi))


class GrazingEquations(Equations):
    """`u(tau) - gap` and `du/dtau`, in units of the motion."""

    def __init__(self, of: GrazingContactEquations, state: BalanceState, tau: float, names: tuple[str, ...]) -> None:
        self.of, self.state, self.tau, self.names = of, state, tau, names

    @lazy
    def _rows(self) -> tuple[Array, Array, Array, Array]:
        rows = basis_rows(self.state.basis.harmonics, self.tau)
        return (read_direction(self.state, self.of.element), *rows)

    @lazy
    def derivatives(self) -> tuple[float, float, float]:
        """u and its first two derivatives by tau at the instant."""
        direction, *rows = self._rows
        u = self.state.x @ direction
        value, slope, curve = (float(row @ u) for row in rows)
        return value, slope, curve

    @lazy
    def values(self) -> Array:
        gap = levels(self.state.local(self.of.element))[self.of.index]
        value, slope, _ = self.derivatives
        return np.array([value - gap, slope]) / self.of.unit

    @property
    def rows(self) -> Array:
        direction, first, second, _ = self._rows
        _, slope, curve = self.derivatives
        gap = [-level_rate(self.state, self.of.element, self.of.index, name) for name in self.names]
        above = np.concatenate((np.multiply.outer(first, direction).ravel(), [slope], gap))
        level = np.concatenate((np.multiply.outer(second, direction).ravel(), [curve], np.zeros(len(gap))))
        return np.array([above, level]) / self.of.unit

    def renewed(self) -> GrazingContactEquations:
        return GrazingContactEquations.of(self.state, self.of.element, self.of.index)
