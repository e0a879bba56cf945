"""How a curve is followed: Newton's method, scaled arclength, events. No vibration in here: it follows any curve."""

from suboctave.continuation.events import Event
from suboctave.continuation.march import March, SteppingOptions
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import CurvePoint

__all__ = ["CurvePoint", "Event", "March", "NewtonOptions", "SteppingOptions"]
