"""The steps in time, which give tables: basins, Lyapunov exponents, stepped sine, comparison of earlier
branches with shooting; and the multipliers of their motions by several methods.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from suboctave.experiments.basins import Basins as BasinsResult, basins
from suboctave.experiments.common import check_plane
from suboctave.experiments.lyapunov import lyapunov_exponents
from suboctave.experiments.stepped_sine import check_stepped_sine, stepped_sine
from suboctave.model.inputs import check_range
from suboctave.store.plain import padded
from suboctave.store.table import Table
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Curve,
    Motion,
    Range,
    State,
    Step,
    as_stability,
    tried,
)
from suboctave.verification.verify import stability, verify


class Basins(Step, kind="basins", verb=basins, besides=("coordinates", "branches", "what")):
    """`so.basins`; `branches` are earlier ones whose stable motions at `omega` give the names, `what` the rows."""

    omega: float = Field(gt=0.0)
    box: list[Range] = Field(min_length=2, max_length=2)
    grid: list[int] = Field(default=[200, 200], min_length=2, max_length=2)
    coordinates: list[str] | None = None
    start: State = None
    branches: list[Curve] = Field(default_factory=list)
    periods: int = Field(default=500, ge=1)
    tolerance: float = Field(default=1e-8, ge=1e-15, le=1e-2)
    what: Literal["shares", "states"] = "shares"

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        for i, side in enumerate(self.box):
            yield from ((("box", i), text) for _, text in tried("box", partial(check_range, "box", side)))
        if any(count < 1 for count in self.grid):
            yield ("grid",), "needs two positive numbers of states"
        system = around.system
        yield from tried("coordinates", lambda: check_plane(system, self.coordinates, system.observed_dof))

    def run(self, context: Context) -> Table:
        attractors = {one.words: one.of(context.results) for one in self.branches}
        result = self.computed(context, plane=self.coordinates, attractors=attractors or None)
        title = f"basins at omega = {self.omega:g}"
        if self.what == "shares":
            frame = result.to_dataframe()
            return Table({name: frame[name].to_numpy() for name in frame.columns}, f"{title}, shares", result)
        return Table(_states(result), f"{title}, state by state", result)


def _states(result: BasinsResult) -> dict[str, np.ndarray]:
    x, y = np.meshgrid(result.x, result.y)
    motion = [result.names[label] for label in result.labels.ravel().tolist()]
    columns = (x.ravel(), y.ravel(), np.array(motion, dtype=str), result.settling.ravel().astype(int))
    return dict(zip((*result.plane, "motion", "settling"), columns, strict=True))


class Lyapunov(Step, kind="lyapunov_exponents", verb=lyapunov_exponents):
    """`so.lyapunov_exponents` from a `start`, default rest, at one frequency."""

    omega: float = Field(gt=0.0)
    start: State = None
    transient: int = Field(default=300, ge=0)
    periods: int = Field(default=1000, ge=1)
    count: int | None = Field(default=None, ge=1)
    trajectories: int = Field(default=16, ge=1)
    tolerance: float | None = Field(default=None, ge=1e-15, le=1e-2)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.count is not None and self.count > 2 * around.system.n:
            yield ("count",), f"is at most {2 * around.system.n}, two for each degree of freedom"

    def run(self, context: Context) -> Table:
        result = self.computed(context)
        values = (result.exponents, result.standard_errors, result.per_period)
        columns = dict(zip(("exponent", "standard_error", "per_period"), values, strict=True))
        return Table(columns, f"Lyapunov exponents at omega = {self.omega:g}", result)


#: omega, degree of freedom, change of velocity
Tap = Annotated[list[float], Field(min_length=3, max_length=3)]


class SteppedSineStep(Step, kind="stepped_sine", verb=stepped_sine):
    """`so.stepped_sine` over `omega`; all else as there."""

    omega: Range
    values: int | list[float] = 201
    direction: str | list[str] = "up"
    start: list[float] | None = None
    transient: int = Field(default=200, ge=1)
    periods: int = Field(default=60, ge=1)
    tap: Tap | None = None
    harmonics: list[float] = Field(default_factory=lambda: [0.0, 0.5, 1.0, 2.0, 3.0])
    noise: float = Field(default=0.0, ge=0.0)
    seed: int = Field(default=0, ge=0)
    observe: int | str | None = None

    def arguments(self, context: CheckContext | Context) -> dict[str, Any]:
        tap = self.tap and (self.tap[0], int(self.tap[1]), self.tap[2])
        return {**super().arguments(context), "tap": tap, "start": self.start}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        if self.tap is not None and self.tap[1] != int(self.tap[1]):
            yield ("tap",), "tap is [omega, degree of freedom, change of velocity]: the second is a whole number"
            return
        yield from tried("omega", lambda: check_stepped_sine(around.system, **self.arguments(around)))

    def run(self, context: Context) -> Table:
        result = self.computed(context)
        title = f"stepped sine {' and '.join(result.directions)}, amplitudes of x_{result.observed}"
        return Table(result.to_table().columns, title, result)


# ----------------------------------------------------------------------------------------- motions of an earlier branch
class BranchStep(Step):
    """What it says is of the motions of a `branch`, at the parameters that they were computed with."""

    branch: Curve

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.parameters:
            yield ("parameters",), "its motions have the parameters that they were computed with: leave them out"


class Verify(BranchStep, kind="verify"):
    """`so.verify` on every `every`-th point, on the bifurcations, or on both; `tolerance` as there."""

    what: Literal["points", "bifurcations", "both"] = "both"
    every: int = Field(default=10, ge=1)
    tolerance: float = Field(default=1e-3, gt=0.0, lt=1.0)

    def run(self, context: Context) -> Table:
        branch = self.branch.of(context.results)
        points = [] if self.what == "bifurcations" else range(0, len(branch), self.every)
        bifurcations = self.what != "points"
        asked: dict[str, Any] = {"points": points, "bifurcations": bifurcations, "progress": context.progress}
        whole = verify(branch, tolerance=self.tolerance, **asked)
        rows = [_row(f"point {p.index}", p.omega, p, p.multiplier_error, p.stable, p.outcome) for p in whole.points]
        rows += [_row(b.kind, b.omega, b) for b in whole.bifurcations]
        names = ("what", "omega", "distance", "multiplier_error", "stable", "agrees", "outcome", "reason")
        table = Table.of_rows(names, rows, f"{self.branch.words}, held against shooting")
        return Table(table.columns, table.title, whole)


def _row(
    what: str, omega: float, check: Any, error: float = np.nan, stable: bool | None = None, outcome: str = ""
) -> tuple[Any, ...]:
    """What a table says of something that was held against shooting."""
    verdict = "" if stable is None else "yes" if stable else "no"
    outcome = outcome or ("agrees" if check.agrees else "disagrees")
    return what, omega, check.distance, error, verdict, check.agrees, outcome, check.reason


class Stability(BranchStep, kind="stability"):
    """`so.stability` at `points` of `branch` and at its `bifurcations` of given kinds, by each of `methods`."""

    points: list[int] | None = None
    bifurcations: list[str] = Field(default_factory=list)
    nearest: dict[str, float] | None = None
    methods: list[Any] | None = None

    def _motion(self, **choice: Any) -> Motion:
        return Motion(**{name: getattr(self.branch, name) for name in Curve.model_fields}, **choice)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.points is None and not self.bifurcations and self.nearest is None:
            yield (), "choose motions: points = [...], bifurcations = [...] or nearest = {omega = ...}"
        for i, kind in enumerate(self.bifurcations):
            for _, text in self._motion(bifurcation=kind).check_choice((), around.system):
                yield ("bifurcations", i), text
        yield from self._motion(nearest=self.nearest).check_choice((), around.system)
        for method in self.methods or []:
            yield from tried("methods", partial(as_stability, method))

    def run(self, context: Context) -> Table:
        results, branch = context.results, self.branch.of(context.results)
        motions: list[tuple[str, Any]] = [
            (f"point {point}", self._motion(point=point).chosen(results)) for point in self.points or []
        ]
        motions += [(kind, item) for kind in self.bifurcations for item in branch.bifurcations[kind]]
        if self.nearest is not None:
            motions.append(("nearest", self._motion(nearest=self.nearest).chosen(results)))
        rows, multipliers, errors = [], [], []
        for name, motion in motions:
            for method in self.methods or [None]:
                verdict = stability(motion.orbit, method=None if method is None else as_stability(method))
                rows.append((name, motion.orbit.omega, verdict.method, verdict.stable, verdict.decided, verdict.note))
                multipliers.append(verdict.multipliers)
                errors.append(verdict.errors)
        names = ("what", "omega", "method", "stable", "decided", "note")
        table = Table.of_rows(names, rows, f"multipliers of {self.branch.words}")
        columns = dict(table.columns)
        for i, both in enumerate(zip(padded(multipliers, complex).T, padded(errors, float).T, strict=True)):
            columns |= dict(zip((f"multiplier_{i}", f"error_{i}"), both, strict=True))
        return Table(columns, table.title)
