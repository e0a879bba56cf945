"""Two events inside one step of a tracked curve: they cancel in the signs at its ends.

Each test has a function that is smooth along the curve (`CurveTest.smooth`). Between two points at which it has the
same sign, it is taken for the parabolas through these and either neighbour (on a curve's first and last step the
parabola and the cubic through those of the one side). If one of them comes clearly nearer to zero inside than at both
ends, or to zero but for the distance between them, a point is solved for where it does most, and the parts are looked
at again. Nothing is evaluated where none does, as along most of a curve. What neither the ends nor their neighbours
hint at is not found; smaller steps do.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from suboctave.continuation import NewtonOptions
from suboctave.continuation.point import point_between
from suboctave.continuation.problem import Array
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.events import SAME, LocatedEvent, brackets, located, slowest_between
from suboctave.curves.tracked.nearest import same_discretisation
from suboctave.curves.tracked.tests import CurveTest, Extremum, PairCrossing
from suboctave.errors import ConvergenceError

#: share of the smaller end's value below which the function must be suspected to fall inside
_FALLS = 0.8
#: share of the slower end's slope below which a parameter must run inside by its cubic interpolation as well
_SLOWER = 0.95
#: points solved for inside one step for one test
_PROBES = 5
#: shares of a step at which the interpolations are looked at
_GRID = np.linspace(0.04, 0.96, 24)


class HiddenPairs:
    """Looks at every step when the points beside it are known."""

    def __init__(self, tests: Sequence[CurveTest], newton: NewtonOptions) -> None:
        self.tests = list(tests)
        self.newton = newton
        #: the last points, with sign and logarithm of every test's function
        self._known: list[tuple[Sample, list[tuple[float, float]]]] = []

    def passed(self, sample: Sample, warnings: list[str]) -> list[LocatedEvent]:
        """Take in the next point; the pairs found in the step before the last."""
        if not self.tests:
            return []
        self._known = [*self._known[-3:], (sample, [test.smooth(sample) for test in self.tests])]
        return self._look(len(self._known) - 3, warnings)

    def rest(self, warnings: list[str]) -> list[LocatedEvent]:
        """The pairs found in the last step: nothing comes after it."""
        events = self._look(len(self._known) - 2, warnings) if self.tests else []
        self._known = []
        return events

    def _look(self, at: int, warnings: list[str]) -> list[LocatedEvent]:
        """Pairs between the known points `at` and `at + 1`."""
        if at < 0 or len(self._known) < 3:
            return []
        events: list[LocatedEvent] = []
        near = self._known
        samples = [sample for sample, _ in near]
        places = [sample.point.arclength for sample in samples]
        if not all(a < b for a, b in pairwise(places)):
            return []
        for i, test in enumerate(self.tests):
            functions = [known[i] for _, known in near]
            share = falling(places, _values(functions), at)
            if share is None or self._settled(test, samples, at):
                continue
            try:
                events += self._pair(test, samples, functions, at)
            except ConvergenceError as failure:
                where = samples[at].curve.where(samples[at].point.u)
                warnings.append(f"whether two {test.kind} lie after {where} could not be told: {failure}")
        return events

    def _settled(self, test: CurveTest, samples: list[Sample], at: int) -> bool:
        """Whether a parameter does not turn twice in a step for all that is known, or was seen to do so already."""
        if not isinstance(test, Extremum):
            return False
        a, b = samples[at : at + 2]
        share, slope = slowest_between(test.name, a, b)
        slower = 0.0 < share < 1.0 and slope < _SLOWER * min(abs(s.slopes[test.name]) for s in (a, b))
        return not slower or test.level(*samples) or len(brackets(test, a, b, self.newton)) > 1

    def _pair(
        self, test: CurveTest, samples: list[Sample], functions: list[tuple[float, float]], at: int
    ) -> list[LocatedEvent]:
        """The two events of one test in a step that may hide them."""
        a, b = same_discretisation(samples[at], samples[at + 1], self.newton), samples[at + 1]
        places = [sample.point.arclength for sample in samples]
        start, way = places[at], places[at + 1] - places[at]
        inside, known, low = [a, b], list(functions), at
        for _ in range(_PROBES):
            suspect = next(
                (
                    (i, share)
                    for i in range(low, low + len(inside) - 1)
                    if (share := falling(places, _values(known), i)) is not None
                ),
                None,
            )
            if suspect is None:
                break
            i, share = suspect
            place = places[i] + share * (places[i + 1] - places[i])
            middle = Sample(point_between(a.point, b.point, (place - start) / way, self.newton))
            before, after = inside[i - low], inside[i - low + 1]
            if test.changed(before, middle) and test.changed(middle, after):
                both = [located(test, before, middle, self.newton), located(test, middle, after, self.newton)]
                genuine = [item for item in both if item is not None]
                return [] if isinstance(test, Extremum) and _coincide(genuine, way) else genuine
            places.insert(i + 1, place)
            known.insert(i + 1, test.smooth(middle))
            inside.insert(i - low + 1, middle)
        return []


def _coincide(events: list[LocatedEvent], way: float) -> bool:
    """Whether two events are one place of a step: slopes jump at a corner, and may seem to turn to and fro in it."""
    places = [item.sample.point.arclength for item in events]
    return len(places) > 1 and max(places) - min(places) <= SAME * way


def _values(functions: Sequence[Sequence[float]]) -> list[float]:
    """A function from signs and logarithms, in units of its largest value."""
    top = max(size for _, size in functions)
    if not math.isfinite(top):
        return [0.0] * len(functions)
    return [sign * math.exp(size - top) for sign, size in functions]


def falling(places: Sequence[float], values: Sequence[float], at: int) -> float | None:
    """Where between `places[at]` and the next a function of one sign may vanish, as a share of the way, or None."""
    first, last = values[at], values[at + 1]
    if not first * last > 0.0:
        return None
    least = min(abs(first), abs(last))
    if at > 0 and at + 2 < len(places):
        if _straight(places, values, at):
            return None
        spans = [(at - 1, at + 2), (at, at + 3)]
    elif at > 0:
        spans = [(at - 1, at + 2), (max(0, at - 2), at + 2)]
    else:
        spans = [(at, at + 3), (at, min(len(places), at + 4))]
    s = places[at] + _GRID * (places[at + 1] - places[at])
    sign = math.copysign(1.0, first)
    one, other = (sign * _interpolated(places[a:b], values[a:b], s) for a, b in spans)
    lower, apart = np.minimum(one, other), np.abs(one - other)
    for lowest, bound in ((lower, _FALLS * least), (lower - apart, 0.0)):
        if lowest.min() < bound:
            return float(_GRID[lowest.argmin()])
    return None


def _straight(places: Sequence[float], values: Sequence[float], at: int) -> bool:
    """Whether the parabolas through two neighbours and either place beside them stay close to the chord."""
    slopes = [(values[i + 1] - values[i]) / (places[i + 1] - places[i]) for i in range(at - 1, at + 2)]
    bends = [(slopes[i + 1] - slopes[i]) / (places[at + i + 1] - places[at + i - 1]) for i in (0, 1)]
    # they leave it by no more than this
    bend = 0.25 * (places[at + 1] - places[at]) ** 2 * max(map(abs, bends))
    return bend <= (1.0 - _FALLS) * min(abs(values[at]), abs(values[at + 1]))


def _interpolated(x: Sequence[float], f: Sequence[float], s: Array) -> Array:
    """The polynomial through points, by Newton's divided differences."""
    c = list(f)
    for k in range(1, len(x)):
        for i in range(len(x) - 1, k - 1, -1):
            c[i] = (c[i] - c[i - 1]) / (x[i] - x[i - k])
    value = np.full_like(s, c[-1])
    for i in range(len(x) - 2, -1, -1):
        value = value * (s - x[i]) + c[i]
    return value


#: most steps between two points whose multipliers are computed
_STRIDE = 4
#: factor between two such points up to which it hardly changes
_SLOWLY = 2.0


class PairWatch:
    """Looks at the points of a curve in order; `test` is None where no pair can pass."""

    def __init__(self, test: PairCrossing | None, newton: NewtonOptions) -> None:
        self.test = test
        self.newton = newton
        self._hidden = HiddenPairs([] if test is None else [test], newton)
        self._waiting: list[Sample] = []
        self._stride = 1

    def passed(self, sample: Sample, warnings: list[str]) -> list[LocatedEvent]:
        """Take in the next point; pairs found before it."""
        if self.test is None:
            return []
        self._waiting.append(sample)
        if len(self._waiting) == 1:
            return self._hidden.passed(sample, warnings)
        return self._look(warnings) if len(self._waiting) > self._stride else []

    def rest(self, warnings: list[str]) -> list[LocatedEvent]:
        """Pairs found before the last point."""
        events = self._look(warnings) if len(self._waiting) > 1 else []
        events += self._hidden.rest(warnings)
        self._waiting, self._stride = [], 1
        return events

    def _look(self, warnings: list[str]) -> list[LocatedEvent]:
        """Pairs between the points that wait."""
        assert self.test is not None
        first, last = self._waiting[0], self._waiting[-1]
        steps = len(self._waiting) - 1
        least, most = sorted(_margin(sample) for sample in (first, last))
        same = self.test.smooth(first)[0] == self.test.smooth(last)[0]
        slow = same and most <= _SLOWLY * least and not self.test.changed(first, last)
        chosen = [last] if slow else self._waiting[1:]
        events: list[LocatedEvent] = []
        for a, b in itertools.pairwise([first, *chosen]):
            events += self._hidden.passed(b, warnings)
            if self.test.changed(a, b):
                try:
                    item = located(self.test, a, b, self.newton)
                except ConvergenceError as failure:
                    warnings.append(f"{self.test.kind} near {b.where}: {failure}")
                    continue
                events += [] if item is None else [item]
        self._stride = min(_STRIDE, 2 * steps) if slow else 1
        self._waiting = [last]
        return events


def _margin(sample: Sample) -> float:
    """The least |1 - mu_i mu_j|, in units of 1 + |mu_i mu_j|."""
    mu = sample.others
    products = np.outer(mu, mu)[np.triu_indices(len(mu), 1)]
    return float((np.abs(1.0 - products) / (1.0 + np.abs(products))).min())


__all__ = ["HiddenPairs", "PairWatch"]
