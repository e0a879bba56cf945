"""Zeros of functions along a curve: the user's own events, and the bracketing that located bifurcations start from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
    """The point between two neighbours at which a function that changes sign vanishes (Illinois false position).

    Raises
    ------
    ConvergenceError
        If a point in between cannot be solved for.
    """
    if value_a == 0.0:
        return a
    if value_b == 0.0:
        return b
    low, high, f_low, f_high = 0.0, 1.0, value_a, value_b
    best, kept = b, 0
    for iteration in range(100):
        share = f_low / (f_low - f_high)
        # a guard against creeping: now and then halve the bracket
        fraction = 0.5 * (low + high) if iteration % 8 == 7 else low + share * (high - low)
        best = point_between(a, b, fraction, newton)
        value = function(best)
        if value == 0.0 or high - low < tolerance or abs(value) < 1e-14 * (abs(value_a) + abs(value_b)):
            return best
        if (value > 0.0) == (f_low > 0.0):
            low, f_low = fraction, value
            f_high, kept = (0.5 * f_high if kept == 1 else f_high), 1
        else:
            high, f_high = fraction, value
            f_low, kept = (0.5 * f_low if kept == -1 else f_low), -1
    if high - low < 1e-6:
        return best
    raise ConvergenceError(f"the zero between {a.curve.where(a.u)} and {b.curve.where(b.u)} could not be located")
