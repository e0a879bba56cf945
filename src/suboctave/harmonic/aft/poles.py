"""Where a function of one variable is not finite.

It is looked at on a grid, which is then drawn together around its largest value, time and again, with what it is two
points beside that. At a maximum of a finite function this settles; at a pole, or where a logarithm's argument vanishes,
it grows by as much with every round, or by more. Nothing need be known of the function but its values.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from suboctave.harmonic.basis import Array

#: points of a grid, and rounds in which it is drawn together to 1e-8 of its width
POINTS, _ROUNDS = 33, 6
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
    for _ in range(_ROUNDS):
        values = value(grid)
        if not beside:
            # a steep force without its trend: else a weak pole is not its largest value
            with np.errstate(all="ignore"):
                slope = float(np.median(np.diff(values) / np.diff(grid)))
                level = float(np.median(values - slope * grid))
        with np.errstate(all="ignore"):
            sizes = np.abs(values - level - slope * grid)
        wrong = ~np.isfinite(sizes)
        if wrong.any():
            return float(grid[np.argmax(wrong)])
        at = int(np.argmax(sizes))
        beside.append(float(sizes[[j for j in (at - 2, at + 2) if 0 <= j < len(grid)]].max()))
        if len(beside) > 2:
            before, growth = beside[-2] - beside[-3], beside[-1] - beside[-2]
            if growth <= _LASTING * before + _ROUNDING * float(np.abs(values).max()):
                return None
        grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], POINTS)
    return float(grid[POINTS // 2])
