"""Central differences of fourth order, `f'(0) ~ (8 (f(h) - f(-h)) - (f(2h) - f(-2h))) / 12 h`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

#: step as a share of the length over which a law changes: truncation (step^4 / 30 times a fifth derivative) and
#: rounding (1e-16 / step, more behind a sharp corner) both stay below 1e-7 there
STEP = 2e-3


def central_difference(law: Callable[[float], Any], step: float) -> Any:
    """The derivative at 0 of a function of a shift."""
    return (8.0 * (law(step) - law(-step)) - (law(2.0 * step) - law(-2.0 * step))) / (12.0 * step)


def step_of(at: Any, width: float = np.inf) -> float:
    """The step for an argument `at` of a law that changes over its largest size, or over a smaller width."""
    return STEP * min(float(np.max(np.abs(at), initial=0.0)) or 1.0, width)


def shifted(at: Any, i: Any, by: float) -> Any:
    """A copy of an array with one of its entries, or rows, moved."""
    moved = at.copy()
    moved[i] += by
    return moved


def shift_derivative(law: Callable[[Any], Any], at: Any, i: Any, step: float) -> Any:
    """The derivative of a function of an array by one of its entries, or along one of its rows."""
    return central_difference(lambda h: law(shifted(at, i, h)), step)
