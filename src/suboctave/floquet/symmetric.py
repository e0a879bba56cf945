"""Symmetric functions of the multipliers, smooth along a curve where single multipliers are not.

Two multipliers that meet part at right angles, like square roots; but these are as smooth as the monodromy matrix:

    fold     prod_j (1 - mu_j)                 a multiplier passes +1
    double   prod_j (1 + mu_j)                 a multiplier passes -1
    torus    prod_{i<j} (1 - mu_i mu_j)        a pair leaves the circle (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9


def symmetric_functions(mu: ComplexArray) -> Array:
    """fold, double, torus of multipliers (m,): signs and logarithms of the moduli, shape (2, 3); products of many
    factors leave the range of numbers.

    `torus` is constant for motions without damping, whose pairs never leave the circle. Complex factors come in
    conjugate pairs: the sign is that of the real ones.
    """
    m, (first, second) = len(mu), _pairs(len(mu))
    of = np.concatenate((mu, mu, mu[first] * mu[second]))
    factors = 1.0 - of
    factors[m : 2 * m] = 1.0 + mu
    size = np.abs(of)
    negative = (np.abs(of.imag) <= 1e-12 * size) & (factors.real < 0.0)
    with np.errstate(all="ignore"):
        logs = np.log(np.abs(factors)) - 0.5 * np.log1p(size * size)
        damped = abs(np.log(size[:m]).sum()) >= UNDAMPED
    out = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    for k in range(3 if damped else 2):
        part = slice(k * m, (k + 1) * m if k < 2 else None)
        out[0, k] = -1.0 if np.count_nonzero(negative[part]) % 2 else 1.0
        out[1, k] = logs[part].sum()
    return out


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[np.ndarray, ...]:
    """All pairs of so many multipliers, as their first and second members."""
    return np.triu_indices(count, 1)
