"""Where a curve leaves the range of one of its parameters, or of what is measured at its points: within a step, or by
passing a bound and coming back.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

from suboctave.continuation.linear import distance
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, between, make_point, point_between
from suboctave.continuation.problem import Curve, Evaluation
from suboctave.errors import ConvergenceError

#: how often a step is halved towards the bound that it passes; Newton's method does the rest
_HALVED = 20
#: way beyond a bound, as a share of the range, that a turn on it may lie by rounding
_ON_IT = 1e-9
#: points solved for between two neighbours until a measure is that of a bound, and the share of the bound it may be off
_SOLVED, _SAME = 60, 1e-13


@dataclass(frozen=True)
class Range(ABC):
    """From `low` to `high`."""

    low: float
    high: float

    @abstractmethod
    def value(self, point: CurvePoint) -> float:
        """What is bounded, at a point."""

    def passed(self, a: CurvePoint, b: CurvePoint) -> float | None:
        """The bound on or beyond which the second of two neighbours lies and the first does not, or None."""
        before, here = self.value(a), self.value(b)
        if here > self.high or here == self.high > before:
            return self.high
        if here < self.low or here == self.low < before:
            return self.low
        return None

    @abstractmethod
    def left(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """The point on a bound at which a curve leaves the range between two neighbours, None if it stays inside;
        ConvergenceError where it leaves and no solution is found exactly on the bound.
        """


@dataclass(frozen=True)
class Measured(Range):
    """The range of what `measure` tells of a point, which is no unknown of the curve."""

    measure: Callable[[CurvePoint], float]
    #: the equations at the last points with what was measured there
    _known: list[tuple[Evaluation, float]] = field(default_factory=list, init=False, repr=False, compare=False)

    def value(self, point: CurvePoint) -> float:
        """What is measured at a point."""
        value = next((value for known, value in self._known if known is point.evaluation), None)
        if value is None:
            value = self.measure(point)
            self._known[:-1] = []
            self._known.append((point.evaluation, value))
        return value

    def left(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """See `Range.left`; a measure that comes back within a step is not noticed."""
        bound = self.passed(a, b)
        if bound is None:
            return None
        ends, misses = [0.0, 1.0], [self.value(a) - bound, self.value(b) - bound]
        point, kept = b, -1
        for _ in range(_SOLVED):
            share = (ends[0] * misses[1] - ends[1] * misses[0]) / (misses[1] - misses[0])
            point = point_between(a, b, share, newton)
            miss = self.value(point) - bound
            if abs(miss) <= _SAME * abs(bound) or not ends[0] < share < ends[1]:
                break
            # the end that stays has its miss halved (the Illinois method)
            moved = 0 if miss * misses[0] > 0.0 else 1
            ends[moved], misses[moved] = share, miss
            if kept == moved:
                misses[1 - moved] *= 0.5
            kept = moved
        return point


@dataclass(frozen=True)
class Bounds(Range):
    """The range (low, high) of a parameter; `index`: that of the parameter among the unknowns of a curve."""

    index: Callable[[Curve], int]

    def value(self, point: CurvePoint) -> float:
        """The parameter at a point."""
        return float(point.u[self.index(point.curve)])

    def left(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """See `Range.left`."""
        bound = self.passed(a, b)
        if bound is None:
            turns = a.tangent[self.index(a.curve)] * b.tangent[self.index(b.curve)] < 0.0
            return self._turned_beyond(a, b, newton) if turns else None
        return b if self.value(b) == bound else self._land(a, b, bound, newton)

    def _turned_beyond(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """The point on a bound that a curve that turns between two neighbours passes and comes back through, by its
        cubic interpolation; None if it does not.
        """
        step = b.arclength - a.arclength
        start, last = a.tangent[self.index(a.curve)] * step, b.tangent[self.index(b.curve)] * step
        before, way = self.value(a), self.value(b) - self.value(a)
        # the slope is start + 2 half s + curve s^2
        half, curve = 3.0 * way - 2.0 * start - last, 3.0 * (start + last - 2.0 * way)
        share = -start / (half - math.copysign(math.sqrt(max(half * half - start * curve, 0.0)), start))
        top = before + share * (start + share * (half + share * curve / 3.0))
        slack = _ON_IT * (self.high - self.low)
        if self.low - slack <= top <= self.high + slack or not 0.0 < share < 1.0:
            return None
        try:
            landed = self._land(a, b, self.high if top > self.high else self.low, newton, share)
        except ConvergenceError:
            return None
        return landed if landed.arclength <= b.arclength else None

    def _land(self, a: CurvePoint, b: CurvePoint, bound: float, newton: NewtonOptions, high: float = 1.0) -> CurvePoint:
        """The point on a bound between two neighbours; high: where on the way it has been passed."""
        index = self.index(b.curve)
        low = 0.0
        side = between(a, b, high)[index] - bound
        for _ in range(_HALVED):
            middle = 0.5 * (low + high)
            beyond = (between(a, b, middle)[index] - bound) * side > 0.0
            low, high = (low, middle) if beyond else (middle, high)
        guess = between(a, b, high)
        guess[index] = bound
        solved = correct(b.curve, guess, index, b.weights, newton)
        arclength = a.arclength + distance(solved.u, b.curve.transfer(a.u, a.curve), b.weights)
        return make_point(solved, b.tangent, arclength)
