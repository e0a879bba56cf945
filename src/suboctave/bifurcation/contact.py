"""The contact that grazes: which gap of which element, where in the period, and what begins or ceases there."""

from __future__ import annotations

from dataclasses import dataclass, replace

#: what happens along a curve, and what happens the other way round
_BACKWARDS = {
    "begins to touch": "ceases to touch",
    "begins to lift off": "ceases to lift off",
}
_BACKWARDS |= {there: here for here, there in _BACKWARDS.items()}


@dataclass(frozen=True)
class GrazingContact:
    """A gap that a local extremum of an element's relative displacement just reaches.

    Attributes
    ----------
    element, label
        Index of the element in the system's list, and how messages name it.
    gap
        Displacement at which the element's law has its corner (unit of length).
    time
        Instant in the motion's period, 0 <= time < T.
    change
        What happens as the curve is followed on: a contact "begins to touch" or "ceases to touch" (an extremum that
        comes from outside), or "begins to lift off", "ceases to lift off" (one inside a contact). Empty where the
        contact belongs to a bifurcation beside the grazing.
    parameter
        Value of the free parameter at which it grazes.
    distance
        Way along the curve from the grazing to the bifurcation that it belongs to, in scaled arclength; 0 for the
        grazing itself.
    """

    element: int
    label: str
    gap: float
    time: float
    change: str
    parameter: float
    distance: float = 0.0

    def backwards(self) -> GrazingContact:
        """The same on a curve followed the other way."""
        return replace(self, change=_BACKWARDS.get(self.change, self.change))

    def __str__(self) -> str:
        return f"{self.label} {self.change}".strip()
