"""The Koopman-Hill projection: the monodromy matrix from Hill's matrix without choosing among eigenvalues.

Let `y' = A(t) y` be the linearised motion (`variational`). Its solutions times waves, `z_k = exp(-i k w0 t) y`, solve

    z_k' = sum_l A_{k-l} z_l - i k w0 z_k,    z_k(0) = I,    Phi(T) = z_0(T) = C exp(H T) W,

H Hill's matrix, `W = [I; ..; I]`, C picking the central block; truncated to |k| <= N this is the projection of Bayer
& Leine (Nonlinear Dyn. 111 (2023) 8439-8466). The sub-harmonic form adds the waves k + 1/2, whose z return negated, and
takes `Phi(T) = sum_k z_k(T) + sum_k z_{k+1/2}(T)`, 2 N + 1 blocks Phi and 2 N blocks -Phi, whose truncation errors
cancel to twice the order for smooth forces (Bayer & Leine, arXiv:2503.21318, 2025). Here in the real basis (mean,
cosines, sines), four times cheaper, as in Bayer et al., Int. J. Non-Linear Mech. 167 (2024) 104894: W and C follow from
the series of a Dirac comb at t = 0, which is what all z_k = I amounts to.

Which coefficients of A are kept matters where contacts make them fall off like 1/q. Those beyond 0.6 N lead from the
ends of the truncated series, where z is wrong, straight to the central block; without them the error falls like N^-3
instead of N^-2. The sub-harmonic form does without that, up to N.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm

from suboctave.floquet.result import FloquetResult
from suboctave.floquet.variational import Variational, liouville, refined
from suboctave.harmonic.assembly import galerkin
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.interruption import check_time

#: size of Hill's matrix above which its exponential acts on the start by its Taylor series, never formed
_DENSE = 400
#: largest Hill matrix that is attempted
_LARGEST = 6000
#: perturbation harmonics, however few the motion has
_FEWEST = 15
#: share of what the motion's neglected harmonics do that is still missing when they are added to first order
_MOTION = 0.5
#: perturbation harmonics that are tried one after the other, in units of the motion's: direct, sub-harmonic
_LADDER = ((0.5, 1.0, 1.5, 2.0, 3.0), (0.5, 1.0, 1.5, 2.0))
#: move of a multiplier at which that ends
_ACCURACY = 1e-4
#: share of parts that cancel by which they are taken not to
_CANCELLED = 0.02


def transition(system: Variational, harmonics: int, subharmonic: bool) -> Array:
    """The monodromy matrix in (y, dy / d tau), DOFs weighted by the square roots of their masses; shape (2 n, 2 n)."""
    kept = harmonics if subharmonic else max(1, math.ceil(0.6 * harmonics))
    waves = _propagated(system, 2 * np.arange(harmonics + 1), kept)
    if not subharmonic:
        return waves[0]
    halves = _propagated(system, 2 * np.arange(harmonics) + 1, kept)
    # the sines of a Dirac comb vanish at its place: the mean and the cosines count
    return waves[0] + waves[1::2].sum(axis=0) + halves[::2].sum(axis=0)


def _propagated(system: Variational, doubled: np.ndarray, kept: int) -> Array:
    """Series of the propagated Dirac comb after one period, shape (basis, 2 n, 2 n).

    `doubled`: twice the frequencies of the basis, even or odd, in units of the base frequency.
    """
    n, mean = system.n, bool(doubled[0] == 0)
    size = 2 * len(doubled) - mean
    cosine = np.arange(1 if mean else 0, size, 2)
    frequency = 0.5 * doubled[1 if mean else 0 :]
    start = np.zeros((size, 2 * n, 2 * n))
    start[cosine] = 2.0 * np.eye(2 * n)
    if mean:
        start[0] = np.eye(2 * n)
    stiffness, damping = system.stiffness / system.rate**2, system.damping / system.rate
    parts = []
    for left, right, k, c in zip(system.left, system.right, system.k, system.c, strict=True):
        parts.append((left, np.concatenate((right, 0.0 * right)), _projected(k / system.rate**2, doubled, kept)))
        if c.any():
            parts.append((left, np.concatenate((0.0 * right, right)), _projected(c / system.rate, doubled, kept)))
    block = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    if size * 2 * n <= _DENSE:
        matrix = np.kron(np.eye(size), block)
        for left, right, projected in parts:
            matrix -= np.kron(projected, np.outer(np.concatenate((0.0 * left, left)), right))
        turning = np.zeros((size, size))
        turning[cosine, cosine + 1], turning[cosine + 1, cosine] = -frequency, frequency
        matrix += np.kron(turning, np.eye(2 * n))
        end = expm(2.0 * math.pi * matrix) @ start.reshape(-1, 2 * n)
        return np.asarray(end).reshape(start.shape)
    return _by_taylor(start, block, parts, cosine, frequency)


def _projected(spectrum: np.ndarray, doubled: np.ndarray, kept: int) -> Array:
    """Galerkin matrix of a real function's Fourier coefficients up to `kept`."""
    padded = np.zeros(int(doubled[-1]) + 1, dtype=complex)
    count = min(kept + 1, len(padded), len(spectrum))
    padded[:count] = spectrum[:count]
    mean = bool(doubled[0] == 0)
    return galerkin(padded, None, 0.0, mean, len(doubled))


def _by_taylor(
    start: Array, block: Array, parts: list[tuple[Array, Array, Array]], cosine: np.ndarray, frequency: Array
) -> Array:
    """`exp(2 pi H)` on `start` by Taylor series of short steps: H is known by its action only."""
    n, size, columns = block.shape[0] // 2, len(start), start.shape[2]
    turn = frequency[:, None]
    first = int(cosine[0])
    cosines, sines = slice(first, size, 2), slice(first + 1, size, 2)
    # with the states first all of them, and what the laws feel, are one product
    acting = np.vstack([block, *(right for _, right, _ in parts)])
    felt = np.array([projected for _, _, projected in parts]).reshape(-1, size, size)
    pushed = np.array([left for left, _, _ in parts]).reshape(-1, n).T

    def slope(z: Array) -> Array:
        both = (acting @ z.reshape(2 * n, -1)).reshape(-1, size, columns)
        out, inputs = both[: 2 * n], both[2 * n :]
        out[:, cosines] -= turn * z[:, sines]
        out[:, sines] += turn * z[:, cosines]
        out[n:] -= (pushed @ (felt @ inputs).reshape(len(felt), -1)).reshape(n, size, columns)
        return out

    # the time scale of H: its norm, were velocities measured in the highest frequency
    stiff = float(np.abs(block[n:, :n]).sum(axis=1).max())
    stiff += sum(float(np.abs(p).sum(axis=1).max() * np.abs(l).max() * np.abs(r[:n]).sum()) for l, r, p in parts)
    drag = float(np.abs(block[n:, n:]).sum(axis=1).max())
    rate = float(frequency[-1]) + math.sqrt(stiff) + drag
    steps = max(1, math.ceil(2.0 * math.pi * rate / 4.0))
    h = 2.0 * math.pi / steps
    z = np.ascontiguousarray(start.transpose(1, 0, 2))
    for _ in range(steps):
        check_time()
        term, order = z, 0
        total = z.copy()
        limit = 1e-17 * float(np.abs(z).max())
        while float(np.abs(term).max()) > limit and order < 60:
            order += 1
            term = slope(term) * (h / order)
            total += term
        z = total
    return z.transpose(1, 0, 2)


def koopman_hill_multipliers(state: BalanceState, subharmonic: bool) -> FloquetResult:
    """Multipliers by the Koopman-Hill projection on the motion with its neglected harmonics.

    The series of the perturbation is lengthened until that moves no multiplier by more than a ten-thousandth, or by
    more than what the motion neglects; the last move is the error estimate.
    """
    name = f"{'sub-harmonic' if subharmonic else 'direct'} Koopman-Hill"
    base, count = max(_FEWEST, state.basis.harmonics), 2 * state.linear.equation_of_motion()[0].shape[0]
    ladder = [math.ceil(share * base) for share in _LADDER[subharmonic]]
    rows = [count * (2 * harmonics + 1) for harmonics in ladder]
    if rows[1] > _LARGEST:
        note = f"A Hill matrix of {rows[1]} rows is larger than {_LARGEST}: use the monodromy matrix"
        return FloquetResult.inapplicable(count, name, note)
    motion, alternative = refined(state)
    best = Variational.of(motion, 2 * ladder[-1])
    phi = transition(best, ladder[0], subharmonic)
    of_motion = [_MOTION * (phi - transition(Variational.of(state, 2 * ladder[0]), ladder[0], subharmonic))]
    if alternative is not None:
        of_motion.append(phi - transition(Variational.of(alternative, 2 * ladder[0]), ladder[0], subharmonic))
    for harmonics, size in zip(ladder[1:], rows[1:], strict=True):
        if size > _LARGEST:
            break
        shorter, phi = phi, transition(best, harmonics, subharmonic)
        if not all(np.isfinite(matrix).all() for matrix in (phi, shorter, *of_motion)):
            return FloquetResult.inapplicable(count, name, "The exponential of Hill's matrix is not finite")
        mu, (series, neglected) = eigenvalues(phi, ([phi - shorter], of_motion))
        if np.all(series <= np.maximum(_ACCURACY * np.maximum(1.0, np.abs(mu)), neglected)):
            break
    errors, defect = liouville(mu, series + neglected, best.decay)
    return FloquetResult(mu, errors, name, checks={"harmonics": float(harmonics), "Liouville": defect})


def eigenvalues(phi: Array, changes: Sequence[Sequence[Array]]) -> tuple[ComplexArray, list[Array]]:
    """Eigenvalues by falling modulus, and how far each set of changes of the matrix, and rounding, moves each."""
    mu, vectors = np.linalg.eig(phi)
    order = np.argsort(-np.abs(mu), kind="stable")
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        left = np.full_like(vectors, np.nan)
    rounding = 1e-15 * ((np.abs(left) @ np.abs(phi)) * np.abs(vectors).T).sum(axis=1)
    moves = []
    for together in changes:
        moved, size = rounding + 1e-14, 1e-15 * float(np.linalg.norm(phi))
        for change in together:
            moved = moved + np.abs(((left @ change) * vectors.T).sum(axis=1))
            # what cancels in this sum need not cancel in the truth
            moved += _CANCELLED * ((np.abs(left) @ np.abs(change)) * np.abs(vectors).T).sum(axis=1)
            size += float(np.linalg.norm(change))
        # a double eigenvalue moves by the root of the change
        root = math.sqrt(size * max(1.0, float(np.abs(mu).max())))
        moves.append(np.minimum(np.nan_to_num(moved, nan=np.inf), root)[order])
    return mu.astype(complex)[order], moves
