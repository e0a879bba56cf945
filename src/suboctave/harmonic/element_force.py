"""The force of one element along a solved motion: of its law, not of a truncated series of the force."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.state import BalanceState
from suboctave.model.coupled import as_coupled

__all__ = ["displacements_read", "force_along"]


def displacements_read(state: BalanceState, element: int) -> list[ComplexArray]:
    """Complex coefficients (H + 1,) of each displacement that an element reads."""
    coupled = next((nodal for nodal in state.nodal if nodal.own.index == element), None)
    return [state.local(element).motion] if coupled is None else list(coupled.motions)


def force_along(state: BalanceState, element: int) -> Callable[[Array], Array]:
    """The force f of an element as a function of instants `tau = omega t / nu` (m,), values (m,)."""
    local, motions = state.local(element), displacements_read(state, element)
    law = as_coupled(local.element)

    def force(tau: Array) -> Array:
        zr, zi = np.cos(tau), np.sin(tau)
        values = [kernels.motion(motion, zr, zi) for motion in motions]
        q = [u for u, _ in values]
        if local.element.depends_on_velocity:
            q += [state.rate * du for _, du in values]
        theta = np.mod(state.basis.nu * tau, 2.0 * math.pi)
        result: Array = law.tangent(np.array(q), theta, local.coefficients)[0]
        return result

    return force
