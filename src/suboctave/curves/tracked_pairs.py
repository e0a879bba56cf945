"""Complex pairs of multipliers that pass the unit circle along a curve of bifurcations, with few multipliers computed.

Multipliers may cost as much as a point does. So they are computed at some points: at every fourth where the least of
|1 - mu_i mu_j|, which vanishes where a pair is on the circle, hardly changes. Once it changes much, or the sign of
`torus` of `bifurcation.measures`, or the number of multipliers outside the circle, those left out are computed, and
each step is looked at. Two pairs between points are looked for as in `tracked_hidden`.
"""

from __future__ import annotations

import itertools

import numpy as np

from suboctave.continuation import NewtonOptions
from suboctave.curves.sample import Sample
from suboctave.curves.tracked_events import Found, located
from suboctave.curves.tracked_hidden import HiddenPairs
from suboctave.curves.tracked_tests import PairCrossing
from suboctave.errors import ConvergenceError

__all__ = ["PairWatch"]

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

    def passed(self, sample: Sample, warnings: list[str]) -> list[Found]:
        """Take in the next point; pairs found before it."""
        if self.test is None:
            return []
        self._waiting.append(sample)
        if len(self._waiting) == 1:
            return self._hidden.passed(sample, warnings)
        return self._look(warnings) if len(self._waiting) > self._stride else []

    def rest(self, warnings: list[str]) -> list[Found]:
        """Pairs found before the last point."""
        found = self._look(warnings) if len(self._waiting) > 1 else []
        found += self._hidden.rest(warnings)
        self._waiting, self._stride = [], 1
        return found

    def _look(self, warnings: list[str]) -> list[Found]:
        """Pairs between the points that wait."""
        assert self.test is not None
        first, last = self._waiting[0], self._waiting[-1]
        steps = len(self._waiting) - 1
        least, most = sorted(_margin(sample) for sample in (first, last))
        same = self.test.smooth(first)[0] == self.test.smooth(last)[0]
        slow = same and most <= _SLOWLY * least and not self.test.changed(first, last)
        looked = [last] if slow else self._waiting[1:]
        found: list[Found] = []
        for a, b in itertools.pairwise([first, *looked]):
            found += self._hidden.passed(b, warnings)
            if self.test.changed(a, b):
                try:
                    item = located(self.test, a, b, self.newton)
                except ConvergenceError as failure:
                    warnings.append(f"{self.test.kind} near {b.where}: {failure}")
                    continue
                found += [] if item is None else [item]
        self._stride = min(_STRIDE, 2 * steps) if slow else 1
        self._waiting = [last]
        return found


def _margin(sample: Sample) -> float:
    """The least |1 - mu_i mu_j|, in units of 1 + |mu_i mu_j|."""
    mu = sample.others
    products = np.outer(mu, mu)[np.triu_indices(len(mu), 1)]
    return float((np.abs(1.0 - products) / (1.0 + np.abs(products))).min())
