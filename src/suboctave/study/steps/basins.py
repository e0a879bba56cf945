"""The step "basins": which motion every state of a plane tends to, as shares or state by state."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from suboctave.analysis import Basins as Found
from suboctave.analysis import Table, basins
from suboctave.analysis.basins import check_plane
from suboctave.analysis.checks import check_range
from suboctave.analysis.integration import start_state
from suboctave.study.steps.base import (
    Complaint,
    Context,
    Named,
    Range,
    Step,
    Surroundings,
    as_curve,
    as_table,
    check_branch,
    chosen_branch,
    key_of_curve,
    tried,
)


class Basins(Step):
    """`so.basins`; `branches` are earlier ones whose stable motions at `omega` give the names, `what` the rows."""

    kind: ClassVar[str] = "basins"

    omega: float = Field(gt=0.0)
    box: list[Range] = Field(min_length=2, max_length=2)
    grid: list[int] = Field(default=[200, 200], min_length=2, max_length=2)
    coordinates: list[str] | None = None
    rest: list[float] | None = None
    branches: list[Named] = Field(default_factory=list)
    periods: int = Field(default=500, ge=1)
    tolerance: float = Field(default=1e-8, ge=1e-15, le=1e-2)
    what: Literal["shares", "states"] = "shares"

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """See `Step.needs`."""
        return [(("branches", i, *key_of_curve(b, "")[1:]), as_curve(b).analysis) for i, b in enumerate(self.branches)]

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        for i, branch in enumerate(self.branches):
            yield from check_branch(as_curve(branch), ("branches", i, *key_of_curve(branch, "")[1:]), around)
        for i, side in enumerate(self.box):
            for _, text in tried("box", partial(check_range, "box", (side[0], side[1]), False)):
                yield ("box", i), text
        if any(count < 1 for count in self.grid):
            yield ("grid",), "needs two positive numbers of states"
        yield from tried(
            "coordinates", lambda: check_plane(around.system, self.coordinates, around.system.observed_dof)
        )
        yield from tried("rest", lambda: start_state(around.system, self.rest))

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        given: dict[str, Any] = {}
        for one in self.branches:
            curve = as_curve(one)
            given[curve.said] = chosen_branch(curve, context.results)
        found = basins(
            context.system, omega=self.omega, box=(self._side(0), self._side(1)), grid=(self.grid[0], self.grid[1]),
            plane=None if self.coordinates is None else (self.coordinates[0], self.coordinates[1]), rest=self.rest,
            attractors=given or None, periods=self.periods, tolerance=self.tolerance, progress=context.progress,
        )  # fmt: skip
        said = f"basins at omega = {self.omega:g}"
        if self.what == "shares":
            frame = found.to_dataframe()
            return Table({name: frame[name].to_numpy() for name in frame.columns}, f"{said}, shares", found)
        return Table(_states(found), f"{said}, state by state", found)

    def _side(self, which: int) -> tuple[float, float]:
        return self.box[which][0], self.box[which][1]


def _states(found: Found) -> dict[str, np.ndarray]:
    names = found.names
    x, y = np.meshgrid(found.x, found.y)
    rows = list(
        zip(
            x.ravel(),
            y.ravel(),
            (names[label] for label in found.labels.ravel().tolist()),
            found.settling.ravel(),
            strict=True,
        )
    )
    return as_table((*found.plane, "motion", "settling"), (float, float, str, int), rows)
