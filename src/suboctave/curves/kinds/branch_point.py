"""Branch points: J_0 is singular and R_p lies in its range, psi . R_p = 0.

In two parameters that is one condition too many: the equations are unfolded, `R + beta b = 0` with beta unknown. A
branch point is a curve only where a symmetry forces it: beta then stays zero, which is what has to be watched.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import Bordered, NullVectors, bordered, null_vectors
from suboctave.curves.augmentation import Augmentation, Equations, Gradient
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, parameter_gradient
from suboctave.lazy import lazy


@dataclass(frozen=True)
class BranchPointUnfolded(Augmentation):
    """J_0 is singular and R_p lies in its range, with the unfolding beta in units of the forces that balance, `force`.

    `parameter` is p, one of the two free ones; `units` are those of g, omega^2, and of psi . R_p, force over the
    parameter's own size.
    """

    borders: NullVectors
    parameter: str
    force: float
    units: tuple[float, float]

    @classmethod
    def of(cls, state: BalanceState, parameter: str) -> BranchPointUnfolded:
        """With the null vectors at a motion."""
        return cls(null_vectors(state, Kind.INTEGER), parameter, cls._force(state), cls._units(state, parameter))

    @staticmethod
    def _units(state: BalanceState, parameter: str) -> tuple[float, float]:
        value = state.omega if parameter == "omega" else abs(state.values[parameter])
        return state.omega**2, BranchPointUnfolded._force(state) / (value or 1.0)

    @staticmethod
    def _force(state: BalanceState) -> float:
        """Size of the forces; at rest, where there are none, that of a motion of unit size."""
        return state.balanced.scale or state.omega**2

    @classmethod
    def through(
        cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]
    ) -> tuple[BranchPointUnfolded, Array]:
        return cls.of(state, names[0]), np.zeros(1)

    name = "BP"
    extras = 1

    def multiplier(self, rate: float, extra: Array) -> complex:
        return 1.0 + 0.0j

    def unfolding(self, extra: Array) -> float:
        return float(extra[0])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BranchPointEquations:
        return BranchPointEquations(self, state, float(extra[0]), names)

    def resized(self, basis: HarmonicBasis, size: int) -> BranchPointUnfolded:
        return replace(self, borders=self.borders.resized(basis, size, Kind.INTEGER))


class BranchPointEquations(Equations):
    """g in units of omega^2, and psi . R_p in units of the forces that balance, psi of unit length."""

    def __init__(
        self,
        of: BranchPointUnfolded,
        state: BalanceState,
        beta: float,
        names: tuple[str, ...],
        border: Bordered | None = None,
    ) -> None:
        self.of, self.state, self.beta, self.names = of, state, beta, names
        self._border = border
        self._unit = 1.0 / np.tile(state.balance.scales[1], state.basis.size)
        self.column = of.force * of.borders.left * self._unit
        self.addition = beta * self.column

    @lazy
    def bordered(self) -> Bordered:
        """g with its null vectors."""
        return bordered(self.state, Kind.INTEGER, self.of.borders) if self._border is None else self._border

    @lazy
    def _slope(self) -> Array:
        return self.state.residual_by(self.of.parameter)

    @lazy
    def values(self) -> Array:
        b = self.bordered
        return np.array([b.g.real, float(b.left @ self._slope)]) / self.of.units

    @lazy
    def gradient(self) -> Gradient:
        """Derivatives of g by the coefficients, by the two parameters, and by kappa."""
        return self.bordered.gradient(self.names)

    @property
    def rows(self) -> Array:
        """`d(u . R_p) = u . R_p,q - u . J_q w` with `J w = R_p` in the bordered sense."""
        b, state = self.bordered, self.state
        by_x, rates, _ = self.gradient
        w = b.factor.solve(np.append(self._slope * b.scale, 0.0))[:-1] * b.scale
        first = parameter_gradient(state, b.left, self.of.parameter, self.names)
        second = bilinear_gradient(state, Kind.INTEGER, b.left, w, self.names)
        top = np.concatenate((by_x.real, [0.0], [rates[name].real for name in self.names]))
        along = [(first.rates[name] - second.rates[name]).real for name in self.names]
        below = np.concatenate(((first.x - second.x).real.ravel(), [0.0], along))
        return np.array([top / self.of.units[0], below / self.of.units[1]])

    def renewed(self) -> BranchPointUnfolded:
        of, state = self.of, self.state
        units = of._units(state, of.parameter)
        return replace(of, borders=self.bordered.vectors, force=of._force(state), units=units)
