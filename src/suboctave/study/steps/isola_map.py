"""The step "isola_map": in which region of two design parameters isolas exist, as a table of its borders."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from suboctave.analysis import Table, find_isolas, isola_map
from suboctave.study.steps.base import Complaint, Context, Range, Surroundings
from suboctave.study.steps.maps import MapStep, check_design


class IsolaRegions(MapStep):
    """`so.find_isolas` over `parameter`, then `so.isola_map` over `second`, as a table (`IsolaMap.to_table`)."""

    kind: ClassVar[str] = "isola_map"

    second: str
    second_bounds: Range
    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    probes: int = Field(default=3, ge=0)

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        wrong = list(check_design(self.second, self.second_bounds, ("second", "second_bounds"), around))
        yield from wrong
        if self.second == self.parameter:
            yield ("second",), f"must be another parameter than {self.parameter}"
        elif not wrong:
            low, high = sorted(self.second_bounds)
            here = around.system.parameters[self.second]
            if not low <= here <= high:
                yield ("second_bounds",), f"must hold the system's own {self.second} = {here:g}"
        if isinstance(self.values, int) and self.values < 2:
            yield ("values",), f"must be at least 2, or values of {self.parameter} themselves, not {self.values}"
        for i, value in enumerate(self.values if isinstance(self.values, list) else ()):
            if not min(self.bounds) <= value <= max(self.bounds):
                yield ("values", i), f"{value:g} lies outside the bounds"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        options = self.options(context)
        isolas = find_isolas(context.system, *self.ranges, values=self.values, depth=self.depth, **options)
        if not isolas or isolas.interrupted:
            said = "; ".join([isolas.said, *(f"note: {note}" for note in isolas.notes if isolas.interrupted)])
            return Table({}, said, stopped=isolas.interruption)
        bounds = self.second_bounds[0], self.second_bounds[1]
        found = isola_map(isolas, self.second, bounds, probes=self.probes, progress=context.progress)
        table = found.to_table()
        said = "; ".join([table.title, *(f"note: {note}" for note in found.notes)])
        return Table(table.columns, said, stopped=found.interruption)
