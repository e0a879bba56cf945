"""Phase resonance: a harmonic of the observed displacement lags the load by a quarter of its period.

    Re(z^q conj(f)^k) = 0,        q arg z = k arg f - pi/2 (up to pi)

z the complex amplitude at `k/q omega` (in lowest terms), f that of the load at omega; shifts by load periods change
nothing. At k/q = 1 it is phase quadrature, the backbone; at 3 a super-, at 1/3 a subharmonic resonance (Volvert &
Kerschen, Phase resonance nonlinear modes of mechanical systems, Journal of Sound and Vibration 511, 2021).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import Array, harmonic_index
from suboctave.harmonic.evaluation import BalanceState


@dataclass(frozen=True)
class PhaseResonance(Augmentation):
    """`order` k/q; `dof` of the displacement; `driven`, that whose load counts; `unit` of the equation."""

    order: Fraction
    dof: int
    driven: int
    unit: float = 1.0
    name = "phase_resonance"
    reads_observed = True

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[PhaseResonance, Array]:
        """See `Augmentation.through`; the number `harmonic` is a multiple of omega."""
        nu, extra = state.basis.nu, np.zeros(0)
        driven = state.balance.loads.strongest(1, {**state.values, "omega": state.omega})
        if driven < 0:
            raise InputError("there is no load at omega that a phase could be measured against")
        order = harmonic_index(item.context["onto"]["harmonic"], nu)
        return cls(Fraction(order, nu), item.context["observe"], driven).at(state, extra, names).renewed(), extra

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> PhaseEquations:
        return PhaseEquations(self, state, names)


class PhaseEquations(Equations):
    """The real part in units of `z^q conj(f)^k` at the last point."""

    def __init__(self, of: PhaseResonance, state: BalanceState, names: tuple[str, ...]) -> None:
        self.of, self.state, self.names = of, state, names
        self.at = int(of.order * 2 * state.basis.nu) - 1
        if self.at > len(state.x) - 2:
            raise ConvergenceError(f"the harmonic at {of.order} omega is not kept")
        self.reads = state.balance.along(of.dof)
        z = complex(*(state.x[self.at : self.at + 2] @ self.reads)).conjugate()
        f, (k, q) = self._conjugate_force(), of.order.as_integer_ratio()
        self.product, self.by_z, self.by_f = z**q * f**k, q * z ** (q - 1) * f**k, k * z**q * f ** (k - 1)

    def _conjugate_force(self, *names: str) -> complex:
        """The conjugate amplitude of the load, differentiated by names."""
        values = {**self.state.values, "omega": self.state.omega}
        return self.state.balance.loads.force(1, values, self.of.driven, names).conjugate()

    @property
    def values(self) -> Array:
        return np.array([self.product.real / self.of.unit])

    @property
    def rows(self) -> Array:
        by_x = np.zeros_like(self.state.x)
        by_x[self.at : self.at + 2] = np.outer((self.by_z.real, self.by_z.imag), self.reads)
        along = [(self.by_f * self._conjugate_force(name)).real for name in self.names]
        return np.append(by_x.ravel(), along)[None] / self.of.unit

    def renewed(self) -> PhaseResonance:
        return replace(self.of, unit=abs(self.product) or 1.0)
