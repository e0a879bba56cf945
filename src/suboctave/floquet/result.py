"""What a stability method says of a motion: multipliers, how far each may be off, and the verdict that follows."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from suboctave.compiled import kernel
from suboctave.floquet.symmetric import UNDAMPED, distinct, symmetric_functions
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.lazy import lazy

#: error of a multiplier, or share of one outside the circle, that is aimed at where more harmonics are asked, and up to
#: which tests compare it; modulus, with its error, from which on it may decide
_AIMED_AT, RESOLVED, _DECIDING = 0.2, 0.3, 0.5
#: error of a multiplier above which it is known to no side of the circle, and the same as a share of one outside: an
#: estimate of first order means nothing where it is as large as what it belongs to
NO_VERDICT, _SHARE = 1.0, 0.5


def no_verdict(multipliers: ComplexArray, errors: Array) -> NDArray[np.bool_]:
    """Of which multipliers, of any shape, the errors are too large to tell a side of the unit circle."""
    vague: NDArray[np.bool_] = errors > np.maximum(NO_VERDICT, _SHARE * np.abs(multipliers))
    return vague


@kernel(inner=True, forceinline=True)
def _known_within(mu, error):
    """How far off a multiplier may be: anywhere, where its error estimate is too large to mean anything."""
    return error if error <= max(NO_VERDICT, _SHARE * abs(mu)) else np.inf


@kernel()
def _off_the_circle(mu, errors):
    """Largest modulus minus one, whether all are off the circle by more than their errors, how many are outside, the
    distance of the nearest one, and the largest error of one that may decide, in units of that aimed at.
    """
    largest, decided, outside, nearest, vagueness = -np.inf, True, 0, np.inf, 0.0
    for i in range(mu.shape[0]):
        beyond = abs(mu[i]) - 1.0
        if not (beyond <= largest or math.isnan(largest)):
            largest = beyond
        decided = decided and abs(beyond) > _known_within(mu[i], errors[i])
        outside += beyond > 0.0
        nearest = min(nearest, abs(beyond))
        if not beyond + errors[i] <= _DECIDING - 1.0:
            vagueness = max(vagueness, errors[i] / (_AIMED_AT * max(1.0, beyond + 1.0)))
    return largest, decided, outside, nearest, vagueness


@dataclass(frozen=True, eq=False, repr=False)
class FloquetResult:
    """Floquet multipliers of a motion over its own period.

    multipliers
        Shape (2 n,), complex, by descending modulus; nan where the method is not applicable.
    errors
        Estimated error of each, shape (2 n,): of the method, of the harmonics that the motion neglects, of rounding.
    method
        The method, or methods, that they come from.
    note
        A sentence where there is something to say: why the method is not applicable, what keeps the verdict undecided,
        which methods contradict each other. Empty otherwise.
    checks
        What the method found when it checked itself, by name.
    witnesses
        The results that were weighed against each other, in the order asked; empty if one method was enough.
    stands_in
        True where the method asked for was not applicable on a curve and the monodromy matrix stands in for it.
    """

    multipliers: ComplexArray
    errors: Array
    method: str = "monodromy"
    note: str = ""
    checks: Mapping[str, float] = field(default_factory=dict)
    witnesses: tuple[FloquetResult, ...] = ()
    stands_in: bool = False

    @classmethod
    def inapplicable(
        cls, count: int, method: str, note: str, checks: Mapping[str, float] | None = None
    ) -> FloquetResult:
        """The result of a method that cannot say anything of a motion with `count` multipliers, and why."""
        return cls(np.full(count, np.nan, dtype=complex), np.full(count, np.inf), method, note, checks or {})

    @lazy
    def applicable(self) -> bool:
        """False if the method could not say anything; `note` says why."""
        return all(map(cmath.isfinite, self.multipliers.tolist()))

    def unknown(self) -> FloquetResult:
        """The same multipliers, of which nothing is known."""
        return replace(self, errors=np.full(len(self.errors), np.inf))

    @property
    def error(self) -> float:
        """Largest error estimate among the multipliers that decide (modulus above one half)."""
        deciding = np.abs(self.multipliers) > 0.5
        return float(np.max(self.errors[deciding] if deciding.any() else self.errors))

    @lazy
    def _verdict(self) -> tuple[float, bool, int, float, float]:
        result: tuple[float, bool, int, float, float] = _off_the_circle(self.multipliers, self.errors)
        return result

    @property
    def margin(self) -> float:
        """Largest modulus minus one: negative if stable."""
        return self._verdict[0]

    @property
    def stable(self) -> bool:
        """True if all multipliers lie inside the unit circle."""
        return self.margin < 0.0

    def inside(self, deciding: NDArray[np.bool_]) -> bool:
        """Whether the multipliers that decide lie inside the unit circle, of a conservative motion not outside of it by
        more than their errors; not where their errors are too large for a verdict.
        """
        mu, errors = self.multipliers[deciding], self.errors[deciding]
        within = np.abs(mu) <= 1.0 + errors if self.undamped else np.abs(mu) < 1.0
        return bool(within.all()) and not no_verdict(mu, errors).any()

    @property
    def decided(self) -> bool:
        """True if no multiplier is closer to the unit circle than its error estimate."""
        return self._verdict[1]

    @lazy
    def symmetric(self) -> Array:
        """Symmetric functions of the multipliers, (2, 3): see `floquet.symmetric`."""
        return symmetric_functions(self.multipliers)

    @lazy
    def distinct(self) -> ComplexArray:
        """One of every set of equal multipliers: see `floquet.symmetric`."""
        return distinct(self.multipliers)

    @lazy
    def repeated(self) -> bool:
        """Whether several multipliers are equal."""
        return len(self.distinct) != len(self.multipliers)

    @property
    def open(self) -> np.ndarray:
        """Which multipliers lie within their errors of the unit circle, (2 n,)."""
        near: np.ndarray = np.abs(np.abs(self.multipliers) - 1.0) <= self.errors
        return near | no_verdict(self.multipliers, self.errors)

    @property
    def vague(self) -> bool:
        """Whether the errors of multipliers are so large that there is no verdict."""
        return bool(no_verdict(self.multipliers, self.errors).any())

    @property
    def resolved(self) -> bool:
        """Whether the verdict is clear, or the multipliers that may decide are known to a share of themselves: the
        error of a multiplier of the corrected motion goes with the square of the shift that is stated.
        """
        return self.decided or self.vagueness * _AIMED_AT <= RESOLVED

    @property
    def vagueness(self) -> float:
        """Largest error of a multiplier that may decide, in units of that aimed at."""
        return self._verdict[4]

    @property
    def undamped(self) -> bool:
        """True if the product of all multipliers is one to rounding: pairs then stay on the unit circle."""
        return abs(float(np.log(np.maximum(np.abs(self.multipliers), 1e-300)).sum())) < UNDAMPED

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return self._verdict[2]

    @property
    def clearance(self) -> float:
        """Distance of the multiplier nearest to the unit circle from it."""
        return self._verdict[3]

    @property
    def unstable_pairs(self) -> int:
        """Number of complex-conjugate pairs outside the unit circle."""
        mu = self.multipliers[np.abs(self.multipliers) > 1.0]
        return int(np.count_nonzero(mu.imag > 0.0))

    def __repr__(self) -> str:
        if not self.applicable:
            return f"FloquetResult: not applicable ({self.method}). {self.note}"
        count, outside = len(self.multipliers), self.unstable
        verdict = "stable" if self.stable else f"unstable, {outside} of {count} outside" if outside else "not stable"
        doubt = "" if self.decided else ", UNDECIDED"
        shown = [written(mu, error) for mu, error in zip(self.multipliers[:4], self.errors, strict=False)]
        more = f", ... ({count} in all)" if count > 4 else ""
        note = f". {self.note}" if self.note else ""
        return f"FloquetResult: {verdict}{doubt} ({self.method}). Multipliers {', '.join(shown)}{more}{note}"


class Spectrum(Protocol):
    """Multipliers of a motion on a curve, in the two ways in which they are used.

    standing
        Those of the motion as it stands, with the errors of computing them: smooth along the curve however few the
        harmonics are.
    completed
        Those of the motion with what its harmonics leave out, to first order, and how far each may be off: what is said
        of the motion.
    """

    @property
    def standing(self) -> FloquetResult: ...

    @property
    def completed(self) -> FloquetResult: ...


@dataclass(frozen=True, eq=False)
class OneResult:
    """Of a method that has one result."""

    completed: FloquetResult

    @property
    def standing(self) -> FloquetResult:
        """The same."""
        return self.completed


def written(mu: complex, error: float) -> str:
    """A multiplier with the digits that its error leaves, and the error."""
    size, digits = max(abs(mu), 1e-300), 6
    if 0.0 < error < 1.0:
        digits = min(12, max(4, 2 + math.floor(math.log10(size)) - math.floor(math.log10(error))))
    real = f"{mu.real:#.{digits}g}"
    text = real if abs(mu.imag) <= max(error, 1e-12 * size) else f"({real}{mu.imag:+#.{digits}g}i)"
    return f"{text} +- {error:.1g}"
