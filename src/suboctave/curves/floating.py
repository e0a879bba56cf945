"""Motions whose mean position nothing determines: of a body that floats in its play, for example.

Where the stiffness alone leaves a displacement `n` free, `K n = 0`, elements have to hold it. On a motion along which
those that could do so do not act, `x + s n` is a motion as well, for all s of an interval: there is a family of them at
each value of the parameter, and no curve. Within the tolerance the equations then also hold of a motion that leans on
the end of that interval: it is seen by moving it off that.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState, length

#: singular value of the stiffness per mass, relative to the largest or to omega^2, below which it is asked whether
#: elements hold the motion: rounding may make as much of zero
_ROUNDING = 1e-10
#: way off the end of its interval at which a motion is asked whether it floats, in units of the motion
_WAY = 1e-5
#: how many times the tolerance of Newton's method the forces may miss their balance there
_MISSED = 10.0
#: change of the forces that rounding makes, in units of those that balance
_EPSILON = 1e-13
#: degrees of freedom that a message names
_SHOWN = 4


class Floating(ConvergenceError):
    """A motion was found, but its mean position is arbitrary."""


@lru_cache(maxsize=32)
def _shapes(stiffness: bytes, scales: bytes) -> tuple[Array, Array]:
    """Singular values of a stiffness per mass, descending, and the displacements (size, size) that belong to them,
    orthonormal in the masses' weights; `scales`: of residual entries, both as they lie in memory.
    """
    weights = np.frombuffer(scales)
    matrix = np.frombuffer(stiffness).reshape(len(weights), len(weights))
    _, sizes, rows = np.linalg.svd(matrix * weights[:, None] * weights)
    return sizes, rows * weights


def floating(state: BalanceState, unit: float, tolerance: float) -> str | None:
    """What floats on a motion, in words; None if all is held. `unit`: size of the motion, `tolerance`: of Newton's
    method.
    """
    balance, size = state.balance, state.balance.size
    sizes, displacements = _shapes(state.blocks[0].real.tobytes(), balance.scales[1].tobytes())
    shapes = displacements[sizes <= _ROUNDING * max(float(sizes[0]), state.omega**2)]
    if not len(shapes):
        return None
    held = state.jacobian[:, :size] @ shapes.T * balance.row_weights(balance.dimension)[:, None]
    # of what the stiffness leaves free, what elements hold least comes first
    for combination in np.linalg.svd(held)[2][::-1]:
        direction = combination @ shapes
        for way in (_WAY * unit, -_WAY * unit):
            near = _moved(state, way * direction).balanced
            if near.size > _MISSED * tolerance * near.scale:
                continue
            change = _moved(state, 2.0 * way * direction).balanced.residual - near.residual
            if length(change * balance.scales[1]) <= _EPSILON * near.scale:
                return unheld(state, direction)
    return None


def _moved(state: BalanceState, way: Array) -> BalanceState:
    """The same motion about another mean position."""
    x = state.x.copy()
    x[0] += way
    return state.balance.at(x, state.omega, state.values)


def unheld(state: BalanceState, direction: Array) -> str:
    """That nothing holds the degrees of freedom that move along a direction of the unknowns, with what to change."""
    linear, system = state.balance.linear, state.balance.system
    shape = np.abs(linear.shaped(linear.expand(direction)))
    most = [int(i) for i in np.flatnonzero(shape >= 0.5 * shape.max())]
    names = [system.dof_names[i] if system.dof_names else str(i) for i in most[:_SHOWN]]
    shown = f"DOF {', '.join(names)}{', ...' * (len(most) > _SHOWN)}"
    return (
        f"nothing holds {shown}: its mean position is arbitrary (it floats between its stops, or has no stiffness). "
        "Give it a small stiffness, or a load that reaches a stop"
    )
