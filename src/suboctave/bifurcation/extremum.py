"""Extrema of a parameter along curves of bifurcations, as systems of their own.

With `Y(U, q) = 0`, `U = (X, extra, p)`, the equations of a curve of bifurcations (`augmented`), q has an extremum where
`M = Y_U` is singular (Alcorta et al., Nonlinear Dynamics 98, 2019, Eq. 32). Minimally augmented:

    [Y; h] = 0,    [M b; c^T 0] [v; h] = [0; 1].

h is taken where a step of Newton's method for Y leads to. Its gradient then lies in the directions that Y leaves free:
the tangent of the curve, or with a third parameter r the two directions of the surface Y(U, q, r) = 0, for which
[Y; h] = 0 is a curve. Central differences along these give it, and Newton's method stays quadratic.

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
from scipy.linalg import solve_triangular

from suboctave.bifurcation.augmented import (
    Augmentation,
    BranchPointEquations,
    BranchPointUnfolded,
    Equations,
    SingularEquations,
    SingularOperator,
)
from suboctave.continuation.linear import Factor, length
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.state import BalanceState
from suboctave.lazy import lazy

__all__ = ["Extremal", "ExtremalEquations", "LimitPointExtremalEquations", "extremal_of", "isola_type"]

#: step of the differences that h is differentiated by, in units of the motion and of the parameters' ranges
_STEP = 3e-5
#: determinant of the quadratic form over the square of its size below which its type is not certain
_DEGENERATE = 1e-8


class Extremal(Augmentation):
    """The equations of a kind of bifurcation, `base`, and that the parameter `turning` has an extremum along them.

    `beside` is the other parameter of the curve that has the extremum.
    """

    base: Augmentation
    beside: str

    @property
    def name(self) -> str:  # type: ignore[override]
        """Kind of the bifurcations."""
        return self.base.name

    @property
    def extras(self) -> int:  # type: ignore[override]
        """Extra unknowns of the bifurcations."""
        return self.base.extras

    @property
    def own(self) -> Augmentation:
        """See `Augmentation.own`."""
        return self.base

    def spans(self, rate: float) -> Array:
        """See `Augmentation.spans`."""
        return self.base.spans(rate)

    def shifted(self, extra: Array, angle: float) -> Array:
        """See `Augmentation.shifted`."""
        return self.base.shifted(extra, angle)

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
        """See `Equations.own`."""
        return self.base

    @property
    @abstractmethod
    def curvature(self) -> float:
        """Second derivative of the extreme parameter along the curve it is extreme on, up to a positive factor."""

    @property
    def isola(self) -> str:
        """See `isola_type`; empty for all but limit points."""
        return ""


def extremal_of(
    base: Augmentation, state: BalanceState, extra: Array, beside: str, turning: str, spans: Mapping[str, float]
) -> Extremal:
    """The extremum of a parameter along a curve of bifurcations, at a motion near it.

    Parameters
    ----------
    base, extra
        What singles the bifurcation out, with bordering vectors of this motion, and its extra unknowns.
    beside, turning
        The two parameters of the curve, the latter extreme.
    spans
        Sizes of all free parameters by name.
    """
    if isinstance(base, SingularOperator) and base.name == "LP":
        return LimitPointExtremal(base, beside, state.force_scale() / spans[beside], turning)
    return BorderedExtremal.of(base, state, extra, beside, turning, spans)


@dataclass(frozen=True)
class LimitPointExtremal(Extremal):
    """`psi . R_p = 0` besides g = 0, in units of forces over the size of the parameter, `unit`."""

    base: SingularOperator
    beside: str
    unit: float
    turning: str = ""

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> LimitPointExtremalEquations:
        """See `Augmentation.at`."""
        return LimitPointExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> LimitPointExtremal:
        """See `Augmentation.resized`."""
        return replace(self, base=self.base.resized(basis, size))


class LimitPointExtremalEquations(ExtremalEquations):
    """See `LimitPointExtremal`."""

    of: LimitPointExtremal
    base: SingularEquations

    @lazy
    def _both(self) -> BranchPointEquations:
        """g = 0 and psi . R_p = 0 are those of a branch point, here without its unfolding."""
        base = self.of.base
        both = BranchPointUnfolded(base.borders, self.of.beside, 1.0, (base.unit, self.of.unit))
        equations = both.at(self.state, np.zeros(1), self.names)
        equations.__dict__["bordered"] = self.base.bordered
        return equations

    @property
    def values(self) -> Array:
        """See `Equations.values`."""
        return self._both.values

    @lazy
    def rows(self) -> Array:
        """See `Equations.rows`."""
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
        """See `isola_type`."""
        return isola_type(self.form)

    @property
    def curvature(self) -> float:
        """See `ExtremalEquations.curvature`."""
        (c, b), (_, a) = self.form
        # along the curve, with t = b phi - c v: there psi.R''[t, phi] = 0
        bent = c * (a * c - b * b)
        slope = float(self.base.bordered.left @ self.state.residual_by(self.of.turning))
        return -bent * slope

    def renewed(self) -> LimitPointExtremal:
        """See `Equations.renewed`."""
        unit = self.of.unit * self.state.omega**2 / self.of.base.unit
        return replace(self.of, base=self.base.renewed(), unit=unit)


def isola_type(form: Array) -> str:
    """ "isola_centre" for a definite form, "isola_merging" for an indefinite one, empty where it is not certain."""
    (c, b), (_, a) = form
    determinant = a * c - b * b
    if not abs(determinant) > _DEGENERATE * (abs(a * c) + b * b):
        return ""
    return "isola_centre" if determinant > 0.0 else "isola_merging"


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
    ) -> BorderedExtremal:
        """With the singular vectors of M at a motion."""
        weight = state.balance.per_unknown(state.balance.scales()[0])
        size = length(weight * state.x.ravel()) or 1.0
        blank = np.zeros(state.balance.dimension + base.extras + 1)
        own = cls(base, beside, blank, blank, state.force_scale() or 1.0, size, dict(sizes), turning)
        matrix = own.at(state, extra, tuple(sizes)).matrix
        u, _, vt = np.linalg.svd(matrix)
        return replace(own, right=vt[-1], left=u[:, -1])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BorderedExtremalEquations:
        """See `Augmentation.at`."""
        return BorderedExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> BorderedExtremal:
        """See `Augmentation.resized`."""
        rest = self.base.extras + 1
        vectors = (_with_harmonics(v, basis.size * size, rest) for v in (self.right, self.left))
        right, left = (v / length(v) for v in vectors)
        return replace(self, base=self.base.resized(basis, size), right=right, left=left)


def _with_harmonics(vector: Array, count: int, rest: int) -> Array:
    """The coefficients cut or filled with zeros to `count`, the last `rest` entries kept."""
    coefficients = np.zeros(count)
    had = vector[: len(vector) - rest]
    coefficients[: min(count, len(had))] = had[:count]
    return np.concatenate((coefficients, vector[len(vector) - rest :]))


class BorderedExtremalEquations(ExtremalEquations):
    """See `BorderedExtremal`."""

    of: BorderedExtremal

    @lazy
    def _whole(self) -> Array:
        """Derivatives of Y by all unknowns in the units of `BorderedExtremal`, (m, m + number of names - 1)."""
        state, base = self.state, self.base
        n, q = state.balance.dimension, len(self.extra)
        out = np.zeros((n + q + 1, n + q + len(self.names)))
        out[:n, :n] = state.jacobian
        if base.column is not None:
            out[:n, n] = base.column
        for i, name in enumerate(self.names):
            out[:n, n + q + i] = state.residual_by(name)
        out[n:] = base.rows
        out[:n] *= self._row_weights[:, None]
        out *= self._sizes
        return out

    @lazy
    def _row_weights(self) -> Array:
        state = self.state
        masses = state.balance.per_unknown(state.balance.scales()[1])
        rows = np.arange(state.basis.size) if state.basis.rows is None else state.basis.rows
        waves = np.repeat(state.basis.multiples[(rows + 1) // 2], state.balance.size)
        result: Array = masses / (self.of.force * (1.0 + waves**2))
        return result

    @lazy
    def _sizes(self) -> Array:
        """Of the unknowns."""
        state, of = self.state, self.of
        weight = state.balance.per_unknown(state.balance.scales()[0])
        return np.concatenate((of.size / weight, of.base.spans(state.rate), [of.sizes[name] for name in self.names]))

    @property
    def matrix(self) -> Array:
        """M, square."""
        columns = len(self.extra) + self.state.balance.dimension
        kept = [*range(columns), columns + self.names.index(self.of.beside)]
        result: Array = self._whole[:, kept]
        return result

    @lazy
    def _solved(self) -> tuple[Array, float, Array]:
        """v, h, and the left vector w."""
        matrix = self.matrix
        m = len(matrix)
        extended = np.zeros((m + 1, m + 1), order="F")
        extended[:m, :m] = matrix
        extended[:m, m], extended[m, :m] = self.of.left, self.of.right
        factor = Factor.of(extended, overwrite=True)
        if factor.singular:
            raise ConvergenceError("two extrema or singular points fall together: the bordered matrix is singular")
        last = np.eye(1, m + 1, m)[0]
        v, w = factor.solve(last), factor.solve(last, adjoint=True)
        return v[:m], float(v[m]), w[:m]

    @lazy
    def values(self) -> Array:
        """See `Equations.values`."""
        q, r = self._directions
        m = len(r)
        top = self.state.residual if self.addition is None else self.state.residual + self.addition
        left = np.concatenate((top * self._row_weights, self.base.values))
        step = q[:, :m] @ solve_triangular(r, left, trans="T")
        return np.append(self.base.values, self._moved(-step)._solved[1])

    @lazy
    def _directions(self) -> tuple[Array, Array]:
        """Q and R of the derivatives of Y, transposed: the last columns of Q are the directions that Y leaves free."""
        q, r = np.linalg.qr(self._whole.T, mode="complete")
        return q, r[: len(self._whole)]

    @lazy
    def rows(self) -> Array:
        """See `Equations.rows`; that of h within the directions that Y leaves free."""
        q, r = self._directions
        row = np.zeros(len(q))
        for direction in q[:, len(r) :].T:
            ahead, behind = (self._moved(s * _STEP * direction)._solved[1] for s in (1.0, -1.0))
            row += (ahead - behind) / (2.0 * _STEP) * direction
        return np.vstack((self.base.rows, row / self._sizes))

    def _moved(self, by: Array) -> BorderedExtremalEquations:
        """The equations beside, for unknowns changed in the units of `BorderedExtremal`."""
        state, step = self.state, by * self._sizes
        n, q = state.balance.dimension, len(self.extra)
        x = state.x + state.balance.spread(step[:n])
        change = dict(zip(self.names, step[n + q :].tolist(), strict=True))
        omega = state.omega + change.pop("omega", 0.0)
        values = {**state.values, **{name: state.values[name] + d for name, d in change.items()}}
        return self.of.at(state.balance.at(x, omega, values), self.extra + step[n : n + q], self.names)

    @property
    def curvature(self) -> float:
        """See `ExtremalEquations.curvature`."""
        v, _, w = self._solved
        n = len(v) - 1
        names = n + np.arange(len(self.names))
        inside = np.zeros(n + len(self.names))
        inside[:n], inside[names[self.names.index(self.of.beside)]] = v[:n], v[n]
        along = float((self.rows[-1] * self._sizes) @ inside)
        return along * float(w @ self._whole[:, names[self.names.index(self.of.turning)]])

    def renewed(self) -> BorderedExtremal:
        """See `Equations.renewed`."""
        v, _, w = self._solved
        state = self.state
        weight = state.balance.per_unknown(state.balance.scales()[0])
        size = length(weight * state.balance.packed(state.x)) or 1.0
        force = state.force_scale() or 1.0
        return replace(
            self.of,
            base=self.base.renewed(),
            right=v / length(v),
            left=w / length(w),
            force=force,
            size=size,
        )
