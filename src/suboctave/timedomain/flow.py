"""Many trajectories at once: the compiled flow of a system over whole periods of the load.

    flow = Flow(system)
    motions = flow.over(states, omega=2.3, periods=200)      # states (B, 2n)

Every trajectory may have its own frequency and parameters. Its result does not depend on the others, on their number or
on that of the threads: neighbours in a group share instructions, no number. Nothing here knows what a user calls; the
verbs are in `analysis`.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from suboctave.errors import ConvergenceError, FunctionError, InputError, check_numbers, shortened, suggest
from suboctave.interruption import Interruption, check_time, pass_on, stopping
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_count
from suboctave.model.system import System
from suboctave.progress import Report
from suboctave.timedomain.batch import Batch, Group, Method
from suboctave.timedomain.law_code import PythonCallbacks
from suboctave.timedomain.layout import Layout
from suboctave.timedomain.newmark import NewmarkMethod
from suboctave.workers import processors

__all__ = ["METHODS", "Flow", "Motions", "check_extent"]

METHODS = ("accurate", "newmark")
#: seconds after which a run is interrupted or reports
_INTERVAL = 0.1
#: numbers that one answer may hold, and periods of the load that all trajectories together may take (weeks on one
#: processor)
_LARGEST, _LONGEST = 400_000_000, 100_000_000_000


@dataclass(frozen=True, eq=False)
class Motions:
    """Result of a batch integration.

    Attributes
    ----------
    states
        (B, S, 2n): displacements, then velocities, at the S instants kept.
    peaks
        (B, S, n): the largest |x_i| since the instant before, between the instants too; S = 0 if not asked for.
    end
        (B, 2n): the last states.
    failed
        (B,): trajectories that left the range of numbers, or took more than 100 000 steps between two samples; they are
        NaN from there on.
    unsettled
        (B,): steps of Newmark's method whose equations were not solved to the tolerance.
    finished
        (B,): whether the trajectory was followed to its end; not all are where it was interrupted.
    growth
        (B, S, k + 1): of a flow with k tangent vectors, the logarithms by which they grew since the instant before,
        then that by which the volume of states did; S = 0 without any.
    tangents
        (B, 2n, k): the tangent vectors at the end, as columns.
    interruption
        What stopped them, Ctrl-C or a time limit; None if nothing did.
    turns
        (B, S, k): of a flow that keeps states at phase 0 alone, whose angles are taken within half a turn, the whole
        turns that each of k angles had made by then; S = 0 of others.
    """

    states: Array
    peaks: Array
    end: Array
    failed: NDArray[np.bool_]
    unsettled: Array
    finished: NDArray[np.bool_]
    growth: Array
    tangents: Array
    interruption: Interruption | None = None
    turns: NDArray[np.int_] = field(default_factory=lambda: np.zeros((0, 0, 0), dtype=int))

    def whole(self) -> Motions:
        """These, if nothing stopped them; else what did so is raised again."""
        pass_on(self.interruption)
        return self

    def checked(self) -> Motions:
        """These, if they are whole and none has failed; else a ConvergenceError with what to change."""
        self.whole()
        if self.failed.any():
            first = int(np.flatnonzero(self.failed)[0])
            raise ConvergenceError(
                f"{int(self.failed.sum())} of {len(self.failed)} trajectories (the first is number {first}) overflow "
                "or need too many steps. Check the sign of the damping and the range of the forces, or use "
                'method="newmark" for high natural frequencies'
            )
        if self.unsettled.any():
            raise ConvergenceError(
                f"Newmark's method did not solve {int(self.unsettled.sum())} of its steps. Use more steps_per_period, "
                'or method="accurate"'
            )
        return self


class Flow:
    """The flow of a system over whole periods of its load, compiled.

    Parameters
    ----------
    system
        Any `System`. Its structure (places and kinds of elements) is compiled, its numbers are not.
    method
        "accurate": Runge-Kutta of order 8 with located corners, local error `tolerance` (default 1e-10) relative to the
        size of the motion. "newmark": constant average acceleration with `steps_per_period` steps (default 1000), each
        solved until Newton's correction is below `tolerance` (default 1e-10) of the motion.
    samples
        Instants per period at which states are given; of Newmark's method a divisor of `steps_per_period`.
    lanes
        Trajectories that run side by side; default what suits large batches. Few of them waste less with 8. Results
        with different numbers may differ in the last bit.
    tangents
        Vectors that are carried along by the derivative of the flow, 0 to 2n; "accurate" only. They are kept
        orthonormal, with weights `omega sqrt(M_ii)` of displacements and `sqrt(M_ii)` of velocities.
    transition
        Leave them as they come, from unit vectors: with 2n of them, the state-transition matrix.
    folded
        Whether whole turns of angles are left out: of the largest displacements, of the last states and, with one
        sample per period, of all states; with more of them states go on through turns.
    """

    def __init__(
        self,
        system: System,
        method: str = "accurate",
        samples: int = 1,
        steps_per_period: int = 1000,
        tolerance: float | None = None,
        lanes: int | None = None,
        tangents: int = 0,
        transition: bool = False,
        folded: bool = True,
    ) -> None:
        if method not in METHODS:
            raise InputError(f"method={method!r}{suggest(str(method), METHODS)}")
        tolerance = 1e-10 if tolerance is None else tolerance
        check_numbers(tolerance=tolerance)
        if not 1e-15 <= tolerance <= 1e-2:
            raise InputError(f"tolerance={tolerance!r}: give a number from 1e-15 to 1e-2, relative to the motion")
        samples = check_count("samples", samples)
        steps = check_count("steps_per_period", steps_per_period)
        if method == "newmark" and (steps < 4 or steps % samples):
            raise InputError(f"steps_per_period={steps} must be at least 4 and a multiple of samples={samples}")
        self.system, self.method, self.samples, self.folded = system, method, samples, folded
        self.layout = Layout(system)
        self.integrator: Method
        if tangents and (method != "accurate" or not 0 < tangents <= 2 * system.n):
            raise InputError(f'tangents={tangents}: from 1 to {2 * system.n} of them, with method="accurate"')
        if method == "newmark":
            self.integrator = NewmarkMethod(self.layout, samples, steps, tolerance, lanes)
        else:
            from suboctave.timedomain.adaptive import AdaptiveMethod  # and with it all of scipy.integrate

            self.integrator = AdaptiveMethod(self.layout, samples, tolerance, lanes, tangents, transition)

    def over(
        self,
        states: ArrayLike,
        omega: ArrayLike,
        periods: int,
        parameters: Mapping[str, ArrayLike] | None = None,
        skip: int = 0,
        measure: bool = False,
        workers: int | None = None,
        report: Report | None = None,
        first: NDArray[np.int_] | None = None,
    ) -> Motions:
        """Follow trajectories from phase 0 of the load over whole periods.

        Parameters
        ----------
        states
            (B, 2n), or (2n,) for one that all share.
        omega, parameters
            A number, or (B,) with one for each; parameters by name.
        periods
            How many periods of the load.
        skip
            Samples at the beginning that are not kept.
        measure
            Whether the largest displacements are wanted.
        workers
            Threads; default: as many as there are processors.
        report
            Called with the share done and a text, from the calling thread.
        first
            For methods that cut a period in pieces, such as multiple shooting: the sample of the period at which each
            begins, (B,); it is followed to the next one only. With the accurate method.

        Raises
        ------
        InputError
            Before any work, for shapes and values that make no sense.
        """
        periods = check_count("periods", periods)
        if first is not None and self.method != "accurate":
            raise InputError('pieces of a period are followed with method="accurate"')
        x, w, varied = self._broadcast(states, omega, parameters or {})
        count, total = len(x), 1 if first is not None else periods * self.samples
        skip = min(max(int(skip), 0), total)
        check_extent(count, periods, count * (total - skip) * 2 * self.layout.n)
        which = np.arange(count) if len(w) > 1 else np.zeros(count, dtype=int)
        numbers = self.layout.numbers(w, varied)
        rows = {name: value.reshape(len(w), -1) for name, value in self.integrator.numbers(numbers).items()}
        sizes, callbacks = self.layout.sizes(numbers, x, which), PythonCallbacks(self.layout.called_back)
        at = None if first is None else np.broadcast_to(np.asarray(first) % self.samples, (count,)).astype(float)
        batch = Batch(rows, which, x, sizes, total, skip, measure, at, callbacks.address, self.folded)
        motions = _Run(self.integrator, batch, callbacks).go(workers, report)
        return self._without_turns(motions) if self.folded and first is None else motions

    def _without_turns(self, motions: Motions) -> Motions:
        """Motions with angles within half a turn, as far as their states are compared."""
        turns = self.system.turns
        if not turns:
            return motions
        motions = replace(motions, end=turns.modulo(motions.end))
        if self.samples > 1:
            return motions
        return replace(motions, states=turns.modulo(motions.states), turns=turns.counts(motions.states))

    def onward(
        self,
        states: ArrayLike,
        omega: ArrayLike,
        first: NDArray[np.int_],
        parameters: Mapping[str, ArrayLike] | None = None,
        workers: int | None = None,
    ) -> Motions:
        """Follow each trajectory from sample `first` (B,) of the period to the next one; the rest is as in `over`."""
        return self.over(states, omega, 1, parameters, workers=workers, first=first)

    def _broadcast(
        self, states: ArrayLike, omega: ArrayLike, parameters: Mapping[str, ArrayLike]
    ) -> tuple[Array, Array, dict[str, Array]]:
        n = self.layout.n
        x, w = _floats("states", states), _floats("omega", omega)
        varied = {}
        if not isinstance(parameters, Mapping):
            raise InputError(f"parameters must be a mapping {{name: number}}, not {shortened(parameters)}")
        for name, values in parameters.items():
            self.system.check_parameter(name)
            varied[name] = _floats(name, values)
        if x.ndim not in (1, 2) or x.shape[-1] != 2 * n:
            raise InputError(
                f"states of {n} degrees of freedom have the shape ({2 * n},) or (B, {2 * n}): displacements, then "
                f"velocities; got {x.shape}"
            )
        for name, array in (("omega", w), *varied.items()):
            if array.ndim > 1 or not np.isfinite(array).all():
                raise InputError(f"{name} must be a finite number or one for each trajectory, got shape {array.shape}")
        if not (w > 0.0).all():
            raise InputError("omega must be positive: it sets the scale of time")
        if not np.isfinite(x).all():
            raise InputError("the states have entries that are not finite")
        sizes = {"states": len(x)} if x.ndim == 2 else {}
        sizes |= {name: len(array) for name, array in (("omega", w), *varied.items()) if array.ndim}
        counts = set(sizes.values()) or {1}
        if len(counts) > 1 or 0 in counts:
            given = ", ".join(f"{name}: {size}" for name, size in sizes.items())
            raise InputError(f"there must be as many states, frequencies and parameters; got {given}")
        count = counts.pop()
        sets = count if w.ndim or any(values.ndim for values in varied.values()) else 1
        return (
            np.broadcast_to(x, (count, 2 * n)),
            np.broadcast_to(w, (sets,)),
            {name: np.broadcast_to(values, (sets,)) for name, values in varied.items()},
        )


class _Run:
    """One batch on its way: groups of trajectories, each followed by one thread in chunks."""

    def __init__(self, method: Method, batch: Batch, callbacks: PythonCallbacks) -> None:
        self.method, self.batch, self.callbacks = method, batch, callbacks
        n, count, kept, lanes = method.layout.n, len(batch.states), batch.kept, method.rows.lanes
        self.motions = Motions(
            states=np.full((count, kept, 2 * n), np.nan),
            peaks=np.full((count, kept * batch.measure, n), np.nan),
            end=np.full((count, 2 * n), np.nan),
            failed=np.zeros(count, dtype=bool),
            unsettled=np.zeros(count),
            finished=np.zeros(count, dtype=bool),
            growth=np.full((count, kept * (method.count > 0), method.count + 1), np.nan),
            tangents=np.full((count, 2 * n, method.count), np.nan),
        )
        self.groups = [range(first, min(first + lanes, count)) for first in range(0, count, lanes)]
        self.done = [0.0] * len(self.groups)
        self.stop = threading.Event()
        callbacks.halted = self.stop.is_set

    def go(self, workers: int | None, report: Report | None) -> Motions:
        """Follow all of them."""
        many = min(processors() if workers is None else check_count("workers", workers), len(self.groups))
        interruption: Interruption | None = None
        try:
            # in a thread of its own what calls back can be left in the middle: in this one Ctrl-C would be lost in C
            if many <= 1 and not self.callbacks.address:
                for g in range(len(self.groups)):
                    self._follow(g, report)
            else:
                self._together(max(1, many), report)
        except KeyboardInterrupt as cause:
            self.stop.set()
            interruption = Interruption.of(cause)
        if (failure := self.callbacks.failure) is not None:
            if not isinstance(failure, FunctionError):
                raise failure
            # the thread that it failed in keeps nothing
            stopped = stopping(str(failure), failure.__cause__)
            if not isinstance(stopped, KeyboardInterrupt):
                raise failure
            interruption = interruption or Interruption.of(stopped)
        motions = self.motions
        motions.failed[motions.finished & ~np.isfinite(motions.end).all(axis=1)] = True
        return replace(motions, interruption=interruption)

    def _together(self, many: int, report: Report | None) -> None:
        # compiled once, before the threads
        nobody = np.zeros(self.method.rows.lanes, dtype=int)
        self.method.advance(Group(self.method, replace(self.batch, skip=self.batch.total), nobody, 0), 0)
        with ThreadPoolExecutor(many) as pool:
            pending: set[Future[None]] = {pool.submit(self._follow, g, None) for g in range(len(self.groups))}
            try:
                while pending:
                    finished, pending = wait(pending, _INTERVAL, FIRST_COMPLETED)
                    for future in finished:
                        future.result()
                    self._report(report)
            except BaseException:
                self.stop.set()
                for future in pending:
                    future.cancel()
                raise

    def _report(self, report: Report | None) -> None:
        check_time()
        if report is not None:
            share, count = sum(self.done) / len(self.done), len(self.batch.states)
            report(share, f"{share * count:.0f} of {count} trajectories")

    def _follow(self, g: int, report: Report | None) -> None:
        members, method, batch = self.groups[g], self.method, self.batch
        # what is missing from the last group is made up by its first one, but stands still where it may
        filled = np.array([*members, *[members[0]] * (method.rows.lanes - len(members))])
        group = Group(method, batch, filled, len(members))
        effort, arrived = method.effort, False
        while not (arrived or self.stop.is_set() or self.callbacks.failure is not None):
            started = perf_counter()
            arrived = method.advance(group, effort)
            # what will take about `_INTERVAL`
            effort = max(1, int(effort * min(4.0, _INTERVAL / max(perf_counter() - started, 1e-6))))
            self.done[g] = 1.0 - min(1.0, method.left(group) / (batch.total * len(members)))
            self._report(report)
        if not arrived or self.stop.is_set() or self.callbacks.failure is not None:
            return
        samples = {name: getattr(group, name).transpose(2, 0, 1) for name in ("states", "peaks", "growth")}
        for name, values in (samples | method.results(group)).items():
            getattr(self.motions, name)[members.start : members.stop] = values[: len(members)]
        self.motions.finished[members.start : members.stop] = True


def _floats(name: str, given: ArrayLike) -> Array:
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} must be a finite number or an array of them, not {shortened(given)}") from None


def check_extent(trajectories: int, periods: int, numbers: int) -> None:
    """Refuse what would not fit in memory (so many numbers are kept), or would take years."""
    if numbers > _LARGEST:
        raise InputError(
            f"{trajectories} trajectories over {periods} periods leave {numbers:.1e} numbers, more than fit (at most "
            f"{_LARGEST:.1e}): keep fewer (a longer transient, fewer trajectories at once, a coarser grid)"
        )
    if trajectories * periods > _LONGEST:
        raise InputError(
            f"{trajectories} trajectories over {periods} periods are {trajectories * periods:.1e} periods of the load, "
            f"more than can be waited for (at most {_LONGEST:.1e}): take fewer of either"
        )
