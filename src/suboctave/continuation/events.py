"""Zeros of functions along a curve: the user's own events, and the bracketing that located bifurcations start from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import scipy

from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import CurvePoint, point_between
from suboctave.errors import ConvergenceError, InputError


@dataclass(frozen=True)
class Event:
    """A user's event: a zero of a function of the solution, located along the curve and reported under its name.

    name
        What it is called in the list of events.
    function
        Takes what the verb stores per point (a `PeriodicOrbit`), returns a number that changes sign at the event.
    """

    name: str
    function: Callable[[Any], float]

    def __post_init__(self) -> None:
        if not self.name or not isinstance(self.name, str):
            raise InputError(f"an Event needs a name, got {self.name!r}")
        if not callable(self.function):
            raise InputError(f"Event {self.name!r}: function must be callable, got {self.function!r}")


def locate_zero(
    a: CurvePoint,
    b: CurvePoint,
    value_a: float,
    value_b: float,
    function: Callable[[CurvePoint], float],
    newton: NewtonOptions,
    tolerance: float = 1e-12,
) -> CurvePoint:
    """The point between two neighbours at which a function that changes sign vanishes (Brent's method).

    Raises
    ------
    ConvergenceError
        If a point in between cannot be solved for.
    """
    points = {0.0: a, 1.0: b}
    little = 1e-14 * (abs(value_a) + abs(value_b))
    values = {0.0: value_a, 1.0: value_b}

    def value(share: float) -> float:
        if share not in points:
            points[share] = point_between(a, b, share, newton)
            values[share] = function(points[share])
        return 0.0 if abs(values[share]) < little else values[share]

    share, result = scipy.optimize.brentq(value, 0.0, 1.0, xtol=tolerance, full_output=True, disp=False)
    if not result.converged:
        raise ConvergenceError(f"the zero between {a.curve.where(a.u)} and {b.curve.where(b.u)} could not be located")
    value(share)
    return points[share]
