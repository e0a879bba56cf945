"""The interior of a step, looked at until nothing can hide in it.

Two events inside one step cancel in every test at its ends. A step is therefore cut into intervals between samples
(solved points with the tests of their curve), and an interval is done when

- the smooth functions of the tests have no zero in it that is not seen at its ends (`crossings`: interpolation through
  its ends and the samples beside it);
- no contact begins or ceases to touch in it, or is about to just beyond it, or it is short. On the side of a grazing on
  which the contact exists everything changes like a square root of the way to it. No polynomial through places on that
  side foretells it, unless they lie the closer together the nearer it is: an interval is too long if an excursion
  across a gap shrinks to less than SHRINKS of itself in it.

Otherwise a point is solved for where the doubt is largest, and its two halves are looked at.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence

from suboctave.bifurcation.gaps import GapExtrema
from suboctave.continuation.problem import Array
from suboctave.curves.crossings import first_doubtful
from suboctave.curves.sample import Excursions, Sample
from suboctave.curves.trace import Unsettled
from suboctave.harmonic.trigonometric import passages

__all__ = ["FINEST", "Interior", "Steps", "unsettled"]

#: intervals of scaled arclength that are not cut any further: events closer together are not told apart
FINEST = 1e-5
#: samples inside one step after which it is halved, or called unsettled
MOST_PROBES = 60
#: pairs of samples whose contacts are remembered, at least
_REMEMBERED = 64
#: intervals shorter than this are not cut because a contact grazes in them
_LAYER = 1e-3
#: share to which an excursion across a gap may shrink in an interval
_SHRINKS = 0.3
#: what an interval's contacts do: nothing, shrink towards its first or its last end, begin or cease within it
_NOTHING, _FIRST, _LAST, _GRAZES = 0, 1, 2, 3
#: where an interval is cut whose contacts shrink, as a fraction of it: closer to that end, towards which the intervals
#: shorten like the excursion
_CUT = {_FIRST: 0.35, _LAST: 0.65}


class Steps:
    """What lies behind the step of a curve that is looked at, and what contacts do between samples, remembered while it
    may be asked again.
    """

    #: samples behind a step that it is foretold from, the one that it begins with included
    reach = 4

    def __init__(self) -> None:
        self._behind: list[Sample] = []
        self._contacts: dict[tuple[Sample, Sample], int] = {}

    def grazes(self, p: Sample, q: Sample) -> bool:
        """Whether a contact begins or ceases to touch between two samples."""
        return self.contacts(p, q) == _GRAZES

    def contacts(self, p: Sample, q: Sample) -> int:
        """What contacts do between two samples: an excursion across a gap may shrink so much that it may end just
        beyond the first or the last of them.
        """
        known = self._contacts.get((p, q))
        if known is None:
            known = self._contacts[p, q] = _contacts_between(p, q)
        return known

    def leading_to(self, old: Sample) -> list[Sample]:
        """The samples that a step from one is foretold from; the last one may have been solved again with other
        harmonics.
        """
        return [*(s for s in self._behind if s.place < old.place), old]

    def keep(self, samples: list[Sample]) -> None:
        """The last of these lie behind the next step."""
        self._behind = samples[-self.reach :]
        if len(self._contacts) > _REMEMBERED:
            kept = set(self._behind)
            self._contacts = {pair: known for pair, known in self._contacts.items() if kept.issuperset(pair)}

    def forget(self) -> None:
        """What lies behind says nothing of what comes (a corner of the equations)."""
        self._behind = []


def _contacts_between(p: Sample, q: Sample) -> int:
    near = _NOTHING
    for a, b, young_a, young_b in zip(p.gaps, q.gaps, p.young, q.young, strict=True):
        _, count, crossed, other = passages(a.tau, a.value, a.curve, a.level, b.tau, b.value, b.curve, b.level)
        if count > 0 or crossed != other:
            return _GRAZES
        near = near or (_FIRST if _shrinks(young_a, b) else _LAST if _shrinks(young_b, a) else _NOTHING)
    return near


def _shrinks(young: Excursions, b: GapExtrema) -> bool:
    """Whether one of a motion's excursions across a gap is a small part of the same excursion of another."""
    for tau, height, curve in young:
        others = zip(b.tau.tolist(), b.value.tolist(), b.curve.tolist(), strict=True)
        alike = [(math.cos(t - tau), v) for t, v, c in others if (c > 0.0) == (curve > 0.0)]
        _, same = max(alike, key=lambda pair: pair[0], default=(0.0, b.level))
        if height < _SHRINKS * (b.level - same if curve > 0.0 else same - b.level):
            return True
    return False


class Interior(ABC):
    """One step under examination; `samples` are all that are known, in order, those behind the step included.

    steps
        Those of its curve.
    reasons
        What is in doubt where a function may vanish unseen, one sentence for each of `measures`.
    """

    def __init__(self, steps: Steps, old: Sample, new: Sample, reasons: Sequence[str]) -> None:
        behind = steps.leading_to(old)[-Steps.reach :]
        self.samples = [*behind, new]
        self.old, self.new, self.first = old, new, len(behind) - 1
        self.steps = steps
        self.reasons = reasons
        self.size = new.place - self.old.place
        self.probes = 0
        self.refused = False
        #: intervals that stayed in doubt, lengths of the others
        self.unsettled: list[Unsettled] = []
        self.settled: list[float] = []

    @abstractmethod
    def measures(self, sample: Sample) -> Array:
        """Signs and logarithms of the moduli of functions smooth along the curve, shape (2, m)."""

    def relative(self, stencil: Sequence[Sample], k: int) -> Iterable[Array]:
        """Functions (N, 2, m) with together the same zeros as `measures`' function k that are smoother where the linear
        structure has many vibrations in a period, in several ways.
        """
        return ()

    @abstractmethod
    def solved(self, fraction: float) -> Sample | None:
        """The sample at a fraction of the step, None if there is none."""

    @abstractmethod
    def harmless(self, p: Sample, q: Sample, reason: str) -> bool:
        """Whether an interval too short to be cut is done all the same."""

    @property
    def inside(self) -> list[Sample]:
        """The samples of the step, both ends included."""
        return self.samples[self.first :]

    def examine(self, pending: list[tuple[Sample, Sample]]) -> None:
        """Look at intervals, the last first, until all are settled or given up."""
        # a step may be short already
        least = min(FINEST, self.size / 30.0)
        while pending and not self.refused:
            p, q = pending.pop()
            doubt = self.doubt(p, q)
            if doubt is None:
                self.settled.append(q.place - p.place)
                continue
            share, reason = doubt
            if q.place - p.place <= least:
                self.settled.append(q.place - p.place)
                if not self.harmless(p, q, reason):
                    self.unsettled.append(unsettled(p, q, reason))
                continue
            halves = self.cut(p, q, share) if self.probes < MOST_PROBES else []
            if not halves and not self.refused:
                self.unsettled.append(unsettled(p, q, reason))
            pending += halves

    def cut(self, p: Sample, q: Sample, share: float) -> list[tuple[Sample, Sample]]:
        """The two parts of an interval, the second first; none if there is no point where the curve should be."""
        self.probes += 1
        sample = self.solved((p.place + share * (q.place - p.place) - self.old.place) / self.size)
        if sample is None:
            return []
        self.samples.insert(self.samples.index(q), sample)
        return [(sample, q), (p, sample)]

    def doubt(self, p: Sample, q: Sample) -> tuple[float, str] | None:
        """Where to look into an interval, as a fraction of it, and why; None if it is done."""
        h, contacts = q.place - p.place, self.steps.contacts(p, q)
        if contacts == _GRAZES:
            return (0.5, "a contact begins or ceases to touch") if h > _LAYER else None
        if contacts and h > _LAYER:
            return _CUT[contacts], "a contact that is about to begin or cease changes everything like a square root"
        stencil, at = self._around(p, q)
        if len(stencil) < 3:
            return 0.5, "nothing was looked at"
        places, tests = [one.place for one in stencil], [self.measures(one) for one in stencil]
        doubt = first_doubtful(places, tests, at, lambda k: self.relative(stencil, k))
        return None if doubt is None else (doubt[1], self.reasons[doubt[0]])

    def _around(self, p: Sample, q: Sample) -> tuple[list[Sample], int]:
        """The samples to interpolate through, up to two on either side, and the position of p among them.

        They should be about as far apart as p and q: farther ones foretell nothing, and closer ones only rounding.
        """
        i = self.samples.index(p)
        h = q.place - p.place
        left, before = self._beside(i, -1, h)
        right, behind = self._beside(i + 1, 1, h)
        if not left and not right and (before is not None or behind is not None):
            # one at least
            if behind is None or (before is not None and p.place - before.place <= behind.place - q.place):
                left = [before] if before is not None else []
            else:
                right = [behind]
        left.reverse()
        return [*left, p, q, *right], len(left)

    def _beside(self, start: int, way: int, h: float) -> tuple[list[Sample], Sample | None]:
        """Up to two of the four samples beyond one, neither too close together nor too far for an interval of length
        h, as far as no contact begins or ceases to touch on the way; and the first one beyond.
        """
        chosen: list[Sample] = []
        first: Sample | None = None
        samples, last = self.samples, 0.0
        here, end = samples[start], samples[start].place
        for k in range(start + way, start + 5 * way, way):
            if not 0 <= k < len(samples):
                break
            beyond = samples[k]
            if self.steps.grazes(beyond, here) if way < 0 else self.steps.grazes(here, beyond):
                break
            if first is None:
                first = beyond
            distance = abs(beyond.place - end)
            if distance - last > 4.0 * h:
                break
            if distance - last > 0.1 * h:
                chosen.append(beyond)
                last = distance
                if len(chosen) == 2:
                    break
            here = beyond
        return chosen, first


def unsettled(p: Sample, q: Sample, reason: str) -> Unsettled:
    """What is in doubt between two samples."""
    a, b = p.point, q.point
    return Unsettled(p.curve.name, a.parameter, b.parameter, (a.arclength, b.arclength), reason)
