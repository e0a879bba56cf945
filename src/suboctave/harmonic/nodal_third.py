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
    """What Gauss rules miss of `f_rrr ~ K y^-p` beside a corner, y = |q_r - level|: Hadamard's finite part.

    On the panel next to a corner instants run like the square of its variable s, `y ~ |q_r'| length s^2`, and the
    finite part of `int 2 s^(1 - 2 p) ds` over [0, 1] is `1 / (1 - p)`. The rule is exact for what is left of laws with
    half powers (p = 3/2: contact after Hertz).
    """
    s, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    zr, zi = np.cos(at), np.sin(at)
    q, theta = force.state_at(zr, zi)
    slope = _rates_of_state(force, zr, zi)[0][row]
    slope = np.where(np.abs(slope) < 1e-12 * force.size(row), 1e-12 * force.size(row), slope)
    nodes = force.nodes.tau.reshape(-1, len(s))
    weights = np.zeros((len(q),) * 3 + (len(at),))
    for side in (1.0, -1.0):
        for i, (power, strength) in enumerate(zip(*_singularity(force, row, level, side, q, theta), strict=True)):
            if not 0.1 < power < 1.95 or power == 1.0:
                continue
            if slope[i] * side > 0.0:
                away = np.mod(nodes - at[i], 2.0 * np.pi)
            else:
                away = np.mod(at[i] - nodes[:, ::-1], 2.0 * np.pi)
            length = away[np.argmin(away[:, 0]), -1] / s[-1] ** 2
            missed = 1.0 / (1.0 - power) - 2.0 * float((share * s ** (1.0 - 2.0 * power)).sum())
            weights[row, row, row, i] += missed * strength * length * (abs(slope[i]) * length) ** -power
    return Third(zr, zi, weights, None)


def _singularity(force: NodalForce, row: int, level: float, side: float, q: Array, theta: Array) -> tuple[Array, Array]:
    """Exponent p and strength K of f_rrr on one side of a corner; p = 0 where it is not singular."""
    y = _NEAR * force.size(row)

    def third(distance: float) -> Array:
        there = q.copy()
        there[row] = level + side * distance
        return np.asarray(force.own.law.third(there, theta, force.c))[row, row, row]

    near, far = third(y), third(4.0 * y)
    with np.errstate(all="ignore"):
        power = np.nan_to_num(-np.log(far / near) / np.log(4.0), posinf=0.0, neginf=0.0)
    half = np.round(2.0 * power) / 2.0
    power = np.where(np.abs(power - half) < 1e-3, half, power)
    # K is the limit of a function that is smooth in y
    strength: Array = (4.0 * near * y**power - far * (4.0 * y) ** power) / 3.0
    return power, strength


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
        by = _without_powers([bend(share * _NEAR) for share in (1.0, 4.0, 16.0)], row)
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


def _without_powers(values: list[Array], row: int) -> Array:
    """Limits of functions K + k d^-p + k' d^(1 - p) of the distance d from their values (Q, N) at d, 4 d, 16 d.

    p is that of the given row, where it is singular at all.
    """
    near, middle, far = (value[row] for value in values)
    with np.errstate(all="ignore"):
        power = np.log((near - middle) / (middle - far)) / np.log(4.0)
    half = np.round(2.0 * power) / 2.0
    power = np.where(np.abs(power - half) < 1e-2, half, power)
    power = np.where(np.isfinite(power) & (np.abs(power) > 0.02) & (np.abs(power - 1.0) > 0.02), power, 0.5)
    first, second = 4.0**-power, 4.0 ** (1.0 - power)
    limit: Array = values[0] * first * second - values[1] * (first + second) + values[2]
    return limit / ((1.0 - first) * (1.0 - second))


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
