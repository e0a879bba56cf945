"""The step "verify": motions and bifurcations of an earlier branch, held against shooting."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from pydantic import Field

from suboctave.analysis import Table, verify
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
        things: list[tuple[str, Any]] = []
        if self.what != "bifurcations":
            things += [(f"point {i}", branch.points[i]) for i in range(0, len(branch), self.every)]
        if self.what != "points":
            things += [(item.kind, item) for item in branch.bifurcations.met]
        rows = []
        for done, (name, thing) in enumerate(things):
            if context.progress is not None:
                context.progress(done / len(things), name)
            found = verify(thing, self.tolerance)
            stable = "" if found.stable is None else "yes" if found.stable else "no"
            rows.append(
                (name, thing.orbit.omega, found.distance, found.multiplier_error, stable, found.agrees, found.reason)
            )
        names = ("what", "omega", "distance", "multiplier_error", "stable", "agrees", "reason")
        kinds: tuple[Any, ...] = (str, float, float, float, str, bool, str)
        return Table(as_table(names, kinds, rows), f"{curve.said}, held against shooting")
