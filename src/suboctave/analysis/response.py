"""Response curves of a system as curves for the continuation engine: unknowns `u = (X, free parameter)`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.analysis.corrector import SOLVED, UNSOLVED, bordered_by_frequency, corrected
from suboctave.bifurcation.gaps import rests_in_corner
from suboctave.compiled import ready
from suboctave.continuation.kernels import bordered_transposed, weighted_length
from suboctave.continuation.linear import Factor
from suboctave.continuation.newton import NewtonOptions, Solved, not_converged
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.errors import ConvergenceError
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import evaluate_told, told_steps
from suboctave.harmonic.group_kernels import add_pieces
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.selection import AdaptiveHarmonics, choose_harmonics, motion_size, truncation
from suboctave.harmonic.state import BalanceState
from suboctave.lazy import lazy

#: motions of less than this share of the reference count as rest
_REST = 1e-8
#: unknowns beyond which leaving harmonics out of sub-harmonic motions saves more than it costs
_WORTH_DROPPING = 90
_TINY = float(np.finfo(float).tiny)


@dataclass(eq=False)
class ResponseEvaluation:
    """Harmonic balance and its derivatives at one u; `reference`: a size of the motion elsewhere on the curve."""

    state: BalanceState
    name: str
    reference: float

    @property
    def residual(self) -> Array:
        """R, shape (N,)."""
        return self.state.residual

    @lazy
    def jacobian(self) -> Array:
        """`[R_X, R_parameter]`, shape (N, N + 1)."""
        return self.state.extended_jacobian(self.name)

    def bordered_transposed(self, row: Array, weights: Array) -> Array:
        """Transpose of `[F_u / weights; row]`, (N + 1, N + 1): what Newton's method factorises."""
        state = self.state
        balance = state.balance
        plain = self.name == "omega" and balance.steady and balance.basis.kept is None
        if not plain or not isinstance(state.linear, StructuralMatrices):
            found: Array = bordered_transposed(self.jacobian, row, weights)
            return found
        return bordered_by_frequency(
            state.spectra_table,
            balance.moving,
            state.rate,
            *balance.directions,
            state.linear.matrices,
            balance.basis.multiples,
            state.omega,
            state.x,
            row,
            weights,
        )

    @lazy
    def error(self) -> float:
        """Residual in units of the forces that balance (at rest, where there are none, of those of a tiny motion)."""
        state = self.state
        floor = _REST * state.omega**2 * self.reference
        return state.residual_size() / max(state.force_scale(), floor, _TINY)

    @lazy
    def at_rest(self) -> bool:
        """True if the motion is nothing beside what the loads make of the structure elsewhere on the curve.

        Without loads (parametric excitation alone) rest is a motion like any other, which may lose its stability; but
        not in a corner of a law, where it has no linear neighbourhood.
        """
        if motion_size(self.state) > _REST * self.reference:
            return False
        return self.reference > 0.0 or rests_in_corner(self.state)

    @lazy
    def truncation(self) -> float:
        """Estimated size of the neglected harmonics relative to the motion."""
        return truncation(self.state)


class ResponseCurve:
    """Periodic motions of a system along one free parameter, "omega" or a parameter by name.

    Parameters
    ----------
    balance
        Equations in the present basis.
    name
        Free parameter.
    omega
        Frequency, where it is not the free parameter.
    span
        Width of the free parameter's range.
    adaptive
        Rule for the number of harmonics, None to keep it.
    reference
        A size of the motion met before the branch begins (the linear response), so that a branch can start from rest.
    """

    def __init__(
        self,
        balance: HarmonicBalance,
        name: str,
        omega: float,
        span: float,
        adaptive: AdaptiveHarmonics | None,
        reference: float = 0.0,
        cache: dict[HarmonicBasis, HarmonicBalance] | None = None,
    ) -> None:
        self.balance = balance
        self.name = name
        self.omega = omega
        self.span = span
        self.adaptive = adaptive
        self.reference = reference
        self._cache = {balance.basis: balance} if cache is None else cache
        self._weight = balance.column_weights

    @property
    def parameter(self) -> int:
        """Index of the free parameter in u: the last."""
        return self.balance.dimension

    def split(self, u: Array) -> tuple[Array, float, Mapping[str, float]]:
        """Coefficients (2 H + 1, size), omega and parameter values of a vector u."""
        x = self.balance.spread(u[:-1])
        if self.name == "omega":
            return x, float(u[-1]), self.balance.values
        return x, self.omega, {**self.balance.values, self.name: float(u[-1])}

    def join(self, x: Array, value: float) -> Array:
        """The vector u of coefficients (2 H + 1, size) and a value of the free parameter."""
        u = np.empty(self.balance.dimension + 1)
        u[:-1] = self.balance.packed(x)
        u[-1] = value
        return u

    def evaluate(self, u: Array) -> ResponseEvaluation:
        """See `Curve.evaluate`."""
        if not math.isfinite(u.dot(u)):
            raise ConvergenceError("the iteration left the range of numbers")
        x, omega, values = self.split(u)
        if not omega > 0.0:
            raise ConvergenceError("omega is not positive")
        return ResponseEvaluation(self.balance.at(x, omega, values), self.name, self.reference)

    @lazy
    def _known(self) -> tuple[tuple[Any, ...], list[Callable[..., Any]]] | None:
        """What `corrector.corrected` is told of these equations, and those of the kernels called for them that other
        laws need not; None where they are not of its kind.
        """
        balance = self.balance
        plain = self.name == "omega" and balance.steady and balance.basis.kept is None
        if not plain or not isinstance(balance.linear, StructuralMatrices):
            return None
        packed, nodes = balance.packed_laws(balance.values)
        if packed.sampled and not packed.told:
            return None
        equations = (
            _REST * self.reference,
            balance.basis.nu,
            balance.moving,
            balance.basis.multiples,
            balance.linear.matrices,
            *balance.directions,
            packed.pieces if len(packed.pieces) else None,
            packed.first,
            packed.polynomial,
            balance.grid,
            nodes,
            balance.load(balance.values, 1.0),
            balance.scales()[1],
        )
        parts = [part for part, needed in ((evaluate_told, packed.told), (add_pieces, len(packed.pieces))) if needed]
        return equations + (told_steps(packed) if packed.told else (None,) * 7), parts

    def corrected(
        self,
        guess: Array,
        row: Array,
        weights: Array,
        options: NewtonOptions,
        spare: float,
        factor: Factor | None = None,
    ) -> Solved | None:
        """See `Curve`: `newton.correct` in one compiled call."""
        known, balance = self._known, self.balance
        # what it calls is compiled one by one, not all at one go
        if factor is not None or known is None or not all(map(ready, known[1])):
            return None
        n, high, size, groups = len(guess), balance.basis.harmonics, balance.size, len(balance.groups)
        u, tangent, lu, pivots = np.empty(n), np.empty(n), np.empty((n, n)), np.empty(n, dtype=np.int32)
        blocks, parts = np.empty((high + 1, size, size), dtype=complex), np.empty((3, 2 * high + 1, size))
        table = np.empty((3, groups, balance.top + 1), dtype=complex)
        motions, sizes, numbers = np.empty((groups, high + 1), dtype=complex), np.empty(4), np.empty(5)
        limits = (options.tolerance, options.correction, options.iterations, spare)
        filled = (u, tangent, lu, pivots, blocks, table, motions, parts, sizes, numbers)
        ended = corrected(*(guess, row, weights, *limits, *known[0], *filled))
        error, iterations, way, contraction, sign = numbers.tolist()
        if ended == UNSOLVED:
            raise not_converged(self, guess, error, int(iterations))
        if ended != SOLVED:
            return None
        # all harmonics are kept, and the frequency is free
        x = u[:-1].reshape(2 * high + 1, size)
        state = BalanceState(balance, balance.linear, x, float(u[-1]), balance.values)
        state.__dict__.update(_evaluated=(table, parts, sizes), motions=motions, blocks=blocks, nodal=[])
        evaluation = ResponseEvaluation(state, self.name, self.reference)
        evaluation.__dict__["error"] = error
        return Solved(
            u, evaluation, weights, Factor(lu.T, pivots, False), int(iterations), way, contraction, tangent, sign
        )

    def size(self, u: Array) -> float:
        """Norm of the coefficients, weighted by the square roots of the masses."""
        return float(weighted_length(self._weight, u))

    def weights(self, u: Array, largest: float) -> Array:
        """See `Curve.weights`."""
        size = max(self.size(u), 0.01 * max(largest, self.reference)) or 1.0
        weights = np.empty(len(u))
        np.divide(self._weight, size, out=weights[:-1])
        weights[-1] = 1.0 / self.span
        return weights

    def unit(self, weights: Array) -> float:
        """Size of a motion that counts as one in `weights`."""
        return float(self._weight[0] / weights[0])

    def adapted(self, u: Array, evaluation: Evaluation) -> Curve:
        """The curve with the number of harmonics (and blind samples) that this point needs."""
        assert isinstance(evaluation, ResponseEvaluation)
        basis = self.balance.basis
        if self.adaptive is not None:
            dropping = self.balance.size * basis.size > _WORTH_DROPPING
            basis = choose_harmonics(evaluation.state, self.adaptive, self.adaptive.tolerance, dropping)
        balance = self.balance if basis is self.balance.basis else self._in_basis(basis)
        if balance is self.balance and balance.settled:
            return self
        x, omega, values = self.split(u)
        if balance is not self.balance:
            x = self.balance.basis.resized(x, basis)
        balance = balance.settle(x, omega, values)
        return self if balance is self.balance else self.with_balance(balance)

    def _in_basis(self, basis: HarmonicBasis) -> HarmonicBalance:
        if basis not in self._cache:
            self._cache[basis] = self.balance.with_basis(basis)
        return self._cache[basis]

    def with_balance(self, balance: HarmonicBalance) -> ResponseCurve:
        """The same curve with other equations (basis, samples)."""
        self._cache[balance.basis] = balance
        return ResponseCurve(balance, self.name, self.omega, self.span, self.adaptive, self.reference, self._cache)

    def with_basis(self, basis: HarmonicBasis) -> ResponseCurve:
        """The same curve in another basis."""
        return self if basis == self.balance.basis else self.with_balance(self._in_basis(basis))

    def transfer(self, u: Array, origin: Curve) -> Array:
        """See `Curve.transfer`."""
        if origin is self:
            return u
        assert isinstance(origin, ResponseCurve)
        if origin.balance is self.balance or origin.balance.basis == self.balance.basis:
            return u
        x = origin.balance.spread(u[:-1])
        return self.join(origin.balance.basis.resized(x, self.balance.basis), u[-1])

    def images(self, u: Array) -> list[Array]:
        """The motion shifted by 0, 1, ..., nu - 1 load periods: all the same motion."""
        basis = self.balance.basis
        if basis.nu == 1:
            return [u]
        x = self.balance.spread(u[:-1])
        shifted = []
        for shift in range(basis.nu):
            angle = 2.0 * np.pi * shift * np.arange(1, basis.harmonics + 1)[:, None] / basis.nu
            y = x.copy()
            y[1::2] = np.cos(angle) * x[1::2] + np.sin(angle) * x[2::2]
            y[2::2] = np.cos(angle) * x[2::2] - np.sin(angle) * x[1::2]
            shifted.append(self.join(y, u[-1]))
        return shifted

    def unwrapped(self, u: Array, near: Array) -> Array:
        """See `Curve.unwrapped`."""
        return u

    def where(self, u: Array) -> str:
        """The free parameter's value in words."""
        return f"{self.name} = {u[-1]:.6g}"
