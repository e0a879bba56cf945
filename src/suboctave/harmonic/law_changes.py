"""Compiled: what a parameter does to laws that are known in closed form, as Fourier coefficients along a direction.

The laws themselves are evaluated in `group_kernels`. With rates k', b' of stiffness and gap, the force of a piece `k (u
- b)` in contact (indicator chi) changes by `(k' (u - b) - k b') chi`, its slope by `k' chi - side k b' delta (u - b)`:
along the motion the Dirac function has the weight `1 / |u'|` at every crossing of the gap. Of an arctan step `s / pi [y
atan(y / w) - w / 2 ln(1 + (y / w)^2)]`, y = u - p, with rates p', w', s' of place, width and step:

    f' = s' f / s - s / pi (p' atan(y / w) + w' / 2 ln(1 + (y / w)^2))
    f_u' = s' f_u / s - s / pi (p' w + w' y) / (w^2 + y^2).
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.arctangent import add_step, arctangent
from suboctave.harmonic.group_kernels import add_pair
from suboctave.harmonic.instants import _jet, crossings_of
from suboctave.harmonic.kernels import contact_spectrum, motion, product_spectrum
from suboctave.harmonic.sharp_nodes import sharp_nodes

__all__ = ["add_changes", "change_of_pieces", "change_of_steps"]


@kernel()
def change_of_pieces(c, pieces, grid_r, grid_i, force, stiffness):
    """Add what changes of piecewise-linear laws do to the spectra of force and stiffness (top + 1,), in place.

    c: complex coefficients of the displacement (H + 1,); pieces: stiffness, gap, side, rates of stiffness and gap
    (P, 5); grid: equidistant points on the circle for the search for crossings.
    """
    top, high = force.shape[0] - 1, c.shape[0] - 1
    values = motion(c, grid_r, grid_i)
    largest = 1e-300
    for h in range(high + 1):
        largest = max(largest, abs(c[h]))
    for p in range(pieces.shape[0]):
        k, gap, side, by_stiffness, by_gap = pieces[p]
        found, above = crossings_of(c, gap, values)
        if found.shape[0] == 0 and above != (side > 0):
            continue
        chi = contact_spectrum(found, above, side, top + high)
        for q in range(top + 1):
            force[q] -= k * by_gap * chi[q]
            stiffness[q] += by_stiffness * chi[q]
        if by_stiffness != 0.0:
            product = product_spectrum(c, gap, chi, top)
            for q in range(top + 1):
                force[q] += by_stiffness * product[q]
        if by_gap == 0.0:
            continue
        for i in range(found.shape[0]):
            zr, zi = math.cos(found[i]), math.sin(found[i])
            _value, speed, _bend = _jet(c, zr, zi)
            # kept from zero where the motion grazes: the derivative does not exist there
            weight = side * k * by_gap / (2.0 * math.pi * max(abs(speed), 1e-12 * largest))
            pr, pi = weight, 0.0
            for q in range(top + 1):
                stiffness[q] -= complex(pr, pi)
                pr, pi = pr * zr + pi * zi, pi * zr - pr * zi


@kernel(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")
def add_moved_step(u, point, width, factor, by_point, by_width, force, stiffness):
    """Add what rates of place and width of a step do to force, without its logarithm, and stiffness (N,), in place."""
    sharpness = 1.0 / width
    for j in range(u.shape[0]):
        ratio = (u[j] - point) * sharpness
        force[j] -= factor * by_point * arctangent(ratio)
        stiffness[j] -= factor * sharpness * (by_point + by_width * ratio) / (1.0 + ratio * ratio)


@kernel()
def change_of_steps(sampled, steps, line, force, stiffness):
    """Add what changes of arctan steps of the stiffness do to the spectra of force and stiffness (top + 1,), in place.

    sampled: what `sharp_nodes` gives, (4, N); steps: point, width, step and their rates, (S, 6); line: rates of
    constant and slope.
    """
    n = sampled.shape[1]
    zr, zi, weights, u = sampled[0], sampled[1], sampled[2], sampled[3]
    f = np.empty(n)
    f_u = np.empty(n)
    for j in range(n):
        f[j] = line[0] + line[1] * u[j]
        f_u[j] = line[1]
    for s in range(steps.shape[0]):
        point, width, step, by_point, by_width, by_step = steps[s]
        if by_step != 0.0:
            add_step(u, point, width, by_step / math.pi, f, f_u)
        if by_point != 0.0 or by_width != 0.0:
            add_moved_step(u, point, width, step / math.pi, by_point, by_width, f, f_u)
        if by_width != 0.0:
            for j in range(n):
                ratio = (u[j] - point) / width
                f[j] -= 0.5 * step / math.pi * by_width * math.log1p(ratio * ratio)
    add_pair(f, f_u, weights, zr, zi, force, stiffness)


@kernel()
def add_changes(
    motions, pieces, first, steps, step_first, line, grid, noted, points, widths, places, rule_nodes, rule_weights,
    force, stiffness,
):  # fmt: skip
    """Add what a parameter does to the laws along all directions to the spectra of force and stiffness (G, top + 1).

    Parameters
    ----------
    motions, grid
        As in `evaluation.evaluate`.
    pieces, first, steps, step_first, line
        `changes.PackedChanges`; None for no pieces, and for no steps.
    noted
        The nodes of the only direction that has steps, or an array without nodes, (4, 0).
    points, widths, places, rule_nodes, rule_weights
        Places and widths of all steps, where each direction's begin, and the nodes' rule, as in
        `evaluation.evaluate_told`.
    """
    degree = force.shape[1] + motions.shape[1] - 2
    # not a literal, for which the nodes would be compiled once more
    moving = degree < 0
    for g in range(motions.shape[0]):
        c = motions[g]
        if pieces is not None and first[g + 1] > first[g]:
            change_of_pieces(c, pieces[first[g] : first[g + 1]], grid[0], grid[1], force[g], stiffness[g])
        if steps is not None and step_first[g + 1] > step_first[g]:
            low, high = places[g], places[g + 1]
            if noted.shape[1] > 0:
                sampled = noted
            else:
                sampled = sharp_nodes(
                    c, points[low:high], widths[low:high], degree, moving, grid[0], grid[1], rule_nodes, rule_weights
                )
            change_of_steps(sampled, steps[step_first[g] : step_first[g + 1]], line[g], force[g], stiffness[g])
