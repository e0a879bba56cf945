"""The interior of a step, looked at until nothing can hide in it.

Two events inside one step cancel in every test at its ends. A step is therefore cut into intervals between samples
(solved points with the tests of their curve), and an interval is done when

- the smooth functions of the tests have no zero in it that is not seen at its ends (`crossings`: interpolation through
  its ends and the samples beside it);
- no contact begins or ceases to touch in it, or it is short. Where one does, the heights of the extremum over the gap
  at both ends and their derivatives foretell where: the interval is cut close beside that place.

On the side of a grazing on which the contact exists everything changes like a square root of the way to it: functions
are interpolated over the root of the height of the excursion across the gap, where it shrinks to less than SHRINKS of
itself in an interval.

Otherwise a point is solved for where the doubt is largest, and its two halves are looked at.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from suboctave.bifurcation.gaps import GapExtrema
from suboctave.continuation.linear import length
from suboctave.continuation.point import between
from suboctave.continuation.problem import Array
from suboctave.curves.crossings import first_doubtful
from suboctave.curves.events.grazings import height_gradient
from suboctave.curves.sample import YOUNG, Sample
from suboctave.curves.trace import Unsettled
from suboctave.errors import ConvergenceError
from suboctave.harmonic.trigonometric import passages

__all__ = ["FINEST", "Interior", "Steps", "contacts_between", "unsettled", "within"]

#: intervals of scaled arclength that are not cut any further: events closer together are not told apart
FINEST = 1e-5
#: samples inside one step after which it is halved, or called unsettled
MOST_PROBES = 60
#: a step belongs to one curve if its interior lies within this share of its length from where its ends say
_AWAY = 0.03
#: samples on either side of an interval that tell what its inside may be
_BESIDE = 3
#: intervals shorter than this are not cut because a contact grazes in them
_LAYER = 1e-3
#: share to which an excursion across a gap may shrink in an interval
_SHRINKS = 0.3
#: halvings of an interval that tell where in it an extremum passes a gap
_BISECTIONS = 24
#: how far beside the place foretold for a grazing an interval is cut, in units of _LAYER: cut on both sides it is short
_CLEAR = 0.4
#: shares of an interval to which a cut keeps from its ends
_ENDS = 0.02
#: where an interval is cut whose contacts shrink in a way that is not told by one excursion, as a fraction of it, from
#: the end towards which they do
_CUT = 0.35


class Contacts(NamedTuple):
    """What contacts do between two samples.

    grazes
        Where one begins or ceases to touch, as a fraction of the way; None if none does.
    shrinking
        Excursions across gaps that shrink so much that they may end just beyond one of the samples: the number of the
        gap, instant and second derivative of the extremum, whether it is smaller at the second sample.
    """

    grazes: float | None
    shrinking: tuple[tuple[int, float, float, bool], ...] = ()


class Steps:
    """What lies behind the step of a curve that is looked at, and what contacts do between samples, remembered while it
    may be asked again.
    """

    #: samples behind a step that it is foretold from, the one that it begins with included
    reach = 6

    def __init__(self) -> None:
        self._behind: list[Sample] = []
        self._contacts: dict[tuple[Sample, Sample], Contacts] = {}

    def grazes(self, p: Sample, q: Sample) -> bool:
        """Whether a contact begins or ceases to touch between two samples."""
        return self.contacts(p, q).grazes is not None

    def parted(self, p: Sample, q: Sample) -> bool:
        """Whether the functions looked at do not go on smoothly from one sample to a later one."""
        return self.contacts(p, q).grazes is not None

    def contacts(self, p: Sample, q: Sample) -> Contacts:
        """What contacts do between two samples."""
        if (p, q) not in self._contacts:
            self._contacts[p, q] = contacts_between(p, q)
        return self._contacts[p, q]

    def leading_to(self, old: Sample) -> list[Sample]:
        """The samples that a step from one is foretold from; the last one may have been solved again with other
        harmonics.
        """
        return [*[s for s in self._behind if s.place < old.place], old]

    def keep(self, samples: list[Sample]) -> None:
        """The last of these lie behind the next step."""
        self._behind = samples[-self.reach :]
        kept = set(self._behind)
        self._contacts = {(p, q): known for (p, q), known in self._contacts.items() if p in kept and q in kept}

    def forget(self) -> None:
        """What lies behind says nothing of what comes (a corner of the equations)."""
        self._behind = []


def contacts_between(p: Sample, q: Sample) -> Contacts:
    """What contacts do between two samples."""
    shrinking: list[tuple[int, float, float, bool]] = []
    for n, (a, b) in enumerate(zip(p.gaps, q.gaps, strict=True)):
        pairs, count, crossed, other, least = passages(
            a.tau, a.value, a.curve, a.level, b.tau, b.value, b.curve, b.level
        )
        if count > 0:
            i, j = pairs[0].tolist()
            return Contacts(_passage(*_rising(p, a, i), *_rising(q, b, j), q.place - p.place))
        if crossed != other:
            return Contacts(0.5)
        if least >= YOUNG:
            continue
        young_a, young_b = p.young(n), q.young(n)
        # one without its like has merged with a neighbour on its own side of the gap, which is no grazing
        for i, j in pairs.tolist():
            if i in young_a and young_a[i] < _SHRINKS * _over(b, j):
                shrinking.append((n, float(a.tau[i]), float(a.curve[i]), False))
            if j in young_b and young_b[j] < _SHRINKS * _over(a, i):
                shrinking.append((n, float(b.tau[j]), float(b.curve[j]), True))
    return Contacts(None, tuple(shrinking))


def _rising(sample: Sample, gap: GapExtrema, which: int) -> tuple[float, float]:
    """How far one of a motion's extrema lies above its gap, and its derivative by the arclength."""
    point, names, size = sample.point, sample.curve.names, sample.state.x.size
    by_x, by_names = height_gradient(sample.state, gap.element, gap.index, float(gap.tau[which]), names)
    change = by_x.ravel() @ point.tangent[:size] + by_names @ point.tangent[-len(names) :]
    return float(gap.value[which]) - gap.level, float(change) / length(point.weights * point.tangent)


def _passage(before: float, leaving: float, behind: float, arriving: float, h: float) -> float:
    """Where in an interval of length h the cubic through two values of opposite sign, with derivatives, is zero."""
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        s = 0.5 * (low + high)
        r = 1.0 - s
        first, last = (1.0 + 2.0 * s) * before + s * h * leaving, (3.0 - 2.0 * s) * behind - r * h * arriving
        value = r * r * first + s * s * last
        low, high = (s, high) if (value > 0.0) == (before > 0.0) else (low, s)
    return 0.5 * (low + high)


def _over(gap: GapExtrema, which: int) -> float:
    """Height of one of a motion's extrema across a gap."""
    height = float(gap.value[which]) - gap.level
    return -height if gap.curve[which] > 0.0 else height


def _height(gap: GapExtrema, tau: float, curve: float) -> float:
    """Height across a gap of a motion's extremum of one kind nearest to an instant; 0 if there is none."""
    alike = np.flatnonzero((gap.curve > 0.0) == (curve > 0.0))
    return _over(gap, int(alike[np.argmax(np.cos(gap.tau[alike] - tau))])) if alike.size else 0.0


def _roots(stencil: Sequence[Sample], contacts: Contacts) -> list[float] | None:
    """Square roots of the height of the excursion that shrinks, ascending along a stencil; None if no single one tells
    the way to the grazing.
    """
    if len({last for *_, last in contacts.shrinking}) != 1:
        return None
    every = [[_height(one.gaps[n], tau, curve) for one in stencil] for n, tau, curve, _ in contacts.shrinking]
    heights = min(every, key=min)
    if min(heights) <= 0.0:
        return None
    sign = -1.0 if contacts.shrinking[0][3] else 1.0
    roots = [sign * math.sqrt(height) for height in heights]
    return roots if all(a < b for a, b in pairwise(roots)) else None


class Interior(ABC):
    """One step under examination; `samples` are all that are known, in order, those behind the step included.

    steps
        Those of its curve.
    reasons
        What is in doubt where a function may vanish unseen, one sentence for each of `tests`.
    """

    #: length above which a step that takes too many samples is halved
    crowded: float = math.inf

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
    def tests(self, stencil: Sequence[Sample]) -> list[Array]:
        """Signs and logarithms of the moduli of functions smooth along the curve, shape (2, m), at every sample of a
        stencil.
        """

    def relative(self, stencil: Sequence[Sample], k: int) -> Iterable[Array]:
        """Functions (N, 2, m) with together the same zeros as function k of `tests` that are smoother where the linear
        structure has many vibrations in a period, in several ways.
        """
        return ()

    @abstractmethod
    def solve(self, fraction: float) -> Sample:
        """The sample at a fraction of the step; may raise ConvergenceError."""

    @abstractmethod
    def harmless(self, p: Sample, q: Sample, reason: str) -> bool:
        """Whether an interval too short to be cut is done all the same."""

    def solved(self, fraction: float) -> Sample | None:
        """The sample at a fraction of the step; None, and the step is refused if it can be halved, where there is none
        or it lies elsewhere than the ends say.
        """
        try:
            sample = self.solve(fraction)
        except ConvergenceError:
            self.refused = self.size > FINEST
            return None
        self.refused = self.strays(sample, fraction)
        return None if self.refused else sample

    def strays(self, sample: Sample, fraction: float) -> bool:
        """Whether the motion at a fraction of the step is not where the ends say: these lie on different curves."""
        a, b = self.old.point, self.new.point
        return self.size > FINEST and length(b.weights * (sample.point.u - between(a, b, fraction))) > _AWAY * self.size

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
            if self.probes >= MOST_PROBES and self.size > self.crowded:
                self.refused = True
                return
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
        if contacts.grazes is not None:
            return (_beside_grazing(contacts.grazes, h), "a contact begins or ceases to touch") if h > _LAYER else None
        stencil, at = self._around(p, q)
        roots = _roots(stencil, contacts) if contacts.shrinking else None
        if contacts.shrinking and roots is None and h > _LAYER:
            return (1.0 - _CUT if contacts.shrinking[0][3] else _CUT), _SQUARE_ROOT
        share, reason = 0.5, "nothing was looked at"
        if len(stencil) > 2:
            places, tests = roots or [one.place for one in stencil], self.tests(stencil)
            doubt = first_doubtful(places, tests, at, lambda k: self.relative(stencil, k))
            if doubt is None:
                return None
            share, reason = doubt[1], self.reasons[doubt[0]]
        if roots is not None:
            # heights, squares of these, are as far as the way is long
            a, b = roots[at], roots[at + 1]
            share *= (2.0 * a + share * (b - a)) / (a + b)
        return share, reason

    def _around(self, p: Sample, q: Sample) -> tuple[list[Sample], int]:
        """The samples to interpolate through, up to three on either side, and the position of p among them.

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
        """Up to three of the six samples beyond one, neither too close together nor too far for an interval of length
        h, as far as the functions go on smoothly; and the first one beyond.
        """
        chosen: list[Sample] = []
        first: Sample | None = None
        samples, parted, last = self.samples, self.steps.parted, 0.0
        here, end = samples[start], samples[start].place
        for beyond in samples[start + 1 : start + 7] if way > 0 else samples[max(0, start - 6) : start][::-1]:
            if parted(beyond, here) if way < 0 else parted(here, beyond):
                break
            first = first or beyond
            distance = way * (beyond.place - end)
            if distance - last > 4.0 * h:
                break
            if distance - last > 0.1 * h:
                chosen += (beyond,)
                last = distance
                if len(chosen) == _BESIDE:
                    break
            here = beyond
        return chosen, first


def _beside_grazing(place: float, h: float) -> float:
    """Where to cut an interval of length h in which a contact grazes, at a fraction of it: close beside that."""
    return within(place + math.copysign(_CLEAR * _LAYER / h, 0.5 - place))


def within(share: float) -> float:
    """Where an interval is cut at most: not at its ends."""
    return min(1.0 - _ENDS, max(_ENDS, share))


_SQUARE_ROOT = "a contact that is about to begin or cease changes everything like a square root"


def unsettled(p: Sample, q: Sample, reason: str) -> Unsettled:
    """What is in doubt between two samples."""
    a, b = p.point, q.point
    return Unsettled(p.curve.name, a.parameter, b.parameter, (a.arclength, b.arclength), reason)
