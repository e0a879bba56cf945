"""Compiled tangent of the regularised stop and its derivatives by the coefficients.

Imported on first evaluation, so that a model alone needs no compiler.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel

__all__ = ["regularised_rates", "regularised_tangent"]


@kernel(error_model="numpy")
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


@kernel(error_model="numpy")
def regularised_rates(u, stiffness, gap, sharpness, side, at_rest, by_gap, by_sharpness):
    """Derivatives of force and stiffness by stiffness, gap and sharpness, (3, N) each.

    `by_gap`, `by_sharpness`: what `at_rest` contributes per unit of stiffness.
    """
    n = u.shape[0]
    force = np.empty((3, n))
    slope = np.empty((3, n))
    for i in range(n):
        y = u[i] - gap
        sy = sharpness * y
        angle = math.atan(sy) / math.pi
        log = math.log1p(sy * sy) / (2.0 * math.pi * sharpness)
        phi = y * (0.5 + angle) - log
        bend = stiffness * side / (math.pi * (1.0 + sy * sy))
        force[0, i] = (phi if side > 0 else u[i] - phi) + at_rest
        slope[0, i] = 0.5 + angle if side > 0 else 0.5 - angle
        force[1, i] = stiffness * (by_gap - side * (0.5 + angle))
        slope[1, i] = -bend * sharpness
        force[2, i] = stiffness * (side * log / sharpness + by_sharpness)
        slope[2, i] = bend * y
    return force, slope
