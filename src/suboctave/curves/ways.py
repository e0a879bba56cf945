"""A curve followed from an inner point to both sides."""

from __future__ import annotations

from suboctave.continuation import CurvePoint
from suboctave.continuation.ending import Ending, EndReason
from suboctave.curves.follow import follow
from suboctave.curves.motion import MotionProblem
from suboctave.curves.trace import Settings, Trace

__all__ = ["both_ways"]

START = Ending(EndReason.START)


def both_ways(point: CurvePoint, ahead: float, bounds: tuple[float, float], settings: Settings) -> Trace:
    """Follow a curve from an inner point to both sides; from a bound inwards only."""
    low, high = bounds
    slack = 1e-9 * (high - low)
    if abs(point.parameter - (low if ahead > 0 else high)) <= slack:
        return follow(point, ahead, bounds, settings)
    if abs(point.parameter - (high if ahead > 0 else low)) <= slack:
        back = follow(point, -ahead, bounds, settings)
        only = Trace(back.points[:1], endings=(START, START))
        return back.reversed_before(only)
    forward = follow(point, ahead, bounds, settings)
    if forward.closed or forward.interrupted:
        return forward
    back = follow(point, -ahead, bounds, settings)
    # between two folds the curve runs the other way: what matters is where it ends
    assert isinstance(point.curve, MotionProblem)
    name, target = point.curve.name, high if ahead > 0 else low
    ends = [t.points[-1].orbit for t in (forward, back)]
    misses = [abs((o.omega if name == "omega" else o.values[name]) - target) for o in ends]
    return back.reversed_before(forward) if misses[0] <= misses[1] else forward.reversed_before(back)
