"""An extremum over a gap: where it is read, and the basis functions there."""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.model.elements.coupled import reads


def read_direction(state: BalanceState, element: int) -> Array:
    """The displacement that an element's gaps are places of, in the unknown DOFs."""
    system = state.balance.system
    return state.linear.retain(reads(system.elements[element], system.n))


def basis_rows(high: int, tau: float) -> tuple[Array, Array, Array]:
    """Basis functions at an instant and their first two derivatives by tau, shape (2 H + 1,) each."""
    k = np.arange(1.0, high + 1.0)
    value, slope, curve = np.empty(2 * len(k) + 1), np.empty(2 * len(k) + 1), np.empty(2 * len(k) + 1)
    c, s = np.cos(k * tau), np.sin(k * tau)
    value[0], slope[0], curve[0] = 1.0, 0.0, 0.0
    value[1::2], value[2::2] = c, s
    slope[1::2], slope[2::2] = -k * s, k * c
    curve[1::2], curve[2::2] = -(k**2) * c, -(k**2) * s
    return value, slope, curve


__all__ = ["basis_rows", "read_direction"]
