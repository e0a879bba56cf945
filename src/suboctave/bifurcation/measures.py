"""How far a motion is from a change: functions along the curve that vanish where something happens, and are smooth.

Single multipliers are no smooth functions along a curve (two that meet part at right angles, like square roots); their
symmetric functions are:

    turn     component of the unit tangent along the free parameter         limit points
    fold     prod_j (1 - mu_j)                                              limit points, branch points
    double   prod_j (1 + mu_j)                                              period doublings
    torus    prod_{i<j} (1 - mu_i mu_j)                                     Neimark-Sacker points (and neutral saddles)

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., section 10.2). Each factor is divided by a positive one,
sqrt(1 + |mu|^2), that keeps large multipliers from drowning the rest. Values are kept as signs and logarithms
of moduli: products of many factors leave the range of numbers. `turn` belongs to the equations solved, the others to
the multipliers, whose zeros lie as far from those of `det J_0` and `det J_half` as the harmonics left out make them:
they tell whether something may hide, not what has happened.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from suboctave.continuation.linear import Factor
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState

#: sum of the logarithms of all multipliers, `-int trace(M^-1 (C + f_v)) dt`, below which a motion counts as undamped
UNDAMPED = 1e-9
_ONE = np.ones(1)


def measured(tangent: Array, weights: Array, parameter: int, mu: ComplexArray) -> Array:
    """turn, fold, double, torus from the tangent, its scaling, the free parameter's place in it, and the multipliers
    (2 n,): signs and logarithms of the moduli, shape (2, 4).

    `torus` is constant for motions without damping, whose pairs never leave the circle.
    """
    scaled = weights * tangent
    turn = float(scaled[parameter]) / math.sqrt(scaled.dot(scaled))
    first, second = _pairs(len(mu))
    with np.errstate(all="ignore"):
        damped = abs(float(np.log(np.abs(mu)).sum())) >= UNDAMPED
        products = (
            (1.0 if turn > 0.0 else -1.0, math.log(abs(turn)) if turn != 0.0 else -math.inf),
            _product(1.0 - mu, mu),
            _product(1.0 + mu, mu),
            _product(1.0 - mu[first] * mu[second], mu[first] * mu[second]) if damped else (1.0, 0.0),
        )
    return np.array(products).T


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[np.ndarray, ...]:
    """All pairs of so many multipliers, as their first and second members."""
    return np.triu_indices(count, 1)


def _product(factors: ComplexArray, of: ComplexArray) -> tuple[float, float]:
    """Sign and logarithm of the product of `factors / sqrt(1 + |of|^2)`.

    Complex factors come in conjugate pairs: the sign is that of the real ones.
    """
    size = np.abs(of)
    negative = (np.abs(of.imag) <= 1e-12 * size) & (factors.real < 0.0)
    log = np.log(np.abs(factors)) - 0.5 * np.log1p(size * size)
    return (-1.0 if np.count_nonzero(negative) % 2 else 1.0), float(log.sum())


def torus(mu: ComplexArray) -> Array:
    """torus alone, of any multipliers: sign and logarithm of the modulus, (2,)."""
    column: Array = measured(_ONE, _ONE, 0, mu)[:, 3]
    return column


def fold(mu: ComplexArray) -> float:
    """fold alone, of any multipliers."""
    sign, log = measured(_ONE, _ONE, 0, mu)[:, 1]
    return float(sign * math.exp(log))


def contradicted(result: FloquetResult, integer: float, half: float) -> list[tuple[int, float]]:
    """Multipliers that the signs of det J_0 (`integer`) and det J_half put on the other side of +1 or -1, with their
    distances from there.

    The signs are the parities of the real multipliers beyond +1 and beyond -1. They belong to the harmonics solved for,
    the multipliers to the motion completed by what it lacks: where the parities differ, the nearest one is between.
    """
    if not result.applicable:
        return []
    mu, contradictions = result.multipliers, []
    sign = measured(_ONE, _ONE, 0, mu)[0]
    for target, solved, completed in ((1.0, integer, sign[1]), (-1.0, half, sign[2])):
        if solved * completed < 0.0:
            real = np.abs(mu.imag) <= 1e-12 * np.abs(mu)
            distance = np.where(real | ~real.any(), np.abs(mu - target), np.inf)
            nearest = int(np.argmin(distance))
            contradictions.append((nearest, float(distance[nearest])))
    return contradictions


def in_doubt(result: FloquetResult, integer: float, half: float) -> FloquetResult:
    """Multipliers whose errors cover what the signs of det J_0 (`integer`) and det J_half say of them."""
    contradictions = contradicted(result, integer, half)
    if not contradictions:
        return result
    errors = result.errors.copy()
    for which, distance in contradictions:
        errors[which] = max(errors[which], 2.0 * distance)
    return replace(result, errors=errors)


def fold_sign(state: BalanceState) -> float:
    """Sign of det J_0."""
    return Factor.of(state.jacobian.T).sign


def half_sign(state: BalanceState) -> float:
    """Sign of det J_half."""
    # the transpose has the same determinant, and lies in memory as LAPACK wants it
    return Factor.of(state.half_jacobian.T).sign
