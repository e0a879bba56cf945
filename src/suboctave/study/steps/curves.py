"""The steps that follow curves: responses, diagrams, branches along a parameter, branches switched to, tracked curves.

What they have in common are the options of the verbs as fields, checked and passed on.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator

from suboctave.analysis.branches import check_left, continue_branch, frequency_response, switch_branch
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.nonlinear_mode import free_system, nonlinear_mode, ranges_of
from suboctave.analysis.options import settings_of
from suboctave.analysis.track import motion_kind, track
from suboctave.bifurcation.bifurcation import CURVES_THROUGH
from suboctave.continuation import Event
from suboctave.errors import InputError, suggest
from suboctave.harmonic.condensed import unknown_directions
from suboctave.kinds import KINDS, TRACKED_KINDS
from suboctave.model.description import from_plain
from suboctave.model.inputs import check_bounds, check_range, check_system
from suboctave.study.mistakes import Section
from suboctave.study.results import Result
from suboctave.study.steps.base import (
    READERS,
    CheckContext,
    Complaint,
    Context,
    Known,
    Motion,
    Range,
    Step,
    check_varied,
    tried,
)


class EventTable(Section):
    """A user's event: the zero of a Python function of the motion, "module:function"."""

    name: str
    function: str


def _way(given: Any) -> str | None:
    """Which way a start is given, so that a mistake in it is told once, as one in that way."""
    if isinstance(given, list):
        return "rows" if given and all(isinstance(row, list) for row in given) else "numbers"
    return "motion" if isinstance(given, str | dict | Motion) else None


Start = Annotated[
    Annotated[Motion, Tag("motion")]
    | Annotated[list[float], Tag("numbers")]
    | Annotated[list[list[float]], Tag("rows")],
    Discriminator(_way),
]

_MOST = 8000  # unknowns of a dense problem, as the verbs have it


class FollowingStep(Step):
    """The options of all verbs that follow curves."""

    harmonics: Any = None
    max_step: float | None = None
    observe: int | str | None = None
    newton: dict[str, Any] | None = None
    stepping: dict[str, Any] | None = None
    stability: Any = None

    @field_validator(*READERS, check_fields=False)
    @classmethod
    def _readable(cls, given: Any, info: ValidationInfo) -> Any:
        """Options stay as they are given; what cannot be read is refused at its key."""
        if given is not None:
            READERS[str(info.field_name)](given)
        return given

    def arguments(self, context: CheckContext | Context) -> dict[str, Any]:
        given = super().arguments(context)
        return {name: READERS[name](value) if name in READERS else value for name, value in given.items()}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        given = self.arguments(around)
        for key in ("max_step", "observe", "newton", "stepping", "stability", "events", "formulation"):
            beside = {"stepping": given.get("stepping")} if key == "max_step" else {}
            yield from tried(key, partial(settings_of, around.system, {key: given.get(key), **beside}))
        # displacements along which no element acts are no unknowns
        size = len(unknown_directions(around.system)) or around.system.n
        if isinstance(self.harmonics, int) and (2 * self.harmonics + 1) * size > _MOST:
            yield (
                ("harmonics",),
                f"with elements along {size} directions that is too many unknowns: keep fewer harmonics",
            )


class AlongParameter(FollowingStep):
    """Follows motions along one parameter over its range."""

    parameter: str
    bounds: Range

    @property
    def varied(self) -> tuple[str, ...]:
        return (self.parameter,)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from check_varied(around, self.parameter, self.bounds)


class CurveStep(FollowingStep, gives="branch"):
    """The arguments that `frequency_response` and `continue_branch` share."""

    start: Start | None = None
    events: list[EventTable] = Field(default_factory=list)
    formulation: Any = None

    @property
    def motion(self) -> Motion | None:
        """The motion of an earlier branch that it starts from."""
        return self.start if isinstance(self.start, Motion) else None

    def arguments(self, context: CheckContext | Context) -> dict[str, Any]:
        given = super().arguments(context)
        if events := given.pop("events"):
            read = partial(from_plain, arrays={}, allow_code=context.allow_code)
            given["events"] = tuple(Event(e.name, read({"callable": e.function})) for e in events)
        return given

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        wrong = list(tried("events", lambda: self.arguments(around)))
        yield from wrong
        yield from Step.check(self, around) if wrong else super().check(around)

    def started(self, context: Context) -> Any:
        """The point or bifurcation that it starts from, whose parameters are kept."""
        assert self.motion is not None
        item = self.motion.chosen(context.results)
        changed = [name for name, value in self.parameters.items() if item.orbit.values[name] != value]
        if changed:
            names = ", ".join(changed)
            raise InputError(f"the motion it starts from has other values of {names}: leave them out of parameters")
        return item

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
            if there != value and name not in self.varied:
                yield ("parameters", name), f"the motion that it starts from has {name} = {there:g}: leave it out"


def check_sweep(omega: list[float], around: CheckContext) -> Iterator[Complaint]:
    """What is wrong with a range of frequencies, or with the system there."""
    wrong = list(tried("omega", lambda: check_range("omega", omega, positive=True)))
    yield from wrong
    yield from tried("", lambda: check_system(around.system, () if wrong else tuple(omega)))


class FrequencyResponse(CurveStep, kind="frequency_response", verb=frequency_response):
    """`so.frequency_response`; `start` may be a motion of an earlier branch, a state or coefficients."""

    omega: Range

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from check_sweep(self.omega, around)

    def computed(self, context: Context, *first: Any, **more: Any) -> Any:
        if self.motion is not None:  # a first guess, at other parameters, too
            more["start"] = self.motion.chosen(context.results).orbit
        return super().computed(context, *first, **more)


class Diagram(FrequencyResponse, kind="bifurcation_diagram", verb=bifurcation_diagram, gives="diagram"):
    """`so.bifurcation_diagram`: a frequency response, and `depth` bifurcations deep what leaves it."""

    depth: int = Field(default=2, ge=0)
    max_branches: int = Field(default=32, ge=1)

    def run(self, context: Context) -> Result:
        return self.computed(context, keeper=context.keeper)


class Mode(FollowingStep, kind="nonlinear_mode", verb=nonlinear_mode, gives="branch"):
    """`so.nonlinear_mode` of the system."""

    mode: int = Field(default=1, ge=1)
    amplitude: float | Range | None = None
    energy: float | Range | None = None
    omega: Range | None = None
    damped: bool | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from tried("", lambda: ranges_of(self.amplitude, self.energy, self.omega))
        yield from tried("damped", lambda: free_system(around.system, self.damped))


class ContinueBranch(CurveStep, AlongParameter, kind="continue_branch", verb=continue_branch):
    """`so.continue_branch` from a motion of an earlier branch, or from the system with `omega`."""

    omega: float | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.start is not None and self.motion is None:
            yield ("start",), "name a motion of an earlier analysis, or leave it out and give omega"
        if self.start is None and self.parameter != "omega":
            yield from tried("", lambda: check_system(around.system))
            if self.omega is None:
                yield (), "needs start = {analysis = ...}, or omega, the frequency that is kept"
        if self.omega is not None and not self.omega > 0.0:
            yield ("omega",), f"must be positive, in rad per unit time, not {self.omega:g}"
        yield from self.differing(around)

    def known(self, around: CheckContext) -> Known | None:
        source = self.inherited(around)
        if self.motion is not None and source is None:
            return None
        values = around.system.parameters if source is None else source.values
        return Known(self.parameter, {name: value for name, value in values.items() if name != self.parameter})

    def run(self, context: Context) -> Result:
        return self.computed(context, context.system if self.motion is None else self.started(context).orbit)


class SwitchBranch(CurveStep, kind="switch_branch", verb=switch_branch):
    """`so.switch_branch` at a bifurcation of an earlier branch; what is not given is as it was there."""

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

    def run(self, context: Context) -> Result:
        return self.computed(context, self.started(context))


#: what is tracked in a third parameter: extrema along curves, the ends of isolas
_EXTREMA = ("extremum", "isola_centre", "isola_merging")


class Track(CurveStep, kind="track", verb=track):
    """`so.track`: `start` names a bifurcation of an earlier branch."""

    parameter: str | list[str]
    bounds: Range | list[Range]
    omega: Range | None = None
    onto: str | dict[str, Any] | None = None

    @property
    def varied(self) -> tuple[str, ...]:
        return (self.parameter,) if isinstance(self.parameter, str) else tuple(self.parameter)

    @property
    def plane(self) -> tuple[str, str] | None:
        both = ("omega", *self.varied)[-2:]
        return (both[0], both[1]) if len(both) == 2 else None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from self._check_start()
        ranges = [self.bounds] if isinstance(self.parameter, str) else self.bounds
        if not isinstance(self.parameter, str) and len(self.parameter) != 2:
            yield ("parameter",), "is one name, beside omega, or two"
        elif len(ranges) != len(self.varied) or any(not isinstance(r, list) for r in ranges):
            yield ("bounds",), "needs a range [from, to] for each parameter"
        else:
            for name, ends in zip(self.varied, ranges, strict=True):
                mistaken = list(check_varied(around, name, ends))
                yield from mistaken or self._check_inside(around, name, ends)
        if self.omega is not None:
            yield from tried("omega", lambda: check_range("omega", self.omega, positive=True))
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
                yield ("start",), 'name a motion: start = { analysis = "response", nearest = { omega = 1.0 } }'
            return
        kind = None if self.motion is None else self.motion.bifurcation
        if kind is None:
            yield ("start",), 'name a bifurcation: start = { analysis = "response", bifurcation = "PD" }'
        elif kind in KINDS and kind not in (*TRACKED_KINDS, *_EXTREMA, *CURVES_THROUGH):
            known = suggest(kind, (*TRACKED_KINDS, *CURVES_THROUGH))
            yield ("start", "bifurcation"), f"{kind} cannot be tracked{known}"
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

    def run(self, context: Context) -> Result:
        return self.computed(context, self.started(context))
