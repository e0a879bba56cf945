"""Numbers so large or so small that what is computed with them leaves the range of floating point."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from suboctave.model.system import System

__all__ = ["extreme_number"]

#: modulus of a number whose fourth power is no float; the inverse of one
_EXTREME = 1e77


def extreme_number(*given: Any) -> str | None:
    """The first number among a verb's arguments, those of its system included, whose powers leave the range of floats;
    with its name.
    """
    for item in given:
        for name, value in _numbers(item):
            if value and not 1.0 / _EXTREME <= abs(value) <= _EXTREME:
                return f"{name} = {value:g}"
    return None


def _numbers(item: Any) -> Iterator[tuple[str, float]]:
    system = getattr(getattr(item, "orbit", item), "system", item)
    if isinstance(system, System):
        yield from system.parameters.items()
        for name, matrix in zip(("mass", "damping", "stiffness"), system.matrices(), strict=True):
            yield from ((name, float(entry)) for entry in matrix.ravel())
        for where, source, _ in system.expressions():
            yield where, source.value({**system.parameters, "omega": 1.0})
    elif isinstance(item, int | float | np.floating):
        yield "an argument", float(item)
    elif isinstance(item, tuple | list | np.ndarray):
        for part in item:
            yield from _numbers(part)
