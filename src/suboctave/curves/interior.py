"""The interior of a step, looked at until nothing can hide in it.

Two events inside one step cancel in every test at its ends. A step is therefore cut into intervals between samples
(solved points with the tests of their curve), and an interval is done when

- the smooth functions of the tests have no zero in it that is not seen at its ends (`crossings`: interpolation through
  its ends and the samples beside it);
- no contact begins or ceases to touch in it, or it is short: behind a grazing everything changes like a square root,
  which no interpolation across it foretells.

Otherwise a point is solved for where the doubt is largest, and its two halves are looked at.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from suboctave.continuation.problem import Array
from suboctave.curves.audit import Unsettled
from suboctave.curves.crossings import first_doubtful
from suboctave.curves.nearing import CUT, GRAZES, contacts_between
from suboctave.curves.sample import Sample

__all__ = ["FINEST", "Contacts", "Interior", "unsettled"]

#: intervals of scaled arclength that are not cut any further: events closer together are not told apart
FINEST = 1e-5
#: samples inside one step after which it is halved, or called unsettled
MOST_PROBES = 60
#: pairs of samples whose contacts are remembered, at least
_REMEMBERED = 64
#: intervals shorter than this are not cut because a contact grazes in them
_LAYER = 1e-3
#: samples behind a step that it is foretold from, the one that it begins with included
_BEHIND = 4


class Contacts:
    """What contacts do between samples, remembered while it may be asked again."""

    def __init__(self) -> None:
        self._known: dict[tuple[Sample, Sample], int] = {}

    def between(self, p: Sample, q: Sample) -> int:
        """See `contacts_between`."""
        known = self._known.get((p, q))
        if known is None:
            known = self._known[p, q] = contacts_between(p, q)
        return known

    def keep(self, samples: Sequence[Sample]) -> None:
        """Forget what lies between others, when that has become much."""
        if len(self._known) > _REMEMBERED:
            kept = set(samples)
            self._known = {pair: known for pair, known in self._known.items() if kept.issuperset(pair)}


class Interior(ABC):
    """One step under examination; `samples` are all that are known, in order, those behind the step included.

    behind
        Samples before the step, in order; the last is that which it begins with.
    reasons
        What is in doubt where a function may vanish unseen, one sentence for each of `measures`.
    """

    def __init__(
        self, behind: list[Sample], new: Sample, contacts: Callable[[Sample, Sample], int], reasons: Sequence[str]
    ) -> None:
        behind = behind[-_BEHIND:]
        self.samples = [*behind, new]
        self.old, self.new, self.first = behind[-1], new, len(behind) - 1
        self.contacts = contacts
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
        h, contacts = q.place - p.place, self.contacts(p, q)
        if contacts == GRAZES:
            return (0.5, "a contact begins or ceases to touch") if h > _LAYER else None
        if contacts and h > _LAYER:
            return CUT[contacts], "a contact that is about to begin or cease changes everything like a square root"
        stencil, at = self._around(p, q)
        if len(stencil) < 3:
            return 0.5, "nothing was looked at"
        doubt = first_doubtful([s.place for s in stencil], [self.measures(s) for s in stencil], at)
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
            if (self.contacts(beyond, here) if way < 0 else self.contacts(here, beyond)) == GRAZES:
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
