"""One degree of freedom whose laws are all known in closed form: from the motion to its multipliers in one compiled
call (the common small case, in which the calls would cost more than what they do).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.sharp_nodes import singular_instants
from suboctave.harmonic.state import BalanceState
from suboctave.stability.magnus import BETWEEN, STEPS
from suboctave.stability.nodes import NODES
from suboctave.stability.panels import _filled, _panels, closed_changes, longest_panel
from suboctave.stability.passages import events_along
from suboctave.stability.single import corrected_single, standing_single


@kernel()
def _passed(c, points, widths, step_first, reach, grid):
    """The instants at which the motion passes arctan steps, as `singular_instants` has them: direction by direction."""
    found = np.empty((2, 0))
    for g in range(c.shape[0]):
        low, high = step_first[g], step_first[g + 1]
        if high == low:
            continue
        more = singular_instants(c[g], points[low:high], widths[low:high], reach, grid[0], grid[1])
        before = found
        count = before.shape[1]
        found = np.empty((2, count + more.shape[1]))
        for i in range(2):
            for k in range(found.shape[1]):
                found[i, k] = before[i, k] if k < count else more[i, k - count]
    return found


@kernel()
def _multipliers(
    c, f, rate, pieces, owner, polynomial, steps, step_owner, line, points, widths, step_first, degree, grid, nodes,
    silent, moving, shape, matrices, tables, between, largest, weight, mu, shift, before,
):  # fmt: skip
    """Fill `mu`, `shift` and `before`, (2,) each, as `single` has them; returns the share of the correction taken.

    points, widths, step_first: as `evaluation.evaluate_told` has them, or None without steps; degree: of the tangent,
    as a polynomial in the motion; silent: whether the force that the motion leaves unbalanced is left out. Other
    arguments: see `panels.lay_out` and `single.standing_single`; scaled by `1 / rate`.
    """
    longest = longest_panel(c, degree)
    if points is None:
        passed = np.empty((2, 0))
    else:
        passed = _passed(c, points, widths, step_first, longest, grid)
    events = events_along(c, pieces, owner, passed, grid[0], grid[1])
    panels, start = _panels(events, longest)
    stretch, path, law, base = _filled(c, f, rate, pieces, owner, polynomial, steps, step_owner, line, panels, nodes)
    if silent:
        for g in range(law.shape[0]):
            for j in range(law.shape[2]):
                law[g, 0, j] = 0.0
    scale = 1.0 / rate
    stood, change, factor = standing_single(
        stretch, scale, path, law, base, moving, shape, matrices, tables, between, nodes, largest, weight
    )
    new, kick = closed_changes(
        path, law, change, rate, pieces, owner, polynomial, steps, step_owner, events, start, stretch.shape[0]
    )
    found, moved = corrected_single(stretch, scale, new, base, kick, moving, shape, matrices, tables, stood)
    for i in range(2):
        mu[i] = found[i]
        shift[i] = moved[i]
        before[i] = stood[i]
    return factor


class ClosedSingle:
    """Multipliers of a motion of one DOF whose laws are known in closed form (`applies`).

    Attributes
    ----------
    varying
        Whether stiffness or damping varies within panels.
    """

    def __init__(self, state: BalanceState, silent: bool, largest: float) -> None:
        self.state, self.silent, self.largest = state, silent, largest
        self.laws = laws = state.packed[0]
        degree = max(laws.polynomial.shape[1] - 2, 1 if len(laws.steps) else 0)
        self.varying, self.degree = degree > 0, degree
        self.passed: tuple[Any, Any, Any] = (*laws.places, laws.step_first) if len(laws.steps) else (None, None, None)
        self.before: ComplexArray = np.empty(2, dtype=complex)

    @staticmethod
    def applies(state: BalanceState) -> bool:
        """Whether a motion is of that kind."""
        balance = state.balance
        if balance.size > 1 or balance.basis.kept is not None or balance.own:
            return False
        laws = state.packed[0]
        return isinstance(state.linear, StructuralMatrices) and (laws.told or not laws.sampled)

    def multipliers(self, weight: float) -> tuple[ComplexArray, Array, float]:
        """Multipliers, how far the correction has moved them, and the share of it that was taken.

        weight: share of its part along the direction of the real multiplier nearest to +1.
        """
        state, laws, balance = self.state, self.laws, self.state.balance
        assert isinstance(state.linear, StructuralMatrices)
        mu, shift = np.empty(2, dtype=complex), np.empty(2)
        share = _multipliers(
            state.motions,
            state.spectra_table[0],
            state.rate,
            laws.pieces,
            laws.owner,
            laws.polynomial,
            laws.steps,
            laws.step_owner,
            laws.line,
            *self.passed,
            self.degree,
            balance.grid,
            NODES,
            self.silent,
            balance.any_moving,
            balance.directions[2],
            state.linear.scalars,
            STEPS,
            BETWEEN,
            self.largest,
            weight,
            mu,
            shift,
            self.before,
        )
        return mu, shift, share

    def gap(self) -> float:
        """Distance to +1 of the nearest multiplier of the motion as it stands."""
        return min(math.hypot(1.0 - mu.real, mu.imag) for mu in self.before.tolist())


__all__ = ["ClosedSingle"]
