"""A regime map held against time integration at random points of its plane.

At every point trajectories begin at random states and beside the stable motions that the map knows. Their stroboscopic
points (`poincare_sections`), which know nothing of harmonic balance, are compared with the motions that the map has
there: the same period, and the same stroboscopic point within a hundredth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.analysis.subharmonics import periodic_orbit
from suboctave.continuation.problem import Array
from suboctave.curves.discretisation import make_curve
from suboctave.curves.junction import period_name
from suboctave.curves.starts import linear_response
from suboctave.errors import ConvergenceError
from suboctave.experiments.attractors import Attractor
from suboctave.experiments.poincare import poincare_sections
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.maps.inputs import check_count
from suboctave.maps.regimes.slices import Arc
from suboctave.maps.regimes.strips import LabelledPlane
from suboctave.model.system import System
from suboctave.progress import reporting
from suboctave.store.columns import parameter_column
from suboctave.store.table import Table

__all__ = ["Landing", "RegimeCheck", "check_regimes"]

#: stroboscopic points of one motion by both ways differ by less, in shares of its largest displacements and velocities
_SAME = 1e-2
#: by how much a start beside a known motion is disturbed, relative to it
_DISTURBED = 1e-4
#: random states are drawn from up to so many times the size of the largest motion, which counts as at most so many
#: times that of the largest on the map
_WIDE, _CAP = 2.0, 20.0
#: periods that are kept: three repetitions of 16T
_KEPT = 48
#: tolerance of the integration, and that of the recognition of periods
_TOLERANCE, _REPEATS = 1e-9, 1e-5
#: times as many periods for trajectories that have not settled
_LONGER = 10

#: verdicts on a trajectory
AGREES, BEYOND, UNKNOWN, LEFT, UNSETTLED, NOT_SOLVED = (
    "agrees",
    "not followed",
    "unknown motion",
    "left its motion",
    "not settled",
    "not solved",
)


@dataclass(frozen=True)
class Landing:
    """A trajectory: where, from what, what it settled on, what the map says there, and the verdict.

    period
        In periods of the load, 0 if nothing repeats.
    start
        "state", or the period of the known motion that it began beside.
    verdict
        "agrees" (also where neither has anything periodic); "not followed" (motions beyond the depth of the map, which
        says so); "unknown motion" (the map has none like it there); "left its motion" (a motion said to be stable was
        left); "not settled" (nothing periodic, not yet or never); "not solved" (the motion of the map was not found
        again at that point).
    state
        (2n,) what it had reached, at phase 0 of the load.
    """

    omega: float
    value: float
    start: str
    period: int
    amplitude: float
    expected: str
    verdict: str
    state: Array


class RegimeCheck:
    """What time integration says of a regime map.

    Attributes
    ----------
    landings
        All trajectories.
    points
        How many points of the plane.
    """

    def __init__(self, landings: Sequence[Landing], points: int, system: System, name: str) -> None:
        self.landings = tuple(landings)
        self.points = points
        self.system = system
        self.name = name

    @property
    def rate(self) -> float:
        """Share of the settled trajectories that end on a motion of the map, or on one that it calls not followed."""
        settled = [one for one in self.landings if one.verdict != UNSETTLED]
        return sum(one.verdict in (AGREES, BEYOND) for one in settled) / max(len(settled), 1)

    @property
    def agreeing(self) -> float:
        """Share of the points at which every trajectory does, and every known motion was confirmed."""
        wrong = {(one.omega, one.value) for one in self.disagreements}
        return 1.0 - len(wrong) / max(self.points, 1)

    @property
    def disagreements(self) -> list[Landing]:
        """The trajectories that do not agree."""
        return [one for one in self.landings if one.verdict not in (AGREES, BEYOND)]

    def unknown(self) -> list[PeriodicOrbit]:
        """The motions that the map does not have, solved by harmonic balance, each once at every point.

        `regime_map(..., motions=check.unknown())` maps the branches that they lie on.
        """
        orbits: list[PeriodicOrbit] = []
        for one in self.landings:
            here = (o for o in orbits if (o.omega, o.values[self.name]) == (one.omega, one.value))
            if one.verdict != UNKNOWN or any(_passes(orbit, one.state) for orbit in here):
                continue
            system = self.system.with_parameters({self.name: one.value})
            with suppress(ConvergenceError):
                orbits.append(periodic_orbit(system, one.omega, one.state, one.period))
        return orbits

    @property
    def counts(self) -> dict[str, int]:
        """How many trajectories got each verdict."""
        return dict(Counter(one.verdict for one in self.landings))

    def to_table(self) -> Table:
        """One row for each trajectory."""
        own = ("start", "period", "amplitude", "expected", "verdict")
        names = ("omega", parameter_column(self.name, own), *own)
        rows = [(x.omega, x.value, x.start, x.period, x.amplitude, x.expected, x.verdict) for x in self.landings]
        columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else [np.zeros(0)] * len(names)
        return Table(dict(zip(names, columns, strict=True)), "a regime map against time integration")

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(self.counts.items()))
        text = (
            f"{self.points} points, {len(self.landings)} trajectories: {100.0 * self.rate:.2f} % of those that settled "
            f"agree, {100.0 * self.agreeing:.2f} % of the points ({counts})"
        )
        lines: Counter[str] = Counter()
        for one in self.disagreements:
            what = period_name(one.period) if one.period else "nothing periodic"
            begun = "a random state" if one.start == "state" else f"the {one.start} motion"
            lines[
                f"omega = {one.omega:.6g}, {self.name} = {one.value:.6g}, from {begun}: {what}, amplitude "
                f"{one.amplitude:.4g}; the map has {one.expected}: {one.verdict}"
            ] += 1
        for line, times in lines.items():
            text += f"\n  {line}" + (f" ({times} trajectories)" if times > 1 else "")
        return text


@dataclass(frozen=True, eq=False)
class _Start:
    """A trajectory's beginning: at which point, from which of the known motions (None: a random state)."""

    point: int
    arc: Arc | None
    state: Array


def check_regimes(
    regimes: LabelledPlane, points: int, seed: int, states: int, transient: int, progress: Any
) -> RegimeCheck:
    """See `RegimeMap.check`."""
    for name, number, least in (("points", points, 1), ("states", states, 0), ("transient", transient, 1)):
        check_count(name, number, least)
    with reporting(progress, "integrating at points of the map") as report:
        check = _Check(regimes, points, seed)
        for number in range(points):
            if report is not None:
                report(0.3 * number / points, f"motions at point {number + 1} of {points}")
            check.begin_at(number, states)
        landings = check.landings(transient, None if report is None else lambda s, text: report(0.3 + 0.7 * s, text))
    return RegimeCheck(landings, points, regimes.system, regimes.parameter)


class _Check:
    """Trajectories from points of the plane drawn at random, and the motions that the map knows there."""

    def __init__(self, regimes: LabelledPlane, points: int, seed: int) -> None:
        self.regimes = regimes
        self.draw = np.random.default_rng(seed)
        sides = (regimes.omega, regimes.bounds)
        self.places = np.column_stack([self.draw.uniform(low, high, points) for low, high in sides])
        self.sizes = _sizes(regimes)
        self.starts: list[_Start] = []
        self.known: dict[int, list[tuple[Arc, PeriodicOrbit]]] = {}
        self.unsolved: list[Landing] = []

    def begin_at(self, number: int, states: int) -> None:
        """Starts at a point: beside its known motions, and at random states."""
        regimes, n = self.regimes, self.regimes.system.n
        omega, value = (float(v) for v in self.places[number])
        known = self.known[number] = []
        for arc in (arc for arc in regimes.arcs(omega, value) if arc.followed):
            try:
                orbit = regimes.motion(arc, omega, value)
            except ConvergenceError:
                begun, label = period_name(arc.nu), str(regimes.label(omega, value))
                nowhere = Landing(omega, value, begun, 0, float("nan"), label, NOT_SOLVED, np.zeros(2 * n))
                self.unsolved.append(nowhere)
                continue
            known.append((arc, orbit))
            beside = _DISTURBED * _extent(orbit) * self.draw.uniform(-1.0, 1.0, 2 * n)
            self.starts.append(_Start(number, arc, orbit.start() + beside))
        smallest, largest = self.sizes
        for _ in range(states):
            # of every order of magnitude between the smallest motion and the largest
            scale = smallest * (_WIDE * largest / smallest) ** self.draw.uniform()
            self.starts.append(_Start(number, None, scale * self.draw.uniform(-1.0, 1.0, 2 * n)))

    def landings(self, transient: int, report: Any) -> list[Landing]:
        """What the trajectories settle on, with verdicts, in the order of the points."""
        if not self.starts:
            return sorted(self.unsolved, key=lambda one: (one.omega, one.value))
        everyone = list(range(len(self.starts)))
        attractors = self._settled(everyone, [s.state for s in self.starts], transient, report)
        moving = [i for i in everyone if not attractors[i].period and np.isfinite(attractors[i].points).all()]
        if moving:
            again = self._settled(moving, [attractors[i].points[-1] for i in moving], _LONGER * transient, None)
            for i, attractor in zip(moving, again, strict=True):
                attractors[i] = attractor
        judged = [self._judged(start, attractor) for start, attractor in zip(self.starts, attractors, strict=True)]
        return sorted([*self.unsolved, *judged], key=lambda one: (one.omega, one.value))

    def _settled(self, which: Sequence[int], states: Sequence[Array], periods: int, progress: Any) -> list[Attractor]:
        """What trajectories from states settle on at the points of some of the starts."""
        at = [self.starts[i].point for i in which]
        sections = poincare_sections(
            self.regimes.system,
            np.array(states),
            omega=self.places[at, 0],
            parameters={self.regimes.parameter: self.places[at, 1]},
            transient=periods,
            periods=_KEPT,
            tolerance=_TOLERANCE,
            period_tolerance=_REPEATS,
            observe=self.regimes.options.get("observe"),
            progress=progress,
        )
        pass_on(sections.interruption)
        return [sections.attractor(i) for i in range(len(sections))]

    def _judged(self, start: _Start, attractor: Attractor) -> Landing:
        """A trajectory with its verdict."""
        omega, value = (float(v) for v in self.places[start.point])
        label = self.regimes.label(omega, value)
        same_period = [(arc, orbit) for arc, orbit in self.known[start.point] if arc.nu == attractor.period]
        alike = [arc for arc, orbit in same_period if _passes(orbit, attractor.state)]
        beyond = [nu for nu, _ in label.beyond]
        if alike and (start.arc is None or start.arc in alike):
            verdict = AGREES
        elif start.arc is not None and attractor.period:
            verdict = LEFT
        elif beyond and (not attractor.period or attractor.period % min(beyond) == 0):
            verdict = BEYOND
        elif not attractor.period:
            verdict = UNSETTLED if label.count else AGREES
        else:
            verdict = UNKNOWN
        begun = "state" if start.arc is None else period_name(start.arc.nu)
        return Landing(omega, value, begun, attractor.period, attractor.amplitude, str(label), verdict, attractor.state)


def _sizes(regimes: LabelledPlane) -> tuple[Array, Array]:
    """Sizes (2n,) of the smallest motion of the map, and of what may be reached: that of its largest, or in resonance.

    The linear response in resonance is what no motion of the load's period exceeds by much.
    """
    system, n = regimes.system, regimes.system.n
    sizes = [
        _extent(point.orbit)
        for strip in regimes.strips
        for arc in strip.arcs
        for point in (arc.points[0], arc.points[len(arc.points) // 2], arc.points[-1])
    ]
    known = np.array(sizes) if sizes else np.ones((1, 2 * n))
    top = known.max(axis=0)
    curve = make_curve(system, "omega", regimes.omega[0], regimes.omega[1], 1, 1, None)
    first, last = regimes.omega
    for omega in np.geomspace(first / 3.0, 3.0 * last, 97):
        try:
            rows = curve.balance.shaped(linear_response(curve, float(omega))[:-1])
        except (ConvergenceError, np.linalg.LinAlgError):
            continue
        size = np.hypot(rows[1], rows[2])
        if np.isfinite(size).all():
            top = np.maximum(top, np.concatenate((size, omega * size)))
    return known.min(axis=0), np.minimum(top, _CAP * known.max(axis=0))


def _passes(orbit: PeriodicOrbit, state: Array) -> bool:
    """Whether a motion has a state (2n,) at the beginning of some period of the load."""
    t = np.linspace(0.0, orbit.period, orbit.basis.nu, endpoint=False, dtype=np.float64)
    states = np.concatenate((orbit.displacement(t), orbit.velocity(t)))
    extent = _extent(orbit)
    off = np.linalg.norm((states - state[:, None]) / np.where(extent > 0.0, extent, 1.0)[:, None], axis=0)
    return bool(off.min() <= _SAME)


def _extent(orbit: PeriodicOrbit) -> Array:
    """Largest displacement and velocity of every DOF, shape (2n,)."""
    dofs = range(orbit.balance.system.n)
    return np.array([orbit.amplitude(i) for i in dofs] + [orbit.velocity_amplitude(i) for i in dofs])
