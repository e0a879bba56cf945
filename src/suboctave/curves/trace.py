"""How a curve is followed, and what following it gave: its points, its bifurcations, what is in doubt."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.continuation.ending import Ending, EndReason, interruption_of
from suboctave.continuation.notes import Note, lines
from suboctave.curves.events.formulation import BORDERED, Formulation
from suboctave.errors import InputError, suggest
from suboctave.floquet.methods import StabilityMethod
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.lazy import lazy
from suboctave.motion import Motion
from suboctave.progress import CurveProgress, Report


@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class BranchPoint(Motion):
    """One point of a branch: orbit, multipliers, position in scaled arclength, Newton iterations.

    The multipliers are computed when asked for, by `method`, unless they are `known`. `still`: whether the branch's
    parameter stands still along a piece about it, on which a multiplier stays at +1. `curve`: the curve that it is a
    point of, which says what is observed and what decides whether it is stable.
    """

    orbit: PeriodicOrbit
    known: FloquetResult | None
    arclength: float
    iterations: int
    method: StabilityMethod | None = None
    still: bool = field(default=False, kw_only=True)
    curve: Any = field(default=None, kw_only=True)

    @property
    def omega(self) -> float:
        """Circular frequency of the load."""
        return self.orbit.omega

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters of the system by name."""
        return self.orbit.values

    def parameter(self, name: str) -> float:
        """omega or a parameter by name."""
        if name == "omega":
            return self.omega
        if name not in self.parameters:
            raise InputError(f"unknown parameter {name!r}{suggest(name, ['omega', *self.parameters])}")
        return self.parameters[name]

    @property
    def amplitude(self) -> float:
        """Largest |x| over a period of the DOF that its curve observes; of others `point.orbit.amplitude(dof)`."""
        return self.orbit.amplitude(self.orbit.system.observed_dof if self.curve is None else self.curve.observe)

    @property
    def multipliers(self) -> ComplexArray:
        """Floquet multipliers over the motion's own period, (2 N,)."""
        return self.floquet.multipliers

    def __repr__(self) -> str:
        names = [n for n in getattr(self.curve, "names", (getattr(self.curve, "name", "omega"),)) if n != "omega"]
        free = "".join(f", {name}={self.parameter(name):.9g}" for name in names)
        return f"<point at omega={self.omega:.9g}{free}, amplitude={self.amplitude:.7g}>"

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers and their errors."""
        if self.known is not None:
            return self.known
        assert self.method is not None
        return self.method.along(self.orbit.state())


@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class TrackedPoint(BranchPoint):
    """One point of a tracked curve: a branch point with the extra unknown and the coefficient of its normal form.

    `extra` is kappa at an NS, the instant tau in (0, 2 pi) at a grazing, zeta of a mode, else 0; `coefficient` the one
    that decides the normal form of an LP (a) or a PD (c3), else nan; `extreme` and `isola` say on a curve of extrema of
    which nature they are (`TrackedEvent`).
    """

    extra: float = 0.0
    coefficient: float = float("nan")
    extreme: str = ""
    isola: str = ""


Bound = TypeVar("Bound", bound=BranchPoint)


def bound(point: Bound, curve: Any) -> Bound:
    """The same as a point of a curve; every point of every curve passes here."""
    copied: Bound = object.__new__(type(point))
    copied.__dict__.update(point.__dict__, curve=curve)
    return copied


#: scaled arclength up to which two stretches in doubt are at one place of the branch: a share of a usual step
PLACE = 0.01


@dataclass(frozen=True)
class Unsettled:
    """A stretch of a branch in which something may have happened that is not in the list.

    Attributes
    ----------
    parameter, first, last
        Name of the free parameter and its values at the two ends, in the order of the branch.
    arclength
        The two ends in scaled arclength along the branch.
    reason
        What is in doubt, as the rest of a sentence.
    """

    parameter: str
    first: float
    last: float
    arclength: tuple[float, float]
    reason: str

    @property
    def length(self) -> float:
        """Length in scaled arclength."""
        return self.arclength[1] - self.arclength[0]

    def __str__(self) -> str:
        return f"between {self.parameter} = {self.first:.9g} and {self.last:.9g} {self.reason}"


def joined(stretches: Iterable[Unsettled]) -> list[Unsettled]:
    """Stretches in the order of the branch, those at one place as one: what overlaps, or lies no farther apart than
    PLACE or than the longer of two is long.
    """
    result: list[Unsettled] = []
    for item in sorted(stretches, key=lambda u: u.arclength):
        last = result[-1] if result else None
        if last is None or item.arclength[0] - last.arclength[1] > max(PLACE, last.length, item.length):
            result.append(item)
            continue
        known = set(last.reason.split("; "))
        reasons = "; ".join([last.reason, *(one for one in item.reason.split("; ") if one not in known)])
        end = max(last, item, key=lambda u: u.arclength[1])
        result[-1] = replace(last, last=end.last, arclength=(last.arclength[0], end.arclength[1]), reason=reasons)
    return result


def stretches_in_doubt(stretches: Iterable[Unsettled], remedy: str) -> list[Note]:
    """A note for each reason of each stretch."""
    return [
        Note(f"{reason}. {remedy}", u.parameter, u.first, u.last) for u in stretches for reason in u.reason.split("; ")
    ]


@dataclass(frozen=True)
class Audit:
    """How a branch was searched for bifurcations.

    Neighbouring motions at which all test functions are known bound an interval. An interval counts as settled if the
    test functions, with what they do at its ends and beside it, cannot have vanished unseen inside.

    Attributes
    ----------
    finest, longest
        Shortest and longest interval that was settled, in scaled arclength: two events closer together than the
        former cannot be told apart, and what passes within less than the latter without leaving a trace in any test
        function beside it is not seen.
    probes
        Motions solved for between neighbouring points to settle a step; those that were needed to separate events are
        points of the branch.
    refused
        Steps taken again, shorter, because they may have jumped to another curve.
    unsettled
        Stretches that stayed in doubt.
    """

    finest: float = math.inf
    longest: float = 0.0
    probes: int = 0
    refused: int = 0
    unsettled: tuple[Unsettled, ...] = ()

    @property
    def complete(self) -> bool:
        """True if nothing is in doubt."""
        return not self.unsettled

    def in_doubt(self, *stretches: Unsettled) -> Audit:
        """This audit with more stretches in doubt."""
        return replace(self, unsettled=tuple(joined((*self.unsettled, *stretches))))

    def reversed_before(self, other: Audit, whole: float, gap: float = 0.0) -> Audit:
        """This audit's stretch, of length `whole`, walked backwards, and then, beyond a gap, that of `other`."""
        start = whole + gap
        back = [
            replace(u, first=u.last, last=u.first, arclength=(whole - u.arclength[1], whole - u.arclength[0]))
            for u in reversed(self.unsettled)
        ]
        on = [replace(u, arclength=(start + u.arclength[0], start + u.arclength[1])) for u in other.unsettled]
        return Audit(
            min(self.finest, other.finest),
            max(self.longest, other.longest),
            self.probes + other.probes,
            self.refused + other.refused,
            (*back, *on),
        )

    def __repr__(self) -> str:
        if self.longest == 0.0:
            return "Audit: no interval examined"
        text = (
            f"Audit: {self.probes} probes between points, {self.refused} steps refused; intervals from "
            f"{self.finest:.1e} to {self.longest:.1e} of arclength; "
        )
        if self.complete:
            return text + "nothing unsettled"
        return text + "\n  ".join([f"{len(self.unsettled)} unsettled:", *map(str, self.unsettled)])


_REMEDY = "Use more harmonics, a smaller max_step, or so.verify"


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
class CurveDescription:
    """What a curve is: its free parameters, the kind of its motions, of extrema the parameter that turns, and the DOF
    that is observed.
    """

    names: tuple[str, ...]
    kind: str
    turning: str
    observe: int


@dataclass
class Trace:
    """What following a curve in one direction gave.

    open
        Motions between its points whose verdict is open.
    doubts
        Of located bifurcations: the motion there, and a note.
    endings
        Why it ends at its first and at its last point.
    departs, arrives
        Bifurcations of other branches that it leaves at its beginning and meets at its end.
    of
        What the curve is.
    """

    points: list[BranchPoint] = field(default_factory=list)
    open: list[BranchPoint] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)
    events: list[Bifurcation] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    doubts: list[tuple[PeriodicOrbit, Note]] = field(default_factory=list)
    audit: Audit = field(default_factory=Audit)
    closed: bool = False
    endings: tuple[Ending, Ending] = (Ending(EndReason.START), Ending(EndReason.NOT_STARTED))
    departs: Bifurcation | None = None
    arrives: Bifurcation | None = None
    of: CurveDescription | None = None

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped in one of its directions before it came to an end."""
        return interruption_of(self.endings) is not None

    @property
    def open_questions(self) -> list[str]:
        """Its notes, those on bifurcations that are listed, and stretches in doubt, in a line for each cause."""
        listed = {id(item.orbit) for item in self.bifurcations}
        doubts = [note for orbit, note in self.doubts if id(orbit) in listed]
        return lines([*self.notes, *doubts, *stretches_in_doubt(self.audit.unsettled, _REMEDY)])

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
            self.notes + other.notes,
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
        self.bifurcations = [b for b in self.bifurcations if b.arclength < item.arclength]
        self.events = [b for b in self.events if b.arclength < item.arclength]
        self.open = [p for p in self.open if p.arclength < end]
        self.audit = replace(self.audit, unsettled=tuple(u for u in self.audit.unsettled if u.arclength[1] <= end))
        self.closed, self.arrives = False, replace(item, arclength=end)
        where = f"{item.parameter_name} = {item.parameter(item.parameter_name):.6g}"
        self.ends(
            Ending(EndReason.MET_BRANCH, where, f"reached the branch that it leaves, at the branch point at {where}")
        )
