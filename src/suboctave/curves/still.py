"""Equilibria written as motions: of one harmonic, at a frequency beyond all at which they may oscillate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.model.linearised import ALL_EIGENVALUES, eigenvalues
from suboctave.model.system import System

#: the frequency that an equilibrium is written with, as a multiple of the highest at which it may oscillate, and the
#: share of half of it which that may reach
BEYOND, _BELOW = 4.5, 0.9
STILL = HarmonicBasis(1)


def fastest(system: System, places: Iterable[tuple[Array, Mapping[str, float]]]) -> float:
    """The highest frequency of small motions about positions, rad per unit time; where none oscillates, of the rates
    at which they grow or decay.
    """
    found = np.concatenate([eigenvalues(system, x, values) for x, values in places])
    return float(np.abs(found.imag).max()) or float(np.abs(found).max()) or 1.0


def beyond(system: System, places: Iterable[tuple[Array, Mapping[str, float]]], omega: float) -> float:
    """The frequency that equilibria are written with: the present one where that will do, and of systems with too many
    degrees of freedom for all eigenvalues.
    """
    if system.n > ALL_EIGENVALUES:
        return omega
    highest = fastest(system, places)
    return omega if highest <= 0.5 * _BELOW * omega else BEYOND * highest


def at_rest(state: BalanceState, omega: float) -> BalanceState:
    """The mean of a motion, at another frequency."""
    balance = state.balance.with_basis(STILL)
    x = np.zeros((STILL.size, state.balance.size))
    x[0] = state.x[0]
    return balance.settle(x, omega, state.values).at(x, omega, state.values)
