"""Whether a step along a response hides something, or has left its curve.

What `interior` looks at are the smooth test functions of `bifurcation.measures`. An interval is not done either while

- the number of unstable multipliers changes across it by what the tests at its ends do not explain;
- a multiplier of modulus above one half moves further than MOVEMENT (a fast rotation may look like none).

A branch point in the step is located first. Where the curve turns back exactly there (the unsymmetric motions of a
pitchfork, mirror images of each other on either side of it), turn is odd and fold even in the way s from it: turn / s
and (fold - fold_BP) / s^2 show whatever else there is, and no motion is solved for where the equations are almost
singular.

A step whose interior is not where its two ends say has jumped from one curve to another that passes close by, as has
one across which the orientation of the curve changes without a branch point: it is refused and halved by the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from suboctave.compiled import kernel
from suboctave.continuation.linear import course
from suboctave.continuation.point import CurvePoint
from suboctave.continuation.problem import Array
from suboctave.curves.events.monitors import BRANCH_POINT, BifurcationKind, Located, NeimarkSacker, changes
from suboctave.curves.interior import FINEST, Interior, Steps, unsettled, within
from suboctave.curves.sample import Sample, compare, resolved
from suboctave.curves.trace import Audit
from suboctave.floquet.held import of_those_moved
from suboctave.floquet.result import FloquetResult
from suboctave.floquet.symmetric import in_rings, symmetric_functions

#: multipliers of modulus above one half may move by this much per interval (relative to their modulus above one)
MOVEMENT = 0.5
#: intervals shorter than this are not cut for the multipliers' movement, unless a contact grazes in them, nor for that
#: at +1 beside a branch point
_EXAMINED = 0.01
#: distance from +1 or -1 up to which several real multipliers may be taken for each other
_CROWD = 0.1
#: steps shorter than this are not halved to tell a branch point from a jump between curves
_JUMP = 1e-5
#: way from an interval in which several pairs cross within which the test for pairs says nothing
_BESIDE_PAIRS = 3.0 * FINEST
#: distance from a branch point, as a share of an interval, from which on one cuts it
_CLEAR = 0.1
#: the ends say so themselves if chord and tangents agree to this share of the length
_AGREE = 0.03


@dataclass(frozen=True)
class Crossing:
    """A branch point of a curve, or several bifurcations that fall together, and its arclength.

    turned: fold at it, where the curve turns back in its parameter exactly there; else None. The double zero of fold
    lies as far from there as the harmonics left out make it.
    """

    place: float
    located: Located
    turned: float | None

    def between(self, a: Sample, b: Sample) -> bool:
        """Whether it lies between two samples."""
        return a.place <= self.place <= b.place


class StepGuard(Steps):
    """Examines the steps along one curve.

    `solve` gives the sample at a fraction of the way between two neighbours, about as exactly as rounding allows where
    that is asked for (may raise ConvergenceError); `crossing` the branch point, or the multiple bifurcation of a kind,
    between two samples whose tests show one.
    """

    def __init__(
        self,
        solve: Callable[[Sample, Sample, float, bool], Sample],
        crossing: Callable[[BifurcationKind, Sample, Sample], Crossing | None],
    ) -> None:
        super().__init__()
        self.solve = solve
        self.crossing = crossing
        #: the branch point behind at which the curve has turned back, while tests still reach back to it
        self.turned: Crossing | None = None
        self.audit = Audit()
        self._last: GuardedStep | None = None

    def refuses(self, old: Sample, new: Sample) -> bool:
        """True if a step has left its curve, or hides more than can be told while it is that long."""
        step = self.examined(old, new)
        if step.refused:
            self.audit = replace(self.audit, refused=self.audit.refused + 1)
        return step.refused

    def passage(self, old: Sample, new: Sample) -> GuardedStep:
        """The way between two neighbours, looked at, the step being accepted."""
        step, audit = self.examined(old, new), self.audit
        known, self.turned = [*audit.unsettled, *step.unsettled], step.turned
        if self.turned is not None:
            # known now, it explains what was in doubt right before it
            nearest = self.turned.place - _EXAMINED
            known = [u for u in known if u.reason != _RETURNS or u.arclength[0] < nearest]
        finest, longest = min([audit.finest, *step.settled]), max([audit.longest, *step.settled])
        self.audit = Audit(finest, longest, audit.probes + step.probes, audit.refused, tuple(known))
        self.keep(step.samples)
        return step

    def doubt(self, old: Sample, new: Sample, reason: str) -> None:
        """Something between two samples could not be settled."""
        self.audit = replace(self.audit, unsettled=(*self.audit.unsettled, unsettled(old, new, reason)))

    def forget(self) -> None:
        super().forget()
        self.turned = None

    def examined(self, old: Sample, new: Sample) -> GuardedStep:
        """The way between two neighbours, looked at."""
        if self._last is None or self._last.old is not old or self._last.new is not new:
            self._last = GuardedStep(self, old, new)
        return self._last


class GuardedStep(Interior):
    """One step along a response under examination."""

    steps: StepGuard
    crowded = 0.01

    def __init__(self, guard: StepGuard, old: Sample, new: Sample) -> None:
        super().__init__(guard, old, new, _REASONS)
        #: the branch points in it, and that within reach at which the curve has turned back
        self.crossings: list[Crossing] = []
        self.turned = guard.turned if guard.turned and guard.leading_to(old)[0].place < guard.turned.place else None
        #: the multiple bifurcations in it
        self.multiple: list[Crossing] = []
        pending = [(old, new)]
        if self.size > _JUMP:
            if BRANCH_POINT in changes(old, new):
                self._look_for_crossing(old, new)
            if not self.refused and self.size > FINEST and _disagreement(old.point, new.point) > _AGREE:
                pending = self.cut(old, new, 0.5)
        self.examine(pending)

    @property
    def separating(self) -> list[Sample]:
        """The fewest of the samples inside (the first left out, the last kept) between which no test changes twice, and
        every change that lies between is seen: two real multipliers that meet and cross the circle as a pair are a pair
        only from close by.

        A pair that crosses the circle is seen in the count of unstable multipliers: it wants an interval of its own,
        but not one that ends where the count is open.
        """
        first, *_, last = samples = self.inside
        if first is samples[-2]:
            return [last]
        kept, since = [first], set[BifurcationKind]()
        for p, q in pairwise(samples):
            now = set(changes(p, q))
            pairs = any(kind.name == "NS" for kind in now | since)
            crowded = now & since or (now and since and pairs and p.floquet.decided)
            if p is not kept[-1] and (crowded or set(changes(kept[-1], q)) != now | since):
                kept.append(p)
                since = set()
            since |= now
        return [*kept[1:], last]

    def harmless(self, p: Sample, q: Sample, reason: str) -> bool:
        # no event, but too close to one to tell it from two; open verdicts are stated as such
        if reason in (_BESIDE, _TOGETHER):
            return False
        # beside an interval in which several pairs cross their product comes to zero without changing its sign
        near = [(a, b) for a, b in pairwise(self.samples) if max(p.place - b.place, a.place - q.place) <= _BESIDE_PAIRS]
        several = reason == _REASONS[3] and any(abs(compare(a, b).change) > 3 for a, b in near)
        return several or bool(changes(p, q)) or (reason in _REASONS[1:] and _open(p, q))

    def cut(self, p: Sample, q: Sample, share: float) -> list[tuple[Sample, Sample]]:
        """See `Interior.cut`: not right at a branch point."""
        for crossing in self.crossings:
            at = (crossing.place - p.place) / (q.place - p.place)
            if abs(share - at) < _CLEAR:
                share = at + math.copysign(2.0 * _CLEAR, 0.5 - at)
        return super().cut(p, q, share)

    def solve(self, fraction: float) -> Sample:
        return self.steps.solve(self.old, self.new, fraction, bool(self.crossings or self.turned))

    def doubt(self, p: Sample, q: Sample) -> tuple[float, str] | None:
        """See `Interior.doubt`."""
        h, kinds = q.place - p.place, changes(p, q)
        crossing = self._look_for_crossing(p, q) if BRANCH_POINT in kinds else None
        if self.refused:
            return None
        told = resolved(p, q)
        eventful = told and (bool(kinds) or compare(p, q).change != 0)
        doubt = self._doubt_at_event(p, q, crossing) if eventful else None
        if doubt is not None:
            return doubt
        doubt = super().doubt(p, q)
        if doubt is None and told:
            # at a grazing they turn like a square root: a pair may come inside right before it and leave right behind
            place = self.steps.contacts(p, q).grazes
            if h > (_EXAMINED if place is None else FINEST) and _too_fast(p, q, eventful):
                return within(place or 0.5), "multipliers move too fast to be followed"
        # right beside a branch point at which the curve turns the multiplier at +1 is known up to its error only
        return None if doubt is not None and doubt[1] == _RETURNS and h <= _EXAMINED and self.turned else doubt

    def _doubt_at_event(self, p: Sample, q: Sample, crossing: Crossing | None) -> tuple[float, str] | None:
        """The same where something has changed: the number of unstable multipliers, or a test."""
        if not all(self._confirmed(kind, p, q) for kind in changes(p, q) if kind.multiplicity > 1):
            return 0.5, _TOGETHER
        if not _explained(p, q):
            before, now = p.outside, q.outside
            return 0.5, (
                f"the number of unstable multipliers changes from {before} to {now}, which no bifurcation there "
                "explains"
            )
        if self._mixed(p, q):
            return 0.5, "a pair of multipliers may cross the unit circle together with a real one"
        turns = [self.measures(one)[0, 0] for one in (p, q)]
        return (0.5, _BESIDE) if crossing is not None and turns[0] != turns[1] else None

    def _mixed(self, p: Sample, q: Sample) -> bool:
        """Whether a pair that leaves the circle could be set off in the count by a real multiplier that enters it.

        Its product changes sign there, and in its ring if multipliers lie in rings. Without rings it also does where
        two real ones are each other's inverses: alone the count tells which.
        """
        if not _pairs_change(p, q) or all(isinstance(kind, NeimarkSacker) for kind in changes(p, q)):
            return False
        stencil, at = self._around(p, q)
        rings = next(iter(self.relative(stencil, 3)), None) if len(stencil) > 2 else None
        return rings is None or bool((rings[at, 0] != rings[at + 1, 0]).any())

    def _look_for_crossing(self, p: Sample, q: Sample) -> Crossing | None:
        """The branch point between two samples between which the orientation changes; the step is refused where there
        is none, as it does not change along one branch.
        """
        known = next((crossing for crossing in self.crossings if crossing.between(p, q)), None)
        if known is None:
            known = self.steps.crossing(BRANCH_POINT, p, q)
            if known is not None:
                self.crossings.append(known)
                self.turned = known if known.turned is not None else self.turned
        self.refused = self.refused or (known is None and self.size > _JUMP)
        return known

    def _confirmed(self, kind: BifurcationKind, p: Sample, q: Sample) -> bool:
        """Whether bifurcations that seem to fall together between two samples do."""
        if any(known.located.kind is kind and known.between(p, q) for known in self.multiple):
            return True
        found = self.steps.crossing(kind, p, q)
        self.multiple += [] if found is None else [found]
        return found is not None

    def relative(self, stencil: Sequence[Sample], k: int) -> Iterator[Array]:
        """See `Interior.relative`: with the functions of multipliers in rings, equal ones taken for one, then of those
        that elements move.
        """
        if self.turned or k == 0:
            return
        told = _told(stencil)
        known = [one.multipliers for one in told]
        if len({len(mu) for mu in known}) > 1 or not np.isfinite(known).all():
            return
        if _families(told):
            yield in_rings(np.array([one.distinct for one in told]), k - 1)
        elif not told[0].repeated:
            yield in_rings(np.array(known), k - 1)
            yield of_those_moved(known, [s.grip for s in stencil], k - 1)

    def tests(self, stencil: Sequence[Sample]) -> list[Array]:
        """See `Interior.tests`: of equal multipliers with one, where there are as many all along. A family that passes
        the circle in the same step as a single one would go unseen, its zero being double.
        """
        tests = [self.measures(one) if self.turned else one.measures for one in stencil]
        if not resolved(*stencil):
            # but for the turn, which the curve itself tells
            return [one[:, :1] for one in tests]
        if self.turned or not stencil[0].floquet.repeated or not _families(told := _told(stencil)):
            return tests
        own = (symmetric_functions(one.distinct) for one in told)
        return [np.column_stack((one[:, :1], functions)) for one, functions in zip(tests, own, strict=True)]

    def measures(self, sample: Sample) -> Array:
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


_TOGETHER = "several multipliers may pass the unit circle together, or one after the other"
_RETURNS = "a multiplier may pass +1 and come back"
_BESIDE = "the branch turns back beside a branch point, too close to tell where"
_REASONS = (
    "the branch may turn back and turn again",
    _RETURNS,
    "a multiplier may pass -1 and come back",
    "a pair of multipliers may leave the unit circle and come back",
)


def _told(stencil: Sequence[Sample]) -> list[FloquetResult]:
    """The multipliers at the samples of a stencil."""
    return [one.floquet for one in stencil]


def _families(told: Sequence[FloquetResult]) -> bool:
    """Whether motions have families of equal multipliers, as many at all of them."""
    return told[0].repeated and len({len(one.distinct) for one in told}) == 1


def _open(p: Sample, q: Sample) -> bool:
    """Whether a multiplier lies within its error of the unit circle at either of two samples."""
    return not all(one.decided for one in _told((p, q)))


def _pairs_change(p: Sample, q: Sample) -> bool:
    """Whether the product of all pairs changes its sign."""
    return bool(p.measures[0, -1] != q.measures[0, -1])


def _disagreement(a: CurvePoint, b: CurvePoint) -> float:
    """Distance between the chord and the mean tangent of a step, in units of its length."""
    u, heading = a.u, a.tangent
    if a.curve is not b.curve:
        u, heading = b.curve.transfer(u, a.curve), b.curve.transfer(heading, a.curve)
    apart: float = course(heading, b.tangent, b.u - u, b.weights)[2]
    return apart


def _explained(p: Sample, q: Sample) -> bool:
    """Whether the tests that change across an interval explain how the number of unstable multipliers changes."""
    kinds = changes(p, q)
    change, changed = abs(compare(p, q).change), {kind.name for kind in kinds}
    # open verdicts leave the count open, but not where the product of all pairs tells of one as well
    pair = change > 1 and "NS" not in changed and _pairs_change(p, q)
    if (change == 0 and not changed) or (_open(p, q) and not pair):
        return True
    pairs = sum(kind.multiplicity for kind in kinds if kind.name == "NS")
    single = sum(kind.multiplicity for kind in kinds) - pairs
    # at a pitchfork the bifurcating branch turns back and is its own mirror image beyond
    return change <= single + 2 * pairs and ({"LP", "BP"} <= changed or (change - single) % 2 == 0)


def _too_fast(p: Sample, q: Sample, eventful: bool) -> bool:
    """Whether multipliers move too fast between two samples to be followed."""
    a, b = p.floquet, q.floquet
    return bool(_moves_too_fast(a.multipliers, b.multipliers, a.distinct, b.distinct, eventful))


@kernel()
def _moves_too_fast(old, new, before, behind, eventful):
    """Whether a new multiplier of modulus above one half lies too far from all old ones; or, where nothing has changed,
    of different ones before and behind a real one near +1 or -1, where there are several, has moved farther than it is
    from there: one that passes and another that comes back leave the number of those outside as it was, and the sign of
    products.
    """
    for mu in new:
        size = abs(mu)
        if size > 0.5:
            nearest = np.inf
            for other in old:
                nearest = min(nearest, abs(mu - other))
            if nearest > MOVEMENT * max(1.0, size):
                return True
    if eventful:
        return False
    for first, last in ((before, behind), (behind, before)):
        for target in (1.0, -1.0):
            near = 0
            for mu in last:
                near += mu.imag == 0.0 and abs(mu.real - target) < _CROWD
            for mu in last:
                if near > 1 and mu.imag == 0.0 and abs(mu.real - target) < _CROWD:
                    moved, clearance = np.inf, 0.0
                    for other in first:
                        if other.imag == 0.0 and abs(mu.real - other.real) < moved:
                            moved = abs(mu.real - other.real)
                            clearance = min(abs(mu.real - target), abs(other.real - target))
                    if moved > clearance:
                        return True
    return False
