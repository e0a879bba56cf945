"""Following a response curve until it ends, with its located bifurcations and events."""

from __future__ import annotations

import math
from bisect import insort
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.continuation import CurvePoint, Event, March
from suboctave.continuation.ending import Ending, EndReason
from suboctave.continuation.events import Bracket
from suboctave.continuation.march import Arrival
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.notes import Note
from suboctave.continuation.point import point_ahead, point_between, solved_again
from suboctave.continuation.problem import Curve
from suboctave.curves.blow_up import BlownUp
from suboctave.curves.corners import beyond_corner
from suboctave.curves.driver import Driver
from suboctave.curves.events.grazings import locate_grazings
from suboctave.curves.events.layer import behind_their_grazings, jumps
from suboctave.curves.events.monitors import (
    BRANCH_POINT,
    NARROWEST,
    PERIOD_DOUBLING,
    BifurcationKind,
    Located,
    changes,
    locate,
    multiple,
    solved_by,
)
from suboctave.curves.guard import Crossing, GuardedStep, StepGuard
from suboctave.curves.identity import same_event
from suboctave.curves.junction import Meeting, lost, meeting, passes_doubling, plain_point, regular_point
from suboctave.curves.leaving import multiple_at
from suboctave.curves.ledgers import REASON, CountCheck, DoublingWatch, HiddenDoublings, pair_in
from suboctave.curves.motion import CRITICAL, MotionEvaluation, MotionProblem
from suboctave.curves.refine import bifurcation_at, solved_bifurcation, solved_in, turns_at
from suboctave.curves.sample import Sample
from suboctave.curves.trace import Settings, Trace, Unsettled, joined
from suboctave.errors import ConvergenceError
from suboctave.harmonic.truncation import next_harmonics
from suboctave.interruption import stopping, users_function

#: bracket, as a share of a step, in which a bifurcation is not looked for any more that only its equations can tell
_TOLD_APART = 2e-3
#: growth of motions of every size at one value of the parameter after which they may grow for ever: of a piece that a
#: branch begins with, and of others
_GROWN = 1e12, 1e4
#: speed of the free parameter along a curve, in scaled arclength, at which it turns; how far from there a curve begins
#: that is followed both ways
_TURNS, _BESIDE = 1e-2, 3e-3


_NOT_FOUND = {
    "BP": "the curve may have jumped to another branch: its orientation changes without a branch point",
    "LP": "the branch turns back, but its limit point could not be located",
    "PD": "a multiplier passes -1, but no period doubling could be located",
    "NS": "a pair of multipliers passes the unit circle, but no Neimark-Sacker point could be located",
}


_UNSEARCHED = "other harmonics change what has happened there, and it could not be searched with them"


def follow(start: CurvePoint, direction: float, bounds: tuple[float, float], settings: Settings) -> Trace:
    """Follow a response curve from a solved start; KeyboardInterrupt ends it politely."""
    return _Follower(start, direction, bounds, settings).run()


class _Follower(Driver):
    def __init__(self, start: CurvePoint, direction: float, bounds: tuple[float, float], settings: Settings) -> None:
        super().__init__(settings)
        hooks = self._clear, self._arrived, self._finer
        options = bounds, settings.newton, settings.stepping, *hooks
        headed = regular_point(start.turned if start.tangent[start.curve.parameter] * direction < 0.0 else start)
        self.march = March(headed, 0.0, *options)
        #: goes on from a point behind a corner
        self._from = lambda point: March(point, 0.0, *options, home=headed)
        #: size of the last motion at which the parameter moved, or of the first, and how much larger motions may become
        self._size: tuple[float, float] | None = None
        #: where the corners that were passed lie
        self._corners: list[float] = []
        self._candidate: Sample | None = None
        self._guard = StepGuard(self._between, self._crossing)
        #: the step that is searched
        self._step: GuardedStep | None = None
        self._again: tuple[Sample, MotionProblem, Sample] | None = None
        self._count = CountCheck()
        self._hidden = HiddenDoublings()
        #: the samples of the last step
        self._passed: list[Sample] = []
        #: bifurcations listed that other harmonics show farther ahead, where they may be met again
        self._ahead: list[Bifurcation] = []
        self._last_located: tuple[BifurcationKind, Sample, Sample, Located | None] | None = None
        self._turned: Bifurcation | None = None
        self._meeting: tuple[CurvePoint, CurvePoint, Meeting] | None = None
        #: the last motion that was asked whether something floats, and the answer
        self._loose: tuple[CurvePoint, str | None] | None = None
        self._kinds = solved_by(settings.formulation)
        #: looks for period doublings in place of det J_half, where the formulation has tests of its own
        self._watch: DoublingWatch | None = None
        if settings.formulation.test is not None:
            self._watch = DoublingWatch(settings.formulation.test, self._kinds["PD"], self._located)

    def _walk(self) -> None:
        # in a fresh installation the first verdict on stability waits for its kernels to be compiled
        self._report(self._plain(self.march.start))
        ending: Ending | None = None
        while True:
            for point in self.march:
                self._accept(self._plain(point))
                ending = self._growing()
                if ending is not None or (self._turned is not None and self.settings.half):
                    break
            beyond = self._beyond_corner()
            if beyond is None:
                break
            self.march = self._from(beyond)
        self.trace.closed = self.march.closed
        self.trace.ends(ending or self.march.ending)
        self.trace.arrives = self._arrival()

    def _growing(self) -> Ending | None:
        """How the curve ends where motions of every size exist at one value of the parameter, and they have grown by
        orders of magnitude since it last moved, or by more if it never has: a branch may begin with such a piece.
        """
        last = self.previous
        assert last is not None
        size = last.curve.size(last.point.u)
        if self._size is None or not last.still:
            self._size = size, _GROWN[0] if last.still else _GROWN[1]
        if size <= self._size[0] * self._size[1]:
            return None
        detail = f"the motions grow without bound at {last.where}, at constant parameters"
        return Ending(EndReason.NO_MEANING, last.where, detail)

    def _beyond_corner(self) -> CurvePoint | None:
        """A point behind a corner that the steps could not get around as their parameter does not lead on: where a
        contact begins everywhere at once. None if there is none.
        """
        last = self.previous
        if self.march.ending.reason is not EndReason.STEP_TOO_SMALL or last is None or last.place in self._corners:
            return None
        self._corners.append(last.place)
        corner = beyond_corner(last, (p.orbit for p in reversed(self.trace.points)), self.settings.newton)
        if corner is None or corner[0] is None:
            return None
        beyond = regular_point(corner[0])
        if isinstance(self.march.start.curve, BlownUp) and not isinstance(beyond.curve, BlownUp):
            # motions of half the period are none of the branch
            return None
        self._guard.forget()
        return beyond

    def _interrupted(self) -> None:
        trace = self.trace
        if self.previous is None:
            self.previous = start = self._sample(self._plain(self.march.start))
            trace.points.append(start.as_point(start.floquet))
        # of the step that was under way nothing counts
        trace.cut(trace.points[-1].arclength)

    def _finish(self) -> None:
        for p, q, reason in self._watch.missed() if self._watch is not None else ():
            self._guard.doubt(p, q, reason)
        self._jumps()
        audit = self._guard.audit
        self.trace.audit = replace(audit, unsettled=tuple(joined(audit.unsettled)))
        if self._turned is not None and self.settings.half:
            self.trace.end_at(self._turned)

    def _jumps(self) -> None:
        """List each jump of a multiplier at a grazing once; what jumps there and back is in doubt."""
        self.trace.bifurcations, back = jumps(self.trace.bifurcations, self.trace.points)
        for first, *_, last in back:
            reason = "a multiplier may pass " + ("+1" if first.kind == "LP" else "-1") + " and come back"
            name, way = first.parameter_name, (first.arclength, last.arclength)
            doubt = Unsettled(name, first.parameter(name), last.parameter(name), way, reason)
            self._guard.audit = self._guard.audit.in_doubt(doubt)

    def _sample(self, point: CurvePoint) -> Sample:
        known = self._candidate
        return known if known is not None and known.point is point else Sample(point, self.settings.stability)

    def _plain(self, point: CurvePoint) -> CurvePoint:
        if not isinstance(point.curve, BlownUp):
            return point
        return plain_point(point, None if self.previous is None else self.previous.point)

    def _clear(self, a: CurvePoint, b: CurvePoint) -> bool:
        """True if a step stays on its curve and its interior could be looked at, or ends where it meets another."""
        self._meeting = None
        if passes_doubling(b):
            return self._met(a, b) is not None
        a, b = self._plain(a), self._plain(b)
        assert isinstance(a.evaluation, MotionEvaluation)
        assert isinstance(b.curve, MotionProblem)
        if self._floating(b) is not None:
            return False
        self._candidate = new = self._sample(b)
        if self.previous is None or self.previous.at_rest or new.at_rest:
            return True
        if a.evaluation.curve is b.curve is not self.previous.curve:
            # the step began with solving for its start in its own discretisation
            self._again = (self.previous, b.curve, self.previous.at(a))
        return not self._guard.refuses(self._solved_again(self.previous, new), new)

    def _arrived(self, a: CurvePoint, b: CurvePoint) -> Arrival | None:
        """How the curve ends between two neighbours, if it meets another one there or its motions begin to float."""
        if not passes_doubling(b):
            loose = self._floating(self._plain(b))
            if loose is None:
                return None
            where = a.curve.where(a.u)
            return Arrival(None, Ending(EndReason.MOTIONS_END, where, f"the motions end at {where}: beyond it {loose}"))
        known = self._meeting
        if known is None or known[0] is not a or known[1] is not b:
            # a step too short to be halved
            met = self._met(a, b)
            return lost(a) if met is None else met.arrival
        return known[2].arrival

    def _met(self, a: CurvePoint, b: CurvePoint) -> Meeting | None:
        """Where the branch meets its parent between two neighbours."""
        met = meeting(a, b, self.settings.newton)
        if met is not None:
            assert self.previous is not None
            met = replace(met, arrival=met.behind(self.previous.point))
            self._meeting = (a, b, met)
        return met

    def _floating(self, point: CurvePoint) -> str | None:
        """What floats on a motion, in words; None if all is held."""
        known = self._loose
        if known is None or known[0] is not point:
            assert isinstance(point.curve, MotionProblem)
            loose = point.curve.floating(point.evaluation, point.weights, self.settings.newton.tolerance)
            self._loose = known = (point, loose)
        return known[1]

    def _finer(self, a: CurvePoint, b: CurvePoint) -> Curve | None:
        """The curve with more harmonics, where those of a step leave it open whether a multiplier passes the circle."""
        self._candidate = new = self._sample(self._plain(b))
        old, rule = self.previous, new.curve.adaptive
        # where sub-harmonic motions are born and end depends on their harmonics
        if rule is None or old is None or old.at_rest or new.at_rest or new.state.basis.nu > 1:
            return None
        inside = self._guard.examined(self._solved_again(old, new), new).inside
        known = [sample for sample in inside if sample is new or sample.completed_is_known]
        worst = max(known, key=lambda sample: sample.doubt)
        if worst.doubt <= CRITICAL:
            return None
        basis = next_harmonics(worst.state, rule)
        if basis.size <= worst.state.basis.size:
            return None
        try:
            return replace(worst.curve.finer(worst.state, basis)[0], erred=worst.doubt)
        except ConvergenceError:
            return None

    def _arrival(self) -> Bifurcation | None:
        """The bifurcation of another curve that this one ends at."""
        if self._meeting is None or not self.trace.points:
            return None
        met, arclength = self._meeting[2], self.trace.points[-1].arclength
        if self.march.ending is not met.arrival.ending:
            return None
        if met.doubt is not None:
            self._guard.audit = self._guard.audit.in_doubt(replace(met.doubt, arclength=(arclength, arclength)))
        kind, settings = multiple(PERIOD_DOUBLING, met.multiplicity), self.settings
        item = solved_bifurcation(kind, met.solution, met.parent, settings.observe, self.trace.notes, arclength)
        return replace(item, multiplicity=met.multiplicity)

    def _solved_again(self, sample: Sample, next_one: Sample) -> Sample:
        """A sample in the discretisation of the step that leaves it: where harmonics change, the motion moves a little
        and test functions with it.
        """
        curve = next_one.curve
        if sample.curve is curve:
            return sample
        known = self._again
        if known is None or known[0] is not sample or known[1] is not curve:
            try:
                again = sample.at(solved_again(sample.point, curve, next_one.point.weights, self.settings.newton))
            except ConvergenceError:
                again = sample
            self._again = known = (sample, curve, again)
        return known[2]

    def _between(self, a: Sample, b: Sample, fraction: float, exactly: bool) -> Sample:
        """The motion at a fraction of the way between two neighbours."""
        return self._sample(point_between(a.point, b.point, fraction, self.settings.newton, exactly))

    def _crossing(self, kind: BifurcationKind, a: Sample, b: Sample) -> Crossing | None:
        """The branch point, or the multiple bifurcation of a kind, between two samples, if its system can be solved."""
        listed = [] if self._step is None else [*self._step.crossings, *self._step.multiple]
        for known in listed:
            if known.located.kind is kind and known.between(a, b):
                return known
        located = self._located(kind, a, b)
        if located is None or located.solution is None:
            return None
        place = a.place + located.fraction * (b.place - a.place)
        if kind.multiplicity > 1 or not turns_at(located, a, b):
            return Crossing(place, located, None)
        sign, log = self.settings.stability.along(located.solution.state).symmetric[:, 0].tolist()
        return Crossing(place, located, sign * math.exp(log))

    def _accept(self, point: CurvePoint) -> None:
        sample = self._sample(point)
        passed = [sample]
        if self.previous is not None:
            if self.previous.at_rest or sample.at_rest:
                self._guard.forget()
                self._hidden.forget()
                if self._watch is not None:
                    self._watch.forget()
            else:
                again = self._solved_again(self.previous, sample)
                if again is not self.previous:
                    self._search_here(self.previous, again)
                    self.previous = again
                self._step = self._guard.passage(again, sample)
                passed = self._step.separating
        for new in passed:
            if self.previous is not None:
                self._search(self.previous, new)
            self.trace.points.append(new.as_point(new.verdict))
            self.previous = new
        step, self._step = self._step, None
        self._passed = [] if step is None else step.inside
        self._look_behind(self._passed)
        self._report(point)

    def _bifurcation(self, located: Located, a: Sample, b: Sample) -> Bifurcation | None:
        notes: list[Note] = []
        item = bifurcation_at(located, a, b, self.settings.observe, notes)
        if item is not None:
            self.trace.doubts += [(item.orbit, note) for note in notes]
        return item

    def _bifurcations(self, located: Located, a: Sample, b: Sample) -> list[Bifurcation]:
        """What was located, the bifurcations that fall together one by one; none where it is not found again."""
        if located.kind.multiplicity == 1:
            item = self._bifurcation(located, a, b)
            return [] if item is None else [item]
        return multiple_at(located, a, b, self.settings.observe, self.trace.notes)

    def _look_behind(self, inside: list[Sample]) -> None:
        """What the harmonics solved for do not show of a step: hidden pairs, and open verdicts between its points."""
        known = [sample for sample in inside if sample.completed_is_known]
        for stretch in self._hidden.passed([sample for sample in known if sample.resolved]):
            pairs = [] if self._watch else pair_in(stretch, self.settings.newton)
            items = [item for entry in pairs if (item := self._bifurcation(*entry)) is not None]
            for item in items:
                if self._insert(item):
                    self._count.noted(item)
                    self._ahead.append(item)
            if len(items) < 2:
                self._guard.doubt(stretch[0], stretch[2], REASON)
        self.trace.open += [s.as_point(s.floquet) for s in known[1:-1] if not s.floquet.decided]

    def _search_here(self, old: Sample, again: Sample) -> None:
        """Events that lie behind a point in one discretisation and before it in the next: the way to the point is
        searched once more in the next one, from where both agree.
        """
        if self._watch is not None:
            self._watch.moved(old, again)
        if not self._differ(old, again):
            return
        way, agreed = self._way_to(again)
        listed = [item for item in self.trace.bifurcations if item.arclength >= way[0].place]
        found: list[Bifurcation] = []
        for a, b in pairwise(way):
            located, missing = self._changed_between(a, b)
            if missing:
                self._guard.doubt(a, b, "; ".join(_NOT_FOUND[name] for name in missing))
            found += behind_their_grazings(located + self._grazings_between(a, b))
        for item in found:
            if not any(same_event(item, known) for known in listed) and self._insert(item):
                self._count.noted(item)
        # the others lie ahead now
        self._ahead += [item for item in listed if not any(same_event(item, other) for other in found)]
        if not agreed:
            self._guard.doubt(way[0], again, _UNSEARCHED)

    def _differ(self, sample: Sample, again: Sample) -> bool:
        """Whether an event lies behind a motion in one discretisation and before it in another."""
        return bool(self._changes(sample, again)) or self._guard.grazes(sample, again)

    def _way_to(self, again: Sample) -> tuple[list[Sample], bool]:
        """The samples of the last step in the discretisation of its end, back to where their tests agree with what they
        were; whether they do.
        """
        way = [again]
        for sample in reversed(self._passed[:-1]):
            try:
                there = solved_in(again.curve, sample, self.settings.newton)
            except ConvergenceError:
                return way, False
            way.insert(0, there)
            if not self._differ(sample, there):
                return way, True
        return way, False

    def _search(self, a: Sample, b: Sample) -> None:
        # at rest the equations have a corner where a contact is closed: nothing bifurcates there
        resting = a.at_rest or b.at_rest
        events, missing = ([], []) if resting else self._changed_between(a, b)
        if missing:
            self._guard.doubt(a, b, "; ".join(_NOT_FOUND[name] for name in missing))
        events = self._not_listed(events, a, b) if events else []
        unseen = ["PD"] * (self._watch is not None and PERIOD_DOUBLING.changed(a, b))
        complaint = self._count.complaint(b, [item.kind for _, item in events] + missing + unseen)
        if complaint is not None:
            self._guard.doubt(*complaint)
        if not resting and self._guard.grazes(a, b):
            events += self._not_listed(self._grazings_between(a, b), a, b)
        if events:
            self.trace.bifurcations += behind_their_grazings(events)
        if self._watch is not None and not resting:
            for located, p, q in self._watch.passed(a, b):
                item = self._bifurcation(located, p, q)
                if item is None:
                    self._guard.doubt(p, q, _NOT_FOUND["PD"])
                else:
                    self._insert(item)
        for event in self.settings.events:
            item = self._event(event, a, b)
            self.trace.events += [] if item is None else [item]

    def _changed_between(self, a: Sample, b: Sample) -> tuple[list[tuple[float, Bifurcation]], list[str]]:
        """The bifurcations between two samples with their places, and the kinds whose tests change without one."""
        events: list[tuple[float, Bifurcation]] = []
        missing: list[str] = []
        turned: Bifurcation | None = None
        for kind in self._changes(a, b):
            if kind.name == "LP" and turned is not None:
                self._turned = turned
                continue
            crossing = self._crossing(kind, a, b) if kind is BRANCH_POINT or kind.multiplicity > 1 else None
            if crossing is None:
                located = self._located(kind, a, b)
            else:
                located = replace(crossing.located, fraction=(crossing.place - a.place) / (b.place - a.place))
            items = [] if located is None else self._bifurcations(located, a, b)
            if located is None or not items:
                # several real multipliers may pass for a pair: the count tells
                if located is not None or kind.name != "NS":
                    missing += [kind.name] * kind.multiplicity
                continue
            events += [(located.fraction, item) for item in items]
            if crossing is not None and crossing.turned is not None:
                # at a pitchfork the bifurcating branch turns back exactly at the branch point
                (turned,) = items
        if "BP" in missing and "LP" in missing:
            # across a jump between branches the slope means nothing
            missing.remove("LP")
        return events, missing

    def _grazings_between(self, a: Sample, b: Sample) -> list[tuple[float, Bifurcation]]:
        """The grazings between two samples with their places."""
        touched = locate_grazings(a, b, self.settings.newton) if self._guard.grazes(a, b) else []
        items = [(located.fraction, self._bifurcation(located, a, b)) for located in touched]
        return [(place, item) for place, item in items if item is not None]

    def _not_listed(
        self, events: list[tuple[float, Bifurcation]], a: Sample, b: Sample
    ) -> list[tuple[float, Bifurcation]]:
        """Those of the bifurcations between two samples that are met for the first time."""
        fresh, met = [], self.trace.bifurcations[-4:]
        for place, item in events:
            known = next((other for other in met if same_event(item, other)), None)
            if known is None:
                fresh.append((place, item))
            elif item.kind not in CONTACT_KINDS and known not in self._ahead:
                self._guard.doubt(a, b, f"a second {item.kind} may lie beside that which is listed")
        return fresh

    def _changes(self, a: Sample, b: Sample) -> list[BifurcationKind]:
        """The kinds to look for between two samples, as they are to be solved for."""
        kinds = [kind if kind.one_way else self._kinds[kind.name] for kind in changes(a, b)]
        return kinds if self._watch is None else [kind for kind in kinds if kind.name != "PD" or kind.multiplicity > 1]

    def _insert(self, item: Bifurcation) -> bool:
        """Put a bifurcation into its place on the branch unless it is there already."""
        known = any(same_event(item, other) for other in self.trace.bifurcations[-4:])
        if not known:
            insort(self.trace.bifurcations, item, key=lambda other: other.arclength)
        return not known

    def _located(self, kind: BifurcationKind, a: Sample, b: Sample) -> Located | None:
        """A bifurcation between two neighbours; a branch point only if its system was solved."""
        known = self._last_located
        if known is None or known[0] is not kind or known[1] is not a or known[2] is not b:
            must_solve = kind is BRANCH_POINT or kind.multiplicity > 1
            begins = a.point.arclength == 0.0 and len(self.trace.points) <= 1
            # across a corner that was passed tangents do not tell which way is ahead
            narrowest = 1.0 if a.place in self._corners else _TOLD_APART if must_solve else NARROWEST
            located = locate(kind, a, b, self.settings.newton, narrowest, begins)
            unsolved = must_solve and located is not None and located.solution is None
            self._last_located = known = (kind, a, b, None if unsolved else located)
        return known[3]

    def _event_value(self, event: Event, sample: Sample) -> float:
        with users_function(f"the function of the event {event.name!r}"):
            value = event.function(sample.orbit)
        with suppress(TypeError, ValueError, OverflowError):
            if np.isfinite(number := float(value)):
                return number
        raise stopping(
            f"the function of the event {event.name!r} returned {value!r} at {sample.where}; it must return a finite "
            "number"
        )

    def _event(self, event: Event, a: Sample, b: Sample) -> Bifurcation | None:
        value_a, value_b = (self._event_value(event, sample) for sample in (a, b))
        if not (value_a == 0.0 and a.point.arclength == 0.0) and not value_a * value_b < 0.0 and value_b != 0.0:
            return None
        values, newton = (value_a, value_b), self.settings.newton
        try:
            bracket = Bracket(a.point, b.point, values, lambda p: self._event_value(event, self._sample(p)), newton)
            point = bracket.points[bracket.zero()]
        except ConvergenceError as failure:
            here = a.point.parameter, b.point.parameter
            self.trace.notes.append(Note(f"not located: {failure}", a.curve.name, *here, event.name))
            return None
        sample = self._sample(point)
        known = sample.orbit.residual, sample.orbit.amplitude(self.settings.observe), sample.curve.name
        return Bifurcation(event.name, sample.orbit, sample.floquet, *known, arclength=point.arclength)


def both_ways(point: CurvePoint, ahead: float, bounds: tuple[float, float], settings: Settings) -> Trace:
    """Follow a curve from an inner point to both sides; from a bound inwards only."""
    low, high = bounds
    slack, (first, target) = 1e-9 * (high - low), (low, high) if ahead > 0 else (high, low)
    if abs(point.parameter - first) <= slack:
        return follow(point, ahead, bounds, settings)
    if abs(point.parameter - target) <= slack:
        back = follow(point, -ahead, bounds, settings)
        only = Trace(back.points[:1], endings=(Ending(EndReason.START), Ending(EndReason.START)))
        return back.reversed_before(only)
    point = _beside_turn(point, bounds, settings.newton)
    forward = follow(point, ahead, bounds, settings)
    if forward.closed or forward.interrupted:
        return forward
    back = follow(point, -ahead, bounds, settings)
    # between two folds the curve runs the other way: what matters is where it ends
    assert isinstance(point.curve, MotionProblem)
    name = point.curve.name
    ends = [t.points[-1].orbit for t in (forward, back)]
    misses = [abs((o.omega if name == "omega" else o.values[name]) - target) for o in ends]
    return back.reversed_before(forward) if misses[0] <= misses[1] else forward.reversed_before(back)


def _turning(point: CurvePoint) -> float:
    """How fast the free parameter changes along a curve, in scaled arclength."""
    return abs(float(point.weights[-1] * point.tangent[-1]))


def _beside_turn(point: CurvePoint, bounds: tuple[float, float], newton: NewtonOptions) -> CurvePoint:
    """A point beside one at which the parameter turns: a limit point right where two halves of a curve meet, or on the
    seam of a closed one, lies in neither of them, or in both, once harmonics change.
    """
    if _turning(point) > _TURNS:
        return point
    beside = [point]
    for way in (-_BESIDE, _BESIDE):
        with suppress(ConvergenceError):
            beside.append(replace(point_ahead(point, way, newton), arclength=point.arclength))
    return max((one for one in beside if bounds[0] <= one.parameter <= bounds[1]), key=_turning, default=point)
