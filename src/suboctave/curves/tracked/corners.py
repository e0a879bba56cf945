"""Corners of tracked curves: with stops of the exact law a curve turns abruptly where another contact grazes.

Behind a grazing the Jacobian, and with it the test function of a bifurcation, moves like the square root of the
penetration; before it, smoothly. A curve of bifurcations that crosses a curve of grazings has a corner there, and may
come back on the same side of both parameters. What goes on monotonously is the height of the grazing extremum over its
gap: so the far side is looked for at a given height, from the last point before the corner.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.bifurcation.gaps import GapExtrema, gap_extrema
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.linear import length
from suboctave.continuation.newton import correct
from suboctave.continuation.point import make_point
from suboctave.curves.events.grazings import height_gradient
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError

#: distance from a gap, in units of the motion, at which a contact grazes
_GRAZES = 1e-3
#: ways in height at which the far side is looked for, the nearest first (what happens before the point found is not
#: seen), and how far it may lie then, in scaled arclength
_HEIGHTS, _NEAR = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 5e-3


def beyond_corner(last: Sample, newton: NewtonOptions) -> tuple[CurvePoint | None, str] | None:
    """A point behind a corner and what to say of it; no point where none is found, None where no contact grazes."""
    grazing = _grazing(last)
    if grazing is None:
        return None
    gap, at, height = grazing
    label = last.state.local(gap.element).element.label
    point, curve, where = last.point, last.curve, last.where
    by_x, rates = height_gradient(last.state, gap.element, gap.index, float(gap.tau[at]), curve.names)
    row = curve.join(by_x, rates, np.zeros(curve.augmentation.extras)) / point.weights
    size = length(row)
    row = row / size
    # the side of the gap from which the extremum comes
    coming = -float(row @ (point.weights * point.tangent))
    for way in _HEIGHTS:
        rise = -math.copysign(way * size, coming) - height
        if rise * coming >= 0.0 or abs(rise) < 0.5 * way * size:
            # the curve has come that far behind the corner
            continue
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


def _grazing(sample: Sample) -> tuple[GapExtrema, int, float] | None:
    """The extremum nearest to a grazing: its gap, its index there, its height over the gap; None if all are far."""
    heights = [(gap, i, h) for gap in gap_extrema(sample.state) for i, h in enumerate((gap.value - gap.level).tolist())]
    nearest = min(heights, key=lambda item: abs(item[2]), default=None)
    return nearest if nearest and abs(nearest[2]) <= _GRAZES * float(np.abs(sample.state.x).max()) else None
