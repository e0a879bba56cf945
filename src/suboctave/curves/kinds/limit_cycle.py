"""Limit cycles: motions that no load keeps going, whose frequency is unknown and whose phase is free.

    R(X, omega, p) = 0,    <D Y, X> = 0

Any motion shifted in time is one as well. The phase condition takes that whose distance from a reference Y is least, D
the derivative by tau and < , > the product weighted by masses. Y is kept while the motions resemble it, so that a
closed curve comes back to the phase that it began with.

One multiplier is +1 all along: that of the shift in time. Bifurcations of cycles are singular points of the same
equations with the conditions of `curves.kinds.singular` besides (`free_phase`), limit points extrema of p along them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.linear import length
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.lazy import lazy

#: cosine of a motion with the reference below which that is replaced
_RESEMBLES = 0.5


@dataclass(frozen=True)
class LimitCycle(Augmentation):
    """Y is `reference`, coefficients (2 H + 1, size) in `basis`; `size` that of the motions' oscillation."""

    reference: Array
    basis: HarmonicBasis
    size: float
    name = "limit_cycle"
    free_phase = True

    @classmethod
    def of(cls, state: BalanceState) -> LimitCycle:
        """With the phase of a motion."""
        if state.driven:
            raise InputError("a load drives this motion: only motions that no load keeps going choose their frequency")
        return cls(state.x, state.basis, length(oscillating(state)) or 1.0)

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[LimitCycle, Array]:
        """See `Augmentation.through`."""
        return cls.of(state), np.zeros(0)

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        return 1.0 + 0.0j

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> CycleEquations:
        return CycleEquations(self, state, names)

    def phase_condition(self, state: BalanceState) -> tuple[Array, Array]:
        """The reference's oscillation, weighted as `oscillating`, and the derivative of the phase condition by X,
        (dimension,): the same at all motions of a discretisation.
        """
        weights, known = state.balance.scales[0], vars(self).get("_condition")
        if known is None or known[0] is not weights:
            reference = self.reference * weights
            reference[0] = 0.0
            # D Y
            turning = state.basis.derivative(reference)
            row = (turning * weights).ravel() / ((length(turning) or 1.0) * self.size)
            known = vars(self)["_condition"] = weights, (reference, row)
        kept: tuple[Array, Array] = known[1]
        return kept

    def resized(self, basis: HarmonicBasis, size: int) -> LimitCycle:
        return replace(self, reference=self.basis.resized(self.reference, basis), basis=basis)


def oscillating(state: BalanceState) -> Array:
    """The coefficients of a motion but its mean, weighted by the square roots of the masses."""
    x: Array = state.x * state.balance.scales[0]
    x[0] = 0.0
    return x


class CycleEquations(Equations):
    """The phase condition, relative to the reference and to the motion."""

    def __init__(self, of: LimitCycle, state: BalanceState, names: tuple[str, ...]) -> None:
        self.of, self.state, self.names = of, state, names
        self.reference, self.row = of.phase_condition(state)

    @property
    def values(self) -> Array:
        return np.array([self.row.dot(self.state.unknowns)])

    @lazy
    def rows(self) -> Array:
        return self.beside(self.of.extras)

    def beside(self, extras: int) -> Array:
        """The derivatives of the phase condition among so many extra unknowns."""
        rows = np.zeros((1, len(self.row) + extras + len(self.names)))
        rows[0, : len(self.row)] = self.row
        return rows

    def renewed(self) -> LimitCycle:
        x, y = oscillating(self.state), self.reference
        size = length(x)
        alike = float(np.vdot(x, y)) > _RESEMBLES * size * length(y)
        return replace(self.of, size=size) if alike else LimitCycle.of(self.state)
