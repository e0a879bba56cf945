"""Grazings: an extremum of an element's relative displacement u reaches one of its gaps.

u(tau) = gap,    du/dtau(tau) = 0,    the instant tau unknown
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.gaps import Height, gap_extrema, height_at
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
        return cls(element, index, motion_size(state) / float(np.max(state.balance.scales[0])) or 1.0)

    @classmethod
    def through(
        cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]
    ) -> tuple[GrazingContactEquations, Array]:
        """See `Augmentation.through`: of its contact."""
        assert item.contact is not None
        element, tau = item.contact.element, item.contact.time * state.rate
        places = [gap.index for gap in gap_extrema(state) if gap.element == element]
        index = min(places, key=lambda place: abs(height_at(state, element, place, tau).height))
        return cls.of(state, element, index), np.array([tau])

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
    def height(self) -> Height:
        """How far the element lies above its gap at the instant."""
        return height_at(self.state, self.of.element, self.of.index, self.tau, self.names)

    @lazy
    def values(self) -> Array:
        return np.array([self.height.height, self.height.slope]) / self.of.unit

    @property
    def rows(self) -> Array:
        h = self.height
        # where contact begins everywhere at once tau stays as it is
        curve = h.curve or self.of.unit
        above = np.concatenate((h.by_x.ravel(), [h.slope], h.by_names))
        level = np.concatenate((h.slope_by_x.ravel(), [curve], h.slope_by_names))
        return np.array([above, level]) / self.of.unit

    def renewed(self) -> GrazingContactEquations:
        return GrazingContactEquations.of(self.state, self.of.element, self.of.index)
