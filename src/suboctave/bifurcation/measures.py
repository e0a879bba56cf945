"""How far a motion is from a change: functions along the curve that vanish where something happens, and are smooth.

    turn     component of the unit tangent along the free parameter         limit points
    fold     prod_j (1 - mu_j)                                              limit points, branch points
    double   prod_j (1 + mu_j)                                              period doublings
    torus    prod_{i<j} (1 - mu_i mu_j)                                     Neimark-Sacker points (and neutral saddles)

as signs and logarithms of moduli (`floquet.symmetric`). `turn` belongs to the equations solved, the others to the
multipliers, whose zeros lie as far from those of `det J_0` and `det J_half` as the harmonics left out make them: they
tell whether something may hide, not what has happened.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from suboctave.floquet.result import FloquetResult
from suboctave.floquet.symmetric import UNDAMPED
from suboctave.harmonic.basis import Array, ComplexArray

#: imaginary part, as a share of the modulus, up to which a multiplier counts as real
_REAL = 1e-9


def measured(tangent: Array, weights: Array, parameter: int, result: FloquetResult) -> Array:
    """turn, fold, double, torus from the tangent, its scaling, the free parameter's place in it, and the multipliers:
    signs and logarithms of the moduli, shape (2, 4).
    """
    scaled = weights * tangent
    turn = float(scaled[parameter]) / math.sqrt(scaled.dot(scaled))
    out = np.empty((2, 4))
    out[0, 0], out[1, 0] = (1.0 if turn > 0.0 else -1.0), (math.log(abs(turn)) if turn != 0.0 else -math.inf)
    out[:, 1:] = result.symmetric
    return out


def contradicted(result: FloquetResult, integer: float, half: float) -> list[tuple[int, float]]:
    """Multipliers that the signs of det J_0 (`integer`) and det J_half put on the other side of +1 or -1, with their
    distances from there.

    The signs are the parities of the real multipliers beyond +1 and beyond -1. They belong to the harmonics solved for,
    the multipliers to the motion completed by what it lacks: where the parities differ, the nearest one is between.
    """
    mu, contradictions, completed = result.multipliers, [], result.symmetric[0]
    # of multipliers that are not known neither is less than nothing
    for target, solved, of in ((1.0, integer, 0), (-1.0, half, 1)):
        if solved * completed[of] < 0.0 and result.applicable:
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


def neutral(result: FloquetResult) -> FloquetResult:
    """Multipliers of which one is +1 whatever computing it left of that: its error covers the distance."""
    distance, errors = np.abs(result.multipliers - 1.0), result.errors.copy()
    nearest = int(np.argmin(distance))
    errors[nearest] = max(errors[nearest], 2.0 * float(distance[nearest]))
    return replace(result, errors=errors)


def upper(mu: ComplexArray) -> ComplexArray:
    """The complex multipliers of the upper half plane."""
    return mu[mu.imag > _REAL * np.abs(mu)]


def crossing_pair(
    first: ComplexArray, last: ComplexArray, change: int, accounted: int
) -> tuple[complex, complex] | None:
    """The complex pair that crosses the unit circle between two neighbours, by its members in the upper half plane.

    change: of the number of multipliers outside the circle; accounted: how many real ones pass +1 or -1. Where as many
    pairs are complex at both, none has met on the real axis or parted there: those outside tell, if the real ones then
    change by no more than what is accounted for. Elsewhere a real one may have become one of a pair, and a change
    beyond what is accounted for tells alone.
    """
    pairs = [upper(first), upper(last)]
    outside = [mu[np.abs(mu) > 1.0] for mu in pairs]
    more = len(outside[1]) - len(outside[0])
    if len(pairs[0]) == len(pairs[1]) and abs(change - 2 * more) <= accounted:
        leaving = more
    else:
        leaving = change if abs(change) >= accounted + 2 else 0
    with np.errstate(divide="ignore"):
        products = [abs(float(np.log(np.abs(mu)).sum())) for mu in (first, last)]
    # without damping pairs stay on the circle and rounding alone carries them across; of one point alone the product
    # may be one where a pair lies on the circle
    if leaving == 0 or max(products) < UNDAMPED:
        return None
    inner = pairs[0 if leaving > 0 else 1]
    inner, outer = inner[np.abs(inner) <= 1.0], outside[1 if leaving > 0 else 0]
    if not (len(inner) and len(outer)):
        return None
    within, beyond = min(product(inner.tolist(), outer.tolist()), key=lambda pair: abs(pair[0] - pair[1]))
    return (within, beyond) if leaving > 0 else (beyond, within)
