"""What singles a bifurcation out among periodic motions: scalar equations beside R = 0.

    LP, PD      g = 0                        unknowns (X, two parameters)
    NS          Re g = Im g = 0              (X, kappa, two parameters)
    BP          g = 0, psi . R_p = 0         (X, beta, two parameters), R + beta b = 0
    grazing     u(tau) = gap, u'(tau) = 0    (X, tau, two parameters)

with g of `bordered`. Each is one equation more than it has extra unknowns, so that two free parameters leave a curve. A
branch point is a curve only where a symmetry forces it: beta then stays zero, which is what has to be watched.

The bordering vectors are frozen within Newton's method, which then solves fixed smooth equations, and renewed at every
accepted point, from where they are the null vectors themselves.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bordered import Bordered, NullVectors, bordered, null_vectors
from suboctave.bifurcation.gaps import level_rate, levels
from suboctave.bifurcation.grazing import basis_rows, read_direction
from suboctave.harmonic import real_form
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, form_rates, parameter_gradient
from suboctave.harmonic.selection import motion_size
from suboctave.harmonic.state import BalanceState
from suboctave.lazy import lazy

_NAMES = {Kind.INTEGER: "LP", Kind.HALF: "PD", Kind.FREE: "NS"}


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

    def takes_over(self, other: Equations) -> bool:
        """Whether these keep the derivatives of the same equations at a motion that is a rounding away."""
        return False


def gradient_of(b: Bordered, names: tuple[str, ...]) -> tuple[np.ndarray, dict[str, complex], complex]:
    """The gradient of g, the parameters' part apart: most of it is the same whatever the parameters are."""
    named = tuple(name for name in names if name != "omega")
    rates = form_rates(b.state, b.kind, b.left, b.right, named, b.kappa)
    if rates is None:
        return b.gradient(names)
    by_x, plain, by_kappa = b.gradient(("omega",))
    return by_x, plain | {name: -rate for name, rate in rates.items()}, by_kappa


class Augmentation(ABC):
    """Which scalar equations; fixed within a step."""

    #: the parameter that has an extremum along curves of these bifurcations (`extremum`), empty where none need have
    turning: str = ""

    @property
    @abstractmethod
    def name(self) -> str:
        """Kind of bifurcation."""

    @property
    def extras(self) -> int:
        """Number of extra unknowns."""
        return 0

    @property
    def own(self) -> Augmentation:
        """That of the bifurcation alone, without the equation of an extremum."""
        return self

    @abstractmethod
    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> Equations:
        """Evaluate at a motion, values of the extra unknowns, and the names of the free parameters."""

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
class SingularOperator(Augmentation):
    """J_kappa is singular: LP (Kind.INTEGER), PD (Kind.HALF), NS (Kind.FREE, with kappa unknown).

    `unit` is what g is measured in, omega^2.
    """

    kind: Kind
    borders: NullVectors
    unit: float

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, kappa: float = 0.0) -> SingularOperator:
        """With the null vectors at a motion."""
        return cls(kind, null_vectors(state, kind, kappa), state.omega**2)

    @property
    def name(self) -> str:
        """Kind of bifurcation."""
        return _NAMES[self.kind]

    @property
    def extras(self) -> int:
        """kappa, where it is free."""
        return 1 if self.kind is Kind.FREE else 0

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> SingularEquations:
        """See `Augmentation.at`."""
        return SingularEquations(self, state, float(extra[0]) if self.extras else 0.0, names)

    def spans(self, rate: float) -> Array:
        """kappa in units of the base frequency."""
        return np.full(self.extras, rate)

    def resized(self, basis: HarmonicBasis, size: int) -> SingularOperator:
        """See `Augmentation.resized`."""
        return replace(self, borders=self.borders.resized(basis, size, self.kind))


class SingularEquations(Equations):
    """g, or its real and imaginary part, in units of omega^2."""

    def __init__(self, of: SingularOperator, state: BalanceState, kappa: float, names: tuple[str, ...]) -> None:
        self.of = of
        self.state = state
        self.kappa = kappa
        self.names = names

    @lazy
    def bordered(self) -> Bordered:
        """g with its null vectors."""
        return bordered(self.state, self.of.kind, self.of.borders, self.kappa)

    @lazy
    def values(self) -> Array:
        """See `Equations.values`."""
        g = self.bordered.g / self.of.unit
        return np.array([g.real, g.imag] if self.of.extras else [g.real])

    @lazy
    def gradient(self) -> tuple[np.ndarray, dict[str, complex], complex]:
        """Derivatives of g by the coefficients, by the two parameters, and by kappa."""
        return gradient_of(self.bordered, self.names)

    def takes_over(self, other: Equations) -> bool:
        """Keep the gradient of a motion a rounding away, but for kappa: whether that vanishes is asked for."""
        b = self.bordered
        if type(other) is not SingularEquations or b.kind is Kind.FREE or not real_form.applies(self.state, ()):
            return False
        by_x, rates, _ = other.gradient
        by_kappa = -real_form.by_kappa(self.state, b.kind is Kind.INTEGER, b.left, b.right)
        self.__dict__["gradient"] = by_x, rates, by_kappa
        return True

    @property
    def rows(self) -> Array:
        """See `Equations.rows`."""
        by_x, rates, by_kappa = self.gradient
        if not self.of.extras:
            return np.append(by_x.real, [rates[name].real for name in self.names])[None] / self.of.unit
        whole = np.concatenate((by_x, [by_kappa], [rates[name] for name in self.names])) / self.of.unit
        return np.array([whole.real, whole.imag])

    def renewed(self) -> SingularOperator:
        """See `Equations.renewed`."""
        return SingularOperator(self.of.kind, self.bordered.vectors, self.state.omega**2)


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
        return state.force_scale() or state.omega**2

    def renewed(self, state: BalanceState, borders: NullVectors) -> BranchPointUnfolded:
        """The same at another motion, with its null vectors."""
        units = self._units(state, self.parameter)
        return replace(self, borders=borders, force=self._force(state), units=units)

    name = "BP"
    extras = 1

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BranchPointEquations:
        """See `Augmentation.at`."""
        return BranchPointEquations(self, state, float(extra[0]), names)

    def resized(self, basis: HarmonicBasis, size: int) -> BranchPointUnfolded:
        """See `Augmentation.resized`."""
        return replace(self, borders=self.borders.resized(basis, size, Kind.INTEGER))


class BranchPointEquations(Equations):
    """g in units of omega^2, and psi . R_p in units of the forces that balance, psi of unit length."""

    def __init__(self, of: BranchPointUnfolded, state: BalanceState, beta: float, names: tuple[str, ...]) -> None:
        self.of = of
        self.state = state
        self.names = names
        self.beta = beta
        self._unit = 1.0 / np.tile(state.balance.scales()[1], state.basis.size)
        self.column = of.force * of.borders.left * self._unit
        self.addition = beta * self.column

    @lazy
    def bordered(self) -> Bordered:
        """g with its null vectors."""
        return bordered(self.state, Kind.INTEGER, self.of.borders)

    @lazy
    def _slope(self) -> Array:
        return self.state.residual_by(self.of.parameter)

    @lazy
    def values(self) -> Array:
        """See `Equations.values`."""
        b = self.bordered
        return np.array([b.g.real, float(b.left @ self._slope)]) / self.of.units

    @lazy
    def gradient(self) -> tuple[np.ndarray, dict[str, complex], complex]:
        """Derivatives of g by the coefficients, by the two parameters, and by kappa."""
        return gradient_of(self.bordered, self.names)

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
        """See `Equations.renewed`."""
        return self.of.renewed(self.state, self.bordered.vectors)


@dataclass(frozen=True)
class GrazingContactEquations(Augmentation):
    """An extremum of an element's relative displacement reaches one of its gaps, at an instant tau of the period.

    `unit` is a displacement, the size of the motion.
    """

    element: int
    index: int
    unit: float

    @classmethod
    def of(cls, state: BalanceState, element: int, index: int) -> GrazingContactEquations:
        """With the unit of a motion."""
        return cls(element, index, motion_size(state) / float(np.max(state.balance.scales()[0])) or 1.0)

    name = "grazing"
    extras = 1

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> GrazingEquations:
        """See `Augmentation.at`."""
        return GrazingEquations(self, state, float(extra[0]), names)

    def spans(self, rate: float) -> Array:
        """tau in periods."""
        return np.array([2.0 * math.pi])

    def shifted(self, extra: Array, angle: float) -> Array:
        """See `Augmentation.shifted`."""
        return extra - angle

    def unwrapped(self, extra: Array, near: Array) -> Array:
        """See `Augmentation.unwrapped`: instants count modulo the period of the motion."""
        return extra - 2.0 * math.pi * np.round((extra - near) / (2.0 * math.pi))


class GrazingEquations(Equations):
    """`u(tau) - gap` and `du/dtau`, in units of the motion."""

    def __init__(self, of: GrazingContactEquations, state: BalanceState, tau: float, names: tuple[str, ...]) -> None:
        self.of = of
        self.state = state
        self.tau = tau
        self.names = names

    @lazy
    def _rows(self) -> tuple[Array, Array, Array, Array]:
        rows = basis_rows(self.state.basis.harmonics, self.tau)
        return (read_direction(self.state, self.of.element), *rows)

    @lazy
    def derivatives(self) -> tuple[float, float, float]:
        """u and its first two derivatives by tau at the instant."""
        direction, *rows = self._rows
        u = self.state.x @ direction
        value, slope, curve = (float(row @ u) for row in rows)
        return value, slope, curve

    @lazy
    def values(self) -> Array:
        """See `Equations.values`."""
        gap = levels(self.state.local(self.of.element))[self.of.index]
        value, slope, _ = self.derivatives
        return np.array([value - gap, slope]) / self.of.unit

    @property
    def rows(self) -> Array:
        """See `Equations.rows`."""
        direction, first, second, _ = self._rows
        _, slope, curve = self.derivatives
        gap = [-level_rate(self.state, self.of.element, self.of.index, name) for name in self.names]
        above = np.concatenate((np.multiply.outer(first, direction).ravel(), [slope], gap))
        level = np.concatenate((np.multiply.outer(second, direction).ravel(), [curve], np.zeros(len(gap))))
        return np.array([above, level]) / self.of.unit

    def renewed(self) -> GrazingContactEquations:
        """See `Equations.renewed`."""
        return GrazingContactEquations.of(self.state, self.of.element, self.of.index)


__all__ = ["Augmentation", "BranchPointUnfolded", "Equations", "GrazingContactEquations", "SingularOperator"]
