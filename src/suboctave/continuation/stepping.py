"""How far the steps of a curve go."""

from __future__ import annotations

import math
from dataclasses import dataclass

from suboctave.errors import InputError, check_numbers

#: angle between successive tangents at which a step is refused, radians, unless the aim is large
_SHARP = 0.75


@dataclass(frozen=True)
class SteppingOptions:
    """How far the engine steps.

    max_step
        Largest distance between neighbours in scaled arclength: parameters in units of their range, the solution in
        units of its own current size (or of 1 % of the largest met so far, if that is larger).
    initial_step, min_step
        First step, and the step below which the curve ends with a reason.
    deviation
        Aim for the distance between prediction and solution.
    angle, growth
        Aim for the angle between successive tangents, radians; by how much at most a curve that turns more and more is
        expected to turn more from one step to the next.
    max_points
        Points after which the curve ends with a reason.
    """

    max_step: float = 0.06
    initial_step: float = 0.01
    min_step: float = 1e-7
    deviation: float = 0.01
    angle: float = 0.3
    growth: float = 1.0
    max_points: int = 20000

    def __post_init__(self) -> None:
        check_numbers(**vars(self))
        if not 0.0 < self.min_step <= self.initial_step:
            raise InputError(
                f"initial_step={self.initial_step:g} must be positive and not below min_step={self.min_step:g}"
            )
        if not self.min_step < self.max_step < math.inf:
            raise InputError(f"max_step={self.max_step:g} must lie above min_step={self.min_step:g}")
        if self.deviation <= 0.0 or not 0.0 < self.angle < 1.6 or self.growth < 1.0 or self.max_points < 2:
            raise InputError(f"SteppingOptions out of range: {self}")

    @property
    def sharpest(self) -> float:
        """Angle between successive tangents at which a step is refused, radians."""
        return max(_SHARP, 2.5 * self.angle)
