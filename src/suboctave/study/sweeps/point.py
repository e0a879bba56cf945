"""A study at one point of a sweep: what a worker computes. It depends on the study and the point alone."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from suboctave.errors import InputError, shortened
from suboctave.interruption import time_limit
from suboctave.study.file import Study
from suboctave.study.results import Result, Results
from suboctave.study.runner import analysed
from suboctave.study.sweeps.quantities import Row, quantities
from suboctave.study.sweeps.result import OWN, Computed

Measure = Callable[[Results], Mapping[str, float]]


@dataclass(frozen=True)
class AtPoint:
    """The study at given values of its parameters: quantities of its analyses, and what `measure` makes of them."""

    study: Study
    listed: int
    measure: Measure | None = None

    def __call__(self, values: Mapping[str, float]) -> Computed:
        begin = perf_counter()
        row: Row = {}
        try:
            failures = self._fill(row, values)
        except Exception as error:  # of a user's own function, or a mistake of ours: this point only
            failures = [str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"]
        return Computed(row, "; ".join(failures), perf_counter() - begin)

    def _fill(self, row: Row, values: Mapping[str, float]) -> list[str]:
        """Run the analyses in order; what failed, in words."""
        study = replace(self.study, system=self.study.system.with_parameters(values))
        results: dict[str, Result] = {}
        failures: list[str] = []
        with time_limit(study.seconds) as limit:
            for step in study.steps:
                done = analysed(study, step, results)
                words = done.failure or ("" if done.interruption is None else str(done.interruption))
                if words:
                    failures.append(f"{step.name}: {words}")
                elif done.result is not None:
                    results[step.name] = done.result
                    row |= quantities({step.name: done.result}, self.listed)
                if limit is not None and limit.reached:
                    break
        if self.measure is not None and not failures:
            measured = self.measure(Results(results, {"title": study.title}))
            row |= _numbers(measured, (*OWN, *values, *row))
        return failures


def _numbers(measured: Any, taken: Collection[str]) -> Row:
    """What a user's function gave, as floats."""
    if not isinstance(measured, Mapping):
        raise InputError(f"measure must give a mapping of names to numbers, not {shortened(measured)}")
    numbers: Row = {}
    for name, value in measured.items():
        if not isinstance(name, str) or not name or "/" in name or name in taken:
            raise InputError(f"measure gives {name!r}, which cannot be the name of a quantity, or is one already")
        try:
            numbers[name] = float(value)
        except (TypeError, ValueError):
            raise InputError(f"measure gives {name} = {shortened(value)}: give a number") from None
    return numbers
