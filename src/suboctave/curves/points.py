"""Points of curves: a motion, its multipliers and its place along the curve."""

from __future__ import annotations

from dataclasses import dataclass

from suboctave.floquet.methods import StabilityMethod
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.lazy import lazy


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One point of a branch: orbit, multipliers, position in scaled arclength, Newton iterations.

    The multipliers are computed when asked for, by `method`, unless they are `known`.
    """

    orbit: PeriodicOrbit
    known: FloquetResult | None
    arclength: float
    iterations: int
    method: StabilityMethod | None = None

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers and their errors."""
        if self.known is not None:
            return self.known
        assert self.method is not None
        return self.method.along(self.orbit.state())


@dataclass(frozen=True, eq=False)
class TrackedPoint(BranchPoint):
    """One point of a tracked curve: a branch point with the extra unknown and the coefficient of its normal form.

    `extra` is kappa at an NS, the instant tau in (0, 2 pi) at a grazing, else 0; `coefficient` the one that decides the
    normal form of an LP (a) or a PD (c3), else nan; `extreme` and `isola` say on a curve of extrema of which nature
    they are (`TrackedEvent`).
    """

    extra: float = 0.0
    coefficient: float = float("nan")
    extreme: str = ""
    isola: str = ""
