"""The steps that examine motions of an earlier branch: multipliers by several methods, comparison with shooting."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.table import Table
from suboctave.study.options import as_stability
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Curve,
    Motion,
    Named,
    Step,
    as_curve,
    as_table,
    check_branch,
    check_motion,
    chosen as chosen_motion,
    chosen_branch,
    key_of_curve,
    tried,
)
from suboctave.verification.motion import stability
from suboctave.verification.verify import verify


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
