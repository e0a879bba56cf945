"""The steps for systems that nothing drives: equilibria, and the limit cycles that begin at their Hopf points."""

from __future__ import annotations

from collections.abc import Iterator

from suboctave.analysis.equilibria import check_undriven, equilibria
from suboctave.analysis.limit_cycles import limit_cycles
from suboctave.model.inputs import check_range
from suboctave.study.results import Result
from suboctave.study.steps.base import CheckContext, Complaint, Context, Known, Motion, Range, check_varied, tried
from suboctave.study.steps.curves import AlongParameter, CurveStep


class EquilibriaStep(AlongParameter, kind="equilibria", verb=equilibria, gives="branch"):
    """`so.equilibria`; `start` has the displacements that are meant at the first value."""

    start: list[float] | None = None
    highest: float | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from tried("", lambda: check_undriven(around.system))
        if self.harmonics is not None:
            yield ("harmonics",), "equilibria have none: leave it out"
        if self.start is not None and len(self.start) != around.system.n:
            yield ("start",), f"needs {around.system.n} displacements, not {len(self.start)}"

    def known(self, around: CheckContext) -> Known:
        """See `Step.known`."""
        values = around.system.parameters
        return Known(self.parameter, {name: value for name, value in values.items() if name != self.parameter})


class LimitCyclesStep(CurveStep, kind="limit_cycles", verb=limit_cycles):
    """`so.limit_cycles` from a Hopf point, or from any motion that nothing drives."""

    start: Motion
    parameter: str | None = None
    bounds: Range | None = None
    omega: Range | None = None
    unloaded: bool = False

    @property
    def varied(self) -> tuple[str, ...]:
        return () if self.parameter is None else (self.parameter,)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.parameter is None and self.start.bifurcation != "Hopf":
            yield ("parameter",), "say over which; only from a Hopf point it is that along which this was found"
        if self.parameter is not None and self.bounds is None and self.start.bifurcation is None:
            yield ("bounds",), f"needs the range [from, to] of {self.parameter}"
        if self.parameter is not None and self.bounds is not None:
            yield from check_varied(around, self.parameter, self.bounds)
        if self.omega is not None:
            yield from tried("omega", lambda: check_range("omega", self.omega, positive=True))
        if self.events:
            yield ("events",), "is no option of limit cycles: leave it out"
        yield from self.differing(around)

    def known(self, around: CheckContext) -> Known | None:
        """See `Step.known`: their parameter."""
        source = self.inherited(around)
        name = self.parameter or (source.free if source else None)
        values = around.system.parameters if source is None else source.values
        return None if name is None else Known(name, {key: value for key, value in values.items() if key != name})

    def run(self, context: Context) -> Result:
        return self.computed(context, self.started(context))
