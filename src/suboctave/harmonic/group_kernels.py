"""Compiled evaluation of harmonic balance: forces along one direction, the residual, the Jacobian. Arrays in and out.

One call does what belongs together, so that a small system costs what its arithmetic costs. The pieces are in
`kernels` and `instants`; the formulae in `local_force`, `state` and `kernels.galerkin`.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import QUICK, kernel
from suboctave.harmonic.arctangent import add_step
from suboctave.harmonic.instants import crossings_of
from suboctave.harmonic.kernels import _FAST, contact_spectrum, displacement, motion, product_spectrum


@kernel()
def add_pieces(c, pieces, grid_r, grid_i, force, stiffness):
    """Add the Fourier coefficients of piecewise-linear laws to force and stiffness (top + 1,), in place.

    Parameters
    ----------
    c
        Complex coefficients of the relative displacement (H + 1,).
    pieces
        Stiffness, gap and side of every piece, (P, 3).
    grid_r, grid_i
        Equidistant points on the circle for the search for crossings.
    """
    top = force.shape[0] - 1
    high = c.shape[0] - 1
    values = motion(c, grid_r, grid_i)
    slope = np.zeros(top + high + 1, dtype=np.complex128)
    touching = False
    for p in range(pieces.shape[0]):
        k, gap, side = pieces[p, 0], pieces[p, 1], pieces[p, 2]
        found, above = crossings_of(c, gap, values)
        if found.shape[0] == 0 and above != (side > 0):
            continue
        touching = True
        chi = contact_spectrum(found, above, side, top + high)
        for q in range(top + high + 1):
            slope[q] += k * chi[q]
        for q in range(top + 1):
            force[q] -= k * gap * chi[q]
    if touching:
        product = product_spectrum(c, 0.0, slope, top)
        for q in range(top + 1):
            force[q] += product[q]
            stiffness[q] += slope[q]


@kernel()
def add_polynomial(c, polynomial, zr, zi, force, stiffness):
    """Add the Fourier coefficients of `sum_p polynomial_p u^p` to force and stiffness (top + 1,), in place.

    z: equidistant points on the circle, enough for the tangent.
    """
    n = zr.shape[0]
    u, f, slope, weights = np.empty(n), np.zeros(n), np.zeros(n), np.full(n, 2.0 * math.pi / n)
    displacement(c, zr, zi, u)
    for p in range(polynomial.shape[0] - 1, -1, -1):
        for j in range(n):
            slope[j] = slope[j] * u[j] + f[j]
            f[j] = f[j] * u[j] + polynomial[p]
    add_pair(f, slope, weights, zr, zi, force, stiffness)


@kernel(patience=QUICK, fastmath=_FAST)
def add_pair(f, f_u, weights, zr, zi, force, stiffness):
    """Add `1/(2 pi) sum_j weights_j g_j z_j^-q`, q = 0 .. top, of the sampled f and f_u to the spectra of force and
    stiffness, in place.
    """
    n = zr.shape[0]
    scale = 1.0 / (2.0 * math.pi)
    pr, pi = np.empty(n), np.empty(n)
    for j in range(n):
        pr[j] = weights[j] * scale
        pi[j] = 0.0
    # two harmonics at a time: the arrays are read once for both
    for q in range(0, force.shape[0], 2):
        fr, fi, sr, si = 0.0, 0.0, 0.0, 0.0
        gr, gi, tr, ti = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            a, b, c, d = pr[j], pi[j], zr[j], zi[j]
            fr += f[j] * a
            fi += f[j] * b
            sr += f_u[j] * a
            si += f_u[j] * b
            e = a * c - b * d
            b = a * d + b * c
            gr += f[j] * e
            gi += f[j] * b
            tr += f_u[j] * e
            ti += f_u[j] * b
            pr[j] = e * c - b * d
            pi[j] = e * d + b * c
        force[q] += complex(fr, -fi)
        stiffness[q] += complex(sr, -si)
        if q + 1 < force.shape[0]:
            force[q + 1] += complex(gr, -gi)
            stiffness[q + 1] += complex(tr, -ti)


@kernel(fastmath=_FAST)
def add_projected(f, f_u, f_v, weights, zr, zi, force, stiffness, damping):
    """Add `1/(2 pi) sum_j weights_j g_j z_j^-q`, q = 0 .. top, of the sampled f, f_u and f_v (empty if there is none)
    to the spectra of force, stiffness and damping, in place.
    """
    n = zr.shape[0]
    moving = f_v.shape[0] > 0
    scale = 1.0 / (2.0 * math.pi)
    pr = weights * scale
    pi = np.zeros(n)
    for q in range(force.shape[0]):
        fr, fi, sr, si = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            fr += f[j] * pr[j]
            fi += f[j] * pi[j]
            sr += f_u[j] * pr[j]
            si += f_u[j] * pi[j]
        force[q] += complex(fr, -fi)
        stiffness[q] += complex(sr, -si)
        if moving:
            fr, fi = 0.0, 0.0
            for j in range(n):
                fr += f_v[j] * pr[j]
                fi += f_v[j] * pi[j]
            damping[q] += complex(fr, -fi)
        for j in range(n):
            t = pr[j] * zr[j] - pi[j] * zi[j]
            pi[j] = pr[j] * zi[j] + pi[j] * zr[j]
            pr[j] = t


@kernel(patience=QUICK, fastmath=_FAST)
def add_smooth_steps(sampled, steps, line, force, stiffness):
    """Add the Fourier coefficients of arctan steps of the stiffness (`model.sampling.SharpSampling`), in place.

    sampled: what `sharp_nodes` gives, (4, N); steps: point, width, step, (S, 3); line: constant and slope.
    """
    n = sampled.shape[1]
    zr, zi, weights, u = sampled[0], sampled[1], sampled[2], sampled[3]
    f = np.empty(n)
    f_u = np.empty(n)
    for j in range(n):
        f[j] = line[0] + line[1] * u[j]
        f_u[j] = line[1]
    for s in range(steps.shape[0]):
        add_step(u, steps[s, 0], steps[s, 1], steps[s, 2] / math.pi, f, f_u)
    add_pair(f, f_u, weights, zr, zi, force, stiffness)


@kernel()
def add_along(spectrum, dofs, shape, out):
    """Add a force along a direction, given by its Fourier coefficients 0 .. H and more, to coefficients (2 H + 1, n).

    dofs, shape: where the direction is not zero, and its entries there.
    """
    for s in range(dofs.shape[0]):
        d = dofs[s]
        out[0, d] += shape[s] * spectrum[0].real
        for k in range(1, out.shape[0] // 2 + 1):
            out[2 * k - 1, d] += 2.0 * shape[s] * spectrum[k].real
            out[2 * k, d] -= 2.0 * shape[s] * spectrum[k].imag


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
    for h in range(blocks.shape[0]):
        for i in range(n):
            re = 0.0
            im = 0.0
            for j in range(n):
                p = blocks[h, i, j].real
                q = blocks[h, i, j].imag
                # amplitude a - i b of a cos + b sin
                a = x[0, j] if h == 0 else x[2 * h - 1, j]
                b = 0.0 if h == 0 else -x[2 * h, j]
                re += p * a - q * b
                im += p * b + q * a
            if h == 0:
                linear[0, i] = re
            else:
                linear[2 * h - 1, i] = re
                linear[2 * h, i] = -im
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
def apply_blocks(blocks, x):
    """Complex matrices per harmonic (H + 1, n, n) applied to real coefficients (2 H + 1, n)."""
    rows, n = x.shape
    out = np.empty((rows, n))
    for h in range(blocks.shape[0]):
        for i in range(n):
            re = 0.0
            im = 0.0
            for j in range(n):
                p = blocks[h, i, j].real
                q = blocks[h, i, j].imag
                a = x[0, j] if h == 0 else x[2 * h - 1, j]
                b = 0.0 if h == 0 else -x[2 * h, j]
                re += p * a - q * b
                im += p * b + q * a
            if h == 0:
                out[0, i] = re
            else:
                out[2 * h - 1, i] = re
                out[2 * h, i] = -im
    return out


@kernel(patience=QUICK)
def tangent_matrix(out, stiffness, damping, moving, rate, mean, starts, dofs, shape, n):
    """Add the Galerkin matrices `T(f_x) + T(f_v) d/dt` of all directions to `out`, in the integer (mean) or half-odd
    basis.

    stiffness, damping (G, top + 1); moving (G,): whether a direction has damping; directions as in
    `balance_residual`. The formula is that of `kernels.galerkin`.
    """
    count = stiffness.shape[1] // 2
    first = 0 if mean else 1
    # the mean has a cosine only: what follows it lies one place further to the left
    shift = 1 - first
    high = stiffness.shape[1] - 1
    spectra = np.empty((4, 2 * high + 1))
    lines = np.empty((2, count, 2))
    for g in range(stiffness.shape[0]):
        # of all orders -high .. high, and seen through views: no index has to be asked for its sign
        for q in range(high + 1):
            spectra[0, high + q] = spectra[0, high - q] = stiffness[g, q].real
            spectra[1, high + q], spectra[1, high - q] = stiffness[g, q].imag, -stiffness[g, q].imag
            spectra[2, high + q] = spectra[2, high - q] = damping[g, q].real
            spectra[3, high + q], spectra[3, high - q] = damping[g, q].imag, -damping[g, q].imag
        for i in range(count):
            # the orders j - i and i + j
            low, top = spectra[:, high - i :], spectra[:, high + i + first :]
            for j in range(count):
                gr, gi = low[0, j], -low[1, j]
                pr, pi = top[0, j], top[1, j]
                a = gr + pr
                b = gi - pi
                e = -gi - pi
                d = gr - pr
                if moving[g]:
                    w = (j + 0.5 * first) * rate
                    gr, gi = low[2, j], -low[3, j]
                    pr, pi = top[2, j], top[3, j]
                    a -= w * (gi - pi)
                    b += w * (gr + pr)
                    e -= w * (gr - pr)
                    d += w * (-gi - pi)
                lines[0, j, 0], lines[0, j, 1] = a, b
                lines[1, j, 0], lines[1, j, 1] = e, d
            # the row of the mean holds halves, and has no sine beside it
            rows, half = (1, 0.5) if mean and i == 0 else (2, 1.0)
            row = max(0, 2 * i - shift)
            for s in range(starts[g], starts[g + 1]):
                for t in range(starts[g], starts[g + 1]):
                    v = half * shape[s] * shape[t]
                    for part in range(rows):
                        target, line = out[(row + part) * n + dofs[s], dofs[t] :], lines[part]
                        if mean:
                            target[0] += v * line[0, 0]
                        for j in range(shift, count):
                            target[(2 * j - shift) * n] += v * line[j, 0]
                            target[(2 * j - shift + 1) * n] += v * line[j, 1]


@kernel()
def dynamic_stiffness(mass, damping, stiffness, frequency, order):
    """`K - Omega^2 M + i Omega C` at the frequencies, or its first or second derivative by Omega; (F, n, n)."""
    n = mass.shape[0]
    out = np.empty((frequency.shape[0], n, n), dtype=np.complex128)
    for f in range(frequency.shape[0]):
        om = frequency[f]
        for i in range(n):
            for j in range(n):
                if order == 0:
                    out[f, i, j] = complex(stiffness[i, j] - om * om * mass[i, j], om * damping[i, j])
                elif order == 1:
                    out[f, i, j] = complex(-2.0 * om * mass[i, j], damping[i, j])
                else:
                    out[f, i, j] = complex(-2.0 * mass[i, j], 0.0)
    return out


@kernel()
def tails(x, neglected, weight, out):
    """Size of all harmonics above k relative to the motion, into `out` for k = 0 .. 2 H + 1; returns the motion's size.

    x (2 H + 1, n) are kept, `neglected` (H + 1, n) complex those from H + 1 on; sizes are weighted per DOF.
    """
    rows, n = x.shape
    high = rows // 2
    squares = np.zeros(2 * high + 2)
    for i in range(n):
        w = weight[i] * weight[i]
        squares[0] += w * x[0, i] * x[0, i]
        for h in range(1, high + 1):
            a, b = x[2 * h - 1, i], x[2 * h, i]
            squares[h] += w * (a * a + b * b)
        for h in range(high + 1):
            a, b = neglected[h, i].real, neglected[h, i].imag
            squares[high + 1 + h] += w * (a * a + b * b)
    size = 0.0
    for h in range(high + 1):
        size += squares[h]
    size = math.sqrt(size)
    out[2 * high + 1] = total = 0.0
    for h in range(2 * high, -1, -1):
        total += squares[h + 1]
        out[h] = math.sqrt(total) / size if size > 0.0 else 0.0
    return size


@kernel()
def apply_scaled(blocks, scale, x):
    """`apply_blocks` with every harmonic's block multiplied by a number."""
    out = apply_blocks(blocks, x)
    for h in range(1, blocks.shape[0]):
        for i in range(x.shape[1]):
            out[2 * h - 1, i] *= scale[h]
            out[2 * h, i] *= scale[h]
    for i in range(x.shape[1]):
        out[0, i] *= scale[0]
    return out
