"""An elastic stop rounded by an arctan step of its stiffness, in the numbers of `SharpSampling`; see `stops`.

    right:  f = k [phi(y) + r]        left:  f = k [u - phi(y) + r]        y = u - b
    phi(y) = y/2 + y atan(s y)/pi - ln(1 + s^2 y^2)/(2 pi s)

with r = `at_rest`: an arctan step `side k` of width 1/s at b, the slope k/2 and the constant `k (r - side b / 2)`.
Numbers in, numbers out: elements take these functions as they are, those who follow laws along a parameter compile
them.
"""

from __future__ import annotations

import math

__all__ = ["at_rest", "at_rest_by_gap", "at_rest_by_sharpness"]


def at_rest(side: float, b: float, s: float) -> float:
    """r: what makes the force at `u = 0` that of the exact law."""
    phi = -b * (0.5 - math.atan(s * b) / math.pi) - math.log1p((s * b) ** 2) / (2.0 * math.pi * s)
    return side * max(-side * b, 0.0) - side * phi


def at_rest_by_gap(side: float, b: float, s: float) -> float:
    """Its derivative by the gap; at `b = 0` from the side where the stop is open at rest."""
    return side * (0.5 - math.atan(s * b) / math.pi) - (1.0 if side * b < 0.0 else 0.0)


def at_rest_by_sharpness(side: float, b: float, s: float) -> float:
    """Its derivative by the sharpness."""
    return -side * math.log1p((s * b) ** 2) / (2.0 * math.pi * s * s)
