"""The steps over a design parameter: isolas, the region of two parameters in which they exist, regimes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field

from suboctave.analysis.sensitivity import sensitivity
from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.kinds import KINDS, TRACKED_KINDS
from suboctave.maps.catalogue import checked_orders, checked_values
from suboctave.maps.isolas.map import IsolaMap, isola_map
from suboctave.maps.isolas.margin import design_margin
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.isolas.verb import checked_levels, find_isolas
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.verb import regime_map
from suboctave.store.table import Table
from suboctave.study.steps.base import (
    CheckContext,
    Complaint,
    Context,
    Curve,
    Motion,
    Range,
    Step,
    check_varied,
    tried,
)
from suboctave.study.steps.curves import FollowingStep, check_sweep


class DesignStep(FollowingStep):
    """A range of omega, a design parameter with its bounds, and the options of the verbs that follow curves."""

    omega: Range
    parameter: str
    bounds: Range
    max_curves: int = Field(default=64, ge=1)

    @property
    def varied(self) -> tuple[str, ...]:
        return (self.parameter,)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from check_design(around, self.parameter, self.bounds)
        yield from check_sweep(self.omega, around)

    def _check_values(self, values: int | list[float]) -> Iterator[Complaint]:
        low, high = sorted(self.bounds)
        yield from tried("values", lambda: checked_values("values", values, (low, high), least=2))


def check_design(
    around: CheckContext, name: str, bounds: list[float], keys: tuple[str, str] = ("parameter", "bounds")
) -> Iterator[Complaint]:
    """What is wrong with a design parameter and its bounds."""
    if name == "omega":
        hint = suggest("", around.system.parameters)
        yield (keys[0],), f"is the design parameter, beside omega: omega varies anyway{hint}"
    else:
        yield from check_varied(around, name, bounds, keys)


class FindIsolas(DesignStep, kind="find_isolas", verb=find_isolas, gives="isolas", besides=("at",)):
    """`so.find_isolas`; `at` are values of the parameter at which the closed branches are followed and kept."""

    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    levels: list[float] | None = None
    search: list[int] | None = None
    seeds: dict[str, Any] | None = None
    at: list[float] = Field(default_factory=list)

    @property
    def plane(self) -> tuple[str, str] | None:
        return "omega", self.parameter

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from self._check_values(self.values)
        low, high = sorted(self.bounds)
        for i, value in enumerate(self.at):
            if not low <= value <= high:
                yield ("at", i), f"{value:g} lies outside the bounds ({low:g}, {high:g})"
        yield from tried("search", lambda: checked_orders(self.search or (), 2))
        yield from tried("levels", lambda: checked_levels(self.levels))

    def run(self, context: Context) -> Isolas:
        isolas: Isolas = self.computed(context)
        notes = []  # on closed branches at the values asked for
        for isola in isolas:
            for value in self.at:
                if isolas.interrupted or value not in isola:
                    continue
                try:
                    branch = isola.at(value, progress=context.progress)
                except ConvergenceError as failure:
                    notes.append(f"the closed branch at {self.parameter} = {value:g}: {failure}")
                    continue
                if branch.interruption is not None:
                    missing = f"{branch.interruption}: the closed branches asked for are not all here"
                    return isolas.noting([missing, *notes], branch.interruption)
        for value in self.at:
            if not any(value in isola for isola in isolas):
                notes.append(f"no isola was found at {self.parameter} = {value:g}")
        return isolas.noting(notes)


class IsolaRegions(DesignStep, kind="isola_map", verb=find_isolas, besides=("second", "second_bounds", "probes")):
    """`so.find_isolas` over `parameter`, then `so.isola_map` over `second`, as a table (`IsolaMap.to_table`)."""

    second: str
    second_bounds: Range
    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    probes: int = Field(default=3, ge=0)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        wrong = list(check_design(around, self.second, self.second_bounds, ("second", "second_bounds")))
        yield from wrong
        if self.second == self.parameter:
            yield ("second",), f"must be another parameter than {self.parameter}"
        elif not wrong:
            low, high = sorted(self.second_bounds)
            here = around.system.parameters[self.second]
            if not low <= here <= high:
                yield ("second_bounds",), f"must hold the system's own {self.second} = {here:g}"
        yield from self._check_values(self.values)

    def run(self, context: Context) -> Table:
        isolas: Isolas = self.computed(context)
        if not isolas or isolas.interrupted:
            title = "; ".join([isolas.summary, *(f"note: {note}" for note in isolas.notes if isolas.interrupted)])
            return Table({}, title, stopped=isolas.interruption)
        bounds = self.second_bounds[0], self.second_bounds[1]
        regions = isola_map(isolas, self.second, bounds, probes=self.probes, progress=context.progress)
        return _table_of(regions)


class Regimes(DesignStep, kind="regime_map", verb=regime_map, besides=("check_points", "seed")):
    """`so.regime_map` as a table (`RegimeMap.to_table`); with `check` the title says what time integration found."""

    depth: int = Field(default=2, ge=0)
    values: int = Field(default=5, ge=1)
    resolution: float = Field(default=1e-4, gt=0.0, lt=0.5)
    search: list[int] | None = None
    max_slices: int = Field(default=64, ge=1)
    check_points: int = Field(default=0, ge=0)
    seed: int = Field(default=0, ge=0)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from tried("search", lambda: checked_orders(self.search or (), 1))

    def run(self, context: Context) -> Table:
        regimes: RegimeMap = self.computed(context)
        if not self.check_points or regimes.interrupted:
            return _table_of(regimes)
        checked = regimes.check(points=self.check_points, seed=self.seed, progress=context.progress)
        return _table_of(regimes, f"{100.0 * checked.rate:.1f} % of {len(checked.landings)} trajectories in time agree")


def _table_of(of_map: IsolaMap | RegimeMap, *more: str) -> Table:
    """The table of a map, which is kept beside it, its notes in the title."""
    table = of_map.to_table()
    title = [table.title, *more, *(f"note: {note}" for note in of_map.notes)]
    return Table(table.columns, "; ".join(title), of_map)


# ------------------------------------------------------------------------------------- what parameters do to an event
class _ByParameters(Step):
    """Says what parameters, `by`, do to something of an earlier analysis, which has values of its own."""

    by: list[str] | None = None

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if self.parameters:
            yield ("parameters",), "the analysis before this one has its own: leave them out"
        known = ["omega", *around.system.parameters]
        for i, name in enumerate(self.by or ()):
            if name not in known:
                yield ("by", i), f"there is no parameter {name!r}{suggest(name, known)}"


class Sensitivities(_ByParameters, kind="sensitivity"):
    """`so.sensitivity` of a bifurcation of an earlier analysis, by the parameters `by` or by all."""

    start: Motion

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        kind, known = self.start.bifurcation, (*TRACKED_KINDS, "extremum", "isola_centre", "isola_merging")
        if kind is None:
            yield ("start",), 'name a bifurcation: start = { analysis = "response", bifurcation = "PD" }'
        elif kind in KINDS and kind not in known:
            yield ("start", "bifurcation"), f"sensitivities are of {', '.join(known)}"

    def run(self, context: Context) -> Table:
        found = sensitivity(self.start.chosen(context.results), by=self.by)
        columns = found.to_dataframe().reset_index()
        where = ", ".join(f"{name} = {value:.7g}" for name, value in found.position.items())
        title = f"{self.start.words}: {found.kind} at {where}"
        return Table({str(name): column.to_numpy() for name, column in columns.items()}, title)


class Margin(_ByParameters, kind="design_margin"):
    """`so.design_margin` of an isola of an earlier analysis: the nearest values of the parameters `by` without it."""

    isola: Curve
    by: list[str] = Field(min_length=1)
    at: float | None = None
    scales: dict[str, float] | None = None
    end: Literal["born", "merges"] = "born"

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        before = around.before.get(self.isola.analysis)
        if before is not None and before.gives != "isolas":
            yield self.isola.key("isola"), f"the analysis {self.isola.analysis!r} looks for no isolas"
        elif self.isola.at is not None:
            yield ("isola", "at"), "the value of the design parameter stands beside: at = ..."

    def run(self, context: Context) -> Table:
        isolas = context.results.get(self.isola.analysis)
        if not isinstance(isolas, Isolas):
            raise InputError(f"the analysis {self.isola.analysis!r} gave no isolas")
        found = design_margin(self.isola.isola_of(isolas), by=self.by, at=self.at, scales=self.scales, end=self.end)
        rows = [(name, found.design[name], found.values[name], found.scaled[name]) for name in found.values]
        title = f"{self.isola.words}: design margin {found.distance:.6g} ({found.linear:.6g} to first order)"
        return Table.of_rows(("parameter", "design", "gone_at", "change_in_scales"), rows, title)
