"""What `regime_map` gives: labels of the plane of omega and a design parameter, by the stable motions that exist.

`RegimeMap.check` holds it against time integration at random points of the plane. At every point trajectories begin at
random states and beside the stable motions that the map knows. Their stroboscopic points (`poincare_sections`), which
know nothing of harmonic balance, are compared with the motions that the map has there: the same period, and the same
stroboscopic point within a hundredth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.analysis.subharmonics import periodic_orbit
from suboctave.arguments import Count, Index, Positive, Progress, checked
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.curves.identity import apart
from suboctave.curves.junction import period_name
from suboctave.curves.starts import linear_response, make_curve
from suboctave.errors import ConvergenceError
from suboctave.experiments.poincare import Attractor, poincare_sections
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import limited, pass_on
from suboctave.maps.catalogue import Catalogue, PlaneMap, motion_near
from suboctave.maps.regimes.arcs import Arc, Regime, Strip, regime_of
from suboctave.model.inputs import check_count
from suboctave.model.system import System
from suboctave.progress import reporting
from suboctave.results.branch import TrackedBranch
from suboctave.store.layout import parameter_column
from suboctave.store.table import Table
from suboctave.timedomain.period_recognition import floored

#: steps of the way, shares of it: the first, the smallest
_FIRST, _SMALLEST = 0.5, 1e-3
#: a step may change the harmonics of a motion by this share of them
_MOST = 0.35
#: and keeps this share of what a motion of a shorter period has not: else it fell back onto that
_LASTING = 0.3


@dataclass(frozen=True)
class Region:
    """A connected part of the plane with one regime: its share of the plane, and the ranges that it lies within."""

    regime: Regime
    share: float
    omega: tuple[float, float]
    values: tuple[float, float]


@checked(result=True)
class RegimeMap(PlaneMap):
    """Which stable motions exist over omega and a design parameter.

    Attributes
    ----------
    system, parameter, omega, bounds
        What vibrates, the design parameter, both ranges (ascending).
    depth
        How many period doublings deep branches were followed.
    searched
        Periods, in periods of the load, of which isolas were looked for among resonances.
    curves
        The curves of bifurcations that the labels rest on.
    strips
        The stretches of the parameter within which the order of the regimes is the same.
    notes
        What could not be settled; empty if nothing was left open.
    interruption
        What stopped the work, Ctrl-C or a time limit (`seconds`); None if it came to its end.
    """

    def __init__(
        self, catalogue: Catalogue, strips: Sequence[Strip], depth: int, resolution: float, searched: Sequence[int]
    ) -> None:
        self.system = catalogue.system
        self.parameter = catalogue.name
        self.omega: tuple[float, float] = catalogue.omega
        self.bounds = catalogue.bounds
        self.options = catalogue.options
        self.curves: tuple[TrackedBranch, ...] = tuple(catalogue.curves)
        self.strips = tuple(strips)
        self.depth = depth
        self.resolution = resolution
        self.searched = tuple(searched)
        self.notes = catalogue.unsettled
        self.interruption = catalogue.interruption

    def strip(self, value: float) -> Strip:
        """The strip that a value of the parameter lies in; InputError outside the bounds."""
        self._check_reach(self.parameter, value, self.bounds)
        return next(s for s in self.strips if value <= s.high or s is self.strips[-1])

    def arcs(self, omega: float, value: float) -> list[Arc]:
        """The stable arcs that have a motion at a point of the plane; InputError outside the map."""
        self._check_reach("omega", omega, self.omega)
        ranges = ((arc, *arc.range(value)) for arc in self.strip(value).arcs)
        return [arc for arc, first, last in ranges if first <= omega <= last]

    def motion(self, arc: Arc, omega: float, value: float) -> PeriodicOrbit:
        """The motion of an arc at a point of the plane, from its own motions at another value, step by step.

        On the way it keeps its place between the two ends of its arc, so that the path stays on the arc.
        ConvergenceError if Newton's method loses it on the way.
        """
        seen = self.strip(value).value

        def ends(there: float) -> Array:
            return np.clip(np.array(arc.range(there)), *self.omega)

        low, high = ends(value)
        share = (omega - low) / ((high - low) or 1.0)

        def place(there: float) -> float:
            first, last = ends(there)
            return float(first + share * (last - first))

        begin = place(seen)
        orbit = min((p.orbit for p in arc.points), key=lambda o: abs(o.omega - begin))
        way, step = 0.0, _FIRST
        with one_thread():
            while way < 1.0:
                target = min(1.0, way + step)
                there = seen + target * (value - seen)
                at, there = (omega, value) if target == 1.0 else (place(there), there)
                with suppress(ConvergenceError):
                    motion = motion_near(orbit, self.system.with_parameters({self.parameter: there}), at)
                    lasting = _own(motion) >= _LASTING * _own(orbit)
                    # the next one of the arc: not far off, of the same period, stable as all of them are
                    if lasting and apart(orbit, motion) <= _MOST and floquet_multipliers(motion.state()).stable:
                        orbit, way = motion, target
                        continue
                step *= 0.5
                if step < _SMALLEST:
                    where = f"omega = {omega:.6g}, {self.parameter} = {value:.6g}"
                    raise ConvergenceError(f"the motion of {arc.nu} load periods at {where} was not found again")
        return orbit

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

    @limited
    def check(
        self,
        *,
        points: Count = 200,
        seed: Index = 0,
        starts: Index = 4,
        transient: Index = 400,
        progress: Progress = None,
        seconds: Positive | None = None,
    ) -> RegimeCheck:
        """Integrate in time at points of the plane drawn at random, and compare what is reached with the labels.

        Parameters
        ----------
        points, seed
            How many points, drawn evenly from the plane with this seed.
        starts
            From how many states, drawn at random from all orders of magnitude between the smallest motion of the map
            and twice the largest, or the linear response in resonance; the known stable motions, slightly disturbed,
            are starts as well.
        transient
            Periods of the load before a motion is recognised; those that have not settled get ten times as many.
        seconds
            Time limit; what is not complete then is no check, and a TimeLimitError says so.
        """
        for name, number, least in (("points", points, 1), ("starts", starts, 0), ("transient", transient, 1)):
            check_count(name, number, least)
        with reporting(progress, "integrating at points of the map") as report:
            work = _Check(self, points, seed)
            for number in range(points):
                if report is not None:
                    report(0.3 * number / points, f"motions at point {number + 1} of {points}")
                work.begin_at(number, starts)
            landings = work.landings(transient, None if report is None else lambda s, text: report(0.3 + 0.7 * s, text))
        return RegimeCheck(tuple(landings), points, self.system, self.parameter)

    def raster(self, columns: int = 400, rows: int = 300) -> tuple[np.ndarray, tuple[Regime, ...]]:
        """The labels at the centres of cells: numbers (rows, columns), the parameter growing with the row; the regimes.

        A regime's place in the tuple, which is in order of the area, is its number.
        """
        (low, high), (first, last) = self.bounds, self.omega
        values = low + (np.arange(rows) + 0.5) / rows * (high - low)
        omega = first + (np.arange(columns) + 0.5) / columns * (last - first)
        cells = np.empty((rows, columns), dtype=int)
        regimes: dict[Regime, int] = {}
        for strip in self.strips:
            chosen = np.nonzero((values > strip.low) & (values <= strip.high))[0]
            if not len(chosen):
                continue
            ranges = [arc.range(values[chosen]) for arc in strip.arcs]
            present = [((omega >= a[:, None]) & (omega <= b[:, None])).ravel() for a, b in ranges]
            numbers = np.zeros(len(chosen) * columns, dtype=int)
            for there in present:  # cells with the same arcs so far have the same number
                numbers = np.unique(2 * numbers + there, return_inverse=True)[1]
            labels = []
            for cell in np.unique(numbers, return_index=True)[1]:
                regime = regime_of([arc for arc, there in zip(strip.arcs, present, strict=True) if there[cell]])
                labels.append(regimes.setdefault(regime, len(regimes)))
            cells[chosen] = np.array(labels)[numbers].reshape(len(chosen), columns)
        known = list(regimes)
        order = sorted(range(len(known)), key=lambda i: -np.count_nonzero(cells == i))
        return np.argsort(order)[cells], tuple(known[i] for i in order)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The connected regions of the plane, the largest first; those smaller than a cell of `raster` are left out."""
        from scipy import ndimage

        cells, regimes = self.raster()
        rows, columns = cells.shape
        (low, high), (first, last) = self.bounds, self.omega
        regions = []
        for number, regime in enumerate(regimes):
            parts, _ = ndimage.label(cells == number)
            for index, (up, along) in enumerate(ndimage.find_objects(parts), 1):
                share = float(np.count_nonzero(parts[up, along] == index) / cells.size)
                omega = (first + s / columns * (last - first) for s in (along.start, along.stop))
                values = (low + s / rows * (high - low) for s in (up.start, up.stop))
                regions.append(Region(regime, share, tuple(omega), tuple(values)))
        return tuple(sorted(regions, key=lambda region: -region.share))

    @property
    def regimes(self) -> tuple[Regime, ...]:
        """The regimes that occur, that of the largest area first."""
        return tuple(dict.fromkeys(region.regime for region in self.regions))

    def to_table(self) -> Table:
        """The borders of stable arcs, point by point: arc, period, whether on an isola, kind, parameter, both ends."""
        own = ("strip", "arc", "period", "isola", "from kind", "to kind")
        names = (*own, parameter_column(self.parameter, own), "from omega", "to omega")
        return Table.of_rows(names, list(self._rows()), f"stable motions over omega and {self.parameter}")

    def _rows(self, count: int = 33) -> Iterator[tuple[Any, ...]]:
        for number, strip in enumerate(self.strips):
            values = np.linspace(strip.low, strip.high, count)
            for which, arc in enumerate(strip.arcs):
                kinds = [edge.kind or ("range" if edge.bound else "end of branch") for edge in arc.edges]
                first, last = (np.clip(side, *self.omega) for side in arc.range(values))
                for value, a, b in zip(values, first, last, strict=True):
                    if b > a:
                        yield (number, which, arc.nu, arc.isolated, *kinds, float(value), float(a), float(b))

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """The plane coloured by regime, with the borders; options are those of `pictures.maps.plot_regimes`."""
        from suboctave.pictures.maps import plot_regimes
        from suboctave.pictures.options import frequency_label

        cells, regimes = self.raster(900, 700)
        labels = [(str(r).replace(" x ", " \u00d7 "), r.motions, r.beyond) for r in regimes]
        lines = list(self._lines())
        plane = (self.omega, self.bounds), (frequency_label(self.system.units), self.parameter)
        missing = "" if self.interruption is None else f"incomplete: {self.interruption}"
        return plot_regimes(cells, labels, lines, *plane, missing=missing, path=path, **options)

    def _lines(self) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """The stretches of borders that stable motions end at, in the strips in which they do: kind, omega, values."""
        drawn: set[tuple[int, int]] = set()
        for number, strip in enumerate(self.strips):
            values = strip.low + 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 121))) * (strip.high - strip.low)
            for edge in (edge for arc in strip.arcs for edge in arc.edges):
                if edge.border is not None and (number, id(edge.border)) not in drawn:
                    drawn.add((number, id(edge.border)))
                    yield edge.kind, edge.across(values), values

    def __repr__(self) -> str:
        (first, last), (low, high) = self.omega, self.bounds
        count = sum(strip.examined for strip in self.strips)
        head = (
            f"Regimes for omega from {first:g} to {last:g}, {self.parameter} from {low:g} to {high:g}: "
            f"{len(self.regimes)} of stable motions up to {period_name(2**self.depth)}, from {len(self.curves)} curves "
            f"of bifurcations and branches at {count} value{'s' * (count != 1)} of {self.parameter}."
        )
        if looked := " and ".join(period_name(order) for order in self.searched):
            head += f" {looked} isolas were looked for."
        shares = {regime: sum(r.share for r in self.regions if r.regime == regime) for regime in self.regimes}
        listed = sorted(shares.items(), key=lambda item: -item[1])
        lines = [f"  {100.0 * share:5.1f} %  {regime}" for regime, share in listed]
        return "\n".join([head, *lines, *(f"note: {note}" for note in self.notes)])


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
AGREES, BEYOND, UNKNOWN = "agrees", "not followed", "unknown motion"
LEFT, UNSETTLED, NOT_SOLVED, ROTATES = "left its motion", "not settled", "not solved", "rotates"


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
        left); "rotates" (it turns or drifts: harmonic balance has no such motions); "not settled" (nothing periodic,
        not yet or never); "not solved" (the motion of the map was not found again at that point).
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


@checked(result=True)
@dataclass(eq=False, repr=False)
class RegimeCheck:
    """What time integration says of a regime map.

    Attributes
    ----------
    landings
        All trajectories.
    points
        How many points of the plane.
    """

    landings: tuple[Landing, ...]
    points: int
    system: System
    name: str

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
                orbits.append(periodic_orbit(system, one.omega, start=one.state, subharmonic=one.period))
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
        return Table.of_rows(names, rows, "a regime map against time integration")

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(self.counts.items()))
        text = (
            f"{self.points} points, {len(self.landings)} trajectories: {100.0 * self.rate:.2f} % of those that settled "
            f"agree, {100.0 * self.agreeing:.2f} % of the points ({counts})"
        )
        lines = []
        for one in self.disagreements:
            what = period_name(one.period) if one.period else "nothing periodic"
            begun = "a random state" if one.start == "state" else f"the {one.start} motion"
            lines.append(
                f"\n  omega = {one.omega:.6g}, {self.name} = {one.value:.6g}, from {begun}: {what}, amplitude "
                f"{one.amplitude:.4g}; the map has {one.expected}: {one.verdict}"
            )
        counted = Counter(lines).items()
        return text + "".join(line + (f" ({times} trajectories)" if times > 1 else "") for line, times in counted)


@dataclass(frozen=True, eq=False)
class _Start:
    """A trajectory's beginning: where, from which of the motions known there (None: a random state)."""

    omega: float
    value: float
    known: list[tuple[Arc, PeriodicOrbit]]
    arc: Arc | None
    state: Array


class _Check:
    """Trajectories from points of the plane drawn at random, and the motions that the map knows there."""

    def __init__(self, regimes: RegimeMap, points: int, seed: int) -> None:
        self.regimes = regimes
        self.draw = np.random.default_rng(seed)
        sides = (regimes.omega, regimes.bounds)
        self.places = np.column_stack([self.draw.uniform(low, high, points) for low, high in sides]).tolist()
        self.sizes = _sizes(regimes)
        self.starts: list[_Start] = []
        self.unsolved: list[Landing] = []

    def begin_at(self, number: int, states: int) -> None:
        """Starts at a point: beside its known motions, and at random states."""
        regimes, n = self.regimes, self.regimes.system.n
        omega, value = self.places[number]
        known: list[tuple[Arc, PeriodicOrbit]] = []
        for arc in (arc for arc in regimes.arcs(omega, value) if arc.followed):
            try:
                orbit = regimes.motion(arc, omega, value)
            except ConvergenceError:
                begun, label = period_name(arc.nu), str(regimes.label(omega, value))
                nowhere = Landing(omega, value, begun, 0, float("nan"), label, NOT_SOLVED, np.zeros(2 * n))
                self.unsolved.append(nowhere)
                continue
            known.append((arc, orbit))
            extent = _spread(_extent(orbit), orbit)
            beside = _DISTURBED * (extent if extent.any() else self.sizes[0]) * self.draw.uniform(-1.0, 1.0, 2 * n)
            self.starts.append(_Start(omega, value, known, arc, orbit.start() + beside))
        smallest, largest = self.sizes
        for _ in range(states):
            # of every order of magnitude between the smallest motion and the largest
            scale = smallest * (_WIDE * largest / smallest) ** self.draw.uniform()
            self.starts.append(_Start(omega, value, known, None, scale * self.draw.uniform(-1.0, 1.0, 2 * n)))

    def landings(self, transient: int, report: Any) -> list[Landing]:
        """What the trajectories settle on, with verdicts, in the order of the points."""
        reached = self._settled({start: start.state for start in self.starts}, transient, report)
        open_ones = {s: a for s, a in reached.items() if not a.period and a.drift is None}
        moving = {s: a.points[-1] for s, a in open_ones.items() if np.isfinite(a.points).all()}
        reached |= self._settled(moving, _LONGER * transient, None)
        judged = [self._judged(start, attractor) for start, attractor in reached.items()]
        return sorted([*self.unsolved, *judged], key=lambda one: (one.omega, one.value))

    def _settled(self, states: Mapping[_Start, Array], periods: int, progress: Any) -> dict[_Start, Attractor]:
        """What trajectories settle on that go on from states at the points of some of the starts."""
        if not states:
            return {}
        omega, values = (np.array([getattr(start, name) for start in states]) for name in ("omega", "value"))
        sections = poincare_sections(
            self.regimes.system, start=np.array(list(states.values())), omega=omega, transient=periods, periods=_KEPT,
            parameters={self.regimes.parameter: values}, tolerance=_TOLERANCE, period_tolerance=_REPEATS,
            observe=self.regimes.options.get("observe"), progress=progress,
        )  # fmt: skip
        pass_on(sections.interruption)
        return {start: _rested(sections.attractor(i), start.state) for i, start in enumerate(states)}

    def _judged(self, start: _Start, attractor: Attractor) -> Landing:
        """A trajectory with its verdict."""
        label = self.regimes.label(start.omega, start.value)
        same_period = [(arc, orbit) for arc, orbit in start.known if arc.nu == attractor.period]
        alike = [arc for arc, orbit in same_period if _passes(orbit, attractor.state)]
        beyond = [nu for nu, _ in label.beyond]
        if alike and (start.arc is None or start.arc in alike):
            verdict = AGREES
        elif start.arc is not None and attractor.period:
            verdict = LEFT
        elif attractor.drift is not None or any(attractor.turns):
            verdict = ROTATES
        elif beyond and (not attractor.period or attractor.period % min(beyond) == 0):
            verdict = BEYOND
        elif not attractor.period:
            verdict = UNSETTLED if label.count else AGREES
        else:
            verdict = UNKNOWN
        begun, at = "state" if start.arc is None else period_name(start.arc.nu), (start.omega, start.value)
        return Landing(*at, begun, attractor.period, attractor.amplitude, str(label), verdict, attractor.state)


def _sizes(regimes: RegimeMap) -> tuple[Array, Array]:
    """Sizes (2n,) of the smallest motion of the map, and of what may be reached: that of its largest, or in resonance.

    The linear response in resonance is what no motion of the load's period exceeds by much.
    """
    system, n = regimes.system, regimes.system.n
    arcs = [arc.points for strip in regimes.strips for arc in strip.arcs]
    orbits = [points[i].orbit for points in arcs for i in (0, len(points) // 2, -1)]
    known = np.array([_spread(_extent(orbit), orbit) for orbit in orbits]).reshape(-1, 2 * n)
    known = known[known.any(axis=1)]
    if not len(known):  # all at rest: nothing tells a size
        known = np.ones((1, 2 * n))
    top = known.max(axis=0)
    curve = make_curve(system, "omega", regimes.omega[0], regimes.omega[1], 1, 1, None)
    first, last = regimes.omega
    for omega in np.geomspace(first / 3.0, 3.0 * last, 97):
        try:
            x, _, values = curve.split(linear_response(curve, float(omega)))
        except (ConvergenceError, np.linalg.LinAlgError):
            continue
        size = np.abs(PeriodicOrbit(curve.balance, x, float(omega), values, 0.0).amplitudes[1])
        if np.isfinite(size).all():
            top = np.maximum(top, np.concatenate((size, omega * size)))
    return known.min(axis=0), np.minimum(top, _CAP * known.max(axis=0))


def _passes(orbit: PeriodicOrbit, state: Array) -> bool:
    """Whether a motion has a state (2n,) at the beginning of some period of the load, degrees of freedom counting by
    their masses: of a structure hundreds hardly move.
    """
    t = np.linspace(0.0, orbit.period, orbit.basis.nu, endpoint=False, dtype=np.float64)
    system = orbit.balance.system
    masses = np.abs(system.mass.sparse_value(orbit.values).diagonal())
    off = np.zeros(orbit.basis.nu)
    halves = zip(
        (orbit.displacement(t), orbit.velocity(t)), np.split(state, 2), np.split(_extent(orbit), 2), strict=True
    )
    for k, (reached, given, extent) in enumerate(halves):
        away = (given[:, None] - reached).T
        away = (away if k else system.turns.modulo(away)).T
        off += (masses @ away**2) / (float(masses @ extent**2) or 1.0)
    return bool(off.min() <= _SAME**2)


def _extent(orbit: PeriodicOrbit) -> Array:
    """Largest displacement and velocity of every DOF, shape (2n,)."""
    dofs = range(orbit.balance.system.n)
    return np.array([orbit.amplitude(i) for i in dofs] + [orbit.velocity_amplitude(i) for i in dofs])


def _rested(reached: Attractor, begun: Array) -> Attractor:
    """What a trajectory has reached, rest where it has died out: what shrinks for ever never repeats."""
    if reached.period or not np.abs(reached.points).max() <= _REPEATS * np.abs(begun).max():
        return reached
    return replace(reached, kind="periodic", period=1, points=np.zeros_like(reached.points[:1]))


def _spread(extent: Array, orbit: PeriodicOrbit) -> Array:
    """Extents (2n,) of a motion in which a degree of freedom that hardly moves has a share of what the largest has."""
    mass = np.abs(orbit.balance.system.mass.sparse_value(orbit.values).diagonal())
    return np.concatenate([floored(half, mass) for half in np.split(extent, 2)])


def _own(orbit: PeriodicOrbit) -> float:
    """Size of the harmonics that motions of half the period, or of the load's, do not have; of the latter all."""
    sizes = np.linalg.norm(orbit.amplitudes, axis=1)
    orders, nu = np.arange(len(sizes)), orbit.basis.nu
    if nu == 1:
        return float(np.linalg.norm(sizes))
    return float(np.linalg.norm(sizes[orders % 2 == 1] if nu % 2 == 0 else sizes[orders % nu != 0]))
