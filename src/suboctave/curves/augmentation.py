"""What singles a motion out among those of a system: scalar equations beside R = 0, and the unknowns they bring.

An augmentation has one equation more than extra unknowns, so that two free parameters leave a curve; as many leave one
along a single free parameter: the empty one the responses. Each kind of curve is a file in `kinds`.

Bordering vectors are frozen within Newton's method, which then solves fixed smooth equations, and renewed at every
accepted point, from where they are the null vectors themselves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState

#: of g by the coefficients, by parameters, by kappa
Gradient = tuple[np.ndarray, dict[str, complex], complex]


class Equations(ABC):
    """The scalar equations at one motion, dimensionless."""

    state: BalanceState
    #: what is added to R, shape (dimension,), and its derivative by the extra unknown; None for nothing
    addition: Array | None = None
    column: Array | None = None

    @property
    def own(self) -> Equations:
        """Those of the bifurcation alone, without that of an extremum."""
        return self

    @property
    @abstractmethod
    def values(self) -> Array:
        """Values, shape (q + 1,), q the number of extra unknowns."""

    @property
    @abstractmethod
    def rows(self) -> Array:
        """Derivatives by coefficients, extra unknowns and the free parameters, shape (q + 1, dimension + q + 2)."""

    @abstractmethod
    def renewed(self) -> Augmentation:
        """The augmentation with bordering vectors of this motion."""

    def jacobian(self, names: tuple[str, ...]) -> Array:
        """Derivatives of R, with what is added to it, and of the values, like `rows`; names: the free parameters."""
        n, along, rows = self.state.balance.dimension, self.state.extended_jacobian(names[0]), self.rows
        if not rows.size:
            return along
        out, first = np.empty((n + len(rows), rows.shape[1])), rows.shape[1] - len(names)
        out[:n, :n], out[:n, n:first], out[:n, first] = along[:, :n], 0.0, along[:, n]
        if self.column is not None:
            out[:n, n] = self.column
        for i, name in enumerate(names[1:], first + 1):
            out[:n, i] = self.state.residual_by(name)
        out[n:] = rows
        return out

    def takes_over(self, other: Equations) -> bool:
        """Whether these keep the derivatives of the same equations at a motion that is a rounding away."""
        return False


class Augmentation(ABC):
    """Which scalar equations; fixed within a step."""

    #: the parameter that has an extremum along curves of these bifurcations (`extremum`), empty where none need have
    turning: str = ""
    #: whether free parameters count in units of their own values, not of their ranges
    relative: bool = False
    #: whether the equations read the observed degree of freedom, which is an unknown then
    reads_observed: bool = False

    #: how many bifurcations of the kind fall together at a solution
    multiplicity: int = 1

    @property
    @abstractmethod
    def name(self) -> str:
        """Kind of bifurcation."""

    @property
    def extras(self) -> int:
        """Number of extra unknowns."""
        return 0

    @property
    def free_phase(self) -> bool:
        """Whether a motion shifted in time is another solution: no load sets its phase, and omega is unknown."""
        return False

    @property
    def trivial(self) -> int:
        """How many multipliers are critical at a solution; of two real ones rounding leaves the mean alone."""
        return 1

    @property
    def no_multipliers(self) -> str:
        """Why the multipliers of its motions mean nothing, empty where they do."""
        return ""

    @property
    def own(self) -> Augmentation:
        """That of the bifurcation alone, without the equation of an extremum."""
        return self

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[Augmentation, Array]:
        """That of the curve through a located point, at its motion, and the start of the extra unknowns."""
        raise TypeError(f"no curve begins with {cls.__name__}")

    @abstractmethod
    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> Equations:
        """Evaluate at a motion, values of the extra unknowns, and the names of the free parameters."""

    def zeta(self, extra: Array) -> float:
        """The damping ratio that keeps the motions of a mode going, see `energy.fed`."""
        return 0.0

    def unfolding(self, extra: Array) -> float:
        """What must be zero of the extra unknowns, in units of the forces that balance, for the equations to mean what
        they should.
        """
        return 0.0

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        """The multiplier that lies on the unit circle at a solution, None if none need; rate: the base frequency."""
        return None

    def spans(self, rate: float) -> Array:
        """Natural sizes of the extra unknowns, shape (q,); rate: the base frequency."""
        return np.ones(self.extras)

    def resized(self, basis: HarmonicBasis, size: int) -> Augmentation:
        """The same in a basis with other harmonics."""
        return self

    def shifted(self, extra: Array, angle: float) -> Array:
        """Extra unknowns of the motion shifted in time, `x(tau + angle)`."""
        return extra

    def unwrapped(self, extra: Array, near: Array) -> Array:
        """Extra unknowns, periodic ones moved by whole periods next to others."""
        return extra

    def carried(self, extra: Array, basis: HarmonicBasis, size: int) -> Array:
        """Extra unknowns in a basis with other harmonics."""
        return extra


@dataclass(frozen=True)
class Plain(Augmentation):
    """No scalar equation: all motions, along one free parameter."""

    name, extras, free_phase = "response", 0, False

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> NoEquations:
        return NoEquations(state, self)


PLAIN = Plain()


class NoEquations(Equations):
    """Nothing beside the equations of motion."""

    values = rows = np.zeros(0)

    def __init__(self, state: BalanceState, of: Plain) -> None:
        self.state = state
        self.of = of

    def renewed(self) -> Plain:
        return self.of
