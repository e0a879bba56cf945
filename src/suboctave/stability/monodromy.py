"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period on
panels that follow the laws (`panels`), by kernels for one (`single`) and for several DOFs (`several`).

A motion of H harmonics is not quite the true one: it leaves the force `r = sum d (f - P_H f)` unbalanced, P_H f the
part of the element forces within the basis. One step of Newton's method among periodic functions (Kantorovich),

    M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = -r,   y periodic,

whose propagator is at hand, gives what the motion lacks: harmonics beyond H without end, and the shift that they cause
in those within. The multipliers are those of the motion so corrected, with an error of second order. How far they are
from those of the motion as it stands, propagated with fewer digits, is their error estimate: it covers what is left
many times over, and it also covers how far other discretisations of the motion, such as Hill's determinant, may differ.

At a limit point there is no such step: a motion of the same frequency is far away, or there is none. What the step
moves along the direction of the multiplier near +1 is then left out, and belongs to the error: with the gap
`g = 1 - mu` and the shift D of the multiplier to first order, the motions near a fold leave `g^2 - 2 g D` for the
square of the gap, so that the shift is at most about `sqrt(2 g |D|)`.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.linalg import eigh, lapack

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.state import BalanceState, length
from suboctave.interruption import check_time
from suboctave.stability.closed import ClosedSingle
from suboctave.stability.linearisation import Linearisation
from suboctave.stability.magnus import BETWEEN, STEPS
from suboctave.stability.nodes import NODES
from suboctave.stability.result import FloquetResult
from suboctave.stability.several import POWERS, advance, propagate, respond
from suboctave.stability.single import corrected_single, standing_single

#: a correction larger than this share of the motion is cut down to it
_LARGEST = 0.1
#: least error where stiffness or damping varies: what the panels are made for
_PANELS = 1e-8
#: shift of a multiplier in units of its distance to +1 that leaves doubt whether the first order tells it
_DOUBTFUL = 0.1

__all__ = ["FloquetResult", "floquet_multipliers"]


def floquet_multipliers(state: BalanceState, corrected: bool = True) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods).

    corrected
        False: along the motion as it stands, as if it were exact; errors are then those of the propagation alone.
    """
    check_time()
    motion = _linearised(state, corrected)
    mu, shift, share = motion.multipliers(1.0)
    # there are few: numbers are quicker than arrays
    values = mu.tolist()
    largest = max(1.0, abs(values[0]))
    distance, nearest = math.inf, 0
    for i, value in enumerate(values):
        away = abs(1.0 - value)
        if away < distance:
            distance, nearest = away, i
    moved = float(shift[nearest]) / share if share > 0.0 else math.inf
    if moved > _DOUBTFUL * distance:
        mu, shift, share = _beside_fold(motion, moved, shift)
    # where the correction had to be cut, the motion is not near enough to a true one to say much
    cut = 1.0 / share - 1.0 if share > 0.0 else math.inf
    least = (_PANELS if motion.varying else 0.0) + cut
    return FloquetResult(mu, shift * (1.0 + cut) + least * largest)


def _linearised(state: BalanceState, corrected: bool) -> _Motion:
    if ClosedSingle.applies(state):
        return ClosedSingle(state, not corrected, _LARGEST)
    along = Linearisation(state)
    if not corrected:
        along.law[:, 0] = 0.0
    mass, damping, stiffness = state.linear.equation_of_motion()
    parts = (mass, damping, stiffness)
    return _Single(along, *parts) if len(mass) == 1 else _Several(along, *parts)


def _beside_fold(
    motion: ClosedSingle | _Single | _Several, moved: float, shift: Array
) -> tuple[ComplexArray, Array, float]:
    """Multipliers, shifts and share where a correction may have no meaning, as it does at a limit point.

    moved: shift of the multiplier nearest to +1 by the whole correction.
    """
    gap = motion.gap()
    ratio = 2.0 * moved / gap if gap > 0.0 else math.inf
    mu, kept, share = motion.multipliers(1.0 / (1.0 + min(ratio, 1e6) ** 4))
    left_out = moved * min(1.0, 2.0 / math.sqrt(ratio)) if math.isfinite(moved) else math.inf
    return mu, kept + 2.0 * left_out, share


class _Single:
    """One degree of freedom: the multipliers are the roots of `mu^2 - trace mu + exp(-int c dt)`."""

    def __init__(self, along: Linearisation, mass: Array, damping: Array, stiffness: Array) -> None:
        self.along, self.varying = along, along.varying
        linear = along.state.linear
        self.shape = np.array([linear.expand(direction)[0] for direction in along.directions], dtype=float)
        self.scale = 1.0 / along.state.rate
        self.matrices = (mass[0, 0], damping[0, 0], stiffness[0, 0])
        self.before: np.ndarray = np.zeros(0)

    def multipliers(self, weight: float) -> tuple[ComplexArray, Array, float]:
        """Multipliers, how far the correction has moved them, and the share of it that was taken.

        weight: share of its part along the direction of the real multiplier nearest to +1.
        """
        along = self.along
        about = (along.moving, self.shape, self.matrices, STEPS)
        before, change, share = standing_single(
            along.stretch, self.scale, along.path, along.law, along.base, *about, BETWEEN, NODES, _LARGEST, weight
        )
        self.before = before
        law, kick = along.changed(change)
        mu, shift = corrected_single(along.stretch, self.scale, law, along.base, kick, *about, before)
        return mu, shift, share

    def gap(self) -> float:
        """Distance to +1 of the nearest multiplier of the motion as it stands."""
        return float(np.abs(1.0 - self.before).min())


class _Several:
    """Several degrees of freedom."""

    def __init__(self, along: Linearisation, mass: Array, damping: Array, stiffness: Array) -> None:
        self.along, self.varying = along, along.varying
        n, linear = len(mass), along.state.linear
        shapes = np.array([linear.expand(direction) for direction in along.directions], dtype=float).reshape(-1, n)
        acting = np.array([linear.expand(direction) for direction in along.acting], dtype=float).reshape(-1, n)
        self.matrices = _in_modes(mass, damping, stiffness, acting, shapes)
        self.none = np.zeros((len(shapes), 0))
        self.scale = 1.0 / along.state.rate
        self.before: Array = np.zeros((0, 0))

    def multipliers(self, weight: float) -> tuple[ComplexArray, Array, float]:
        """See `_Single.multipliers`."""
        along = self.along
        before, alone, rows, start = self._standing()
        if weight < 1.0:
            start = start - (1.0 - weight) * (projector(before) @ start)
        change = respond(start, alone, rows)
        share = 1.0
        for change_g, path_g in zip(change, along.path, strict=True):
            most, size = _LARGEST * np.abs(path_g[0]).max(), np.abs(change_g[0]).max()
            if not size <= most:
                share = min(share, most / size if size < np.inf else 0.0)
        change = share * change if share > 0.0 else np.zeros_like(change)
        law, kick = along.changed(change)
        after = self._corrected(law, kick, alone)
        mu, shift = perturbed(after, after - before)
        return mu, shift, share

    def _standing(self) -> tuple[Array, Array, Array, Array]:
        """Along the motion as it stands: monodromy matrix, propagators of all panels, what `respond` needs, and the
        state with which the correction begins. Polynomials are of lower degree than along the corrected motion.
        """
        along = self.along
        force, k, c = (np.ascontiguousarray(along.law[:, i]) for i in range(3))
        kick = np.zeros((len(self.none), len(along.stretch)))
        total, alone, rows = propagate(
            along.stretch,
            self.scale,
            *self.matrices,
            along.base,
            k if along.varying else self.none,
            c if along.moving else self.none,
            force,
            kick,
            POWERS[1],
            NODES,
        )
        size = len(total)
        self.before = np.ascontiguousarray(total[:, :size])
        if not len(self.none):
            return self.before, alone, rows, np.zeros(size)
        *_, start, singular = lapack.dgesv(np.eye(size) - self.before, total[:, size])
        return self.before, alone, rows, np.full(size, np.inf) if singular else start

    def _corrected(self, law: Array, kick: Array, alone: Array) -> Array:
        """Monodromy matrix along the corrected motion; law (G, 2, N), kick (G, P): see `panels.closed_changes`.

        Where stiffness and damping are constant on every panel, the panels' propagators are still the same.
        """
        along = self.along
        _, _, left, right = self.matrices
        if along.varying:
            k, c = (np.ascontiguousarray(law[:, i]) for i in range(2))
            total: Array = propagate(
                along.stretch,
                self.scale,
                *self.matrices,
                along.base,
                k,
                c if along.moving else self.none,
                self.none,
                kick,
                POWERS[0],
                NODES,
            )[0]
            return total
        size = len(self.before)
        total = np.eye(size)
        product = np.empty((size, size))
        for p, one in enumerate(np.ascontiguousarray(alone[:, :, :size])):
            advance(total, one, left, right, kick, p, product)
        return total

    def gap(self) -> float:
        """Distance to +1 of the nearest multiplier of the motion as it stands."""
        return float(np.abs(1.0 - np.linalg.eigvals(self.before)).min())


def _in_modes(
    mass: Array, damping: Array, stiffness: Array, acting: Array, shapes: Array
) -> tuple[Array, Array, Array, Array]:
    """Stiffness, damping (n, n), and the directions in which elements act and are moved (G, n), in modes of the linear
    part normalised by mass: norms have no units, and most products are with diagonal matrices.

    Where mass or stiffness is not symmetric, or the mass not positive definite, in DOFs weighted by the square roots of
    their masses.
    """
    given = (np.asarray(matrix, dtype=float).tobytes() for matrix in (mass, stiffness))
    modes = _modes(*given, len(mass))
    if modes is not None:
        values, shape = modes
        return (
            np.diag(values),
            _cleaned(shape.T @ damping @ shape),
            np.ascontiguousarray(acting @ shape),
            np.ascontiguousarray(shapes @ shape),
        )
    weight = np.sqrt(mass.diagonal())
    inverse = np.linalg.inv(mass) * weight[:, None]
    return (
        inverse @ stiffness / weight,
        inverse @ damping / weight,
        np.ascontiguousarray(acting @ inverse.T),
        shapes / weight,
    )


@lru_cache(maxsize=16)
def _modes(mass: bytes, stiffness: bytes, size: int) -> tuple[Array, Array] | None:
    """Squares of natural frequencies and modes in columns of matrices (size, size), None where there are none."""
    m, k = (np.frombuffer(given).reshape(size, size) for given in (mass, stiffness))
    if not (np.array_equal(m, m.T) and np.array_equal(k, k.T)):
        return None
    try:
        values, shape = eigh(k, m)
    except np.linalg.LinAlgError:
        return None
    return values, shape


def _cleaned(matrix: Array) -> Array:
    """Without what rounding leaves off the diagonal."""
    size = np.sqrt(np.abs(np.multiply.outer(matrix.diagonal(), matrix.diagonal())))
    result: Array = np.where(np.abs(matrix) > 1e-13 * size, matrix, 0.0)
    return result


_Motion = ClosedSingle | _Single | _Several


def _vectors(matrix: Array) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Eigenvalues, left and right vectors in columns; `left^H matrix = mu left^H`."""
    real, imaginary, left, right, _ = lapack.dgeev(matrix, 1, 1)
    mu = real + 1j * imaginary
    vectors = []
    for packed in (left, right):
        v = packed.astype(complex)
        for j in np.flatnonzero(imaginary > 0.0):
            v[:, j] = packed[:, j] + 1j * packed[:, j + 1]
            v[:, j + 1] = v[:, j].conj()
        vectors.append(v)
    return mu, vectors[0], vectors[1]


def perturbed(phi: Array, change: Array) -> tuple[ComplexArray, Array]:
    """Eigenvalues of phi (N, N), by descending modulus, and their first-order shifts by a change and by rounding."""
    mu, left, right = _vectors(phi)
    scale = np.abs((left.conj() * right).sum(axis=0))
    by_change = np.abs((left.conj() * (change @ right)).sum(axis=0))
    by_rounding = (np.abs(left) * (np.abs(phi) @ np.abs(right))).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(scale > 0.0, (by_change + 1e-15 * by_rounding) / scale, np.inf)
    # a double multiplier moves like the square root of a perturbation: that bounds the first-order estimate
    norm = length(change) + 1e-15 * length(phi)
    size = np.abs(mu)
    shift = np.minimum(shift, math.sqrt(norm * max(1.0, size.max()))) + 1e-14
    order = np.argsort(-size, kind="stable")
    return mu[order], shift[order]


def projector(phi: Array) -> Array:
    """On the direction of the real multiplier nearest to +1, (N, N); zero if there is none or it is a double one."""
    mu, left, right = _vectors(phi)
    real = np.flatnonzero(mu.imag == 0.0)
    if real.size:
        found = real[np.argmin(np.abs(1.0 - mu[real]))]
        u, v = left[:, found].real, right[:, found].real
        scale = float(u @ v)
        if abs(scale) > 1e-10:
            return np.multiply.outer(v, u) / scale
    return np.zeros_like(phi)
