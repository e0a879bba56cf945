"""Ranges that experiments in time go through: values of a frequency or a parameter, and in which direction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from suboctave.errors import InputError, is_number, shortened, suggest
from suboctave.model.elements.base import Array, numbers_of
from suboctave.model.inputs import check_count, check_range
from suboctave.model.system import System


def checked_directions(given: Any, known: Sequence[str]) -> tuple[str, ...]:
    """One or several of the directions in which a range is gone through."""
    listed = [given] if isinstance(given, str) else list(given) if isinstance(given, Iterable) else [given]
    wrong = next((f"{shortened(one)}{suggest(str(one), known)}" for one in listed if one not in known), None)
    if wrong or not listed:
        raise InputError(f"direction is one of {', '.join(known)}, or several of them, not {wrong or 'none'}")
    return tuple(dict.fromkeys(listed))


def checked_grid(name: str, bounds: Any, values: Any, what: str = "values") -> Array:
    """Increasing values in a range: so many, evenly spread, or those that are given."""
    first, last = check_range(name, bounds, positive=name == "omega")
    low, high = min(first, last), max(first, last)
    if is_number(values):
        return np.linspace(low, high, check_count(what, values))
    array = numbers_of(values)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise InputError(f"{what} must be how many values of {name}, or these values, not {shortened(values)}")
    outside = array[(array < low) | (array > high)]
    if outside.size:
        raise InputError(f"{what}: {name} = {outside[0]:g} lies outside the range ({low:g}, {high:g})")
    return np.unique(array)


def varied_grid(
    system: System, omega: Any, parameter: str | None, bounds: Any, values: Any
) -> tuple[str, float, Array]:
    """What is varied, the frequency if that is not, and the increasing values."""
    if parameter is None:
        if bounds is not None:
            raise InputError("bounds= is the range of a parameter: name it with parameter=")
        if is_number(omega):
            raise InputError("omega must be a range (from, to); or name a parameter= to vary, with its bounds=")
        return "omega", 0.0, checked_grid("omega", omega, values)
    system.check_parameter(parameter)
    if not (is_number(omega) and omega > 0.0):
        raise InputError(f"omega must be a positive number while {parameter} is varied, not {shortened(omega)}")
    if bounds is None:
        raise InputError(f"give bounds=(from, to) of {parameter}")
    grid = checked_grid(parameter, bounds, values)
    for end in (grid[0], grid[-1]):
        try:
            system.with_parameters({parameter: float(end)})
        except InputError as failure:
            raise InputError(f"{parameter}={end:g}: {failure}") from None
    return parameter, float(omega), grid
