"""The step "find_isolas": closed branches that no sweep leads to, over a design parameter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import Field, ValidationInfo, field_validator

from suboctave.analysis import Isolas, find_isolas
from suboctave.analysis.checks import check_bounds, check_parameter, check_range, check_system
from suboctave.errors import ConvergenceError, suggest
from suboctave.study.options import as_seeds
from suboctave.study.steps.base import Complaint, Context, Range, Surroundings, tried
from suboctave.study.steps.curves import FollowingStep


class FindIsolas(FollowingStep):
    """`so.find_isolas`; `at` are values of the parameter at which the closed branches are followed and kept."""

    kind: ClassVar[str] = "find_isolas"
    gives_isolas: ClassVar[bool] = True

    omega: Range
    parameter: str
    bounds: Range
    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    levels: list[float] | None = None
    search: list[int] | None = None
    seeds: dict[str, Any] | None = None
    max_curves: int = Field(default=64, ge=1)
    at: list[float] = Field(default_factory=list)

    @field_validator("seeds")
    @classmethod
    def _read_seeds(cls, given: Any, info: ValidationInfo) -> Any:
        as_seeds(given)
        return given

    @property
    def plane(self) -> tuple[str, str] | None:
        """See `Step.plane`."""
        return "omega", self.parameter

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        wrong = list(tried("omega", lambda: check_range("omega", self.omega, positive=True)))
        yield from wrong
        if self.parameter == "omega":
            known = suggest("", around.system.parameters)
            yield ("parameter",), f"is the design parameter, beside omega, which varies anyway{known}"
            return
        unknown = list(tried("parameter", lambda: check_parameter(around.system, self.parameter)))
        yield from unknown
        if not unknown:
            bad = list(tried("bounds", lambda: check_bounds(around.system, self.parameter, self.bounds)))
            yield from bad
            if not bad:
                yield from self._check_places()
        if not unknown and self.parameter in self.parameters:
            yield ("parameters", self.parameter), "is the parameter that varies: its range is in bounds"
        yield from tried("", lambda: check_system(around.system, () if wrong else tuple(self.omega)))
        for i, order in enumerate(self.search or ()):
            if order < 2:
                yield ("search", i), f"is a period of at least 2 periods of the load, not {order}"
        for i, level in enumerate(self.levels or ()):
            if level <= 0.0:
                yield ("levels", i), f"is a level of the loads in units of their own, positive, not {level:g}"
            if level == 1.0:
                yield ("levels", i), "is that of the loads themselves, at which responses are followed anyway"

    def _check_places(self) -> Iterator[Complaint]:
        low, high = sorted(self.bounds)
        if isinstance(self.values, int):
            if self.values < 2:
                yield (
                    ("values",),
                    f"must be at least 2, or values of {self.parameter} themselves, not {self.values}",
                )
        elif not self.values:
            yield ("values",), f"must be how many, or values of {self.parameter}, at least one"
        else:
            yield from _outside("values", self.values, low, high)
        yield from _outside("at", self.at, low, high)

    def run(self, context: Context) -> Isolas:
        """See `Step.run`."""
        options: dict[str, Any] = self.options(context)
        options |= {"values": self.values, "depth": self.depth, "max_curves": self.max_curves}
        for name in ("levels", "search"):
            if getattr(self, name) is not None:
                options[name] = tuple(getattr(self, name))
        if self.seeds is not None:
            options["seeds"] = as_seeds(self.seeds)
        omega, bounds = (self.omega[0], self.omega[1]), (self.bounds[0], self.bounds[1])
        found = find_isolas(context.system, omega, self.parameter, bounds, **options)
        return self._with_branches(found, context.progress)

    def _with_branches(self, found: Isolas, progress: Any) -> Isolas:
        """The closed branches at the values asked for are followed; what fails is noted."""
        notes = []
        for isola in found:
            for value in self.at:
                if found.interrupted or value not in isola:
                    continue
                try:
                    branch = isola.at(value, progress=progress)
                except ConvergenceError as failure:
                    notes.append(f"the closed branch at {self.parameter} = {value:g}: {failure}")
                    continue
                if branch.interruption is not None:
                    missing = f"{branch.interruption}: the closed branches asked for are not all here"
                    return found.noting([missing, *notes], branch.interruption)
        for value in self.at:
            if not any(value in isola for isola in found):
                notes.append(f"no isola was found at {self.parameter} = {value:g}")
        return found.noting(notes)


def _outside(key: str, values: list[float], low: float, high: float) -> Iterator[Complaint]:
    for i, value in enumerate(values):
        if not low <= value <= high:
            yield (key, i), f"{value:g} lies outside the bounds ({low:g}, {high:g})"
