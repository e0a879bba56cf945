"""What a verb follows, and the branch that comes of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from suboctave.analysis.options import options_of
from suboctave.continuation import CurvePoint
from suboctave.continuation.linear import one_thread
from suboctave.curves.discretisation import Harmonics, make_curve
from suboctave.curves.follow import both_ways, follow
from suboctave.curves.junction import Junction
from suboctave.curves.motion import MotionProblem
from suboctave.curves.starts import linear_response
from suboctave.curves.trace import Settings, Trace
from suboctave.curves.verdicts import with_verdicts
from suboctave.harmonic.linear_part import LinearPart
from suboctave.model.system import System
from suboctave.progress import reporting
from suboctave.results.branch import Branch

__all__ = ["CurveRun"]


@dataclass(frozen=True)
class CurveRun:
    """Motions of a system over a range of one parameter, from the first to the last value, and how they are followed.

    All of it is checked before; `harmonics` as given.
    """

    system: System
    name: str
    ends: tuple[float, float]
    harmonics: Harmonics
    settings: Settings

    @property
    def bounds(self) -> tuple[float, float]:
        """The range, ascending."""
        return min(self.ends), max(self.ends)

    @property
    def ahead(self) -> float:
        """The direction in which the parameter runs: +1 or -1, 0 where the range is a point."""
        first, last = self.ends
        return float(last > first) - float(last < first)

    def curve(self, omega: float, nu: int, linear: LinearPart | None) -> MotionProblem:
        """The motions of `nu` load periods; `omega` where that is not free."""
        low, high = self.bounds
        return make_curve(self.system, self.name, omega, high - low, self.harmonics, nu, linear)

    def scaled(self, curve: MotionProblem) -> MotionProblem:
        """The curve in units of the larger one of the linear responses at both ends."""
        curve.reference = max(curve.size(linear_response(curve, value)) for value in self.ends)
        return curve

    @contextmanager
    def reporting(self, progress: Any, title: str) -> Iterator[CurveRun]:
        """The same, reporting how far it has come; one thread of linear algebra within."""
        with one_thread(), reporting(progress, title) as report:
            yield replace(self, settings=self.settings.reporting_to(report, self.ends))

    def report(self, share: float, where: str) -> None:
        """Report a share of the work where that is not measured by the parameter."""
        if self.settings.report is not None:
            self.settings.report.report(share, where)

    def follow(self, start: CurvePoint) -> Trace:
        """The curve from a point at the first value on."""
        return follow(start, self.ahead, self.bounds, self.settings)

    def both_ways(self, start: CurvePoint) -> Trace:
        """The curve to both sides of a point."""
        return both_ways(start, self.ahead, self.bounds, self.settings)

    def branch(self, trace: Trace) -> Branch:
        """What was followed as a branch, with what it was computed with."""
        options = options_of(self.settings, self.harmonics, {self.name: self.ends})
        with one_thread():
            trace = with_verdicts(trace, self.settings.stability, self.name)
        context = {"system": self.system, "parameter": self.name, **options}
        bifurcations, events = (
            [replace(b, context=context) for b in items] for items in (trace.bifurcations, trace.events)
        )
        return Branch(
            self.system,
            self.name,
            trace.points,
            bifurcations,
            events,
            trace.closed,
            trace.endings,
            self.settings.observe,
            options,
            tuple(trace.sentences),
            trace.audit,
            None if trace.departs is None else Junction.of(trace.departs),
            None if trace.arrives is None else Junction.of(trace.arrives),
        )
