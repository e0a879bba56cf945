"""What follows a curve, of whatever kind: it takes in the points of a march until the curve ends."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.continuation import CurvePoint, March
from suboctave.continuation.ending import Ending
from suboctave.curves.identity import relation
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.trace import Settings, Trace
from suboctave.interruption import Interruption

#: amplitude, unit of length, up to which a motion is rest here: that of located branch points of rest is rounding
_NOTHING = 1e-12


class Driver(ABC):
    """Follows a curve in one direction; KeyboardInterrupt ends it politely."""

    march: March

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.trace = Trace()
        #: the last sample taken in
        self.previous: Sample | None = None

    @abstractmethod
    def _walk(self) -> None:
        """Take in points until the curve ends."""

    @abstractmethod
    def _finish(self) -> None:
        """Complete the trace of a curve that has come to an end or was interrupted."""

    def _interrupted(self) -> None:  # noqa: B027 - nothing as a rule
        """Drop what belongs to the step that was under way."""

    def run(self) -> Trace:
        """What following the curve gives."""
        trace = self.trace
        if self.settings.report is not None:
            self.settings.report.begins()
        try:
            self._walk()
        except KeyboardInterrupt as cause:
            self._interrupted()
            where = self.previous.where if self.previous else "the start"
            trace.ends(Ending.stopped(Interruption.of(cause), where))
        self._finish()
        if trace.closed:
            _drop_seam(trace.bifurcations)
            _drop_seam(trace.events)
        return trace

    def _report(self, point: CurvePoint) -> None:
        if self.settings.report is None:
            return
        curve, trace = point.curve, self.trace
        assert isinstance(curve, MotionProblem)
        basis, located = curve.balance.basis, sum(b.kind not in CONTACT_KINDS for b in trace.bifurcations)
        numbers = len(trace.points), located, basis.harmonics // basis.nu
        self.settings.report.at(point.parameter, curve.where(point.u), *numbers)


def same_event(a: Bifurcation, b: Bifurcation) -> bool:
    """Whether two located bifurcations are one, met twice."""
    if (a.kind, a.parameter_name) != (b.kind, b.parameter_name):
        return False
    if a.kind == "grazing" and _element(a) != _element(b):
        return False
    same_place = all(np.isclose(a.parameter(name), b.parameter(name), rtol=1e-9) for name in a.free_names)
    if not (same_place and np.isclose(a.amplitude, b.amplitude, rtol=1e-6)):
        return False
    # the mirror image of a motion has its amplitude; at rest there is nothing to compare
    return max(a.amplitude, b.amplitude) <= _NOTHING or relation(a.orbit, b.orbit).one


def _element(item: Bifurcation) -> int | None:
    return None if item.contact is None else item.contact.element


def _drop_seam(items: list[Bifurcation]) -> None:
    """What lies on the seam of a closed curve is met at both ends: keep the first."""
    # several contacts may graze at once
    while len(items) > 1 and any(same_event(items[-1], first) for first in items[: min(3, len(items) - 1)]):
        items.pop()
