"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period by
products of matrix exponentials (`stability.kernels`). The motion is taken with the harmonics that it neglects
(`BalanceState.completed`): where contacts make the series converge slowly, that brings the multipliers ten times
closer to the true ones, and the distance from those of the truncated motion is part of their error estimate. Steps
follow the law: the exact contact instants of piecewise- linear elements are their ends (between contacts A is
constant and the exponential exact), panels are graded towards the passage of a sharp law, and everything else is
covered by uniform steps. The run with every step halved gives the multipliers, its distance from the first run their
error estimate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic import kernels as harmonic_kernels
from suboctave.harmonic.basis import Array
from suboctave.harmonic.local_force import LocalMotion
from suboctave.harmonic.quadrature import sharp_nodes
from suboctave.harmonic.state import BalanceState
from suboctave.model.sampling import PiecewiseLinear, SharpSampling
from suboctave.stability import kernels
from suboctave.stability.result import FloquetResult

_GAUSS = np.array([-1.0, 1.0]) / math.sqrt(3.0)
_RATIO = 2.5

__all__ = ["FloquetResult", "floquet_multipliers"]


def floquet_multipliers(state: BalanceState) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods)."""
    mass, damping, stiffness = state.linear.equation_of_motion()
    truncated, linearised = _Linearisation(state), _Linearisation(state.completed)
    # where to step need not be known as well as the motion: one set of steps for both, but each with its own contact
    # instants (between steps that end at the other's, the two would look alike)
    steps = truncated.steps()
    edges = linearised.with_contacts(steps)
    coarse = _monodromy(linearised, mass, damping, stiffness, edges)
    if linearised.constant:
        fine, stepping = coarse, np.zeros_like(coarse)
    else:
        halved = np.empty(2 * len(edges) - 1)
        halved[::2], halved[1::2] = edges, 0.5 * (edges[1:] + edges[:-1])
        fine = _monodromy(linearised, mass, damping, stiffness, halved)
        stepping = (fine - coarse) / 15.0
    plain = _monodromy(truncated, mass, damping, stiffness, truncated.with_contacts(steps))
    return _result(fine + stepping, (stepping, coarse - plain))


def _result(phi: Array, changes: tuple[Array, ...]) -> FloquetResult:
    """Multipliers of phi, with errors from first-order perturbation by the changes seen."""
    mu, vectors = np.linalg.eig(phi)
    shift = np.zeros(len(mu))
    try:
        left = np.linalg.inv(vectors)
        for change in changes:
            shift += np.abs(((left @ change) * vectors.T).sum(axis=1))
        # rounding, in any units of the DOFs: beside a large multiplier the small ones have fewer digits
        shift += 1e-15 * ((np.abs(left) @ np.abs(phi)) * np.abs(vectors).T).sum(axis=1)
    except np.linalg.LinAlgError:
        shift[:] = np.inf
    # a double multiplier moves like the square root of a perturbation: that bounds the first-order estimate
    size = sum(float(np.linalg.norm(change)) for change in changes) + 1e-15 * float(np.linalg.norm(phi))
    shift = np.minimum(np.nan_to_num(shift, nan=np.inf), math.sqrt(size * max(1.0, float(np.abs(mu).max())))) + 1e-14
    order = np.argsort(-np.abs(mu), kind="stable")
    return FloquetResult(mu.astype(complex)[order], shift[order])


class _Linearisation:
    """The elements' tangents along a motion, at any instant, and the steps they ask for."""

    def __init__(self, state: BalanceState) -> None:
        self.state = state
        self.locals = state.local_motions
        self.kinds = [local.kind for local in self.locals]
        self.constant = all(isinstance(kind, PiecewiseLinear) for kind in self.kinds)
        self._contacts = {
            i: local.contacts() for i, local in enumerate(self.locals) if isinstance(self.kinds[i], PiecewiseLinear)
        }

    def steps(self) -> Array:
        """Ends of the steps in tau that laws without contact instants ask for, from 0 to 2 pi, ascending."""
        if self.constant:
            return np.array([0.0, 2.0 * math.pi])
        parts = [np.linspace(0.0, 2.0 * math.pi, self._uniform() + 1)]
        sharp: dict[bytes, list[tuple[LocalMotion, SharpSampling]]] = {}
        for local, kind in zip(self.locals, self.kinds, strict=True):
            if isinstance(kind, SharpSampling):
                sharp.setdefault(local.motion.tobytes(), []).append((local, kind))
        parts += [_panel_edges(together) for together in sharp.values()]
        return _merged(parts)

    def with_contacts(self, steps: Array) -> Array:
        """Ends of steps with those at the motion's contact instants."""
        if not self._contacts:
            return steps
        return _merged([steps] + [c.instants for contacts in self._contacts.values() for c in contacts])

    def _uniform(self) -> int:
        """Uniform steps: enough for the highest harmonic that matters."""
        basis = self.state.basis
        sizes = np.abs(self.state.x).max(axis=1)
        sizes = np.concatenate((sizes[:1], np.maximum(sizes[1::2], sizes[2::2])))
        relevant = np.flatnonzero(sizes > 1e-3 * sizes.max())
        top = int(relevant[-1]) if relevant.size else 1
        return max(16 * basis.nu, 8 * top + 8)

    def tangents(self, tau: Array) -> tuple[Array, Array]:
        """f_u and f_v of every element at instants tau (N,): shape (E, N) each."""
        count = len(self.locals)
        stiffness = np.zeros((count, len(tau)))
        damping = np.zeros((count, len(tau)))
        zr, zi = np.cos(tau), np.sin(tau)
        motions: dict[bytes, Array] = {}
        for i, local in enumerate(self.locals):
            if i in self._contacts:
                # the state of each contact between its instants, not a comparison at the instant itself
                for contact in self._contacts[i]:
                    stiffness[i] += local.coefficients[contact.stiffness] * contact.active(tau)
                continue
            key = local.motion.tobytes()
            if key not in motions:
                motions[key] = harmonic_kernels.motion(local.motion, zr, zi)
            x, rate = motions[key]
            _, f_u, f_v = local.element.tangent(x, local.rate * rate, local.coefficients)
            stiffness[i] = f_u
            if f_v is not None:
                damping[i] = f_v
        return stiffness, damping


def _merged(parts: list[Array]) -> Array:
    """All instants in ascending order, none twice, from 0 to 2 pi."""
    edges = np.sort(np.concatenate(parts))
    kept = np.empty(len(edges), dtype=bool)
    kept[0] = True
    np.greater(np.diff(edges), 1e-12, out=kept[1:])
    edges = edges[kept]
    edges[0], edges[-1] = 0.0, 2.0 * math.pi
    return edges


def _panel_edges(together: list[tuple[LocalMotion, SharpSampling]]) -> Array:
    """Ends of panels graded towards the passages of the sharp laws of elements that share a motion."""
    local = together[0][0]
    kind = SharpSampling(
        tuple(p for _, k in together for p in k.points), tuple(w for _, k in together for w in k.widths)
    )
    weights = sharp_nodes(local.motion, kind, 8, 1, _RATIO)[2]
    return np.minimum(np.append(0.0, np.cumsum(weights)), 2.0 * math.pi)


def _monodromy(
    linearised: _Linearisation, mass: Array, damping: Array, stiffness: Array, edges: Array
) -> NDArray[np.float64]:
    """State-transition matrix of (y, y') over the period, y in DOFs weighted by the square roots of their masses."""
    state = linearised.state
    half = 0.5 * np.diff(edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    tau = (middle[:, None] + half[:, None] * _GAUSS).ravel()
    k, c = linearised.tangents(tau)
    h = 2.0 * half / state.rate
    n = mass.shape[0]
    linear, total = state.linear, state.balance.system.n
    directions = [linear.expand(linear.retain(local.element.direction(total))) for local in linearised.locals]
    if n == 1:
        m = mass[0, 0]
        squares = np.array([d[0] ** 2 / m for d in directions])
        k_total = stiffness[0, 0] / m + squares @ k
        c_total = damping[0, 0] / m + squares @ c
        return kernels.propagate_single(k_total.reshape(-1, 2), c_total.reshape(-1, 2), h)
    # in DOFs weighted by the square roots of their masses the norms that set sub-steps do not depend on units
    weight = np.sqrt(np.diag(mass))
    inverse = np.linalg.inv(mass) * weight[:, None]
    shapes = np.zeros((len(directions), 2, n))
    for i, d in enumerate(directions):
        shapes[i, 0], shapes[i, 1] = inverse @ d, d / weight
    return kernels.propagate(
        np.ascontiguousarray(inverse @ stiffness / weight),
        np.ascontiguousarray(inverse @ damping / weight),
        shapes,
        k.reshape(len(directions), len(h), 2),
        c.reshape(len(directions), len(h), 2),
        h,
    )
