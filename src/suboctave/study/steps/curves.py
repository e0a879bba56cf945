"""What the steps that follow a curve have in common: the options of the verbs as fields, checked and passed on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationInfo, field_validator

from suboctave.analysis.checks import make_settings
from suboctave.continuation import Event
from suboctave.errors import InputError
from suboctave.model.description import from_plain
from suboctave.study.options import as_formulation, as_harmonics, as_newton, as_stability, as_stepping
from suboctave.study.steps.base import (
    Complaint,
    Context,
    Known,
    Motion,
    Step,
    Surroundings,
    check_branch,
    check_motion,
    chosen,
    tried,
)

__all__ = ["CurveStep", "FollowingStep"]


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

    harmonics: Any = None
    max_step: float | None = None
    observe: int | None = None
    newton: dict[str, Any] | None = None
    stepping: dict[str, Any] | None = None
    stability: Any = None

    @field_validator("newton", "stepping", "harmonics", "stability")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        _READ[str(info.field_name)](given)
        return given

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """The options of every verb."""
        yield from _by_name(tried("", lambda: make_settings(around.system, **self._given(around.allow_code))))
        if isinstance(self.harmonics, int) and (2 * self.harmonics + 1) * around.system.n > _MOST:
            yield (
                ("harmonics",),
                f"with {around.system.n} DOFs that is too many unknowns: keep fewer harmonics",
            )

    def _given(self, allow_code: bool) -> dict[str, Any]:
        """The options as the verbs take them."""
        return {
            "max_step": self.max_step,
            "observe": self.observe,
            "events": (),
            "newton": as_newton(self.newton),
            "stepping": as_stepping(self.stepping),
            "stability": as_stability(self.stability),
        }

    def options(self, context: Context) -> dict[str, Any]:
        """The arguments of the verb that were given."""
        given = {
            "harmonics": as_harmonics(self.harmonics),
            **self._given(context.allow_code),
            "progress": context.progress,
        }
        return {name: value for name, value in given.items() if value is not None and value != ()}


class CurveStep(FollowingStep):
    """The arguments that `frequency_response` and `continue_branch` share."""

    gives_branch: ClassVar[bool] = True

    start: Start | None = None
    events: list[EventTable] = Field(default_factory=list)
    formulation: Any = None

    @field_validator("formulation")
    @classmethod
    def _read_formulation(cls, given: Any) -> Any:
        as_formulation(given)
        return given

    @property
    def motion(self) -> Motion | None:
        """The motion of an earlier branch that it starts from; the name of one alone means its last point."""
        return (
            Motion(analysis=self.start)
            if isinstance(self.start, str)
            else (self.start if isinstance(self.start, Motion) else None)
        )

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """See `Step.needs`."""
        if self.motion is None:
            return []
        return [(("start",) if isinstance(self.start, str) else ("start", "analysis"), self.motion.analysis)]

    def check(self, around: Surroundings) -> Iterator[Complaint]:
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
        if self.motion is not None:
            found = chosen(self.motion, context.results)
            return self._moved(found.orbit, context)
        return self.start

    def _moved(self, orbit: Any, context: Context) -> Any:
        """The motion as it is: a step that starts from one keeps its parameters."""
        changed = {name: value for name, value in self.parameters.items() if orbit.values[name] != value}
        if changed:
            names = ", ".join(changed)
            raise InputError(f"the motion it starts from has other values of {names}: leave them out of parameters")
        return orbit

    def known(self, around: Surroundings) -> Known | None:
        """See `Step.known`: the frequency varies, the parameters are those of the system."""
        return Known("omega", dict(around.system.parameters))

    def inherited(self, around: Surroundings) -> Known | None:
        """What is known of the analysis that it starts from."""
        return None if self.motion is None else around.known.get(self.motion.analysis)

    def differing(self, around: Surroundings) -> Iterator[Complaint]:
        """Parameters that the motion it starts from is known to have other values of."""
        source = self.inherited(around)
        for name, value in self.parameters.items():
            there = value if source is None else source.values.get(name, value)
            if there != value:
                yield ("parameters", name), f"the motion that it starts from has {name} = {there:g}: leave it out"


_READ: dict[str, Callable[[Any], Any]] = {
    "newton": as_newton,
    "stepping": as_stepping,
    "harmonics": as_harmonics,
    "stability": as_stability,
}
_MOST = 8000  # unknowns of a dense problem, as the verbs have it


def _by_name(complaints: Iterator[Complaint]) -> Iterator[Complaint]:
    """A complaint of a whole call, at the key that its message begins with."""
    for _, text in complaints:
        keys = ("max_step", "observe", "newton", "stepping", "stability", "formulation")
        named = next((key for key in keys if key in text), None)
        yield ((named,) if named else ()), text
