"""Points of curves: a motion, its multipliers and its place along the curve."""

from __future__ import annotations

from dataclasses import dataclass

from suboctave.floquet import FloquetResult, StabilityMethod
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.lazy import lazy

__all__ = ["BranchPoint", "TrackedPoint"]


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One point of a branch: orbit, multipliers, position in scaled arclength, Newton iterations."""

    orbit: PeriodicOrbit
    floquet: FloquetResult
    arclength: float
    iterations: int


class TrackedPoint(BranchPoint):
    """One point of a tracked curve: a branch point with the extra unknown and the coefficient of its normal form.

    `extra` is kappa at an NS, the instant tau in (0, 2 pi) at a grazing, else 0; `coefficient` the one that decides the
    normal form of an LP (a) or a PD (c3), else nan; `extreme` and `isola` say on a curve of extrema of which nature
    they are (`TrackedEvent`). The multipliers are computed when asked for, by `method`, unless they are `known`.
    """

    extra: float
    coefficient: float
    extreme: str
    isola: str

    def __init__(
        self,
        orbit: PeriodicOrbit,
        arclength: float,
        iterations: int,
        method: StabilityMethod | None,
        extra: float = 0.0,
        coefficient: float = float("nan"),
        known: FloquetResult | None = None,
        extreme: str = "",
        isola: str = "",
    ) -> None:
        said = {"orbit": orbit, "arclength": arclength, "iterations": iterations, "method": method, "extra": extra}
        self.__dict__.update(said, coefficient=coefficient, extreme=extreme, isola=isola)
        if known is not None:
            self.__dict__["floquet"] = known

    @lazy
    def floquet(self) -> FloquetResult:
        """Multipliers and their errors."""
        method: StabilityMethod = self.__dict__["method"]
        return method.along(self.orbit.state())

    def at(self, arclength: float) -> TrackedPoint:
        """The same at another place on the curve."""
        kept = self.__dict__
        args = self.orbit, arclength, self.iterations, kept["method"], self.extra, self.coefficient
        return TrackedPoint(*args, kept.get("floquet"), self.extreme, self.isola)
