"""What a parameter does to the forces along each direction: Fourier coefficients of `df`, `df_u`, `df_v`.

Laws known in closed form are changed in compiled code (`law_changes`), the rounded ones on the nodes that the force
along their direction is integrated with; all other elements have their own (`local_force.coefficient_change`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suboctave.harmonic.basis import Array
from suboctave.harmonic.group_force import Group
from suboctave.harmonic.law_changes import change_of_pieces, change_of_steps
from suboctave.harmonic.local_force import CoefficientChange, coefficient_change
from suboctave.harmonic.rates import coefficient_rates
from suboctave.model.element import Element
from suboctave.model.sampling import PiecewiseLinear, Sampling, SharpSampling

if TYPE_CHECKING:
    from suboctave.harmonic.state import BalanceState


def changes_by(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    """For every direction along which the forces depend on a parameter; kept with the motion."""
    known: dict[str, list[tuple[Group, CoefficientChange]]] = state.__dict__.setdefault("_changes", {})
    if name not in known:
        known[name] = _changes(state, name)
    return known[name]


def _changes(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    balance = state.balance
    found = []
    for g, members in balance.changing(name):
        rates = {}
        for i, known in members.items():
            rate = coefficient_rates(balance.elements[i], state.values, {name: 1.0}) if known is None else known
            if known is not None or rate.any():
                rates[i] = rate
        if rates:
            found.append((balance.groups[g], _along(state, g, rates)))
    return found


def _along(state: BalanceState, g: int, rates: dict[int, Array]) -> CoefficientChange:
    """The change along one direction, by the rates of its elements' coefficients."""
    balance = state.balance
    numbers, kinds, _ = balance.coefficients(state.values)
    force, stiffness = np.zeros((2, balance.top + 1), dtype=complex)
    pieces: list[tuple[float, ...]] = []
    steps: list[tuple[float, ...]] = []
    line = np.zeros(2)
    parts = [CoefficientChange(force, stiffness, None)]
    for i, rate in rates.items():
        kind, c = kinds[i], numbers[i]
        told = told_change(balance.elements[i], kind, c, rate)
        if isinstance(kind, PiecewiseLinear):
            pieces += change_in_pieces(kind, c, rate)
        elif told is not None:
            steps += told[0]
            line += told[1]
        else:
            parts.append(coefficient_change(state.local_motions[i], rate))
    if pieces:
        grid = balance.grid
        change_of_pieces(state.motions[g], np.array(pieces), grid[0], grid[1], force, stiffness)
    if steps:
        change_of_steps(state.told_nodes(g), np.array(steps), line, force, stiffness)
    return parts[0] if len(parts) == 1 else _sum(parts)


def change_in_pieces(kind: PiecewiseLinear, c: Array, rate: Array) -> list[tuple[float, ...]]:
    """Stiffness, gap and side of every piece, with the rates of stiffness and gap."""
    own, by = c.tolist(), rate.tolist()
    return [(own[p.stiffness], own[p.gap], p.side, by[p.stiffness], by[p.gap]) for p in kind.pieces]


def told_change(
    element: Element, kind: Sampling, c: Array, rate: Array
) -> tuple[list[tuple[float, ...]], tuple[float, float]] | None:
    """Arctan steps with the rates of their numbers, and those of constant and slope; None where they are not told."""
    if not isinstance(kind, SharpSampling) or kind.steps is None:
        return None
    by = element.told_change(c, rate)
    if by is None or by.steps is None:
        return None
    rows = zip(kind.points, kind.widths, kind.steps, by.points, by.widths, by.steps, strict=True)
    return list(rows), (by.constant, by.slope)


def _sum(parts: list[CoefficientChange]) -> CoefficientChange:
    first, *others = parts
    for other in others:
        damping = first.damping if other.damping is None else other.damping
        if first.damping is not None and other.damping is not None:
            damping = first.damping + other.damping
        first = CoefficientChange(first.force + other.force, first.stiffness + other.stiffness, damping)
    return first


__all__ = ["change_in_pieces", "changes_by", "told_change"]
