"""Period doublings and Neimark-Sacker points of motions of a free phase: of limit cycles, of conservative modes PD.

    Y(X, zeta, omega, p) = 0,    g = 0

Y are the equations of their family (`limit_cycle`, `nonlinear_mode`), g is that of `singular`. Of a conservative mode
J_half has one null vector though two multipliers are -1, which have one eigenvector: on one side of it the pair lies on
the unit circle, on the other it is real, and det J_half changes sign. zeta moves both off -1 to second order only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import null_vectors
from suboctave.curves.kinds.limit_cycle import LimitCycle
from suboctave.curves.kinds.nonlinear_mode import ModeEquations, NonlinearMode, of_modes
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, rate_by_feeding
from suboctave.lazy import lazy


@dataclass(frozen=True)
class FreePhaseOperator(SingularOperator):
    """J_kappa is singular at a motion of a family; the extra unknowns are kappa, where it is free, and the family's."""

    family: LimitCycle
    free_phase = True

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[FreePhaseOperator, Array]:
        """See `Augmentation.through`."""
        family, more = (NonlinearMode if of_modes(item) else LimitCycle).through(item, state, names)
        own, extra = SingularOperator.through(item, state, names)
        return cls(own.kind, own.borders, own.unit, family), np.append(extra, more)

    def of_kind(self, state: BalanceState, kind: Kind) -> FreePhaseOperator:
        """Another operator of the same family, with the null vectors at a motion."""
        return FreePhaseOperator(kind, null_vectors(state, kind), state.omega**2, self.family)

    @property
    def conservative(self) -> bool:
        """Whether they are those of conservative modes: two multipliers are +1 by themselves, two are critical."""
        return isinstance(self.family, NonlinearMode)

    @property
    def extras(self) -> int:
        return super().extras + self.family.extras

    @property
    def trivial(self) -> int:
        return self.family.trivial

    def zeta(self, extra: Array) -> float:
        return self.family.zeta(self.of_family(extra))

    def of_family(self, extra: Array) -> Array:
        """The extra unknowns of the family."""
        return extra[super().extras :]

    def spans(self, rate: float) -> Array:
        return np.append(super().spans(rate)[: super().extras], self.family.spans(rate))

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> FreePhaseEquations:
        return FreePhaseEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> FreePhaseOperator:
        borders = self.borders.resized(basis, size, self.kind)
        return replace(self, borders=borders, family=self.family.resized(basis, size))


class FreePhaseEquations(SingularEquations):
    """The equations of the family and those of the bifurcation."""

    of: FreePhaseOperator

    def __init__(self, of: FreePhaseOperator, state: BalanceState, extra: Array, names: tuple[str, ...]) -> None:
        super().__init__(of, state, float(extra[0]) if of.extras > of.family.extras else 0.0, names)
        self.family = of.family.at(state, of.of_family(extra), names)
        self.column = self.family.column

    @lazy
    def values(self) -> Array:
        return np.concatenate((self.family.values, super().values))

    @property
    def rows(self) -> Array:
        own = super().rows
        if isinstance(self.family, ModeEquations):
            own = np.insert(own, self.state.balance.dimension, 0.0, axis=1)
            first, by_zeta = own.shape[1] - len(self.names), self._by_zeta(self.state)
            own[:, first - 1] += by_zeta
            for i, slope in self.family.through_zeta(by_zeta, self._by_zeta, self.names):
                own[:, first + i] += slope
        return np.concatenate((self.family.beside(self.of.extras), own))

    def _by_zeta(self, state: BalanceState) -> Array:
        """g differentiated by zeta, for its vectors as they are, (1,)."""
        b = self.bordered
        rate = rate_by_feeding(state, b.kind, b.left, b.right)
        return np.array([-2.0 * state.omega * rate.real / self.of.unit])

    def jacobian(self, names: tuple[str, ...]) -> Array:
        family, rows, n = self.family.jacobian(names), self.rows, self.state.balance.dimension
        out = np.zeros((n + len(rows), rows.shape[1]))
        out[:n, :n], out[:n, n - family.shape[1] :] = family[:n, :n], family[:n, n:]
        out[n:] = rows
        return out

    def renewed(self) -> FreePhaseOperator:
        own = super().renewed()
        return FreePhaseOperator(own.kind, own.borders, own.unit, self.family.renewed())
