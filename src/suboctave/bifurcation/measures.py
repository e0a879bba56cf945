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

import numpy as np

from suboctave.compiled import kernel
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
    out = np.empty((2, 4))
    _measure(tangent, weights, parameter, mu, out)
    return out


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


@kernel()
def _measure(tangent, weights, parameter, mu, out):
    """Complex factors come in conjugate pairs: the sign is that of the real ones."""
    n = mu.shape[0]
    sign, log = out[0], out[1]
    size = 0.0
    for i in range(tangent.shape[0]):
        size += (weights[i] * tangent[i]) ** 2
    turn = weights[parameter] * tangent[parameter] / math.sqrt(size)
    sign[0] = 1.0 if turn > 0.0 else -1.0
    log[0] = math.log(abs(turn)) if turn != 0.0 else -np.inf
    for k in range(1, 4):
        sign[k] = 1.0
        log[k] = 0.0
    total = 0.0
    for i in range(n):
        size = abs(mu[i])
        total += math.log(size) if size > 0.0 else -np.inf
        half = 0.5 * math.log1p(size * size)
        real = abs(mu[i].imag) <= 1e-12 * size
        for k in range(1, 3):
            factor = 1.0 - mu[i] if k == 1 else 1.0 + mu[i]
            if real and factor.real < 0.0:
                sign[k] = -sign[k]
            log[k] += (math.log(abs(factor)) if abs(factor) > 0.0 else -np.inf) - half
    if abs(total) < UNDAMPED:
        return
    for i in range(n):
        for j in range(i + 1, n):
            product = mu[i] * mu[j]
            factor = 1.0 - product
            size = abs(product)
            if abs(product.imag) <= 1e-12 * size and factor.real < 0.0:
                sign[3] = -sign[3]
            log[3] += (math.log(abs(factor)) if abs(factor) > 0.0 else -np.inf) - 0.5 * math.log1p(size * size)
