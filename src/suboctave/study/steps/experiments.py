"""The steps in time: basins, Lyapunov exponents, the virtual stepped-sine test; each gives a table."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from suboctave.experiments.basins.verb import Basins as BasinsResult, basins, check_plane
from suboctave.experiments.common import start_state
from suboctave.experiments.lyapunov import lyapunov_exponents
from suboctave.experiments.stepped_sine import check_stepped_sine, stepped_sine
from suboctave.model.inputs import check_range
from suboctave.store.table import Table
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Named,
    Range,
    Step,
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

    def check(self, around: CheckContext) -> Iterator[Complaint]:
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
            given[curve.words] = chosen_branch(curve, context.results)
        result = basins(
            context.system, omega=self.omega, box=(self._side(0), self._side(1)), grid=(self.grid[0], self.grid[1]),
            plane=None if self.coordinates is None else (self.coordinates[0], self.coordinates[1]), rest=self.rest,
            attractors=given or None, periods=self.periods, tolerance=self.tolerance, progress=context.progress,
        )  # fmt: skip
        title = f"basins at omega = {self.omega:g}"
        if self.what == "shares":
            frame = result.to_dataframe()
            return Table({name: frame[name].to_numpy() for name in frame.columns}, f"{title}, shares", result)
        return Table(_states(result), f"{title}, state by state", result)

    def _side(self, which: int) -> tuple[float, float]:
        return self.box[which][0], self.box[which][1]


def _states(result: BasinsResult) -> dict[str, np.ndarray]:
    names = result.names
    x, y = np.meshgrid(result.x, result.y)
    rows = list(
        zip(
            x.ravel(),
            y.ravel(),
            (names[label] for label in result.labels.ravel().tolist()),
            result.settling.ravel(),
            strict=True,
        )
    )
    return as_table((*result.plane, "motion", "settling"), (float, float, str, int), rows)


class Lyapunov(Step):
    """`so.lyapunov_exponents` from a `state`, default rest, at one frequency."""

    kind: ClassVar[str] = "lyapunov_exponents"

    omega: float = Field(gt=0.0)
    state: list[float] | None = None
    periods: int = Field(default=1000, ge=1)
    transient: int = Field(default=300, ge=0)
    count: int | None = Field(default=None, ge=1)
    trajectories: int = Field(default=16, ge=1)
    tolerance: float | None = Field(default=None, ge=1e-15, le=1e-2)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from tried("state", lambda: start_state(around.system, self.state))
        if self.count is not None and self.count > 2 * around.system.n:
            yield ("count",), f"is at most {2 * around.system.n}, two for each degree of freedom"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        result = lyapunov_exponents(
            context.system, self.state, omega=self.omega, periods=self.periods, transient=self.transient,
            count=self.count, trajectories=self.trajectories, tolerance=self.tolerance, progress=context.progress,
        )  # fmt: skip
        rows = list(zip(result.exponents, result.standard_errors, result.per_period, strict=True))
        names = ("exponent", "standard_error", "per_period")
        title = f"Lyapunov exponents at omega = {self.omega:g}"
        return Table(as_table(names, (float, float, float), rows), title, result)


#: omega, degree of freedom, change of velocity
Tap = Annotated[list[float], Field(min_length=3, max_length=3)]


class SteppedSineStep(Step):
    """`so.stepped_sine` over `omega` in `steps`; `state` and the rest as there."""

    kind: ClassVar[str] = "stepped_sine"

    omega: Range
    steps: int = Field(default=200, ge=1)
    direction: Literal["up", "down", "both"] = "up"
    settle: int = Field(default=200, ge=1)
    measure: int = Field(default=60, ge=1)
    state: list[float] | None = None
    tap: Tap | None = None
    harmonics: list[float] = Field(default_factory=lambda: [0.0, 0.5, 1.0, 2.0, 3.0])
    noise: float = Field(default=0.0, ge=0.0)
    seed: int = Field(default=0, ge=0)
    observe: int | None = None

    def _arguments(self) -> dict[str, Any]:
        names = ("steps", "direction", "settle", "measure", "state", "harmonics", "noise", "seed", "observe")
        tap = self.tap and (self.tap[0], int(self.tap[1]), self.tap[2])
        return {name: getattr(self, name) for name in names} | {"tap": tap}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """See `Step.check`."""
        if self.tap is not None and self.tap[1] != int(self.tap[1]):
            yield ("tap",), "tap is [omega, degree of freedom, change of velocity]: the second is a whole number"
            return
        arguments = self._arguments()
        yield from tried("omega", lambda: check_stepped_sine(around.system, tuple(self.omega), **arguments))

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        result = stepped_sine(context.system, tuple(self.omega), progress=context.progress, **self._arguments())
        frame = result.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame}
        title = f"stepped sine {' and '.join(result.directions)}, amplitudes of x_{result.observed}"
        return Table(columns, title, result)
