"""The steps over a design parameter: isolas, the region of two parameters in which they exist, regimes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from suboctave.errors import ConvergenceError, suggest
from suboctave.maps.catalogue import checked_orders
from suboctave.maps.isolas.map import isola_map
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.isolas.verb import checked_levels, find_isolas
from suboctave.maps.regimes.verb import regime_map
from suboctave.model.inputs import check_bounds, check_parameter
from suboctave.store.table import Table
from suboctave.study.steps.base import CheckContext, Complaint, Context, Range, as_seeds, read_by, tried
from suboctave.study.steps.curves import FollowingStep, check_sweep


class DesignStep(FollowingStep):
    """A range of omega, a design parameter with its bounds, and the options of the verbs that follow curves."""

    omega: Range
    parameter: str
    bounds: Range
    max_curves: int = Field(default=64, ge=1)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from check_design(self.parameter, self.bounds, ("parameter", "bounds"), around)
        if self.parameter in self.parameters:
            yield ("parameters", self.parameter), "is the parameter that varies: its range is in bounds"
        yield from check_sweep(self.omega, around)

    def options(self, context: Context) -> dict[str, Any]:
        """The arguments of the verb that were given."""
        return super().options(context) | {"max_curves": self.max_curves}

    @property
    def ranges(self) -> tuple[tuple[float, float], str, tuple[float, float]]:
        """omega, the design parameter, its bounds."""
        return (self.omega[0], self.omega[1]), self.parameter, (self.bounds[0], self.bounds[1])

    def _check_values(self, values: int | list[float], key: str = "values") -> Iterator[Complaint]:
        """Values of the design parameter: how many, or which."""
        low, high = sorted(self.bounds)
        if isinstance(values, int):
            if values < 2:
                yield (key,), f"must be at least 2, or values of {self.parameter} themselves, not {values}"
            return
        for i, value in enumerate(values):
            if not low <= value <= high:
                yield (key, i), f"{value:g} lies outside the bounds ({low:g}, {high:g})"


def check_design(name: str, bounds: list[float], keys: tuple[str, str], around: CheckContext) -> Iterator[Complaint]:
    """What is wrong with a design parameter and its bounds."""
    if name == "omega":
        hint = suggest("", around.system.parameters)
        yield (keys[0],), f"is the design parameter, beside omega: omega varies anyway{hint}"
        return
    unknown = list(tried(keys[0], lambda: check_parameter(around.system, name)))
    yield from unknown or tried(keys[1], lambda: check_bounds(around.system, name, bounds))


class FindIsolas(DesignStep):
    """`so.find_isolas`; `at` are values of the parameter at which the closed branches are followed and kept."""

    kind: ClassVar[str] = "find_isolas"
    gives_isolas: ClassVar[bool] = True

    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    levels: list[float] | None = None
    search: list[int] | None = None
    seeds: Annotated[dict[str, Any] | None, read_by(as_seeds)] = None
    at: list[float] = Field(default_factory=list)

    @property
    def plane(self) -> tuple[str, str] | None:
        return "omega", self.parameter

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        if isinstance(self.values, list) and not self.values:
            yield ("values",), f"must be how many, or values of {self.parameter}, at least one"
        yield from self._check_values(self.values)
        yield from self._check_values(self.at, "at")
        yield from tried("search", lambda: checked_orders(self.search or (), 2))
        yield from tried("levels", lambda: checked_levels(self.levels))

    def run(self, context: Context) -> Isolas:
        given = self.own("at") | {"seeds": as_seeds(self.seeds)}
        options = self.options(context) | {name: value for name, value in given.items() if value is not None}
        return self._with_branches(find_isolas(context.system, *self.ranges, **options), context.progress)

    def _with_branches(self, isolas: Isolas, progress: Any) -> Isolas:
        """The closed branches at the values asked for are followed; what fails is noted."""
        notes = []
        for isola in isolas:
            for value in self.at:
                if isolas.interrupted or value not in isola:
                    continue
                try:
                    branch = isola.at(value, progress=progress)
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


class IsolaRegions(DesignStep):
    """`so.find_isolas` over `parameter`, then `so.isola_map` over `second`, as a table (`IsolaMap.to_table`)."""

    kind: ClassVar[str] = "isola_map"

    second: str
    second_bounds: Range
    values: int | list[float] = 5
    depth: int = Field(default=1, ge=0)
    probes: int = Field(default=3, ge=0)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        wrong = list(check_design(self.second, self.second_bounds, ("second", "second_bounds"), around))
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
        options = self.options(context)
        isolas = find_isolas(context.system, *self.ranges, values=self.values, depth=self.depth, **options)
        if not isolas or isolas.interrupted:
            title = "; ".join([isolas.summary, *(f"note: {note}" for note in isolas.notes if isolas.interrupted)])
            return Table({}, title, stopped=isolas.interruption)
        bounds = self.second_bounds[0], self.second_bounds[1]
        regions = isola_map(isolas, self.second, bounds, probes=self.probes, progress=context.progress)
        table = regions.to_table()
        title = "; ".join([table.title, *(f"note: {note}" for note in regions.notes)])
        return Table(table.columns, title, regions)


class Regimes(DesignStep):
    """`so.regime_map` as a table (`RegimeMap.to_table`); with `check` the title says what time integration found."""

    kind: ClassVar[str] = "regime_map"

    depth: int = Field(default=2, ge=0)
    values: int = Field(default=5, ge=1)
    resolution: float = Field(default=1e-4, gt=0.0, lt=0.5)
    search: list[int] = Field(default_factory=list)
    max_slices: int = Field(default=64, ge=1)
    check_points: int = Field(default=0, ge=0)
    seed: int = Field(default=0, ge=0)

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        yield from super().check(around)
        yield from tried("search", lambda: checked_orders(self.search, 1))

    def run(self, context: Context) -> Table:
        given = self.own("check_points", "seed") | self.options(context)
        regimes = regime_map(context.system, *self.ranges, **given)
        table = regimes.to_table()
        title = [table.title, *(f"note: {note}" for note in regimes.notes)]
        if self.check_points and not regimes.interrupted:
            checked = regimes.check(self.check_points, self.seed, progress=context.progress)
            rate = 100.0 * checked.rate
            title.insert(1, f"{rate:.1f} % of {len(checked.landings)} trajectories in time agree")
        return Table(table.columns, "; ".join(title), regimes)
