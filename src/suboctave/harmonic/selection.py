"""How many harmonics a motion needs: the energy of the force that the basis neglects.

The element forces of a truncated motion have harmonics beyond the basis. To first order the motion they would excite
is `x_k = -A(k w0)^-1 B(k w0) f_k`; its size relative to the motion is the truncation estimate stated on every orbit.
It is the criterion of Ferri & Leamy (AIAA 2009-2667) carried from forces to displacements, so that it is
dimensionless and weighs what matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.state import BalanceState, length

#: most unknowns that adaptive selection goes to: beyond, the dense matrices cost more than the harmonics are worth
_MOST_UNKNOWNS = 4000
#: numbers of harmonics (of omega) that adaptive selection chooses from
_LADDER = (3, 5, 7, 9, 11, 13, 15, 19, 23, 27, 31, 39, 47, 55, 63, 79, 95, 111, 127, 159, 191, 223, 255)


@dataclass(frozen=True)
class AdaptiveHarmonics:
    """Harmonics chosen at every step so that the neglected part of the motion stays below a tolerance.

    tolerance
        Largest neglected motion relative to the motion along a curve.
    event_tolerance
        The same for located bifurcations, which are solved again with more harmonics.
    minimum, maximum
        Bounds on the highest harmonic of omega; at the maximum the estimate is stated and the curve goes on.
    """

    tolerance: float = 1e-5
    event_tolerance: float = 3e-7
    minimum: int = 5
    maximum: int = 127

    def __post_init__(self) -> None:
        if not (0.0 < self.event_tolerance <= self.tolerance < 0.1):
            raise InputError(
                f"need 0 < event_tolerance <= tolerance < 0.1, got {self.event_tolerance:g} and {self.tolerance:g}"
            )
        if not 1 <= self.minimum <= self.maximum <= _LADDER[-1]:
            raise InputError(
                f"need 1 <= minimum <= maximum <= {_LADDER[-1]} harmonics, got {self.minimum} and {self.maximum}"
            )


def motion_size(state: BalanceState) -> float:
    """Size of a motion with the DOF weights of `HarmonicBalance.scales`."""
    return length(state.x * state.balance.scales()[0])


def truncation(state: BalanceState) -> float:
    """Estimated size of the neglected harmonics relative to the motion."""
    tail, size = state.tails
    return float(tail[state.basis.harmonics]) if size > 0.0 else 0.0


def _ladder(options: AdaptiveHarmonics, state: BalanceState) -> tuple[int, ...]:
    """Numbers of harmonics of omega to choose from."""
    basis = state.basis
    return _rungs(options, basis.harmonics, basis.nu, state.balance.size, state.balance.highest_load)


@lru_cache(maxsize=256)
def _rungs(options: AdaptiveHarmonics, high: int, nu: int, size: int, highest_load: int) -> tuple[int, ...]:
    lowest = max(options.minimum, highest_load)
    most = max(high / nu, min(options.maximum, (_MOST_UNKNOWNS / size - 1) / (2 * nu)))
    return tuple(h for h in _LADDER if lowest <= h <= most) or (max(lowest, high // nu),)


def next_harmonics(state: BalanceState, options: AdaptiveHarmonics) -> HarmonicBasis:
    """A basis with half as many harmonics again, where the options allow it, else the present one."""
    nu, high = state.basis.nu, state.basis.harmonics
    wanted = next((h for h in _ladder(options, state) if h * nu >= 1.5 * high), None)
    return state.basis if wanted is None else HarmonicBasis(wanted * nu, nu)


def _expected(tail: Array, high: int, bound: float) -> float:
    """Harmonic beyond which less than `bound` is left, if the harmonics beyond H go on falling like a power.

    Contacts make them fall like k^-3 or k^-4; smooth laws do so faster than any power.
    """
    middle = (3 * high + 1) // 2
    near, far = tail[high] ** 2 - tail[middle] ** 2, tail[middle] ** 2
    if not near > far > 0.0:
        return 2.0 * high
    # amplitudes k^-p: sums of squares over (H, 3 H / 2] and (3 H / 2, 2 H + 1]
    power = min(40.0, max(2.0, math.log(near / far) / (2.0 * math.log(1.4))))
    slope = 2.0 * power - 1.0
    rest = near / (1.0 - 1.5**-slope)
    return float(high * (rest / bound**2) ** (1.0 / slope))


def choose_harmonics(state: BalanceState, options: AdaptiveHarmonics, tolerance: float) -> HarmonicBasis:
    """The basis a motion needs for a tolerance: the present one where that will do, with some hysteresis."""
    basis = state.basis
    nu, high = basis.nu, basis.harmonics
    tail, size = state.tails
    if size == 0.0:
        return basis
    ladder = _ladder(options, state)

    def sufficient(bound: float) -> int:
        for h in ladder:
            if h * nu < 2 * high and tail[h * nu] <= bound:
                return h
        least = max(2.0 * high, min(_expected(tail, high, bound), 2.5 * high))
        return next((h for h in ladder if h * nu >= least), ladder[-1])

    if tail[high] > tolerance:
        wanted = sufficient(0.5 * tolerance)
        return basis if wanted * nu <= high else HarmonicBasis(wanted * nu, nu)
    wanted = sufficient(0.2 * tolerance)
    return HarmonicBasis(wanted * nu, nu) if wanted * nu < high else basis
