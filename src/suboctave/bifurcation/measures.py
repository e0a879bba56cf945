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

from suboctave.harmonic.basis import ComplexArray

#: (sign, logarithm of the modulus)
Value = tuple[float, float]

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9


def fold(mu: ComplexArray) -> Value:
    """prod (1 - mu) / sqrt(1 + |mu|^2)."""
    return _product(1.0 - mu, mu)


def double(mu: ComplexArray) -> Value:
    """prod (1 + mu) / sqrt(1 + |mu|^2)."""
    return _product(1.0 + mu, mu)


def torus(mu: ComplexArray) -> Value:
    """prod_{i<j} (1 - mu_i mu_j) with its sign; constant for motions without damping, whose pairs never leave the
    circle.
    """
    i, j = np.triu_indices(len(mu), 1)
    products = mu[i] * mu[j]
    with np.errstate(divide="ignore"):
        if abs(float(np.log(np.abs(mu)).sum())) < UNDAMPED:
            return 1.0, 0.0
    return _product(1.0 - products, products)


def _product(factors: ComplexArray, mu: ComplexArray) -> Value:
    """Complex factors come in conjugate pairs: the sign is that of the real ones."""
    with np.errstate(divide="ignore"):
        log = float(np.log(np.abs(factors)).sum() - 0.5 * np.log1p(np.abs(mu) ** 2).sum())
    real = np.abs(mu.imag) <= 1e-12 * np.abs(mu)
    negative = np.count_nonzero(factors.real[real] < 0.0)
    return (-1.0 if negative % 2 else 1.0), log


def scaled(values: list[Value]) -> list[float]:
    """Values as plain numbers in units of the largest of them."""
    top = max(log for _, log in values)
    if top == -math.inf:
        return [sign * 0.0 for sign, _ in values]
    return [sign * math.exp(log - top) for sign, log in values]
