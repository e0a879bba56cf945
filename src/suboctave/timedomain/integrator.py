"""Integration of the scaled vector field over a stretch of time, contact by contact.

DOP853 (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, in SciPy) between the instants at which a
switch of the field changes sign. Those are found on the interpolant of a step, then reached by an integration of their
own and refined by Newton, because an error `d` in the instant is one of order `stiffness d` in the tangent. A pair of
crossings inside one step (a near-grazing contact) shows as an extremum of the distance and is looked for there.
The force is continuous at a gap, so the state-transition matrix goes through without a jump. The linear part of
structures is not stepped but solved between their contacts (`linear_flow`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from suboctave.errors import ConvergenceError
from suboctave.interruption import check_time
from suboctave.timedomain.field import Array, Field
from suboctave.timedomain.linear_flow import ExactRate, ExactSolver, exact_rate

if TYPE_CHECKING:
    from scipy.integrate import DOP853, DenseOutput

__all__ = ["Contact", "Passage", "Step", "advance", "reach"]

# Points on the interpolant of a step at which distances are looked at, when a switch is near.
_GRID = np.linspace(0.0, 1.0, 9)
_EPS = np.finfo(float).eps
# This many changes of one switch at one instant are a contact that grazes within rounding: it stays as it is.
_CHATTER = 3
_LANDING_ITERATIONS = 4


@dataclass(frozen=True)
class Contact:
    """An instant at which an element meets (`closing`) or leaves its gap."""

    time: float
    element: int
    gap: float
    closing: bool


@dataclass(frozen=True)
class Step:
    """One accepted step with its interpolant, which is good to about two digits less than the step itself."""

    begin: float
    end: float
    active: NDArray[np.bool_]
    start: Array
    interpolant: DenseOutput


@dataclass
class Passage:
    """What an integration brings: the stacked state at the end, the contacts, the extent of the motion."""

    y: Array
    extent: Array  # (2n,) largest modulus of each scaled component over the step ends
    contacts: list[Contact] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    tau: list[float] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)


def _solver(
    model: Field, rhs: Any, begin: float, y: Array, end: float, rtol: float, atol: float, first: float | None
) -> Any:
    if first is not None:
        first = min(first, end - begin)
    if isinstance(rhs, ExactRate):
        return ExactSolver(rhs, begin, y, end, rtol, first)
    solver = scipy.integrate.DOP853(rhs, begin, y, end, rtol=rtol, atol=atol, first_step=first)
    if not np.all(np.isfinite(solver.f)):  # no step is short enough, and none is ever taken
        raise _stopped(model, begin, y[: 2 * model.n], "The rate is not finite")
    return solver


def _zero(function: Callable[[float], float], a: float, b: float) -> float:
    """The zero of a function that changes sign between a and b, to rounding."""
    return float(scipy.optimize.brentq(function, a, b, xtol=_EPS * max(abs(b), b - a)))


def _step(solver: DOP853, model: Field) -> None:
    check_time()
    message = solver.step()
    state = _states(solver, model)[1]
    if solver.status == "failed" or not np.all(np.isfinite(state)):
        raise _stopped(model, solver.t, state, message)


def _stopped(model: Field, tau: float, state: Array, reason: str | None) -> ConvergenceError:
    return ConvergenceError(
        f"the integration stopped at t = {tau / model.omega:.6g} (omega = {model.omega:.6g}): {reason}. "
        f"The motion grows without bound (largest scaled component {np.max(np.abs(state)):.3g}), or a force is not "
        "finite. Check the sign of the damping, the forces over this range, and the state at the start"
    )


def reach(model: Field, rhs: Any, begin: float, y: Array, end: float, rtol: float, atol: float) -> Array:
    """The stacked state at `end`, contacts frozen on the way, in one step if the tolerances allow it."""
    solver = _solver(model, rhs, begin, y, end, rtol, atol, end - begin)
    while solver.status == "running":
        _step(solver, model)
    return np.asarray(solver.y, dtype=float)


def _at_start(solver: DOP853) -> Array:
    """The stacked state at the start of the solver's last step."""
    return np.asarray(solver.y_old, dtype=float)


def _states(solver: Any, model: Field) -> tuple[Array, Array]:
    """The states (2n,) at the start and at the end of the solver's last step."""
    if isinstance(solver, ExactSolver):
        return solver.state_old, solver.state
    return solver.y_old[: 2 * model.n], solver.y[: 2 * model.n]


class _Watch:
    """Which switches act, and the search for their next change."""

    def __init__(self, model: Field, tau: float, z: Array) -> None:
        self.model = model
        self.active = model.contacts(tau, z)
        self._last = np.full(len(self.active), -np.inf)
        self._repeats = np.zeros(len(self.active), dtype=int)

    def _margins(self, z: Array) -> tuple[Array, Array]:
        """Distances from the changes, positive on this side of them, and their rates."""
        sign = np.where(self.active, 1.0, -1.0)
        sign = sign if z.ndim == 1 else sign[:, None]
        return sign * self.model.distances(z), sign * self.model.approach(z)

    def change(self, tau: float, switch: int) -> Contact:
        """Note that `switch` changes at `tau`."""
        self._repeats[switch] = self._repeats[switch] + 1 if abs(tau - self._last[switch]) <= 8 * _EPS * abs(tau) else 0
        self._last[switch] = tau
        self.active[switch] = not self.active[switch]
        place = self.model.switches[switch]
        return Contact(tau / self.model.omega, place.element, place.gap, bool(self.active[switch]))

    def first_change(self, solver: DOP853) -> tuple[float, int] | None:
        """The earliest instant in the solver's last step at which a switch changes, and which one; else None."""
        m, h = 2 * self.model.n, solver.t - solver.t_old
        old, new = _states(solver, self.model)
        (start, leaving), (end, arriving) = self._margins(old), self._margins(new)
        reach = 2.0 * h * np.maximum(np.abs(leaving), np.abs(arriving))
        near = np.flatnonzero((end < 0.0) | (np.minimum(np.abs(start), np.abs(end)) <= reach))
        if near.size == 0:
            return None
        interpolant = solver.dense_output()
        times = solver.t_old + h * _GRID
        z = interpolant(times)[:m]
        z[:, 0], z[:, -1] = old, new
        margins, rates = self._margins(z)
        best: tuple[float, int] | None = None
        for i in near:
            if self._repeats[i] >= _CHATTER and self._last[i] == solver.t_old:
                continue
            root = self._root(int(i), times, margins[i], rates[i], interpolant)
            if root is not None and (best is None or root < best[0]):
                best = root, int(i)
        return best

    def _root(self, i: int, times: Array, margin: Array, rate: Array, interpolant: DenseOutput) -> float | None:
        m = 2 * self.model.n

        def distance(t: float) -> float:
            return float(self._margins(interpolant(t)[:m])[0][i])

        def speed(t: float) -> float:
            return float(self._margins(interpolant(t)[:m])[1][i])

        for k in range(len(times) - 1):
            a, b = float(times[k]), float(times[k + 1])
            if margin[k + 1] < 0.0:
                if margin[k] <= 0.0 and k == 0:  # leaves from the gap itself: outwards first, or the wrong way at once
                    if rate[0] > 0.0 > rate[1]:
                        top = _zero(speed, a, b)
                        if distance(top) > 0.0:
                            return _zero(distance, top, b)
                    return a
                if distance(a) <= 0.0:
                    return a
                return _zero(distance, a, b) if distance(b) < 0.0 else b
            if rate[k] < 0.0 < rate[k + 1]:
                low = _zero(speed, a, b)
                if distance(low) < 0.0:
                    return _zero(distance, a, low) if distance(a) > 0.0 else a
        return None

    def land(self, rhs: Any, solver: DOP853, tau: float, switch: int, rtol: float, atol: float) -> tuple[float, Array]:
        """Integrate from the start of the solver's last step to the zero of one distance (near it for a smooth law)."""
        begin, y_begin, end = solver.t_old, _at_start(solver), solver.t
        m = 2 * self.model.n
        best: tuple[float, float, Array] | None = None
        for _ in range(_LANDING_ITERATIONS):
            if tau - begin <= 4 * _EPS * abs(begin):
                return best[1:] if best is not None else (begin, y_begin)
            y = reach(self.model, rhs, begin, y_begin, tau, rtol, atol)
            distance, approach = (float(values[switch]) for values in self._margins(y[:m]))
            if best is not None and abs(distance) >= best[0]:
                break
            best = abs(distance), tau, y
            correction = -distance / approach if approach != 0.0 else 0.0
            if self.model.switches[switch].stiffness is None:
                break
            if abs(correction) <= 2 * _EPS * abs(tau) or abs(correction) > 0.1 * (end - begin):
                break
            tau = min(tau + correction, end)
        assert best is not None
        return best[1], best[2]


# what is not finite ends in an error that says where
@np.errstate(over="ignore", invalid="ignore")
def advance(
    model: Field,
    begin: float,
    y: Array,
    end: float,
    rtol: float = 1e-12,
    atol: float = 1e-12,
    slope: bool = False,
    dense: bool = False,
) -> Passage:
    """Integrate stacked rows `y` from `begin` to `end` in `tau`; `rtol`, `atol` apply to the scaled variables.

    `slope`: the last row is the derivative with respect to `omega / W`. `dense`: keep every step and its interpolant.
    """
    m = 2 * model.n
    watch = _Watch(model, begin, y[:m])
    out = Passage(y, np.abs(y[:m]).copy(), tau=[begin], states=[y[:m].copy()])
    tau, length = begin, None
    while tau < end:
        rhs = exact_rate(model, watch.active, slope)
        solver = _solver(model, rhs, tau, y, end, rtol, atol, length)
        while solver.status == "running":
            _step(solver, model)
            change = watch.first_change(solver) if len(watch.active) else None
            if change is None:
                _record(out, solver, solver.t, _states(solver, model)[1], watch, m, dense)
                continue
            length = solver.t - solver.t_old
            at, y_at = watch.land(rhs, solver, change[0], change[1], rtol, atol)
            if at > solver.t_old:
                _record(out, solver, at, y_at, watch, m, dense)
            out.contacts.append(watch.change(at, change[1]))
            tau, y = at, y_at
            break
        else:
            tau, y = solver.t, solver.y
    out.y = y
    return out


def _record(out: Passage, solver: DOP853, tau: float, y: Array, watch: _Watch, m: int, dense: bool) -> None:
    np.maximum(out.extent, np.abs(y[:m]), out=out.extent)
    if not dense:
        return
    out.tau.append(tau)
    out.states.append(y[:m].copy())
    out.steps.append(Step(solver.t_old, tau, watch.active.copy(), _at_start(solver).copy(), solver.dense_output()))
