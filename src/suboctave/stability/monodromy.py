"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period on
panels that follow the laws (`panels`), by kernels for one (`single`) and for several DOFs (`several`).

A motion of H harmonics is not quite the true one: it leaves the force `r = sum d (f - P_H f)` unbalanced, P_H f the part
of the element forces within the basis. One step of Newton's method in the space of periodic functions (Kantorovich),

    M d'' + (C + sum f_v d d^T) d' + (K + sum f_u d d^T) d = -r,   d periodic,

whose propagator is at hand, gives what the motion lacks: harmonics beyond H without end, and the shift that they cause
in those within. The multipliers are those of the motion so corrected; the distance between theirs and those of the
motion as it stands, propagated with coarser steps, is their error estimate. It bounds what remains: an error of the
second order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.state import BalanceState
from suboctave.stability.linearisation import Linearisation
from suboctave.stability.panels import NODES
from suboctave.stability.several import POWERS, monodromy_several, respond_several
from suboctave.stability.single import BETWEEN, STEPS, monodromy_single, respond_single

#: a correction larger than this share of the motion is cut down to it
_LARGEST = 0.1
#: a correction is taken as it is where its effect stays below this share of what it may be
_MODEST = 0.1


@dataclass(frozen=True)
class FloquetResult:
    """Floquet multipliers of a motion over its own period.

    multipliers
        Shape (2 n,), complex, by descending modulus.
    errors
        Estimated error of each, shape (2 n,): of the steps, of the harmonics that the motion neglects, of rounding.
    """

    multipliers: ComplexArray
    errors: Array

    @property
    def error(self) -> float:
        """Largest error estimate among the multipliers that decide (modulus above one half)."""
        deciding = np.abs(self.multipliers) > 0.5
        return float(np.max(self.errors[deciding] if deciding.any() else self.errors))

    @property
    def margin(self) -> float:
        """Largest modulus minus one: negative if stable."""
        return float(np.abs(self.multipliers).max() - 1.0)

    @property
    def stable(self) -> bool:
        """True if all multipliers lie inside the unit circle."""
        return self.margin < 0.0

    @property
    def decided(self) -> bool:
        """True if no multiplier is closer to the unit circle than its error estimate."""
        return bool(np.all(np.abs(np.abs(self.multipliers) - 1.0) > self.errors))

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return int(np.count_nonzero(np.abs(self.multipliers) > 1.0))

    @property
    def unstable_pairs(self) -> int:
        """Number of complex-conjugate pairs outside the unit circle."""
        mu = self.multipliers[np.abs(self.multipliers) > 1.0]
        return int(np.count_nonzero(mu.imag > 0.0))


def floquet_multipliers(state: BalanceState) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods)."""
    along = Linearisation(state)
    mass, damping, stiffness = state.linear.equation_of_motion()
    if len(mass) == 1:
        return _single(along, mass[0, 0], damping[0, 0], stiffness[0, 0])
    return _several(along, mass, damping, stiffness)


def _single(along: Linearisation, mass: float, damping: float, stiffness: float) -> FloquetResult:
    """One degree of freedom: the multipliers are the roots of `mu^2 - trace mu + exp(-int c dt)`."""
    linear = along.state.linear
    d = np.array([linear.expand(direction)[0] for direction in along.directions])
    square = d * d / mass
    scale = 1.0 / along.state.rate
    c = damping / mass
    base = square @ along.base + stiffness / mass
    still = np.zeros(len(base))
    k, cv = square @ along.stiffness, square @ along.damping

    def multipliers(k: Array, cv: Array, kick: Array, fine: bool) -> ComplexArray:
        trace, decay = monodromy_single(along.stretch, scale, base, k, c, cv, kick, STEPS, fine)
        return _roots(trace, decay)

    before = multipliers(k, cv, still, False)
    force = (d / mass) @ along.defect
    size = float(np.min(along.size() / np.abs(d))) if len(d) else 0.0
    response, share = respond_single(along.stretch, scale, base, k, c, cv, force, BETWEEN, _LARGEST * size)

    def after(part: float) -> ComplexArray:
        k, cv, kick = along.changed(np.multiply.outer(part * d, response))
        return multipliers(square @ k, square @ cv, square @ kick, True)

    mu = after(1.0)
    shift = np.abs(mu - before)
    trace = abs(mu.sum())
    rounding = 1e-14 * (1.0 + trace)
    apart = abs(mu[0] - mu[1])
    errors = shift + np.array([min(math.sqrt(rounding), rounding * abs(m) / apart if apart > 0.0 else 1.0) for m in mu])
    return FloquetResult(mu, errors)


def _roots(trace: float, decay: float) -> ComplexArray:
    """Roots of `mu^2 - trace mu + exp(-decay)`, the larger one first."""
    product = math.exp(-decay)
    square = 0.25 * trace * trace - product
    if square < 0.0:
        part = math.sqrt(-square)
        return np.array([complex(0.5 * trace, part), complex(0.5 * trace, -part)])
    larger = 0.5 * trace + math.copysign(math.sqrt(square), trace)
    return np.array([larger, product / larger if larger != 0.0 else 0.0], dtype=complex)


def _several(along: Linearisation, mass: Array, damping: Array, stiffness: Array) -> FloquetResult:
    """Several degrees of freedom, in DOFs weighted by the square roots of their masses: norms have no units there."""
    n, linear = len(mass), along.state.linear
    weight = np.sqrt(np.diag(mass))
    inverse = np.linalg.inv(mass) * weight[:, None]
    d = np.array([linear.expand(direction) for direction in along.directions]).reshape(-1, n)
    left, right = d @ inverse.T, d / weight
    k0 = np.ascontiguousarray(inverse @ stiffness / weight)
    c0 = np.ascontiguousarray(inverse @ damping / weight)
    scale = 1.0 / along.state.rate

    def run(k: Array, c: Array, force: Array, kick: Array) -> tuple[Array, Array, Array]:
        return monodromy_several(
            along.stretch, scale, k0, c0, left, right, along.base, k, c, force, kick, POWERS, NODES
        )

    total, alone, rows = run(along.stiffness, along.damping, along.defect, np.zeros_like(along.base))
    phi = total[:, :-1]
    start = np.linalg.solve(np.eye(2 * n) - phi, total[:, -1])
    response = respond_several(start, alone, rows)
    k, c, kick = along.changed(response)
    better = run(k, c, np.zeros((len(d), 0)), kick)[0][:, :-1]
    return _result(better, (better - phi,))


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
