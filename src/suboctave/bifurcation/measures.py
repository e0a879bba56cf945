"""How far a motion is from a change: functions along the curve that vanish where something happens, and are smooth.

Single multipliers are no smooth functions along a curve (two that meet part at right angles, like square roots); their
symmetric functions are:

    turn     component of the unit tangent along the free parameter         limit points
    fold     prod_j (1 - mu_j)                                              limit points, branch points
    double   prod_j (1 + mu_j)                                              period doublings
    torus    prod_{i<j} (1 - mu_i mu_j)                                     Neimark-Sacker points (and neutral saddles)

Each factor is divided by a positive one, sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest. Signs
are those of the determinants and of the tangent, which are exact for the equations solved; sizes those of the
multipliers. Values are pairs (sign, logarithm of the modulus): products of many factors leave the range of numbers.
The signs of `fold` (up to a constant along the curve) and of `double` follow from `det J_0` and `det J_half`
(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2, has the three products).
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.harmonic.basis import ComplexArray

#: (sign, logarithm of the modulus)
Value = tuple[float, float]

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9


def fold(mu: ComplexArray) -> float:
    """Logarithm of prod |1 - mu| / sqrt(1 + |mu|^2)."""
    return _log(1.0 - mu, mu)


def double(mu: ComplexArray) -> float:
    """Logarithm of prod |1 + mu| / sqrt(1 + |mu|^2)."""
    return _log(1.0 + mu, mu)


def torus(mu: ComplexArray) -> Value:
    """prod_{i<j} (1 - mu_i mu_j) with its sign; constant for motions without damping, whose pairs never leave the
    circle.
    """
    i, j = np.triu_indices(len(mu), 1)
    products = mu[i] * mu[j]
    with np.errstate(divide="ignore"):
        if abs(float(np.log(np.abs(mu)).sum())) < UNDAMPED:
            return 1.0, 0.0
    factors = 1.0 - products
    # conjugate factors give a positive product: the sign is that of the real ones
    real = np.abs(products.imag) <= 1e-12 * np.abs(products)
    negative = np.count_nonzero(factors.real[real] < 0.0)
    return (-1.0 if negative % 2 else 1.0), _log(factors, products)


def _log(factors: ComplexArray, mu: ComplexArray) -> float:
    with np.errstate(divide="ignore"):
        return float(np.log(np.abs(factors)).sum() - 0.5 * np.log1p(np.abs(mu) ** 2).sum())


def scaled(values: list[Value]) -> list[float]:
    """Values as plain numbers in units of the largest of them."""
    top = max(log for _, log in values)
    if top == -math.inf:
        return [sign * 0.0 for sign, _ in values]
    return [sign * math.exp(log - top) for sign, log in values]
