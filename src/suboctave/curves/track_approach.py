"""What lies between the last point of a curve of bifurcations and its end, where that was located."""

from __future__ import annotations

import numpy as np

from suboctave.continuation import NewtonOptions
from suboctave.continuation.linear import length
from suboctave.continuation.newton import correct
from suboctave.continuation.point import make_point
from suboctave.continuation.problem import Array
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.subharmonic_part import doubled_size
from suboctave.curves.track_ends import End, resonant_between
from suboctave.errors import ConvergenceError

#: points on the way to an end at which a parameter may turn before it, and a way for differences
_APPROACHES, _LITTLE = 6, 1e-6


def points_before(end: End, a: Sample, newton: NewtonOptions) -> list[Sample]:
    """Points between one and the end behind it, as many as a parameter asks for that is to turn there.

    The parameters p run like p_end + c z^2 + d z^4 towards it, z the size of the doubled part of limit points, or the
    distance of kappa from a resonance.
    """
    if end.event is None or a.curve.augmentation.turning:
        return []
    found: list[Sample] = []
    last = end.event.sample.point.u[-2:]
    for _ in range(_APPROACHES):
        point, curve = a.point, a.curve
        here = _remaining(curve, point.u)
        rate = (_remaining(curve, point.u + _LITTLE * point.tangent) - here) / _LITTLE
        slopes = point.tangent[-2:] * here
        # 2 c z^2 and 2 (c + 2 d z^2) z^2, but for the sign
        first, turned = 2.0 * (point.u[-2:] - last) * 2.0 * rate - slopes, slopes
        if not here * rate < 0.0 or not np.any(first * turned < 0.0):
            break
        way = -0.5 * here / rate
        row = point.weights * point.tangent
        try:
            solved = correct(curve, point.u + way * point.tangent, row / length(row), point.weights, newton)
            b = Sample(make_point(solved, curve, point.tangent, point.arclength + way))
        except ConvergenceError:
            break
        if not abs(_remaining(curve, b.point.u)) < abs(here) or resonant_between(a, b) is not None:
            break
        found.append(b)
        a = b
    return found


def _remaining(curve: MotionProblem, u: Array) -> float:
    """What vanishes at the end of limit points of doubled motions, or of an NS curve."""
    if curve.augmentation.name == "LP":
        return doubled_size(curve, u)
    extra, omega = curve.extra(u), curve.split(u)[1]
    share = float(extra[0]) * curve.balance.basis.nu / omega
    return share - 0.5 * round(2.0 * share)


__all__ = ["points_before"]
