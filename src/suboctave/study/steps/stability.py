"""The step "stability": multipliers of chosen motions of an earlier branch, by one method or by several."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from suboctave.analysis import Table, stability
from suboctave.study.options import as_stability
from suboctave.study.steps.base import (
    Complaint,
    Context,
    Motion,
    Named,
    Step,
    Surroundings,
    as_curve,
    as_table,
    check_branch,
    check_motion,
    chosen_branch,
    key_of_curve,
    tried,
)
from suboctave.study.steps.base import chosen as chosen_motion


class Stability(Step):
    """`so.stability` at `points` of `branch` and at its `bifurcations` of given kinds, by each of `methods`."""

    kind: ClassVar[str] = "stability"

    branch: Named
    points: list[int] | None = None
    bifurcations: list[str] = Field(default_factory=list)
    nearest: dict[str, float] | None = None
    methods: list[Any] | None = None

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """See `Step.needs`."""
        return [(key_of_curve(self.branch, "branch"), as_curve(self.branch).analysis)]

    def _motion(self, **choice: Any) -> Motion:
        curve = as_curve(self.branch)
        return Motion(analysis=curve.analysis, branch=curve.branch, label=curve.label, **choice)

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from check_branch(as_curve(self.branch), key_of_curve(self.branch, "branch"), around)
        if self.points is None and not self.bifurcations and self.nearest is None:
            yield (), "choose motions: points = [...], bifurcations = [...] or nearest = {omega = ...}"
        for i, kind in enumerate(self.bifurcations):
            for key, text in check_motion(self._motion(bifurcation=kind), (), around):
                yield ("bifurcations", i) if "bifurcation" in key else key, text
        yield from check_motion(self._motion(nearest=self.nearest), (), around)
        for method in self.methods or []:
            yield from tried("methods", partial(as_stability, method))
        if self.parameters:
            yield ("parameters",), "stability is that of motions as they were computed: leave them out"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
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
                found = stability(motion.orbit, as_stability(method))
                rows.append((name, motion.orbit.omega, found.method, found.stable, found.decided, found.note))
                multipliers.append(found.multipliers)
                errors.append(found.errors)
        names = ("what", "omega", "method", "stable", "decided", "note")
        kinds: tuple[Any, ...] = (str, float, str, bool, bool, str)
        columns = as_table(names, kinds, rows)
        for i in range(max((len(mu) for mu in multipliers), default=0)):
            for name, lists, sort in (("multiplier", multipliers, complex), ("error", errors, float)):
                columns[f"{name}_{i}"] = np.array([row[i] if i < len(row) else np.nan for row in lists], dtype=sort)
        return Table(columns, f"multipliers of {as_curve(self.branch).said}")
