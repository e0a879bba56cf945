"""`brute_force_diagram`: what trajectories settle on while a parameter is varied; it knows of no branch.

The state is carried on from value to value, upwards and downwards, or every value begins anew, from rest or from
states that are given. Only attracting motions are seen, and only those whose basins are met; nothing that is found is
left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from suboctave.analysis.attractors import TOLERANCE, Attractor, attractor_of
from suboctave.analysis.checks import check_parameter, check_range, is_number
from suboctave.analysis.integration import FEW, _not_negative, _samples, start_state
from suboctave.analysis.poincare import check_observe, check_tolerance
from suboctave.analysis.progress import Report, reporting, timed
from suboctave.analysis.time_result import TimeResult
from suboctave.errors import InputError, suggest
from suboctave.interruption import Interruption, pass_on
from suboctave.model.element import Array
from suboctave.model.system import System
from suboctave.store.columns import parameter_column
from suboctave.timedomain.batch import Flow, check_count, check_extent
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["BruteForceDiagram", "brute_force_diagram", "told"]

_CARRIED = ("up", "down")
_STARTS = (*_CARRIED, "rest")


@dataclass(eq=False)
class BruteForceDiagram(TimeResult):
    """Stroboscopic points over a parameter, for S ways to start and V values.

    Attributes
    ----------
    name, values
        What was varied ("omega" or a parameter), and its values (V,), increasing.
    starts
        S of "up", "down", "rest", "state 0", "state 1", ...
    points
        (S, V, P, 2n): states at phase 0 of the load after the transient; NaN where nothing was computed.
    largest
        (S, V, P, n): the largest |x_i| in the period before each point.
    attractors
        S lists of V: the attractor that was found, None where the trajectory left the range of numbers or was not
        computed.
    complete
        False where an interruption (Ctrl-C) left values out.
    """

    name: str
    values: Array
    starts: tuple[str, ...]
    points: Array
    largest: Array
    attractors: list[list[Attractor | None]]
    complete: bool
    omega: float | None
    transient: int
    tolerance: float
    method: str
    observed: int
    system: System
    seconds: float = 0.0

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

    def to_xarray(self) -> xarray.Dataset:
        """Points on (start, value, section, dof), periods and amplitudes on (start, value)."""
        import xarray

        n = self.system.n
        axes = ("start", "value", "section", "dof")
        return xarray.Dataset(
            {
                "displacement": (axes, self.points[..., :n]),
                "velocity": (axes, self.points[..., n:]),
                "largest": (axes, self.largest),
                "period": (axes[:2], self.period),
                "amplitude": (axes[:2], self.amplitude),
                "parameters": (("parameter",), np.array(list(self.system.parameters.values()), dtype=float)),
            },
            coords={
                "start": list(self.starts),
                "value": self.values,
                "dof": list(self.system.dof_names or range(n)),
                "parameter": list(self.system.parameters),
            },
            attrs={
                "contents": "brute force",
                "varied": self.name,
                **({} if self.omega is None else {"omega": self.omega}),
                "transient": self.transient,
                "tolerance": self.tolerance,
                "method": self.method,
                "observed": self.observed,
                "dofs": n,
                "complete": int(self.complete),
                "system": self.system.name,
                "suboctave": __version__,
            },
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per value and start: what was varied, start, period, amplitude, defect of the repetition."""
        import pandas as pd

        rows = [
            (float(value), start, one.kind, one.period, one.amplitude, one.defect)
            for start, row in zip(self.starts, self.attractors, strict=True)
            for value, one in zip(self.values, row, strict=True)
            if one is not None
        ]
        own = ("start", "kind", "period", "amplitude", "defect")
        return pd.DataFrame(rows, columns=[parameter_column(self.name, own), *own])

    def plot(self, path: Any = None, curves: Any = None, **options: Any) -> Any:
        """Draw the motions found, one colour for each period, over branches if any are given; saved to a path.

        Options are those of `pictures.plot_brute_force`: `quantity` ("amplitude" or "section"), `starts`, `dof`,
        `title`, `size`.
        """
        from suboctave.pictures.in_time import plot_brute_force

        return plot_brute_force(self.to_xarray(), path, curves=curves, **options)

    def __repr__(self) -> str:
        found = self.period
        told = []
        for period in sorted({int(p) for p in found.ravel() if p >= 0}, key=lambda p: (p == 0, p)):
            name = "aperiodic" if period == 0 else "T" if period == 1 else f"{period}T"
            told.append(f"{name} {int((found == period).sum())}")
        return (
            f"BruteForceDiagram({self.name} from {self.values[0]:g} to {self.values[-1]:g}, {len(self.values)} values, "
            f"{' and '.join(self.starts)}: {', '.join(told) or 'nothing'}{'' if self.complete else ', not complete'})"
        )


@timed
def brute_force_diagram(
    system: System,
    omega: Any,
    *,
    parameter: str | None = None,
    values: Any = None,
    count: int = 200,
    start: str | Sequence[str] = ("up", "down"),
    state: Any = None,
    states: Any = None,
    transient: int = 200,
    periods: int = 60,
    method: str = "accurate",
    steps_per_period: int | None = None,
    tolerance: float | None = None,
    period_tolerance: float = TOLERANCE,
    observe: int | None = None,
    workers: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> BruteForceDiagram:
    """Integrate in time over a range of the frequency or of a parameter, and tell what the motion settles on.

    Parameters
    ----------
    omega
        The frequencies: `(from, to)`, of which `count` are taken, or all of an array. With `parameter`, one number.
    parameter, values
        A parameter that is varied instead, and its range `(from, to)` or its values.
    start
        "up", "down": the state is carried on through increasing or decreasing values. "rest": every value begins at
        rest. Several of them in a sequence.
    state
        Where "up" and "down" begin, (2n,), a periodic motion or an attractor; default rest.
    states
        Further states (k, 2n) from which every value begins anew: they find motions that coexist.
    transient, periods
        Periods of the load that are left out at every value, and those that are kept. A motion of period nT is told
        if `periods` is at least 3 n.
    method, steps_per_period, tolerance, period_tolerance, observe, workers, progress, seconds
        As in `poincare_sections`.

    Raises
    ------
    InputError
        Before any work.
    """
    first = start_state(system, state)
    name, at, grid = _grid(system, omega, parameter, values, count)
    fresh = _fresh(system, states)
    names = _starts(start)
    periods = check_count("periods", periods)
    transient = _not_negative("transient", transient)
    check_tolerance(period_tolerance)
    observe = check_observe(system, observe)
    samples = _samples(method, steps_per_period)
    labels = (*names, *(f"state {i}" for i in range(len(fresh))))
    shape = (len(labels), len(grid), periods)
    trajectories = len(labels) * len(grid)
    check_extent(trajectories, transient + periods, trajectories * periods * 2 * system.n)
    points = np.full((*shape, 2 * system.n), np.nan)
    largest = np.full((*shape, system.n), np.nan)
    run = _Scan(system, name, at, grid, transient, periods, points, largest, workers)
    carried = [name for name in names if name in _CARRIED]
    anew = [i for i, label in enumerate(labels) if label not in _CARRIED]
    with reporting(progress, "brute force") as report:
        whole = len(labels)
        interruption: Interruption | None = None
        if carried:
            flow = Flow(system, method, 1, samples, tolerance, lanes=FEW)
            try:
                run.carried(flow, carried, names, first, _share(report, 0.0, len(carried) / whole))
            except KeyboardInterrupt as cause:
                interruption = Interruption.of(cause)
        if anew and interruption is None:
            flow = Flow(system, method, 1, samples, tolerance)
            begin = np.vstack([np.zeros((1, 2 * system.n)), fresh]) if "rest" in names else fresh
            interruption = run.anew(flow, anew, begin, _share(report, len(carried) / whole, 1.0))
    attractors = [
        [
            told(system, name, at, float(value), points[s, v], largest[s, v], period_tolerance, observe)
            for v, value in enumerate(grid)
        ]
        for s in range(len(labels))
    ]
    found = BruteForceDiagram(
        name, grid, labels, points, largest, attractors, interruption is None, None if name == "omega" else at,
        transient, period_tolerance, method, observe, system,
    )  # fmt: skip
    found.interruption = interruption
    return found


@dataclass
class _Scan:
    """The work of one diagram; fills `points` and `largest`."""

    system: System
    name: str
    omega: float
    grid: Array
    transient: int
    periods: int
    points: Array
    largest: Array
    workers: int | None

    def carried(self, flow: Flow, which: list[str], names: Sequence[str], first: Array, report: Report | None) -> None:
        """Carry states through the values, all directions side by side."""
        count = len(self.grid)
        states = np.repeat(first[None], len(which), axis=0)
        rows = [names.index(one) for one in which]
        for step in range(count):
            columns = [step if one == "up" else count - 1 - step for one in which]
            motions = flow.over(
                states, *self._at(self.grid[columns]), skip=self.transient, measure=True, workers=1
            )  # fmt: skip
            pass_on(motions.interruption)
            assert motions.peaks is not None
            for i, (row, column) in enumerate(zip(rows, columns, strict=True)):
                self.points[row, column], self.largest[row, column] = motions.states[i], motions.peaks[i]
            # where a motion has left the range of numbers, the next value begins as the first one did
            states = np.where(motions.failed[:, None], first, motions.end)
            if report is not None:
                report((step + 1) / count, f"{self.name} = {self.grid[columns[0]]:.6g}")

    def anew(self, flow: Flow, rows: list[int], begin: Array, report: Report | None) -> Interruption | None:
        """Every value from every state in `begin` (k, 2n); what stopped it, if anything did."""
        k, count = len(begin), len(self.grid)
        motions = flow.over(
            np.repeat(begin, count, axis=0),
            *self._at(np.tile(self.grid, k)),
            skip=self.transient,
            measure=True,
            workers=self.workers,
            report=report,
        )
        assert motions.peaks is not None
        self.points[rows] = motions.states.reshape(k, count, *motions.states.shape[1:])
        self.largest[rows] = motions.peaks.reshape(k, count, *motions.peaks.shape[1:])
        return motions.interruption

    def _at(self, values: Array) -> tuple[Any, int, dict[str, Array]]:
        """Frequency, periods and parameters of a flow."""
        whole = self.transient + self.periods
        if self.name == "omega":
            return values, whole, {}
        return self.omega, whole, {self.name: values}


def told(
    system: System, name: str, omega: float, value: float, points: Array, largest: Array, tolerance: float, observe: int
) -> Attractor | None:
    if not np.isfinite(points).all():
        return None
    changed = {} if name == "omega" else {name: value}
    at: Mapping[str, float] = {**system.parameters, **changed}
    return attractor_of(system, points, largest, value if name == "omega" else omega, at, tolerance, observe)


def _share(report: Report | None, begin: float, end: float) -> Report | None:
    if report is None:
        return None
    return lambda share, where: report(begin + (end - begin) * share, where)


def _starts(start: str | Sequence[str]) -> list[str]:
    listed = [start] if isinstance(start, str) else list(start) if isinstance(start, Iterable) else [start]
    for one in listed:
        if one not in _STARTS:
            raise InputError(
                f"start is one of {', '.join(_STARTS)}, or several of them, not {one!r}{suggest(str(one), _STARTS)}"
            )
    if not listed:
        raise InputError(f"start is one of {', '.join(_STARTS)}, or several of them, not none")
    return list(dict.fromkeys(listed))


def _fresh(system: System, states: Any) -> Array:
    if states is None:
        return np.zeros((0, 2 * system.n))
    try:
        array = np.atleast_2d(np.asarray(states, dtype=float))
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if array.ndim != 2 or array.shape[1] != 2 * system.n or not np.isfinite(array).all():
        raise InputError(f"states must be finite numbers of shape (k, {2 * system.n}), got {array.shape}")
    return array


def _grid(system: System, omega: Any, parameter: str | None, values: Any, count: int) -> tuple[str, float, Array]:
    """What is varied, the frequency if that is not, and the increasing values."""
    count = check_count("count", count)
    if parameter is None or parameter == "omega":
        if values is not None and parameter is None:
            raise InputError("values= are those of a parameter: name it with parameter=")
        if is_number(omega):
            raise InputError("omega must be a range (from, to) or several values; or name a parameter to vary")
        return "omega", 0.0, _spread("omega", omega, count, True)
    check_parameter(system, parameter)
    if not (is_number(omega) and omega > 0.0):
        raise InputError(f"omega must be a positive number while {parameter} is varied, not {omega!r}")
    if values is None:
        raise InputError(f"give the range or the values of {parameter}: values=(from, to)")
    grid = _spread(parameter, values, count, False)
    for end in (grid[0], grid[-1]):
        try:
            system.with_parameters({parameter: float(end)})
        except InputError as failure:
            raise InputError(f"{parameter}={end:g}: {failure}") from None
    return parameter, float(omega), grid


def _spread(name: str, given: Any, count: int, positive: bool) -> Array:
    if isinstance(given, tuple) and len(given) == 2:
        first, last = check_range(name, given, positive)
        return np.linspace(min(first, last), max(first, last), count)
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all() or (positive and (array <= 0.0).any()):
        what = "finite positive" if positive else "finite"
        raise InputError(f"{name}: give a range (from, to), or an array of {what} values")
    return np.unique(array)
