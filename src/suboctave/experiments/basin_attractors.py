"""The attractors that basins belong to: those that are given, and those that trajectories come to."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.experiments.common import Integration
from suboctave.experiments.poincare import Attractor, state_sizes
from suboctave.model.elements.base import Array
from suboctave.model.system import System
from suboctave.timedomain.flow import Flow
from suboctave.timedomain.period_recognition import same_cycle
from suboctave.timedomain.shooting import PeriodicSolution, shoot
from suboctave.timedomain.trapping import Trap, traps_about

#: relative distance below which two periodic motions are the same
_SAME = 1e-5
#: by how much points that have repeated may still be away from the motion that shooting finds
_ROUGHLY = 1e-2
#: what a motion that is given may differ in frequency and parameters
_NEAR = 1e-9


@dataclass(frozen=True, eq=False)
class BasinAttractor:
    """A stable periodic motion that basins belong to.

    Attributes
    ----------
    name
        As given, or from its period: "T", "2T", "2T (2)".
    period
        In periods of the load.
    points
        (period, 2n): its states at phase 0 of the load.
    amplitude
        Largest |x| of the observed degree of freedom.
    multipliers
        Over its period, by shooting.
    given
        Whether it was given, or found.
    radius
        Of its trapping neighbourhoods, relative to the motion's size in their norm; 0 if there are none.
    """

    name: str
    period: int
    points: Array
    amplitude: float
    multipliers: NDArray[np.complex128]
    given: bool
    traps: list[Trap] = field(default_factory=list, repr=False)

    @property
    def state(self) -> Array:
        """A state (2n,) at phase 0 of the load."""
        return self.points[0]

    @property
    def radius(self) -> float:
        """The smallest radius of its trapping neighbourhoods."""
        return min((trap.radius for trap in self.traps), default=0.0)

    def __repr__(self) -> str:
        return f"BasinAttractor({self.name!r}, max|x|={self.amplitude:.8g}, {'given' if self.given else 'found'})"


@runtime_checkable
class Orbit(Protocol):
    """A motion of harmonic balance: its state at t = 0, its parameters, its period `basis.nu` T."""

    omega: float
    values: Mapping[str, float]
    basis: Any

    def start(self) -> Array:
        """State (2n,)."""


@runtime_checkable
class Curve(Protocol):
    """Motions along one parameter."""

    name: str
    orbits: Sequence[Orbit]

    def parameter(self, name: str) -> Array:
        """Values of a parameter along the curve."""


@runtime_checkable
class Curves(Protocol):
    """Several curves: a diagram."""

    branches: Iterable[Curve]


class Catalogue:
    """The attractors known so far, at one frequency and one set of parameters."""

    def __init__(self, system: System, omega: float, values: Mapping[str, float], how: Integration) -> None:
        self.system, self.omega, self.values, self.how = system, omega, values, how
        #: all that a motion must agree with
        self.wanted = {**system.parameters, **values, "omega": omega}
        self.known: list[BasinAttractor] = []
        self._sizes: list[Array] = []

    def find(self, points: Array) -> int | None:
        """The number of the one with these stroboscopic points (n, 2n), to a hundred thousandth of its size."""
        for i, one in enumerate(self.known):
            if same_cycle(one.points, points, self._sizes[i], _SAME, self.system.turns):
                return i
        return None

    def near(self, number: int, points: Array) -> bool:
        """Whether these stroboscopic points are those of that one, roughly."""
        return same_cycle(self.known[number].points, points, self._sizes[number], _ROUGHLY, self.system.turns)

    def add(self, state: Array, period: int, name: str | None, given: bool) -> int | None:
        """Enter the motion near a state, found by shooting: its number, None if there is no stable one."""
        try:
            solution = shoot(self.system, state, self.omega, period, self.values, observe=self.how.observe)
        except ConvergenceError:
            return None
        if not solution.stable:
            return None
        flow = Flow(self.system, "accurate", tolerance=1e-12)
        motions = flow.over(solution.state, self.omega, solution.periods, self.values, workers=1).whole()
        points = np.vstack([solution.state[None], motions.states[0][:-1]])
        sizes = self._extents(points)
        for shorter in range(1, period):
            other = np.roll(points, shorter, axis=0)[:1]
            if period % shorter == 0 and same_cycle(other, points[:1], sizes, _SAME, self.system.turns):
                return self.add(solution.state, shorter, name, given)
        known = self.find(points)
        if known is None:
            self.enter(self._name(name, period), points, solution.amplitude, solution.multipliers, given)
            return len(self.known) - 1
        if given and not self.known[known].given and name:
            self.known[known] = replace(self.known[known], name=self._name(name, period), given=True)
        return known

    def enter(
        self, name: str, points: Array, amplitude: float, multipliers: NDArray[np.complex128], given: bool
    ) -> None:
        """Enter a motion that is known to be one, and look for its neighbourhoods."""
        sizes, tolerance = self._extents(points), max(self.how.tolerance or 0.0, 1e-8)
        traps = traps_about(self.system, points, self.omega, self.values, sizes, tolerance, self.how.workers)
        self.known.append(BasinAttractor(name, len(points), points, amplitude, multipliers, given, traps))
        self._sizes.append(sizes)

    def trapped(self, states: Array) -> NDArray[np.int_]:
        """For every state (B, 2n) the number of the attractor that it is trapped by, -1 if by none."""
        out = np.full(len(states), -1)
        for i, one in enumerate(self.known):
            for trap in one.traps:
                out[(out < 0) & trap.holds(states, self.system.turns)] = i
        return out

    def _extents(self, points: Array) -> Array:
        flow = Flow(self.system, "accurate", tolerance=1e-10)
        motions = flow.over(points[0], self.omega, len(points), self.values, measure=True, workers=1).whole()
        return state_sizes(self.system, motions.peaks[0], self.omega, self.values)

    def _name(self, name: str | None, period: int) -> str:
        """A name that no other one has."""
        base, taken = name or ("T" if period == 1 else f"{period}T"), {one.name for one in self.known}
        names = (base if k == 1 else f"{base} ({k})" for k in itertools.count(1))
        return next(name for name in names if name not in taken)


@dataclass(frozen=True, eq=False)
class Given:
    """What a user gives under one name: its words, and states and periods of its motions at these parameters."""

    name: str | None
    words: str
    starts: list[tuple[Array, int]]

    def same(self, other: Given) -> bool:
        """Whether both have the same name and motions, as far as harmonic balance gives the same again."""
        if self.name != other.name or [nu for _, nu in self.starts] != [nu for _, nu in other.starts]:
            return False
        pairs = zip(self.starts, other.starts, strict=True)
        return all(np.allclose(a, b, rtol=_SAME, atol=_SAME * np.abs(a).max()) for (a, _), (b, _) in pairs)


def read_attractors(catalogue: Catalogue, given: Any) -> list[Given]:
    """What a user gives: motions, attractors, branches, diagrams; one, several, or by name."""
    if given is None:
        return []
    named: list[tuple[str | None, Any]]
    if isinstance(given, Mapping):
        named = [(str(name), one) for name, one in given.items()]
    elif isinstance(given, Orbit | Attractor | PeriodicSolution | Curve | Curves):
        named = [(None, given)]
    elif isinstance(given, Iterable):
        named = [(None, one) for one in given]
    else:
        raise InputError(f"attractors={shortened(given)}: give motions, branches or diagrams, in a sequence or by name")
    read = []
    for name, one in named:
        if isinstance(one, Curves):
            starts = [motion for branch in one.branches for motion in _crossings(catalogue, branch)]
        elif isinstance(one, Curve):
            starts = _crossings(catalogue, one)
        else:
            starts = [_motion(catalogue, one)]
        read.append(Given(name, name or repr(one).splitlines()[0], starts))
    return read


def enter_attractors(catalogue: Catalogue, given: Iterable[Given]) -> None:
    """Enter what a user gives; InputError for what has no stable motion."""
    for one in given:
        entered = {number for s, nu in one.starts if (number := catalogue.add(s, nu, one.name, True)) is not None}
        if not entered:
            raise InputError(
                f"attractors: {one.words} has no stable motion at omega={catalogue.omega:g} and these parameters"
            )


def _motion(catalogue: Catalogue, one: Any) -> tuple[Array, int]:
    """State and period of a motion, if it is one at this frequency and with these parameters."""
    if isinstance(one, Orbit):
        state, nu, parameters = one.start(), one.basis.nu, one.values
    elif isinstance(one, PeriodicSolution):
        state, nu, parameters = one.state, one.periods, one.parameters
    elif isinstance(one, Attractor):
        if not one.period:
            raise InputError(f"attractors: {one!r} is not periodic; what is not is told as such by itself")
        state, nu, parameters = one.state, one.period, one.parameters
    else:
        raise InputError(f"attractors: {type(one).__name__} is no motion, branch or diagram")
    has = {**parameters, "omega": one.omega}
    for name in _differences(catalogue, has):
        raise InputError(f"attractors: {one!r} has {name}={has[name]:.9g}, not {catalogue.wanted[name]:.9g}")
    return catalogue.system.reduced(state), int(nu)


def _differences(catalogue: Catalogue, has: Mapping[str, float]) -> list[str]:
    """The names under which a motion has other values."""
    pairs = ((name, value, has.get(name, value)) for name, value in catalogue.wanted.items())
    return [name for name, value, own in pairs if abs(own - value) > _NEAR * max(abs(value), 1e-300)]


def _crossings(catalogue: Catalogue, branch: Curve) -> list[tuple[Array, int]]:
    """States and periods of a branch where it passes these parameters: between its points, or at them."""
    orbits = branch.orbits
    if not orbits or set(_differences(catalogue, {**orbits[0].values, "omega": orbits[0].omega})) - {branch.name}:
        return []
    at = np.asarray(branch.parameter(branch.name), dtype=float) - catalogue.wanted[branch.name]
    crossings = []
    for i in range(len(at) - 1):
        if at[i] == 0.0 or at[i] * at[i + 1] < 0.0:
            share = at[i] / (at[i] - at[i + 1]) if at[i] != at[i + 1] else 0.0
            first, second = (catalogue.system.reduced(orbits[k].start()) for k in (i, i + 1))
            crossings.append((first + share * (second - first), orbits[i].basis.nu))
    if len(at) and at[-1] == 0.0:
        crossings.append((catalogue.system.reduced(orbits[-1].start()), orbits[-1].basis.nu))
    return crossings
