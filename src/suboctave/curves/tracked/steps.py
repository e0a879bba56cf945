"""The steps of a tracked curve: their interiors are looked at, and the events in them located."""

from __future__ import annotations

import numpy as np

from suboctave.continuation import NewtonOptions
from suboctave.continuation.point import point_between
from suboctave.continuation.problem import Array
from suboctave.curves.audit import joined
from suboctave.curves.interior import Interior, Steps
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.events import LocatedEvent, events_between
from suboctave.curves.tracked.tests import CurveTest
from suboctave.errors import ConvergenceError

__all__ = ["StepWatch"]


class StepWatch(Steps):
    """Looks at the steps of a curve in order, for the events that `tests` tell of."""

    reach = 3

    def __init__(self, tests: tuple[CurveTest, ...], newton: NewtonOptions) -> None:
        super().__init__()
        self.tests = tests
        self.newton = newton
        #: the functions of the tests at the last points
        self._functions: dict[Sample, Array] = {}

    def passed(self, a: Sample, b: Sample, warnings: list[str]) -> list[LocatedEvent]:
        """The events between two neighbours, in the order met."""
        step = _Step(self, a, b, [f"two {test.kind} may lie" for test in self.tests])
        if step.size > 0.0:
            step.examine([(a, b)])
        warnings += [f"{stretch}: a smaller max_step may tell" for stretch in joined(step.unsettled)]
        self.keep(step.samples)
        self._functions = {s: known for s, known in self._functions.items() if s in self._behind}
        return events_between(step.inside, self.tests, self.newton, warnings)

    def functions(self, sample: Sample) -> Array:
        """The functions of the tests that are smooth along the curve: see `Interior.measures`."""
        known = self._functions.get(sample)
        if known is None:
            known = self._functions[sample] = np.array([test.smooth(sample) for test in self.tests]).T
        return known


class _Step(Interior):
    """One step of a tracked curve under examination."""

    steps: StepWatch

    def measures(self, sample: Sample) -> Array:
        return self.steps.functions(sample)

    def solved(self, fraction: float) -> Sample | None:
        try:
            return Sample(point_between(self.old.point, self.new.point, fraction, self.steps.newton))
        except ConvergenceError:
            return None

    def harmless(self, p: Sample, q: Sample, reason: str) -> bool:
        return reason not in self.reasons or self.steps.tests[self.reasons.index(reason)].changed(p, q)
