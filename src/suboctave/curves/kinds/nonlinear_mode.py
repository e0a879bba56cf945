"""Nonlinear modes: motions that no load keeps going, over their energy.

    R(X, omega; C - 2 zeta omega M) = 0,    <D Y, X> = 0

A damping of -2 zeta omega per unit of mass is added. Of a conservative system `zeta = 0` along the curve:
the work of all forces over a period is zero by itself, and zeta makes the equations regular though energy is
conserved, a curve over energy (Munoz-Almaraz et al., Continuation of periodic orbits in conservative and Hamiltonian
systems, Physica D 181, 2003). Of a damped one it feeds what damping takes, zeta is the modal damping ratio: the
extended periodic motion concept (Krack, Nonlinear modal analysis of nonconservative systems, Computers & Structures
154, 2015). The phase condition is that of limit cycles; where zeta passes zero a damped mode is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.kinds.limit_cycle import CycleEquations, LimitCycle
from suboctave.harmonic.assembly import apply_blocks
from suboctave.harmonic.basis import Array
from suboctave.harmonic.energy import damping_ratio
from suboctave.harmonic.evaluation import BalanceState

#: step of the difference by which masses enter, in units of the parameter
_STEP = 1e-5


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
    def at_phase(cls, state: BalanceState, conservative: bool) -> NonlinearMode:
        """With the phase of a motion."""
        phase = LimitCycle.of(state)
        return cls(phase.reference, phase.basis, phase.size, conservative)

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[NonlinearMode, Array]:
        """See `Augmentation.through`."""
        conservative = not (item.context or {}).get("damped", False)
        return cls.at_phase(state, conservative), np.array([damping_ratio(state)])

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        # of a damped one the multipliers of the motion are those of no motion that the system has
        return 1.0 + 0.0j if self.conservative else None

    @property
    def no_multipliers(self) -> str:
        """See `Augmentation.no_multipliers`."""
        return "" if self.conservative else "a damped mode is the motion of no system that stands by itself"

    def zeta(self, extra: Array) -> float:
        return float(extra[0])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> ModeEquations:
        return ModeEquations(self, state, float(extra[0]), names)


class ModeEquations(CycleEquations):
    """The phase condition, and what zeta does to R."""

    of: NonlinearMode

    def __init__(self, of: NonlinearMode, state: BalanceState, zeta: float, names: tuple[str, ...]) -> None:
        super().__init__(of, state, names)
        self.zeta = zeta
        #: R differentiated by zeta
        self.column: Array = _by_zeta(state)

    def jacobian(self, names: tuple[str, ...]) -> Array:
        out, n = super().jacobian(names), self.state.balance.dimension
        for i, slope in self.through_zeta(self.column, _by_zeta, names):
            out[:n, n + 1 + i] += slope
        return out

    def through_zeta(
        self, own: Array, by_zeta: Callable[[BalanceState], Array], names: tuple[str, ...]
    ) -> Iterator[tuple[int, Array]]:
        """What the forces of zeta do to the derivatives of R, or of a form, by the free parameters: which of names, and
        a column (m,); `by_zeta` is the derivative by zeta at a motion, (m,), `own` at this one.

        omega, the first of names, is a factor of these forces, and parameters may change the masses.
        """
        yield 0, self.zeta / self.state.omega * own
        for i, name in enumerate(names[1:], 1):
            if self.zeta and name in self.state.balance.system.mass.names:
                yield i, self.zeta * self._slope(by_zeta, name)

    def _slope(self, function: Callable[[BalanceState], Array], name: str) -> Array:
        """The derivative of a function of the motion by a parameter: a central difference."""
        state, value = self.state, self.state.values[name]
        step = _STEP * (abs(value) or 1.0)
        beside = [{**state.values, name: value + side * step} for side in (1.0, -1.0)]
        ahead, behind = (function(state.balance.at(state.x, state.omega, values)) for values in beside)
        return (ahead - behind) / (2.0 * step)

    def renewed(self) -> NonlinearMode:
        own = super().renewed()
        return replace(self.of, reference=own.reference, basis=own.basis, size=own.size)


def of_modes(item: Bifurcation) -> bool:
    """Whether something was located along nonlinear modes, or along curves of their events."""
    return "damped" in (item.context or {})


def _by_zeta(state: BalanceState) -> Array:
    """R differentiated by zeta, (dimension,)."""
    fed_by = apply_blocks(state.linear.feeding(state.frequencies), state.x)
    return np.asarray(2.0 * state.omega * fed_by).ravel()
