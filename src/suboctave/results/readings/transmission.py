"""What a structure passes on to the ground: the force there, and its ratio to the force applied.

In a rigid translation r no internal force does work, so that the force on the ground along r is that of everything that
holds the structure,

    F(t) = r . (K x + C x' + sum_e d_e f_e),

springs, dampers and elements between degrees of freedom cancelling out by themselves. With the force applied,
`P(t) = r . p(t)`, the transmissibility of harmonic k is `|F_k| / |P_k|`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, ComplexArray, harmonic_index, to_complex
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.trigonometric import peak


def translation(n: int, direction: ArrayLike | None) -> Array:
    """The rigid translation r (n,): all DOFs alike unless told."""
    if direction is None:
        return np.ones(n)
    given: Any = direction
    try:
        r = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        r = np.zeros(0)
    if r.shape != (n,) or not np.all(np.isfinite(r)) or not r.any():
        raise InputError(f"direction must be a vector of {n} finite numbers, not all zero, not {given!r}")
    return r


def ground_and_load(orbit: PeriodicOrbit, r: Array) -> tuple[ComplexArray, ComplexArray]:
    """Complex amplitudes (H + 1,) of the force on the ground and of the force applied, along r."""
    state, balance = orbit.state(), orbit.balance
    if balance.size != balance.system.n:
        raise InputError(
            "the force on the ground needs the motion of the whole structure; this model is condensed onto "
            f"{balance.size} of its {balance.system.n} degrees of freedom"
        )
    _, damping, stiffness = balance.system.matrices(orbit.values)
    rate = 1j * orbit.basis.multiples * orbit.omega
    held = orbit.amplitudes @ (r @ stiffness) + rate * (orbit.amplitudes @ (r @ damping))
    return held + to_complex(state.force) @ r, to_complex(balance.load(orbit.values, orbit.omega)) @ r


def of_harmonic(amplitudes: ComplexArray, k: float, nu: int) -> float:
    """Amplitude at `k omega` of a force or motion with these complex amplitudes; 0 beyond them."""
    index = harmonic_index(k, nu)
    return float(abs(amplitudes[index])) if index < len(amplitudes) else 0.0


def largest(amplitudes: ComplexArray) -> float:
    """Largest modulus over a period."""
    return peak(np.ascontiguousarray(amplitudes), 8 * len(amplitudes))[0]
