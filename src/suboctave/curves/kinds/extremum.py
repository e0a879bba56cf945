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
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from suboctave.continuation.linear import length
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.curves.kinds.bordering import bordered_factor, column_sizes, row_factors, sizes_of, with_harmonics
from suboctave.curves.kinds.branch_point import BranchPointEquations, BranchPointUnfolded
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.energy import fed
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

    @property
    def free_phase(self) -> bool:
        """As of the bifurcations."""
        return self.base.free_phase

    @property
    def trivial(self) -> int:
        """As of the bifurcations."""
        return self.base.trivial

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
        self.of, self.state, self.extra, self.names = of, state, extra, names
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


#: step of the differences that h is differentiated by, in units of the motion and of the parameters' ranges
_STEP = 1e-5


@dataclass(frozen=True)
class BorderedExtremal(Extremal):
    """h = 0, with bordering vectors of unit length for M in these units:

    rows
        `force` times one plus the square of the frequency over omega, weighted by masses.
    columns
        `size` of the motion, weighted by masses, and sizes of the extra unknowns and of p.
    """

    base: Augmentation
    beside: str
    right: Array
    left: Array
    force: float
    size: float
    sizes: Mapping[str, float]
    extra_sizes: Array
    turning: str = ""

    @classmethod
    def of(
        cls,
        base: Augmentation,
        state: BalanceState,
        extra: Array,
        beside: str,
        turning: str,
        sizes: Mapping[str, float],
        extra_sizes: Array,
    ) -> BorderedExtremal:
        """With the singular vectors of M at a motion.

        `sizes` are those of all free parameters by name, `extra_sizes` those of the extra unknowns.
        """
        blank = np.zeros(0)
        own = cls(base, beside, blank, blank, *sizes_of(state), dict(sizes), extra_sizes, turning)
        u, _, vt = np.linalg.svd(own.at(state, extra, tuple(sizes)).matrix)
        return replace(own, right=vt[-1], left=u[:, -1])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BorderedExtremalEquations:
        return BorderedExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> BorderedExtremal:
        rest = self.base.extras + 1
        right, left = (with_harmonics(v, basis.size * size, rest) for v in (self.right, self.left))
        return replace(self, base=self.base.resized(basis, size), right=right, left=left)


class BorderedExtremalEquations(ExtremalEquations):
    of: BorderedExtremal

    @lazy
    def _whole(self) -> Array:
        """Derivatives of Y by all unknowns in the units of `BorderedExtremal`, (m, m + number of names - 1)."""
        state, out = self.state, self.base.jacobian(self.names)
        out[: state.balance.dimension] *= row_factors(state, self.of.force)[:, None]
        return out * self._sizes

    @lazy
    def _sizes(self) -> Array:
        """Of the unknowns."""
        state, of = self.state, self.of
        return np.concatenate((column_sizes(state, of.size), of.extra_sizes, [of.sizes[name] for name in self.names]))

    @lazy
    def _kept(self) -> Array:
        """The columns of M among those of all unknowns."""
        free = len(self._sizes) - len(self.names)
        return np.append(np.arange(free), free + self.names.index(self.of.beside))

    @property
    def matrix(self) -> Array:
        """M, square."""
        result: Array = self._whole[:, self._kept]
        return result

    @lazy
    def _solved(self) -> tuple[Array, float, Array]:
        """v, h, and the left vector w."""
        factor, m = bordered_factor(self.matrix, self.of.left, self.of.right), len(self.of.right)
        last = np.eye(1, m + 1, m)[0]
        v, w = factor.solve(last), factor.solve(last, adjoint=True)
        return v[:m], float(v[m]), w[:m]

    @lazy
    def values(self) -> Array:
        return np.append(self.base.values, self._solved[1])

    @lazy
    def _slope(self) -> Array:
        """Derivatives of h in the units of `BorderedExtremal`."""
        v, _, w = self._solved
        ahead, behind = (self._moved(s * _STEP * v)._whole for s in (1.0, -1.0))
        result: Array = w @ (behind - ahead) / (2.0 * _STEP)
        return result

    @lazy
    def rows(self) -> Array:
        return np.vstack((self.base.rows, self._slope / self._sizes))

    def _moved(self, by: Array) -> BorderedExtremalEquations:
        """The equations beside, for the unknowns of M changed in the units of `BorderedExtremal`."""
        state, name, step = self.state, self.of.beside, by * self._sizes[self._kept]
        n = state.balance.dimension
        omega, values = state.omega, dict(state.values)
        if name == "omega":
            omega += step[-1]
        else:
            values[name] += step[-1]
        moved = state.balance.at(state.x + state.balance.shaped(step[:n]), omega, values)
        extra = self.extra + step[n:-1]
        return self.of.at(fed(moved, self.of.base.zeta(extra)), extra, self.names)

    @property
    def curvature(self) -> float:
        v, _, w = self._solved
        at = len(self._sizes) - len(self.names) + self.names.index(self.of.turning)
        return float(self._slope[self._kept] @ v) * float(w @ self._whole[:, at])

    def renewed(self) -> BorderedExtremal:
        v, _, w = self._solved
        force, size = sizes_of(self.state)
        right, left = v / length(v), w / length(w)
        return replace(self.of, base=self.base.renewed(), right=right, left=left, force=force, size=size)
