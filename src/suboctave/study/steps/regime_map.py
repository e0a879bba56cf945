"""The step "regime_map": which stable motions exist over the plane of omega and a design parameter, as a table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from suboctave.analysis import Table, regime_map
from suboctave.study.steps.base import Complaint, Context, Surroundings
from suboctave.study.steps.maps import MapStep


class Regimes(MapStep):
    """`so.regime_map` as a table (`RegimeMap.to_table`); with `check` the title says what time integration found."""

    kind: ClassVar[str] = "regime_map"

    depth: int = Field(default=2, ge=0)
    values: int = Field(default=5, ge=1)
    resolution: float = Field(default=1e-4, gt=0.0, lt=0.5)
    search: list[int] = Field(default_factory=list)
    max_slices: int = Field(default=64, ge=1)
    check_points: int = Field(default=0, ge=0)
    seed: int = Field(default=0, ge=0)

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        for i, order in enumerate(self.search):
            if order < 1:
                yield ("search", i), f"is a period in periods of the load, at least 1, not {order}"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        found = regime_map(
            context.system,
            *self.ranges,
            depth=self.depth,
            values=self.values,
            resolution=self.resolution,
            search=tuple(self.search),
            max_slices=self.max_slices,
            **self.options(context),
        )
        table = found.to_table()
        said = [table.title, *(f"note: {note}" for note in found.notes)]
        if self.check_points and not found.interrupted:
            checked = found.check(self.check_points, self.seed, progress=context.progress)
            rate = 100.0 * checked.rate
            said.insert(1, f"{rate:.1f} % of {len(checked.landings)} trajectories in time agree")
        return Table(table.columns, "; ".join(said), stopped=found.interruption)
