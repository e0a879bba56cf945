"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period on
panels that follow the laws (`linearised`, `time_mesh`, `propagate`).

A motion of H harmonics is not quite the true one: it leaves the force `r = sum d (f - P_H f)` unbalanced, P_H f the
part of the element forces within the basis. One step of Newton's method among periodic functions (Kantorovich),

    M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = -r,   y periodic,

whose propagator is at hand, gives what the motion lacks: harmonics beyond H without end, and the shift that they cause
in those within. The multipliers are those of the motion so corrected, with an error of second order. How far they are
from those of the motion as it stands, propagated with fewer digits, is their error estimate: it covers what is left
many times over, and it also covers how far other discretisations of the motion, such as Hill's determinant, may differ.

At a limit point there is no such step: a motion of the same frequency is far away, or there is none. What the step
moves along the direction of the multiplier near +1 is then left out, and belongs to the error: with the gap
`g = 1 - mu` and the shift D of the multiplier to first order, the motions near a fold leave `g^2 - 2 g D` for the
square of the gap, so that the shift is at most about `sqrt(2 g |D|)`.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from scipy.linalg import lapack

from suboctave.floquet.linearised import Linearised
from suboctave.floquet.propagate import multipliers_and_shifts, response
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.interruption import check_time

#: a correction larger than this share of the motion is cut down to it
_LARGEST = 0.1
#: least error where stiffness or damping varies: what the panels are made for
_PANELS = 1e-8
#: shift of a multiplier in units of its distance to +1 that leaves doubt whether the first order tells it
_DOUBTFUL = 0.1
#: distance to +1 up to which multipliers lie together with the nearest one, in units of its own
_TOGETHER = 3.0
#: natural vibrations in a period of the load beyond which a phase has no digits left
_MOST_TURNS = 1e15

__all__ = ["FloquetResult", "floquet_multipliers"]


def floquet_multipliers(state: BalanceState, corrected: bool = True) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods).

    corrected
        False: along the motion as it stands, as if it were exact; errors are then those of the propagation alone.
    """
    check_time()
    motion = _Motion(Linearised(state), corrected)
    if not np.isfinite(motion.before).all():
        return _no_numbers(state, motion.along.size)
    mu, shift, share = motion.multipliers(1.0)
    # there are few: numbers are quicker than arrays
    values, shifts = mu.tolist(), shift.tolist()
    largest = max(1.0, abs(values[0]))
    # that nearest to +1 before the correction, which may have carried it off
    nearest = min(range(len(values)), key=lambda i: abs(1.0 - values[i]) - shifts[i])
    distance = abs(1.0 - values[nearest])
    moved = shifts[nearest] / share if share > 0.0 else math.inf
    if moved > _DOUBTFUL * distance:
        mu, shift, share = _beside_fold(motion, moved, shift)
    # where the correction had to be cut, the motion is not near enough to a true one to say much
    cut = 1.0 / share - 1.0 if share > 0.0 else math.inf
    least = (_PANELS if motion.along.varying else 0.0) + cut
    return FloquetResult(mu, shift * (1.0 + cut) + least * largest)


def _no_numbers(state: BalanceState, count: int) -> FloquetResult:
    """Where a law gives no number between the samples of a motion; OverflowError for sizes beyond numbers."""
    mass, _, stiffness = state.balance.system.with_parameters(state.values).matrices()
    with np.errstate(all="ignore"):
        turns = math.sqrt(float(np.abs(np.linalg.solve(mass, stiffness)).max())) / state.omega
    if not turns < _MOST_TURNS:
        raise OverflowError(f"natural vibrations turn {turns:.0e} times in a period of the load")
    return FloquetResult.inapplicable(count, "monodromy", "The linearised motion is not finite")


def _beside_fold(motion: _Motion, moved: float, shift: Array) -> tuple[ComplexArray, Array, float]:
    """Multipliers, shifts and share where a correction may have no meaning, as it does at a limit point.

    moved: shift of the multiplier nearest to +1 by the whole correction.
    """
    gap = motion.gap()
    ratio = 2.0 * moved / gap if gap > 0.0 else math.inf
    mu, kept, share = motion.multipliers(1.0 / (1.0 + min(ratio, 1e6) ** 4))
    left_out = moved * min(1.0, 2.0 / math.sqrt(ratio)) if math.isfinite(moved) else math.inf
    return mu, kept + 2.0 * left_out, share


class _Motion:
    """A motion as it stands, and one step of Newton's method from it.

    Attributes
    ----------
    before
        Monodromy matrix along the motion as it stands, (2 n, 2 n).
    """

    def __init__(self, along: Linearised, corrected: bool) -> None:
        self.along = along
        self.before, start, self._nodes = along.standing()
        self._start = start if corrected and len(self._nodes) and len(along.active) else None

    def multipliers(self, weight: float) -> tuple[ComplexArray, Array, float]:
        """Multipliers, how far the correction has moved them, and the share of it that was taken.

        weight: share of its part along the direction of the real multiplier nearest to +1.
        """
        along, share, start = self.along, 1.0, self._start
        if start is None:
            change = np.zeros_like(along.path)
        else:
            if weight < 1.0:
                start = start - (1.0 - weight) * (projector(self.before) @ start)
            change, share = response(start, self._nodes, along.active, along.path, _LARGEST)
        after = along.corrected(change)
        real, imaginary, left, right, _ = lapack.dgeev(after, 1, 1)
        mu, shift = multipliers_and_shifts(real, imaginary, left, right, after, self.before)
        order = np.argsort(-np.abs(mu), kind="stable")
        return mu[order], shift[order], share

    def gap(self) -> float:
        """Distance to +1 of the nearest multiplier of the motion as it stands."""
        return float(np.abs(1.0 - np.linalg.eigvals(self.before)).min())


def projector(phi: Array) -> Array:
    """On the invariant subspace of the multipliers nearest to +1, one or several that lie together, (N, N).

    With `phi = Q [[A, X], [0, B]] Q^T`, A with these multipliers, it is `Q [[1, R], [0, 0]] Q^T`, `A R - R B = X`.
    """
    mu = np.linalg.eigvals(phi)
    reach = _TOGETHER * float(np.abs(1.0 - mu).min())
    schur, q, count = scipy.linalg.schur(phi, sort=lambda re, im: math.hypot(1.0 - re, im) <= reach)
    inside, coupling, outside = schur[:count, :count], schur[:count, count:], schur[count:, count:]
    beside = scipy.linalg.solve_sylvester(inside, -outside, coupling) if 0 < count < len(phi) else coupling
    result: Array = q[:, :count] @ np.hstack((np.eye(count), beside)) @ q.T
    return result
