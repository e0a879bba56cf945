"""A located point on a curve of bifurcations in two parameters: an extremum, or a point of codimension two."""

from __future__ import annotations

from dataclasses import dataclass

from suboctave.bifurcation.bifurcation import Bifurcation, target_multiplier
from suboctave.kinds import TRACKED_KINDS

#: kinds of the curves that pass through points of codimension two, or begin there
CURVES_THROUGH = {
    "GPD": ("PD", "LP"),
    "R1": ("LP", "NS"),
    "R2": ("PD", "NS"),
    "LPPD": ("LP", "PD"),
    "LPNS": ("LP", "NS"),
    "PDNS": ("PD", "NS"),
    "NSNS": ("NS",),
}
#: multipliers at ends of curves that are found on others
_AT_ENDS = {"R1": 1.0, "R2": -1.0, "GPD": -1.0}


@dataclass(frozen=True, eq=False, repr=False)
class TrackedEvent(Bifurcation):
    """A bifurcation of a tracked curve at which the curve turns, or at which a second condition holds.

    Besides what a `Bifurcation` has (`null_vectors` and `kappa` are those of the tracked kind):

    curve
        Kind of the motions that the curve consists of; where one ends in a point of another (R1, R2, GPD) the null
        vectors are those of the other.
    names
        The two free parameters.
    extreme
        "minimum" or "maximum" of `parameter_name` at an extremum, else empty.
    isola
        At an extremum along limit points what happens to branches over the other parameter when `parameter_name`
        passes it: "isola_centre" (a closed branch shrinks to a point), "isola_merging" (two branches meet and
        reconnect), empty where that is not certain.
    turning
        On a curve of extrema the parameter that is extreme all along it, else empty.
    """

    curve: str = ""
    names: tuple[str, ...] = ()
    extreme: str = ""
    isola: str = ""
    turning: str = ""

    @property
    def free_names(self) -> tuple[str, ...]:
        """The free parameters."""
        return self.names

    @property
    def smooth(self) -> bool:
        """False along a curve of grazings."""
        return self.curve != "grazing"

    @property
    def discontinuous(self) -> bool:
        """False: events are located along curves, not behind a grazing."""
        return False

    def critical_multiplier(self) -> complex:
        """The multiplier on the unit circle that the curve's bifurcations have."""
        if self.kind in TRACKED_KINDS:
            return super().critical_multiplier()
        mu, target = self.multipliers, target_multiplier(self.curve, self.kappa * self.orbit.period)
        target = _AT_ENDS.get(self.kind, target)
        return complex(mu[0] if target is None else min(mu, key=lambda m: abs(m - target)))

    def remark(self) -> str:
        """What a table says beside the numbers."""
        words = [f"{self.extreme} of {self.parameter_name}"] if self.extreme else []
        if self.extreme and self.turning and self.parameter_name == self.names[-1]:
            words.append(f"a minimum and a maximum of {self.turning} meet")
        if self.isola:
            words.append(self.isola.replace("_", " "))
        if self.contact is not None:
            words.append(str(self.contact))
        elif super().remark():
            words.append(super().remark())
        return "; ".join(words)


def kind_of(item: Bifurcation) -> str:
    """Kind of the curve that is followed from a located point."""
    return item.curve if isinstance(item, TrackedEvent) and item.kind not in TRACKED_KINDS else item.kind


__all__ = ["CURVES_THROUGH", "TrackedEvent", "kind_of"]
