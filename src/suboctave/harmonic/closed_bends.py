"""Second and third derivatives of laws known in closed form along a motion, as weights at instants, part by part.

For a force f (u) along one direction and any periodic h,

    int f_uu h dtau = sum_j second_j h (tau_j),    int f_uuu h dtau = sum_j third_j h (tau_j) + slope_j h' (tau_j).

A piecewise-linear law has Dirac functions at the crossings of its gaps (`bends` says where their slopes come from),
polynomials have weights on a uniform grid, arctan steps on the graded nodes that their force is integrated with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.instants import _jet, crossings_of
from suboctave.harmonic.kernels import motion
from suboctave.harmonic.quadrature import even, search_grid, uniform_nodes

if TYPE_CHECKING:
    from suboctave.harmonic.group_force import GroupLaw

_NO_SLOPE = np.zeros(0)


class ClosedBends(NamedTuple):
    """Instants (cosines, sines) and weights, (N,) each; `slope` is empty where there is no corner."""

    zr: Array
    zi: Array
    second: Array
    third: Array
    slope: Array


def closed_bends(law: GroupLaw, along: ComplexArray, top: int, told_nodes: Callable[[], Array]) -> list[ClosedBends]:
    """Of all laws of a direction that are known in closed form.

    along: coefficients of its displacement (H + 1,); told_nodes: gives the nodes of its arctan steps (`graded_motion`).
    """
    high, parts = along.shape[0] - 1, []
    if law.pieces.shape[0]:
        grid = search_grid(high)
        parts.append(ClosedBends(*bends_of_corners(along, law.pieces, grid.zr, grid.zi)))
    if law.polynomial.shape[0] > 2:
        nodes = uniform_nodes(even((law.polynomial.shape[0] - 1) * high + top + 1))
        second, third = bends_of_polynomial(along, law.polynomial, nodes.zr, nodes.zi)
        parts.append(ClosedBends(nodes.zr, nodes.zi, second, third, _NO_SLOPE))
    if law.told:
        sampled = told_nodes()
        second, third = bends_of_smooth_steps(sampled, law.smooth_steps)
        parts.append(ClosedBends(sampled[0], sampled[1], second, third, _NO_SLOPE))
    return parts


@kernel()
def bends_of_corners(c, pieces, grid_r, grid_i):
    """Instants at which the gaps of piecewise-linear pieces (stiffness, gap, side) are crossed: cosines, sines, and the
    weights there, (5, N); `f_uu` has `side stiffness / |u'|`, |u'| kept from zero where the motion grazes.
    """
    values = motion(c, grid_r, grid_i)
    largest = 1e-300
    for h in range(c.shape[0]):
        largest = max(largest, abs(c[h]))
    out = np.empty((5, 4 * grid_r.shape[0] * max(1, pieces.shape[0])))
    count = 0
    for p in range(pieces.shape[0]):
        found, _above = crossings_of(c, pieces[p, 1], values)
        for i in range(found.shape[0]):
            zr, zi = math.cos(found[i]), math.sin(found[i])
            _value, speed, bend = _jet(c, zr, zi)
            if abs(speed) < 1e-12 * largest:
                speed = 1e-12 * largest
            weight = pieces[p, 2] * pieces[p, 0] / abs(speed)
            out[0, count] = zr
            out[1, count] = zi
            out[2, count] = weight
            out[3, count] = weight * bend / (speed * speed)
            out[4, count] = -weight / speed
            count += 1
    return np.ascontiguousarray(out[:, :count])


@kernel()
def bends_of_polynomial(c, polynomial, zr, zi):
    """Weights (2, N) of `sum_p polynomial_p u^p` at equidistant points on the circle, enough for the tangent."""
    values = motion(c, zr, zi)
    n = zr.shape[0]
    out = np.empty((2, n))
    scale = 2.0 * math.pi / n
    for j in range(n):
        second = third = 0.0
        for p in range(polynomial.shape[0] - 1, 1, -1):
            third = third * values[0, j] + second
            second = second * values[0, j] + p * (p - 1) * polynomial[p]
        out[0, j] = scale * second
        out[1, j] = scale * third
    return out


@kernel()
def bends_of_smooth_steps(sampled, steps):
    """Weights (2, N) of arctan steps of the stiffness; arguments as in `group_kernels.add_smooth_steps`."""
    n = sampled.shape[1]
    out = np.zeros((2, n))
    for s in range(steps.shape[0]):
        point, sharpness = steps[s, 0], 1.0 / steps[s, 1]
        scale = steps[s, 2] * sharpness / math.pi
        for j in range(n):
            ratio = (sampled[3, j] - point) * sharpness
            share = 1.0 / (1.0 + ratio * ratio)
            out[0, j] += sampled[2, j] * scale * share
            out[1, j] -= 2.0 * sampled[2, j] * scale * sharpness * ratio * share * share
    return out


__all__ = ["ClosedBends", "closed_bends"]
