"""Bifurcations in two free parameters as curves for the continuation engine: unknowns `u = (X, extra, p, q)`; their
extrema in three, `(X, extra, p, q, r)`.

`extra` are the unknowns that come with the kind (kappa, an unfolding, an instant; `bifurcation.augmented`), p and q the
free parameters, "omega" and a named one, or two named ones. The engine's free parameter is the last.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from suboctave.analysis import tracked_newton
from suboctave.analysis.tracked_matrix import bordered_by_rows, evaluate_at_once, matrix_at_once
from suboctave.bifurcation.augmented import Augmentation, Equations
from suboctave.continuation.kernels import bordered_transposed, weighted_length
from suboctave.continuation.linear import Factor, length
from suboctave.continuation.newton import NewtonOptions, Solved
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.errors import ConvergenceError
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.selection import AdaptiveHarmonics, choose_harmonics, next_harmonics
from suboctave.harmonic.state import BalanceState
from suboctave.lazy import lazy
from suboctave.stability import FloquetResult, floquet_multipliers

#: distance of the critical multiplier from the unit circle up to which harmonics suffice
_CRITICAL = 1e-3
#: steps after which that is looked at again
LOOKED_AT = 5
_TINY = float(np.finfo(float).tiny)


class TrackedEvaluation:
    """The augmented equations and their derivatives at one u."""

    def __init__(self, curve: TrackedCurve, state: BalanceState, extra: Array) -> None:
        self.curve = curve
        self.state = state
        self.extra = extra
        self.equations: Equations = curve.augmentation.at(state, extra, curve.names)

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers of the motion, by the monodromy matrix."""
        return floquet_multipliers(self.state)

    @property
    def critical(self) -> complex | None:
        """The multiplier that lies on the unit circle at a solution, None if none need."""
        kind = self.curve.augmentation.name
        if kind == "NS":
            return cmath.exp(2j * cmath.pi * float(self.extra[0]) / self.state.rate)
        return {"LP": 1.0 + 0.0j, "BP": 1.0 + 0.0j, "PD": -1.0 + 0.0j}.get(kind)

    @property
    def doubt(self) -> float:
        """Distance of the critical multiplier from where it should be: what the harmonics left out make of it."""
        critical = self.critical
        return 0.0 if critical is None else float(np.abs(self.floquet.multipliers - critical).min())

    @lazy
    def residual(self) -> Array:
        """`[R + addition; scalar equations]`, in units of the forces that balance at the curve's last point."""
        equations, force = self.equations, self.curve.force
        top = self.state.residual
        if equations.addition is not None:
            top = top + equations.addition
        return np.concatenate((top, equations.values * force))

    @lazy
    def jacobian(self) -> Array:
        """Derivatives by u, shape (N, N + 1)."""
        state, equations = self.state, self.equations
        names, n, q = self.curve.names, state.balance.dimension, len(self.extra)
        rows = equations.rows
        out = np.zeros((n + rows.shape[0], rows.shape[1]))
        # omega comes first
        along = state.extended_jacobian(names[0])
        out[:n, :n], out[:n, n + q] = along[:, :n], along[:, n]
        if equations.column is not None:
            out[:n, n] = equations.column
        for i, name in enumerate(names[1:], 1):
            out[:n, n + q + i] = state.residual_by(name)
        out[n:] = rows
        out[n:] *= self.curve.force
        return out

    def bordered_transposed(self, row: Array, weights: Array) -> Array:
        """Transpose of `[F_u / weights; row]`: what Newton's method factorises."""
        at_once = matrix_at_once(self, row, weights)
        if at_once is not None:
            return at_once
        state, equations, names = self.state, self.equations, self.curve.names
        balance, linear = state.balance, state.linear
        plain = names[0] == "omega" and balance.steady and balance.basis.kept is None and equations.column is None
        if not plain or not isinstance(linear, StructuralMatrices):
            found: Array = bordered_transposed(self.jacobian, row, weights)
            return found
        others = np.array([state.residual_by(name) for name in names[1:]])
        found = np.empty((len(weights), len(weights)))
        bordered_by_rows(
            state.spectra_table,
            balance.moving,
            state.rate,
            *balance.directions,
            linear.matrices,
            balance.basis.multiples,
            state.omega,
            state.x,
            others,
            equations.rows,
            self.curve.force,
            row,
            weights,
            found,
            np.empty((state.x.size, state.x.size + 1)),
        )
        return found

    def takes_over(self, other: Evaluation) -> bool:
        """See `Evaluation`."""
        assert isinstance(other, TrackedEvaluation)
        return self.equations.takes_over(other.equations)

    @lazy
    def error(self) -> float:
        """The larger of the residual in units of the forces that balance and the scalar equations'."""
        evaluate_at_once(self)
        state, addition = self.state, self.equations.addition
        if addition is None:
            size = state.residual_size()
        else:
            shaped = (state.residual + addition).reshape(state.x.shape)
            size = length(shaped * state.balance.scales()[1])
        balanced = size / max(state.force_scale(), self.curve.floor, _TINY)
        return max(balanced, *map(abs, self.equations.values.tolist()))


@dataclass(frozen=True, eq=False)
class TrackedCurve:
    """Bifurcations of one kind in two free parameters, or extrema along curves of them in three.

    balance
        Equations of motion in the present basis.
    augmentation
        What singles the bifurcation out, with its bordering vectors.
    names, spans
        The free parameters and the widths of their ranges.
    omega
        Frequency, where it is not free.
    adaptive, tolerance
        Rule for the number of harmonics (None to keep it) and the neglected share of the motion that is tolerated.
    force, floor
        Size of the forces at the last point; size below which residuals are not judged (a motion at rest).
    steps
        How many steps lie behind.
    """

    balance: HarmonicBalance
    augmentation: Augmentation
    names: tuple[str, ...]
    spans: tuple[float, ...]
    omega: float
    adaptive: AdaptiveHarmonics | None
    tolerance: float
    force: float
    floor: float
    cache: dict[HarmonicBasis, HarmonicBalance]
    steps: int = 0

    @lazy
    def parameter(self) -> int:
        """Index of the last free parameter in u, the last entry."""
        return self.balance.dimension + self.augmentation.extras + len(self.names) - 1

    @property
    def delicate(self) -> bool:
        """See `Curve`: limit points of doubled motions, whose equations those of the parent's period doublings solve as
        well. Where the doubled part is small the two are told apart by little.
        """
        return self.augmentation.name == "LP" and self.balance.basis.nu % 2 == 0

    def index(self, name: str) -> int:
        """Index of one of the free parameters in u."""
        return self.balance.dimension + self.augmentation.extras + self.names.index(name)

    @property
    def _weight(self) -> Array:
        return self.balance.column_weights

    def split(self, u: Array) -> tuple[Array, Array, float, Mapping[str, float]]:
        """Coefficients (2 H + 1, size), extra unknowns, omega and parameter values of a vector u."""
        n = self.balance.dimension
        x = u[:n].reshape(self.balance.basis.size, self.balance.size)
        extra, parameters = u[n : -len(self.names)], u[-len(self.names) :]
        free = dict(zip(self.names, parameters.tolist(), strict=True))
        omega = free.pop("omega", self.omega)
        return x, extra, omega, {**self.balance.values, **free}

    def join(self, x: Array, extra: Array, values: Array) -> Array:
        """The vector u of coefficients, extra unknowns and the free parameters."""
        return np.concatenate((x.ravel(), extra, values))

    def evaluate(self, u: Array) -> TrackedEvaluation:
        """See `Curve.evaluate`."""
        if not math.isfinite(u.dot(u)):
            raise ConvergenceError("the iteration left the range of numbers")
        x, extra, omega, values = self.split(u)
        if not omega > 0.0:
            raise ConvergenceError("omega is not positive")
        return TrackedEvaluation(self, self.balance.at(x, omega, values), extra)

    def corrected(
        self,
        guess: Array,
        row: Array,
        weights: Array,
        options: NewtonOptions,
        spare: float,
        known: Factor | None = None,
    ) -> Solved | None:
        """See `Curve`: `newton.correct` in few compiled calls."""
        if not tracked_newton.applies(self):
            return None
        found = tracked_newton.corrected(self, guess, row, weights, options, spare, known)
        if found is None:
            return None
        evaluation = TrackedEvaluation(self, found.state, found.u[:0])
        evaluation.__dict__["error"] = found.error
        evaluation.equations.own.__dict__.update(bordered=found.bordered, gradient=found.gradient)
        made = (found.factor, found.iterations, found.distance, found.rate, found.tangent, found.sign)
        return Solved(found.u, evaluation, weights, *made)

    def size(self, u: Array) -> float:
        """Norm of the coefficients, weighted by the square roots of the masses."""
        return float(weighted_length(self._weight, u))

    def weights(self, u: Array, largest: float) -> Array:
        """See `Curve.weights`."""
        size = max(self.size(u), 0.01 * largest) or 1.0
        weights, n = np.empty(len(u)), self.balance.dimension
        np.divide(self._weight, size, out=weights[:n])
        if self.augmentation.extras:
            weights[n : -len(self.names)] = 1.0 / self.augmentation.spans(self.split(u)[2] / self.balance.basis.nu)
        for i, span in enumerate(self.spans, len(u) - len(self.names)):
            weights[i] = 1.0 / span
        return weights

    def adapted(self, u: Array, evaluation: Evaluation) -> TrackedCurve:
        """The curve with the harmonics, samples and bordering vectors of this point."""
        assert isinstance(evaluation, TrackedEvaluation)
        state = evaluation.state
        augmentation = evaluation.equations.renewed()
        balance = self.balance
        if self.adaptive is not None:
            balance = self._in_basis(self._basis(evaluation, self.adaptive))
        x = state.x if balance is self.balance else self.balance.basis.resized(state.x, balance.basis)
        balance = balance.settle(x, state.omega, state.values)
        self.cache[balance.basis] = balance
        if balance.basis != self.balance.basis:
            augmentation = augmentation.resized(balance.basis, balance.size)
        force = max(state.force_scale(), self.floor)
        what = (self.names, self.spans, self.omega, self.adaptive, self.tolerance)
        return TrackedCurve(balance, augmentation, *what, force, self.floor, self.cache, self.steps + 1)

    def _basis(self, evaluation: TrackedEvaluation, adaptive: AdaptiveHarmonics) -> HarmonicBasis:
        """The basis that a point needs: a small neglected motion may still matter where a stiff contact just closes."""
        state, present = evaluation.state, self.balance.basis
        basis = choose_harmonics(state, adaptive, self.tolerance)
        lower = basis.harmonics < present.harmonics
        if basis.harmonics > present.harmonics or not (lower or self.steps % LOOKED_AT == 0):
            return basis
        if evaluation.doubt > _CRITICAL:
            return next_harmonics(state, adaptive)
        return present if lower and evaluation.doubt > 0.1 * _CRITICAL else basis

    def _in_basis(self, basis: HarmonicBasis) -> HarmonicBalance:
        if basis == self.balance.basis:
            return self.balance
        if basis not in self.cache:
            self.cache[basis] = self.balance.with_basis(basis)
        return self.cache[basis]

    def with_basis(self, basis: HarmonicBasis) -> TrackedCurve:
        """The same curve in another basis."""
        if basis == self.balance.basis:
            return self
        balance = self._in_basis(basis)
        return replace(self, balance=balance, augmentation=self.augmentation.resized(basis, balance.size))

    def transfer(self, u: Array, origin: Curve) -> Array:
        """See `Curve.transfer`."""
        if origin is self:
            return u
        assert isinstance(origin, TrackedCurve)
        basis, own = origin.balance.basis, self.balance.basis
        if basis is own or basis == own:
            return u
        n = origin.balance.dimension
        x = u[:n].reshape(basis.size, -1)
        extra = origin.augmentation.carried(u[n:-2], self.balance.basis, self.balance.size)
        return np.concatenate((basis.resized(x, self.balance.basis).ravel(), extra, u[-2:]))

    def images(self, u: Array) -> list[Array]:
        """The motion shifted by 0, 1, ..., nu - 1 load periods: all the same motion."""
        basis, n = self.balance.basis, self.balance.dimension
        if basis.nu == 1:
            return [u]
        extra, parameters = u[n : -len(self.names)], u[-len(self.names) :]
        found = []
        x = u[:n].reshape(basis.size, -1)
        for turn, cosine, sine in _turns(basis.nu, basis.harmonics):
            y = x.copy()
            y[1::2] = cosine * x[1::2] + sine * x[2::2]
            y[2::2] = cosine * x[2::2] - sine * x[1::2]
            found.append(self.join(y, self.augmentation.shifted(extra, turn), parameters))
        return found

    def unwrapped(self, u: Array, near: Array) -> Array:
        """See `Curve.unwrapped`."""
        own = slice(self.balance.dimension, -len(self.names))
        moved = u.copy()
        moved[own] = self.augmentation.unwrapped(u[own], near[own])
        return moved

    def named(self, u: Array) -> dict[str, float]:
        """Values of the free parameters by name."""
        return dict(zip(self.names, u[-len(self.names) :].tolist(), strict=True))

    def where(self, u: Array) -> str:
        """Where in the plane of the parameters, in words."""
        return ", ".join(f"{name} = {value:.6g}" for name, value in self.named(u).items())


@lru_cache(maxsize=64)
def _turns(nu: int, harmonics: int) -> list[tuple[float, Array, Array]]:
    """The shifts by load periods as angles of the motion's own period, with cosine and sine at every harmonic."""
    turns = [2.0 * np.pi * shift / nu for shift in range(nu)]
    angles = [turn * np.arange(1, harmonics + 1)[:, None] for turn in turns]
    return [(turn, np.cos(angle), np.sin(angle)) for turn, angle in zip(turns, angles, strict=True)]


__all__ = ["LOOKED_AT", "TrackedCurve", "TrackedEvaluation"]
