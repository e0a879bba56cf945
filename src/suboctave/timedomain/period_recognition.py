"""Which motion a trajectory has settled on, from its stroboscopic points alone.

A motion has the period nT if its last points repeat after n of them, n the smallest such number: `|y_(k+n) - y_k| <=
tolerance` of the motion's size for the last 2 n pairs. So at least 3 n points are needed. Points that spiral towards
one may do so before they have come together, for the n after which the spiral has gone about once around: the
differences then shrink from n points to the next n, and what is still to come by that rate must be little beside the
distances that make it a motion of nT. Two things cannot be told: a motion of twice the period whose points lie closer
together than the tolerance counts as the simple one, and one that still creeps by less than the tolerance counts as
settled. Points are compared modulo the turns of angles.

A motion drifts if its points repeat after n of them but for displacements that grow by the same each time: so does a
rotation whose angle is not declared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suboctave.model.angles import NO_TURNS, Turns
from suboctave.model.elements.base import Array

__all__ = ["Drift", "Repeat", "drift_of", "extents", "floored", "period_of", "same_cycle"]

_SMALLEST_SHARE = 1e-3
#: largest share of the distance between the points of a cycle by which they may still move
_TO_COME = 0.1
#: slowest rate at which differences count as shrinking
_SLOWEST = 0.999
#: least growth of a motion that drifts, relative to its size: less may be the last of a slow approach
_DRIFTS = 1e-2


@dataclass(frozen=True)
class Repeat:
    """The period in load periods, 0 if nothing repeats, and by how much the points miss, relative to the motion."""

    period: int
    defect: float


def extents(peaks: Array, omega: float, mass: Array) -> Array:
    """Sizes (2n,) of displacements and velocities of a motion, from its largest displacements (n,).

    A degree of freedom that hardly moves counts for a thousandth of the largest one, weighted by the roots of the
    masses `mass` (n,).
    """
    lengths = np.maximum(floored(peaks, mass), np.finfo(float).tiny)
    return np.concatenate([lengths, omega * lengths])


def floored(sizes: Array, mass: Array) -> Array:
    """Sizes (n,) of which none is below a thousandth of the largest, weighted by the roots of the masses (n,)."""
    weight = np.sqrt(mass)
    return np.maximum(sizes, _SMALLEST_SHARE * np.max(sizes * weight) / weight)


@dataclass(frozen=True, eq=False)
class Drift:
    """After how many load periods points repeat but for a drift, and by how much displacements (n,) grow meanwhile."""

    period: int
    step: Array


def drift_of(points: Array, omega: float, mass: Array, tolerance: float) -> Drift | None:
    """The steady drift of stroboscopic points (P, 2n), turns of angles included; None without one."""
    if not np.isfinite(points).all():
        return None
    dofs = points.shape[1] // 2
    for n in range(1, len(points) // 3 + 1):
        grown = points[-2 * n :] - points[-3 * n : -n]
        step = grown[:, :dofs].mean(axis=0)
        speeds = np.abs(points[-3 * n :, dofs:]).max(axis=0) / omega
        sizes = extents(np.maximum(np.abs(step), speeds), omega, mass)
        grown[:, :dofs] -= step
        if np.max(np.abs(grown) / sizes) <= tolerance and np.max(np.abs(step) / sizes[:dofs]) >= _DRIFTS:
            return Drift(n, step)
    return None


def period_of(points: Array, sizes: Array, tolerance: float, turns: Turns = NO_TURNS) -> Repeat:
    """The period of stroboscopic points (P, 2n), as long as they can show."""
    if not np.isfinite(points).all():
        return Repeat(0, np.inf)
    best = np.inf
    for n in range(1, len(points) // 3 + 1):
        defect = float(np.max(np.abs(turns.modulo(points[-2 * n :] - points[-3 * n : -n])) / sizes))
        if defect <= tolerance and _stays_apart(points, sizes, n, turns):
            return Repeat(n, defect)
        best = min(best, defect)
    return Repeat(0, best)


def _stays_apart(points: Array, sizes: Array, n: int, turns: Turns) -> bool:
    """Whether the n points of a cycle will not come together to one of a shorter period."""
    changes = np.abs(turns.modulo(points[-2 * n :] - points[-3 * n : -n])) / sizes
    before, last = float(changes[:n].max()), float(changes[n:].max())
    rate = min(last / before, _SLOWEST) if before > 0.0 else 0.0
    to_come = last * rate / (1.0 - rate)
    cycle = points[-n:]
    shorter = (turns.modulo(np.roll(cycle, d, axis=0) - cycle) for d in range(1, n) if n % d == 0)
    apart = (float(np.max(np.abs(away) / sizes)) for away in shorter)
    return all(to_come <= _TO_COME * distance for distance in apart)


def same_cycle(one: Array, other: Array, sizes: Array, tolerance: float, turns: Turns = NO_TURNS) -> bool:
    """Whether two cycles of n points (n, 2n) are the same but for where they begin."""
    if one.shape != other.shape:
        return False
    return any(
        float(np.max(np.abs(turns.modulo(np.roll(other, shift, axis=0) - one)) / sizes)) <= tolerance
        for shift in range(len(one))
    )
