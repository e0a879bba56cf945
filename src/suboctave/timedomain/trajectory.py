"""Time histories and state-transition matrices of a `System`, from any state, over any stretch of time.

A state is `(x, x')`, shape (2n,), in the user's units; the loads are `amplitude cos(harmonic omega t + phase)`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model import System
from suboctave.timedomain.field import Array, Field, scaled_field
from suboctave.timedomain.integrator import Contact, Passage, advance, reach
from suboctave.timedomain.linear_flow import exact_rate

__all__ = ["Contact", "Trajectory", "integrate", "largest_displacement", "state_transition"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion: instants `t` (N,), displacements `x` (N, n), velocities `v` (N, n), contacts in order of time."""

    t: Array
    x: Array
    v: Array
    contacts: tuple[Contact, ...]
    omega: float
    _passage: Passage = field(repr=False)
    _field: Field = field(repr=False)

    @property
    def end(self) -> Array:
        """State (2n,) at the last instant integrated to."""
        return self._passage.y[: 2 * self._field.n] * self._field.scale

    def at(self, times: ArrayLike) -> tuple[Array, Array]:
        """Displacements and velocities, (N, n) each, at any times inside the stretch, from the interpolants."""
        return _read(self._field, self._passage, np.atleast_1d(np.asarray(times, dtype=float)))

    def largest(self, dof: int = 0) -> float:
        """Largest |x_dof| over the whole stretch: where the velocity vanishes, not the largest sample."""
        return largest_displacement(self._field, self._passage, dof)

    def __repr__(self) -> str:
        return (
            f"Trajectory(t from {self._passage.tau[0] / self.omega:.6g} to {self._passage.tau[-1] / self.omega:.6g}, "
            f"{len(self.t)} instants, {self.x.shape[1]} DOF, {len(self.contacts)} contact instants)"
        )


def _read(model: Field, passage: Passage, times: Array) -> tuple[Array, Array]:
    n, tau = model.n, times * model.omega
    first, last = passage.tau[0], passage.tau[-1]
    slack = 1e-12 * max(abs(first), abs(last))
    if times.size and (np.min(tau) < first - slack or np.max(tau) > last + slack):
        raise InputError(f"times must lie between {first / model.omega:.9g} and {last / model.omega:.9g}")
    if not passage.steps:
        z = np.repeat(passage.states[0][:, None], len(tau), axis=1)
    else:
        z = np.empty((2 * n, len(tau)))
        ends = np.array([step.end for step in passage.steps])
        which = np.minimum(np.searchsorted(ends, tau, side="left"), len(ends) - 1)
        for i in np.unique(which):
            z[:, which == i] = passage.steps[i].interpolant(tau[which == i])[: 2 * n]
    z *= model.scale[:, None]
    return z[:n].T.copy(), z[n:].T.copy()


def integrate(
    system: System,
    state: ArrayLike,
    times: Sequence[float] | Array,
    omega: float,
    values: Mapping[str, float] | None = None,
    rtol: float = 1e-12,
    atol: float | None = None,
) -> Trajectory:
    """Integrate the equation of motion with every contact instant located.

    `state` (2n,) displacements then velocities at the first time; `times` either `(begin, end)`, and the answer lies at
    the integrator's own steps and contact instants, or three and more increasing instants, and the answer lies there
    (by the interpolants: about 1e-10). `values` replaces parameters by name. `rtol` is relative; `atol` too, in units
    of the size of the motion (default: `rtol`). Raises `InputError`, or `ConvergenceError` when the motion diverges.
    DOP853 with frozen contacts (see `integrator`).
    """
    wanted = np.asarray(times, dtype=float)
    if wanted.ndim != 1 or wanted.size < 2 or not np.all(np.isfinite(wanted)) or np.any(np.diff(wanted) <= 0.0):
        raise InputError("times must be (begin, end) or a list of instants, finite and increasing")
    start = np.asarray(state, dtype=float)
    model = scaled_field(system, start, omega, values)
    tolerance = rtol if atol is None else atol
    begin, end = float(wanted[0]) * omega, float(wanted[-1]) * omega
    passage = advance(model, begin, start / model.scale, end, rtol, tolerance, dense=True)
    if wanted.size == 2:
        t = np.array(passage.tau) / omega
        z = np.array(passage.states) * model.scale
        x, v = z[:, : system.n], z[:, system.n :]
    else:
        t = wanted
        x, v = _read(model, passage, wanted)
    return Trajectory(t, x, v, tuple(passage.contacts), float(omega), passage, model)


def state_transition(
    system: System,
    state: ArrayLike,
    times: tuple[float, float],
    omega: float,
    values: Mapping[str, float] | None = None,
    rtol: float = 1e-12,
) -> tuple[Array, Array]:
    """State at the end (2n,) and state-transition matrix (2n, 2n) over `times = (begin, end)`, in the user's units.

    Variational equations with the exact tangent, integrated together with the state. Over one period of a periodic
    motion the matrix is the monodromy matrix.
    """
    start = np.asarray(state, dtype=float)
    model = scaled_field(system, start, omega, values)
    begin, end = times
    if not (np.isfinite(begin) and np.isfinite(end) and end >= begin):
        raise InputError(f"times must be (begin, end), finite and in order; got {times!r}")
    z, transition, _ = flow(model, begin * omega, start / model.scale, end * omega, rtol)
    return z * model.scale, transition * model.scale[:, None] / model.scale


def flow(
    model: Field, begin: float, z: Array, end: float, rtol: float, slope: bool = False
) -> tuple[Array, Array, Passage]:
    """Scaled state at the end, scaled state-transition matrix (2n, 2n, or 2n + 1 columns with `slope`), the passage."""
    m = 2 * model.n
    rows = np.vstack([z[None, :], np.eye(m)] + ([np.zeros((1, m))] if slope else []))
    passage = advance(model, begin, rows.ravel(), end, rtol, rtol, slope=slope)
    final = passage.y.reshape(-1, m)
    return final[0].copy(), final[1:].T.copy(), passage


def largest_displacement(model: Field, passage: Passage, dof: int) -> float:
    """Largest |x_dof| of a passage kept densely, at the zeros of the velocity, in the user's units; of an angle within
    half a turn.

    The zeros come from the interpolants; the few best are reached again by an integration of their own.
    """
    n, origin = model.n, 0.0
    turn = float(model.system.turns.periods[dof] / model.lengths[dof])
    if math.isfinite(turn):  # within half a turn
        cells = {math.floor(float(z[dof]) / turn + 0.5) for z in passage.states}
        if len(cells) > 1:
            return 0.5 * turn * float(model.lengths[dof])
        origin = turn * cells.pop()
    ends = [abs(float(z[dof]) - origin) for z in passage.states]
    candidates: list[tuple[float, int, float]] = []
    for i, step in enumerate(passage.steps):
        grid = np.linspace(step.begin, step.end, 7)
        z = step.interpolant(grid)
        speed = z[n + dof]
        for k in np.flatnonzero(speed[:-1] * speed[1:] <= 0.0).tolist():
            drop = speed[k] - speed[k + 1]
            share = speed[k] / drop if drop != 0.0 else 0.0
            at = float(grid[k] + share * (grid[k + 1] - grid[k]))
            candidates.append((abs(float(step.interpolant(at)[dof]) - origin), i, at))
    best = max(ends)
    candidates.sort(reverse=True)
    for size, i, at in candidates[:3]:
        if size >= best * (1.0 - 1e-6):
            best = max(best, abs(_extreme(model, passage, i, at, dof) - origin))
    return best * float(model.lengths[dof])


def _extreme(model: Field, passage: Passage, i: int, at: float, dof: int) -> float:
    """Scaled displacement at the zero of the velocity near `at`, inside step `i`, by Newton on exact integrations."""
    n, step = model.n, passage.steps[i]
    rhs = exact_rate(model, step.active, False)
    z = step.start[: 2 * n]
    for _ in range(3):
        at = min(max(at, step.begin), step.end)
        if at - step.begin <= 1e-14 * max(1.0, abs(at)):
            return float(z[dof])
        z = reach(model, rhs, step.begin, step.start[: 2 * n], at, 1e-13, 1e-13)
        rate = float(rhs(at, z)[n + dof])
        speed = float(z[n + dof])
        if rate == 0.0 or abs(speed / rate) <= 1e-9:  # the displacement is off by the square of this
            break
        at -= speed / rate
    return float(z[dof])
