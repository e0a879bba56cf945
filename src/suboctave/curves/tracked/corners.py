"""Corners of tracked curves: with stops of the exact law a curve turns abruptly where another contact grazes.

Behind a grazing the Jacobian, and with it the test function of a bifurcation, moves like the square root of the
penetration; before it, smoothly. A curve of bifurcations that crosses a curve of grazings has a corner there, and may
come back on the same side of both parameters. What goes on monotonously is the height of the grazing extremum over its
gap: so the far side is looked for at a given height, from the last point before the corner.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from suboctave.bifurcation.gaps import GapExtrema, basis_rows, gap_extrema, level_rate, read_direction
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.linear import length
from suboctave.continuation.newton import correct
from suboctave.continuation.point import make_point
from suboctave.continuation.problem import Array
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.orbit import PeriodicOrbit

#: distance from a gap, in units of the motion, at which a contact grazes
_GRAZES = 1e-3
#: the same, from which on it is clear on which side of the gap the curve has come
_CLEAR = 1e-6
#: ways in height at which the far side is looked for, the nearest first (what happens before the point found is not
#: seen), and how far it may lie then, in scaled arclength
_HEIGHTS, _NEAR = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 5e-3


def beyond_corner(
    last: Sample, before: Iterable[PeriodicOrbit], newton: NewtonOptions
) -> tuple[CurvePoint | None, str] | None:
    """A point behind a corner and what to say of it; no point where none is found, None where no contact grazes.

    `before`: the motions up to there, the last first.
    """
    grazing = _grazing(last)
    if grazing is None:
        return None
    gap, at, height = grazing
    gradient, label = _gradient(last, gap, at), last.state.local(gap.element).element.label
    coming = next((h for h in (_height(orbit, gap, at) for orbit in before) if abs(h) > _CLEAR * _size(last)), height)
    point, curve = last.point, last.curve
    where = curve.where(point.u)
    row = gradient / point.weights
    size = length(row)
    row = row / size
    for way in _HEIGHTS:
        rise = -math.copysign(way * size, coming) - height
        guess = point.u + rise / size * row / point.weights
        try:
            solved = correct(curve, guess, row, point.weights, newton)
            away = point.weights * (solved.u - point.u)
            if length(away) < _NEAR:
                # behind a corner the extremum moves on from the gap; what led there may be most of the way
                ahead = math.copysign(1.0, rise) * row / point.weights
                new = make_point(solved, curve, ahead, point.arclength + length(away))
                return new, f"the curve has a corner at {where}, where {label} grazes"
        except ConvergenceError:
            continue
    return None, f"{label} grazes at {where}: the equations are not smooth there"


def _size(sample: Sample) -> float:
    """The size of a motion that heights are compared with."""
    return float(np.abs(sample.state.x).max())


def _grazing(sample: Sample) -> tuple[GapExtrema, int, float] | None:
    """The extremum nearest to a grazing: its gap, its index there, its height over the gap; None if all are far."""
    near = []
    for gap in gap_extrema(sample.state):
        heights = gap.value - gap.level
        if len(heights):
            at = int(np.abs(heights).argmin())
            near.append((gap, at, float(heights[at])))
    nearest = min(near, key=lambda item: abs(item[2]), default=None)
    return nearest if nearest is not None and abs(nearest[2]) <= _GRAZES * _size(sample) else None


def _height(orbit: PeriodicOrbit, gap: GapExtrema, at: int) -> float:
    """Height of the same extremum on another motion; 0 where there is none."""
    tau, maximum = float(gap.tau[at]), bool(gap.curve[at] < 0.0)
    for other in gap_extrema(orbit.state()):
        if (other.element, other.index) == (gap.element, gap.index):
            same = np.flatnonzero((other.curve < 0.0) == maximum)
            if same.size:
                i = same[np.argmin(1.0 - np.cos(other.tau[same] - tau))]
                return float(other.value[i] - other.level)
    return 0.0


def _gradient(sample: Sample, gap: GapExtrema, at: int) -> Array:
    """Gradient of the extremum's height over the gap by u."""
    state, curve = sample.state, sample.curve
    value = basis_rows(state.basis.harmonics, float(gap.tau[at]))[0]
    by_x = np.multiply.outer(value, read_direction(state, gap.element))
    rates = np.array([-level_rate(state, gap.element, gap.index, name) for name in curve.names])
    return curve.join(by_x, rates, np.zeros(curve.augmentation.extras))
