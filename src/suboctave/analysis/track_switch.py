"""Where a curve of bifurcations begins on another one: the limit points that leave a generalised period doubling.

At a GPD the motions of twice the period change sides. On one side of it the doubled branch turns back close to its
birth, and these limit points are a curve that ends at the GPD, tangent to the curve of period doublings. It is entered
beside its end: at a value of the second parameter near that of the GPD the period doubling is located, the doubled
branch followed, and its first limit point taken.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suboctave.analysis.options import Inherited
from suboctave.analysis.switching import switch_branch
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation import SteppingOptions
from suboctave.curves.discretisation import own_linear_part
from suboctave.curves.events.locate import Guess, Singular
from suboctave.curves.events.monitors import PERIOD_DOUBLING
from suboctave.curves.motion import MotionProblem
from suboctave.curves.refine import solved_bifurcation
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.interruption import pass_on

__all__ = ["limit_point_beside"]

#: distances from the GPD at which the curve is looked for, in units of the second parameter's range
_SHARES = (0.001, 0.003, 0.01, 0.03, 0.1)
#: steps from the GPD to there
_STEPS = 24
#: way of a limit point from the birth of its branch, in scaled arclength, that is far enough from the GPD
_CLEAR = 0.01
#: range of the first parameter in which the doubled branch is followed, in units of its value
_AROUND = 0.05


def limit_point_beside(event: TrackedEvent, span: float) -> Bifurcation:
    """A limit point of the doubled motions close to a generalised period doubling.

    Parameters
    ----------
    event
        The GPD.
    span
        Width of the second parameter's range.

    Raises
    ------
    ConvergenceError
        If none is found beside it.
    """
    best: tuple[float, Bifurcation] | None = None
    for share in _SHARES:
        for sign in (1.0, -1.0):
            try:
                candidate = _limit_point(event, sign * share * span)
            except ConvergenceError:
                continue
            if candidate is not None and (best is None or candidate[0] > best[0]):
                best = candidate
        if best is not None and best[0] > _CLEAR:
            break
    if best is not None:
        return best[1]
    first, second = event.names
    raise ConvergenceError(
        f"no limit point of the doubled motions was found beside the GPD at {first} = {event.parameter(first):.6g}, "
        f"{second} = {event.parameter(second):.6g}"
    )


def _doubling_at(event: TrackedEvent, way: float) -> Singular:
    """The period doubling at a distance from the GPD, in steps along its curve."""
    free, fixed = event.names
    orbit = event.orbit
    span = 2.0 * _AROUND * (abs(event.parameter(free)) or 1.0)
    x, first = orbit.coefficients, event.parameter(free)
    step_x, step = np.zeros_like(x), 0.0
    vectors = event.null_vectors
    for number in range(1, _STEPS + 1):
        values = {**orbit.values, fixed: event.parameter(fixed) + way * number / _STEPS}
        omega = orbit.omega
        if free == "omega":
            omega = first + step
        else:
            values[free] = first + step
        guess = Guess(orbit.balance, x + step_x, omega, values, free, span, vectors=vectors)
        doubling = PERIOD_DOUBLING.solve(guess)
        state = doubling.state
        value = state.omega if free == "omega" else state.values[free]
        step_x, step = state.x - x, value - first
        x, first, vectors = state.x, value, doubling.vectors
    return doubling


def _limit_point(event: TrackedEvent, way: float) -> tuple[float, Bifurcation] | None:
    """The first limit point of the doubled branch at a distance from the GPD, and how far from its birth it lies."""
    free, fixed = event.names
    orbit = event.orbit
    value = event.parameter(free)
    start = _doubling_at(event, way)
    system = orbit.system.with_parameters({fixed: event.parameter(fixed) + way})
    linear = own_linear_part(orbit)
    if linear is not None:
        linear = linear.rebuilt(dict(system.parameters))
    balance = HarmonicBalance(system, orbit.basis, linear=linear).settle(start.state.x, start.state.omega)
    width = _AROUND * (abs(value) or 1.0)
    curve = MotionProblem.response(balance, free, orbit.omega, 2.0 * width, orbit.adaptive)
    observe = Inherited(event).observe or 0
    own = replace(start, state=balance.at(start.state.x, start.state.omega, start.state.values))
    doubling = solved_bifurcation(PERIOD_DOUBLING, own, curve, observe, [])
    there = doubling.parameter(free)
    context: dict[str, Any] = {**(event.context or {}), "bounds": {free: (there - width, there + width)}}
    stepping = SteppingOptions(max_step=0.03, max_points=60)
    branch = switch_branch(replace(doubling, context=context), stepping=stepping)
    pass_on(branch.interruption)
    limits = branch.bifurcations["LP"]
    if not limits:
        return None
    return float(limits[0].arclength), limits[0]
