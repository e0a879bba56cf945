"""Periodic motions by multiple shooting on compiled flows, many at once, with free frequency.

A motion of nu load periods is cut at N = nu S instants of equal phase, and `Phi_k(y_k, omega) = y_(k+1)`, `y_N = y_0`,
is solved for all y_k and omega by Newton's method with corrections of least norm: that leads to the nearest motion of
the curve of periodic motions, and limit points of that curve are points like any other. Motions that nothing drives
have a free phase, in which they are not corrected, and their curve runs over a parameter, free as well. Unstable
motions grow by the N-th root of their multipliers within a piece. Derivatives of the pieces are central differences of
two widths, d and 2 d; Richardson's combination of both counts, and its distance from the first one tells the error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from suboctave.model.elements.base import Array
from suboctave.model.system import System
from suboctave.timedomain.flow import Flow

__all__ = ["PIECES", "MultipleShooting", "ShotMotions"]

#: pieces of a period of the load
PIECES = 4
#: error of one step of the flow, and half width of the differences, relative to the motion
_TOLERANCE, _WIDTH = 1e-13, 3e-5
#: a correction so small is the last one
_SMALL = 1e-9
#: what must be reached, of the residual and of the last correction
_RESIDUAL, _CORRECTION = 1e-8, 1e-5
_LONGEST = 0.3
#: numbers that the matrices of one batch may hold
_ROOM = 20_000_000


@dataclass(frozen=True, eq=False)
class ShotMotions:
    """B motions, each of N pieces.

    Attributes
    ----------
    states
        (B, N, 2n), the first one at phase 0 of the load.
    omega
        (B,).
    free
        (B, f): the free parameters.
    converged
        (B,): whether Newton's method arrived.
    residual
        (B,), relative to the motion.
    tangent
        (B, N 2n + 1 + f): the direction of the curve of motions, in units of `sizes` and omega; unit length.
    border
        (B,): sign of the determinant of the Jacobian bordered by `tangent`, which changes at a branch point if the
        tangents keep their sense.
    monodromy, rough
        (B, 2n, 2n) by Richardson's combination, and by the differences of smaller width alone; in units of `sizes`.
    """

    states: Array
    omega: Array
    free: Array
    converged: NDArray[np.bool_]
    residual: Array
    tangent: Array
    border: Array
    monodromy: Array
    rough: Array

    def multipliers(self) -> tuple[NDArray[np.complex128], Array]:
        """(B, 2n) by falling modulus, and the estimated error of each; nan where no motion was converged."""
        values = np.full(self.monodromy.shape[:2], np.nan, dtype=complex)
        errors = np.full(values.shape, np.inf)
        for b in np.flatnonzero(self.converged):
            fine, rough = np.linalg.eigvals(self.monodromy[b]), np.linalg.eigvals(self.rough[b])
            fine = fine[np.lexsort((-fine.imag, -np.abs(fine).round(12)))]
            values[b] = fine
            # each from the nearest of the others: a pair that splits is off by as much as it splits
            errors[b] = 2.0 * np.min(np.abs(fine[:, None] - rough[None, :]), axis=1)
            errors[b] += 1e-14 * np.linalg.norm(self.monodromy[b])
        return values, errors


class MultipleShooting:
    """The equations of a system's periodic motions of `nu` load periods; `free`: parameters that are unknowns beside
    omega.
    """

    def __init__(self, system: System, nu: int, workers: int | None = None, free: tuple[str, ...] = ()) -> None:
        self.system, self.nu, self.workers, self.free = system, nu, workers, free
        self.flow = Flow(system, samples=PIECES, tolerance=_TOLERANCE)
        self.pieces = nu * PIECES

    @property
    def at_once(self) -> int:
        """How many motions one batch may have."""
        n = self.system.n
        trajectories = self.pieces * self._each
        return int(np.clip(_ROOM // max(trajectories * max(3 * n * n, 100), 1), 1, 64))

    @property
    def _each(self) -> int:
        """Trajectories of a piece: two for every unknown, and its own."""
        return 2 * (2 * self.system.n + 1 + len(self.free)) + 1

    def solve(
        self,
        states: Array,
        omega: Array,
        parameters: Mapping[str, Array],
        sizes: Array,
        iterations: int = 12,
        along: Array | None = None,
        held: Array | None = None,
    ) -> ShotMotions:
        """The motions nearest to `states` (B, N, 2n) at `omega` (B,) and `parameters` (B,) each, in units of `sizes`
        (B, 2n + f), of the states and the free parameters.

        `along` (B, N 2n + 1 + f): the sense of the tangents. `held` (B, N 2n): a direction of the states in which they
        are not corrected, in these units. Raises KeyboardInterrupt where it was interrupted.
        """
        count, pieces, m = states.shape
        y, units = states.copy(), np.column_stack([omega, sizes[:, m:]])
        # omega and the free parameters
        tail = np.column_stack([omega, *(parameters[name] for name in self.free)])
        converged, gone = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        residual = np.full(count, np.inf)
        last = np.full(count, np.inf)

        def linearised(which: NDArray[np.int_], width: float = _WIDTH) -> tuple[Array, Array, Array]:
            own = {name: values[which] for name, values in parameters.items()}
            jacobian, defect, transition = self._linearised(
                y[which], tail[which], own, sizes[which, :m], units[which], width
            )
            if held is not None:
                row = np.pad(held[which], ((0, 0), (0, units.shape[1])))[:, None, :]
                jacobian = np.concatenate([jacobian, row], axis=1)
                defect = np.pad(defect, ((0, 0), (0, 1)))
            return jacobian, defect, transition

        for _ in range(iterations):
            now = np.flatnonzero(~converged & ~gone)
            if not now.size:
                break
            jacobian, defect, _ = linearised(now)
            usable = np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(defect).all(axis=1)
            gone[now[~usable]] = True
            now, jacobian, defect = now[usable], jacobian[usable], defect[usable]
            if not now.size:
                continue
            step = _least_norm(jacobian, -defect)
            length = np.abs(step).max(axis=1)
            residual[now] = np.abs(defect).max(axis=1)
            good = np.isfinite(length)
            gone[now[~good]] = True
            step = np.where(good[:, None], step, 0.0) * np.minimum(1.0, _LONGEST / np.maximum(length, 1e-300))[:, None]
            y[now] += step[:, : pieces * m].reshape(y[now].shape) * sizes[now, None, :m]
            tail[now] += step[:, pieces * m :] * units[now]
            lost = ~(tail[now, 0] > 0.0)
            gone[now[lost]] = True
            tail[now, 0] = np.where(lost, omega[now], tail[now, 0])
            # the noise of the differences: corrections that do not fall any more
            settled = (length >= 0.5 * last[now]) & (length <= _CORRECTION) & (residual[now] <= _RESIDUAL)
            converged[now[good & ((length <= _SMALL) | settled)]] = True
            last[now] = length
        converged |= (last <= _CORRECTION) & (residual <= _RESIDUAL)
        converged &= ~gone
        tangent, border = np.full((count, pieces * m + units.shape[1]), np.nan), np.full(count, np.nan)
        whole, rough = np.full((2, count, m, m), np.nan)
        now = np.flatnonzero(converged)
        if now.size:
            jacobian, defect, narrow = linearised(now)
            wide = linearised(now, 2.0 * _WIDTH)[2]
            residual[now] = np.abs(defect).max(axis=1)
            rough[now] = _product(narrow)
            whole[now] = _product((4.0 * narrow - wide) / 3.0)
            t = np.linalg.qr(np.swapaxes(jacobian, 1, 2), mode="complete")[0][:, :, -1]
            if along is not None:
                t *= np.where(np.sum(t * along[now], axis=1) < 0.0, -1.0, 1.0)[:, None]
            tangent[now] = t
            border[now] = np.linalg.slogdet(np.concatenate([jacobian, t[:, None, :]], axis=1))[0]
            # a neighbour may not be followed
            converged[now] = np.isfinite(whole[now] + rough[now]).all(axis=(1, 2))
        return ShotMotions(y, tail[:, 0], tail[:, 1:], converged, residual, tangent, border, whole, rough)

    def _linearised(
        self,
        y: Array,
        tail: Array,
        parameters: Mapping[str, Array],
        sizes: Array,
        units: Array,
        width: float,
    ) -> tuple[Array, Array, Array]:
        """Jacobian (B, N m, N m + 1 + f), defect (B, N m), transition matrices of the pieces (B, N, m, m), scaled."""
        count, pieces, m = y.shape
        each, others = self._each, tail.shape[1]
        starts = np.repeat(y[:, :, None, :], each, axis=2)
        for i in range(m):
            starts[:, :, 2 * i, i] += width * sizes[:, None, i]
            starts[:, :, 2 * i + 1, i] -= width * sizes[:, None, i]
        free = np.broadcast_to(tail.T[:, :, None, None], (others, count, pieces, each)).copy()
        for j in range(others):
            free[j, :, :, 2 * (m + j)] += width * units[:, None, j]
            free[j, :, :, 2 * (m + j) + 1] -= width * units[:, None, j]
        omega = free[0]
        first = np.broadcast_to(np.arange(pieces)[None, :, None], omega.shape)
        varied = {name: np.repeat(values, pieces * each) for name, values in parameters.items()}
        varied |= {name: free[j].ravel() for j, name in enumerate(self.free, 1)}
        motions = self.flow.onward(starts.reshape(-1, m), omega.ravel(), first.ravel(), varied, self.workers).whole()
        ends = motions.end.reshape(count, pieces, each, m) / sizes[:, None, None, :]
        slopes = (ends[:, :, 0:-1:2] - ends[:, :, 1:-1:2]) / (2.0 * width)
        transition = np.swapaxes(slopes[:, :, :m], 2, 3)
        jacobian = np.zeros((count, pieces * m, pieces * m + others))
        for k in range(pieces):
            rows, onto = slice(k * m, (k + 1) * m), (k + 1) % pieces
            jacobian[:, rows, k * m : (k + 1) * m] += transition[:, k]
            jacobian[:, rows, onto * m : (onto + 1) * m] -= np.eye(m)
            jacobian[:, rows, pieces * m :] = np.swapaxes(slopes[:, k, m:], 1, 2)
        defect = ends[:, :, -1] - np.roll(y, -1, axis=1) / sizes[:, None, :]
        return jacobian, defect.reshape(count, -1), transition


def _product(pieces: Array) -> Array:
    """(B, m, m): the last of the matrices (B, N, m, m) times ... times the first."""
    out = pieces[:, 0]
    for k in range(1, pieces.shape[1]):
        out = pieces[:, k] @ out
    return out


def _least_norm(matrices: Array, right: Array) -> Array:
    """The shortest solutions (B, p) of m equations each, matrices (B, m, p)."""
    q, r = np.linalg.qr(np.swapaxes(matrices, 1, 2))
    # a direction that hardly matters (at a branch point) must not stop the others
    diagonal = np.abs(np.einsum("bii->bi", r))
    tiny = diagonal <= 1e-13 * diagonal.max(axis=1, keepdims=True)
    r = r + np.einsum("bi,ij->bij", np.where(tiny, diagonal.max(axis=1, keepdims=True), 0.0), np.eye(r.shape[1]))
    inner = np.linalg.solve(np.swapaxes(r, 1, 2), right[:, :, None])
    return np.asarray((q @ inner)[:, :, 0])
