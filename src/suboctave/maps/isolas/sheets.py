"""How the range of an isola moves with a second parameter: its two ends, followed from sheet to sheet.

At one value s of the second parameter an isola lives between two values of the design parameter q, each an extremum of
a curve of limit points, or a bound. Both ends are followed in s. Where both reach the same turn of one curve of extrema
the range closes: beyond there is no isola. Where only one end is followed no further, what is beyond is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.maps.pieces import MonotonePiece

__all__ = ["Span", "spans_of"]

#: shares of the range of s that are rounding
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Span:
    """A stretch of s over which an isola lives between two ends, each a border or a number (a bound of q).

    `reasons` says in words why it begins at its lower and ends at its upper value of s; `closed` whether the range of q
    shrinks to nothing there; `settled` whether that is all there is (the bounds of s, or closed).
    """

    low: float
    high: float
    ends: tuple[MonotonePiece | float, MonotonePiece | float]
    reasons: tuple[str, str]
    closed: tuple[bool, bool]
    settled: tuple[bool, bool]

    def contains(self, value: float) -> bool:
        """Whether it reaches a value of s."""
        return self.low <= value <= self.high

    def range(self, value: float) -> tuple[float, float]:
        """Between which values of q the isola exists at a value of s."""
        low, high = (float(e.across(value)) if isinstance(e, MonotonePiece) else e for e in self.ends)
        return low, high

    def outline(self, count: int = 241) -> tuple[Array, Array, Array]:
        """Values of s, dense towards both ends, and both ends of the range of q there."""
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
        values = self.low + share * (self.high - self.low)
        low, high = (e.across(values) if isinstance(e, MonotonePiece) else np.full(count, e) for e in self.ends)
        return values, np.asarray(low), np.asarray(high)


def spans_of(
    start: float,
    ends: tuple[MonotonePiece | float, MonotonePiece | float],
    bounds: tuple[float, float],
    second: str,
) -> Span:
    """The stretch of s around `start` over which both ends can be followed."""
    down, up = (_reached(start, ends, bounds, second, upper) for upper in (False, True))
    return Span(down[0], up[0], ends, (down[1], up[1]), (down[2], up[2]), (down[3], up[3]))


def _reached(
    start: float,
    ends: tuple[MonotonePiece | float, MonotonePiece | float],
    bounds: tuple[float, float],
    second: str,
    upper: bool,
) -> tuple[float, str, bool, bool]:
    """How far in one direction: the value of s, why no further, whether the range closes, whether that is settled."""
    bound = bounds[1] if upper else bounds[0]
    sign = 1.0 if upper else -1.0
    slack = _ROUNDING * (bounds[1] - bounds[0])
    reach = bound
    for end in ends:
        if isinstance(end, MonotonePiece):
            edge = end.high if upper else end.low
            reach = edge if sign * (edge - reach) < 0.0 else reach
    crossed = _crossing(start, reach, ends, upper)
    if crossed is not None:
        return crossed, f"the two ends of the range cross at {second} = {crossed:.7g}", True, False
    if abs(reach - bound) <= slack:
        return bound, f"{second} = {bound:.7g}, the end of the bounds", False, True
    stops = [e for e in ends if isinstance(e, MonotonePiece) and abs((e.high if upper else e.low) - reach) <= slack]
    events = [e.end(upper) for e in stops]
    if len(stops) == 2 and events[0] is not None and events[1] is not None and events[0].orbit is events[1].orbit:
        where = f"{second} = {reach:.7g}, {events[0].names[1]} = {events[0].parameter(events[0].names[1]):.7g}"
        return reach, f"born and merging meet at {where}: no isola beyond", True, True
    border = stops[0]
    ending = "turns back" if border.end(upper) is not None else f"ends ({border.curve.ended})"
    return reach, f"the curve of one end {ending} at {second} = {reach:.7g}: what is beyond is not known", False, False


def _crossing(start: float, reach: float, ends: Sequence[MonotonePiece | float], upper: bool) -> float | None:
    """The value of s nearest to `start` at which the lower end rises above the upper one, None if it does not."""
    low, high = ends
    if reach == start or (
        isinstance(low, MonotonePiece) and isinstance(high, MonotonePiece) and low.curve is high.curve
    ):
        return None
    values = np.linspace(start, reach, 400)[:-1]
    first, last = (e.across(values) if isinstance(e, MonotonePiece) else np.full(len(values), e) for e in (low, high))
    crossed = np.nonzero(np.asarray(first) > np.asarray(last))[0]
    return float(values[crossed[0]]) if len(crossed) else None
