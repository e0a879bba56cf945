"""Nonlinear modes: motions that no load keeps going, over their energy.

    R(X, omega) - zeta B X = 0,    <D Y, X> = 0,    (B X)_k = 2 omega (i k omega) M x_k

B X is the force of a damping that is twice omega per unit of mass. Of a conservative system `zeta = 0` along the curve:
the work of all forces over a period is zero by itself, and zeta makes the equations regular though energy is
conserved, a curve over energy (Munoz-Almaraz et al., Continuation of periodic orbits in conservative and Hamiltonian
systems, Physica D 181, 2003). Of a damped one it feeds what damping takes, zeta is the modal damping ratio: the
extended periodic motion concept (Krack, Nonlinear modal analysis of nonconservative systems, Computers & Structures
154, 2015). The phase condition is that of limit cycles; where zeta passes zero a damped mode is one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.kinds.limit_cycle import CycleEquations, LimitCycle
from suboctave.harmonic.assembly import apply_blocks, block_diagonal
from suboctave.harmonic.basis import Array
from suboctave.harmonic.energy import damping_ratio
from suboctave.harmonic.evaluation import BalanceState
from suboctave.lazy import lazy

#: zeta whose forces are lost among those of inertia
_ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True)
class NonlinearMode(LimitCycle):
    """The phase condition of limit cycles, and zeta as the extra unknown; `conservative`: whether it is zero. omega may
    grow by any factor, hence counts in units of itself.
    """

    conservative: bool = True
    name = "nonlinear_mode"
    extras = 1
    relative = True
    trivial = 2

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[NonlinearMode, Array]:
        """See `Augmentation.through`."""
        conservative = not (item.context or {}).get("damped", False)
        phase = LimitCycle.of(state)
        return cls(phase.reference, phase.basis, phase.size, conservative), np.array([damping_ratio(state)])

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        # of a damped one the multipliers of the motion are those of no motion that the system has
        return 1.0 + 0.0j if self.conservative else None

    @property
    def no_multipliers(self) -> str:
        """See `Augmentation.no_multipliers`."""
        return "" if self.conservative else "a damped mode is the motion of no system that stands by itself"

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> ModeEquations:
        return ModeEquations(self, state, float(extra[0]), names)


class ModeEquations(CycleEquations):
    """The phase condition, and what zeta adds to R."""

    of: NonlinearMode

    def __init__(self, of: NonlinearMode, state: BalanceState, zeta: float, names: tuple[str, ...]) -> None:
        super().__init__(of, state, names)
        self.zeta = zeta
        self.column = -apply_blocks(state.feeding, state.x).ravel()
        self.addition = zeta * self.column

    @lazy
    def rows(self) -> Array:
        return np.insert(super().rows, self.state.balance.dimension, 0.0, axis=1)

    def jacobian(self, names: tuple[str, ...]) -> Array:
        out, n, state = super().jacobian(names), self.state.balance.dimension, self.state
        if abs(self.zeta) > _ROUNDING:
            out[:n, :n] -= self.zeta * block_diagonal(state.feeding, True)
            out[:n, n + 1] -= self.zeta * apply_blocks(state.feeding_by_omega, state.x).ravel()
        return out

    def renewed(self) -> NonlinearMode:
        own = super().renewed()
        return replace(self.of, reference=own.reference, basis=own.basis, size=own.size)
