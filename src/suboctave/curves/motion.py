"""Periodic motions as curves for the continuation engine: unknowns `u = (X, extra, free parameters)`.

    R(X, omega, parameters) + addition = 0,    scalar equations (X, extra, parameters) = 0

What is followed is a matter of the augmentation (`curves.kinds`): without any, frequency responses and responses
over a parameter; with the equations of a bifurcation, bifurcations in two parameters; with that of an extremum besides,
their extrema in three. `extra` are the unknowns that come with the augmentation (kappa, an unfolding, an instant). The
engine's free parameter is the last.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from suboctave.bifurcation.gaps import rests_in_corner
from suboctave.continuation.linear import length
from suboctave.continuation.point import CurvePoint
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.curves.augmentation import PLAIN, Augmentation, Equations
from suboctave.curves.floating import floating
from suboctave.curves.still import beyond
from suboctave.errors import ConvergenceError, InputError, NotFiniteError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.energy import fed
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.finite import infinite_between, quotients, unbounded_along, unbounded_between
from suboctave.harmonic.truncation import (
    AdaptiveHarmonics,
    beyond_usual,
    choose_harmonics,
    motion_size,
    next_harmonics,
    truncation,
)
from suboctave.lazy import lazy

#: motions of less than this share of the reference count as rest
_REST = 1e-8
#: distance of the critical multiplier from the unit circle, and error of one that may lie on it, up to which harmonics
#: suffice
CRITICAL = 1e-3
#: neglected motion in units of the tolerance above which a curve takes more harmonics than it has as a rule
_TOO_FEW = 10.0
#: steps after which that distance is computed again
CRITICAL_EVERY = 5
#: share of the largest motion met, or of the reference, that is the unit of motions below it
LEAST = 0.01
_TINY = float(np.finfo(float).tiny)


class MotionEvaluation:
    """The augmented equations and their derivatives at one u."""

    def __init__(self, curve: MotionProblem, state: BalanceState, extra: Array) -> None:
        self.curve = curve
        self.state = state
        self.extra = extra
        self.equations: Equations = curve.augmentation.at(state, extra, curve.names)

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers of the motion, by the monodromy matrix."""
        why = self.curve.augmentation.no_multipliers
        count = 2 * len(self.state.linear.equation_of_motion()[0]) if why else 0
        return FloquetResult.inapplicable(count, "none", why) if why else floquet_multipliers(self.state)

    @property
    def known_floquet(self) -> FloquetResult | None:
        """The multipliers, where they have been computed."""
        return self.__dict__.get("floquet")

    @property
    def critical(self) -> complex | None:
        """The multiplier that lies on the unit circle at a solution, None if none need."""
        return self.curve.augmentation.multiplier(self.state.rate, self.extra)

    @property
    def doubt(self) -> float:
        """Distance of the critical multiplier from where it should be: what the harmonics left out make of it."""
        critical = self.critical
        if critical is None:
            return 0.0
        away = self.floquet.multipliers - critical
        nearest = np.argsort(np.abs(away), kind="stable")[: self.curve.augmentation.trivial]
        return float(abs(away[nearest].mean()))

    @lazy
    def residual(self) -> Array:
        """`[R + addition; scalar equations]`, in units of the forces that balance at the curve's last point."""
        equations, top = self.equations, self.state.residual
        if equations.addition is not None:
            top = top + equations.addition
        return np.concatenate((top, equations.values * self.curve.force)) if equations.values.size else top

    @lazy
    def jacobian(self) -> Array:
        """Derivatives by u, shape (N, N + 1)."""
        out, size = self.equations.jacobian(self.curve.names), self.state.balance.dimension
        if len(out) > size:
            out[size:] *= self.curve.force
        return out

    def takes_over(self, other: Evaluation) -> bool:
        assert isinstance(other, MotionEvaluation)
        return self.equations.takes_over(other.equations)

    @lazy
    def error(self) -> float:
        """The larger of the residual in units of the forces that balance (at rest, where there are none, of those of a
        tiny motion) and the scalar equations'.
        """
        state, addition = self.state, self.equations.addition
        balanced, values = state.balanced, self.equations.values
        size = balanced.size
        if addition is not None:
            shaped = (state.residual + addition).reshape(state.x.shape)
            size = length(shaped * state.balance.scales[1])
        worst = size / max(balanced.scale, self.curve.least_force(state), _TINY)
        return max(worst, *map(abs, values.tolist())) if values.size else worst

    @lazy
    def at_rest(self) -> bool:
        """True if the motion is nothing beside what the loads make of the structure elsewhere on the curve.

        Without loads (parametric excitation alone) rest is a motion like any other, which may lose its stability; but
        not in a corner of a law, where it has no linear neighbourhood.
        """
        reference = self.curve.reference
        if motion_size(self.state) > _REST * reference:
            return False
        return reference > 0.0 or rests_in_corner(self.state)

    @property
    def truncation(self) -> float:
        """Estimated size of the neglected harmonics relative to the motion."""
        return truncation(self.state)


@dataclass(eq=False, repr=False)
class MotionProblem:
    """Periodic motions along one free parameter, their bifurcations in two, extrema along curves of those in three.

    balance
        Equations of motion in the present basis.
    names, spans, unbounded
        The free parameters, "omega" first where it is one of them, the widths of their ranges, and those without one:
        they have the size of their values, and at least that at the start.
    omega
        Frequency, where it is not free.
    adaptive, tolerance
        Rule for the number of harmonics (None to keep it) and the neglected share of the motion that is tolerated.
    augmentation
        What singles the motions out, with its bordering vectors.
    reference
        A size of the motion met before the curve begins (`starts.bounded_response`), so that it can start from rest.
    force
        Size of the forces at the last point: the unit of the scalar equations.
    cache
        The equations in every basis that was needed.
    held
        Values of parameters that are not those of the equations.
    steps
        How many steps lie behind.
    erred
        Error of a multiplier that fewer harmonics left on either side of the unit circle, 0 where they did not: as long
        as one is that close to it none are taken away.
    """

    balance: HarmonicBalance
    names: tuple[str, ...]
    spans: tuple[float, ...]
    omega: float
    adaptive: AdaptiveHarmonics | None = None
    tolerance: float = 0.0
    augmentation: Augmentation = PLAIN
    reference: float = 0.0
    force: float = 1.0
    cache: dict[HarmonicBasis, HarmonicBalance] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    unbounded: frozenset[str] = frozenset()
    steps: int = 0
    erred: float = 0.0

    def __post_init__(self) -> None:
        self.cache.setdefault(self.balance.basis, self.balance)

    @classmethod
    def response(
        cls, balance: HarmonicBalance, name: str, omega: float, span: float, adaptive: AdaptiveHarmonics | None
    ) -> MotionProblem:
        """All motions along one free parameter."""
        return cls(balance, (name,), (span,), omega, adaptive, 0.0 if adaptive is None else adaptive.tolerance)

    @lazy
    def parameter(self) -> int:
        """Index of the last free parameter in u, the last entry."""
        return self.balance.dimension + self.augmentation.extras + len(self.names) - 1

    @property
    def name(self) -> str:
        """The last free parameter."""
        return self.names[-1]

    @property
    def span(self) -> float:
        """Width of its range."""
        return self.spans[-1]

    @property
    def delicate(self) -> bool:
        """See `Curve`: limit points of doubled motions, whose equations those of the parent's period doublings solve as
        well. Where the doubled part is small the two are told apart by little.
        """
        return self.augmentation.name == "LP" and self.balance.basis.nu % 2 == 0

    @lazy
    def still(self) -> bool:
        """Whether its motions are equilibria: nothing drives them, and nothing holds a phase."""
        if "omega" in self.names or self.augmentation.free_phase or self.balance.basis.harmonics > 1:
            return False
        system, at = self.balance.system, {**self.balance.values, **self.held, "omega": self.omega}
        loads = [load.amplitude for load in system.load_components() if load.harmonic > 0]
        loaded = any(set(load.names) & set(self.names) or load.value(at) != 0.0 for load in loads)
        return not (loaded or system.excited_by_elements)

    def alike(self, other: MotionProblem) -> bool:
        """Whether two members of a curve have the same discretisation."""
        return self.balance is other.balance and self.omega == other.omega

    def index(self, name: str) -> int:
        """Index of one of the free parameters in u."""
        return self.balance.dimension + self.augmentation.extras + self.names.index(name)

    def least_force(self, state: BalanceState) -> float:
        """Force that residuals are held against at least: that of a motion at rest; without a load, where the forces
        of the structure alone may balance, that of the masses.
        """
        least = _REST * state.omega**2 * self.reference
        if not self.augmentation.free_phase:
            return least
        return max(least, state.rate**2 * length(self.balance.column_weights * state.unknowns))

    def split(self, u: Array) -> tuple[Array, float, Mapping[str, float]]:
        """Coefficients (2 H + 1, size), omega and parameter values of a vector u."""
        balance = self.balance
        x, own = u[: balance.dimension].reshape(balance.basis.size, balance.size), balance.values
        if self.names == ("omega",) and not self.held:
            return x, float(u[-1]), own
        free = self.named(u)
        omega = free.pop("omega", self.omega)
        return x, omega, {**own, **self.held, **free} if free or self.held else own

    @lazy
    def _extra(self) -> slice:
        return slice(self.balance.dimension, -len(self.names))

    def extra(self, u: Array) -> Array:
        """The unknowns of the augmentation in a vector u."""
        return u[self._extra]

    def join(self, x: Array, values: float | Array, extra: Array | None = None) -> Array:
        """The vector u of coefficients, the free parameters, and extra unknowns."""
        n, k = self.balance.dimension, len(self.names)
        u = np.empty(n + self.augmentation.extras + k)
        u[:n] = x.ravel()
        u[-k:] = values
        if extra is not None:
            u[n:-k] = extra
        return u

    def u_of(self, state: BalanceState) -> Array:
        """The vector u of a motion, where the augmentation brings no unknowns."""
        return self.join(state.x, np.array([state.omega if n == "omega" else state.values[n] for n in self.names]))

    def evaluate(self, u: Array) -> MotionEvaluation:
        if not math.isfinite(u.dot(u)):
            raise ConvergenceError("the iteration left the range of numbers")
        x, omega, values = self.split(u)
        if not omega > 0.0:
            raise ConvergenceError("omega is not positive")
        extra = u[self._extra]
        try:
            state = self.balance.state(x, omega, values)
        except InputError as failure:
            # a coefficient has no value there
            raise NotFiniteError(str(failure)) from None
        return MotionEvaluation(self, fed(state, self.zeta(extra)) if extra.size else state, extra)

    def zeta(self, extra: Array) -> float:
        """See `Augmentation.zeta`."""
        return self.augmentation.own.zeta(extra) if extra.size else 0.0

    def size(self, u: Array) -> float:
        """Norm of the coefficients, weighted by the square roots of the masses."""
        return length(self.balance.column_weights * u[: self.balance.dimension])

    def weights(self, u: Array, largest: float) -> Array:
        size = max(self.size(u), LEAST * max(largest, self.reference)) or 1.0
        weights, n = np.empty(u.size), self.balance.dimension
        np.divide(self.balance.column_weights, size, out=weights[:n])
        if self.augmentation.extras:
            weights[n : -len(self.names)] = 1.0 / self.augmentation.spans(self.split(u)[1] / self.balance.basis.nu)
        for i, (name, span) in enumerate(zip(self.names, self.spans, strict=True), u.size - len(self.names)):
            value = abs(u[i])
            grown = max(span, value) if name in self.unbounded else span
            weights[i] = 1.0 / (value if self.augmentation.relative else grown)
        return weights

    def unit(self, weights: Array) -> float:
        """Size of a motion that counts as one in `weights`."""
        return float(self.balance.column_weights[0] / weights[0])

    def severed(self, point: CurvePoint, u: Array, evaluation: Evaluation | None = None) -> str | None:
        """Where a force is not finite between a motion and u, or along that, in words; see `Curve`."""
        system = self.balance.system
        if quotients(system, self.names):
            own = {**self.balance.values, "omega": self.omega}
            infinite = infinite_between(system, self.names, *({**own, **self.named(at)} for at in (point.u, u)))
            if infinite is not None:
                return infinite
        if self.balance.settled:
            return None
        assert isinstance(point.evaluation, MotionEvaluation)
        assert evaluation is None or isinstance(evaluation, MotionEvaluation)
        try:
            state = (evaluation or self.evaluate(u)).state
            return unbounded_along(state) or unbounded_between(point.evaluation.state, state)
        except NotFiniteError as failure:
            return str(failure)

    def floating(self, evaluation: Evaluation, weights: Array, tolerance: float) -> str | None:
        """What floats on a response, in words; None if all is held. `tolerance`: of Newton's method."""
        assert isinstance(evaluation, MotionEvaluation)
        if self.augmentation is not PLAIN:
            return None
        return floating(evaluation.state, self.unit(weights), tolerance)

    def adapted(self, u: Array, evaluation: Evaluation) -> MotionProblem:
        """The curve with the harmonics, samples and bordering vectors of this point."""
        assert isinstance(evaluation, MotionEvaluation)
        state = evaluation.state
        augmentation = evaluation.equations.renewed()
        balance = self.balance
        if self.adaptive is not None:
            balance = self._in_basis(self._basis(evaluation, self.adaptive))
        x = state.x if balance is self.balance else self.balance.basis.resized(state.x, balance.basis)
        if not balance.settled:
            balance = balance.settle(x, state.omega, state.values)
        omega = self.omega
        if self.still and self.steps % CRITICAL_EVERY == 0:
            omega = beyond(balance.system, [(state.recovered[0].real, state.values)], omega)
        if balance is self.balance and augmentation is self.augmentation and omega == self.omega:
            return self
        self.cache[balance.basis] = balance
        if balance.basis != self.balance.basis:
            augmentation = augmentation.resized(balance.basis, balance.size)
        force = max(state.balanced.scale, self.least_force(state))
        erred = self.erred if balance.basis.harmonics >= self.balance.basis.harmonics else 0.0
        return replace(
            self,
            balance=balance,
            augmentation=augmentation,
            omega=omega,
            force=force,
            steps=self.steps + 1,
            erred=erred,
        )

    def _basis(self, evaluation: MotionEvaluation, adaptive: AdaptiveHarmonics) -> HarmonicBasis:
        """The basis that a point needs: a small neglected motion may still matter where a stiff contact just closes."""
        state, present = evaluation.state, self.balance.basis
        basis = choose_harmonics(state, adaptive, self.tolerance)
        lower = basis.harmonics < present.harmonics
        if lower and self.erred > 0.0 and evaluation.floquet.clearance <= self.erred:
            return present
        if basis.harmonics <= present.harmonics and self._far_from_enough(evaluation, adaptive):
            basis = beyond_usual(state, adaptive)
        if basis.harmonics > present.harmonics or not (lower or self.steps % CRITICAL_EVERY == 0):
            return basis
        if evaluation.doubt > CRITICAL:
            return next_harmonics(state, adaptive)
        return present if lower and evaluation.doubt > 0.1 * CRITICAL else basis

    def _far_from_enough(self, evaluation: MotionEvaluation, adaptive: AdaptiveHarmonics) -> bool:
        """Whether as many harmonics as there may be as a rule leave out so much that the equations may have motions
        that do not exist.
        """
        return evaluation.truncation > _TOO_FEW * adaptive.tolerance

    def _in_basis(self, basis: HarmonicBasis) -> HarmonicBalance:
        if basis is self.balance.basis or basis == self.balance.basis:
            return self.balance
        if basis not in self.cache:
            self.cache[basis] = self.balance.with_basis(basis)
        return self.cache[basis]

    def with_balance(self, balance: HarmonicBalance) -> MotionProblem:
        """The same curve with other equations of motion (basis, samples)."""
        self.cache[balance.basis] = balance
        augmentation = self.augmentation
        if balance.basis != self.balance.basis:
            augmentation = augmentation.resized(balance.basis, balance.size)
        return replace(self, balance=balance, augmentation=augmentation)

    def with_basis(self, basis: HarmonicBasis) -> MotionProblem:
        """The same curve in another basis."""
        return self if basis == self.balance.basis else self.with_balance(self._in_basis(basis))

    def finer(self, state: BalanceState, basis: HarmonicBasis) -> tuple[MotionProblem, BalanceState]:
        """The curve in a basis with more harmonics and a motion there: those that come in begin at what the motion
        excites, and the samples are as many as it needs.
        """
        wide, completed = state.completed_x
        x = wide.resized(completed, basis)
        balance = self._in_basis(basis).settle(x, state.omega, state.values)
        return self.with_balance(balance), balance.at(x, state.omega, state.values)

    def transfer(self, u: Array, origin: Curve) -> Array:
        if origin is self:
            return u
        assert isinstance(origin, MotionProblem)
        basis, own = origin.balance.basis, self.balance.basis
        if basis is own or basis == own:
            return u
        n, k = origin.balance.dimension, len(self.names)
        x = basis.resized(u[:n].reshape(basis.size, -1), own)
        return np.concatenate((x.ravel(), origin.augmentation.carried(u[n:-k], own, self.balance.size), u[-k:]))

    def images(self, u: Array) -> list[Array]:
        """The motion shifted by 0, 1, ..., nu - 1 load periods: all the same motion."""
        basis = self.balance.basis
        if basis.nu == 1:
            return [u]
        extra, parameters = self.extra(u), u[-len(self.names) :]
        shifted = []
        x = u[: self.balance.dimension].reshape(basis.size, -1)
        for turn, cosine, sine in _turns(basis.nu, basis.harmonics):
            y = x.copy()
            y[1::2] = cosine * x[1::2] + sine * x[2::2]
            y[2::2] = cosine * x[2::2] - sine * x[1::2]
            shifted.append(self.join(y, parameters, self.augmentation.shifted(extra, turn)))
        return shifted

    def unwrapped(self, u: Array, near: Array) -> Array:
        if not self.augmentation.extras:
            return u
        own = slice(self.balance.dimension, -len(self.names))
        moved = u.copy()
        moved[own] = self.augmentation.unwrapped(u[own], near[own])
        return moved

    def named(self, u: Array) -> dict[str, float]:
        """Values of the free parameters by name."""
        return dict(zip(self.names, u[-len(self.names) :].tolist(), strict=True))

    def where(self, u: Array) -> str:
        """The free parameters' values in words."""
        return ", ".join(f"{name} = {value:.6g}" for name, value in self.named(u).items())


@lru_cache(maxsize=64)
def _turns(nu: int, harmonics: int) -> list[tuple[float, Array, Array]]:
    """The shifts by load periods as angles of the motion's own period, with cosine and sine at every harmonic."""
    turns = [2.0 * np.pi * shift / nu for shift in range(nu)]
    angles = [turn * np.arange(1, harmonics + 1)[:, None] for turn in turns]
    return [(turn, np.cos(angle), np.sin(angle)) for turn, angle in zip(turns, angles, strict=True)]
