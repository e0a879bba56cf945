"""How far a motion is from a change: functions along the curve that vanish where something happens, and are smooth.

Single multipliers are no smooth functions along a curve (two that meet part at right angles, like square roots); their
symmetric functions are:

    turn     component of the unit tangent along the free parameter         limit points
    fold     prod_j (1 - mu_j)                                              limit points, branch points
    double   prod_j (1 + mu_j)                                              period doublings
    torus    prod_{i<j} (1 - mu_i mu_j)                                     Neimark-Sacker points (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest. Values are pairs (sign, logarithm of the
modulus): products of many factors leave the range of numbers. `turn` belongs to the equations solved, the others to
the multipliers, whose zeros lie as far from those of `det J_0` and `det J_half` as the harmonics left out make them:
they tell whether something may hide, not what has happened.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.harmonic.basis import ComplexArray

#: (sign, logarithm of the modulus)
Value = tuple[float, float]

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9


def of_multipliers(mu: ComplexArray) -> tuple[Value, Value, Value]:
    """fold, double and torus of multipliers (2 n,).

    `torus` is constant for motions without damping, whose pairs never leave the circle.
    """
    signs, logs = _products(mu)
    return (signs[0], logs[0]), (signs[1], logs[1]), (signs[2], logs[2])


@njit(cache=True)
def _products(mu):
    """Signs and logarithms of the three products. Complex factors come in conjugate pairs: the sign is that of the
    real ones.
    """
    n = mu.shape[0]
    signs = (np.ones(3), np.zeros(3))
    sign, log = signs
    total = 0.0
    for i in range(n):
        size = abs(mu[i])
        total += math.log(size) if size > 0.0 else -np.inf
        half = 0.5 * math.log1p(size * size)
        real = abs(mu[i].imag) <= 1e-12 * size
        for k in range(2):
            factor = 1.0 - mu[i] if k == 0 else 1.0 + mu[i]
            if real and factor.real < 0.0:
                sign[k] = -sign[k]
            log[k] += (math.log(abs(factor)) if abs(factor) > 0.0 else -np.inf) - half
    if abs(total) < UNDAMPED:
        return signs
    for i in range(n):
        for j in range(i + 1, n):
            product = mu[i] * mu[j]
            factor = 1.0 - product
            size = abs(product)
            if abs(product.imag) <= 1e-12 * size and factor.real < 0.0:
                sign[2] = -sign[2]
            log[2] += (math.log(abs(factor)) if abs(factor) > 0.0 else -np.inf) - 0.5 * math.log1p(size * size)
    return signs


def scaled(values: list[Value]) -> list[float]:
    """Values as plain numbers in units of the largest of them."""
    top = max(log for _, log in values)
    if top == -math.inf:
        return [sign * 0.0 for sign, _ in values]
    return [sign * math.exp(log - top) for sign, log in values]
