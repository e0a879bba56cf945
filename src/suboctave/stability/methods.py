"""The methods that a user can ask for, as objects: `so.stability(orbit, method=...)` and `stability=...` of the verbs.

A method takes one solved motion's equations and returns a `FloquetResult`. Along a curve it is asked twice: `along` for
the multipliers that tests of neighbouring points compare, on every point that is tried, and `settled` for the verdict
of a point that was accepted. For most methods that is the same; arbitration asks its witnesses only there.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

from suboctave.errors import InputError, suggest
from suboctave.harmonic.state import BalanceState
from suboctave.stability.hill import hill_multipliers
from suboctave.stability.koopman_hill import koopman_hill_multipliers
from suboctave.stability.monodromy import floquet_multipliers
from suboctave.stability.result import FloquetResult

SELECTIONS = ("strip", "imaginary", "symmetry")


class StabilityMethod(ABC):
    """One way to the multipliers of a motion."""

    name: ClassVar[str]
    #: whether `along` gives the multipliers of the monodromy matrix
    follows_monodromy: ClassVar[bool] = False

    @abstractmethod
    def multipliers(self, state: BalanceState) -> FloquetResult:
        """Multipliers, error estimates and verdict of a solved motion, over the motion's own period."""

    def along(self, state: BalanceState) -> FloquetResult:
        """The same along a curve, where something must be said at every point."""
        found = self.multipliers(state)
        if found.applicable:
            return found
        instead = floquet_multipliers(state)
        return replace(instead, note=f"{found.note}; multipliers of the monodromy matrix instead", stands_in=True)

    def settled(self, state: BalanceState, found: FloquetResult) -> FloquetResult:
        """The verdict on a point of a curve, from what `along` found there."""
        return found


@dataclass(frozen=True)
class Monodromy(StabilityMethod):
    """Multipliers as eigenvalues of the monodromy matrix, a product of matrix exponentials over one period."""

    name: ClassVar[str] = "monodromy"
    follows_monodromy: ClassVar[bool] = True

    def multipliers(self, state: BalanceState) -> FloquetResult:
        """See `StabilityMethod.multipliers`."""
        return floquet_multipliers(state)


@dataclass(frozen=True)
class Hill(StabilityMethod):
    """Multipliers as eigenvalues in the frequency domain; see `suboctave.stability.hill`.

    selection
        Which eigenvalues count: "strip" (checks itself), or as the literature does it, "imaginary" (smallest imaginary
        parts) and "symmetry" (most central eigenvectors). The last two are there for comparison: they fail beside every
        period doubling, and the result says so where they do.
    """

    selection: str = "strip"
    name: ClassVar[str] = "hill"

    def __post_init__(self) -> None:
        if self.selection not in SELECTIONS:
            raise InputError(f"unknown selection {self.selection!r}{suggest(str(self.selection), SELECTIONS)}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        """See `StabilityMethod.multipliers`."""
        return hill_multipliers(state, self.selection)


@dataclass(frozen=True)
class KoopmanHill(StabilityMethod):
    """Multipliers of `C exp(H T) W`, H Hill's matrix: no selection; see `suboctave.stability.koopman_hill`.

    subharmonic
        With the waves of half the base frequency besides: half as many harmonics reach the same accuracy.
    """

    subharmonic: bool = True
    name: ClassVar[str] = "koopman-hill"

    def __post_init__(self) -> None:
        if not isinstance(self.subharmonic, bool):
            raise InputError(f"subharmonic must be True or False, not {self.subharmonic!r}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        """See `StabilityMethod.multipliers`."""
        return koopman_hill_multipliers(state, self.subharmonic)
