"""Curves of bifurcations in monotone pieces: functions of one parameter, with the bifurcation at any of its values.

A curve tracked in two parameters (or one of extrema in three) is cut at its extrema of the parameter `along` and, of
limit points, at its cusps. Every piece then has exactly one bifurcation at each value of `along` that it reaches:
`across(value)` is its place in the other parameter, `solve_at(value)` locates it. Between the points of the curve
everything is interpolated by cubics over arclength, so that square roots beside a turn are no difficulty.

Branches over omega in stretches between two bifurcations, on which motions keep their stability.

Between two consecutive bifurcations a branch runs one way in omega (limit points are bifurcations), so that a stretch
has one motion at each frequency within it. What ends it is a bifurcation, or the end of the branch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from suboctave.analysis.diagram import span_of
from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.curves.events.locate import Guess
from suboctave.curves.events.monitors import LIMIT_POINT
from suboctave.curves.identity import gap_to, lies_on
from suboctave.curves.motion import MotionProblem
from suboctave.curves.refine import solved_bifurcation
from suboctave.curves.starts import own_linear_part
from suboctave.curves.trace import BranchPoint, TrackedPoint
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.results.branch import Branch, TrackedBranch

#: places between two points of a curve at which the interpolation is tabulated
_BETWEEN = 16
#: points closer together, in shares of the whole length, say nothing of the way between them
_TOGETHER = 1e-4
#: a spline may leave the monotone cubics by this share of the way between two points
_SWING = 0.5
#: share of the way between two nodes below which steps towards a value are not halved again
_SMALLEST = 0.02


@dataclass(frozen=True, eq=False)
class MonotonePiece:
    """A stretch of a curve of bifurcations along which the parameter `along` runs one way.

    curve
        What it is a stretch of.
    along, name
        The parameter that it is a function of, and the one that it gives ("omega" or a parameter).
    nodes
        Its points in order, at least two, the events at its ends among them.
    ends
        The events at which it ends; None where the curve itself does.
    """

    curve: TrackedBranch
    along: str
    name: str
    nodes: tuple[TrackedPoint, ...]
    ends: tuple[TrackedEvent | None, TrackedEvent | None]
    _located: dict[float, Bifurcation] = field(default_factory=dict, repr=False)

    @property
    def kind(self) -> str:
        """LP, PD, NS or BP."""
        return self.curve.kind

    @property
    def nu(self) -> int:
        """Period of its motions in periods of the load."""
        return self.nodes[0].orbit.basis.nu

    @cached_property
    def values(self) -> Array:
        """`along` at the nodes, running one way."""
        return _read(self.nodes, self.along)

    @cached_property
    def positions(self) -> Array:
        """`name` at the nodes."""
        return _read(self.nodes, self.name)

    @property
    def low(self) -> float:
        """The least value of `along`."""
        return float(min(self.values[0], self.values[-1]))

    @property
    def high(self) -> float:
        """The largest value of `along`."""
        return float(max(self.values[0], self.values[-1]))

    @property
    def rising(self) -> bool:
        """Whether `along` grows from the first node to the last."""
        return bool(self.values[-1] > self.values[0])

    def end(self, upper: bool) -> TrackedEvent | None:
        """The event at its upper or at its lower end; None where the curve ends."""
        return self.ends[1] if self.rising == upper else self.ends[0]

    def contains(self, value: float) -> bool:
        """Whether it reaches a value of `along`."""
        return self.low <= value <= self.high

    def leads_to(self, other: MonotonePiece) -> bool:
        """Whether it ends in the event at which another piece begins."""
        return self.ends[1] is not None and self.ends[1] is other.ends[0]

    # ------------------------------------------------------------------------------------------------- interpolation
    def across(self, values: Array | float) -> Array:
        """Where it lies at values of `along`; nan outside its range."""
        abscissa, ordinate = self.table
        given = np.asarray(values, dtype=float)
        return np.asarray(np.interp(given, abscissa, ordinate, left=np.nan, right=np.nan))

    def values_at(self, position: float) -> list[float]:
        """At which values of `along` it passes a position."""
        abscissa, ordinate = self.table
        gap = ordinate - position
        passed = np.nonzero(np.signbit(gap[:-1]) != np.signbit(gap[1:]))[0]
        return [float(abscissa[i] + (abscissa[i + 1] - abscissa[i]) * gap[i] / (gap[i] - gap[i + 1])) for i in passed]

    def cut_at(self, value: float) -> TrackedPoint:
        """The bifurcation at a value of `along`, located, as a point of the curve."""
        index, share = self._around(value)
        step = self._places[index + 1] - self._places[index]
        place = self.nodes[index].arclength + share * float(step)
        return replace(as_point(self.solve_at(value)), arclength=place)

    def _around(self, value: float) -> tuple[int, float]:
        """The node before a value (in the order of the nodes) and the share of the way, in arclength, to the next."""
        abscissa, _ = self.table
        places = np.linspace(0.0, len(self.nodes) - 1.0, len(abscissa))
        place = float(np.interp(value, abscissa, places if self.rising else places[::-1]))
        index = min(int(place), len(self.nodes) - 2)
        return index, place - index

    @cached_property
    def table(self) -> tuple[Array, Array]:
        """`along`, ascending, and `name`, tabulated densely."""
        places = self._places
        shares = np.arange(len(places) * _BETWEEN - _BETWEEN + 1) / _BETWEEN
        dense = np.interp(shares, np.arange(len(places)), places)
        abscissa = _interpolated(places, self.values, dense, True)
        ordinate = _interpolated(places, self.positions, dense, False)
        return (abscissa, ordinate) if self.rising else (abscissa[::-1], ordinate[::-1])

    @cached_property
    def _places(self) -> Array:
        """Arclengths of the nodes from the first, ascending also across the seam of a closed curve."""
        steps = np.diff([node.arclength for node in self.nodes])
        steps[steps < 0.0] += self.curve.points[-1].arclength
        floor = 1e-9 * (float(steps.sum()) or 1.0)
        return np.concatenate(([0.0], np.cumsum(np.maximum(steps, floor))))

    # ------------------------------------------------------------------------------------------------------ location
    def solve_at(self, value: float) -> Bifurcation:
        """The limit point at a value of `along`, located over omega; ConvergenceError where there is none on it."""
        if not self.contains(value):
            raise ConvergenceError(f"the curve of limit points was not followed to {self.along} = {value:.6g}")
        if value not in self._located:
            with one_thread():
                self._located[value] = self._solved(value)
        return self._located[value]

    def _solved(self, value: float) -> Bifurcation:
        """From the polynomial over arclength through four nodes, or two; else in steps from a node beside the value."""
        index, share = self._around(value)
        place = float(np.interp(index + share, np.arange(len(self.nodes)), self._places))
        for count in (4, 2):
            first = min(max(0, index - count // 2 + 1), max(0, len(self.nodes) - count))
            nodes, s = self.nodes[first : first + count], self._places[first : first + count]
            weights = [np.prod((place - np.delete(s, k)) / (s[k] - np.delete(s, k))) for k in range(len(s))]
            orbit = max((node.orbit for node in nodes), key=lambda o: o.basis.harmonics)
            basis = orbit.basis
            motions = (node.orbit.basis.resized(node.orbit.x, basis) for node in nodes)
            x = np.asarray(sum(w * motion for w, motion in zip(weights, motions, strict=True)))
            try:
                return self._corrected(value, orbit, x, float(self.across(value)))
            except ConvergenceError:
                continue
        return self._approached(value, index)

    def _approached(self, value: float, index: int) -> Bifurcation:
        """In small steps from the nodes beside a value, where contacts that graze are near."""
        failure = ConvergenceError("no node")
        for i in (index, index + 1):
            orbit, start = self.nodes[i].orbit, float(self.values[i])
            share, step = 0.0, 0.5
            while step > _SMALLEST:
                ahead = min(1.0, share + step)
                x = orbit.basis.resized(orbit.x, orbit.basis)
                try:
                    point = self._corrected(start + ahead * (value - start), orbit, x, orbit.omega)
                except ConvergenceError as why:
                    failure, step = why, 0.5 * step
                    continue
                if ahead == 1.0:
                    return point
                orbit, share, step = point.orbit, ahead, 2.0 * step
        raise failure

    def _corrected(self, value: float, orbit: PeriodicOrbit, x: Array, omega: float) -> Bifurcation:
        """Newton's method from a guess `x`, `omega` near an orbit; ConvergenceError where it leaves the piece."""
        span = float(np.ptp(self.positions)) or omega
        options = self.curve.options
        system = orbit.system.with_parameters({**orbit.values, self.along: value})
        balance = HarmonicBalance(system, orbit.basis, linear=own_linear_part(orbit, system)).settle(x, omega)
        solution = LIMIT_POINT.solve(Guess(balance.at(x, omega), "omega", span))
        curve = MotionProblem.response(solution.state.balance, "omega", omega, span, orbit.adaptive)
        point = solved_bifurcation(LIMIT_POINT, solution, curve, int(options["observe"]), [])
        if gap_to(point.orbit, self.nodes, self.along) is None:
            expected = float(self.across(value))
            raise ConvergenceError(
                f"the limit point near omega = {expected:.6g}, {self.along} = {value:.6g} was not found again"
            )
        around = {"omega": (omega - span, omega + span)}
        return replace(point, context={**options, "system": system, "parameter": "omega", "bounds": around})


Piece = tuple[list[TrackedPoint], TrackedEvent | None, TrackedEvent | None]


def across(end: MonotonePiece | float, values: Array | float) -> Array:
    """Where the end of a range lies at values of `along`: on a piece, or at one place everywhere."""
    return end.across(values) if isinstance(end, MonotonePiece) else np.full(np.shape(values), end)


def pieces_of(curve: TrackedBranch, along: str, name: str = "omega") -> list[MonotonePiece]:
    """The monotone pieces of a curve, in order.

    Along a curve of extrema a point of codimension two is no turn: there `along` goes on.
    """
    met = [event for event in curve.bifurcations.met if isinstance(event, TrackedEvent)]
    extrema = [e for e in met if e.kind == "extremum" and e.parameter_name == along]
    turns = sorted([*extrema, *(e for e in met if e.kind == "CP" and not curve.turning)], key=lambda e: e.arclength)
    events: list[TrackedEvent | None] = [None, *turns, None]
    points = curve.tracked[:-1] if curve.closed and turns else curve.tracked
    pieces: list[Piece] = []
    for first, last in pairwise(events):
        start = -math.inf if first is None else first.arclength
        stop = math.inf if last is None else last.arclength
        before, after = ([] if event is None else [as_point(event)] for event in (first, last))
        between = [p for p in points if start < p.arclength < stop]
        while between and _beyond(between[0], first, along):
            del between[0]
        while between and _beyond(between[-1], last, along):
            del between[-1]
        pieces.append(([*before, *between, *after], first, last))
    if curve.closed and turns:
        # the seam of a closed curve is no end: what begins there goes on from its last points
        nodes, _, last = pieces.pop(0)
        pieces[-1] = (pieces[-1][0] + nodes, pieces[-1][1], last)
    cut = (piece for uncut in pieces for piece in _one_way(*uncut, along))
    return [MonotonePiece(curve, along, name, tuple(nodes), (a, b)) for nodes, a, b in cut if len(nodes) > 1]


def _beyond(point: TrackedPoint, end: TrackedEvent | None, along: str) -> bool:
    """Whether a point beside an extremum lies beyond it, having fewer harmonics than that was located with."""
    sign = {"maximum": 1.0, "minimum": -1.0}.get("" if end is None else end.extreme, 0.0)
    return end is not None and sign * (point.orbit.values[along] - end.parameter(along)) > 0.0


def as_point(item: Bifurcation) -> TrackedPoint:
    """A located bifurcation as a point of a tracked curve."""
    return TrackedPoint(item.orbit, item.floquet, item.arclength, 0)


def _one_way(
    nodes: list[TrackedPoint], first: TrackedEvent | None, last: TrackedEvent | None, along: str
) -> Iterator[Piece]:
    """A piece cut where its nodes turn though no event was located there (a curve's last step before its end)."""
    signs, end = np.sign(np.diff(_read(nodes, along))), len(nodes) - 1
    turns = np.flatnonzero(signs[:-1] * signs[1:] < 0.0) + 1
    for a, b in pairwise([0, *turns, end]):
        yield nodes[a : b + 1], first if a == 0 else None, last if b == end else None


def _read(nodes: Sequence[TrackedPoint], name: str) -> Array:
    orbits = [node.orbit for node in nodes]
    return np.array([o.omega if name == "omega" else o.values[name] for o in orbits])


def _interpolated(places: Array, values: Array, dense: Array, monotone: bool) -> Array:
    """Values between the points of a curve: a cubic spline, where that does not swing; else by monotone cubics.

    The latter are those of Fritsch and Carlson (SIAM J. Numer. Anal. 17, 1980), an order less accurate.
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator

    careful = np.asarray(PchipInterpolator(places, values)(dense))
    apart = np.concatenate(([True], np.diff(places) > _TOGETHER * (places[-1] - places[0])))
    if np.count_nonzero(apart) >= 4:
        smooth = np.asarray(CubicSpline(places[apart], values[apart])(dense))
        room = _SWING * np.repeat(np.abs(np.diff(values)), _BETWEEN) + 1e-12 * np.abs(values).max()
        steps = np.diff(smooth)
        if np.all(np.abs(smooth - careful)[:-1] <= room) and (not monotone or np.all(steps >= 0) or np.all(steps <= 0)):
            careful = smooth
    careful[::_BETWEEN] = values
    return np.maximum.accumulate(careful) if monotone and values[-1] > values[0] else careful


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a branch between two bifurcations: what ends it, its points, whether these are stable.

    An end is a bifurcation, or the frequency at which the branch itself ends.
    """

    branch: Branch
    ends: tuple[Bifurcation | float, Bifurcation | float]
    points: tuple[BranchPoint, ...]
    stable: bool | None

    @property
    def doubled(self) -> bool:
        """Whether it lies between period doublings and is unstable by one multiplier below -1 alone."""
        if self.stable is not False or not all(isinstance(e, Bifurcation) and e.kind == "PD" for e in self.ends):
            return False
        middle = self.points[len(self.points) // 2].floquet.multipliers
        outside = middle[np.abs(middle) > 1.0]
        return len(outside) == 1 and bool(outside[0].real < -1.0)

    @property
    def omega(self) -> tuple[float, float]:
        """Between which frequencies it lies, ascending."""
        first, last = (end if isinstance(end, float) else float(end.omega) for end in self.ends)
        return min(first, last), max(first, last)

    @property
    def width(self) -> float:
        """How far it reaches in omega."""
        return self.omega[1] - self.omega[0]


def stretches(branch: Branch, others: Iterable[Bifurcation] = ()) -> list[Stretch]:
    """The stretches of a branch, in order; `others` are the bifurcations at which it may leave or meet its parent."""
    places, points = branch.arclength, branch.points
    whole = float(places[-1])
    changes = sorted(branch.bifurcations, key=lambda b: b.arclength)
    marks: list[tuple[float, Bifurcation | float]] = [(b.arclength, b) for b in changes]
    if branch.closed and marks:
        # the seam is no end
        places = np.concatenate((places, places[1:] + whole))
        points = points + points[1:]
        marks.append((marks[0][0] + whole, marks[0][1]))
    elif not branch.closed:
        known = list(others)
        first, last = (_met(known, branch, end) or float(branch.omega[end]) for end in (0, -1))
        marks = [(-1.0, first), *marks, (whole + 1.0, last)]
    cut = []
    for (begin, one), (end, other) in pairwise(marks):
        # on a located bifurcation itself the verdict is open
        inside = tuple(p for p, place in zip(points, places, strict=True) if begin < place < end)
        stable = bool(np.median([p.floquet.stable for p in inside]) > 0.5) if inside else None
        cut.append(Stretch(branch, (one, other), inside, stable))
    return cut


def _met(known: Sequence[Bifurcation], branch: Branch, end: int) -> Bifurcation | None:
    """The bifurcation of another branch at which one leaves it, at its first point (0), or meets it, at its last."""
    junction = branch.arrives if end else branch.departs
    if junction is None:
        return None
    span, beside = span_of(branch), branch.points[end].orbit
    alike = [b for b in known if b.orbit.basis.nu == junction.nu and junction.same_place(b, span, beside)]
    return min(alike, key=lambda b: abs(b.omega - junction.omega), default=None)


def same_branch(one: Branch, other: Branch) -> bool:
    """Whether the middle motion of a branch lies on another branch of the same period."""
    return one.nu == other.nu and bool(len(one)) and lies_on(one.points[len(one) // 2].orbit, other.points)


def stable_ranges(branch: Branch) -> list[tuple[float, float]]:
    """Between which frequencies a branch has stable motions; pairs of omega, ascending, overlapping ones joined."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(stretch.omega for stretch in stretches(branch) if stretch.stable):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined
