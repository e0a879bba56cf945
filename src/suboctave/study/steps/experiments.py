"""The steps in time, which give tables: basins, Lyapunov exponents, stepped sine, comparison of earlier
branches with shooting; and the multipliers of their motions by several methods.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from suboctave.experiments.basins import Basins as BasinsResult, basins, check_plane
from suboctave.experiments.lyapunov import lyapunov_exponents
from suboctave.experiments.stepped_sine import check_stepped_sine, stepped_sine
from suboctave.model.inputs import check_range, start_state
from suboctave.results.branch import TrackedBranch
from suboctave.store.table import Table
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Curve,
    Motion,
    Named,
    Range,
    Step,
    as_curve,
    as_stability,
    as_table,
    check_branch,
    check_motion,
    chosen as chosen_motion,
    chosen_branch,
    key_of_curve,
    tried,
)
from suboctave.verification.branch import verify
from suboctave.verification.motion import stability


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
        return [(("branches", i, *key_of_curve(b, "")[1:]), as_curve(b).analysis) for i, b in enumerate(self.branches)]

    def check(self, around: CheckContext) -> Iterator[Complaint]:
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
        given = {as_curve(one).words: chosen_branch(as_curve(one), context.results) for one in self.branches}
        own = self.own("coordinates", "branches", "what") | {"plane": self.coordinates}
        result = basins(context.system, attractors=given or None, progress=context.progress, **own)
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
        yield from tried("state", lambda: start_state(around.system, self.state))
        if self.count is not None and self.count > 2 * around.system.n:
            yield ("count",), f"is at most {2 * around.system.n}, two for each degree of freedom"

    def run(self, context: Context) -> Table:
        result = lyapunov_exponents(context.system, progress=context.progress, **self.own())
        values = (result.exponents, result.standard_errors, result.per_period)
        columns = dict(zip(("exponent", "standard_error", "per_period"), values, strict=True))
        return Table(columns, f"Lyapunov exponents at omega = {self.omega:g}", result)


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
        tap = self.tap and (self.tap[0], int(self.tap[1]), self.tap[2])
        return self.own("omega") | {"tap": tap}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        if self.tap is not None and self.tap[1] != int(self.tap[1]):
            yield ("tap",), "tap is [omega, degree of freedom, change of velocity]: the second is a whole number"
            return
        arguments = self._arguments()
        yield from tried("omega", lambda: check_stepped_sine(around.system, tuple(self.omega), **arguments))

    def run(self, context: Context) -> Table:
        result = stepped_sine(context.system, tuple(self.omega), progress=context.progress, **self._arguments())
        frame = result.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame}
        title = f"stepped sine {' and '.join(result.directions)}, amplitudes of x_{result.observed}"
        return Table(columns, title, result)


# ----------------------------------------------------------------------------------------- motions of an earlier branch
class BranchStep(Step):
    """What it says is of the motions of a `branch`, at the parameters that they were computed with."""

    branch: Named

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        return [(key_of_curve(self.branch, "branch"), as_curve(self.branch).analysis)]

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from check_branch(as_curve(self.branch), key_of_curve(self.branch, "branch"), around)
        if self.parameters:
            yield ("parameters",), "its motions have the parameters that they were computed with: leave them out"


class Verify(BranchStep):
    """`so.verify` on every `every`-th point, on the bifurcations, or on both; `tolerance` as there."""

    kind: ClassVar[str] = "verify"

    what: Literal["points", "bifurcations", "both"] = "both"
    every: int = Field(default=10, ge=1)
    tolerance: float = Field(default=1e-3, gt=0.0, lt=1.0)

    def run(self, context: Context) -> Table:
        curve = as_curve(self.branch)
        branch = chosen_branch(curve, context.results)
        points = [] if self.what == "bifurcations" else range(0, len(branch), self.every)
        bifurcations = self.what != "points"
        if isinstance(branch, TrackedBranch):  # its points as motions, and its special points, one by one
            things: list[tuple[str, Any]] = [(f"point {i}", branch.points[i]) for i in points]
            things += [(item.kind, item) for item in branch.bifurcations.met] if bifurcations else []
            whole, rows = None, []
            for done, (name, thing) in enumerate(things):
                if context.progress is not None:
                    context.progress(done / len(things), name)
                one = verify(thing, self.tolerance)
                outcome = "agrees" if one.agrees else "disagrees"
                rows.append(_row(name, one, one.multiplier_error, _word(one.stable), outcome, thing.orbit.omega))
        else:
            progress = context.progress
            whole = verify(branch, self.tolerance, points=points, bifurcations=bifurcations, progress=progress)
            rows = [
                _row(f"point {p.index}", p, p.multiplier_error, _word(p.stable), p.outcome, p.omega)
                for p in whole.points
            ]
            rows += [
                _row(b.kind, b, float("nan"), "", "agrees" if b.agrees else "disagrees", b.omega)
                for b in whole.bifurcations
            ]
        names = ("what", "omega", "distance", "multiplier_error", "stable", "agrees", "outcome", "reason")
        kinds: tuple[Any, ...] = (str, float, float, float, str, bool, str, str)
        return Table(as_table(names, kinds, rows), f"{curve.words}, held against shooting", whole)


def _row(what: str, check: Any, error: float, stable: str, outcome: str, omega: float) -> tuple[Any, ...]:
    """What a table says of something that was held against shooting."""
    return what, omega, check.distance, error, stable, check.agrees, outcome, check.reason


def _word(stable: bool | None) -> str:
    return "" if stable is None else "yes" if stable else "no"


class Stability(BranchStep):
    """`so.stability` at `points` of `branch` and at its `bifurcations` of given kinds, by each of `methods`."""

    kind: ClassVar[str] = "stability"

    points: list[int] | None = None
    bifurcations: list[str] = Field(default_factory=list)
    nearest: dict[str, float] | None = None
    methods: list[Any] | None = None

    def _motion(self, **choice: Any) -> Motion:
        curve = as_curve(self.branch)
        return Motion(**{name: getattr(curve, name) for name in Curve.model_fields}, **choice)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.points is None and not self.bifurcations and self.nearest is None:
            yield (), "choose motions: points = [...], bifurcations = [...] or nearest = {omega = ...}"
        for i, kind in enumerate(self.bifurcations):
            for key, text in check_motion(self._motion(bifurcation=kind), (), around):
                yield ("bifurcations", i) if "bifurcation" in key else key, text
        yield from check_motion(self._motion(nearest=self.nearest), (), around)
        for method in self.methods or []:
            yield from tried("methods", partial(as_stability, method))

    def run(self, context: Context) -> Table:
        motions: list[tuple[str, Any]] = []
        for point in self.points or []:
            motions.append((f"point {point}", chosen_motion(self._motion(point=point), context.results)))
        branch = chosen_branch(as_curve(self.branch), context.results)
        for kind in self.bifurcations:
            motions += [(kind, item) for item in branch.bifurcations[kind]]
        if self.nearest is not None:
            motions.append(("nearest", chosen_motion(self._motion(nearest=self.nearest), context.results)))
        rows, multipliers, errors = [], [], []
        for name, motion in motions:
            for method in self.methods or [None]:
                verdict = stability(motion.orbit, as_stability(method))
                rows.append((name, motion.orbit.omega, verdict.method, verdict.stable, verdict.decided, verdict.note))
                multipliers.append(verdict.multipliers)
                errors.append(verdict.errors)
        names = ("what", "omega", "method", "stable", "decided", "note")
        kinds: tuple[Any, ...] = (str, float, str, bool, bool, str)
        columns = as_table(names, kinds, rows)
        for i in range(max((len(mu) for mu in multipliers), default=0)):
            for name, lists, sort in (("multiplier", multipliers, complex), ("error", errors, float)):
                columns[f"{name}_{i}"] = np.array([row[i] if i < len(row) else np.nan for row in lists], dtype=sort)
        return Table(columns, f"multipliers of {as_curve(self.branch).words}")
