"""Extrema along curves of bifurcations by a bordered matrix: `[Y; h] = 0`, see `extremum`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

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
        blank = np.zeros(0)
        own = cls(base, beside, blank, blank, *_units(state), dict(sizes), extra_sizes, turning)
        u, _, vt = np.linalg.svd(own.at(state, extra, tuple(sizes)).matrix)
        return replace(own, right=vt[-1], left=u[:, -1])

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> BorderedExtremalEquations:
        return BorderedExtremalEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> BorderedExtremal:
        rest = self.base.extras + 1
        vectors = (_with_harmonics(v, basis.size * size, rest) for v in (self.right, self.left))
        right, left = (v / length(v) for v in vectors)
        return replace(self, base=self.base.resized(basis, size), right=right, left=left)


def _units(state: BalanceState) -> tuple[float, float]:
    """Sizes of the forces and of the motion, those of rest taken for one."""
    weight = state.balance.per_unknown(state.balance.scales()[0])
    return state.balanced.scale or 1.0, length(weight * state.x.ravel()) or 1.0


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
        state, out = self.state, self.base.jacobian(self.names)
        masses = state.balance.per_unknown(state.balance.scales()[1])
        waves = np.repeat(state.basis.multiples[(np.arange(state.basis.size) + 1) // 2], state.balance.size)
        out[: len(masses)] *= (masses / (self.of.force * (1.0 + waves**2)))[:, None]
        return out * self._sizes

    @lazy
    def _sizes(self) -> Array:
        """Of the unknowns."""
        state, of = self.state, self.of
        weight = state.balance.per_unknown(state.balance.scales()[0])
        return np.concatenate((of.size / weight, of.extra_sizes, [of.sizes[name] for name in self.names]))

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
        return self.of.at(moved, self.extra + step[n:-1], self.names)

    @property
    def curvature(self) -> float:
        v, _, w = self._solved
        at = len(self._sizes) - len(self.names) + self.names.index(self.of.turning)
        return float(self._slope[self._kept] @ v) * float(w @ self._whole[:, at])

    def renewed(self) -> BorderedExtremal:
        v, _, w = self._solved
        force, size = _units(self.state)
        right, left = v / length(v), w / length(w)
        return replace(self.of, base=self.base.renewed(), right=right, left=left, force=force, size=size)
