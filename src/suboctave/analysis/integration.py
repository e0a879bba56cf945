"""`integrate`: the motion from a state, in time; the witness that a user may call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.checks import check_omega, is_number, read_values
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.time_result import TimeResult
from suboctave.errors import InputError, shortened, suggest
from suboctave.interruption import pass_on
from suboctave.model.element import Array
from suboctave.model.system import System
from suboctave.timedomain.batch import METHODS, Flow, check_count
from suboctave.timedomain.motions import check_motions
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Trajectory", "integrate", "start_state"]

#: samples per period of the accurate method, steps of Newmark's
_SAMPLES = {"accurate": 200, "newmark": 1000}
#: trajectories side by side where there are one or two
FEW = 4


@dataclass(eq=False)
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
    """

    time: Array
    displacement: Array
    velocity: Array
    largest: Array
    omega: float
    parameters: Mapping[str, float]
    steps_per_period: int
    method: str
    system: System
    seconds: float = 0.0

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

    def to_xarray(self) -> xarray.Dataset:
        """Displacement and velocity on (time, dof), and what produced them."""
        import xarray

        names: Any = self.system.dof_names or range(self.system.n)
        return xarray.Dataset(
            {
                "displacement": (("time", "dof"), self.displacement),
                "velocity": (("time", "dof"), self.velocity),
                "largest": (("dof",), self.largest),
                "parameters": (("parameter",), np.array(list(self.parameters.values()), dtype=float)),
            },
            coords={"time": self.time, "dof": list(names), "parameter": list(self.parameters)},
            attrs={
                "contents": "trajectory",
                "omega": self.omega,
                "method": self.method,
                "steps_per_period": self.steps_per_period,
                "dofs": self.system.n,
                "observed": self.system.observed_dof,
                "system": self.system.name,
                "suboctave": __version__,
            },
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per sample: time, displacements, velocities."""
        import pandas as pd

        columns = {"time": self.time}
        for kind, values in (("x", self.displacement), ("v", self.velocity)):
            columns |= {f"{kind}_{i}": values[:, i] for i in range(self.system.n)}
        return pd.DataFrame(columns)

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Displacement over time in load periods, stroboscopic instants marked; saved if a path is given.

        Options are those of `pictures.plot_trajectory`: `dof`, `quantity`, `title`, `size`.
        """
        from suboctave.pictures.in_time import plot_trajectory

        return plot_trajectory(self.to_xarray(), path, **options)

    def __repr__(self) -> str:
        periods = (len(self.time) - 1) / self.steps_per_period
        dof = self.system.observed_dof
        return (
            f"Trajectory(omega={self.omega:.10g}, {periods:g} periods of {self.steps_per_period} samples, "
            f"max|x_{dof}|={self.largest[dof]:.8g}, {self.method})"
        )


@timed
def integrate(
    system: System,
    state: Any = None,
    *,
    omega: float,
    periods: int = 10,
    transient: int = 0,
    steps_per_period: int | None = None,
    parameters: Mapping[str, float] | None = None,
    method: str = "accurate",
    tolerance: float | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> Trajectory:
    """Integrate the equation of motion in time, from phase 0 of the load over whole periods.

    Parameters
    ----------
    state
        Displacements and velocities at t = 0, shape (2 n,); a periodic motion, whose state at t = 0 is taken; None for
        rest.
    omega
        Circular frequency of the load.
    periods, transient
        Periods of the load that are given, after some that are left out.
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
    progress
        True for a bar, or a callable (share, text).
    seconds
        Time limit, after which a TimeLimitError is raised.

    Raises
    ------
    InputError
        Before any work.
    ConvergenceError
        If the motion leaves the range of numbers, or Newmark's equations could not be solved.
    """
    periods = check_count("periods", periods)
    samples = _samples(method, steps_per_period)
    start = start_state(system, state)
    flow = Flow(system, method, samples, samples, tolerance, lanes=FEW)
    transient = _not_negative("transient", transient)
    values, omega = read_values(system, parameters), check_omega(omega)
    with reporting(progress, "integrating") as report:
        motions = flow.over(
            start, omega, periods + transient, values, skip=max(transient * samples - 1, 0), measure=True, report=report
        )
    pass_on(motions.interruption)
    check_motions(motions)
    assert motions.peaks is not None
    states, peaks = motions.states[0], motions.peaks[0]
    if transient:  # the last instant of the transient is the first that is given
        peaks = peaks[1:]
    else:
        states = np.vstack([start[None], states])
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


def start_state(system: System, state: Any) -> Array:
    """A state (2n,): rest for None, that of a periodic motion at t = 0, or what is given."""
    if not isinstance(system, System):
        raise InputError(f"the first argument must be a System, not {type(system).__name__}")
    if state is None:
        return np.zeros(2 * system.n)
    for name in ("start", "state"):
        held = getattr(state, name, None)
        if held is not None and not isinstance(state, np.ndarray):
            state = held() if callable(held) else held
            break
    try:
        array = np.array(state, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if array.shape != (2 * system.n,) or not np.isfinite(array).all():
        raise InputError(f"state must be {2 * system.n} finite numbers, displacements and then velocities")
    return array


def _samples(method: str, given: int | None) -> int:
    if method not in METHODS:
        raise InputError(f"method={shortened(method)}{suggest(str(method), METHODS)}")
    return check_count("steps_per_period", _SAMPLES.get(method, 200) if given is None else given)


def _not_negative(name: str, value: Any) -> int:
    if not (is_number(value) and float(value).is_integer() and value >= 0):
        raise InputError(f"{name} must be a whole number of periods, not {shortened(value)}")
    return int(value)
