"""The step "verify": motions and bifurcations of an earlier branch, held against shooting."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from pydantic import Field

from suboctave.analysis import Branch, BranchVerification, Table, TrackedBranch, verify
from suboctave.study.steps.base import (
    Complaint,
    Context,
    Named,
    Step,
    Surroundings,
    as_curve,
    as_table,
    check_branch,
    chosen_branch,
    key_of_curve,
)


class Verify(Step):
    """`so.verify` on every `every`-th point, on the bifurcations, or on both; `tolerance` as there."""

    kind: ClassVar[str] = "verify"

    branch: Named
    what: Literal["points", "bifurcations", "both"] = "both"
    every: int = Field(default=10, ge=1)
    tolerance: float = Field(default=1e-3, gt=0.0, lt=1.0)

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """See `Step.needs`."""
        return [(key_of_curve(self.branch, "branch"), as_curve(self.branch).analysis)]

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from check_branch(as_curve(self.branch), key_of_curve(self.branch, "branch"), around)
        if self.parameters:
            yield ("parameters",), "a branch is verified at the parameters that it was computed with: leave them out"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        curve = as_curve(self.branch)
        branch = chosen_branch(curve, context.results)
        found = None if isinstance(branch, TrackedBranch) else _whole(self, branch, context)
        rows = _one_by_one(self, branch, context) if found is None else _rows(found)
        names = ("what", "omega", "distance", "multiplier_error", "stable", "agrees", "outcome", "reason")
        kinds: tuple[Any, ...] = (str, float, float, float, str, bool, str, str)
        return Table(as_table(names, kinds, rows), f"{curve.said}, held against shooting", found)


def _whole(step: Verify, branch: Branch, context: Context) -> BranchVerification:
    """A branch of motions, all at once."""
    points = [] if step.what == "bifurcations" else range(0, len(branch), step.every)
    return verify(branch, step.tolerance, points=points, bifurcations=step.what != "points", progress=context.progress)


def _rows(found: BranchVerification) -> list[tuple[Any, ...]]:
    rows: list[tuple[Any, ...]] = [
        (f"point {p.index}", p.omega, p.distance, p.multiplier_error, _said(p.stable), p.agrees, p.outcome, p.reason)
        for p in found.points
    ]
    return rows + [
        (b.kind, b.omega, b.distance, float("nan"), "", b.agrees, _outcome(b.agrees), b.reason)
        for b in found.bifurcations
    ]


def _one_by_one(step: Verify, branch: Branch, context: Context) -> list[tuple[Any, ...]]:
    """Rows of a curve of bifurcations: its points as motions, its special points."""
    things: list[tuple[str, Any]] = []
    if step.what != "bifurcations":
        things += [(f"point {i}", branch.points[i]) for i in range(0, len(branch), step.every)]
    if step.what != "points":
        things += [(item.kind, item) for item in branch.bifurcations.met]
    rows = []
    for done, (name, thing) in enumerate(things):
        if context.progress is not None:
            context.progress(done / len(things), name)
        one = verify(thing, step.tolerance)
        said, outcome = _said(one.stable), _outcome(one.agrees)
        rows.append(
            (name, thing.orbit.omega, one.distance, one.multiplier_error, said, one.agrees, outcome, one.reason)
        )
    return rows


def _said(stable: bool | None) -> str:
    return "" if stable is None else "yes" if stable else "no"


def _outcome(agrees: bool) -> str:
    return "agrees" if agrees else "disagrees"
