"""Options of the verbs that follow curves: declared once, checked, and inherited from a bifurcation.

`TypedDict`s declare them for the verbs (`suboctave.options`); `settings_of` checks them and gives the `Settings` that a
curve is followed with; `options_of` is what a result keeps of these, and `Inherited` reads that again.

What a verb follows, and the branch that comes of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, TypeVar, cast, get_type_hints

from suboctave.arguments import Positive
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import one_thread
from suboctave.continuation.notes import Note
from suboctave.curves.events.formulation import FORMULATIONS, Formulation, formulation_of, written
from suboctave.curves.junction import Junction
from suboctave.curves.motion import MotionProblem
from suboctave.curves.starts import Harmonics, bounded_response, make_curve
from suboctave.curves.trace import Settings, Trace
from suboctave.curves.verdicts import with_verdicts
from suboctave.errors import InputError, is_number, shortened
from suboctave.floquet.methods import METHODS, StabilityMethod, method_of
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS
from suboctave.model.inputs import observed_dof
from suboctave.model.system import System
from suboctave.options import ParallelOptions, RunOptions
from suboctave.progress import reporting
from suboctave.results.branch import Branch

#: truncation estimate from which a fixed number of harmonics is said to be too small: peaks are wrong by per cents
_FEW = 1e-2
#: how many times as many are proposed then: what harmonics leave out of a motion with contacts falls like their cube
_MORE = 3


class SearchOptions(RunOptions, total=False):
    """Options of all verbs that follow curves, searches over a design parameter among them."""

    max_step: Annotated[
        Positive | None,
        "Largest distance between neighbours in scaled arclength (short for `stepping=SteppingOptions(max_step=...)`).",
    ]
    observe: Annotated[
        int | str | None, "DOF whose amplitude is reported, by its number or name; default the first loaded one."
    ]
    newton: Annotated[NewtonOptions | None, "Tolerances and iterations of Newton's method."]
    stepping: Annotated[SteppingOptions | None, "Step lengths, and the largest number of points."]
    stability: Annotated[
        StabilityMethod | str | None,
        "How the multipliers of points and bifurcations are computed: `Monodromy()`, `Hill()`, or their names "
        '"monodromy", "hill". Default: the monodromy matrix, and where a verdict is open the roots of Hill\'s '
        "determinant beside it (`Arbitration()`). Where the method is not applicable the monodromy matrix stands in, "
        "and the branch says so.",
    ]


class DesignOptions(SearchOptions, ParallelOptions, total=False):
    """Options of searches over a design parameter."""


class TrackOptions(SearchOptions, total=False):
    """Options of verbs that locate bifurcations by a formulation of the user's choice."""

    formulation: Annotated[
        Formulation | str | None,
        'By which system bifurcations are located: "bordered" (default), "extended", or "alcorta2019", the published '
        "formulation of period doublings with its own test functions; or `BorderedSystem()`, `ExtendedSystem()`, "
        '`Alcorta2019(test="multiplier")`, where test may be "determinant". All find the same bifurcations, the last '
        "only those that its test shows: what it misses is in the branch's warnings.",
    ]


class CurveOptions(TrackOptions, total=False):
    """Options of verbs that follow a branch of periodic motions."""

    events: Annotated[Event | Sequence[Event] | None, "User's events, located along the branch."]


Options = TypeVar("Options", bound=SearchOptions)


def handed_on(options: Options) -> Options:
    """The options of a search that are those of each of its curves: all but progress, time limit and workers."""
    own = get_type_hints(ParallelOptions)
    return cast("Options", {name: value for name, value in options.items() if name not in own})


def settings_of(system: System, options: Mapping[str, Any]) -> Settings:
    """The options of a verb, checked; raises InputError."""
    stepping = options.get("stepping") or SteppingOptions()
    max_step = options.get("max_step")
    if max_step is not None:
        if not (is_number(max_step) and max_step > 0.0):  # of a step in a study file, which is checked before it runs
            raise InputError(f"max_step must be a positive number, not {shortened(max_step)}")
        if max_step <= stepping.min_step:
            raise InputError(f"max_step={max_step:g} is below the smallest step that is taken, {stepping.min_step:g}")
        stepping = replace(stepping, max_step=float(max_step), initial_step=min(stepping.initial_step, float(max_step)))
    return Settings(
        options.get("newton") or NewtonOptions(),
        stepping,
        method_of(options.get("stability")),
        _events(options.get("events")),
        observed_dof(system, options.get("observe")),
        formulation_of(options.get("formulation")),
    )


def _events(given: Event | Sequence[Event] | None) -> tuple[Event, ...]:
    events = () if given is None else (given,) if isinstance(given, Event) else tuple(given)
    if len({e.name for e in events}) < len(events):
        raise InputError("two events have the same name")
    for event in events:
        if event.name in KINDS:
            raise InputError(f"an event cannot be called {event.name!r}: that is the name of a kind of bifurcation")
    return events


# ------------------------------------------------------------------------------------------------ what a result keeps
def options_of(settings: Settings, harmonics: Harmonics, bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """How a branch was computed."""
    method = settings.stability
    return {
        "bounds": dict(bounds),
        "harmonics": asdict(harmonics) if isinstance(harmonics, AdaptiveHarmonics) else harmonics,
        "newton": asdict(settings.newton),
        "stepping": asdict(settings.stepping),
        # by the name that gives it again, or in full
        "stability": method.name if METHODS.get(method.name) == method else repr(method),
        "formulation": written(settings.formulation),
        "observe": settings.observe,
    }


class Inherited:
    """How a bifurcation was computed: range, harmonics and options, as far as they are known."""

    def __init__(self, item: Bifurcation) -> None:
        self.item = item
        self.known: Mapping[str, Any] = item.context or {}

    def range(self, name: str) -> tuple[float, float] | None:
        """The range of a free parameter, None where it is not known."""
        known = self.known.get("bounds", {}).get(name)
        return None if known is None else (known[0], known[1])

    def bounds(self, name: str) -> tuple[float, float]:
        """The range of a free parameter; InputError where it is not known."""
        known = self.range(name)
        if known is None:
            raise InputError(f"this {self.item.kind} does not know its range: give bounds=(from, to) of {name}")
        return known

    @property
    def observe(self) -> int | None:
        """The DOF whose amplitude is reported, None where it is not known."""
        return self.known.get("observe")

    def under(self, options: CurveOptions) -> CurveOptions:
        """Options that are given, and where they are not those of the bifurcation."""
        given = {name: value for name, value in options.items() if value is not None}
        inherited: dict[str, Any] = {"observe": self.observe}
        for name, kind in (("newton", NewtonOptions), ("stepping", SteppingOptions)):
            if name not in given and self.known.get(name) is not None:
                inherited[name] = kind(**self.known[name])
        for name, names in (("stability", METHODS), ("formulation", FORMULATIONS)):
            if name not in given:
                inherited[name] = known = self.known.get(name)
                if known is not None and known not in names:
                    what = f"{name}={known}, which has options"
                    raise InputError(f"this {self.item.kind} was found with {what}: give it again")
        return cast("CurveOptions", inherited | given)


def check_inside(what: str, name: str, value: float, ends: tuple[float, float], slack: float = 0.0) -> None:
    """Refuse a start outside its range by more than a share of that."""
    low, high = sorted(ends)
    room = slack * (high - low)
    if not low - room <= value <= high + room:
        raise InputError(f"{what} has {name}={value:.6g}, outside the bounds ({low:g}, {high:g})")


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
        return make_curve(self.system, self.name, omega, high - low, self.harmonics, nu, linear, self.settings.observe)

    def scaled(self, curve: MotionProblem) -> MotionProblem:
        """The curve in units of the larger one of the responses without elements at both ends."""
        curve.reference = max(curve.size(bounded_response(curve, value)) for value in self.ends)
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

    def _truncated(self, trace: Trace) -> list[Note]:
        """A note where a given number of harmonics is far too small."""
        if isinstance(self.harmonics, AdaptiveHarmonics):
            return []
        lacking = [point.orbit for point in trace.points if point.orbit.truncation > _FEW]
        if not lacking:
            return []
        worst = max(orbit.truncation for orbit in lacking)
        values = [orbit.omega if self.name == "omega" else orbit.values[self.name] for orbit in lacking]
        return [
            Note(
                f"harmonics={self.harmonics} is too small, it leaves out up to {worst:.0%} of the motion. Use "
                f'harmonics="adaptive" or {_MORE * self.harmonics}',
                *(self.name, min(values), max(values)),
            )
        ]

    def branch(self, trace: Trace) -> Branch:
        """What was followed as a branch, with what it was computed with."""
        options = options_of(self.settings, self.harmonics, {self.name: self.ends})
        with one_thread():
            trace = with_verdicts(trace, self.settings.stability, self.name)
        trace = replace(trace, notes=[*self._truncated(trace), *trace.notes])
        context = {"system": self.system, "parameter": self.name, **options}
        bifurcations, events = (
            [replace(b, context=context) for b in items] for items in (trace.bifurcations, trace.events)
        )
        met = (None if item is None else Junction.of(item) for item in (trace.departs, trace.arrives))
        return Branch(
            self.system, self.name, trace.points, bifurcations, events, trace.closed, trace.endings,
            self.settings.observe, options, tuple(trace.open_questions), trace.audit, *met,
        )  # fmt: skip
