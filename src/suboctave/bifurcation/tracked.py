"""A located point on a curve of bifurcations in two parameters: an extremum, or a point of codimension two."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

from suboctave.bifurcation.bifurcation import Bifurcation

#: kinds of bifurcation that can be followed in two parameters
TRACKED_KINDS = ("LP", "BP", "PD", "NS", "grazing")


@dataclass(frozen=True, eq=False)
class TrackedEvent(Bifurcation):
    """A bifurcation of a tracked curve at which the curve turns, or at which a second condition holds.

    Besides what a `Bifurcation` has (`null_vectors` and `kappa` are those of the tracked kind):

    curve
        Kind of the bifurcations that the curve consists of.
    names
        The two free parameters.
    extreme
        "minimum" or "maximum" of `parameter_name` at an extremum, else empty.
    """

    curve: str = ""
    names: tuple[str, ...] = ()
    extreme: str = ""

    @property
    def free_names(self) -> tuple[str, ...]:
        """The two free parameters."""
        return self.names

    def critical_multiplier(self) -> complex:
        """The multiplier on the unit circle that the curve's bifurcations have."""
        targets = {"LP": 1.0, "BP": 1.0, "PD": -1.0, "NS": cmath.exp(1j * self.kappa * self.orbit.period)}
        target = targets.get(self.curve)
        if target is None:
            return complex(self.multipliers[0])
        return complex(min(self.multipliers, key=lambda m: abs(m - target)))

    def remark(self) -> str:
        """What a table says beside the numbers."""
        words = [f"{self.extreme} of {self.parameter_name}"] if self.extreme else []
        return "; ".join([*words, super().remark()] if super().remark() else words)


__all__ = ["TRACKED_KINDS", "TrackedEvent"]
