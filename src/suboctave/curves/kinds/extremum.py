"""Extrema of a parameter along curves of bifurcations, as systems of their own.

With `Y(U, q) = 0`, `U = (X, extra, p)`, the equations of a curve of bifurcations, q has an extremum where
`M = Y_U` is singular (Alcorta et al., Nonlinear Dynamics 98, 2019, Eq. 32). Minimally augmented:

    [Y; h] = 0,    [M b; c^T 0] [v; h] = [0; 1],    [M b; c^T 0]^T [w; h] = [0; 1].

By q, by a third parameter r, for which [Y; h] = 0 is a curve, and by U, h changes by `-w . d(Y_(U, q, r))[v]`: the
change of the Jacobian along v, a central difference of two of them.

Limit points have an extremum of q where `psi . R_p = 0` (psi the left null vector of R_X): p is then a direction along
which the branches do not leave, and a cusp, at which M is singular as well, is none. There all derivatives are
analytic,

    [R; g; psi . R_p] = 0.

The form `psi . R''[t, t]` on the null space of `[R_X R_p]` tells what happens to branches over p when q passes its
extremum: where it is definite a closed branch shrinks to a point and vanishes (isola centre), where it is indefinite
two branches meet and reconnect (isola merging) (Golubitsky & Schaeffer, Singularities and Groups in Bifurcation Theory
I, 1985, chapter III).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.curves.kinds.branch_point import BranchPointEquations, BranchPointUnfolded
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.lazy import lazy

#: determinant of the quadratic form over the square of its size below which its type is not certain
_DEGENERATE = 1e-8


class Extremal(Augmentation):
    """The equations of a kind of bifurcation, `base`, and that the parameter `turning` has an extremum along them.

    `beside` is the other parameter of the curve that has the extremum.
    """

    base: Augmentation
    beside: str

    @property
    def name(self) -> str:
        """Kind of the bifurcations."""
        return self.base.name

    @property
    def extras(self) -> int:
        """Extra unknowns of the bifurcations."""
        return self.base.extras

    @property
    def own(self) -> Augmentation:
        return self.base

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        return self.base.multiplier(rate, extra)

    def spans(self, rate: float) -> Array:
        return self.base.spans(rate)

    def shifted(self, extra: Array, angle: float) -> Array:
        return self.base.shifted(extra, angle)

    def unwrapped(self, extra: Array, near: Array) -> Array:
        return self.base.unwrapped(extra, near)

    @abstractmethod
    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> ExtremalEquations:
        """See `Augmentation.at`."""


class ExtremalEquations(Equations):
    """The equations of the bifurcation and the one of the extremum."""

    def __init__(self, of: Extremal, state: BalanceState, extra: Array, names: tuple[str, ...]) -> None:
        self.of = of
        self.state = state
        self.extra = extra
        self.names = names
        self.base = of.base.at(state, extra, names)
        self.addition, self.column = self.base.addition, self.base.column

    @property
    def own(self) -> Equations:
        return self.base

    @property
    @abstractmethod
    def curvature(self) -> float:
        """Second derivative of the extreme parameter along the curve it is extreme on, up to a positive factor."""

    @property
    def isola(self) -> str:
        """See `isola_type`; empty for all but limit points."""
        return ""


@dataclass(frozen=True)
class LimitPointExtremal(Extremal):
    """`psi . R_p = 0` besides g = 0, in units of forces over the size of the parameter, `unit`."""

    base: SingularOperator
    beside: str
    unit: float
    turning: str = ""

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> LimitPointExtremalEquations:
        return LimitPointExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> LimitPointExtremal:
        return replace(self, base=self.base.resized(basis, size))


class LimitPointExtremalEquations(ExtremalEquations):
    of: LimitPointExtremal
    base: SingularEquations

    @lazy
    def _both(self) -> BranchPointEquations:
        """g = 0 and psi . R_p = 0 are those of a branch point, here without its unfolding."""
        base = self.of.base
        both = BranchPointUnfolded(base.borders, self.of.beside, 1.0, (base.unit, self.of.unit))
        return BranchPointEquations(both, self.state, 0.0, self.names, self.base.bordered)

    @property
    def values(self) -> Array:
        return self._both.values

    @lazy
    def rows(self) -> Array:
        return np.delete(self._both.rows, self.state.balance.dimension, axis=1)

    @lazy
    def form(self) -> Array:
        """psi . R''[t, t] on the null space of [R_X R_p], spanned by (phi, 0) and (X', 1), up to a positive factor."""
        state, b = self.state, self.base.bordered
        n = state.balance.dimension
        at = n + self.names.index(self.of.beside)
        along = -state.residual_by(self.of.beside) * b.scale
        tangent = b.factor.solve(np.append(along, 0.0))[:n] * b.scale
        by_motion, by_slope = self.rows * np.array([[self.of.base.unit], [self.of.unit]])
        # the row of g is that of -psi . R_X phi
        bend = -float(by_motion[:n] @ b.right)
        mixed = float(by_slope[:n] @ b.right)
        other = float(by_slope[:n] @ tangent) + float(by_slope[at])
        return np.array([[bend, mixed], [mixed, other]])

    @property
    def isola(self) -> str:
        return isola_type(self.form)

    @property
    def curvature(self) -> float:
        (c, b), (_, a) = self.form
        # along the curve, with t = b phi - c v: there psi.R''[t, phi] = 0
        bent = c * (a * c - b * b)
        slope = float(self.base.bordered.left @ self.state.residual_by(self.of.turning))
        return -bent * slope

    def renewed(self) -> LimitPointExtremal:
        unit = self.of.unit * self.state.omega**2 / self.of.base.unit
        return replace(self.of, base=self.base.renewed(), unit=unit)


def isola_type(form: Array) -> str:
    """ "isola_centre" for a definite form, "isola_merging" for an indefinite one, empty where it is not certain."""
    (c, b), (_, a) = form
    determinant = a * c - b * b
    if not abs(determinant) > _DEGENERATE * (abs(a * c) + b * b):
        return ""
    return "isola_centre" if determinant > 0.0 else "isola_merging"
