"""Compiled tangent of the regularised stop. Imported on first evaluation, so that a model alone needs no compiler."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["regularised_tangent"]


@njit(cache=True, error_model="numpy")
def regularised_tangent(u, stiffness, gap, sharpness, side, at_rest):
    """Force and stiffness (N,) of the arctan law; `at_rest` is the constant that makes it right at `u = 0`."""
    force = np.empty(u.shape[0])
    slope = np.empty(u.shape[0])
    for i in range(u.shape[0]):
        y = u[i] - gap
        sy = sharpness * y
        angle = math.atan(sy) / math.pi
        phi = y * (0.5 + angle) - math.log1p(sy * sy) / (2.0 * math.pi * sharpness)
        if side > 0:
            force[i] = stiffness * (phi + at_rest)
            slope[i] = stiffness * (0.5 + angle)
        else:
            force[i] = stiffness * (u[i] - phi + at_rest)
            slope[i] = stiffness * (0.5 - angle)
    return force, slope
