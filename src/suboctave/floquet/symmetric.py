"""Symmetric functions of the multipliers, smooth along a curve where single multipliers are not.

Two multipliers that meet part at right angles, like square roots; but these are as smooth as the monodromy matrix:

    fold     prod_j (1 - mu_j)                 a multiplier passes +1
    double   prod_j (1 + mu_j)                 a multiplier passes -1
    torus    prod_{i<j} (1 - mu_i mu_j)        a pair leaves the circle (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest.
"""

from __future__ import annotations

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9
#: squares of products beyond which a factor is one to rounding
_LARGE = 1e280


def symmetric_functions(mu: ComplexArray) -> Array:
    """fold, double, torus of multipliers (m,): signs and logarithms of the moduli, shape (2, 3); products of many
    factors leave the range of numbers.

    `torus` is constant for motions without damping, whose pairs never leave the circle. Complex factors come in
    conjugate pairs: the sign is that of the real ones.
    """
    out = np.empty((2, 3))
    multiply(mu, out)
    return out


@kernel()
def multiply(mu, out):
    """`symmetric_functions` into (2, 3)."""
    m, total = mu.shape[0], 0.0
    for i in range(m):
        total += np.log(np.abs(mu[i]))
    for k in range(3):
        sign, logarithm, product = 1.0, 0.0, 1.0
        for i in range(m if k < 2 or abs(total) >= UNDAMPED else 0):
            for j in range(i if k == 2 else 1):
                of = mu[i] * mu[j] if k == 2 else mu[i]
                real, size = (1.0 + of.real if k == 1 else 1.0 - of.real), of.real**2 + of.imag**2
                if real < 0.0 and of.imag**2 <= 1e-24 * size:
                    sign = -sign
                if size < _LARGE:
                    product *= (real * real + of.imag**2) / (1.0 + size)
                if not 1.0 / _LARGE < product < _LARGE:
                    # one logarithm for many factors
                    logarithm += np.log(product)
                    product = 1.0
        out[0, k], out[1, k] = sign, 0.5 * (logarithm + np.log(product))
