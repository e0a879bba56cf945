"""Multiple bifurcations: several multipliers pass +1, -1 or one place on the unit circle together.

Where a structure is symmetric (equal sectors, equal oscillators) its modes come in families, and the null space of J
has m dimensions, along one branch without further conditions. With m border vectors on either side,

    [J B; C^H 0] [V; G] = [0; 1],     [J B; C^H 0]^H [U; .] = [0; 1],

the m x m matrix G vanishes there, and `tr G = 0` is the one equation that locates it; the derivative is
`G_p = -U^H J_p V`, as of the scalar g of `bifurcation.bordered`. R_X itself is singular where J is J_0: its equations
are unfolded, and what the motion has along the null vectors is that of the branch beside,

    R + B beta = 0,    C^T (X - X_0) = 0,    tr G = 0.

beta vanishes where the symmetry forces it, and G with its trace: both have to be watched (Golubitsky, Stewart &
Schaeffer, Singularities and Groups in Bifurcation Theory II, 1988, chapter XIII).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import polar

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import NullVectors, weighted_operator
from suboctave.continuation.linear import Factor
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Gradient, Kind, bilinear_gradient
from suboctave.harmonic.truncation import motion_size
from suboctave.lazy import lazy

_NAMES = {Kind.INTEGER: "BP", Kind.HALF: "PD", Kind.FREE: "NS"}
_OPERATORS = {name: kind for kind, name in _NAMES.items()} | {"Hopf": Kind.FREE}


@dataclass(frozen=True)
class MultiplePoint(Augmentation):
    """tr G of J_0 (Kind.INTEGER), J_half (Kind.HALF) or J_kappa (Kind.FREE) is zero.

    `left`, `right`: B and C, `multiplicity` unit columns each, (N, m), in mass weights; `reference`: X_0 there,
    (dimension,); `unit`: of G, omega^2; `force`: of the unfolding.
    """

    kind: Kind
    left: ComplexArray
    right: ComplexArray
    reference: Array
    unit: float
    force: float
    multiplicity: int = 2

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, multiplicity: int, name: str, kappa: float = 0.0) -> MultiplePoint:
        """With the singular vectors of the smallest singular values at a motion, those on the left turned such that G
        changes along the branch in its free parameter `name` like a multiple of the unit matrix: its eigenvalues pass
        zero alike.
        """
        matrix, scale = weighted_operator(state, kind, kappa)
        u, _, vh = np.linalg.svd(matrix)
        left, right = u[:, -multiplicity:], vh[-multiplicity:].conj().T
        reference = state.unknowns / scale if kind is Kind.INTEGER else np.zeros(0)
        force = state.balanced.scale or state.omega**2
        own = cls(kind, left, right, reference, state.omega**2, force, multiplicity)
        extra = np.array([kappa]) if kind is Kind.FREE else np.zeros(own.extras)
        turn, _ = polar(own.at(state, extra, (name,)).change)
        return replace(own, left=left @ turn)

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[MultiplePoint, Array]:
        """See `Augmentation.through`."""
        own = cls.of(state, _OPERATORS[item.kind], item.multiplicity, names[0], item.kappa)
        return own, np.full(own.extras, item.kappa)

    @property
    def name(self) -> str:
        """Kind of bifurcation."""
        return _NAMES[self.kind]

    @property
    def extras(self) -> int:
        """beta, or kappa."""
        return {Kind.INTEGER: self.multiplicity, Kind.HALF: 0, Kind.FREE: 1}[self.kind]

    def multiplier(self, rate: float, extra: Array) -> complex:
        if self.kind is Kind.FREE:
            return cmath.exp(2j * cmath.pi * float(extra[0]) / rate)
        return 1.0 + 0.0j if self.kind is Kind.INTEGER else -1.0 + 0.0j

    def spans(self, rate: float) -> Array:
        """kappa in units of the base frequency."""
        return np.full(self.extras, rate if self.kind is Kind.FREE else 1.0)

    def resized(self, basis: HarmonicBasis, size: int) -> MultiplePoint:
        pairs = [NullVectors(*pair) for pair in zip(self.right.T, self.left.T, strict=True)]
        pairs = [pair.resized(basis, size, self.kind) for pair in pairs]
        # harmonics in ascending order; border vectors have no others
        reference = np.zeros(len(pairs[0].right) if self.reference.size else 0)
        kept = min(len(reference), len(self.reference))
        reference[:kept] = self.reference[:kept]
        right, left = (np.column_stack([getattr(pair, side) for pair in pairs]) for side in ("right", "left"))
        return replace(self, right=right, left=left, reference=reference)

    def unfolding(self, extra: Array) -> float:
        return float(np.abs(extra).max()) if self.kind is Kind.INTEGER else 0.0

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> MultipleEquations:
        return MultipleEquations(self, state, extra, names)


class MultipleEquations(Equations):
    """tr G / m in units of omega^2, its imaginary part where kappa is free, and the motion along the null vectors."""

    def __init__(self, of: MultiplePoint, state: BalanceState, extra: Array, names: tuple[str, ...]) -> None:
        self.of, self.state, self.extra, self.names = of, state, extra, names
        self.kappa = float(extra[0]) if of.kind is Kind.FREE else 0.0
        self.unfolds = of.kind is Kind.INTEGER
        self.scale = state.balance.row_weights(len(of.left))
        if self.unfolds:
            self.columns: Array = np.real(of.force * of.left / self.scale[:, None])
            self.addition = self.columns @ extra

    @lazy
    def factor(self) -> Factor:
        """Of the bordered matrix, borders in units of omega^2."""
        of, (n, m) = self.of, self.of.left.shape
        matrix, _ = weighted_operator(self.state, of.kind, self.kappa)
        whole = np.zeros((n + m, n + m), dtype=matrix.dtype, order="F")
        whole[:n, :n], whole[:n, n:], whole[n:, :n] = matrix, of.unit * of.left, of.unit * of.right.conj().T
        return Factor.of(whole, overwrite=True)

    @lazy
    def solved(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """V and U, (N, m), in mass weights, and G in units of omega^2, (m, m)."""
        n, m = self.of.left.shape
        units = (self.of.unit * np.eye(n + m, m, -n)).astype(self.factor.lu.dtype)
        right, left = self.factor.solve(units), self.factor.solve(units, adjoint=True)
        return right[:n], left[:n], right[n:]

    @property
    def _motion(self) -> Array:
        """How far the motion lies from X_0 along the null vectors, in units of its size, (m,)."""
        here = self.state.unknowns / self.scale - self.of.reference
        return np.real(self.of.right.T @ here) / (motion_size(self.state) or 1.0)

    @lazy
    def values(self) -> Array:
        mean = complex(np.trace(self.solved[2])) / self.of.multiplicity
        if self.of.kind is Kind.FREE:
            return np.array([mean.real, mean.imag])
        return np.append(mean.real, self._motion) if self.unfolds else np.array([mean.real])

    @lazy
    def _gradients(self) -> list[list[Gradient]]:
        """Derivatives of -G, in units of omega^2, by the coefficients, by the free parameters, by kappa; [i][j]."""
        right, left, _ = self.solved
        vectors = [one.T * self.scale / math.sqrt(self.of.unit) for one in (left, right)]
        state, kind = self.state, self.of.kind
        return [[bilinear_gradient(state, kind, u, v, self.names, self.kappa) for v in vectors[1]] for u in vectors[0]]

    @lazy
    def _gradient(self) -> tuple[ComplexArray, dict[str, complex], complex]:
        """Derivatives of tr G / m by the coefficients, by the free parameters, by kappa."""
        every, m = [row[i] for i, row in enumerate(self._gradients)], self.of.multiplicity
        by_x: ComplexArray = -np.sum([one.x.ravel() for one in every], axis=0) / m
        rates = {name: -sum(one.rates[name] for one in every) / m for name in self.names}
        return by_x, rates, -sum(one.kappa for one in every) / m

    @lazy
    def _move(self) -> Array:
        """How the motion changes along the branch with the first free parameter, (dimension,)."""
        slope = self.state.residual_by(self.names[0])
        if not self.unfolds:
            return np.asarray(-np.linalg.solve(self.state.jacobian, slope))
        rhs = np.append(slope * self.scale, np.zeros(self.of.multiplicity))
        return np.asarray(-self.factor.solve(rhs)[: len(slope)] * self.scale)

    @property
    def change(self) -> ComplexArray:
        """How -G changes along the branch with the first free parameter, (m, m)."""
        name, kind = self.names[0], self.of.kind
        change = [[one.x.ravel() @ self._move + one.rates[name] for one in row] for row in self._gradients]
        return np.array(change) if kind is Kind.FREE else np.real(change)

    @property
    def rows(self) -> Array:
        by_x, rates, by_kappa = self._gradient
        along = [rates[name] for name in self.names]
        if self.of.kind is Kind.FREE:
            whole = np.concatenate((by_x, [by_kappa], along))
            return np.array([whole.real, whole.imag])
        top = np.concatenate((by_x, np.zeros(self.of.extras), along)).real
        if not self.unfolds:
            return top[None]
        held = np.zeros((self.of.multiplicity, len(top)))
        held[:, : len(by_x)] = self.of.right.T / self.scale / (motion_size(self.state) or 1.0)
        return np.vstack((top, held))

    def jacobian(self, names: tuple[str, ...]) -> Array:
        out = super().jacobian(names)
        if self.unfolds:
            out[: len(self.columns), len(self.columns) : len(self.columns) + self.of.multiplicity] = self.columns
        return out

    def apart(self, weights: Array) -> float:
        """How far from each other, in scaled arclength along the branch, the eigenvalues of G vanish.

        weights: of the coefficients and of the free parameter.
        """
        by_x, rates, by_kappa = self._gradient
        change = complex(by_x @ self._move + rates[self.names[0]])
        if self.of.kind is Kind.FREE and by_kappa:
            # kappa goes with it
            change = complex((change / by_kappa).imag * by_kappa)
        way = float(np.hypot(np.linalg.norm(weights[:-1] * self._move), weights[-1]))
        spread = float(np.linalg.norm(self.solved[2], 2))
        return spread * way / abs(change) if change else np.inf

    def parting(self, way: Array) -> float:
        """How fast eigenvalues of G part along a way of the unknowns, in units of how fast they change together along
        the branch with the first free parameter.
        """
        n, last = self.state.x.size, way[-len(self.names) :]
        turning = float(way[n]) if self.of.kind is Kind.FREE else 0.0

        def slope(one: Gradient) -> complex:
            by_names = sum(one.rates[name] * part for name, part in zip(self.names, last, strict=True))
            return complex(one.x.ravel() @ way[:n] + by_names + one.kappa * turning)

        change, m = np.array([[slope(one) for one in row] for row in self._gradients]), self.of.multiplicity
        rest = change - np.trace(change) / m * np.eye(m)
        return float(np.linalg.norm(rest, 2)) * m / abs(np.trace(self.change))

    def vectors(self, mixed: Array) -> NullVectors:
        """The null vectors that combine V and U by the coefficients `mixed`, (m,)."""
        right, left, _ = self.solved
        pair = [vectors @ mixed for vectors in (right, left)]
        return NullVectors(*(vector / np.linalg.norm(vector) for vector in pair))

    def renewed(self) -> MultiplePoint:
        return MultiplePoint.of(self.state, self.of.kind, self.of.multiplicity, self.names[0], self.kappa)
