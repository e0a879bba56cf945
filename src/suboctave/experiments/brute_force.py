"""`brute_force_diagram`: what trajectories settle on while a parameter is varied; it knows of no branch.

The state is carried on from value to value, upwards and downwards, or every value begins anew, at rest or at
states that are given. Only attracting motions are seen, and only those whose basins are met; none of
these is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Count, Index, Range, checked
from suboctave.errors import InputError, suggest
from suboctave.experiments.common import (
    FEW,
    Integration,
    On,
    PeaksOn,
    SectionOptions,
    StatesOn,
    TimeResult,
    checked_integration,
    of_structures,
    starting_states,
)
from suboctave.experiments.grids import checked_directions, varied_grid
from suboctave.experiments.poincare import Attractor, attractor_of, observed_in, recovered_attractor
from suboctave.interruption import Interruption
from suboctave.model.elements.base import Array
from suboctave.model.inputs import timed
from suboctave.model.projected import coordinates_of
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import Report, reporting
from suboctave.store.layout import parameter_column
from suboctave.timedomain.flow import Flow, Motions, check_extent

_CARRIED = ("up", "down")
_DIRECTIONS = (*_CARRIED, "anew")


@checked(result=True)
@dataclass(eq=False, repr=False)
class BruteForceDiagram(TimeResult):
    """Stroboscopic points over a parameter, for S ways to start and V values.

    Attributes
    ----------
    name, values
        What was varied ("omega" or a parameter), and its values (V,), increasing.
    starts
        S of "up", "down", "anew"; from several starts "up 0", "up 1", ...
    points
        (S, V, P, 2n): states at phase 0 of the load after the transient, angles within half a turn; NaN where nothing
        was computed.
    largest
        (S, V, P, n): the largest |x_i| in the period before each point.
    complete
        False where an interruption (Ctrl-C) left values out.
    turns
        (S, V, P, k): whole turns that each of k angles had made by then; None without angles.

    The table has one row per value and start: what was varied, start, period, amplitude, defect of the repetition.
    """

    contents = "brute force"
    picture = "plot_brute_force"
    name: Annotated[str, On(name="varied")]
    values: Annotated[Array, On("value", name="value")]
    starts: Annotated[tuple[str, ...], On("start", name="start")]
    points: Annotated[Array, StatesOn("start", "value", "section")]
    largest: Annotated[Array, PeaksOn("start", "value", "section", "dof")]
    complete: bool
    omega: float | None
    transient: int
    tolerance: float
    method: str
    observed: int
    system: System
    turns: Annotated[NDArray[np.int_] | None, On("start", "value", "section", "angle")] = None

    @cached_property
    def attractors(self) -> list[list[Attractor | None]]:
        """S lists of V attractors, None where the trajectory left the range of numbers or was not computed."""
        points, largest = coordinates_of(self.points), coordinates_of(self.largest)
        turned = np.zeros((*points.shape[:3], 0), dtype=int) if self.turns is None else self.turns
        rows = zip(points, largest, turned, strict=True)
        return [[self._attractor(*one) for one in zip(self.values, *row, strict=True)] for row in rows]

    def _attractor(self, value: float, points: Array, largest: Array, turned: NDArray[np.int_]) -> Attractor | None:
        if not np.isfinite(points).all():
            return None
        at = {**self.system.parameters, **({} if self.omega is None else {self.name: float(value)})}
        omega = float(value) if self.omega is None else self.omega
        observed = observed_in(self.projection, self.observed)
        one = attractor_of(self.integrated, points, largest, omega, at, self.tolerance, observed, turned)
        return recovered_attractor(one, self.projection)

    @property
    def period(self) -> NDArray[np.int_]:
        """(S, V): periods in periods of the load, 0 where nothing repeats, -1 where nothing was computed."""
        return np.array([[-1 if one is None else one.period for one in row] for row in self.attractors], dtype=int)

    @property
    def amplitude(self) -> Array:
        """(S, V): largest |x| of the observed degree of freedom, NaN where nothing was computed."""
        return np.array([[np.nan if one is None else one.amplitude for one in row] for row in self.attractors])

    def of(self, start: str) -> list[Attractor | None]:
        """The attractors of one way to start, in the order of `values`."""
        if start not in self.starts:
            raise InputError(f"there is no start {start!r}{suggest(str(start), self.starts)}")
        return self.attractors[self.starts.index(start)]

    def _derived(self) -> Mapping[str, Any]:
        return {"period": (("start", "value"), self.period), "amplitude": (("start", "value"), self.amplitude)}

    def _columns(self) -> Mapping[str, Any]:
        rows = [
            (float(value), start, one.kind, one.period, one.amplitude, one.defect)
            for start, row in zip(self.starts, self.attractors, strict=True)
            for value, one in zip(self.values, row, strict=True)
            if one is not None
        ]
        own = ("start", "kind", "period", "amplitude", "defect")
        columns = zip(*rows, strict=True) if rows else [()] * (len(own) + 1)
        return dict(zip((parameter_column(self.name, own), *own), columns, strict=True))

    def plot(self, path: Any = None, curves: Any = None, **options: Any) -> Any:
        """Draw the motions, one colour for each period, over branches if any are given; saved to a path.

        Options are those of `pictures.plot_brute_force`: `quantity` ("amplitude" or "section"), `starts`, `dof`,
        `title`, `size`.
        """
        return super().plot(path, curves=curves, **options)

    def _in_words(self) -> str:
        known = [one for row in self.attractors for one in row if one is not None]
        periodic = sorted({one.period for one in known if one.period})
        names = [("T" if p == 1 else f"{p}T", sum(one.period == p for one in known)) for p in periodic]
        names += [(kind, sum(one.kind == kind for one in known)) for kind in ("drifting", "aperiodic")]
        counts = [f"{name} {count}" for name, count in names if count]
        drifting = next((f"\n  {one.drifts}" for one in known if one.drifts), "")
        whole = "" if self.complete else ", not complete"
        return (
            f"BruteForceDiagram({self.name} from {self.values[0]:g} to {self.values[-1]:g}, {len(self.values)} values, "
            f"{' and '.join(self.starts)}: {', '.join(counts) or 'nothing'}{whole}){drifting}"
        )


@with_options(SectionOptions)
@timed
@of_structures
def brute_force_diagram(
    system: System,
    omega: Any,
    parameter: str | None = None,
    bounds: Range | None = None,
    *,
    values: int | Sequence[float] = 200,
    direction: str | Sequence[str] = ("up", "down"),
    start: Any = None,
    transient: Index = 200,
    periods: Count = 60,
    **options: Unpack[SectionOptions],
) -> BruteForceDiagram:
    """Integrate in time over a range of the frequency or of a parameter, for what the motion settles on.

    Parameters
    ----------
    omega
        The range of frequencies `(from, to)`. With `parameter`, one frequency.
    parameter, bounds
        A parameter that is varied instead, and its range `(from, to)`.
    values
        How many values are taken, evenly spread over the range; or these values.
    direction
        "up", "down": the state is carried on through increasing or decreasing values. "anew": every value begins at
        `start`. Several of them in a sequence.
    start
        Where all of them begin: (2n,), a periodic motion or an attractor; default rest. From several, (k, 2n) or
        a list, each direction is followed: they find motions that coexist.
    transient, periods
        Periods of the load that are left out at every value, and those that are kept. A motion of period nT is
        recognised if `periods` is at least 3 n.
    """
    begin, directions = starting_states(system, start), checked_directions(direction, _DIRECTIONS)
    name, at, grid = varied_grid(system, omega, parameter, bounds, values)
    how = checked_integration(system, options)
    numbers = [f" {i}" for i in range(len(begin))] if len(begin) > 1 else [""]
    labels = tuple(f"{one}{number}" for one in directions for number in numbers)
    trajectories = len(labels) * len(grid)
    check_extent(trajectories, transient + periods, trajectories * periods * 2 * system.n)
    points, largest = (np.full((len(labels), len(grid), periods, size), np.nan) for size in (2 * system.n, system.n))
    diagram = BruteForceDiagram(
        name, grid, labels, points, largest, True, None if name == "omega" else at, transient, how.period_tolerance,
        how.method, how.observe, system, turns=_no_turns(system, points),
    )  # fmt: skip
    run = _Run(diagram, periods, how)
    with reporting(options.get("progress"), "brute force") as report:
        try:
            diagram.interruption = run.go(np.tile(begin, (len(directions), 1)), report)
        except KeyboardInterrupt as cause:
            diagram.interruption = Interruption.of(cause)
    diagram.complete = diagram.interruption is None
    return diagram


@dataclass
class _Run:
    """The work of one diagram; fills its `points` and `largest`."""

    diagram: BruteForceDiagram
    periods: int
    how: Integration

    def go(self, begin: Array, report: Report | None) -> Interruption | None:
        """From states `begin` (S, 2n): those that are carried on, then those from which every value begins anew."""
        starts = self.diagram.starts
        carried = [i for i, label in enumerate(starts) if label.startswith(_CARRIED)]
        anew = [i for i in range(len(starts)) if i not in carried]
        share = len(carried) / len(starts)
        if carried:
            self._carry(carried, begin[carried], _share(report, 0.0, share))
        if not anew:
            return None
        return self._begin_anew(anew, begin[anew], _share(report, share, 1.0))

    def _carry(self, rows: list[int], first: Array, report: Report | None) -> None:
        """Carry states `first` (len(rows), 2n) through the values, all side by side."""
        d, count = self.diagram, len(self.diagram.values)
        flow, states = self._flow(FEW), first
        for step in range(count):
            columns = [step if d.starts[row].startswith("up") else count - 1 - step for row in rows]
            motions = self._over(flow, states, d.values[columns], workers=1).whole()
            d.points[rows, columns], d.largest[rows, columns] = motions.states, motions.peaks
            if d.turns is not None:
                d.turns[rows, columns] = motions.turns
            # where a motion has left the range of numbers, the next value begins as the first one did
            states = np.where(motions.failed[:, None], first, motions.end)
            if report is not None:
                report((step + 1) / count, f"{d.name} = {d.values[columns[0]]:.6g}")

    def _begin_anew(self, rows: list[int], begin: Array, report: Report | None) -> Interruption | None:
        """Every value from every state in `begin` (k, 2n); what stopped it, if anything did."""
        d, k, count = self.diagram, len(begin), len(self.diagram.values)
        states, values = np.repeat(begin, count, axis=0), np.tile(d.values, k)
        motions = self._over(self._flow(), states, values, workers=self.how.workers, report=report)
        for out, kept in ((d.points, motions.states), (d.largest, motions.peaks)):
            out[rows] = kept.reshape(k, count, *kept.shape[1:])
        if d.turns is not None:
            d.turns[rows] = motions.turns.reshape(k, count, *motions.turns.shape[1:])
        return motions.interruption

    def _flow(self, lanes: int | None = None) -> Flow:
        how = self.how
        return Flow(self.diagram.system, how.method, 1, how.steps, how.tolerance, lanes)

    def _over(self, flow: Flow, states: Array, values: Array, **options: Any) -> Motions:
        d = self.diagram
        omega, varied = (values, {}) if d.omega is None else (d.omega, {d.name: values})
        return flow.over(states, omega, d.transient + self.periods, varied, d.transient, measure=True, **options)


def _no_turns(system: System, points: Array) -> NDArray[np.int_] | None:
    """Room for whole turns at points (S, V, P, 2n); None without angles."""
    return np.zeros((*points.shape[:3], len(system.turns.rows)), dtype=int) if system.turns else None


def _share(report: Report | None, begin: float, end: float) -> Report | None:
    if report is None:
        return None
    return lambda share, where: report(begin + (end - begin) * share, where)
