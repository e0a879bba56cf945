"""The true motions beside those of a curve by multiple shooting, many at once.

Of a response omega is free, so that what counts is the distance to the curve of true motions. Motions that nothing
drives are corrected at their phase, with omega and what their curve runs over: of limit cycles a parameter, of
nonlinear modes the artificial damping `C - d M` as an unknown d (`curves.kinds.nonlinear_mode`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import ComplexArray, HarmonicBasis
from suboctave.harmonic.condensed import linear_part_of
from suboctave.harmonic.energy import damping_ratio
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.model.projected import ProjectedSystem
from suboctave.model.system import System
from suboctave.projection import system_of_motions
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.modes import ModeCurve
from suboctave.timedomain import shoot_along
from suboctave.timedomain.multiple_shooting import MultipleShooting, ShotMotions
from suboctave.verification.motions import distance_of, largest_of


@dataclass(frozen=True)
class Shot:
    """The true motion beside one of harmonic balance, if `converged`, its state in the coordinates of `system`.

    A bifurcation lies `along` the curve of true motions from there, in units of the motion's size, at `omega_there`;
    nan where none of the kind lies within the distance that was looked at, or none was looked for.
    """

    converged: bool
    distance: float
    state: Array
    omega: float
    multipliers: ComplexArray
    errors: Array
    along: float
    omega_there: float
    system: System


class Shots:
    """Multiple shooting from motions of one curve, which have one period.

    Its differences take four trajectories for every coordinate and piece: responses of projected structures, with
    dozens of coordinates, are shot at once over the period.
    """

    def __init__(self, branch: Branch, orbits: Sequence[PeriodicOrbit], workers: int | None = None) -> None:
        #: whether nothing drives the motions
        self.alone = not branch.system.driven and any(np.any(orbit.x[1:]) for orbit in orbits)
        free, self.unit = tuple[str, ...](), 1.0
        if isinstance(branch, ModeCurve):
            free = (_new_name(branch.system.parameters),)
            orbits = kept_going(orbits, *free)
            sizes = [abs(orbit.values[free[0]]) for orbit in orbits] if branch.damped else [0.0]
            # of a conservative mode a damping ratio of one is the unit
            self.unit = max(sizes) or 2.0 * max(orbit.omega for orbit in orbits)
        elif self.alone:
            assert isinstance(branch, TrackedBranch)
            free = branch.names[1:2]
            values = branch.parameter(*free)
            self.unit = float(np.ptp(values) or np.abs(values).max() or 1.0)
        self.orbits = orbits
        self.system = system_of_motions(orbits)
        #: the last projection of a single motion, and the linear part that it was solved with
        self._own: tuple[LinearPart, System] | None = None
        self.shooting = MultipleShooting(self.system, orbits[0].basis.nu, workers, free)
        self.single = isinstance(self.system, ProjectedSystem) and not self.alone

    def motions(self, which: Sequence[int], kinds: Sequence[str] = (), reach: float | None = None) -> Iterator[Shot]:
        """The true motions beside some of these; where bifurcations of these kinds lie, within `reach` either way."""
        orbits = [self.orbits[i] for i in which]
        if self.single:
            yield from map(self._single, orbits)
            return
        count = self.shooting.at_once
        for begin in range(0, len(orbits), count):
            end = begin + count
            yield from self._batch(orbits[begin:end], kinds[begin:end], reach)

    def _single(self, orbit: PeriodicOrbit) -> Shot:
        linear = orbit.state().linear
        if self._own is None or self._own[0] is not linear:
            # a basis grows along a curve, and another one has other multipliers beyond the frequencies it is made for
            self._own = linear, system_of_motions([orbit])
        system = self._own[1]
        start = system.reduced(orbit.start())
        try:
            found = shoot_along(system, start, orbit.omega, orbit.basis.nu, orbit.values)
        except ConvergenceError:
            none = np.zeros(0, dtype=complex)
            return Shot(False, math.inf, start, orbit.omega, none, none.real, math.nan, math.nan, system)
        distance = distance_of(system, orbit, start, found)
        doubt = np.full(len(found.multipliers), found.residual)
        return Shot(True, distance, found.state, found.omega, found.multipliers, doubt, math.nan, found.omega, system)

    def _batch(self, orbits: Sequence[PeriodicOrbit], kinds: Sequence[str], reach: float | None) -> list[Shot]:
        states, omega, parameters, sizes, held = self._starts(orbits)
        n = states.shape[2]
        middle = self.shooting.solve(states, omega, parameters, sizes, held=held)
        multipliers, errors = middle.multipliers()
        distance = np.max(np.abs(middle.states - states) / sizes[:, None, :n], axis=(1, 2))
        distance = np.maximum(distance, np.abs(middle.omega - omega) / omega)
        for j, name in enumerate(self.shooting.free):
            distance = np.maximum(distance, np.abs(middle.free[:, j] - parameters[name]) / sizes[:, n + j])
        places = [(math.nan, float(there)) for there in middle.omega]
        if reach is not None:
            t = np.where(np.isfinite(middle.tangent), middle.tangent, 0.0)
            sides = []
            for way in (-reach, reach):
                moved, tail = np.split(way * t, [states[0].size], axis=1)
                y = middle.states + moved.reshape(states.shape) * sizes[:, None, :n]
                beside = {
                    name: middle.free[:, j] + tail[:, 1 + j] * sizes[:, n + j]
                    for j, name in enumerate(self.shooting.free)
                }
                w = middle.omega * (1.0 + tail[:, 0])
                sides.append(self.shooting.solve(y, w, {**parameters, **beside}, sizes, along=t, held=held))
            places = [_place(kind, [sides[0], middle, sides[1]], b, reach) for b, kind in enumerate(kinds)]
        return [
            Shot(bool(middle.converged[b]), float(distance[b]), middle.states[b, 0], float(middle.omega[b]),
                 multipliers[b], errors[b], *place, self.system)
            for b, place in enumerate(places)
        ]  # fmt: skip

    def _starts(self, orbits: Sequence[PeriodicOrbit]) -> tuple[Array, Array, dict[str, Array], Array, Array | None]:
        """States, omega, parameters, sizes, and the directions in which a free phase moves the states."""
        share = np.arange(self.shooting.pieces) / self.shooting.pieces
        states, sizes, turning = [], [], []
        for orbit in orbits:
            t = share * orbit.period
            x, v, a = (part(t).T for part in (orbit.displacement, orbit.velocity, orbit.acceleration))
            states.append(self.system.reduced(np.hstack([x, v])))
            largest = largest_of(orbit, self.system)
            # a motion at rest has no size of its own
            own = np.repeat([largest[0] or 1.0, largest[1] or orbit.omega], self.system.n)
            sizes.append(np.append(own, [self.unit] * len(self.shooting.free)))
            way = (self.system.reduced(np.hstack([v, a])) / own).ravel()
            turning.append(way / (np.linalg.norm(way) or 1.0))
        values = {name: np.array([orbit.values[name] for orbit in orbits]) for name in self.system.parameters}
        moved = {name: own for name, own in values.items() if (own != self.system.parameters[name]).any()}
        moved |= {name: values[name] for name in self.shooting.free}
        omega = np.array([orbit.omega for orbit in orbits])
        return np.array(states), omega, moved, np.array(sizes), np.array(turning) if self.alone else None


def kept_going(orbits: Sequence[PeriodicOrbit], rate: str) -> list[PeriodicOrbit]:
    """Motions of a nonlinear mode as those of a system with the damping `C - rate M`, at the rate that each has."""
    system = orbits[0].balance.system.fed(rate)
    linear, balances = None, dict[HarmonicBasis, HarmonicBalance]()
    if not isinstance(orbits[0].balance.linear, StructuralMatrices):
        highest = max((orbit.basis.multiples[-1] + 0.5) * orbit.omega for orbit in orbits)
        linear = linear_part_of(system, None, float(highest))
    found = []
    for orbit in orbits:
        values = {**orbit.values, rate: 2.0 * damping_ratio(orbit.state()) * orbit.omega}
        if orbit.basis not in balances:
            own = HarmonicBalance(system, orbit.basis, linear=linear)
            balances[orbit.basis] = own.settle(orbit.x, orbit.omega, values)
        found.append(replace(orbit, balance=balances[orbit.basis], values=values, zeta=0.0))
    return found


def _new_name(names: Any) -> str:
    """A name that no parameter has."""
    name = "fed"
    while name in names:
        name += "_"
    return name


def _place(kind: str, at: list[ShotMotions], b: int, reach: float) -> tuple[float, float]:
    """Where the test function of a kind vanishes along the curve, and omega there; nan where it keeps its sign."""
    if not all(motions.converged[b] for motions in at):
        return math.nan, math.nan
    values = [_test(kind, motions, b) for motions in at]
    if kind == "NS":
        values = _pair(values)
    if not values[0] * values[2] < 0.0:
        return math.nan, math.nan
    # a parabola through the three, and where it vanishes between the sides
    c, a, d = (float(value) for value in np.polyfit((-1.0, 0.0, 1.0), values, 2))
    roots = np.roots([c, a, d]) if c != 0.0 else np.array([-d / a])
    inside = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and abs(root.real) <= 1.0]
    share = min(inside, key=abs) if inside else 0.0
    bend = np.polyfit((-1.0, 0.0, 1.0), [float(motions.omega[b]) for motions in at], 2)
    return reach * share, float(np.polyval(bend, share))


def _test(kind: str, motions: ShotMotions, b: int) -> Any:
    """What changes its sign at a bifurcation; of a Neimark-Sacker point all multipliers of pairs."""
    monodromy = motions.monodromy[b]
    if kind == "LP":
        return float(motions.tangent[b, -1])
    if kind == "extremum":
        return float(motions.tangent[b, motions.states[b].size])
    if kind == "BP":
        return float(motions.border[b])
    if kind == "PD":
        return float(np.linalg.det(monodromy + np.eye(len(monodromy))))
    multipliers = np.linalg.eigvals(monodromy)
    return multipliers[multipliers.imag > 1e-9 * np.abs(multipliers)]


def _pair(pairs: list[Any]) -> list[float]:
    """|mu|^2 - 1 of the pair that is nearest to the unit circle in the middle, followed to either side."""
    if not all(map(len, pairs)):
        return [1.0, 1.0, 1.0]
    own = pairs[1][np.argmin(np.abs(np.abs(pairs[1]) - 1.0))]
    return [float(abs(solved[np.argmin(np.abs(solved - own))]) ** 2 - 1.0) for solved in pairs]
