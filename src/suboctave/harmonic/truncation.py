"""How many harmonics a motion needs: the energy of the force that the basis neglects.

The element forces of a truncated motion have harmonics beyond the basis. To first order the motion they would excite
is `x_k = -A(k w0)^-1 B(k w0) f_k`; its size relative to the motion is the truncation estimate stated on every orbit.
It is the criterion of Ferri & Leamy (AIAA 2009-2667) carried from forces to displacements, so that it is
dimensionless and weighs what matters.

The harmonics k of a motion of nu load periods fall into classes by gcd(k, nu): those of the load, those that came with
the first doubling, with the second, and so on. All end at the same frequency: the place at which the motion was born
depends on it, since the equations within the youngest class are those of its parent's J_half there.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from suboctave.arguments import Count, Positive, checked
from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance, length

#: most unknowns that adaptive selection goes to: beyond, the dense matrices cost more than the harmonics are worth
_MOST_UNKNOWNS = 4000
#: numbers of harmonics (of omega) that adaptive selection chooses from; those that only a user asks for
_HIGH = (319, 383, 447, 511)
_LADDER = (3, 5, 7, 9, 11, 13, 15, 19, 23, 27, 31, 39, 47, 55, 63, 79, 95, 111, 127, 159, 191, 223, 255, *_HIGH)
MOST_HARMONICS = _LADDER[-1]
#: most harmonics of omega where nobody says how many
_USUAL = 127
#: unknowns up to which twice as many are taken where those do not suffice, of a curve and of one bifurcation:
#: factorisations of some milliseconds at every iteration, of some ten at a few
_FEW_UNKNOWNS, _FOR_ONE = 511, 1023
#: ratio of neighbouring highest harmonics for sub-harmonic motions, whose steps need not be whole multiples of omega
_FINER = 1.05
#: share of a class of harmonics in the motion below which what is neglected of it counts as if it had that share, and
#: that below which there is none
_OWN, _NONE = 0.01, 1e-9
#: share of the tolerance that a new choice for sub-harmonic motions aims at
_AIM = 0.6


@checked(methods=False)
@dataclass(frozen=True)
class AdaptiveHarmonics:
    """Harmonics chosen at every step so that the neglected part of the motion stays below a tolerance.

    tolerance
        Largest neglected motion relative to the motion along a curve.
    event_tolerance
        The same for located bifurcations, which are solved again with more harmonics.
    minimum, maximum
        Bounds on the highest harmonic of omega; at the maximum the estimate is stated and the curve goes on. None: 127,
        and up to 255 where so many do not suffice and the unknowns are few.
    """

    tolerance: Positive = 1e-5
    event_tolerance: Positive = 3e-7
    minimum: Count = 5
    maximum: Count | None = None

    def __post_init__(self) -> None:
        if not (self.event_tolerance <= self.tolerance < 0.1):
            raise InputError(
                f"need 0 < event_tolerance <= tolerance < 0.1, got {self.event_tolerance:g} and {self.tolerance:g}"
            )
        if not self.minimum <= self.usual <= _LADDER[-1]:
            raise InputError(
                f"need 1 <= minimum <= maximum <= {_LADDER[-1]} harmonics, got {self.minimum} and {self.usual}"
            )

    @property
    def usual(self) -> int:
        """Most harmonics of omega that the tolerances ask for."""
        return max(self.minimum, _USUAL) if self.maximum is None else self.maximum


def motion_size(state: BalanceState) -> float:
    """Size of a motion with the DOF weights of `HarmonicBalance.scales`."""
    return length(state.x * state.balance.scales[0])


def truncation(state: BalanceState) -> float:
    """Estimated size of the neglected harmonics relative to the motion."""
    return float(state.tails[0][state.basis.harmonics])


def _limits(options: AdaptiveHarmonics, state: BalanceState) -> tuple[int, float]:
    """Fewest and most harmonics of omega that may be chosen."""
    basis, balance = state.basis, state.balance
    affordable = (_MOST_UNKNOWNS / balance.size - 1) / (2 * basis.nu)
    return max(options.minimum, balance.highest_load), max(basis.harmonics / basis.nu, min(options.usual, affordable))


def most_harmonics(state: BalanceState, options: AdaptiveHarmonics) -> int:
    """Most multiples of the base frequency that may be chosen for a motion."""
    return int(_limits(options, state)[1] * state.basis.nu)


@lru_cache(maxsize=256)
def _rungs(lowest: int, most: float, otherwise: int) -> tuple[int, ...]:
    """Numbers of harmonics of omega to choose from."""
    return tuple(h for h in _LADDER if lowest <= h <= most) or (max(lowest, otherwise),)


def next_harmonics(state: BalanceState, options: AdaptiveHarmonics) -> HarmonicBasis:
    """A basis with half as many harmonics again, or as many as the options allow; the present one where that is not
    more.
    """
    nu, high = state.basis.nu, state.basis.harmonics
    rungs = _rungs(*_limits(options, state), high // nu)
    wanted = next((h for h in rungs if h * nu >= 1.5 * high), rungs[-1])
    return HarmonicBasis(wanted * nu, nu) if wanted * nu > high else state.basis


def beyond_usual(state: BalanceState, options: AdaptiveHarmonics, one: bool = False) -> HarmonicBasis:
    """A basis with twice as many harmonics as a curve has as a rule, for a motion that these leave out more of than the
    tolerance; the present one where they suffice, where the user gave the most, and where the unknowns are too many.
    one: for a single motion, not a curve.
    """
    basis = state.basis
    wanted = HarmonicBasis((2 * _USUAL + 1) * basis.nu, basis.nu)
    few = state.balance.size * wanted.size <= (_FOR_ONE if one else _FEW_UNKNOWNS)
    lacking = basis.harmonics < wanted.harmonics and truncation(state) > options.tolerance
    return wanted if options.maximum is None and few and lacking else basis


def holding(balance: HarmonicBalance, spectrum: ComplexArray, options: AdaptiveHarmonics) -> HarmonicBasis:
    """The basis that holds a motion known in time by its harmonics (K + 1, size): those left out are smaller than the
    tolerance, unless there may be no more.
    """
    nu = balance.basis.nu
    twice = 2 * _USUAL + 1
    few = options.maximum is None and balance.size * (2 * twice * nu + 1) <= _FEW_UNKNOWNS
    most = twice if few else min(options.usual, (_MOST_UNKNOWNS / balance.size - 1) / (2 * nu))
    sizes = np.linalg.norm(spectrum * balance.scales[0], axis=1)
    left_out = np.sqrt(np.cumsum(sizes[::-1] ** 2))[::-1]
    rungs = _rungs(max(options.minimum, balance.highest_load), most, options.usual)
    enough = (h for h in rungs if h * nu + 1 >= len(sizes) or left_out[h * nu + 1] <= options.tolerance * left_out[0])
    return HarmonicBasis(next(enough, rungs[-1]) * nu, nu)


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
    if basis.nu > 1:
        return _of_subharmonics(state, options, tolerance)
    high = basis.harmonics
    tail, size = state.tails
    if size == 0.0:
        return basis
    ladder = _rungs(*_limits(options, state), high)

    def sufficient(bound: float) -> int:
        for h in ladder:
            if h < 2 * high and tail[h] <= bound:
                return h
        least = max(2.0 * high, min(_expected(tail, high, bound), 2.5 * high))
        return next((h for h in ladder if h >= least), ladder[-1])

    if tail[high] > tolerance:
        wanted = sufficient(0.5 * tolerance)
        return basis if wanted <= high else HarmonicBasis(wanted)
    fewer = bisect_left(ladder, high) - 1
    if fewer < 0 or tail[ladder[fewer]] > 0.2 * tolerance:
        return basis
    wanted = sufficient(0.2 * tolerance)
    return HarmonicBasis(wanted) if wanted < high else basis


@lru_cache(maxsize=256)
def _fine_rungs(nu: int, lowest: int, most: float, high: int) -> tuple[int, ...]:
    rungs = sorted({round(nu * _LADDER[0] * _FINER**i) for i in range(100)})
    return tuple(r for r in rungs if lowest * nu <= r <= most * nu) or (max(lowest * nu, high),)


def _of_subharmonics(state: BalanceState, options: AdaptiveHarmonics, tolerance: float) -> HarmonicBasis:
    """`choose_harmonics` for motions of several load periods."""
    basis, high, nu = state.basis, state.basis.harmonics, state.basis.nu
    beyond = _class_tails(state)
    if beyond is None:
        return basis
    total = np.sqrt(np.sum(beyond**2, axis=0))
    rungs = _fine_rungs(nu, *_limits(options, state), high)
    lacking = total[high] > tolerance
    if not lacking and total[int(0.9 * high)] > _AIM * tolerance:
        return basis
    wanted = _needed(beyond, total, high, _AIM * tolerance, rungs)
    better = wanted > high if lacking else 2 * wanted + 1 < 0.9 * basis.size
    return HarmonicBasis(wanted, nu) if better else basis


def _class_tails(state: BalanceState) -> Array | None:
    """What each class of harmonics has beyond k = 0 .. 2 H + 1 relative to the motion, (classes, 2 H + 2), of a small
    one relative to itself; None at rest.
    """
    nu, squares = state.basis.nu, state.squares
    size = float(squares[: state.basis.harmonics + 1].sum())
    if size == 0.0:
        return None
    divisor = np.gcd(np.arange(len(squares)), nu)
    classes = np.array([np.where(divisor == d, squares, 0.0) for d in range(1, nu + 1) if nu % d == 0])
    sums = np.cumsum(classes[:, ::-1], axis=1)[:, ::-1] / size
    tails: Array = np.sqrt(np.column_stack((sums[:, 1:], np.zeros(len(sums)))))
    shares = np.sqrt(classes[:, : state.basis.harmonics + 1].sum(axis=1) / size)
    # what decides where a class is born is what it lacks of itself
    weights = np.where(shares > _NONE, np.maximum(1.0, _OWN / np.maximum(shares, _NONE)), 1.0)
    return tails * weights[:, None]


def _needed(beyond: Array, total: Array, high: int, bound: float, rungs: tuple[int, ...]) -> int:
    """Highest harmonic beyond which less than `bound` is neglected in all, by the tails of all classes."""

    def rung(end: int) -> int:
        return rungs[min(bisect_left(rungs, end), len(rungs) - 1)]

    share = bound
    while True:
        ends = [min(2 * high, rung(int(np.argmax(b <= share)))) for b in beyond]
        neglected = math.hypot(*[float(b[end]) for b, end in zip(beyond, ends, strict=True)])
        if neglected <= bound or share < bound / math.sqrt(len(beyond)):
            break
        share *= 0.9
    end = max(ends)
    if end >= 2 * high:
        end = round(max(2 * high, min(_expected(total, high, bound), 2.5 * high)))
    return rung(end)
