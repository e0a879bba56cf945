"""Symmetric functions of the multipliers, smooth along a curve where single multipliers are not.

Two multipliers that meet part at right angles, like square roots; but these are as smooth as the monodromy matrix:

    fold     prod_j (1 - mu_j)                 a multiplier passes +1
    double   prod_j (1 + mu_j)                 a multiplier passes -1
    torus    prod_{i<j} (1 - mu_i mu_j)        a pair leaves the circle (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.linear_part import LinearPart

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9
#: modulus of the multipliers of a linear structure up to which it counts as damped
_DAMPED = 1.0 - 1e-9
#: share of its distance from the circle by which a multiplier may be moved and is left out
_SHARE = 0.25


def symmetric_functions(mu: ComplexArray) -> Array:
    """fold, double, torus of multipliers (m,): signs and logarithms of the moduli, shape (2, 3); products of many
    factors leave the range of numbers.

    `torus` is constant for motions without damping, whose pairs never leave the circle. Complex factors come in
    conjugate pairs: the sign is that of the real ones.
    """
    out = np.empty((2, 3))
    _multiply(mu, out)
    return out


@lru_cache(maxsize=64)
def _exponents(linear: LinearPart) -> ComplexArray:
    mass, damping, stiffness = linear.equation_of_motion()
    n = len(mass)
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    exponents: ComplexArray = np.linalg.eigvals(flow).astype(complex)
    return exponents[np.lexsort((exponents.imag, exponents.real, np.abs(exponents)))]


def linear_multipliers(linear: LinearPart, period: float) -> ComplexArray:
    """Multipliers of a structure without its elements over a period, (2 N,), in an order that no frequency changes."""
    multipliers: ComplexArray = np.exp(_exponents(linear) * period)
    return multipliers


def relative_functions(motions: Sequence[tuple[ComplexArray, ComplexArray]]) -> list[Array]:
    """The symmetric functions, (2, 3) each, of those multipliers of neighbouring motions that elements have moved at
    one of them, in units of what they are for the linear structure; empty where that is undamped.

    motions: multipliers, and those of the linear structure, (2 N,) each. Of many vibrations in a period every
    multiplier turns fast as the frequency changes, and with it the functions of all; but most turn as those of the
    linear structure do, which lie inside the circle. One that elements have moved by a small share of its distance from
    the circle does not leave it between places so close together.
    """
    lengths = {len(mu) for motion in motions for mu in motion}
    if len(lengths) > 1 or any(np.abs(linear).max() > _DAMPED for _, linear in motions):
        return []
    found = [_unmoved(mu, linear) for mu, linear in motions]
    unmoved = np.all([places >= 0 for places in found], axis=0)
    functions = []
    for (mu, linear), places in zip(motions, found, strict=True):
        own, known = symmetric_functions(np.delete(mu, places[unmoved])), symmetric_functions(linear[~unmoved])
        functions.append(np.array((own[0] * known[0], own[1] - known[1])))
    return functions


@kernel()
def _unmoved(mu, linear):
    """For every multiplier of the linear structure (m,) which of `mu` (m,) it is, each the other's nearest and closer
    than a share of the distance from the circle; -1 for none.
    """
    m = mu.shape[0]
    place, nearest = np.full(m, -1), np.full(m, -1)
    for i in range(m):
        best = np.inf
        for j in range(m):
            away = abs(mu[i] - linear[j])
            if away < best:
                best, nearest[i] = away, j
    for j in range(m):
        best = _SHARE * (1.0 - abs(linear[j]))
        for i in range(m):
            away = abs(mu[i] - linear[j])
            if away <= best:
                best, place[j] = away, i
        if place[j] >= 0 and nearest[place[j]] != j:
            place[j] = -1
    return place


@kernel()
def _multiply(mu, out):
    """`symmetric_functions` into (2, 3)."""
    m, total = mu.shape[0], 0.0
    for i in range(m):
        total += np.log(np.abs(mu[i]))
    for k in range(3):
        sign, logarithm = 1.0, 0.0
        for i in range(m if k < 2 or abs(total) >= UNDAMPED else 0):
            for j in range(i if k == 2 else 1):
                of = mu[i] * mu[j] if k == 2 else mu[i]
                factor, size = (1.0 + of if k == 1 else 1.0 - of), np.abs(of)
                if abs(of.imag) <= 1e-12 * size and factor.real < 0.0:
                    sign = -sign
                logarithm += np.log(np.abs(factor)) - 0.5 * np.log1p(size * size)
        out[0, k], out[1, k] = sign, logarithm
