"""The step "frequency_response": the periodic response over a range of frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from suboctave.analysis import BifurcationDiagram, Branch, frequency_response
from suboctave.analysis.checks import check_range, check_system
from suboctave.study.steps.base import Complaint, Context, Range, Surroundings, tried
from suboctave.study.steps.curves import CurveStep


class FrequencyResponse(CurveStep):
    """`so.frequency_response`; `start` may be a motion of an earlier branch, a state or coefficients."""

    kind: ClassVar[str] = "frequency_response"

    omega: Range

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        wrong = list(tried("omega", lambda: check_range("omega", self.omega, positive=True)))
        yield from wrong
        yield from tried("", lambda: check_system(around.system, () if wrong else tuple(self.omega)))

    def run(self, context: Context) -> Branch | BifurcationDiagram:
        """See `Step.run`."""
        options: dict[str, Any] = self.options(context)
        start = self.started(context)
        first, last = self.omega
        return frequency_response(context.system, (first, last), start=start, **options)

    def _moved(self, orbit: Any, context: Context) -> Any:
        return orbit  # a first guess at other parameters, too
