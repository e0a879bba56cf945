"""Steps along a curve of bifurcations: what their interior hides, and the events in them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.notes import Note
from suboctave.continuation.point import point_between
from suboctave.continuation.problem import Array
from suboctave.curves.interior import Interior, Steps, unsettled
from suboctave.curves.sample import Sample
from suboctave.curves.trace import joined, stretches_in_doubt
from suboctave.curves.tracked.events import LocatedEvent, events_between, located, same_discretisation
from suboctave.curves.tracked.tests import CurvesCross, CurveTest, Cusp, Extremum, PairCrossing
from suboctave.errors import ConvergenceError
from suboctave.floquet.symmetric import least_factor


class StepWatch(Steps):
    """Looks at the steps of a curve in order, for the events that `tests` tell of."""

    reach = 5

    def __init__(self, tests: tuple[CurveTest, ...], newton: NewtonOptions) -> None:
        super().__init__()
        self.tests = tests
        self.newton = newton
        #: whether limit points may turn back abruptly
        self.cusped = any(isinstance(test, Cusp) for test in tests)
        #: the functions of the tests at the last points
        self._functions: dict[Sample, Array] = {}
        self._last: _Step | None = None
        #: where curves cross in the step that was looked at last, and its ends
        self._crossing: tuple[Sample, Sample, LocatedEvent] | None = None

    def crossing(self, a: Sample, b: Sample) -> LocatedEvent | None:
        """Where curves cross between two neighbours of different orientation; None where none do."""
        if self._found(a, b) is None:
            with suppress(ConvergenceError):
                found = located(CurvesCross(), a, b, self.newton)
                self._crossing = None if found is None else (a, b, found)
        return self._found(a, b)

    def _found(self, a: Sample, b: Sample) -> LocatedEvent | None:
        """The crossing between them, if it is known."""
        known = self._crossing
        return known[2] if known is not None and known[0] is a and known[1] is b else None

    def refuses(self, a: Sample, b: Sample) -> bool:
        """Whether a step has gone over to another curve."""
        return self._examined(a, b).refused

    def _examined(self, a: Sample, b: Sample) -> _Step:
        if self._last is None or self._last.old is not a or self._last.new is not b:
            self._last = step = _Step(self, a, b)
            if step.size > 0.0:
                step.look()
        return self._last

    def passed(self, a: Sample, b: Sample, notes: list[Note]) -> list[LocatedEvent]:
        """The events between two neighbours, in the order met."""
        step = self._examined(a, b)
        notes += stretches_in_doubt(joined(step.unsettled), "Use a smaller max_step")
        self.keep(step.samples)
        self._functions = {s: known for s, known in self._functions.items() if s in self._behind}
        # parameters turn in a corner, see `follow`; the function of cusps jumps there
        tests = tuple(test for test in self.tests if not (step.corner and isinstance(test, Extremum | Cusp)))
        return events_between(step.inside, tests, self.newton, notes, self._found(a, b))

    def over_corner(self, a: Sample, b: Sample) -> bool:
        """Whether limit points turn back abruptly in a step."""
        return self._examined(a, b).corner

    def parted(self, p: Sample, q: Sample) -> bool:
        # determinants and null vectors belong to a discretisation
        return not p.curve.alike(q.curve) or super().parted(p, q)

    def functions(self, sample: Sample) -> Array:
        """The functions of the tests that are smooth along the curve: see `Interior.tests`."""
        known = self._functions.get(sample)
        if known is None:
            known = self._functions[sample] = np.array([test.smooth(sample) for test in self.tests]).T
        return known


class _Step(Interior):
    """One step of a tracked curve under examination.

    Where the harmonics have changed, the first sample is there twice, and the step is looked at from the second one on,
    that of the new harmonics. Events are those between the first and the others, see `events_between`.
    """

    steps: StepWatch

    def __init__(self, steps: StepWatch, old: Sample, new: Sample) -> None:
        super().__init__(steps, old, new, [f"two {test.kind} may lie" for test in steps.tests])
        self.start = old
        with suppress(ConvergenceError):
            self.start = same_discretisation(old, new, steps.newton)
        if self.start is not old:
            self.samples.insert(self.first + 1, self.start)

    @property
    def inside(self) -> list[Sample]:
        known = self.samples[self.first :]
        return known if self.start is self.old else [self.old, *known[2:]]

    def look(self) -> None:
        """Examine all of it."""
        self.examine([(self.start, self.new)])
        first, again, second = self.old, self.start, self.inside[1]
        for test, reason in zip(self.steps.tests, self.reasons, strict=True):
            if again is not first and test.changed(first, again) and test.changed(again, second):
                # of a pair that the change of harmonics may have brought about, or hidden, nothing is seen
                self.unsettled.append(unsettled(first, second, reason))
        # not over a corner, if it can be halved
        self.refused = self.refused or self.corner

    @property
    def corner(self) -> bool:
        """Whether limit points turn where a contact grazes, in either parameter, or in both as at a cusp, but abruptly:
        the function of cusps, by which smooth turns are told, jumps there.
        """
        if not self.steps.cusped:
            return False

        def turn(p: Sample, q: Sample) -> bool:
            return p.bend * q.bend < 0.0 or any(p.slopes[n] * q.slopes[n] < 0.0 for n in p.slopes)

        return any(turn(p, q) and self.steps.grazes(p, q) for p, q in itertools.pairwise(self.inside))

    def tests(self, stencil: Sequence[Sample]) -> list[Array]:
        return [self.steps.functions(one) for one in stencil]

    def relative(self, stencil: Sequence[Sample], k: int) -> Iterator[Array]:
        """See `Interior.relative`: with the least factor of `torus`."""
        if isinstance(self.steps.tests[k], PairCrossing):
            yield np.array([least_factor(sample.others) for sample in stencil])

    def solve(self, fraction: float) -> Sample:
        return Sample(point_between(self.old.point, self.new.point, fraction, self.steps.newton))

    def harmless(self, p: Sample, q: Sample, reason: str) -> bool:
        if reason not in self.reasons:
            return True
        test = self.steps.tests[self.reasons.index(reason)]
        return test.changed(p, q) or test.still(p) != test.still(q)
