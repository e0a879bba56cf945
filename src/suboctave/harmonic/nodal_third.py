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
from suboctave.harmonic.nodal import BESIDE, GAUSS, NodalForce
from suboctave.harmonic.third_weights import Third
from suboctave.model.sampling import CornerSampling

#: step in the phase of the load by which the jump of a slope is differentiated
_PHASE = 1e-3
#: distance from a rough corner, in units of the motion, at which the strength of its singularity is looked at
_NEAR = 1e-6


def nodal_third(force: NodalForce) -> list[Third]:
    """Weights of the third derivative at the nodes and at the corners."""
    nodes = force.nodes
    q, theta = force.path
    third = np.asarray(force.own.law.third(q, theta, force.c))
    found = [Third(nodes.zr, nodes.zi, nodes.weights * third, None)]
    rough = isinstance(force.kind, CornerSampling) and force.kind.rough
    for row, level, at in force.corner_rows:
        if len(at):
            found.append(_corner(force, row, level, at))
            if rough:
                found.append(_finite_part(force, row, level, at))
    return found


def _finite_part(force: NodalForce, row: int, level: float, at: Array) -> Third:
    """What Gauss rules miss of `f_rrr ~ K y^(-3/2)` beside a corner, y = |q_r - level|: Hadamard's finite part.

    On the panel next to a corner instants run like the square of its variable s, and the integrand is `E(s) / s^2` with
    `E(0) = 2 K |q_r'|^(-3/2) / sqrt(length)`. Its finite part over [0, 1] is `int (E(s) - E(0)) / s^2 ds - E(0)`; the
    rule takes `sum_i w_i / s_i^2` for the -1.
    """
    s, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    zr, zi = np.cos(at), np.sin(at)
    q, theta = force.state_at(zr, zi)
    slope = _rates_of_state(force, zr, zi)[0][row]
    slope = np.where(np.abs(slope) < 1e-12 * force.size(row), 1e-12 * force.size(row), slope)
    nodes = force.nodes.tau.reshape(-1, len(s))
    total = np.zeros(len(at))
    for side in (1.0, -1.0):

        def strength(distance: float, side: float = side) -> Array:
            y = distance * force.size(row)
            there = q.copy()
            there[row] = level + side * y
            found: Array = np.asarray(force.own.law.third(there, theta, force.c))[row, row, row] * y**1.5
            return found

        # K is the limit of a function that is smooth in y
        limit = (4.0 * strength(_NEAR) - strength(4.0 * _NEAR)) / 3.0
        for i, corner in enumerate(at):
            if slope[i] * side > 0.0:
                away = np.mod(nodes - corner, 2.0 * np.pi)
            else:
                away = np.mod(corner - nodes[:, ::-1], 2.0 * np.pi)
            length = away[np.argmin(away[:, 0]), -1] / s[-1] ** 2
            total[i] += 2.0 * limit[i] / np.sqrt(abs(slope[i]) ** 3 * length)
    weights = np.zeros((len(q),) * 3 + (len(at),))
    weights[row, row, row] = -(1.0 + float((share / s**2).sum())) * total
    return Third(zr, zi, weights, None)


def _corner(force: NodalForce, row: int, level: float, at: Array) -> Third:
    """Dirac functions and their derivatives at one corner."""
    law, c = force.own.law, force.c
    zr, zi = np.cos(at), np.sin(at)
    q, theta = force.state_at(zr, zi)
    rates = _rates_of_state(force, zr, zi)
    scale = force.size(row)

    def bend(distance: float) -> Array:
        """Jumps of f_rs."""
        sides = []
        for sign in (1.0, -1.0):
            there = q.copy()
            there[row] = level + sign * distance * scale
            sides.append(law.curvature(there, theta, c)[row])
        found: Array = sides[0] - sides[1]
        return found

    eta = force.jump(row, level, q, theta)
    if isinstance(force.kind, CornerSampling) and force.kind.rough:
        # a jump between half powers: those of -1/2 and 1/2 in the distance cancel
        by = -2.0 * bend(_NEAR) + 5.0 * bend(4.0 * _NEAR) - 2.0 * bend(16.0 * _NEAR)
    else:
        by = bend(BESIDE)
    by[row] *= 0.5
    along = np.einsum("sn,sn->n", by, rates[0])
    if force.own.harmonic:
        jumps = [force.jump(row, level, q, theta + share * _PHASE) for share in (1.0, -1.0, 2.0, -2.0)]
        along += force.basis.nu * (8.0 * (jumps[0] - jumps[1]) - (jumps[2] - jumps[3])) / (12.0 * _PHASE)
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
