"""Curves of limit points over a design parameter, cut where the parameter turns, and one of their points at a value.

A curve of limit points in (omega, q) is cut at its extrema of q and at its cusps into legs, along each of which q runs
one way: at any q within it a leg has exactly one limit point. Branches over omega change their nature, as q changes,
only where legs end or period doublings appear; in between every leg keeps its branch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from suboctave.analysis.making import own_linear_part
from suboctave.analysis.refine import solved_bifurcation
from suboctave.analysis.response import ResponseCurve
from suboctave.analysis.tracked_branch import TrackedBranch, TrackedPoint
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.kinds import LIMIT_POINT, BifurcationKind
from suboctave.bifurcation.solve import Guess
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit

__all__ = ["Leg", "as_point", "bifurcation_at_value", "legs_of", "same_motion", "turns_at"]

#: a solved limit point lies at most this many distances between its neighbours away from where it was expected
_AWAY = 3.0
#: harmonics of two motions that are one differ by less, relative to their size
_SAME = 1e-4


def bifurcation_at_value(
    kind: BifurcationKind,
    orbit: PeriodicOrbit,
    x: Array,
    omega: float,
    name: str,
    value: float,
    span: float,
    options: Mapping[str, Any],
) -> Bifurcation:
    """A bifurcation over omega with one parameter set to a value, from a guess `x`, `omega` near an orbit.

    `span` is the width of frequencies that matter, `options` what the verbs were called with. Raises ConvergenceError
    where Newton's method finds none.
    """
    system = orbit.system.with_parameters({**orbit.values, name: value})
    linear = own_linear_part(orbit)
    if linear is not None:
        linear = linear.rebuilt(dict(system.parameters))
    basis = orbit.basis.filled
    balance = HarmonicBalance(system, basis, linear=linear).settle(x, omega)
    solution = kind.solve(Guess(balance, x, omega, dict(balance.values), "omega", span))
    curve = ResponseCurve(solution.state.balance, "omega", omega, span, orbit.adaptive)
    found = solved_bifurcation(kind, solution, curve, int(options["observe"]), [])
    around = {"omega": (omega - span, omega + span)}
    return replace(found, context={**options, "system": system, "parameter": "omega", "bounds": around})


@dataclass(frozen=True, eq=False)
class Leg:
    """A stretch of a curve of limit points along which the design parameter `name` runs one way.

    curve, name
        The curve, and the parameter.
    nodes
        Limit points in order, at least two: the curve's own, and the events at the ends.
    ends
        The events at its two ends; None where the curve itself ends.
    """

    curve: TrackedBranch
    name: str
    nodes: tuple[TrackedPoint, ...]
    ends: tuple[TrackedEvent | None, TrackedEvent | None]

    @cached_property
    def values(self) -> Array:
        """The parameter at the nodes."""
        return np.array([node.orbit.values[self.name] for node in self.nodes])

    @cached_property
    def omega(self) -> Array:
        """The frequencies of the nodes."""
        return np.array([node.orbit.omega for node in self.nodes])

    @property
    def low(self) -> float:
        """The least value."""
        return float(min(self.values[0], self.values[-1]))

    @property
    def high(self) -> float:
        """The largest value."""
        return float(max(self.values[0], self.values[-1]))

    @property
    def nu(self) -> int:
        """Period of the motions in periods of the load."""
        return self.nodes[0].orbit.basis.nu

    def contains(self, value: float) -> bool:
        """Whether it has a limit point at a value of the parameter."""
        return self.low <= value <= self.high

    def end(self, upper: bool) -> TrackedEvent | None:
        """The event at its upper or its lower end."""
        rising = self.values[-1] > self.values[0]
        return self.ends[1] if rising == upper else self.ends[0]

    def _around(self, value: float) -> tuple[int, float]:
        """Between which nodes a value lies, and the share of the way that the motion has gone."""
        values = self.values
        ascending = values if values[-1] > values[0] else -values
        i = int(np.searchsorted(ascending, value if values[-1] > values[0] else -value, side="right")) - 1
        i = min(max(i, 0), len(values) - 2)
        share = (value - values[i]) / ((values[i + 1] - values[i]) or 1.0)
        # beside a turn the motion changes with the square root of the way
        if i == 0 and self.ends[0] is not None:
            share = math.sqrt(max(share, 0.0))
        elif i == len(values) - 2 and self.ends[1] is not None:
            share = 1.0 - math.sqrt(max(1.0 - share, 0.0))
        return i, share

    def omega_near(self, value: float) -> tuple[float, float]:
        """Where the limit point at a value is to be expected, and how far off it may lie."""
        i, share = self._around(value)
        a, b = float(self.omega[i]), float(self.omega[i + 1])
        return a + share * (b - a), abs(b - a) + 1e-6 * abs(a)

    def limit_point(self, value: float) -> Bifurcation:
        """The limit point at a value of the parameter, located over omega.

        Raises ConvergenceError where it is not found again.
        """
        i, share = self._around(value)
        beside = [node.orbit for node in self.nodes[i : i + 2]]
        orbit = max(beside, key=lambda o: o.basis.harmonics)
        a, b = (o.basis.resized(o.coefficients, orbit.basis.filled) for o in beside)
        expected, reach = self.omega_near(value)
        span = float(np.ptp(self.omega)) or expected
        x = a + share * (b - a)
        with one_thread():
            found = bifurcation_at_value(LIMIT_POINT, orbit, x, expected, self.name, value, span, self.curve.options)
        if abs(found.omega - expected) > _AWAY * reach:
            raise ConvergenceError(
                f"the limit point near omega = {expected:.6g}, {self.name} = {value:.6g} was not found again"
            )
        return found


def legs_of(curve: TrackedBranch, name: str) -> list[Leg]:
    """The legs of a curve of limit points in (omega, name), in order."""
    met = (event for event in curve.bifurcations.met if isinstance(event, TrackedEvent))
    turns = sorted((event for event in met if turns_at(event, name)), key=lambda event: event.arclength)
    events: list[TrackedEvent | None] = [None, *turns, None]
    # the seam of a closed curve is no end: what begins there goes on from its last points
    points = curve.tracked[:-1] if curve.closed else curve.tracked
    pieces = []
    for first, last in pairwise(events):
        start = -math.inf if first is None else first.arclength
        stop = math.inf if last is None else last.arclength
        before, after = ([] if event is None else [as_point(event)] for event in (first, last))
        nodes = [*before, *(p for p in points if start < p.arclength < stop), *after]
        pieces.append((nodes, first, last))
    if curve.closed and turns:
        nodes, _, last = pieces.pop(0)
        pieces[-1] = (pieces[-1][0] + nodes, pieces[-1][1], last)
    return [Leg(curve, name, tuple(nodes), (first, last)) for nodes, first, last in pieces if len(nodes) > 1]


def turns_at(event: TrackedEvent, name: str) -> bool:
    """Whether the curve of an event turns there in a parameter."""
    return event.kind == "CP" or (event.kind == "extremum" and event.parameter_name == name)


def as_point(item: Bifurcation) -> TrackedPoint:
    """A located bifurcation as a point of a tracked curve."""
    return TrackedPoint(item.orbit, item.arclength, 0, None, known=item.floquet)


def same_motion(a: PeriodicOrbit, b: PeriodicOrbit) -> bool:
    """Whether two motions are one up to a shift by load periods, by the moduli of their harmonics."""
    first, second = (np.abs(orbit.amplitudes) for orbit in (a, b))
    if a.basis.nu != b.basis.nu:
        return False
    top = min(len(first), len(second))
    return bool(np.linalg.norm(first[:top] - second[:top]) <= _SAME * np.linalg.norm(second))
