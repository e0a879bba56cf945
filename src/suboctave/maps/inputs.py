"""What searches over a design parameter refuse before any work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from suboctave.analysis.subharmonics import Seeds
from suboctave.errors import InputError, is_number, shortened

__all__ = [
    "COARSE",
    "MOST_VALUES",
    "check_count",
    "check_seeds",
    "checked_orders",
    "checked_values",
    "is_count",
    "listed",
]

#: values of a parameter at which whole responses are followed
MOST_VALUES = 10_000
#: a search among resonances: coarse, since the branches themselves are followed afterwards
COARSE = Seeds(8, 4, 3)


def is_count(number: Any, least: int) -> bool:
    """Whether something is a whole number that is not too small."""
    return isinstance(number, int) and not isinstance(number, bool) and number >= least


def check_count(name: str, number: Any, least: int) -> int:
    """A whole number that is not too small."""
    if not is_count(number, least):
        raise InputError(f"{name} must be a whole number of at least {least}, not {number!r}")
    return int(number)


def listed(values: Any) -> list[Any]:
    """The items of a sequence or an array; a single None for anything else."""
    return list(values) if isinstance(values, Sequence | np.ndarray) and not isinstance(values, str) else [None]


def check_seeds(seeds: Any) -> Seeds | None:
    """How finely resonances are searched."""
    if seeds is not None and not isinstance(seeds, Seeds):
        raise InputError(f"seeds must be a Seeds, not {type(seeds).__name__}")
    return seeds


def checked_orders(search: Any, least: int) -> tuple[int, ...]:
    """Periods, in periods of the load, of a search among resonances."""
    given = listed(search)
    if not all(is_count(order, least) for order in given):
        raise InputError(f"search must be periods in periods of the load, {least} or more, as (2, 3), not {search!r}")
    return tuple(given)


def checked_values(values: Any, bounds: tuple[float, float]) -> list[float]:
    """Values of the design parameter: how many from bound to bound, or the values themselves."""
    low, high = bounds
    if isinstance(values, int) and not isinstance(values, bool):
        if not 2 <= values <= MOST_VALUES:
            raise InputError(
                f"values must be at least 2 and at most {MOST_VALUES}, or the values of the parameter themselves, not "
                f"{shortened(values)}"
            )
        return [float(v) for v in np.linspace(low, high, values)]
    given = listed(values)
    if not given or not all(is_number(v) and low <= v <= high for v in given):
        raise InputError(f"values must be how many, or numbers within the bounds ({low:g}, {high:g}), not {values!r}")
    return sorted({float(v) for v in given})
