"""The steps that follow curves: responses, diagrams, branches along a parameter, branches switched to, tracked curves.

What they have in common are the options of the verbs as fields, checked and passed on.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from suboctave.analysis.branches import check_left, continue_branch, frequency_response, switch_branch
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.options import settings_of
from suboctave.analysis.track import motion_kind, track
from suboctave.bifurcation.bifurcation import CURVES_THROUGH
from suboctave.continuation import Event
from suboctave.errors import InputError, is_number, suggest
from suboctave.kinds import KINDS, TRACKED_KINDS
from suboctave.model.description import from_plain
from suboctave.model.inputs import check_bounds, check_parameter, check_range, check_system
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Known,
    Motion,
    Range,
    Step,
    as_formulation,
    as_harmonics,
    as_newton,
    as_stability,
    as_stepping,
    check_branch,
    check_motion,
    chosen,
    read_by,
    tried,
)


class EventTable(BaseModel):
    """A user's event: the zero of a Python function of the motion, "module:function"."""

    model_config = ConfigDict(extra="forbid", strict=True)

    name: str
    function: str


def _way(given: Any) -> str | None:
    """Which way a start is given, so that a mistake in it is told once, as one in that way."""
    if isinstance(given, list):
        return "rows" if given and all(isinstance(row, list) for row in given) else "numbers"
    return "name" if isinstance(given, str) else "table" if isinstance(given, dict | Motion) else None


Start = Annotated[
    Annotated[str, Tag("name")]
    | Annotated[Motion, Tag("table")]
    | Annotated[list[float], Tag("numbers")]
    | Annotated[list[list[float]], Tag("rows")],
    Discriminator(_way),
]


class FollowingStep(Step):
    """The options of all verbs that follow curves."""

    harmonics: Annotated[Any, read_by(as_harmonics)] = None
    max_step: float | None = None
    observe: int | None = None
    newton: Annotated[dict[str, Any] | None, read_by(as_newton)] = None
    stepping: Annotated[dict[str, Any] | None, read_by(as_stepping)] = None
    stability: Annotated[Any, read_by(as_stability)] = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """The options of every verb."""
        given = self._given(around.allow_code)
        for key, value in given.items():
            beside = {"stepping": given["stepping"]} if key == "max_step" else {}
            yield from tried(key, partial(settings_of, around.system, {key: value, **beside}))
        if isinstance(self.harmonics, int) and (2 * self.harmonics + 1) * around.system.n > _MOST:
            yield ("harmonics",), f"with {around.system.n} DOFs that is too many unknowns: keep fewer harmonics"

    def _given(self, allow_code: bool) -> dict[str, Any]:
        """The options as the verbs take them."""
        return {
            "max_step": self.max_step,
            "observe": self.observe,
            "newton": as_newton(self.newton),
            "stepping": as_stepping(self.stepping),
            "stability": as_stability(self.stability),
        }

    def options(self, context: Context) -> dict[str, Any]:
        """The arguments of the verb that were given."""
        own = {"harmonics": as_harmonics(self.harmonics), "progress": context.progress}
        given = {**own, **self._given(context.allow_code)}
        return {name: value for name, value in given.items() if value is not None and value != ()}


class CurveStep(FollowingStep):
    """The arguments that `frequency_response` and `continue_branch` share."""

    gives_branch: ClassVar[bool] = True

    start: Start | None = None
    events: list[EventTable] = Field(default_factory=list)
    formulation: Annotated[Any, read_by(as_formulation)] = None

    @property
    def motion(self) -> Motion | None:
        """The motion of an earlier branch that it starts from; the name of one alone means its last point."""
        if isinstance(self.start, str):
            return Motion(analysis=self.start)
        return self.start if isinstance(self.start, Motion) else None

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        if self.motion is None:
            return []
        return [(("start",) if isinstance(self.start, str) else ("start", "analysis"), self.motion.analysis)]

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """The options of the verb, and where it starts."""
        wrong = list(tried("events", lambda: self._events(around.allow_code)))
        yield from wrong
        if not wrong:
            yield from super().check(around)
        if self.motion is not None:
            for key, _ in self.needs():
                yield from check_branch(self.motion, key, around)
            yield from check_motion(self.motion, ("start",), around)

    def _given(self, allow_code: bool) -> dict[str, Any]:
        own = {"events": tuple(self._events(allow_code)), "formulation": as_formulation(self.formulation)}
        return super()._given(allow_code) | own

    def _events(self, allow_code: bool) -> list[Event]:
        return [Event(e.name, from_plain({"callable": e.function}, {}, allow_code)) for e in self.events]

    def started(self, context: Context) -> Any:
        """What the curve starts from: a motion of an earlier branch, numbers, or None."""
        return self.start if self.motion is None else self._moved(chosen(self.motion, context.results).orbit, context)

    def _moved(self, orbit: Any, context: Context) -> Any:
        """The motion as it is: a step that starts from one keeps its parameters."""
        changed = {name: value for name, value in self.parameters.items() if orbit.values[name] != value}
        if changed:
            names = ", ".join(changed)
            raise InputError(f"the motion it starts from has other values of {names}: leave them out of parameters")
        return orbit

    def known(self, around: CheckContext) -> Known | None:
        """See `Step.known`: the frequency varies, the parameters are those of the system."""
        return Known("omega", dict(around.system.parameters))

    def inherited(self, around: CheckContext) -> Known | None:
        """What is known of the analysis that it starts from."""
        return None if self.motion is None else around.known.get(self.motion.analysis)

    def differing(self, around: CheckContext) -> Iterator[Complaint]:
        """Parameters that the motion it starts from is known to have other values of."""
        source = self.inherited(around)
        for name, value in self.parameters.items():
            there = value if source is None else source.values.get(name, value)
            if there != value:
                yield ("parameters", name), f"the motion that it starts from has {name} = {there:g}: leave it out"


_MOST = 8000  # unknowns of a dense problem, as the verbs have it


def check_sweep(omega: list[float], around: CheckContext) -> Iterator[Complaint]:
    """What is wrong with a range of frequencies, or with the system there."""
    wrong = list(tried("omega", lambda: check_range("omega", omega, positive=True)))
    yield from wrong
    yield from tried("", lambda: check_system(around.system, () if wrong else tuple(omega)))


class FrequencyResponse(CurveStep):
    """`so.frequency_response`; `start` may be a motion of an earlier branch, a state or coefficients."""

    kind: ClassVar[str] = "frequency_response"

    omega: Range

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from check_sweep(self.omega, around)

    def run(self, context: Context) -> Branch | BifurcationDiagram:
        options: dict[str, Any] = self.options(context)
        start = self.started(context)
        first, last = self.omega
        return frequency_response(context.system, (first, last), start=start, **options)

    def _moved(self, orbit: Any, context: Context) -> Any:
        return orbit  # a first guess at other parameters, too


class Diagram(FrequencyResponse):
    """`so.bifurcation_diagram`: a frequency response, and `depth` bifurcations deep what leaves it."""

    kind: ClassVar[str] = "bifurcation_diagram"
    gives_branch: ClassVar[bool] = False
    gives_diagram: ClassVar[bool] = True

    depth: int = Field(default=2, ge=0)
    max_branches: int = Field(default=32, ge=1)

    def run(self, context: Context) -> BifurcationDiagram:
        options: dict[str, Any] = self.options(context)
        omega: Any = tuple(self.omega)
        options |= {"start": self.started(context), "max_branches": self.max_branches}
        return bifurcation_diagram(context.system, omega, self.depth, keeper=context.keeper, **options)


class ContinueBranch(CurveStep):
    """`so.continue_branch` from a motion of an earlier branch, or from the system with `omega`."""

    kind: ClassVar[str] = "continue_branch"

    parameter: str
    bounds: Range
    omega: float | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        unknown = list(tried("parameter", lambda: check_parameter(around.system, self.parameter)))
        yield from unknown
        if not unknown:
            yield from tried("bounds", lambda: check_bounds(around.system, self.parameter, self.bounds))
        if self.start is not None and self.motion is None:
            yield ("start",), "name a motion of an earlier analysis, or leave it out and give omega"
        if self.start is None and self.parameter != "omega":
            yield from tried("", lambda: check_system(around.system))
            if self.omega is None:
                yield (), "needs start = {analysis = ...}, or omega, the frequency that is kept"
        if self.omega is not None and not (is_number(self.omega) and self.omega > 0.0):
            yield ("omega",), f"must be positive, in rad per unit time, not {self.omega:g}"
        if self.parameter in self.parameters:
            yield ("parameters", self.parameter), "is the parameter that varies: its range is in bounds"
        else:
            yield from self.differing(around)

    def known(self, around: CheckContext) -> Known | None:
        source = self.inherited(around)
        if self.motion is not None and source is None:
            return None
        values = around.system.parameters if source is None else source.values
        return Known(self.parameter, {name: value for name, value in values.items() if name != self.parameter})

    def run(self, context: Context) -> Branch:
        options: dict[str, Any] = self.options(context)
        start = context.system if self.motion is None else self.started(context)
        bounds: Any = tuple(self.bounds)
        return continue_branch(start, self.parameter, bounds, omega=self.omega, **options)


class SwitchBranch(CurveStep):
    """`so.switch_branch` at a bifurcation of an earlier branch; what is not given is as it was there."""

    kind: ClassVar[str] = "switch_branch"

    start: Motion
    side: Literal[1, -1] | None = None
    bounds: Range | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        kind = self.start.bifurcation
        if kind is None:
            yield ("start",), 'name the bifurcation that it leaves: bifurcation = "PD" or "BP", with index = 0, 1, ...'
        elif kind in KINDS:
            yield from tried("start", lambda: check_left(kind))
        if self.bounds is not None:
            yield from tried("bounds", lambda: self._check_bounds(around))
        yield from self.differing(around)

    def _check_bounds(self, around: CheckContext) -> None:
        source = self.inherited(around)
        if source is None:
            check_range("bounds", self.bounds)
        else:
            check_bounds(around.system, source.free, self.bounds)

    def known(self, around: CheckContext) -> Known | None:
        return self.inherited(around)

    def run(self, context: Context) -> Branch:
        item = chosen(self.start, context.results)
        self._moved(item.orbit, context)
        options: dict[str, Any] = self.options(context)
        if self.bounds is not None:
            options["bounds"] = tuple(self.bounds)
        return switch_branch(item, self.side, **options)


#: what is tracked in a third parameter: extrema along curves, the ends of isolas
_EXTREMA = ("extremum", "isola_centre", "isola_merging")


class Track(CurveStep):
    """`so.track`: `start` names a bifurcation of an earlier branch."""

    kind: ClassVar[str] = "track"

    parameter: str | list[str]
    bounds: Range | list[Range]
    omega: Range | None = None
    onto: str | dict[str, Any] | None = None

    @property
    def plane(self) -> tuple[str, str] | None:
        both = ["omega", self.parameter] if isinstance(self.parameter, str) else self.parameter
        return (both[0], both[1]) if len(both) == 2 else None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from self._check_start()
        names = [self.parameter] if isinstance(self.parameter, str) else self.parameter
        ranges = [self.bounds] if isinstance(self.parameter, str) else self.bounds
        wrong = [c for name in names for c in tried("parameter", partial(check_parameter, around.system, name))]
        yield from wrong
        if not isinstance(self.parameter, str) and len(names) != 2:
            yield ("parameter",), "is one name, beside omega, or two"
        elif len(ranges) != len(names) or any(not isinstance(r, list) for r in ranges):
            yield ("bounds",), "needs a range [from, to] for each parameter"
        elif not wrong:
            for name, ends in zip(names, ranges, strict=True):
                mistaken = [*tried("bounds", partial(check_bounds, around.system, name, ends))]
                yield from mistaken or self._check_inside(around, name, ends)
        if self.omega is not None:
            yield from tried("omega", lambda: check_range("omega", self.omega, positive=True))
        for name in names:
            if name in self.parameters:
                yield ("parameters", name), "is a parameter that varies: its range is in bounds"
        if self.events:
            yield ("events",), "is no option of a curve of bifurcations: leave it out"

    def _check_inside(self, around: CheckContext, name: str, ends: Any) -> Iterator[Complaint]:
        """That the range of a parameter holds the value that it has along the curve where the bifurcation is."""
        known = self.inherited(around)
        value = None if known is None or name == known.free else known.values.get(name)
        if value is not None and not min(ends) <= value <= max(ends):
            yield ("bounds",), f"the bifurcations there have {name} = {value:g}: let the range hold it"

    def _check_start(self) -> Iterator[Complaint]:
        wrong = list(tried("onto", lambda: motion_kind(self.onto)))
        if wrong or motion_kind(self.onto) is not None:
            yield from wrong
            if self.motion is None:
                yield (
                    ("start",),
                    'name a motion: start = { analysis = "response", nearest = { omega = 1.0 } }',
                )
            return
        kind = None if self.motion is None else self.motion.bifurcation
        if kind is None:
            yield ("start",), 'name a bifurcation: start = { analysis = "response", bifurcation = "PD" }'
        elif kind not in (*TRACKED_KINDS, *_EXTREMA, *CURVES_THROUGH):
            yield (
                ("start", "bifurcation"),
                f"{kind} cannot be tracked{suggest(kind, (*TRACKED_KINDS, *CURVES_THROUGH))}",
            )
        elif kind in _EXTREMA and not isinstance(self.parameter, str):
            yield ("parameter",), "of an extremum is one name: the third parameter"
        if self.onto is None or kind is None:
            return
        through = CURVES_THROUGH.get(kind)
        if through is None:
            yield ("onto",), f"chooses between the curves through a point of codimension two; {kind} is none"
        elif self.onto not in through:
            yield ("onto",), f"{self.onto!r}: the curves through {kind} are {' and '.join(through)}"

    def known(self, around: CheckContext) -> Known | None:
        """See `Step.known`: what varies along it are parameters, too."""
        return None

    def run(self, context: Context) -> Branch:
        options: dict[str, Any] = self.options(context)
        assert self.motion is not None
        start = chosen(self.motion, context.results)
        self._moved(start.orbit, context)
        if self.omega is not None:
            options["omega"] = (self.omega[0], self.omega[1])
        if self.onto is not None:
            options["onto"] = self.onto
        return track(start, self.parameter, self.bounds, **options)
