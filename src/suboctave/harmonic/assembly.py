"""What laws along directions and the linear part make of a whole motion: its residual, and operators on changes of it.

Between the functions of the integer basis (the mean, cosines and sines of tau, 2 tau, ..) or of the half-odd one (of
tau / 2, 3 tau / 2, ..) the Galerkin matrix T(g) of the product with a periodic g depends on the Fourier coefficients of
g at sums and differences of frequencies only.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.aft.closed_form import add_laws
from suboctave.harmonic.basis import Array, ComplexArray

__all__ = [
    "Sparse",
    "add_displacements",
    "add_operator",
    "apply_blocks",
    "balance_residual",
    "block_diagonal",
    "evaluated",
    "galerkin",
    "sizes_of",
    "sparse",
    "toeplitz",
]

#: directions by what is not zero of them: where each begins, its DOFs, its entries there
Sparse = tuple[np.ndarray, np.ndarray, Array]


def sparse(directions: Array) -> Sparse:
    """Directions (G, n) by their entries that are not zero."""
    owner, dofs = map(np.ascontiguousarray, np.nonzero(directions))
    return np.searchsorted(owner, np.arange(len(directions) + 1)), dofs, directions[owner, dofs]


_ALONE = sparse(np.ones((1, 1)))
_NO_BLOCKS, _NOWHERE = np.zeros((0, 1, 1), dtype=complex), np.zeros((0, 1))


def galerkin(stiffness: ComplexArray, damping: ComplexArray | None, rate: float, mean: bool, count: int) -> Array:
    """`T(f_u) + T(f_v) d/dt` between all functions of `count` harmonics of the integer (mean) or half-odd basis."""
    spectra = np.zeros((3, 1, len(stiffness)), dtype=complex)
    spectra[1, 0] = stiffness
    if damping is not None:
        spectra[2, 0] = damping
    size = 2 * count - (1 if mean else 0)
    out = np.zeros((size, size))
    add_operator(out, spectra, 1, damping is not None, rate, mean, _ALONE, _ALONE, _NO_BLOCKS, _NO_BLOCKS, _NOWHERE)
    return out


def toeplitz(spectrum: ComplexArray, harmonics: int) -> Array:
    """T(g) in the integer basis 0 .. H."""
    return galerkin(spectrum, None, 0.0, True, harmonics + 1)


def block_diagonal(blocks: ComplexArray, mean: bool) -> Array:
    """A linear operator given by its blocks, one a harmonic, in the integer (mean) or the half-odd basis."""
    rows = blocks.shape[1] * (2 * len(blocks) - (1 if mean else 0))
    out = np.zeros((rows, rows))
    spectra = np.zeros((3, 0, 1), dtype=complex)
    add_operator(out, spectra, 0, False, 0.0, mean, _ALONE, _ALONE, blocks, _NO_BLOCKS, _NOWHERE)
    return out


@kernel()
def add_displacements(x, directions, out):
    """Add the complex coefficients of the displacements along directions (`sparse`), x (2 H + 1, n), to (G, H + 1)."""
    starts, dofs, entries = directions
    for g in range(out.shape[0]):
        for s in range(starts[g], starts[g + 1]):
            i, d = dofs[s], entries[s]
            out[g, 0] += d * x[0, i]
            for h in range(1, out.shape[1]):
                out[g, h] += complex(d * x[2 * h - 1, i], -d * x[2 * h, i])


@kernel()
def sizes_of(x, beyond, weight):
    """Squares of the sizes of the harmonics in x (2 H + 1, n) and of those beyond these, complex amplitudes (K, n),
    with weights (n,); the size of all above the k-th relative to those in x; the size of these.
    """
    inside = (x.shape[0] + 1) // 2
    squares = np.zeros(inside + beyond.shape[0])
    for i in range(x.shape[1]):
        w = weight[i] * weight[i]
        for r in range(x.shape[0]):
            squares[(r + 1) // 2] += w * x[r, i] * x[r, i]
        for k in range(beyond.shape[0]):
            squares[inside + k] += w * (beyond[k, i].real ** 2 + beyond[k, i].imag ** 2)
    size, left, tails = 0.0, 0.0, np.zeros(squares.shape[0])
    for k in range(inside):
        size += squares[k]
    size = math.sqrt(size)
    for k in range(squares.shape[0] - 1, 0, -1):
        left += squares[k]
        if size > 0.0:
            tails[k - 1] = math.sqrt(left) / size
    return squares, tails, size


@kernel()
def apply_blocks(blocks, x):
    """Complex matrices per harmonic (H + 1, n, n) applied to real coefficients (2 H + 1, n)."""
    out = np.zeros(x.shape)
    for h in range(blocks.shape[0]):
        # amplitude a - i b of a cos + b sin
        cosine = max(0, 2 * h - 1)
        for i in range(x.shape[1]):
            for j in range(x.shape[1]):
                p = blocks[h, i, j].real
                out[cosine, i] += p * x[cosine, j]
                if h > 0:
                    q = blocks[h, i, j].imag
                    out[cosine, i] += q * x[cosine + 1, j]
                    out[cosine + 1, i] += p * x[cosine + 1, j] - q * x[cosine, j]
    return out


@kernel()
def balance_residual(x, blocks, force, load, directions, weight):
    """F and `R = A X + F - P`, (2 H + 1, n) each, |R| and `|A X| + |F| + |P|`.

    blocks (H + 1, n, n) hold A, `force` (G, top + 1) the Fourier coefficients along G directions (`sparse`). Sizes are
    weighted by `weight` per DOF.
    """
    rows, n = x.shape
    linear, forces, residual = apply_blocks(blocks, x), np.zeros(x.shape), np.empty(x.shape)
    starts, dofs, entries = directions
    for g in range(force.shape[0]):
        for s in range(starts[g], starts[g + 1]):
            i, d = dofs[s], entries[s]
            forces[0, i] += d * force[g, 0].real
            for h in range(1, blocks.shape[0]):
                forces[2 * h - 1, i] += 2.0 * d * force[g, h].real
                forces[2 * h, i] -= 2.0 * d * force[g, h].imag
    missing = linears = whole = loads = 0.0
    for r in range(rows):
        for i in range(n):
            residual[r, i] = linear[r, i] + forces[r, i] - load[r, i]
            w = weight[i] * weight[i]
            missing += w * residual[r, i] * residual[r, i]
            linears += w * linear[r, i] * linear[r, i]
            whole += w * forces[r, i] * forces[r, i]
            loads += w * load[r, i] * load[r, i]
    return forces, residual, math.sqrt(missing), math.sqrt(linears) + math.sqrt(whole) + math.sqrt(loads)


@kernel()
def evaluated(x, blocks, load, directions, weight, laws, top):
    """A motion at once where all laws are known in closed form (`ClosedLaws`): displacements along the directions, (G,
    H + 1), spectra (3, G, top + 1), what `balance_residual` gives, and whether forces and slopes are finite.
    """
    groups = directions[0].shape[0] - 1
    motions = np.zeros((groups, blocks.shape[0]), dtype=np.complex128)
    table = np.zeros((3, groups, top + 1), dtype=np.complex128)
    add_displacements(x, directions, motions)
    add_laws(motions, laws, table)
    force, residual, size, scale = balance_residual(x, blocks, table[0], load, directions, weight)
    whole = 0.0
    # a number that is not finite at any instant is in all coefficients
    for part in range(2):
        for g in range(groups):
            whole += abs(table[part, g, 0])
    return motions, table, force, residual, size, scale, math.isfinite(whole)


@kernel()
def add_operator(out, spectra, groups, moving, rate, mean, outgoing, incoming, blocks, slope, x):
    """Add `A + sum_g out_g [T(f_u) + T(f_v) d/dt] in_g^T`, g the first `groups` channels, in the integer (mean) or the
    half-odd basis to a real matrix.

    spectra (3, C, top + 1): of force, stiffness, damping; moving: whether any has damping; rate: base frequency;
    outgoing, incoming: directions (`sparse`); blocks: A, one per harmonic, (H + 1, n, n), or none, (0, n, n); slope: A
    differentiated by a parameter, likewise: what it makes of coefficients x (2 H + 1, n) is added to the last column.
    """
    n = blocks.shape[1]
    count = (out.shape[0] // n + 1) // 2
    first = 0 if mean else 1
    # the mean has a cosine only: what follows it lies one place further to the left
    shift = 1 - first
    # a complex amplitude `a - i b` stands for `a cos + b sin`: the block of a matrix `P + i Q` is [[P, Q], [-Q, P]]
    for h in range(blocks.shape[0]):
        at = max(0, 2 * h - shift) * n
        for i in range(n):
            for j in range(n):
                p = blocks[h, i, j].real
                q = blocks[h, i, j].imag
                out[at + i, at + j] += p
                if not (mean and h == 0):
                    out[at + n + i, at + n + j] += p
                    out[at + i, at + n + j] += q
                    out[at + n + i, at + j] -= q
    if slope.shape[0] > 0:
        along = apply_blocks(slope, x)
        for r in range(along.shape[0]):
            for i in range(n):
                out[r * n + i, out.shape[1] - 1] += along[r, i]
    high = spectra.shape[2] - 1
    both, lines = np.empty((4, 2 * high + 1)), np.empty((2, count, 2))
    for g in range(groups):
        stiffness, damping = spectra[1, g], spectra[2, g]
        # of all orders -high .. high, and seen through views: no index has to be asked for its sign
        for q in range(high + 1):
            both[0, high + q] = both[0, high - q] = stiffness[q].real
            both[1, high + q], both[1, high - q] = stiffness[q].imag, -stiffness[q].imag
            if moving:
                both[2, high + q] = both[2, high - q] = damping[q].real
                both[3, high + q], both[3, high - q] = damping[q].imag, -damping[q].imag
        for i in range(count):
            # the orders j - i and i + j
            low, top = both[:, high - i :], both[:, high + i + first :]
            for j in range(count):
                gr, gi = low[0, j], -low[1, j]
                pr, pi = top[0, j], top[1, j]
                a = gr + pr
                b = gi - pi
                e = -gi - pi
                d = gr - pr
                if moving:
                    # d/dt turns cos into -w sin and sin into w cos
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
            parts, half = (1, 0.5) if mean and i == 0 else (2, 1.0)
            row = max(0, 2 * i - shift)
            for s in range(outgoing[0][g], outgoing[0][g + 1]):
                for t in range(incoming[0][g], incoming[0][g + 1]):
                    v = half * outgoing[2][s] * incoming[2][t]
                    for part in range(parts):
                        target, line = out[(row + part) * n + outgoing[1][s], incoming[1][t] :], lines[part]
                        if mean:
                            target[0] += v * line[0, 0]
                        for j in range(shift, count):
                            target[(2 * j - shift) * n] += v * line[j, 0]
                            target[(2 * j - shift + 1) * n] += v * line[j, 1]
