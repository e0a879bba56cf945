"""Extrema along curves of bifurcations by a bordered matrix: `[Y; h] = 0`, see `extremum`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from suboctave.continuation.linear import Factor, length
from suboctave.curves.augmentation import Augmentation
from suboctave.curves.kinds.extremum import Extremal, ExtremalEquations
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.lazy import lazy

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
        weight = state.balance.per_unknown(state.balance.scales()[0])
        size = length(weight * state.x.ravel()) or 1.0
        blank = np.zeros(state.balance.dimension + base.extras + 1)
        own = cls(base, beside, blank, blank, state.balanced.scale or 1.0, size, dict(sizes), extra_sizes, turning)
        matrix = own.at(state, extra, tuple(sizes)).matrix
        u, _, vt = np.linalg.svd(matrix)
        return replace(own, right=vt[-1], left=u[:, -1])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BorderedExtremalEquations:
        return BorderedExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> BorderedExtremal:
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
        waves = np.repeat(state.basis.multiples[(np.arange(state.basis.size) + 1) // 2], state.balance.size)
        result: Array = masses / (self.of.force * (1.0 + waves**2))
        return result

    @lazy
    def _sizes(self) -> Array:
        """Of the unknowns."""
        state, of = self.state, self.of
        weight = state.balance.per_unknown(state.balance.scales()[0])
        return np.concatenate((of.size / weight, of.extra_sizes, [of.sizes[name] for name in self.names]))

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
        """The equations for M and h beside, for unknowns changed in the units of `BorderedExtremal`."""
        state, step = self.state, by * self._sizes
        n, q = state.balance.dimension, len(self.extra)
        x = state.x + state.balance.shaped(step[:n])
        change = dict(zip(self.names, step[n + q :].tolist(), strict=True))
        omega = state.omega + change.pop("omega", 0.0)
        values = {**state.values, **{name: state.values[name] + d for name, d in change.items()}}
        # M has a column of that parameter alone
        return self.of.at(state.balance.at(x, omega, values), self.extra + step[n : n + q], (self.of.beside,))

    @property
    def curvature(self) -> float:
        v, _, w = self._solved
        n = len(v) - 1
        names = n + np.arange(len(self.names))
        inside = np.zeros(n + len(self.names))
        inside[:n], inside[names[self.names.index(self.of.beside)]] = v[:n], v[n]
        along = float((self.rows[-1] * self._sizes) @ inside)
        return along * float(w @ self._whole[:, names[self.names.index(self.of.turning)]])

    def renewed(self) -> BorderedExtremal:
        v, _, w = self._solved
        state = self.state
        weight = state.balance.per_unknown(state.balance.scales()[0])
        size = length(weight * state.x.ravel()) or 1.0
        force = state.balanced.scale or 1.0
        return replace(
            self.of,
            base=self.base.renewed(),
            right=v / length(v),
            left=w / length(w),
            force=force,
            size=size,
        )
