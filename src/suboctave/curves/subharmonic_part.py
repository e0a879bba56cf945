"""The parts of a motion that its period multiplications have brought about, along a curve of bifurcations.

With x written by harmonics of omega/nu, those that a prime factor of nu does not divide would not be there if the
motion repeated earlier by that factor.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from suboctave.continuation import CurvePoint
from suboctave.continuation.problem import Array
from suboctave.curves.motion import MotionProblem
from suboctave.harmonic.orbit import PeriodicOrbit

#: sub-harmonic share of a motion that is none any more
NOTHING_LEFT = 1e-5


def keeps_subharmonics(a: CurvePoint, b: CurvePoint) -> bool:
    """False if the sub-harmonic part of a motion may have vanished between two neighbours."""
    curve = b.curve
    assert isinstance(curve, MotionProblem)
    if curve.balance.basis.nu == 1 or subharmonic_share(curve, b.u) <= NOTHING_LEFT:
        return True
    before = parts_of(curve, curve.transfer(a.u, a.curve))
    return all(float(p @ q) >= 0.25 * float(p @ p) for p, q in zip(before, parts_of(curve, b.u), strict=True))


def subharmonic_share(curve: MotionProblem, u: Array) -> float:
    """Smallest share of a motion that one of its period multiplications has brought about."""
    return min(float(np.linalg.norm(part)) for part in parts_of(curve, u)) / (curve.size(u) or 1.0)


def parts_of(curve: MotionProblem, u: Array) -> list[Array]:
    """Harmonics that the motion would not have if it repeated earlier: one array for each prime factor of nu."""
    basis = curve.balance.basis
    nu = basis.nu
    x = u[: curve.balance.dimension].reshape(basis.size, -1) * curve.balance.scales()[0]
    return [x[rows].ravel() for rows in _rows_of_parts(nu, basis.harmonics)]


def repeats_earlier(orbit: PeriodicOrbit) -> bool:
    """Whether a motion repeats after a part of the period that it is written with."""
    basis, scales = orbit.basis, orbit.balance.scales()[0]
    x = orbit.coefficients.reshape(basis.size, -1) * scales
    least = min((float(np.linalg.norm(x[rows])) for rows in _rows_of_parts(basis.nu, basis.harmonics)), default=np.inf)
    return least <= NOTHING_LEFT * float(np.linalg.norm(x))


@lru_cache(maxsize=64)
def _rows_of_parts(nu: int, harmonics: int) -> list[np.ndarray]:
    k = np.append(0, np.repeat(np.arange(1, harmonics + 1), 2))
    primes = [d for d in range(2, nu + 1) if nu % d == 0 and all(d % e for e in range(2, math.isqrt(d) + 1))]
    return [np.flatnonzero(k % prime) for prime in primes]


def doubled_size(curve: MotionProblem, u: Array) -> float:
    """Size of the doubled part of a motion, nu even."""
    return float(np.linalg.norm(parts_of(curve, u)[0]))
