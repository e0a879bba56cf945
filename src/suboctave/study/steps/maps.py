"""What the steps that map a plane of parameters have in common: the first plane, and the options of the verbs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from pydantic import Field, ValidationInfo, field_validator

from suboctave.analysis.checks import check_bounds, check_parameter, check_range, check_system, make_settings
from suboctave.study.options import as_harmonics, as_newton, as_stability, as_stepping
from suboctave.study.steps.base import Complaint, Context, Range, Step, Surroundings, tried

__all__ = ["MapStep", "check_design"]


class MapStep(Step):
    """A range of omega, a design parameter with its bounds, and the options of the verbs that follow curves."""

    omega: Range
    parameter: str
    bounds: Range
    max_curves: int = Field(default=64, ge=1)
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
        """See `Step.check`."""
        wrong = list(tried("omega", lambda: check_range("omega", self.omega, positive=True)))
        yield from wrong
        yield from check_design(self.parameter, self.bounds, ("parameter", "bounds"), around)
        if self.parameter in self.parameters:
            yield ("parameters", self.parameter), "is the parameter that varies: its range is in bounds"
        yield from tried("", lambda: check_system(around.system, () if wrong else tuple(self.omega)))
        for key, value in self._settings().items():
            given: dict[str, Any] = dict.fromkeys(("max_step", "observe", "newton", "stepping", "stability"))
            given[key] = value
            yield from tried(key, partial(make_settings, around.system, events=(), **given))

    def _settings(self) -> dict[str, Any]:
        return {
            "max_step": self.max_step,
            "observe": self.observe,
            "newton": as_newton(self.newton),
            "stepping": as_stepping(self.stepping),
            "stability": as_stability(self.stability),
        }

    def options(self, context: Context) -> dict[str, Any]:
        """The arguments of the verb that were given."""
        given = {**self._settings(), "harmonics": as_harmonics(self.harmonics), "progress": context.progress}
        return {name: value for name, value in given.items() if value is not None} | {"max_curves": self.max_curves}

    @property
    def ranges(self) -> tuple[tuple[float, float], str, tuple[float, float]]:
        """omega, the design parameter, its bounds."""
        return (self.omega[0], self.omega[1]), self.parameter, (self.bounds[0], self.bounds[1])


def check_design(name: str, bounds: list[float], keys: tuple[str, str], around: Surroundings) -> Iterator[Complaint]:
    """What is wrong with a design parameter and its bounds."""
    if name == "omega":
        yield (keys[0],), "is a parameter of the system: omega varies anyway"
        return
    unknown = list(tried(keys[0], lambda: check_parameter(around.system, name)))
    yield from unknown or tried(keys[1], lambda: check_bounds(around.system, name, bounds))


_READ: dict[str, Callable[[Any], Any]] = {
    "newton": as_newton,
    "stepping": as_stepping,
    "harmonics": as_harmonics,
    "stability": as_stability,
}
