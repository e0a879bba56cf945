"""What equations with a bordered matrix of all unknowns share: units that make it well-scaled, and its factors.

Rows of R are in units of `force` times one plus the square of the multiple of omega, columns of X in those of `size`,
both weighted by masses. Border vectors have an entry for every coefficient of X, then those of the other unknowns.
"""

from __future__ import annotations

import numpy as np

from suboctave.continuation.linear import Factor, length
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState


def sizes_of(state: BalanceState) -> tuple[float, float]:
    """Sizes of the forces and of the motion, those of rest taken for one."""
    weight = state.balance.per_unknown(state.balance.scales[0])
    return state.balanced.scale or 1.0, length(weight * state.x.ravel()) or 1.0


def row_factors(state: BalanceState, force: float) -> Array:
    """What the rows of R are multiplied by, (dimension,)."""
    masses = state.balance.per_unknown(state.balance.scales[1])
    waves = np.repeat(state.basis.multiples[(np.arange(state.basis.size) + 1) // 2], state.balance.size)
    return np.asarray(masses / (force * (1.0 + waves**2)))


def column_sizes(state: BalanceState, size: float) -> Array:
    """The units of X, (dimension,)."""
    return np.asarray(size / state.balance.per_unknown(state.balance.scales[0]))


def with_harmonics(vector: Array, count: int, rest: int) -> Array:
    """A border vector with its coefficients cut or filled with zeros to `count`, the last `rest` entries kept, of unit
    length.
    """
    coefficients = np.zeros(count)
    had = vector[: len(vector) - rest]
    coefficients[: min(count, len(had))] = had[:count]
    whole = np.concatenate((coefficients, vector[len(vector) - rest :]))
    return whole / length(whole)


def bordered_factor(matrix: Array, left: Array, right: Array) -> Factor:
    """Factors of `[matrix left; right^T 0]`; ConvergenceError where it is singular."""
    m = len(matrix)
    extended = np.zeros((m + 1, m + 1), order="F")
    extended[:m, :m] = matrix
    extended[:m, m], extended[m, :m] = left, right
    factor = Factor.of(extended, overwrite=True)
    if factor.singular:
        raise ConvergenceError("two extrema or singular points fall together: the bordered matrix is singular")
    return factor
