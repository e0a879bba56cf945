"""Corners of curves: with stops of the exact law one of bifurcations turns abruptly where another contact grazes, and a
response where contact begins everywhere at once.

Behind a grazing the Jacobian, and with it the test function of a bifurcation, moves like the square root of the
penetration; before it, smoothly. A curve of bifurcations that crosses a curve of grazings has a corner there, and may
come back on the same side of both parameters. What goes on monotonously is the height of the grazing extremum over its
gap: so the far side is looked for at a given height, from the last point before the corner.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from suboctave.bifurcation.gaps import GapExtrema, gap_extrema
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.linear import length
from suboctave.continuation.newton import correct
from suboctave.continuation.notes import Note
from suboctave.continuation.point import make_point
from suboctave.curves.events.grazings import height_gradient, nearest_extremum
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.orbit import PeriodicOrbit

#: distance from a gap, in units of the motion, at which a contact grazes
_GRAZES = 1e-3
#: the same, from which on it is clear on which side of the gap the curve has come
_CLEAR = 1e-6
#: angle to the way that the curve has come at which another part of it leads away
_BACK = 1e-3
#: phase of the load by which an extremum moves at most on the last steps into a corner
_MOVED = 0.3
#: ways in height at which the far side is looked for, the nearest first (what happens before the point found is not
#: seen), and how far it may lie then, in scaled arclength
_HEIGHTS, _NEAR = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 5e-3


def beyond_corner(
    last: Sample, before: Iterable[PeriodicOrbit], newton: NewtonOptions
) -> tuple[CurvePoint | None, Note] | None:
    """A point behind a corner and a note on it; no point where none is found, None where no contact grazes.

    `before`: the motions up to there, the last first.
    """
    grazing = _grazing(last)
    if grazing is None:
        return None
    gap, at, height = grazing
    label, clear = last.state.local(gap.element).element.label, _CLEAR * float(np.abs(last.state.x).max())
    coming = next((h for h in (_height(orbit, gap, at) for orbit in before) if abs(h) > clear), height)
    point, curve = last.point, last.curve
    here = curve.name, point.parameter, point.parameter, "", last.where
    by_x, rates = height_gradient(last.state, gap.element, gap.index, float(gap.tau[at]), curve.names)
    row = curve.join(by_x, rates, np.zeros(curve.augmentation.extras)) / point.weights
    size = length(row)
    row = row / size
    along = point.weights * point.tangent
    along = along / length(along)
    for way in _HEIGHTS:
        rise = -math.copysign(way * size, coming) - height
        if rise * coming >= 0.0 or abs(rise) < 0.5 * way * size:
            # the curve has come that far behind the corner
            continue
        guess = point.u + rise / size * row / point.weights
        try:
            solved = correct(curve, guess, row, point.weights, newton)
            away = point.weights * (solved.u - point.u)
            # not back along the curve itself
            if length(away) < _NEAR and length(away / length(away) + along) > _BACK:
                # behind a corner the extremum moves on from the gap; what led there may be most of the way
                ahead = math.copysign(1.0, rise) * row / point.weights
                new = make_point(solved, ahead, point.arclength + length(away))
                return new, Note(f"the curve has a corner there, {label} grazes", *here)
        except ConvergenceError:
            continue
    return None, Note(f"{label} grazes, the equations are not smooth there", *here)


def grazes(point: CurvePoint) -> bool:
    """Whether a contact grazes about there: the curve may have come from where its parameter leads on."""
    return _grazing(Sample(point)) is not None


def _grazing(sample: Sample) -> tuple[GapExtrema, int, float] | None:
    """The extremum nearest to a grazing: its gap, its index there, its height over the gap; None if all are far."""
    heights = [(gap, i, h) for gap in gap_extrema(sample.state) for i, h in enumerate((gap.value - gap.level).tolist())]
    nearest = min(heights, key=lambda item: abs(item[2]), default=None)
    return nearest if nearest and abs(nearest[2]) <= _GRAZES * float(np.abs(sample.state.x).max()) else None


def _height(orbit: PeriodicOrbit, gap: GapExtrema, at: int) -> float:
    """Height of the same extremum on another motion; 0 where there is none."""
    tau = float(gap.tau[at])
    same = nearest_extremum(orbit.state(), gap.element, gap.index, tau, bool(gap.curve[at] < 0.0))
    # where it was not born yet another one is the nearest
    if same is None or math.cos(float(same[0].tau[same[1]]) - tau) < math.cos(_MOVED):
        return 0.0
    return float(same[0].value[same[1]] - same[0].level)
