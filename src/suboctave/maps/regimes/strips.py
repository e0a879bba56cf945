"""The plane of omega and a design parameter in strips, in which stable arcs keep their order; labels of its points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from suboctave.curves.junction import period_name
from suboctave.errors import InputError, is_number
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.maps.catalogue import Catalogue
from suboctave.maps.regimes.arcs import Arc
from suboctave.maps.regimes.motions import motion_at
from suboctave.maps.regimes.slices import Slice
from suboctave.results.tracked_branch import TrackedBranch

__all__ = ["LabelledPlane", "Regime", "Strip", "regime_of"]


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
