"""Following a curve of bifurcations in two parameters: points, events, until it ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suboctave.continuation import CurvePoint, March
from suboctave.continuation.ending import Ending, EndReason
from suboctave.continuation.linear import cosine, distance, length
from suboctave.continuation.notes import Note
from suboctave.continuation.point import solved_again
from suboctave.curves.corners import beyond_corner, grazes
from suboctave.curves.driver import Driver
from suboctave.curves.junction import keeps_subharmonics
from suboctave.curves.measures import bounded
from suboctave.curves.motion import CRITICAL_EVERY, MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.trace import Settings, Trace, TrackedPoint
from suboctave.curves.tracked.ends import (
    End,
    comes_close,
    end_ahead,
    end_between,
    is_lopsided,
    points_before,
    rebased,
    vanished,
)
from suboctave.curves.tracked.events import LocatedEvent, as_event, events_between, noted, refined
from suboctave.curves.tracked.start import Ranges
from suboctave.curves.tracked.tests import Extremum, stands, tests_of
from suboctave.curves.tracked.watch import StepWatch
from suboctave.errors import ConvergenceError

#: range of a parameter that is not bounded
_ANY = (-math.inf, math.inf)
#: steps longer than this, in scaled arclength, must not change the curve's orientation
_JUMP = 2e-6
#: growth of motions from that at the start after which they may grow for ever
_GROWN = 1e4
#: growth of the frequency and of motions, and speed of the parameters that have a range in scaled arclength, at which
#: they do, too
_FASTER, _LARGER, _HARDLY = 1e3, 10.0, 1e-3
#: steps that need not come closer to the end of an NS curve
_NEAR_END = 1e-3
#: way before a corner, in scaled arclength, on which what turns there, or comes to it, is not told from it
_CORNER = 1e-5
#: distance of the multipliers from the critical one at which a point is doubtful; points in succession at which it is,
#: beside multipliers so large that it cannot be told, after which a curve ends
_DOUBTFUL, _UNTOLD, _VIOLENT = 0.05, 3, 1e4


def follow_tracked(start: CurvePoint, ranges: Ranges, settings: Settings) -> Trace:
    """Follow a curve from a solved start along the start's own tangent; KeyboardInterrupt ends it politely."""
    return _Tracker(start, ranges, settings).run()


class _Tracker(Driver):
    def __init__(self, start: CurvePoint, ranges: Ranges, settings: Settings) -> None:
        assert isinstance(start.curve, MotionProblem)
        super().__init__(settings)
        self.lopsided = is_lopsided(Sample(start))
        #: the first point, headed as the curve leaves it
        self.home: CurvePoint | None = None
        self.bounds = ranges.get(start.curve.name, _ANY)
        #: ranges of the parameters but the last, and of what is measured
        self.others = [
            bounded(start.curve, name, ends, settings.observe)
            for name, ends in ranges.items()
            if name != start.curve.name
        ]
        self.march = self._marching(start)
        self.tests = tests_of(start.curve)
        self.watch = StepWatch(self.tests, settings.newton)
        #: the end of the step that was looked at last
        self._candidate: Sample | None = None
        #: points from which corners were passed
        self.corners: list[CurvePoint] = []
        #: how many points have known multipliers, and where none of these is the critical one
        self.compared = 0
        self.doubtful: list[str] = []
        #: how many of the last of these in succession, with others that are large
        self.untold = 0

    def _marching(self, start: CurvePoint) -> March:
        """Along the tangent of a point; closed where it comes back to the first one."""
        options = (self.settings.newton, self.settings.stepping, self._clear)
        return March(start, 0.0, self.bounds, *options, corner=grazes, home=self.home, others=self.others)

    def _walk(self) -> None:
        trace = self.trace
        while True:
            stop = next((stop for point in self.march if (stop := self._accept(point)) is not None), None)
            ending = stop or self.march.ending
            trace.ends(ending)
            beyond = self._beyond_corner() if ending.reason is EndReason.STEP_TOO_SMALL else None
            if beyond is None:
                break
            self.march = self._marching(beyond)
        trace.closed = self.march.closed
        if self.doubtful:
            share = f"{len(self.doubtful)} of {self.compared} points, the first at {self.doubtful[0]}"
            text = f"the critical multiplier is off by more than {_DOUBTFUL:g}. Use more harmonics or a shorter range"
            trace.notes.append(Note(text, where=share))

    def _finish(self) -> None:
        self.trace.bifurcations.sort(key=lambda event: event.arclength)

    def _beyond_corner(self) -> CurvePoint | None:
        """A point behind a corner that the steps could not get around, None if there is none."""
        last = self.previous
        # once each way: a second time the curve has gone astray
        if last is None or any(_same(last.point, known) for known in self.corners):
            return None
        self.corners.append(last.point)
        before = (p.orbit for p in reversed(self.trace.points))
        corner = beyond_corner(last, before, self.settings.newton)
        if corner is None:
            return None
        point, note = corner
        self.trace.notes.append(note)
        if point is None or not all(bounds.low <= bounds.value(point) <= bounds.high for bounds in self.others):
            return None
        self._turn_at_corner(last, point)
        return point

    def _turn_at_corner(self, last: Sample, beyond: CurvePoint) -> None:
        """Parameters that run the other way behind a corner have an extremum in it, known as well as the corner is.

        It stands for whatever turns on the last steps into it, where nothing tells one turn from another: what turned
        there an odd number of times turned once.
        """
        middle = 0.5 * (last.point.arclength + beyond.arclength)
        events = self.trace.bifurcations
        beside = [e for e in events if e.kind in ("extremum", "CP") and middle - e.arclength <= _CORNER]
        events[:] = [e for e in events if not any(e is known for known in beside)]
        for test in self.tests:
            if not isinstance(test, Extremum):
                continue
            i = last.curve.index(test.name)
            turned = [e for e in beside if e.kind == test.kind and e.parameter_name == test.name]
            turns = last.point.tangent[i] * beyond.tangent[i] < 0.0
            if turns == bool(len(turned) % 2):
                continue
            if turned and not turns:
                events.append(turned[-1])
                continue
            turn = LocatedEvent(test, last, test.extreme(test.value(last), last))
            event = as_event(turn, self.settings.stability, self.settings.observe)
            width = abs(float(beyond.u[i] - last.point.u[i]))
            events.append(replace(event, isola="", uncertainty=width, arclength=middle))

    def _clear(self, a: CurvePoint, b: CurvePoint) -> bool:
        """True if a step stays on its curve."""
        way = b.arclength - a.arclength
        assert isinstance(b.curve, MotionProblem)
        free = b.curve.augmentation.free_phase
        old, new = Sample(a), Sample(b)
        if b.orientation != a.orientation and way > _JUMP and not (free and self._crossed(new)):
            return False
        if way > _NEAR_END and not comes_close(old, new):
            return False
        if not (keeps_subharmonics(a, b) or (free and vanished(old, new))):
            return False
        last = self.previous
        if last is None or last.place != a.arclength:
            return True
        self._candidate = new
        return not self.watch.refuses(last, new)

    def _crossed(self, b: Sample) -> bool:
        """Whether the orientation has changed since the last point because another curve crosses there, or because
        motions shrink to nothing; else the step has gone over to another curve, or back.
        """
        a = self.previous
        return a is None or vanished(a, b) or self.watch.crossing(a, b) is not None

    def _accept(self, point: CurvePoint) -> Ending | None:
        """Take a point in; why the curve ends there or before it, if it does."""
        settings, known = self.settings, self._candidate
        new = known if known is not None and known.point is point else Sample(point)
        self.home = self.home or point
        if self.previous is not None:
            # by now the choice of harmonics has asked for what it needs
            self._note_doubt(self.previous)
            if self.untold >= _UNTOLD:
                largest = np.abs(self.previous.evaluation.floquet.multipliers).max()
                where = self.previous.where
                detail = (
                    f"the critical multiplier is lost at {where}, among others of up to {largest:.0e}: the motions are "
                    "too unstable. Use a shorter range"
                )
                return Ending(EndReason.NO_MEANING, where, detail)
        if self.previous is None or point is self.march.start:
            # beyond a corner nothing leads on from what lies behind
            self.watch.forget()
            self._add(new)
            self.previous = new
            return None
        if self.march.closed:
            new = self._closing(self.previous, new)
        a = self.previous
        end = end_between(a, new, settings.newton, self.lopsided)
        if end is not None:
            self._take_end(a, end)
            return Ending(EndReason.MOTIONS_END, detail=end.reason)
        new = self._smooth(a, new)
        self._take(self.watch.passed(a, new, self.trace.notes))
        if self.watch.over_corner(a, new):
            self._turn_at_corner(a, new.point)
        self._add(new)
        self.previous = new
        self._report(point)
        if self._grows(new):
            detail = f"the motions grow without bound at {new.where}, at constant parameters"
            return Ending(EndReason.NO_MEANING, new.where, detail)
        ahead = None if self.march.ending.reason is not EndReason.NOT_STARTED else end_ahead(a, new, settings.newton)
        if ahead is None:
            return None
        self._take_end(new, ahead)
        return Ending(EndReason.MOTIONS_END, detail=ahead.reason)

    def _grows(self, sample: Sample) -> bool:
        """Whether motions without a load have grown by orders of magnitude where the parameters stand still, or become
        faster by orders of magnitude where those with a range hardly move.
        """
        assert self.home is not None
        curve, first, point = sample.curve, self.home, sample.point
        if not curve.augmentation.free_phase:
            return False
        growth = curve.size(point.u) / (first.curve.size(first.u) or 1.0)
        if growth > _GROWN and all(stands(sample, name) for name in curve.names):
            return True
        bounded = [curve.index(name) for name in curve.names if name not in curve.unbounded]
        if not bounded or growth < _LARGER or sample.state.omega < _FASTER * Sample(first).state.omega:
            return False
        return bool(np.all(np.abs(point.weights * point.tangent)[bounded] < _HARDLY))

    def _take(self, events: list[LocatedEvent]) -> None:
        settings, notes = self.settings, self.trace.notes
        for item in events:
            better = refined(item, settings.newton, notes)
            if not better.test.confirmed(better.sample):
                text = "left out: its pair of multipliers is not confirmed by the monodromy matrix. Use more harmonics"
                notes.append(noted(better.test.kind, better.sample, text))
                continue
            self.trace.bifurcations.append(as_event(better, settings.stability, settings.observe))

    def _add(self, sample: Sample) -> None:
        method, point = self.settings.stability, sample.point
        follows, none = method.follows_monodromy, sample.curve.augmentation.no_multipliers
        known = sample.evaluation.floquet if none else sample.evaluation.known_floquet if follows else None
        extra = sample.instant_or_frequency, sample.coefficient, sample.extreme, sample.isola
        self.trace.points.append(TrackedPoint(sample.orbit, known, point.arclength, point.iterations, method, *extra))

    def _note_doubt(self, sample: Sample) -> None:
        """Whether the critical multiplier is one of the monodromy matrix, where that is known and now and then."""
        evaluation = sample.evaluation
        known = evaluation.known_floquet is not None or sample.curve.steps % CRITICAL_EVERY == 0
        if known and evaluation.critical is not None:
            self.compared += 1
            doubtful = evaluation.doubt > _DOUBTFUL
            if doubtful:
                self.doubtful.append(sample.where)
            violent = np.abs(evaluation.floquet.multipliers).max() > _VIOLENT
            self.untold = self.untold + 1 if doubtful and violent else 0

    def _take_end(self, a: Sample, end: End) -> None:
        settings = self.settings
        for b in points_before(end, a, settings.newton):
            self._take(events_between([a, b], self.tests, settings.newton, self.trace.notes))
            self._add(b)
            a = b
        arclength = a.point.arclength + end.way(a)
        if end.hopf is not None:
            size = end.hopf.orbit.amplitude(settings.observe)
            self.trace.bifurcations.append(replace(end.hopf, amplitude=size, arclength=arclength))
        if end.event is not None:
            event = refined(end.event, settings.newton, self.trace.notes)
            item = as_event(event, settings.stability, settings.observe)
            curve = a.curve.augmentation.name
            self.trace.bifurcations.append(replace(item, arclength=arclength, curve=curve))
            if end.last:
                orbit = rebased(item.orbit, a)
                kappa = 0.5 * orbit.omega / orbit.basis.nu if event.test.kind == "R2" else 0.0
                self.trace.points.append(TrackedPoint(orbit, None, arclength, 0, settings.stability, kappa))

    def _closing(self, a: Sample, back: Sample) -> Sample:
        """The first point again, with the bordering vectors of the last."""
        curve = a.curve.adapted(a.point.u, a.evaluation).with_basis(back.curve.balance.basis)
        try:
            return Sample(solved_again(back.point, curve, back.point.weights, self.settings.newton))
        except ConvergenceError:
            return back

    def _smooth(self, a: Sample, b: Sample) -> Sample:
        """The second of two neighbours with the direction in which the curve comes to it.

        On the end of a range a coefficient may have a corner (a gap that is just closed): derivatives there may be
        those of the far side. Behind a corner that is passed they are.
        """
        if self.watch.grazes(a, b):
            return b
        point, angle = b.point, self.settings.stepping.sharpest
        if cosine(b.curve.transfer(a.point.tangent, a.curve), point.tangent, point.weights) > math.cos(angle):
            return b
        chord = point.u - b.curve.transfer(a.point.u, a.curve)
        return Sample(replace(point, tangent=chord / length(point.weights * chord)))


def _same(a: CurvePoint, b: CurvePoint) -> bool:
    """Whether two points of a curve lie at one place and head the same way."""
    other, heading = (a.curve.transfer(vector, b.curve) for vector in (b.u, b.tangent))
    return distance(a.u, other, a.weights) < _CORNER and cosine(a.tangent, heading, a.weights) > 0.0
