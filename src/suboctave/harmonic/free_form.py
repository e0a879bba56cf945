"""The complex operator J_kappa and the gradient of `left^H J_kappa right`, compiled, for a structure's own matrices.

In the basis of waves `exp(i (k w0 + kappa) t)`, k = -H .. H, with directions d and laws that depend on displacements
alone,

    J[k, m] = (K - Omega_k^2 M + i Omega_k C) delta_km + sum d f_u,(k - m) d^T,    Omega_k = k w0 + kappa,

and along a direction `d (left^H J right) / dX_k = 1/(2 pi) int f_uu conj(L) R phi_k dtau`, phi_k = 1, cos k tau,
sin k tau. The real kinds of operator are in `real_form`, the general case in `perturbation`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suboctave.compiled import at_hand, kernel, ready
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.closed_bends import bends_of_corners, bends_of_polynomial, bends_of_smooth_steps
from suboctave.harmonic.kernels import polynomial as at_points
from suboctave.harmonic.kernels import spectra
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.real_form import closed_laws, closed_parts
from suboctave.harmonic.sharp_nodes import sharp_nodes

if TYPE_CHECKING:
    from suboctave.harmonic.state import BalanceState


@kernel()
def _free_operator(out, stiffness, damping, moving, frequency, starts, dofs, shape, matrices):
    """Add J_kappa to zeros (F n, F n); stiffness, damping: spectra along directions (G, top + 1); frequency (F,)."""
    count, n = frequency.shape[0], matrices.shape[1]
    for g in range(stiffness.shape[0]):
        for k in range(count):
            for m in range(count):
                lag = abs(k - m)
                re, im = stiffness[g, lag].real, stiffness[g, lag].imag
                sign = 1.0 if k >= m else -1.0
                im *= sign
                if moving[g]:
                    re -= frequency[m] * sign * damping[g, lag].imag
                    im += frequency[m] * damping[g, lag].real
                for s in range(starts[g], starts[g + 1]):
                    for t in range(starts[g], starts[g + 1]):
                        v = shape[s] * shape[t]
                        out[k * n + dofs[s], m * n + dofs[t]] += complex(v * re, v * im)
    for k in range(count):
        om = frequency[k]
        for i in range(n):
            for j in range(n):
                p, q = matrices[2, i, j] - om * om * matrices[0, i, j], om * matrices[1, i, j]
                out[k * n + i, k * n + j] += complex(p, q)


@kernel()
def _add_free_group(left, right, dofs, shape, zr, zi, uu, gx):
    """Add the gradient of one direction's force, given as weights `uu` at the points z, to `gx` (2 H + 1, n)."""
    high, count, n = gx.shape[0] // 2, left.shape[0], zr.shape[0]
    waves = np.zeros((2, count), dtype=np.complex128)
    for s in range(dofs.shape[0]):
        for k in range(count):
            waves[0, k] += shape[s] * left[k, dofs[s]]
            waves[1, k] += shape[s] * right[k, dofs[s]]
    # the common factor exp(i f_0 tau) of all waves cancels in conj(left) * right
    values = at_points(waves, zr, zi)
    product = np.empty((2, n))
    for j in range(n):
        a, b, c, d = values[0, j].real, values[0, j].imag, values[1, j].real, values[1, j].imag
        product[0, j] = (a * c + b * d) * uu[j]
        product[1, j] = (a * d - b * c) * uu[j]
    found = spectra(product, zr, zi, high)
    for s in range(dofs.shape[0]):
        gx[0, dofs[s]] += shape[s] * complex(found[0, 0].real, found[1, 0].real)
        for k in range(1, high + 1):
            gx[2 * k - 1, dofs[s]] += shape[s] * complex(found[0, k].real, found[1, k].real)
            gx[2 * k, dofs[s]] -= shape[s] * complex(found[0, k].imag, found[1, k].imag)


@kernel()
def _free_gradient(
    left, right, frequency, by_omega, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points,
    widths, steps, step_first, line, rule_nodes, rule_weights, top, matrices, gx,
):  # fmt: skip
    """As `real_form.closed_gradient` for waves left, right (F, n) at the frequencies, whose derivatives by omega are
    `by_omega`; returns the derivatives by omega and kappa.
    """
    degree = top + motions.shape[1] - 1
    # not a literal, for which the nodes would be compiled once more
    moving = degree < 0
    for g in range(motions.shape[0]):
        c, at, along = motions[g], dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
        if pieces is not None and first[g + 1] > first[g]:
            bends = bends_of_corners(c, pieces[first[g] : first[g + 1]], grid[0], grid[1])
            _add_free_group(left, right, at, along, bends[0], bends[1], bends[2], gx)
        if polynomial.shape[1] > 2:
            weights = bends_of_polynomial(c, polynomial[g], nodes[0], nodes[1])
            _add_free_group(left, right, at, along, nodes[0], nodes[1], weights[0], gx)
        if points is not None and step_first[g + 1] > step_first[g]:
            low, high = step_first[g], step_first[g + 1]
            sampled = sharp_nodes(
                c, points[low:high], widths[low:high], degree, moving, grid[0], grid[1], rule_nodes, rule_weights
            )
            weights = bends_of_smooth_steps(sampled, steps[low:high])
            _add_free_group(left, right, at, along, sampled[0], sampled[1], weights[0], gx)
    slope_re = slope_im = rate_re = rate_im = 0.0
    n = matrices.shape[1]
    for k in range(frequency.shape[0]):
        re = im = 0.0
        for i in range(n):
            for j in range(n):
                p, q = -2.0 * frequency[k] * matrices[0, i, j], matrices[1, i, j]
                a, b, c, d = left[k, i].real, left[k, i].imag, right[k, j].real, right[k, j].imag
                x, y = a * c + b * d, a * d - b * c
                re += p * x - q * y
                im += p * y + q * x
        slope_re += re
        slope_im += im
        rate_re += by_omega[k] * re
        rate_im += by_omega[k] * im
    return complex(rate_re, rate_im), complex(slope_re, slope_im)


def free_operator(state: BalanceState, frequency: Array) -> ComplexArray | None:
    """J_kappa at the frequencies of its waves (F,); None for a condensed model, or elements with nodes of their own."""
    balance, linear = state.balance, state.linear
    if balance.own or not isinstance(linear, StructuralMatrices):
        return None
    n = len(frequency) * balance.size
    out, table = np.zeros((n, n), dtype=complex), state.spectra_table
    _free_operator(out, table[1], table[2], balance.moving, frequency, *balance.directions, linear.matrices)
    return out


def free_gradient(
    state: BalanceState, left: ComplexArray, right: ComplexArray, frequency: Array, by_omega: Array
) -> tuple[ComplexArray, complex, complex] | None:
    """Derivative of `left^H J_kappa right` by the coefficients (2 H + 1, size), by omega and by kappa, for laws in
    closed form; None for others. left, right: waves (F, size).
    """
    balance, linear = state.balance, state.linear
    if balance.own or balance.any_moving or not isinstance(linear, StructuralMatrices):
        return None
    packed, nodes = state.packed
    called = closed_parts(packed)
    if called is None:
        return None
    gx = np.zeros((state.basis.size, balance.size), dtype=complex)
    laws, steps = closed_laws(balance, packed, nodes)
    waves = (np.ascontiguousarray(left), np.ascontiguousarray(right), frequency, by_omega, state.motions)
    given = (*waves, *laws, *steps, balance.top, linear.matrices, gx)
    # what it calls is compiled one by one, not all at one go
    if not (at_hand(_free_gradient, *given) or all(map(ready, called))):
        return None
    rate, slope = _free_gradient(*given)
    return gx, rate, slope


__all__ = ["free_gradient", "free_operator"]
