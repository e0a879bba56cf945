"""Responses: all motions of a system, along one free parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState


@dataclass(frozen=True)
class Plain(Augmentation):
    """No scalar equation: all motions, along one free parameter."""

    name = "response"

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> NoEquations:
        return NoEquations(state, self)


PLAIN = Plain()


class NoEquations(Equations):
    """Nothing beside the equations of motion."""

    values = rows = np.zeros(0)

    def __init__(self, state: BalanceState, of: Plain) -> None:
        self.state = state
        self.of = of

    def renewed(self) -> Plain:
        return self.of
