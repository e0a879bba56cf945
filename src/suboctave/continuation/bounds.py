"""Where a curve leaves the range of one of its parameters: within a step, or by passing a bound and coming back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from suboctave.continuation.linear import distance
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, between, make_point
from suboctave.continuation.problem import Curve
from suboctave.errors import ConvergenceError

#: how often a step is halved towards the bound that it passes; Newton's method does the rest
_HALVED = 20
#: way beyond a bound, as a share of the range, that a turn on it may lie by rounding
_ON_IT = 1e-9


@dataclass(frozen=True)
class Bounds:
    """The range (low, high) of a parameter; `index`: that of the parameter among the unknowns of a curve."""

    index: Callable[[Curve], int]
    low: float
    high: float

    def value(self, point: CurvePoint) -> float:
        """The parameter at a point."""
        return float(point.u[self.index(point.curve)])

    def passed(self, a: CurvePoint, b: CurvePoint) -> float | None:
        """The bound on or beyond which the second of two neighbours lies and the first does not, or None."""
        before, here = self.value(a), self.value(b)
        if here > self.high or here == self.high > before:
            return self.high
        if here < self.low or here == self.low < before:
            return self.low
        return None

    def left(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """The point on a bound at which a curve leaves the range between two neighbours, None if it stays inside;
        ConvergenceError where it leaves and no solution is found exactly on the bound.
        """
        bound = self.passed(a, b)
        if bound is None:
            return self._turned_beyond(a, b, newton)
        return b if self.value(b) == bound else self._land(a, b, bound, newton)

    def _turned_beyond(self, a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint | None:
        """The point on a bound that the curve passes between two neighbours and comes back through, by its cubic
        interpolation; None if it does not.
        """
        step = b.arclength - a.arclength
        start, last = a.tangent[self.index(a.curve)] * step, b.tangent[self.index(b.curve)] * step
        before, way = self.value(a), self.value(b) - self.value(a)
        if start * last >= 0.0:
            return None
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
        return make_point(solved, b.curve, b.tangent, arclength)
