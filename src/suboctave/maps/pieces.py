"""Curves of bifurcations in monotone pieces: functions of one parameter, with the bifurcation at any of its values.

A curve tracked in two parameters (or one of extrema in three) is cut at its extrema of the parameter `along` and, of
limit points, at its cusps. Every piece then has exactly one bifurcation at each value of `along` that it reaches:
`across(value)` is its place in the other parameter, `solve_at(value)` locates it. Between the points of the curve
everything is interpolated by cubics over arclength, so that square roots beside a turn are no difficulty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.curves.discretisation import own_linear_part
from suboctave.curves.events.locate import Guess
from suboctave.curves.events.monitors import LIMIT_POINT
from suboctave.curves.identity import gap_to
from suboctave.curves.motion import MotionProblem
from suboctave.curves.points import TrackedPoint
from suboctave.curves.refine import solved_bifurcation
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.results.tracked_branch import TrackedBranch

__all__ = ["MonotonePiece", "as_point", "pieces_of"]

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

    def node_beside(self, value: float) -> TrackedPoint:
        """The node nearest to a value of `along`."""
        return self.nodes[int(np.argmin(np.abs(self.values - value)))]

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
        """The limit point at a value of `along`, located over omega.

        Raises
        ------
        ConvergenceError
            Where Newton's method arrives at none on this piece.
        """
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
            motions = (node.orbit.basis.resized(node.orbit.coefficients, basis) for node in nodes)
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
                x = orbit.basis.resized(orbit.coefficients, orbit.basis)
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
        solution = LIMIT_POINT.solve(Guess(balance, x, omega, dict(balance.values), "omega", span))
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


def pieces_of(curve: TrackedBranch, along: str, name: str = "omega") -> list[MonotonePiece]:
    """The monotone pieces of a curve, in order.

    Along a curve of extrema a point of codimension two is no turn: there `along` goes on.
    """
    met = (event for event in curve.bifurcations.met if isinstance(event, TrackedEvent))
    turns = sorted((e for e in met if _turns(e, along, bool(curve.turning))), key=lambda e: e.arclength)
    events: list[TrackedEvent | None] = [None, *turns, None]
    points = curve.tracked[:-1] if curve.closed and turns else curve.tracked
    pieces: list[Piece] = []
    for first, last in pairwise(events):
        start = -math.inf if first is None else first.arclength
        stop = math.inf if last is None else last.arclength
        before, after = ([] if event is None else [as_point(event)] for event in (first, last))
        pieces.append(([*before, *(p for p in points if start < p.arclength < stop), *after], first, last))
    if curve.closed and turns:
        # the seam of a closed curve is no end: what begins there goes on from its last points
        nodes, _, last = pieces.pop(0)
        pieces[-1] = (pieces[-1][0] + nodes, pieces[-1][1], last)
    cut = (piece for uncut in pieces for piece in _one_way(uncut, along))
    return [MonotonePiece(curve, along, name, tuple(nodes), (a, b)) for nodes, a, b in cut if len(nodes) > 1]


def as_point(item: Bifurcation) -> TrackedPoint:
    """A located bifurcation as a point of a tracked curve."""
    return TrackedPoint(item.orbit, item.floquet, item.arclength, 0)


def _turns(event: TrackedEvent, along: str, of_extrema: bool) -> bool:
    """Whether the curve of an event turns there in a parameter."""
    if event.kind == "extremum":
        return event.parameter_name == along
    return event.kind == "CP" and not of_extrema


def _one_way(piece: Piece, along: str) -> list[Piece]:
    """A piece cut where its nodes turn though no event was located there (a curve's last step before its end)."""
    nodes, first, last = piece
    signs = np.sign(np.diff(_read(nodes, along)))
    breaks = [i + 1 for i in range(len(signs) - 1) if signs[i] * signs[i + 1] < 0.0]
    places = [0, *breaks, len(nodes) - 1]
    return [
        (nodes[a : b + 1], first if a == 0 else None, last if b == len(nodes) - 1 else None)
        for a, b in pairwise(places)
    ]


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
