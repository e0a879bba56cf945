"""What a parameter does to the forces along each direction: Fourier coefficients of `df`, `df_u`, `df_v`.

Laws known in closed form are changed in compiled code (`law_changes`), the rounded ones on the nodes that the force
along their direction is integrated with; all other elements have their own (`local_force.coefficient_change`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.basis import Array
from suboctave.harmonic.group_force import Group
from suboctave.harmonic.law_changes import change_of_pieces, change_of_steps
from suboctave.harmonic.local_force import CoefficientChange, coefficient_change
from suboctave.harmonic.rates import coefficient_rates
from suboctave.model.element import Element
from suboctave.model.sampling import PiecewiseLinear, Sampling, SharpSampling

if TYPE_CHECKING:
    from suboctave.harmonic.balance import HarmonicBalance
    from suboctave.harmonic.state import BalanceState

_NO_PIECES, _NO_STEPS = np.zeros((0, 5)), np.zeros((0, 6))


class PackedChanges(NamedTuple):
    """What a parameter does to laws that are known in closed form, direction by direction, as arrays.

    pieces, first
        Pieces as `law_changes.change_of_pieces` wants them, (P, 5); where each direction's begin, (G + 1,).
    steps, step_first
        Steps as `law_changes.change_of_steps` wants them, (S, 6); where each direction's begin, (G + 1,).
    line
        Rates of constant and slope of the laws that the steps belong to, (G, 2).
    """

    pieces: Array
    first: NDArray[np.int64]
    steps: Array
    step_first: NDArray[np.int64]
    line: Array


def packed_changes(balance: HarmonicBalance, values: Mapping[str, float], name: str) -> PackedChanges | None:
    """What a parameter does to the forces, None where elements have to be asked along the motion."""
    count = len(balance.groups)
    pieces: list[tuple[float, ...]] = []
    steps: list[tuple[float, ...]] = []
    line = np.zeros((count, 2))
    ends, step_ends = np.zeros((2, count + 1), dtype=np.int64)
    numbers, kinds, _ = balance.coefficients(values)
    for g, rates in _rates(balance, values, name):
        own = _known_changes(balance, numbers, kinds, rates)
        if own.others:
            return None
        pieces += own.pieces
        steps += own.steps
        line[g] = own.line
        ends[g + 1 :], step_ends[g + 1 :] = len(pieces), len(steps)
    return PackedChanges(
        np.array(pieces) if pieces else _NO_PIECES, ends, np.array(steps) if steps else _NO_STEPS, step_ends, line
    )


def changes_by(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    """For every direction along which the forces depend on a parameter; kept with the motion."""
    known: dict[str, list[tuple[Group, CoefficientChange]]] = state.__dict__.setdefault("_changes", {})
    if name not in known:
        known[name] = _changes(state, name)
    return known[name]


def _changes(state: BalanceState, name: str) -> list[tuple[Group, CoefficientChange]]:
    return [
        (state.balance.groups[g], _along(state, g, rates)) for g, rates in _rates(state.balance, state.values, name)
    ]


def _rates(balance: HarmonicBalance, values: Mapping[str, float], name: str) -> list[tuple[int, dict[int, Array]]]:
    """Rates of the coefficients of all elements that a parameter changes, direction by direction."""
    found = []
    for g, members in balance.changing(name):
        rates = {}
        for i, known in members.items():
            rate = coefficient_rates(balance.elements[i], values, {name: 1.0}) if known is None else known
            if known is not None or rate.any():
                rates[i] = rate
        if rates:
            found.append((g, rates))
    return found


class _Known(NamedTuple):
    """Changes along one direction: of pieces, of steps, of the line that these belong to; elements with other laws."""

    pieces: list[tuple[float, ...]]
    steps: list[tuple[float, ...]]
    line: tuple[float, float]
    others: list[int]


def _known_changes(
    balance: HarmonicBalance, numbers: list[Array], kinds: list[Sampling], rates: dict[int, Array]
) -> _Known:
    pieces: list[tuple[float, ...]] = []
    steps: list[tuple[float, ...]] = []
    constant = slope = 0.0
    others = []
    for i, rate in rates.items():
        kind, c = kinds[i], numbers[i]
        told = _told_change(balance.elements[i], kind, c, rate)
        if isinstance(kind, PiecewiseLinear):
            own, by = c.tolist(), rate.tolist()
            pieces += [(own[p.stiffness], own[p.gap], p.side, by[p.stiffness], by[p.gap]) for p in kind.pieces]
        elif told is not None:
            steps += told[0]
            constant, slope = constant + told[1][0], slope + told[1][1]
        else:
            others.append(i)
    return _Known(pieces, steps, (constant, slope), others)


def _along(state: BalanceState, g: int, rates: dict[int, Array]) -> CoefficientChange:
    """The change along one direction, by the rates of its elements' coefficients."""
    balance = state.balance
    numbers, kinds, _ = balance.coefficients(state.values)
    force, stiffness = np.zeros((2, balance.top + 1), dtype=complex)
    known = _known_changes(balance, numbers, kinds, rates)
    parts = [CoefficientChange(force, stiffness, None)]
    parts += [coefficient_change(state.local_motions[i], rates[i]) for i in known.others]
    if known.pieces:
        grid = balance.grid
        change_of_pieces(state.motions[g], np.array(known.pieces), grid[0], grid[1], force, stiffness)
    if known.steps:
        change_of_steps(state.told_nodes(g), np.array(known.steps), np.array(known.line), force, stiffness)
    return parts[0] if len(parts) == 1 else _sum(parts)


def _told_change(
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


__all__ = ["PackedChanges", "changes_by", "packed_changes"]
