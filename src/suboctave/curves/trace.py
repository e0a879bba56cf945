"""How a curve is followed, and what following it gave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.continuation.ending import Ending, EndReason, interruption_of
from suboctave.curves.audit import Audit
from suboctave.curves.events.formulation import BORDERED, Formulation
from suboctave.curves.points import BranchPoint
from suboctave.floquet.methods import StabilityMethod
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.progress import CurveProgress, Report

_REMEDY = "a smaller max_step or more harmonics may settle it, or shooting (so.verify)"


@dataclass(frozen=True)
class Settings:
    """How a curve is followed and what is reported."""

    newton: NewtonOptions
    stepping: SteppingOptions
    stability: StabilityMethod
    events: Sequence[Event] = ()
    observe: int = 0
    formulation: Formulation = BORDERED
    report: CurveProgress | None = None
    #: end at a branch point at which the branch turns back: where it meets the one that it bifurcates from
    half: bool = False

    def reporting_to(
        self, report: Report | None, bounds: tuple[float, float], located: str = "bifurcation"
    ) -> Settings:
        """The same, reporting how far a curve between bounds of its parameter has come; `located`: what is counted."""
        progress = None if report is None else CurveProgress(report, (min(bounds), max(bounds)), located)
        return replace(self, report=progress)


@dataclass(frozen=True)
class Doubt:
    """What is in doubt of a bifurcation that was located: the motion there, and the sentence."""

    orbit: PeriodicOrbit
    text: str


@dataclass
class Trace:
    """What following a curve in one direction gave.

    open
        Motions between its points whose verdict is open.
    endings
        Why it ends at its first and at its last point.
    departs, arrives
        Bifurcations of other branches that it leaves at its beginning and meets at its end.
    """

    points: list[BranchPoint] = field(default_factory=list)
    open: list[BranchPoint] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)
    events: list[Bifurcation] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    doubts: list[Doubt] = field(default_factory=list)
    audit: Audit = field(default_factory=Audit)
    closed: bool = False
    endings: tuple[Ending, Ending] = (Ending(EndReason.START), Ending(EndReason.NOT_STARTED))
    departs: Bifurcation | None = None
    arrives: Bifurcation | None = None

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped in one of its directions before it came to an end."""
        return interruption_of(self.endings) is not None

    @property
    def sentences(self) -> list[str]:
        """What is to be said of it: a stretch in doubt in one line, doubts of bifurcations that are listed."""
        listed = {id(item.orbit) for item in self.bifurcations}
        doubts = (doubt.text for doubt in self.doubts if id(doubt.orbit) in listed)
        stretches = (f"{u}; {_REMEDY}" for u in self.audit.unsettled)
        return [*self.warnings, *doubts, *stretches]

    def ends(self, ending: Ending) -> None:
        """Why it ends at its last point."""
        self.endings = (self.endings[0], ending)

    def reversed_before(self, other: Trace, gap: float | None = None) -> Trace:
        """This trace walked backwards, then `other`, which started from the same point, or a gap beyond it."""
        whole = self.points[-1].arclength
        start = whole + (gap or 0.0)

        def walked(first: list[BranchPoint], second: list[BranchPoint]) -> list[BranchPoint]:
            back = [replace(p, arclength=whole - p.arclength) for p in reversed(first)]
            return back + [replace(p, arclength=start + p.arclength) for p in second]

        def joined(first: list[Bifurcation], second: list[Bifurcation]) -> list[Bifurcation]:
            flipped = [b.seen_backwards(whole - b.arclength) for b in reversed(first)]
            return flipped + [replace(b, arclength=start + b.arclength) for b in second]

        # an event right at the start that both share was met by both
        seam = set() if gap is not None else {event.kind for event in self.events if event.arclength == 0.0}
        events = [event for event in other.events if not (event.arclength == 0.0 and event.kind in seam)]
        return Trace(
            walked(self.points, other.points[1:] if gap is None else other.points),
            walked(self.open, other.open),
            joined(self.bifurcations, other.bifurcations),
            joined(self.events, events),
            self.warnings + other.warnings,
            self.doubts + other.doubts,
            self.audit.reversed_before(other.audit, whole, gap or 0.0),
            other.closed,
            (self.endings[1], other.endings[1]),
            self.arrives,
            other.arrives,
        )

    def settle_end(self, reach: float) -> None:
        """Take back what is in doubt within a distance of the end, where a known bifurcation explains it."""
        whole = self.points[-1].arclength
        kept = tuple(u for u in self.audit.unsettled if u.arclength[0] < whole - reach)
        self.audit = replace(self.audit, unsettled=kept)

    def cut(self, end: float) -> None:
        """Drop what was located beyond an arclength."""
        for items in (self.bifurcations, self.events):
            items[:] = [b for b in items if b.arclength <= end]
        self.open = [p for p in self.open if p.arclength <= end]

    def end_at(self, item: Bifurcation) -> None:
        """Drop what lies behind a bifurcation, which the trace arrives at."""
        self.points = [p for p in self.points if p.arclength < item.arclength] or self.points[:1]
        end = self.points[-1].arclength
        self.cut(item.arclength)
        self.bifurcations = [b for b in self.bifurcations if b.arclength < item.arclength and b is not item]
        self.events = [b for b in self.events if b.arclength < item.arclength]
        self.open = [p for p in self.open if p.arclength < end]
        self.audit = replace(self.audit, unsettled=tuple(u for u in self.audit.unsettled if u.arclength[1] <= end))
        self.closed, self.arrives = False, replace(item, arclength=end)
        name = item.parameter_name
        where = f"{name} = {item.parameter(name):.6g}"
        self.ends(Ending(EndReason.MET_BRANCH, where, f"met the branch that it leaves at the branch point at {where}"))
