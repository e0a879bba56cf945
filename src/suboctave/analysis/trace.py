"""How a curve is followed, and what following it gave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from suboctave.analysis.audit import Audit
from suboctave.analysis.branch import BranchPoint
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.formulation import BORDERED, Formulation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.stability import StabilityMethod

__all__ = ["Settings", "Trace"]


@dataclass(frozen=True)
class Settings:
    """How a curve is followed and what is reported."""

    newton: NewtonOptions
    stepping: SteppingOptions
    stability: StabilityMethod
    events: Sequence[Event] = ()
    observe: int = 0
    formulation: Formulation = BORDERED
    report: Callable[[float, str], None] | None = None
    #: end at a branch point at which the branch turns back: where it meets the one that it bifurcates from
    half: bool = False


@dataclass
class Trace:
    """What following a curve in one direction gave.

    open
        Motions between its points whose verdict is open.
    departs, arrives
        Bifurcations of other branches that it leaves at its beginning and meets at its end.
    """

    points: list[BranchPoint] = field(default_factory=list)
    open: list[BranchPoint] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)
    events: list[Bifurcation] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    audit: Audit = field(default_factory=Audit)
    closed: bool = False
    ended: str = ""
    interrupted: bool = False
    departs: Bifurcation | None = None
    arrives: Bifurcation | None = None

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

        return Trace(
            walked(self.points, other.points[1:] if gap is None else other.points),
            walked(self.open, other.open),
            joined(self.bifurcations, other.bifurcations),
            joined(self.events, other.events),
            self.warnings + other.warnings,
            self.audit.reversed_before(other.audit, whole, gap or 0.0),
            other.closed,
            other.ended if self.ended == other.ended else f"{self.ended} in one direction, {other.ended} in the other",
            self.interrupted or other.interrupted,
            self.arrives,
            other.arrives,
        )

    def settle_end(self, reach: float) -> None:
        """Take back what is in doubt within a distance of the end, where a known bifurcation explains it."""
        whole = self.points[-1].arclength
        explained = [u for u in self.audit.unsettled if u.arclength[0] >= whole - reach]
        self.warnings = [w for w in self.warnings if not any(w.startswith(str(u)) for u in explained)]
        self.audit = replace(self.audit, unsettled=tuple(u for u in self.audit.unsettled if u not in explained))

    def end_at(self, item: Bifurcation) -> None:
        """Drop what lies behind a bifurcation, which the trace arrives at."""
        self.points = [p for p in self.points if p.arclength < item.arclength] or self.points[:1]
        end = self.points[-1].arclength
        for items in (self.bifurcations, self.events):
            items[:] = [b for b in items if b.arclength < item.arclength and b is not item]
        self.open = [p for p in self.open if p.arclength < end]
        self.audit = replace(self.audit, unsettled=tuple(u for u in self.audit.unsettled if u.arclength[1] <= end))
        self.closed, self.arrives = False, item
        name = item.parameter_name
        self.ended = f"met the branch that it leaves at the branch point at {name} = {item.parameter(name):.6g}"
