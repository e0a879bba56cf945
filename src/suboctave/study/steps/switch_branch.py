"""The step "switch_branch": the other branch at a period doubling or a branch point of an earlier one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from suboctave.analysis import Branch, switch_branch
from suboctave.analysis.checks import check_bounds, check_range
from suboctave.analysis.switching import check_left
from suboctave.bifurcation import KINDS
from suboctave.study.steps.base import Complaint, Context, Known, Motion, Range, Surroundings, chosen, tried
from suboctave.study.steps.curves import CurveStep


class SwitchBranch(CurveStep):
    """`so.switch_branch` at a bifurcation of an earlier branch; what is not given is as it was there."""

    kind: ClassVar[str] = "switch_branch"

    start: Motion
    side: Literal[1, -1] | None = None
    bounds: Range | None = None

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        kind = self.start.bifurcation
        if kind is None:
            yield ("start",), 'name the bifurcation that it leaves: bifurcation = "PD" or "BP", with index = 0, 1, ...'
        elif kind in KINDS:
            yield from tried("start", lambda: check_left(kind))
        if self.bounds is not None:
            yield from tried("bounds", lambda: self._check_bounds(around))
        yield from self.differing(around)

    def _check_bounds(self, around: Surroundings) -> None:
        source = self.inherited(around)
        if source is None:
            check_range("bounds", self.bounds)
        else:
            check_bounds(around.system, source.free, self.bounds)

    def known(self, around: Surroundings) -> Known | None:
        """See `Step.known`."""
        return self.inherited(around)

    def run(self, context: Context) -> Branch:
        """See `Step.run`."""
        item = chosen(self.start, context.results)
        self._moved(item.orbit, context)
        options: dict[str, Any] = self.options(context)
        if self.bounds is not None:
            options["bounds"] = tuple(self.bounds)
        return switch_branch(item, self.side, **options)
