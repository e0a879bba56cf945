"""How many harmonics a motion needs: the energy of the force that the basis neglects.

The element forces of a truncated motion have harmonics beyond the basis. To first order the motion they would excite
is `x_k = -A(k w0)^-1 B(k w0) f_k`; its size relative to the motion is the truncation estimate stated on every orbit.
It is the criterion of Ferri & Leamy (AIAA 2009-2667) carried from forces to displacements, so that it is
dimensionless and weighs what matters.

The harmonics k of a motion of nu load periods fall into classes by gcd(k, nu): those of the load, those that came with
the first doubling, with the second, and so on. In a cascade each class is smaller than the one before, and a share of
it
will do; `choose_harmonics` may give every class an end of its own. What must not be lost with the harmonics that are
left out:

- the place at which the motion was born. At a period doubling of its parent the youngest class vanishes, and the
  equations within it are those of the parent's J_half. The errors of both cancel in part if they end at the same
  frequency; one class that is shorter moves the birth, and the whole branch with it, by ten times as much as fewer
  harmonics of all classes do. So nothing is left out while a class is small beside one that it doubles, and later only
  what a class itself does not miss;
- symmetries that may break. The even harmonics of a symmetric motion are empty, but J_0 sees the branch point at which
  they appear only if they are among its unknowns. So an empty class is a young one, the load's included (2T motions of
  parametric excitation have odd multiples only), and motions of the load's period keep all harmonics;
- what leaves the branch by a further doubling: J_half always has all frequencies.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from suboctave.compiled import kernel
from suboctave.errors import InputError, check_numbers
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.harmonic.state import BalanceState, length
from suboctave.lazy import lazy

#: most unknowns that adaptive selection goes to: beyond, the dense matrices cost more than the harmonics are worth
_MOST_UNKNOWNS = 4000
#: numbers of harmonics (of omega) that adaptive selection chooses from
_LADDER = (3, 5, 7, 9, 11, 13, 15, 19, 23, 27, 31, 39, 47, 55, 63, 79, 95, 111, 127, 159, 191, 223, 255)
#: ratio of neighbouring highest harmonics for sub-harmonic motions, whose steps need not be whole multiples of omega
_FINER = 1.05
#: what a class of sub-harmonics may lack in units of itself
_OF_ITSELF = 3e-4
#: size of a class in units of the one that it doubles, below which it is young and all harmonics are kept
_YOUNG = 0.05
#: share of the tolerance that a new choice for sub-harmonic motions aims at
_AIM = 0.6
#: least end of a class in units of the highest harmonic
_SHARE = 1.0 / 3.0


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
        check_numbers(**vars(self))
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
    if size == 0.0:
        return 0.0
    beyond = float(tail[state.basis.harmonics])
    if state.basis.kept is None:
        return beyond
    return math.hypot(beyond, _modulus(state.left_out * state.balance.scales()[0]) / size)


def _modulus(amplitudes: ComplexArray) -> float:
    return float(np.linalg.norm(amplitudes))


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
    """A basis with half as many harmonics again, where the options allow it, else the present ones;
    none of them left out.
    """
    nu, high = state.basis.nu, state.basis.harmonics
    wanted = next((h for h in _ladder(options, state) if h * nu >= 1.5 * high), None)
    return state.basis.filled if wanted is None else HarmonicBasis(wanted * nu, nu)


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


def choose_harmonics(
    state: BalanceState, options: AdaptiveHarmonics, tolerance: float, dropping: bool = False
) -> HarmonicBasis:
    """The basis a motion needs for a tolerance: the present one where that will do, with some hysteresis.

    dropping
        Whether harmonics of sub-harmonic motions may be left out below the highest.
    """
    basis = state.basis
    if basis.nu > 1:
        return _Classes(state, options).chosen(tolerance, dropping)
    high = basis.harmonics
    tail, size = state.tails
    if size == 0.0:
        return basis
    ladder = _ladder(options, state)

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


@dataclass(frozen=True)
class _Parts:
    """The harmonics k = 0 .. 2 H + 1 of a basis by gcd(k, nu): nu for the mean and the harmonics of the load.

    owner
        The place of each one's divisor among them, (2 H + 2,).
    ends
        Where each class ends: before the first of its harmonics that is missing.
    cut
        Whether a class misses harmonics below the highest, (divisors,).
    """

    divisors: tuple[int, ...]
    owner: NDArray[np.int64]
    ends: tuple[int, ...]
    cut: np.ndarray


@lru_cache(maxsize=256)
def _parts_of(basis: HarmonicBasis) -> _Parts:
    nu, high = basis.nu, basis.harmonics
    divisor = np.gcd(np.arange(2 * high + 2), nu)
    divisors = tuple(d for d in range(1, nu + 1) if nu % d == 0)
    owner = np.searchsorted(divisors, divisor)
    masks = [owner == i for i in range(len(divisors))]
    missing = np.arange(2 * high + 2) > high
    missing[basis.left_out] = True
    ends = tuple(int(np.flatnonzero(missing & mask)[0]) - 1 for mask in masks)
    cut = np.array([mask[basis.left_out].any() for mask in masks])
    return _Parts(divisors, owner, ends, cut)


@lru_cache(maxsize=256)
def _fine_rungs(nu: int, lowest: float, most: float) -> tuple[int, ...]:
    rungs = sorted({round(nu * _LADDER[0] * _FINER**i) for i in range(100)})
    return tuple(r for r in rungs if lowest <= r <= most)


@kernel()
def _rests(x, beyond, weight, owner, rest):
    """What each class of a motion's harmonics has from k on, k = 0 .. 2 H + 2, relative to the motion, into `rest`
    (divisors, 2 H + 3); returns the motion's size.

    x (2 H + 1, n): coefficients; beyond (H + 1, n): complex amplitudes from H + 1 on; weight (n,); owner: see `_Parts`.
    """
    rows, n = x.shape
    high = rows // 2
    squares = np.zeros(2 * high + 2)
    for i in range(n):
        w = weight[i] * weight[i]
        squares[0] += w * x[0, i] * x[0, i]
        for k in range(1, high + 1):
            squares[k] += w * (x[2 * k - 1, i] * x[2 * k - 1, i] + x[2 * k, i] * x[2 * k, i])
        for k in range(high + 1):
            a, b = beyond[k, i].real, beyond[k, i].imag
            squares[high + 1 + k] += w * (a * a + b * b)
    size = 0.0
    for k in range(high + 1):
        size += squares[k]
    scale = 1.0 / size if size > 0.0 else 1.0
    for d in range(rest.shape[0]):
        total = 0.0
        rest[d, 2 * high + 2] = 0.0
        for k in range(2 * high + 1, -1, -1):
            if owner[k] == d:
                total += squares[k] * scale
            rest[d, k] = math.sqrt(total)
    return math.sqrt(size)


class _Classes:
    """The harmonics of a sub-harmonic motion by gcd(k, nu), with what is left of each class beyond every harmonic."""

    def __init__(self, state: BalanceState, options: AdaptiveHarmonics) -> None:
        self.basis = basis = state.basis
        nu, high = basis.nu, basis.harmonics
        parts = _parts_of(basis)
        self.divisors, self.ends, self.cut = parts.divisors, parts.ends, parts.cut
        x = state.x if basis.kept is None else state.completed.x[: basis.size]
        rest = np.empty((len(parts.divisors), 2 * high + 3))
        self.size = _rests(x, state.neglected, state.balance.scales()[0], parts.owner, rest)
        #: size of each class, and of what it has beyond k, relative to the motion
        self.whole, self.beyond = rest[:, 0], rest[:, 1:]
        lowest = max(options.minimum, state.balance.highest_load)
        most = max(high / nu, min(options.maximum, (_MOST_UNKNOWNS / state.balance.size - 1) / (2 * nu)))
        self.rungs = _fine_rungs(nu, lowest * nu, most * nu) or (max(lowest * nu, high),)

    def chosen(self, tolerance: float, dropping: bool) -> HarmonicBasis:
        """See `choose_harmonics`."""
        if self.size == 0.0:
            return self.basis
        filling = self.basis.kept is not None and not dropping
        if filling or self._lack(tolerance):
            wanted = self._needed(_AIM * tolerance)
            return self._with([max(pair) for pair in zip(wanted, self.ends, strict=True)], dropping)
        close = int(0.9 * self.basis.harmonics)
        if not dropping and math.hypot(*self.beyond[:, close].tolist()) > _AIM * tolerance:
            return self.basis
        fewer = self._with(self._needed(_AIM * tolerance), dropping)
        return fewer if fewer.count < 0.9 * self.basis.count else self.basis

    def _lack(self, tolerance: float) -> bool:
        """Whether the present harmonics are too few, in all or in a class that is cut short."""
        lacking = self.beyond[np.arange(len(self.ends)), self.ends]
        if math.hypot(*lacking.tolist()) > tolerance:
            return True
        if self.basis.kept is None:
            return False
        return self._youngest < _YOUNG or bool(np.any(self.cut & (lacking > 2.0 * _OF_ITSELF * self.whole)))

    def _needed(self, bound: float) -> list[int]:
        """Where each class has to end for less than `bound` to be neglected in all."""
        double, share = 2 * self.basis.harmonics, bound
        while True:
            least = [min(double, self._rung(int(np.argmax(b <= share)))) for b in self.beyond]
            left = math.hypot(*[float(b[end]) for b, end in zip(self.beyond, least, strict=True)])
            if left <= bound or share < bound / math.sqrt(len(self.divisors)):
                break
            share *= 0.9
        high = max(least)
        if high >= double:
            total = np.sqrt(np.sum(self.beyond**2, axis=0))
            high = round(max(double, min(_expected(total, self.basis.harmonics, bound), 1.25 * double)))
        high = self._rung(high)
        # some way from where they would have to be filled again
        if self._youngest < 1.5 * _YOUNG:
            return [high] * len(least)
        found = []
        for end, b, whole in zip(least, self.beyond, self.whole, strict=True):
            end = max(end, int(np.argmax(b <= _OF_ITSELF * whole)), round(_SHARE * high))
            found.append(min(high, self._rung(end)))
        return found

    @lazy
    def _youngest(self) -> float:
        """The least size of a class in units of one whose period it multiplies, or of the load's in units of any."""
        sizes = dict(zip(self.divisors, self.whole, strict=True))
        pairs = [(d, m) for d in self.divisors for m in self.divisors if m % d == 0 and _is_prime(m // d)]
        ages = [sizes[d] / sizes[m] for d, m in pairs if sizes[m] > 0.0]
        return float(min(ages + [sizes[self.basis.nu] / max(sizes.values())]))

    def _rung(self, end: int) -> int:
        return self.rungs[min(bisect_left(self.rungs, end), len(self.rungs) - 1)]

    def _with(self, ends: list[int], dropping: bool) -> HarmonicBasis:
        """The basis whose classes end there, those of the load not before the highest one that is loaded."""
        high, nu = max(ends), self.basis.nu
        if not dropping:
            return HarmonicBasis(high, nu)
        end = dict(zip(self.divisors, ends, strict=True))
        end[nu] = max(end[nu], self.rungs[0])
        kept = [k for k in range(high + 1) if k <= end[math.gcd(k, nu)]]
        return HarmonicBasis(kept[-1], nu, tuple(kept))


def _is_prime(number: int) -> bool:
    return number > 1 and all(number % k for k in range(2, math.isqrt(number) + 1))
