"""Zeros of functions along a curve between two of its points: the user's own events, and tests of tracked curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import scipy

from suboctave.arguments import Name, checked
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions, closely, correct
from suboctave.continuation.point import CurvePoint, between, make_point
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError

#: distance from the chord between two neighbours, in units of its length, from which on a point is on another curve
_ELSEWHERE = 2.0
#: ratio of a function's values at two ends beyond which it does not change evenly
_LARGE = 30.0


@checked(methods=False)
@dataclass(frozen=True)
class Event:
    """A user's event: a zero of a function of the solution, located along the curve and reported under its name.

    name
        What it is called in the list of events.
    function
        Takes what the verb stores per point (a `PeriodicOrbit`), returns a number that changes sign at the event.
    """

    name: Name
    function: Callable[[Any], float]


class Bracket:
    """A function along a curve between two neighbours at which it has different signs, by the share of the way from one
    to the other; `values`: those at the two.
    """

    def __init__(
        self,
        a: CurvePoint,
        b: CurvePoint,
        values: tuple[float, float],
        function: Callable[[CurvePoint], float],
        newton: NewtonOptions,
    ) -> None:
        self.function, self.newton = function, newton
        self.points, self.values = {0.0: a, 1.0: b}, {0.0: values[0], 1.0: values[1]}
        #: in the discretisation of b: the chord as a row of unit length, and a and b as places along it
        scaled, origin = b.weights * b.u, b.weights * b.curve.transfer(a.u, a.curve)
        size = length(scaled - origin)
        if size == 0.0:
            raise ConvergenceError(f"two points fall together at {b.curve.where(b.u)}")
        self._row = (scaled - origin) / size
        self._places, self._ends = (float(self._row @ origin), float(self._row @ scaled)), (origin, scaled)

    @property
    def way(self) -> float:
        """Its length in scaled arclength."""
        return self.points[1.0].arclength - self.points[0.0].arclength

    def share(self, u: Array) -> float:
        """The share of the way at which the plane across the chord goes through u."""
        start, end = self._places
        return (float(self._row @ (self.points[1.0].weights * u)) - start) / (end - start)

    def value(self, share: float) -> float:
        """The function at a share of the way; may raise ConvergenceError."""
        if share not in self.values:
            self.points[share] = self._point(share)
            self.values[share] = self.function(self.points[share])
        return self.values[share]

    def _point(self, share: float) -> CurvePoint:
        """The point on the plane across the chord at a share of it, started from the nearest points known."""
        a, b, (start, end) = self.points[0.0], self.points[1.0], self._places
        curve, weights, place = b.curve, b.weights, start + share * (end - start)
        shares = max(s for s in self.points if s < share), min(s for s in self.points if s > share)
        low, high = (self.points[s] for s in shares)
        part = (share - shares[0]) / (shares[1] - shares[0])
        arclength = a.arclength + share * (b.arclength - a.arclength)
        ahead, close = self._row / weights, closely(self.newton)
        interpolated = between(low, high, part), ahead
        # along a corner of the equations, near a grazing, neighbours may lie on both sides of it
        beside = [(curve.transfer(p.u, p.curve), curve.transfer(p.tangent, p.curve)) for p in (low, high)]
        starts = [interpolated, *(beside if part <= 0.5 else beside[::-1]), interpolated]
        failure = ConvergenceError()
        # beside a corner the last digits tell on which side of it a point lies
        for (u, along), options in zip(starts, (close, close, close, None), strict=True):
            missing = place - float(self._row @ (weights * u))
            guess = u + missing / float(self._row @ (weights * along)) * along
            try:
                options = options or replace(self.newton, iterations=30, damped=True)
                solved = correct(curve, guess, self._row, weights, options)
            except ConvergenceError as error:
                failure = error
                continue
            off = length(weights * solved.u - (1.0 - share) * self._ends[0] - share * self._ends[1])
            if off <= _ELSEWHERE * (end - start):
                return make_point(solved, ahead, arclength)
            failure = ConvergenceError(f"Newton's method left the curve for {curve.where(solved.u)}")
        raise failure

    def narrowed(self, width: float) -> tuple[float, float]:
        """The shares, no further apart, of two points with the zero between them, by secants and halvings. None of the
        points lies at the zero itself, where the equations of the curve may be singular. Raises ConvergenceError.
        """
        low, high = self._change()
        while high - low > width:
            first, last = self.values[low], self.values[high]
            share = low + (high - low) * first / (first - last)
            for aside in (share - 0.5 * width, share + 0.5 * width, None):
                place = 0.5 * (low + high) if aside is None else aside
                if low < place < high and high - low > width:
                    low, high = (low, place) if self.value(place) * first <= 0.0 else (place, high)
        return low, high

    def between(self, low: float, high: float) -> Array:
        """The unknowns where the function vanishes by its values at two shares, on the cubic between their points."""
        first, last = self.values[low], self.values[high]
        return between(self.points[low], self.points[high], first / (first - last))

    def _change(self) -> tuple[float, float]:
        """The first two shares in succession at which the function has different signs; raises ConvergenceError."""
        for low, high in pairwise(sorted(self.values)):
            if self.values[low] * self.values[high] <= 0.0 and self.values[low] != self.values[high]:
                return low, high
        raise self._none()

    def _none(self) -> ConvergenceError:
        a, b = self.points[0.0], self.points[1.0]
        return ConvergenceError(f"no zero was located between {a.curve.where(a.u)} and {b.curve.where(b.u)}")

    def zero(self, resolved: float = 1e-12) -> float:
        """The share at which the function vanishes, to so much of it, by Brent's method; its point is in `points` then.

        Where the function is large at one end it is taken about as its logarithm, lest secants stay at the other.

        Raises
        ------
        ConvergenceError
            If a point in between cannot be solved for, or the function does not change sign.
        """
        little = 1e-14 * (abs(self.values[0.0]) + abs(self.values[1.0]))
        for low, high in pairwise(sorted(self.values)):
            if self.values[low] * self.values[high] <= 0.0:
                least, most = sorted((abs(self.values[low]), abs(self.values[high])))
                unit = least if 0.0 < _LARGE * least < most else 0.0

                def scaled(share: float, unit: float = unit) -> float:
                    value = self.value(share)
                    value = 0.0 if abs(value) < little else value
                    return math.asinh(value / unit) if unit else value

                share, result = scipy.optimize.brentq(
                    scaled, low, high, xtol=resolved, rtol=8.9e-16, maxiter=200, full_output=True, disp=False
                )
                if result.converged:
                    return float(share)
        raise self._none()
