"""What a parameter does to the forces along each direction: Fourier coefficients of `df`, `df_u`, `df_v`.

The rounded laws along a direction share the nodes that its force is integrated with; all other elements have their own
(`local_force.coefficient_change`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.group_force import Group, GroupLaw
from suboctave.harmonic.local_force import CoefficientChange, coefficient_change
from suboctave.harmonic.quadrature import graded_motion
from suboctave.harmonic.rates import coefficient_rates

if TYPE_CHECKING:
    from suboctave.harmonic.state import BalanceState


def changes_by(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    """For every direction along which the forces depend on a parameter; kept with the motion."""
    known: dict[str, list[tuple[Group, CoefficientChange]]] = state.__dict__.setdefault("_changes", {})
    if name not in known:
        known[name] = _changes(state, name)
    return known[name]


def _changes(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    balance, change = state.balance, {name: 1.0}
    found = []
    laws = balance.coefficients(state.values)[2]
    for g, group in enumerate(balance.groups):
        rates = {i: coefficient_rates(balance.elements[i], state.values, change) for i in group.members}
        rates = {i: rate for i, rate in rates.items() if rate.any()}
        if not rates:
            continue
        law = laws[g]
        told = {i for i, _ in law.told}
        parts = [coefficient_change(state.local_motions[i], rate) for i, rate in rates.items() if i not in told]
        if not told.isdisjoint(rates):
            parts.append(_of_told(state, law, state.motions[g], rates))
        found.append((group, _sum(parts)))
    return found


def _of_told(state: BalanceState, law: GroupLaw, motion: ComplexArray, rates: dict[int, Array]) -> CoefficientChange:
    zr, zi, weights, u = graded_motion(motion, *law.told_places, state.balance.top, moving=False)
    # these laws do not ask for the velocity
    still = np.zeros_like(u)
    rows = np.zeros((2, len(u)))
    for i, c in law.told:
        if i in rates:
            force, stiffness, _ = state.balance.elements[i].coefficient_change(u, still, c, rates[i])
            rows[0] += force
            rows[1] += stiffness
    rows *= weights
    found = kernels.spectra(rows, zr, zi, state.balance.top)
    return CoefficientChange(found[0], found[1], None)


def _sum(parts: list[CoefficientChange]) -> CoefficientChange:
    first, *others = parts
    for other in others:
        damping = first.damping if other.damping is None else other.damping
        if first.damping is not None and other.damping is not None:
            damping = first.damping + other.damping
        first = CoefficientChange(first.force + other.force, first.stiffness + other.stiffness, damping)
    return first


__all__ = ["changes_by"]
