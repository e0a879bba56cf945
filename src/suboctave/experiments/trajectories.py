"""`integrate`: the motion from a state, in time; the witness that a user may call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Unpack

import numpy as np

from suboctave.arguments import Count, Index, Positive, checked
from suboctave.experiments.common import (
    FEW,
    On,
    PeaksOn,
    TimeOptions,
    TimeResult,
    of_structures,
    steps_of,
    watched_states,
)
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_omega, start_state, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.timedomain.flow import Flow


@checked(result=True)
@dataclass(eq=False, repr=False)
class Trajectory(TimeResult):
    """A motion in time.

    Attributes
    ----------
    time
        (N,), from 0 at phase 0 of the load (after the transient, if one was left out) in the user's unit.
    displacement, velocity
        (N, n).
    largest
        (n,): the largest |x_i| over the whole stretch, between the samples too.
    omega, parameters
        Of the load, and all of the system's by name.
    steps_per_period
        Samples in one period of the load.
    method
        "accurate" or "newmark".
    seconds
        How long it took.

    The table has one row per sample. `plot` draws displacement over time in load periods, stroboscopic instants marked;
    options are those of `pictures.plot_trajectory`: `dof`, `quantity`, `title`, `size`.
    """

    contents = "trajectory"
    picture = "plot_trajectory"
    time: Annotated[Array, On("time")]
    displacement: Annotated[Array, On("time", "dof")]
    velocity: Annotated[Array, On("time", "dof")]
    largest: Annotated[Array, PeaksOn("dof")]
    omega: float
    parameters: Mapping[str, float]
    steps_per_period: int
    method: str
    system: System

    @property
    def period(self) -> float:
        """Period of the load, in the user's unit of time."""
        return 2.0 * np.pi / self.omega

    @property
    def end(self) -> Array:
        """The last state (2n,), from which another integration may go on."""
        return np.concatenate([self.displacement[-1], self.velocity[-1]])

    @property
    def stroboscopic(self) -> Array:
        """The states (periods + 1, 2n) at phase 0 of the load, the first and the last one too."""
        every = slice(None, None, self.steps_per_period)
        return np.hstack([self.displacement[every], self.velocity[every]])

    def _derived(self) -> Mapping[str, Any]:
        return {"observed": self.system.observed_dof}

    def _columns(self) -> Mapping[str, Any]:
        which, names = watched_states(self.system, self.projection)
        dofs = which[: len(which) // 2]
        states = np.hstack([self.displacement[:, dofs], self.velocity[:, dofs]])
        return {"time": self.time, **dict(zip(names, states.T, strict=True))}

    def _in_words(self) -> str:
        periods = (len(self.time) - 1) / self.steps_per_period
        dof = self.system.observed_dof
        return (
            f"Trajectory(omega={self.omega:.10g}, {periods:g} periods of {self.steps_per_period} samples, "
            f"max|x_{dof}|={self.largest[dof]:.8g}, {self.method})"
        )


@with_options(TimeOptions)
@timed
@of_structures
def integrate(
    system: System,
    omega: Positive,
    *,
    start: Any = None,
    transient: Index = 0,
    periods: Count = 10,
    steps_per_period: Count | None = None,
    parameters: Mapping[str, float] | None = None,
    method: str = "accurate",
    tolerance: Positive | None = None,
    **options: Unpack[TimeOptions],
) -> Trajectory:
    """Integrate the equation of motion in time, from phase 0 of the load over whole periods.

    Parameters
    ----------
    omega
        Circular frequency of the load.
    start
        Displacements and velocities at t = 0, shape (2 n,); a periodic motion, whose state at t = 0 is taken; None for
        rest.
    transient, periods
        Periods of the load that are left out, and those that are given. Angles begin within half a turn; from there on
        displacements go on through turns.
    steps_per_period
        Instants in one period at which the motion is given (default 200); of Newmark's method its steps (default 1000).
    parameters
        Other values of some of the system's, by name.
    method
        "accurate": Dormand and Prince's method of order 8 with steps of its own, corners of laws located. "newmark":
        constant average acceleration (beta = 1/4, gamma = 1/2) with fixed steps, as in Alcorta et al. 2019.
    tolerance
        Local error relative to the size of the motion (default 1e-10); of Newmark's method that of the equations
        solved in each step.

    Raises
    ------
    InputError
        Before any work.
    ConvergenceError
        If the motion leaves the range of numbers, or Newmark's equations could not be solved.
    """
    samples = steps_of(method, steps_per_period)
    begin = start_state(system, start)
    flow = Flow(system, method, samples, samples, tolerance, lanes=FEW, folded=False)
    values, omega = system.read_values(parameters), check_omega(omega)
    if system.turns:
        begin = _within_a_turn(system, begin, omega, transient, values, method, samples, tolerance)
        transient = 0
    with reporting(options.get("progress"), "integrating") as report:
        motions = flow.over(
            begin, omega, periods + transient, values, skip=max(transient * samples - 1, 0), measure=True, report=report
        ).checked()
    states, peaks = motions.states[0], motions.peaks[0]
    if transient:  # the last instant of the transient is the first that is given
        peaks = peaks[1:]
    else:
        states = np.vstack([begin[None], states])
    n = system.n
    return Trajectory(
        time=np.arange(len(states), dtype=float) * (2.0 * np.pi / float(omega) / samples),
        displacement=states[:, :n].copy(),
        velocity=states[:, n:].copy(),
        largest=np.maximum(np.abs(states[0, :n]), peaks.max(axis=0)),
        omega=float(omega),
        parameters={**system.parameters, **values},
        steps_per_period=samples,
        method=method,
        system=system,
    )


def _within_a_turn(
    system: System, state: Array, omega: float, transient: int, values: Mapping[str, float], method: str, steps: int,
    tolerance: float | None,
) -> Array:  # fmt: skip
    """The state (2n,) after a transient, angles within half a turn."""
    if not transient:
        return system.turns.modulo(state)
    flow = Flow(system, method, 1, steps, tolerance, lanes=FEW)
    return np.asarray(flow.over(state, omega, transient, values, skip=transient).checked().end[0])
