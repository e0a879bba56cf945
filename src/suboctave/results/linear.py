"""The linear response under a curve: that of the system without its elements over the same range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from suboctave.continuation.linear import one_thread
from suboctave.continuation.march import SteppingOptions
from suboctave.continuation.newton import NewtonOptions
from suboctave.curves.follow import follow
from suboctave.curves.starts import make_curve, start_point
from suboctave.curves.trace import Settings, Trace
from suboctave.errors import InputError
from suboctave.floquet.methods import method_of
from suboctave.model.system import System

#: largest angle between neighbours, in radians: a resonance is drawn round
_ANGLE = 0.1


def linear_trace(curve: Any) -> tuple[System, Trace]:
    """The system without its elements, and its response over the range of a curve; InputError where it has none."""
    if not len(curve):
        raise InputError("the curve is empty")
    orbit, name = curve.orbits[0], curve.name
    system = orbit.system.linear()
    if name != "omega" and name not in system.parameters:
        raise InputError(f"without the elements nothing depends on {name}: its linear response stays the same")
    if not system.driven:
        raise InputError("without the elements nothing drives the system: there is no linear response")
    values = curve.parameter(name)
    first, last = curve.options.get("bounds", {}).get(name, (values[0], values[-1]))
    low, high = min(first, last), max(first, last)
    known = curve.options.get("newton")
    newton = NewtonOptions(**known) if isinstance(known, Mapping) else NewtonOptions()
    settings = Settings(newton, SteppingOptions(angle=_ANGLE), method_of("monodromy"), observe=curve.observe)
    harmonics = max(1, *(load.harmonic for load in system.load_components()))
    # an undriven curve of cycles has another frequency at every point, and no response
    omega = first if name == "omega" else orbit.omega
    problem = make_curve(system, name, float(omega), high - low, harmonics, 1, None, curve.observe)
    with one_thread():
        begun = start_point(problem, float(first), None, newton, (low, high))
        return system, follow(begun, float(np.sign(last - first)), (low, high), settings)
