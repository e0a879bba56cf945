"""A point of a curve with many more harmonics than it is followed with: what those left out move.

Where the largest number of harmonics does not suffice, as with stops that are a thousand times as stiff as the springs,
the motion beside a point is solved for with twice as many, four times as many, .. (`harmonic.finer`), in the plane
across the curve's tangent, until its multipliers are known.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from suboctave.continuation.linear import length
from suboctave.continuation.problem import Array
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.finer import BorderedMotion
from suboctave.interruption import check_time

#: residual of a finer motion in units of the forces that balance, and its last correction in scaled arclength, at most
_TOLERANCE, _CORRECTION = 1e-10, 1e-7
#: harmonics of omega from which on no more are tried
_MOST = 1000
#: power of the number of harmonics that errors of multipliers fall like, at least: beside a contact
_FALLS = 3
#: corrections before it is given up, and the longest one in scaled arclength
_CORRECTIONS, _LONGEST = 15, 0.5
#: growth of the residual by a correction that is taken all the same, across the corner of a contact; least share of one
_GROWS, _SHORTEST = 2.0, 0.05


@dataclass(frozen=True, eq=False)
class FinerMotion:
    """A motion with more harmonics than its curve has.

    low
        The curve that it lies beside, with the harmonics that it is followed with.
    curve, u, state
        The same with more, and the motion there.
    row, weights
        The scaled row that it was solved with, and the scaling of u.
    """

    low: MotionProblem
    curve: MotionProblem
    u: Array
    state: BalanceState
    row: Array
    weights: Array

    @property
    def harmonics(self) -> int:
        """How many harmonics it has."""
        return self.curve.balance.basis.harmonics

    @property
    def parameter(self) -> float:
        """Value of the free parameter."""
        return float(self.u[-1])

    def with_more(self) -> FinerMotion:
        """The motion with twice as many harmonics; raises ConvergenceError where none is found."""
        return _solved(self.low, self.curve, self.state, self.row)

    def beside(self, way: float) -> FinerMotion:
        """The motion of as many harmonics a way along the tangent from this one, in scaled arclength."""
        along = self.tangent
        row = self.weights * along
        return _corrected(self.low, self.curve, self.u + way * along, row / length(row), self.weights)

    @property
    def tangent(self) -> Array:
        """Tangent of the curve there, of unit length in scaled arclength."""
        border = BorderedMotion(
            self.state,
            self.state.residual_by(self.curve.name),
            self.row * self.weights,
            self.low.balance.basis.harmonics,
        )
        t = border.solve(np.eye(1, len(self.u), len(self.u) - 1)[0])
        result: Array = t / length(self.weights * t)
        return result


def finer(curve: MotionProblem, state: BalanceState, tangent: Array, doublings: int = 1) -> FinerMotion:
    """The motion beside a solved one of a curve, with twice as many harmonics, or after more doublings of their number,
    across the curve's tangent there; raises ConvergenceError where none is found.
    """
    row = curve.weights(curve.u_of(state), 0.0) * tangent
    return _solved(curve, curve, state, row / length(row), doublings)


def resolved_beside(
    curve: MotionProblem, state: BalanceState, tangent: Array, known: FloquetResult
) -> tuple[FinerMotion, FloquetResult] | None:
    """The motion beside a solved one of a curve with as many harmonics as resolve its multipliers, or as are worth
    their time, and these; None if there is none. known: the multipliers of the solved one.
    """
    best: tuple[FinerMotion, FloquetResult] | None = None
    motion: FinerMotion | None = None
    while motion is None or motion.harmonics < _MOST * motion.curve.balance.basis.nu:
        try:
            motion = _first(curve, state, tangent, known.vagueness) if motion is None else motion.with_more()
        except ConvergenceError:
            break
        best = motion, floquet_multipliers(motion.state)
        if best[1].resolved and best[1].decided:
            break
    return best


def _first(curve: MotionProblem, state: BalanceState, tangent: Array, vagueness: float) -> FinerMotion:
    """With four times as many harmonics where the errors of multipliers want it, which fall like their third power at
    least, or else with twice as many.
    """
    if vagueness > 2.0**_FALLS:
        with suppress(ConvergenceError):
            return finer(curve, state, tangent, 2)
    return finer(curve, state, tangent)


def _solved(
    low: MotionProblem, origin: MotionProblem, state: BalanceState, row: Array, doublings: int = 1
) -> FinerMotion:
    basis, completed = state.completed_x
    for _ in range(doublings - 1):
        more = HarmonicBasis(2 * basis.harmonics + 1, basis.nu)
        basis, completed = more, basis.resized(completed, more)
    wide = low.with_basis(basis)
    wide = wide.with_balance(wide.balance.settle(completed, state.omega, state.values))
    u = wide.join(completed, origin.u_of(state)[-1:])
    kept = np.zeros(len(u))
    kept[: len(row) - 1], kept[-1] = row[:-1], row[-1]
    return _corrected(low, wide, u, kept, wide.weights(u, 0.0))


def _corrected(low: MotionProblem, wide: MotionProblem, guess: Array, row: Array, weights: Array) -> FinerMotion:
    """Newton's method from a guess, in the plane through it that a scaled row is the normal of."""
    few, where = low.balance.basis.harmonics, f"{wide.balance.basis.harmonics} harmonics at {wide.where(guess)}"
    u, size, here = guess, math.inf, _evaluated(wide, guess)
    for _ in range(_CORRECTIONS):
        check_time()
        if here.error <= _TOLERANCE and size <= _CORRECTION:
            return FinerMotion(low, wide, u, here.state, row, weights)
        border = BorderedMotion(here.state, here.state.residual_by(wide.name), row * weights, few)
        if border.singular:
            break
        step = border.solve(np.append(here.residual, 0.0))
        size = length(weights * step)
        share = min(1.0, _LONGEST / size) if size > 0.0 else 1.0
        while True:
            with suppress(ConvergenceError):
                there = _evaluated(wide, u - share * step)
                if there.error <= max(_GROWS * here.error, _TOLERANCE):
                    break
            share *= 0.5
            if share < _SHORTEST:
                raise ConvergenceError(f"the iteration for {where} diverges")
        u, here = u - share * step, there
    raise ConvergenceError(f"no motion was found with {where}, beside that of {few}")


def _evaluated(wide: MotionProblem, u: Array) -> MotionEvaluation:
    here = wide.evaluate(u)
    if not math.isfinite(here.error):
        raise ConvergenceError(f"the residual is not finite at {wide.where(u)}")
    return here
