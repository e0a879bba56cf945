"""The step "continue_branch": a curve of motions along any one parameter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from suboctave.analysis import Branch, continue_branch
from suboctave.analysis.checks import check_bounds, check_parameter, check_system, is_number
from suboctave.study.steps.base import Complaint, Context, Known, Range, Surroundings, tried
from suboctave.study.steps.curves import CurveStep


class ContinueBranch(CurveStep):
    """`so.continue_branch` from a motion of an earlier branch, or from the system with `omega`."""

    kind: ClassVar[str] = "continue_branch"

    parameter: str
    bounds: Range
    omega: float | None = None

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
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

    def known(self, around: Surroundings) -> Known | None:
        """See `Step.known`."""
        source = self.inherited(around)
        if self.motion is not None and source is None:
            return None
        values = around.system.parameters if source is None else source.values
        return Known(self.parameter, {name: value for name, value in values.items() if name != self.parameter})

    def run(self, context: Context) -> Branch:
        """See `Step.run`."""
        options: dict[str, Any] = self.options(context)
        start = context.system if self.motion is None else self.started(context)
        bounds: Any = tuple(self.bounds)
        return continue_branch(start, self.parameter, bounds, omega=self.omega, **options)
