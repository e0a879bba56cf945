"""The plane of omega and a design parameter in strips, in which stable arcs keep their order; labels and motions of its
points.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from suboctave.continuation.linear import one_thread
from suboctave.curves.identity import apart
from suboctave.curves.junction import period_name
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.floquet import floquet_multipliers
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.maps.catalogue import Catalogue, motion_near
from suboctave.maps.regimes.slices import Arc, Slice
from suboctave.model.system import System
from suboctave.results.tracked_branch import TrackedBranch

__all__ = ["LabelledPlane", "Regime", "Strip", "regime_of"]

#: steps of the way, shares of it: the first, the smallest
_FIRST, _SMALLEST = 0.5, 1e-3
#: a step may change the harmonics of a motion by this share of them
_MOST = 0.35
#: and keeps this share of what a motion of a shorter period has not: else it fell back onto that
_KEPT = 0.3


@dataclass(frozen=True)
class Regime:
    """The stable motions that coexist: of each its period in periods of the load, and whether it lies on an isola.

    `beyond`: the same of what leaves the deepest branches at period doublings, with the period of the first such
    motions. It was not followed: it may double again, or be chaotic.
    """

    motions: tuple[tuple[int, bool], ...] = ()
    beyond: tuple[tuple[int, bool], ...] = ()

    @property
    def count(self) -> int:
        """How many stable motions are known; two that differ by a shift in time only are one, mirror images two."""
        return len(self.motions)

    @property
    def periods(self) -> tuple[int, ...]:
        """Their periods in periods of the load, ascending, one for each motion."""
        return tuple(nu for nu, _ in self.motions)

    @property
    def isolated(self) -> bool:
        """Whether one of them lies on an isola."""
        return any(isolated for _, isolated in (*self.motions, *self.beyond))

    def __str__(self) -> str:
        parts = []
        for group, words in ((self.motions, ""), (self.beyond, " or more")):
            for (nu, isolated), number in sorted(Counter(group).items()):
                name = f"{period_name(nu)}{words}{' on an isola' if isolated else ''}"
                parts.append(name if number == 1 else f"{number} x {name}")
        return " + ".join(parts) or "no stable motion known"


@dataclass(frozen=True, eq=False)
class Strip:
    """Values of the parameter from `low` to `high`, the slice that stands for them, and whether it lies within."""

    low: float
    high: float
    slice: Slice | None
    examined: bool

    @property
    def arcs(self) -> list[Arc]:
        """The stable arcs."""
        return [] if self.slice is None else self.slice.arcs

    @property
    def value(self) -> float:
        """The value of the parameter at which branches were followed."""
        return 0.5 * (self.low + self.high) if self.slice is None else self.slice.value


class LabelledPlane:
    """What `RegimeMap` says of a point: stable arcs over omega and a design parameter, strip by strip."""

    def __init__(self, catalogue: Catalogue, strips: Sequence[Strip], depth: int, resolution: float) -> None:
        self.system = catalogue.system
        self.parameter = catalogue.name
        self.omega: tuple[float, float] = catalogue.omega
        self.bounds = catalogue.bounds
        self.options = catalogue.options
        self.curves: tuple[TrackedBranch, ...] = tuple(catalogue.curves)
        self.strips = tuple(strips)
        self.depth = depth
        self.resolution = resolution
        self.notes = tuple(catalogue.notes)
        self.interruption = catalogue.interruption

    def strip(self, value: float) -> Strip:
        """The strip that a value of the parameter lies in; InputError outside the bounds."""
        low, high = self.bounds
        if not is_number(value) or not low <= value <= high:
            raise InputError(f"the map reaches from {self.parameter} = {low:g} to {high:g}, not to {value!r}")
        return next(s for s in self.strips if value <= s.high or s is self.strips[-1])

    def arcs(self, omega: float, value: float) -> list[Arc]:
        """The stable arcs that have a motion at a point of the plane; InputError outside the map."""
        low, high = self.omega
        if not is_number(omega) or not low <= omega <= high:
            raise InputError(f"the map reaches from omega = {low:g} to {high:g}, not to {omega!r}")
        present = []
        for arc in self.strip(value).arcs:
            first, last = (float(v) for v in arc.range(value))
            if first <= omega <= last:
                present.append(arc)
        return present

    def motion(self, arc: Arc, omega: float, value: float) -> PeriodicOrbit:
        """The motion of an arc at a point of the plane, solved there; ConvergenceError if it is not found again."""
        seen = self.strip(value).value
        return motion_at(arc, seen, self.system, self.parameter, self.omega, omega, value)

    def motions(self, omega: float, value: float) -> list[PeriodicOrbit]:
        """The stable motions themselves at a point of the plane, solved there; those beyond the depth are left out.

        Raises
        ------
        ConvergenceError
            If one is not found again, which may happen next to a border.
        """
        return [self.motion(arc, omega, value) for arc in self.arcs(omega, value) if arc.followed]

    def label(self, omega: float, value: float) -> Regime:
        """The stable motions known at a point of the plane.

        Raises
        ------
        InputError
            Outside the map.
        """
        return regime_of(self.arcs(omega, value))


def regime_of(arcs: Sequence[Arc]) -> Regime:
    """The label of motions that coexist."""
    known, beyond = ([(a.nu, a.isolated) for a in arcs if a.followed is followed] for followed in (True, False))
    return Regime(tuple(sorted(known)), tuple(sorted(beyond)))


# ------------------------------------------------------------------------------------------------- motions at points
def motion_at(
    arc: Arc, seen: float, system: System, name: str, within: tuple[float, float], omega: float, value: float
) -> PeriodicOrbit:
    """The motion of an arc at (omega, value), from its own motions at the value `seen`, step by step.

    On the way it keeps its place between the two ends of its arc, so that the path stays on the arc.

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
