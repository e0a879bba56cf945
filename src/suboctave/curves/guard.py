"""Whether a step hides something: its interior is looked at until every test function is known well enough.

Two events inside one step cancel in every test at its ends. A step is therefore cut into intervals between samples
(solved motions with all their tests), and an interval is done when

- the smooth test functions of `bifurcation.measures` have no zero in it that is not seen at its ends
  (`analysis.crossings`: interpolation through its ends and the samples beside it);
- the number of unstable multipliers changes across it by what the tests at its ends explain;
- no contact begins or ceases to touch in it, or it is short: behind a grazing everything changes like a square root,
  which no interpolation across it foretells;
- no multiplier of modulus above one half moves further than MOVEMENT (a fast rotation may look like none).

Otherwise a motion is solved for where the doubt is largest, and its two halves are looked at. A branch point in the
step is located first. Where the curve turns back exactly there (the unsymmetric motions of a pitchfork, mirror images
of each other on either side of it), turn is odd and fold even in the way s from it: turn / s and (fold - fold_BP) / s^2
show whatever else there is, and no motion is solved for where the equations are almost singular.

A step whose interior is not where its two ends say has jumped from one curve to another that passes close by, as has
one across which the orientation of the curve changes without a branch point: it is refused and halved by the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from suboctave.continuation.linear import length
from suboctave.continuation.point import CurvePoint, between
from suboctave.continuation.problem import Array
from suboctave.curves.audit import Audit, Unsettled, joined
from suboctave.curves.crossings import first_doubtful
from suboctave.curves.events.finder import Located
from suboctave.curves.events.monitors import BRANCH_POINT, NEIMARK_SACKER, changes
from suboctave.curves.nearing import CUT, GRAZES, contacts_between
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import ComplexArray

#: intervals of scaled arclength that are not cut any further: events closer together are not told apart
FINEST = 1e-5
#: samples inside one step after which it is halved, or called unsettled
MOST_PROBES = 60
#: pairs of samples whose contacts are remembered, at least
_REMEMBERED = 64
#: multipliers of modulus above one half may move by this much per interval (relative to their modulus above one)
MOVEMENT = 0.5
#: intervals shorter than this are not cut because a contact grazes in them
_LAYER = 1e-3
#: intervals shorter than this are not cut for the multipliers' movement, nor for that at +1 beside a branch point
_EXAMINED = 0.01
#: steps shorter than this are not halved to tell a branch point from a jump between curves
_JUMP = 1e-5
#: a step belongs to one curve if its middle lies within this share of its length from where its ends say
_AWAY = 0.03
#: distance from a branch point, as a share of an interval, from which on one cuts it
_CLEAR = 0.1
#: the ends say so themselves if chord and tangents agree to this share of the length
_AGREE = 0.03


@dataclass(frozen=True)
class Crossing:
    """A branch point of a curve and its arclength.

    turned: fold at it, where the curve turns back in its parameter exactly there; else None. The double zero of fold
    lies as far from there as the harmonics left out make it.
    """

    place: float
    located: Located
    turned: float | None

    @property
    def turns(self) -> bool:
        """Whether the curve turns back in its parameter exactly there."""
        return self.turned is not None

    def between(self, a: Sample, b: Sample) -> bool:
        """Whether it lies between two samples."""
        return a.place <= self.place <= b.place

    def within(self, a: Sample, b: Sample) -> Located:
        """It as located between two samples."""
        return replace(self.located, fraction=(self.place - a.place) / (b.place - a.place))


@dataclass
class Passage:
    """An examined step: the samples that separate its events, its end included, all that were looked at, both ends
    included, the branch points between them, and what stayed in doubt.
    """

    samples: list[Sample]
    inside: list[Sample]
    crossings: list[Crossing]
    unsettled: list[Unsettled] = field(default_factory=list)


class StepGuard:
    """Examines the steps along one curve.

    Parameters
    ----------
    solve
        Gives the sample at a fraction of the way between two neighbours, about as exactly as rounding allows where that
        is asked for; may raise ConvergenceError.
    branch_point
        The branch point between two samples of different orientation, None if there is none.
    """

    def __init__(
        self,
        solve: Callable[[Sample, Sample, float, bool], Sample],
        branch_point: Callable[[Sample, Sample], Crossing | None],
    ) -> None:
        self._solve = solve
        self._branch_point = branch_point
        self._behind: list[Sample] = []
        #: the branch point behind at which the curve has turned back, while tests still reach back to it
        self._turned: Crossing | None = None
        self._probes = self._refused = 0
        self._finest, self._longest = np.inf, 0.0
        self._unsettled: list[Unsettled] = []
        self._last: tuple[Sample, Sample, _Step] | None = None
        self._contacts: dict[tuple[Sample, Sample], int] = {}

    @property
    def audit(self) -> Audit:
        """What was examined so far."""
        return Audit(self._finest, self._longest, self._probes, self._refused, tuple(joined(self._unsettled)))

    def refuses(self, old: Sample, new: Sample) -> bool:
        """True if a step has left its curve, or hides more than can be told while it is that long."""
        step = self._examined(old, new)
        if step.refused:
            self._refused += 1
        return step.refused

    def passage(self, old: Sample, new: Sample) -> Passage:
        """What lies on the way between two neighbours, the step being accepted."""
        step = self._examined(old, new)
        self._probes += step.probes
        self._unsettled += step.unsettled
        self._turned = step.turned
        if self._turned is not None:
            # known now, it explains what was in doubt right before it
            nearest = self._turned.place - _EXAMINED
            self._unsettled = [u for u in self._unsettled if u.reason != _RETURNS or u.arclength[0] < nearest]
        for interval in step.settled:
            self._finest, self._longest = min(self._finest, interval), max(self._longest, interval)
        self._behind = step.samples[-4:]
        if len(self._contacts) > _REMEMBERED:
            kept = set(self._behind)
            self._contacts = {pair: known for pair, known in self._contacts.items() if kept.issuperset(pair)}
        inside = step.inside
        return Passage(_separating(inside), inside, step.crossings, step.unsettled)

    def doubt(self, old: Sample, new: Sample, reason: str) -> None:
        """Something between two samples could not be settled."""
        self._unsettled.append(_unsettled(old, new, reason))

    def grazes(self, p: Sample, q: Sample) -> bool:
        """Whether a contact begins or ceases to touch between two samples."""
        return self._between(p, q) == GRAZES

    def _between(self, p: Sample, q: Sample) -> int:
        """What contacts do between two samples."""
        known = self._contacts.get((p, q))
        if known is None:
            known = self._contacts[p, q] = contacts_between(p, q)
        return known

    def forget(self) -> None:
        """What lies behind says nothing of what comes (a corner of the equations)."""
        self._behind = []
        self._turned = None

    def _examined(self, old: Sample, new: Sample) -> _Step:
        if self._last is None or self._last[0] is not old or self._last[1] is not new:
            # the last one may have been solved again with other harmonics
            behind = [s for s in self._behind if s.place < old.place]
            behind.append(old)
            turned = self._turned if self._turned and behind[0].place < self._turned.place else None
            self._last = (old, new, _Step(behind, new, self._solve, self._branch_point, self._between, turned))
        return self._last[2]


class _Step:
    """One step under examination; `samples` are all that are known, in order, those behind the step included."""

    def __init__(
        self,
        behind: list[Sample],
        new: Sample,
        solve: Callable[[Sample, Sample, float, bool], Sample],
        branch_point: Callable[[Sample, Sample], Crossing | None],
        contacts: Callable[[Sample, Sample], int],
        turned: Crossing | None = None,
    ) -> None:
        self.contacts = contacts
        self.samples = [*behind, new]
        self.old, self.new, self.first = behind[-1], new, len(behind) - 1
        self.solve = solve
        self.branch_point = branch_point
        self.crossings: list[Crossing] = []
        self.turned = turned
        self.size = new.place - self.old.place
        self.probes = 0
        self.refused = False
        self.unsettled: list[Unsettled] = []
        self.settled: list[float] = []
        pending = [(self.old, new)]
        # a step may be short already
        least = min(FINEST, self.size / 30.0)
        if self.size > _JUMP:
            self._look_for_crossing(self.old, new)
            if not self.refused and self.size > FINEST and _disagreement(self.old.point, new.point) > _AGREE:
                pending = self._cut(self.old, new, 0.5)
        while pending and not self.refused:
            p, q = pending.pop()
            doubt = self._doubt(p, q)
            if doubt is None:
                self.settled.append(q.place - p.place)
                continue
            share, reason = doubt
            if q.place - p.place <= least:
                self.settled.append(q.place - p.place)
                if reason == _BESIDE or (not changes(p, q) and not (reason in _REASONS[1:] and _open(p, q))):
                    # no event, but too close to one to tell it from two; open verdicts are stated as such
                    self.unsettled.append(_unsettled(p, q, reason))
                continue
            halves = self._cut(p, q, share) if self.probes < MOST_PROBES else []
            if not halves and not self.refused:
                self.unsettled.append(_unsettled(p, q, reason))
            pending += halves

    @property
    def inside(self) -> list[Sample]:
        """The samples of the step, both ends included."""
        return self.samples[self.first :]

    def _cut(self, p: Sample, q: Sample, share: float) -> list[tuple[Sample, Sample]]:
        """The two parts of an interval, the second first; none if there is no motion where the curve should be."""
        a, b = self.old.point, self.new.point
        h = q.place - p.place
        for crossing in self.crossings:
            at = (crossing.place - p.place) / h
            if abs(share - at) < _CLEAR:
                share = at + math.copysign(2.0 * _CLEAR, 0.5 - at)
        place = p.place + share * h
        fraction = (place - a.arclength) / self.size
        self.probes += 1
        try:
            sample = self.solve(self.old, self.new, fraction, bool(self.crossings or self.turned))
        except ConvergenceError:
            self.refused = self.size > _JUMP
            return []
        point = sample.point
        away = length(b.weights * (point.u - between(a, b, fraction)))
        if away > _AWAY * self.size and self.size > FINEST:
            self.refused = True
            return []
        self.samples.insert(self.samples.index(q), sample)
        return [(sample, q), (p, sample)]

    def _doubt(self, p: Sample, q: Sample) -> tuple[float, str] | None:
        """Where to look into an interval, as a fraction of it, and why; None if it is done."""
        h = q.place - p.place
        crossing = self._look_for_crossing(p, q)
        if self.refused:
            return None
        eventful = p.unstable != q.unstable or bool(changes(p, q))
        if eventful and not _explained(p, q):
            return 0.5, (
                f"the number of unstable multipliers changes from {p.unstable} to {q.unstable}, which "
                "no bifurcation there explains"
            )
        if eventful and _mixed(p, q):
            return 0.5, "a pair of multipliers may cross the unit circle together with a real one"
        if crossing is not None and self._measures(p)[0, 0] != self._measures(q)[0, 0]:
            return 0.5, _BESIDE
        contacts = self.contacts(p, q)
        if contacts == GRAZES:
            return (0.5, "a contact begins or ceases to touch") if h > _LAYER else None
        if contacts and h > _LAYER:
            return CUT[contacts], "a contact that is about to begin or cease changes everything like a square root"
        stencil, at = self._around(p, q)
        if len(stencil) < 3:
            return 0.5, "nothing was looked at"
        if h > _EXAMINED and _movement(p.floquet.multipliers, q.floquet.multipliers) > MOVEMENT:
            return 0.5, "multipliers move too fast to be followed"
        doubt = first_doubtful([s.place for s in stencil], [self._measures(s) for s in stencil], at)
        if doubt is None or (_REASONS[doubt[0]] == _RETURNS and h <= _EXAMINED and self.turned):
            # right beside the branch point the multiplier at +1 is known up to its error only
            return None
        return doubt[1], _REASONS[doubt[0]]

    def _look_for_crossing(self, p: Sample, q: Sample) -> Crossing | None:
        """The branch point between two samples; the step is refused if the orientation changes without one, which it
        does not along one branch.
        """
        if not BRANCH_POINT.changed(p, q):
            return None
        known = next((crossing for crossing in self.crossings if crossing.between(p, q)), None)
        if known is None:
            known = self.branch_point(p, q)
            if known is not None:
                self.crossings.append(known)
                self.turned = known if known.turned is not None else self.turned
        self.refused = self.refused or (known is None and self.size > _JUMP)
        return known

    def _measures(self, sample: Sample) -> Array:
        """The tests at a sample, without their zeros at a branch point at which the curve turns back."""
        crossing = self.turned
        if crossing is None or crossing.turned is None:
            return sample.measures
        tests = sample.measures.copy()
        way = sample.place - crossing.place or math.ulp(1.0)
        change = tests[0, 1] * math.exp(tests[1, 1]) - crossing.turned
        tests[0, 0] *= math.copysign(1.0, way)
        tests[1, 0] -= math.log(abs(way))
        tests[0, 1] = math.copysign(1.0, change)
        tests[1, 1] = (math.log(abs(change)) if change else -math.inf) - 2.0 * math.log(abs(way))
        return tests

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


_RETURNS = "a multiplier may pass +1 and come back"
_REASONS = (
    "the branch may turn back and turn again",
    _RETURNS,
    "a multiplier may pass -1 and come back",
    "a pair of multipliers may leave the unit circle and come back",
)


_BESIDE = "the branch turns back beside a branch point, too close to tell where"


def _open(p: Sample, q: Sample) -> bool:
    """Whether a multiplier lies within its error of the unit circle at either of two samples."""
    return not (p.floquet.decided and q.floquet.decided)


def _unsettled(p: Sample, q: Sample, reason: str) -> Unsettled:
    a, b = p.point, q.point
    return Unsettled(p.curve.name, a.parameter, b.parameter, (a.arclength, b.arclength), reason)


def _separating(samples: list[Sample]) -> list[Sample]:
    """The fewest of the samples (the first left out, the last kept) between which no test changes twice, and every
    change that lies between is seen: two real multipliers that meet and cross the circle as a pair are a pair only from
    close by.

    A pair that crosses the circle is seen in the count of unstable multipliers: it wants an interval of its own.
    """
    if len(samples) == 2:
        return samples[1:]
    kept = [samples[0]]
    since: set[str] = set()
    for p, q in pairwise(samples):
        now = {kind.name for kind in changes(p, q)}
        crowded = now & since or (now and since and "NS" in now | since)
        if p is not kept[-1] and (crowded or {kind.name for kind in changes(kept[-1], q)} != now | since):
            kept.append(p)
            since = set()
        since |= now
    return [*kept[1:], samples[-1]]


def _disagreement(a: CurvePoint, b: CurvePoint) -> float:
    """Distance between the chord and the mean tangent of a step, in units of its length."""
    u, heading = b.curve.transfer(a.u, a.curve), b.curve.transfer(a.tangent, a.curve)
    scaled = [b.weights * vector for vector in (b.u - u, heading, b.tangent)]
    chord, first, last = (vector / (length(vector) or 1.0) for vector in scaled)
    return length(chord - 0.5 * (first + last)) if chord.any() else 0.0


def _explained(p: Sample, q: Sample) -> bool:
    """Whether the tests that change across an interval explain how the number of unstable multipliers changes."""
    change = abs(p.unstable - q.unstable)
    kinds = changes(p, q)
    if change == 0 and not kinds:
        return True
    if _open(p, q):
        return True
    changed = {kind.name for kind in kinds}
    if {"LP", "BP"} <= changed:
        # at a pitchfork the bifurcating branch turns back and is its own mirror image beyond
        return change <= 2 + ("PD" in changed) + 2 * ("NS" in changed)
    single = len(changed & {"LP", "BP", "PD"})
    most = single + 2 * ("NS" in changed)
    return change <= most and (change - single) % 2 == 0


def _mixed(p: Sample, q: Sample) -> bool:
    """Whether a pair that leaves the circle could be set off in the count by a real multiplier that enters it.

    Its product changes sign there (and where two real ones are each other's inverses): alone the count tells which.
    """
    if p.measures[0, -1] == q.measures[0, -1]:
        return False
    return any(kind is not NEIMARK_SACKER for kind in changes(p, q))


def _movement(old: ComplexArray, new: ComplexArray) -> float:
    """Largest distance from a new multiplier of modulus above one half to the nearest old one."""
    size = np.abs(new)
    nearest = np.abs(new[:, None] - old).min(axis=1) / np.maximum(1.0, size)
    return float(nearest[size > 0.5].max(initial=0.0))
