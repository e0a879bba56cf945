"""Forces along directions and linear blocks, summed into the equations and the operators of a whole motion."""

from __future__ import annotations

import math

from suboctave.compiled import kernel
from suboctave.harmonic.galerkin import add_galerkin
from suboctave.harmonic.linear_part import add_linear, multiply_blocks

__all__ = ["add_operator", "along_directions", "balance_residual"]


@kernel()
def balance_residual(x, blocks, force, load, starts, dofs, shape, weight, parts, sizes):
    """A X, F and `R = A X + F - P` into `parts` (3, 2 H + 1, n), and |R|, |A X|, |F|, |P| into `sizes` (4,).

    blocks (H + 1, n, n) hold A, `force` (G, top + 1) the Fourier coefficients along G directions, whose non-zero
    entries are `shape[starts[g] : starts[g + 1]]` at `dofs`. Sizes are weighted by `weight` per DOF.
    """
    rows, n = x.shape
    linear, forces, residual = parts[0], parts[1], parts[2]
    for r in range(rows):
        for i in range(n):
            forces[r, i] = 0.0
    multiply_blocks(blocks, x, linear)
    for g in range(force.shape[0]):
        for s in range(starts[g], starts[g + 1]):
            i, d = dofs[s], shape[s]
            forces[0, i] += d * force[g, 0].real
            for h in range(1, blocks.shape[0]):
                forces[2 * h - 1, i] += 2.0 * d * force[g, h].real
                forces[2 * h, i] -= 2.0 * d * force[g, h].imag
    for k in range(4):
        sizes[k] = 0.0
    for r in range(rows):
        for i in range(n):
            residual[r, i] = linear[r, i] + forces[r, i] - load[r, i]
            w = weight[i] * weight[i]
            sizes[0] += w * residual[r, i] * residual[r, i]
            sizes[1] += w * linear[r, i] * linear[r, i]
            sizes[2] += w * forces[r, i] * forces[r, i]
            sizes[3] += w * load[r, i] * load[r, i]
    for k in range(4):
        sizes[k] = math.sqrt(sizes[k])


@kernel()
def add_operator(out, spectra, groups, moving, rate, mean, starts, dofs, shape, blocks):
    """Add the Galerkin matrix of the tangents along the first `groups` directions and linear blocks to a real matrix of
    the integer (mean) or the half-odd basis.

    spectra (3, C, top + 1): of force, stiffness, damping; moving: whether any has damping; rate: base frequency;
    starts, dofs, shape: directions, as in `balance_residual`; blocks: (H + 1, n, n), or (0, n, n).
    """
    n = blocks.shape[1]
    count = (out.shape[0] // n + 1) // 2
    for g in range(groups):
        at, entries = dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
        damping = spectra[2, g] if moving else spectra[2, g, :0]
        add_galerkin(out, spectra[1, g], damping, rate, mean, count, at, entries, at, entries, n)
    add_linear(out, blocks, mean)


@kernel()
def along_directions(x, starts, dofs, shape, motions):
    """Complex coefficients of the displacement along every direction, into `motions` (G, H + 1)."""
    for g in range(motions.shape[0]):
        for h in range(motions.shape[1]):
            re = 0.0
            im = 0.0
            for s in range(starts[g], starts[g + 1]):
                if h == 0:
                    re += shape[s] * x[0, dofs[s]]
                else:
                    re += shape[s] * x[2 * h - 1, dofs[s]]
                    im -= shape[s] * x[2 * h, dofs[s]]
            motions[g, h] = complex(re, im)
