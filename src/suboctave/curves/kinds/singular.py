"""Limit points, period doublings and Neimark-Sacker points: J_kappa is singular.

    LP, PD    g = 0                          kappa = 0, w0 / 2
    NS        Re g = Im g = 0                kappa unknown

g is the bordered scalar of `bifurcation.bordered`, in units of omega^2.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, kind_of
from suboctave.bifurcation.bordered import Bordered, NullVectors, bordered, null_vectors
from suboctave.curves.augmentation import Augmentation, Equations, Gradient
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, rate_by_kappa
from suboctave.lazy import lazy

OPERATORS = {"LP": Kind.INTEGER, "PD": Kind.HALF, "NS": Kind.FREE, "Hopf": Kind.FREE}


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

    @classmethod
    def started(
        cls, state: BalanceState, kind: Kind, kappa: float = 0.0, vectors: NullVectors | None = None
    ) -> tuple[SingularOperator, Array]:
        """The augmentation at a motion, with null vectors of its neighbourhood where they are known, and the start of
        its unknowns.
        """
        own = cls.of(state, kind, kappa) if vectors is None else cls(kind, vectors, state.omega**2)
        return own, np.array([kappa] if kind is Kind.FREE else [])

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[SingularOperator, Array]:
        kind, kappa = OPERATORS[kind_of(item)], 0.0
        if kind is Kind.FREE:
            kappa = item.kappa or float(np.angle(item.critical_multiplier())) * state.rate / (2.0 * np.pi)
        return cls.started(state, kind, kappa)

    @property
    def name(self) -> str:
        """Kind of bifurcation."""
        return "LP" if self.kind is Kind.INTEGER else "PD" if self.kind is Kind.HALF else "NS"

    @property
    def extras(self) -> int:
        """kappa, where it is free."""
        return 1 if self.kind is Kind.FREE else 0

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> SingularEquations:
        return SingularEquations(self, state, float(extra[0]) if self.extras else 0.0, names)

    def multiplier(self, rate: float, extra: Array) -> complex:
        if self.kind is Kind.FREE:
            return cmath.exp(2j * cmath.pi * float(extra[0]) / rate)
        return 1.0 + 0.0j if self.kind is Kind.INTEGER else -1.0 + 0.0j

    def spans(self, rate: float) -> Array:
        """kappa in units of the base frequency."""
        return np.full(self.extras, rate)

    def resized(self, basis: HarmonicBasis, size: int) -> SingularOperator:
        return replace(self, borders=self.borders.resized(basis, size, self.kind))


class SingularEquations(Equations):
    """g, or its real and imaginary part, in units of omega^2."""

    def __init__(self, of: SingularOperator, state: BalanceState, kappa: float, names: tuple[str, ...]) -> None:
        self.of, self.state, self.kappa, self.names = of, state, kappa, names
        self._kept: Gradient | None = None

    @lazy
    def bordered(self) -> Bordered:
        """g with its null vectors."""
        return bordered(self.state, self.of.kind, self.of.borders, self.kappa)

    @lazy
    def values(self) -> Array:
        g = self.bordered.g / self.of.unit
        return np.array([g.real, g.imag] if self.of.kind is Kind.FREE else [g.real])

    @lazy
    def gradient(self) -> Gradient:
        """Derivatives of g by the coefficients, by the two parameters, and by kappa."""
        return self._kept or self.bordered.gradient(self.names)

    def takes_over(self, other: Equations) -> bool:
        """Keep the gradient of a motion a rounding away, but for kappa: whether that vanishes is asked for."""
        b = self.bordered
        if type(other) is not SingularEquations or b.kind is Kind.FREE:
            return False
        by_x, rates, _ = other.gradient
        by_kappa = -rate_by_kappa(self.state, b.kind, b.left, b.right)
        self._kept = by_x, rates, by_kappa
        return True

    @property
    def rows(self) -> Array:
        by_x, rates, by_kappa = self.gradient
        if self.of.kind is not Kind.FREE:
            return np.concatenate((by_x.real, [rates[name].real for name in self.names]))[None] / self.of.unit
        whole = np.concatenate((by_x, [by_kappa], [rates[name] for name in self.names])) / self.of.unit
        return np.array([whole.real, whole.imag])

    def renewed(self) -> SingularOperator:
        return SingularOperator(self.of.kind, self.bordered.vectors, self.state.omega**2)
