"""Where a function of one variable is not finite.

It is looked at on a grid, which is then drawn together around its largest value, time and again, with what it is two
points beside that. At a maximum of a finite function this settles; at a pole, or where a logarithm's argument vanishes,
it grows by as much with every round, or by more. Nothing need be known of the function but its values.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from suboctave.harmonic.basis import Array

#: points of a grid, and rounds in which it is drawn together to 1e-8 of its width
POINTS, _ROUNDS = 33, 6
_SHARES = np.linspace(0.0, 1.0, POINTS)
#: growth beside the largest value, in units of that of the round before, from which on it goes on for ever
_LASTING = 0.5
#: growth, in units of the largest value, that is rounding
_ROUNDING = 1e-9


def unbounded(value: Callable[[Array], Array], grid: Array) -> float | None:
    """Where a function is not finite between the ends of an ascending grid that is fine enough to see it; None if it
    is finite.
    """
    beside: list[float] = []
    slope = level = 0.0
    with np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            values = value(grid)
            if not beside:
                # a steep force without its trend: else a weak pole is not its largest value
                slope = _middle((values[1:] - values[:-1]) / (grid[1:] - grid[:-1]))
                level = _middle(values - slope * grid)
            sizes = np.abs(values - (level + slope * grid))
            at = int(sizes.argmax())  # the first that is no number, if there is one
            largest = float(sizes[at])
            if not math.isfinite(largest):
                return float(grid[at])
            last = len(grid) - 1
            beside.append(max(float(sizes[at - 2]) if at > 1 else 0.0, float(sizes[at + 2]) if at < last - 1 else 0.0))
            if len(beside) > 2:
                before, growth = beside[-2] - beside[-3], beside[-1] - beside[-2]
                if growth <= _LASTING * before + _ROUNDING * (largest + abs(level + slope * float(grid[at]))):
                    return None
            start, end = grid[max(at - 1, 0)], grid[min(at + 1, last)]
            grid = start + (end - start) * _SHARES
    return float(grid[POINTS // 2])


def _middle(values: Array) -> float:
    """About the median of numbers."""
    half = len(values) // 2
    return float(np.partition(values, half)[half])
