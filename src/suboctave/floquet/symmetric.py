"""Symmetric functions of the multipliers, smooth along a curve where single multipliers are not.

Two multipliers that meet part at right angles, like square roots; but these are as smooth as the monodromy matrix:

    fold     prod_j (1 - mu_j)                 a multiplier passes +1
    double   prod_j (1 + mu_j)                 a multiplier passes -1
    torus    prod_{i<j} (1 - mu_i mu_j)        a pair leaves the circle (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest.

A structure has many multipliers, and the product of all factors changes as fast as all of them together. But moduli
change slowly however fast the multipliers turn: where neighbouring motions have theirs in separate rings around the
origin, the symmetric functions of each ring are as smooth, and simpler (`in_rings`).

- Of fold and double all real multipliers share one ring, whose factors alone change sign together with others.
- A pair that leaves the circle is one of conjugates, of equal modulus and thus of one ring. The factors of torus
  between two rings vanish where their multipliers are each other's inverses, neutral saddles: they are left out. In
  their place stand, between rings with real multipliers, which become a pair where they meet, those of 1 - mu_i / mu_j.
"""

from __future__ import annotations

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9
#: relative difference below which multipliers are equal: of two that meet rounding leaves 1e-8
EQUAL = 1e-7
#: squares of products beyond which a factor is one to rounding
_LARGE = 1e280
#: modulus of a multiplier, or of a product of two, up to which its ring would have to grow many times over to reach 1
_INSIDE = 0.25


@kernel()
def distinct(mu):
    """Multipliers (m,) without those that equal another one: a symmetric system has families of equal ones all along a
    branch, of which one stands for all. Where two such families are each other's inverses torus has a multiple zero.
    Those that have decayed to nothing are no family.
    """
    kept = np.ones(mu.shape[0], dtype=np.bool_)
    for i in range(mu.shape[0]):
        near = EQUAL * abs(mu[i])
        for j in range(i):
            if abs(mu[i].real - mu[j].real) < near and abs(mu[i] - mu[j]) < near:
                kept[i] = False
                break
    return mu[kept]


def symmetric_functions(mu: ComplexArray) -> Array:
    """fold, double, torus of multipliers (m,): signs and logarithms of the moduli, shape (2, 3); products of many
    factors leave the range of numbers.

    `torus` is constant for motions without damping, whose pairs never leave the circle. Complex factors come in
    conjugate pairs: the sign is that of the real ones.
    """
    out = np.empty((2, 3))
    _multiplied(mu, out)
    return out


@kernel(inner=True)
def multiply(mu, k, column, out):
    """fold, double, torus or the product of all `1 - mu_i / mu_j` (k = 0, 1, 2, 3) of multipliers (m,) into the columns
    of (2, C): `column` (m, m) says into which the factor of i and j < i goes, at [i, 0] for fold and double; one that
    is negative is left out.
    """
    m, total = mu.shape[0], 0.0
    for i in range(m if k == 2 else 0):
        total += np.log(np.abs(mu[i]))
    product = np.ones(out.shape[1])
    for c in range(out.shape[1]):
        out[0, c], out[1, c] = 1.0, 0.0
    for i in range(m if k != 2 or abs(total) >= UNDAMPED else 0):
        for j in range(i if k > 1 else 1):
            c = column[i, j]
            if c < 0:
                continue
            of = mu[i]
            if k > 1:
                of = mu[i] * mu[j] if k == 2 else mu[i] / mu[j]
            real, size = (1.0 + of.real if k == 1 else 1.0 - of.real), of.real**2 + of.imag**2
            if real < 0.0 and of.imag**2 <= 1e-24 * size:
                out[0, c] = -out[0, c]
            if size < _LARGE:
                product[c] *= (real * real + of.imag**2) / (1.0 + size)
            if not 1.0 / _LARGE < product[c] < _LARGE:
                # one logarithm for many factors
                out[1, c] += np.log(product[c])
                product[c] = 1.0
    for c in range(out.shape[1]):
        out[1, c] = 0.5 * (out[1, c] + np.log(product[c]))


@kernel()
def _multiplied(mu, out):
    """fold, double, torus of multipliers (m,) into (2, 3)."""
    whole = np.zeros((mu.shape[0], mu.shape[0]), dtype=np.int64)
    for k in range(3):
        multiply(mu, k, whole, out[:, k : k + 1])


def least_factor(mu: ComplexArray) -> Array:
    """Sign of `torus` and logarithm of the modulus of the least of its factors that may change sign, those of
    conjugates and of two real ones of equal sign, shape (2, 1): zero where torus is, whatever its other factors do.
    """
    real = mu.real[mu.imag == 0.0]
    i, j = np.triu_indices(len(real), 1)
    products = np.append(np.abs(mu[mu.imag > 0.0]) ** 2, (real[i] * real[j])[real[i] * real[j] > 0.0])
    factors = (1.0 - products) / np.sqrt(1.0 + products**2)
    with np.errstate(divide="ignore"):
        if not factors.size or abs(float(np.log(np.abs(mu)).sum())) < UNDAMPED:
            return np.array([[1.0], [0.0]])
        return np.array([[np.prod(np.where(factors < 0.0, -1.0, 1.0))], [np.log(np.abs(factors).min())]])


@kernel()
def in_rings(mu, k):
    """fold, double or torus (k = 0, 1, 2) of neighbouring motions with multipliers (N, m), by descending modulus, as
    functions (N, 2, C) of fewer multipliers each: one or the other vanishes where an event is.
    """
    motions, m = mu.shape
    lowest, highest = np.full(m, np.inf), np.zeros(m)
    for q in range(motions):
        for i in range(m):
            lowest[i], highest[i] = min(lowest[i], abs(mu[q, i])), max(highest[i], abs(mu[q, i]))
    # of fold and double the first ring is that of all real ones
    ring, reach, rings, first = np.zeros(m, dtype=np.int64), np.zeros(m + 1), 1, 0
    with_real = np.zeros(m + 1, dtype=np.bool_)
    for i in range(m):
        if i + 1 < m:
            moved = max(highest[i] - lowest[i], highest[i + 1] - lowest[i + 1])
            if not lowest[i] - highest[i + 1] > moved:
                continue
        real = False
        for q in range(motions):
            for j in range(first, i + 1):
                real = real or mu[q, j].imag == 0.0
        at = 0 if real and k < 2 else rings
        with_real[at] = real
        for j in range(first, i + 1):
            ring[j], reach[at] = at, max(reach[at], highest[j])
        rings, first = max(rings, at + 1), i + 1
    number, own = np.full((rings, rings), -1), 0
    for a in range(rings):
        if reach[a] ** (2 if k == 2 else 1) > _INSIDE:
            number[a, a], own = own, own + 1
    count = own
    for a in range(rings if k == 2 else 0):
        for b in range(a):
            if with_real[a] and with_real[b] and reach[a] * reach[b] > _INSIDE:
                number[a, b], count = count - own, count + 1
    inner, between = np.full((m, m), -1), np.full((m, m), -1)
    for i in range(m):
        for j in range(m):
            if k < 2 or ring[i] == ring[j]:
                inner[i, j] = number[ring[i], ring[i]]
            else:
                between[i, j] = number[ring[i], ring[j]]
    out = np.empty((motions, 2, count))
    for q in range(motions):
        multiply(mu[q], k, inner, out[q, :, :own])
        if count > own:
            # k is 2: the next one of the four
            multiply(mu[q], k + 1, between, out[q, :, own:])
    return out
