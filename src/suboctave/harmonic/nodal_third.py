"""Third derivatives of elements that are integrated at nodes of their own (`nodal`): see `harmonic.bends`.

At a corner of the law in q_r the force is `f_0(q) + (q_r - level) eta(q) H(q_r - level)`. Its jumps are `[f_r] = eta`,
`[f_rs] = eta_s` for s other than r, `[f_rr] = 2 eta_r`, and

    f_qqq[a, b, c] = ... + (eta.a b_r c_r + a_r eta.b c_r + a_r b_r eta.c) delta(q_r - level) + a_r b_r c_r eta
    delta'(q_r - level),

with `eta.a = sum_s eta_s a_s`.
"""

from __future__ import annotations

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array
from suboctave.harmonic.nodal import _BESIDE, NodalForce
from suboctave.harmonic.third_weights import Third

#: step in the phase of the load by which the jump of a slope is differentiated
_PHASE = 1e-3


def nodal_third(force: NodalForce) -> list[Third]:
    """Weights of the third derivative at the nodes and at the corners."""
    nodes = force.nodes
    q, theta = force.path
    third = np.asarray(force.own.law.third(q, theta, force.c))
    found = [Third(nodes.zr, nodes.zi, nodes.weights * third, None)]
    for number, (row, level, at) in enumerate(force._corner_rows):
        if len(at):
            found.append(_corner(force, row, level, np.cos(at), np.sin(at)))
    return found


def _corner(force: NodalForce, row: int, level: float, zr: Array, zi: Array) -> Third:
    """Dirac functions and their derivatives at one corner."""
    law, c, count = force.own.law, force.c, force.own.count
    q, theta = force.state_at(zr, zi)
    rates = _rates_of_state(force, zr, zi)
    scale = float(np.abs(force.path[0][row]).max()) or 1.0

    def jump(order: int, phase: Array) -> Array:
        sides = []
        for sign in (1.0, -1.0):
            there = q.copy()
            there[row] = level + sign * _BESIDE * scale
            sides.append(law.tangent(there, phase, c)[1][row] if order == 1 else law.curvature(there, phase, c)[row])
        return sides[0] - sides[1]

    eta, by = jump(1, theta), jump(2, theta)
    by[row] *= 0.5
    along = np.einsum("sn,sn->n", by, rates[0])
    if force.own.harmonic:
        near, far = (jump(1, theta + h) - jump(1, theta - h) for h in (_PHASE, 2.0 * _PHASE))
        along += force.basis.nu * (8.0 * near - far) / (12.0 * _PHASE)
    slope = rates[0][row]
    least = 1e-12 * scale
    slope = np.where(np.abs(slope) < least, least, slope)
    size = len(q)
    weights = np.zeros((size, size, size, len(zr)))
    for s in range(size):
        for place in ((s, row, row), (row, s, row), (row, row, s)):
            weights[place] += by[s] / np.abs(slope)
    weights[row, row, row] -= (along / slope - eta * rates[1][row] / slope**2) / np.abs(slope)
    slopes = np.zeros_like(weights)
    slopes[row, row, row] = -eta / (slope * np.abs(slope))
    return Third(zr, zi, weights, slopes)


def _rates_of_state(force: NodalForce, zr: Array, zi: Array) -> tuple[Array, Array]:
    """First and second derivatives by tau of q at instants, (Q, N) each."""
    first, second = [], []
    for order in (0, 1) if force.own.moving else (0,):
        for motion in force.motions:
            k = 1j * np.arange(len(motion))
            series = np.ascontiguousarray(k * motion * (force.rate * k) ** order)
            a, b = kernels.motion(series, zr, zi)
            first.append(a)
            second.append(b)
    return np.array(first), np.array(second)
