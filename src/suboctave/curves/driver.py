"""Following a curve, of whatever kind, until it ends or is interrupted."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from suboctave.bifurcation.bifurcation import CONTACT_KINDS
from suboctave.continuation import CurvePoint, March
from suboctave.continuation.ending import Ending, EndReason
from suboctave.curves.identity import drop_seam
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.trace import CurveDescription, Settings, Trace
from suboctave.errors import ConvergenceError, NotFiniteError
from suboctave.interruption import Interruption


class Driver(ABC):
    """Follows a curve in one direction; KeyboardInterrupt ends it politely."""

    march: March

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.trace = Trace()
        #: the last sample taken in
        self.previous: Sample | None = None
        #: somebody who keeps the curve so far (`progress.reporting`)
        self._keeper: Callable[[Trace], None] | None = None
        if settings.report is not None:
            self._keeper = getattr(settings.report.report, "followed", None)

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
        except ConvergenceError as failure:
            if self.previous is None:
                raise
            self._interrupted()
            reason = EndReason.NOT_FINITE if isinstance(failure, NotFiniteError) else EndReason.FAILED
            trace.ends(Ending(reason, self.previous.where, str(failure)))
        self._finish()
        if trace.closed:
            drop_seam(trace.bifurcations)
            drop_seam(trace.events)
        return trace

    def _report(self, point: CurvePoint) -> None:
        if self.settings.report is None:
            return
        curve, trace = point.curve, self.trace
        assert isinstance(curve, MotionProblem)
        basis, located = curve.balance.basis, sum(b.kind not in CONTACT_KINDS for b in trace.bifurcations)
        numbers = len(trace.points), located, basis.harmonics // basis.nu
        self.settings.report.at(point.parameter, curve.where(point.u), *numbers)
        if self._keeper is not None and trace.points:
            kind = curve.augmentation
            trace.of = CurveDescription(curve.names, kind.name, kind.turning, self.settings.observe)
            self._keeper(trace)
