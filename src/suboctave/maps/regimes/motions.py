"""The motion of a stable arc at a point of the plane: reached from the arc's own motions, step by step.

On the way the motion keeps its place between the two ends of its arc, so that the path stays on the arc.
"""

from __future__ import annotations

import numpy as np

from suboctave.continuation.linear import one_thread
from suboctave.curves.identity import apart
from suboctave.errors import ConvergenceError
from suboctave.floquet import floquet_multipliers
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.maps.catalogue import motion_near
from suboctave.maps.regimes.arcs import Arc
from suboctave.model.system import System

__all__ = ["motion_at"]

#: steps of the way, shares of it: the first, the smallest
_FIRST, _SMALLEST = 0.5, 1e-3
#: a step may change the harmonics of a motion by this share of them
_MOST = 0.35
#: and keeps this share of what a motion of a shorter period has not: else it fell back onto that
_KEPT = 0.3


def motion_at(
    arc: Arc, seen: float, system: System, name: str, within: tuple[float, float], omega: float, value: float
) -> PeriodicOrbit:
    """The motion of an arc at (omega, value); `seen` is the value at which the arc was computed.

    Raises
    ------
    ConvergenceError
        If Newton's method loses it on the way.
    """
    low, high = _range(arc, value, within)
    share = (omega - low) / ((high - low) or 1.0)

    def place(way: float) -> tuple[float, float]:
        there = seen + way * (value - seen)
        first, last = _range(arc, there, within)
        return first + share * (last - first), there

    begin = place(0.0)[0]
    orbit = min((p.orbit for p in arc.points), key=lambda o: abs(o.omega - begin))
    way, step = 0.0, _FIRST
    with one_thread():
        while way < 1.0:
            target = min(1.0, way + step)
            at = (omega, value) if target == 1.0 else place(target)
            motion = _solved(orbit, system, name, *at)
            if motion is None or not _follows(orbit, motion):
                step *= 0.5
                if step < _SMALLEST:
                    where = f"omega = {omega:.6g}, {name} = {value:.6g}"
                    raise ConvergenceError(f"the motion of {arc.nu} load periods at {where} was not found again")
                continue
            orbit, way = motion, target
    return orbit


def _range(arc: Arc, value: float, within: tuple[float, float]) -> tuple[float, float]:
    low, high = arc.range(value)
    return max(float(low), within[0]), min(float(high), within[1])


def _follows(orbit: PeriodicOrbit, motion: PeriodicOrbit) -> bool:
    """Whether a motion may be the next one of an arc: not far off, of the same period, stable as all of them are."""
    lasting = _own(motion) >= _KEPT * _own(orbit)
    return lasting and apart(orbit, motion) <= _MOST and bool(floquet_multipliers(motion.state()).stable)


def _own(orbit: PeriodicOrbit) -> float:
    """Size of the harmonics that motions of half the period, or of the load's, do not have; of the latter all."""
    sizes = np.linalg.norm(orbit.amplitudes, axis=1)
    orders, nu = np.arange(len(sizes)), orbit.basis.nu
    if nu == 1:
        return float(np.linalg.norm(sizes))
    return float(np.linalg.norm(sizes[orders % 2 == 1] if nu % 2 == 0 else sizes[orders % nu != 0]))


def _solved(orbit: PeriodicOrbit, system: System, name: str, omega: float, value: float) -> PeriodicOrbit | None:
    """The motion near another one at other values; None if Newton's method arrives at none there."""
    try:
        return motion_near(orbit, system.with_parameters({name: value}), omega)
    except ConvergenceError:
        return None
