"""Curves of bifurcations cut where a parameter turns: borders in a plane, each a function of that parameter.

A curve tracked in two parameters (or one of extrema in three) is cut at its extrema of the parameter `along` and, of
limit points, at its cusps. Every piece then has exactly one bifurcation at each value of `along` that it reaches, and
says where: `across(value)`. Between the points of the curve both parameters are interpolated by cubics over
arclength, so that square roots beside a turn are no difficulty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from suboctave.analysis.limit_curves import as_point
from suboctave.analysis.tracked_branch import TrackedBranch, TrackedPoint
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation.problem import Array

__all__ = ["Border", "borders_of"]

#: places between two points of a curve at which the interpolation is tabulated
_BETWEEN = 16
#: points closer together, in shares of the whole length, say nothing of the way between them
_TOGETHER = 1e-4
#: a spline may leave the monotone cubics by this share of the way between two points
_SWING = 0.5


@dataclass(frozen=True, eq=False)
class Border:
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
        return self._read(self.along)

    @cached_property
    def positions(self) -> Array:
        """`name` at the nodes."""
        return self._read(self.name)

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

    def across(self, values: Array | float) -> Array:
        """Where it lies at values of `along`; nan outside its range."""
        abscissa, ordinate = self.table
        given = np.asarray(values, dtype=float)
        found = np.interp(given, abscissa, ordinate, left=np.nan, right=np.nan)
        return np.asarray(found)

    def values_at(self, position: float) -> list[float]:
        """At which values of `along` it passes a position."""
        abscissa, ordinate = self.table
        gap = ordinate - position
        passed = np.nonzero(np.signbit(gap[:-1]) != np.signbit(gap[1:]))[0]
        return [float(abscissa[i] + (abscissa[i + 1] - abscissa[i]) * gap[i] / (gap[i] - gap[i + 1])) for i in passed]

    def node_beside(self, value: float) -> TrackedPoint:
        """The node nearest to a value of `along`."""
        return self.nodes[int(np.argmin(np.abs(self.values - value)))]

    def around(self, value: float) -> tuple[int, float]:
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
        found = [
            _interpolated(places, v, dense, monotone) for v, monotone in ((self.values, True), (self.positions, False))
        ]
        return (found[0], found[1]) if self.rising else (found[0][::-1], found[1][::-1])

    @property
    def _places(self) -> Array:
        """Arclengths of the nodes, ascending also across the seam of a closed curve."""
        steps = np.diff([node.arclength for node in self.nodes])
        steps[steps < 0.0] += self.curve.points[-1].arclength
        floor = 1e-9 * (float(steps.sum()) or 1.0)
        return np.concatenate(([0.0], np.cumsum(np.maximum(steps, floor))))

    def _read(self, name: str) -> Array:
        orbits = [node.orbit for node in self.nodes]
        return np.array([o.omega if name == "omega" else o.values[name] for o in orbits])


def borders_of(curve: TrackedBranch, along: str, name: str) -> list[Border]:
    """The borders that a curve consists of, in order.

    Along a curve of extrema a point of codimension two is no turn: there `along` goes on.
    """
    met = (event for event in curve.bifurcations.met if isinstance(event, TrackedEvent))
    turns = sorted((e for e in met if _turns(e, along, bool(curve.turning))), key=lambda e: e.arclength)
    events: list[TrackedEvent | None] = [None, *turns, None]
    points = curve.tracked[:-1] if curve.closed and turns else curve.tracked
    pieces: list[tuple[list[TrackedPoint], TrackedEvent | None, TrackedEvent | None]] = []
    for first, last in pairwise(events):
        start = -math.inf if first is None else first.arclength
        stop = math.inf if last is None else last.arclength
        before, after = ([] if event is None else [as_point(event)] for event in (first, last))
        pieces.append(([*before, *(p for p in points if start < p.arclength < stop), *after], first, last))
    if curve.closed and turns:
        # the seam of a closed curve is no end: what begins there goes on from its last points
        nodes, _, last = pieces.pop(0)
        pieces[-1] = (pieces[-1][0] + nodes, pieces[-1][1], last)
    cut = (piece for nodes, first, last in pieces for piece in _one_way(nodes, first, last, along))
    return [Border(curve, along, name, tuple(nodes), (first, last)) for nodes, first, last in cut if len(nodes) > 1]


def _turns(event: TrackedEvent, along: str, of_extrema: bool) -> bool:
    if event.kind == "extremum":
        return event.parameter_name == along
    return event.kind == "CP" and not of_extrema


def _one_way(
    nodes: list[TrackedPoint], first: TrackedEvent | None, last: TrackedEvent | None, along: str
) -> list[tuple[list[TrackedPoint], TrackedEvent | None, TrackedEvent | None]]:
    """A piece cut where its nodes turn though no event was located there (a curve's last step before its end)."""
    values = [n.orbit.omega if along == "omega" else n.orbit.values[along] for n in nodes]
    signs = np.sign(np.diff(values))
    breaks = [i + 1 for i in range(len(signs) - 1) if signs[i] * signs[i + 1] < 0.0]
    if not breaks:
        return [(nodes, first, last)]
    places = [0, *breaks, len(nodes) - 1]
    return [
        (nodes[a : b + 1], first if a == 0 else None, last if b == len(nodes) - 1 else None)
        for a, b in pairwise(places)
    ]


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
