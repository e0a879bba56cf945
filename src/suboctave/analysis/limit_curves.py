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
from scipy.optimize import brentq

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

__all__ = ["Leg", "as_point", "bifurcation_at_value", "legs_of", "turns_at"]

#: a solved limit point lies at most this many distances between its neighbours away from where it was expected
_AWAY = 3.0
#: and at most this share of the way between them outside, which rounding may account for
_ASIDE = 1e-2
#: share of the way between two nodes below which steps are not halved again
_SMALLEST = 0.02


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

    @cached_property
    def places(self) -> Array:
        """Arclengths of the nodes along the curve."""
        return np.array([node.arclength for node in self.nodes])

    def _segment(self, value: float) -> int:
        """Between which nodes a value lies: the index of the first."""
        rising = self.values[-1] > self.values[0]
        ascending, wanted = (self.values, value) if rising else (-self.values, -value)
        return min(max(int(np.searchsorted(ascending, wanted, side="right")) - 1, 0), len(self.values) - 2)

    def _near(self, value: float, order: int) -> tuple[slice, Array]:
        """Nodes around a value, and their weights in the polynomial of an order in arclength that passes through them.

        Over arclength all is smooth, also where the parameter turns.
        """
        i = self._segment(value)
        first = min(max(0, i - (order - 1) // 2), max(0, len(self.values) - order - 1))
        nodes = slice(first, first + order + 1)
        s, v = self.places[nodes], self.values[nodes]
        start, stop = self.places[i], self.places[i + 1]

        def weights(place: float) -> Array:
            return np.array([np.prod((place - np.delete(s, k)) / (s[k] - np.delete(s, k))) for k in range(len(s))])

        def off(place: float) -> float:
            return float(weights(place) @ v) - value

        if off(start) * off(stop) > 0.0:
            return nodes, weights(start if abs(off(start)) < abs(off(stop)) else stop)
        return nodes, weights(brentq(off, start, stop, xtol=1e-13 * (1.0 + abs(stop))))

    def place(self, value: float) -> float:
        """The arclength along the curve at a value."""
        nodes, weights = self._near(value, 1)
        return float(weights @ self.places[nodes])

    def omega_near(self, value: float) -> tuple[float, float]:
        """Where the limit point at a value is to be expected, and how far off it may lie."""
        i = self._segment(value)
        nodes, weights = self._near(value, 1)
        return float(weights @ self.omega[nodes]), abs(float(self.omega[i + 1] - self.omega[i])) + 1e-6 * self.omega[i]

    @cached_property
    def _known(self) -> dict[float, Bifurcation]:
        """Limit points that were located already, by the value."""
        return {}

    def limit_point(self, value: float) -> Bifurcation:
        """The limit point at a value of the parameter, located over omega.

        Raises ConvergenceError where it is not found again.
        """
        if value not in self._known:
            with one_thread():
                self._known[value] = self._located(value)
        return self._known[value]

    def _located(self, value: float) -> Bifurcation:
        expected, reach = self.omega_near(value)
        for order in (3, 1):
            nodes, weights = self._near(value, order)
            try:
                return self._solved(value, nodes, weights, expected, reach)
            except ConvergenceError:
                continue
        return self._approached(value, expected, reach)

    def _solved(self, value: float, nodes: slice, weights: Array, expected: float, reach: float) -> Bifurcation:
        """The limit point at a value by Newton's method from nodes with weights."""
        beside = [node.orbit for node in self.nodes[nodes]]
        orbit = max(beside, key=lambda o: o.basis.harmonics)
        basis = orbit.basis.filled
        x = sum(w * o.basis.resized(o.coefficients, basis) for w, o in zip(weights, beside, strict=True))
        omega = float(weights @ self.omega[nodes])
        return self._at(value, orbit, np.asarray(x), omega, expected, reach)

    def _at(
        self, value: float, orbit: PeriodicOrbit, x: Array, omega: float, expected: float, reach: float
    ) -> Bifurcation:
        span = float(np.ptp(self.omega)) or expected
        found = bifurcation_at_value(LIMIT_POINT, orbit, x, omega, self.name, value, span, self.curve.options)
        if abs(found.omega - expected) > _AWAY * reach or not -_ASIDE <= self._share(found) <= 1.0 + _ASIDE:
            raise ConvergenceError(
                f"the limit point near omega = {expected:.6g}, {self.name} = {value:.6g} was not found again"
            )
        return found

    def _share(self, found: Bifurcation) -> float:
        """How far between the nodes beside its value a motion lies; outside of (0, 1) it is of a neighbouring leg."""
        i = self._segment(found.parameter(self.name))
        orbits = [node.orbit for node in self.nodes[i : i + 2]] + [found.orbit]
        basis = max((orbit.basis.filled for orbit in orbits), key=lambda b: b.harmonics)
        a, b, x = (orbit.basis.resized(orbit.coefficients, basis).ravel() for orbit in orbits)
        return float((x - a) @ (b - a)) / (float((b - a) @ (b - a)) or 1.0)

    def _approached(self, value: float, expected: float, reach: float) -> Bifurcation:
        """The limit point at a value in small steps from the nodes beside it, where contacts that graze are near."""
        i = self._segment(value)
        failure = ConvergenceError("no node")
        for node, start in ((self.nodes[i], self.values[i]), (self.nodes[i + 1], self.values[i + 1])):
            orbit, share = node.orbit, 0.0
            step = 0.5
            while share < 1.0 and step > _SMALLEST:
                there = min(1.0, share + step)
                between = float(start + there * (value - start))
                x = orbit.basis.resized(orbit.coefficients, orbit.basis.filled)
                try:
                    found = self._at(between, orbit, x, orbit.omega, expected, reach)
                    orbit, share, step = found.orbit, there, 2.0 * step
                except ConvergenceError as why:
                    failure, step = why, 0.5 * step
            if share == 1.0:
                return found
        raise failure


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
