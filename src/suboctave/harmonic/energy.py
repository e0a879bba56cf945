"""Energy of a motion, action, and the position of rest that energies are measured from.

    E = x' . M x' / 2 + (x . K x - r . K r) / 2 + int f . dx - p . (x - r),

the work of the element forces f taken along the straight way from rest r to x, where velocities are zero, p the
constant loads. It is constant along a motion of a conservative system; else its mean over a period is meant. With J the
action, `dE = omega dJ` along a family of conservative motions, and `omega J` is twice the mean kinetic energy where no
gyroscopic forces act.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from suboctave.errors import ConvergenceError
from suboctave.harmonic.aft.law import Member
from suboctave.harmonic.assembly import apply_blocks
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance, length
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import levels

#: Gauss nodes between rest, corners of a law and a displacement
_NODES = 24
#: corrections for the position of rest, and the last one in units of the position
_CORRECTIONS, _STILL = 50, 1e-13


def at_rest(balance: HarmonicBalance, omega: float, values: Mapping[str, float]) -> BalanceState:
    """The system at rest under its constant loads, as a motion; ConvergenceError where none is found.

    `omega` is the frequency that loads may depend on.
    """
    n = balance.size
    balance = balance.with_basis(HarmonicBasis(max(1, balance.highest_load)))
    x = np.zeros((balance.basis.size, n))
    for _ in range(_CORRECTIONS):
        state = balance.at(x, omega, values)
        force = state.residual[:n]
        if not force.any():
            return state
        step = np.asarray(np.linalg.lstsq(state.jacobian[:n, :n], force, rcond=None)[0], dtype=float)
        x[0] -= step
        if length(step) <= _STILL * length(x[0]):
            return balance.at(x, omega, values)
    raise ConvergenceError("no equilibrium under the constant loads was found from zero")


#: zeta whose forces are lost among those of inertia
_ROUNDING = float(np.finfo(float).eps)
#: most corrections of zeta, and change of it, absolute and relative, that is none
_REPEATED, _REMAINS = 30, 1e-15


def fed(state: BalanceState, zeta: float) -> BalanceState:
    """A motion with a damping of `-2 zeta omega` per unit of mass besides."""
    if abs(zeta) <= _ROUNDING:
        return state
    linear = state.linear.fed(2.0 * zeta * state.omega)
    return BalanceState(state.balance, linear, state.x, state.omega, state.values)


def action(state: BalanceState) -> float:
    """`1 / (2 pi)` times the integral of `p . x'` over the period of the motion, `p = M x' + G x / 2` with G the
    gyroscopic part of the damping matrix.
    """
    mass, damping, _ = state.linear.equation_of_motion()
    moving = state.recovered
    velocity = 1j * state.frequencies[:, None] * moving
    momentum = velocity @ mass.T + 0.25 * moving @ (damping - damping.T).T
    return 0.5 * float(np.vdot(velocity, momentum).real) / state.rate


def twice_kinetic(state: BalanceState) -> float:
    """The mean of `x' . M x'`, twice the kinetic energy."""
    mass, velocity = state.linear.equation_of_motion()[0], 1j * state.frequencies[:, None] * state.recovered
    return 0.5 * float(np.vdot(velocity, velocity @ mass.T).real)


def modal_amplitude(state: BalanceState) -> float:
    """`sqrt(c . M c)`, c the complex amplitudes at omega: that of a mode shape with unit modal mass."""
    mass, c = state.linear.equation_of_motion()[0], state.recovered[state.basis.nu]
    return math.sqrt(max(float((c.conj() @ mass @ c).real), 0.0))


def damping_ratio(state: BalanceState) -> float:
    """zeta with which a damping of -2 zeta omega per unit of mass balances the work of the forces over a period."""
    zeta = 0.0
    for _ in range(_REPEATED):
        missing = _missing(fed(state, zeta))
        zeta += missing
        if abs(missing) <= _REMAINS * (1.0 + abs(zeta)):
            break
    return zeta


def _missing(state: BalanceState) -> float:
    """What zeta lacks if the whole structure keeps its motion: that of a condensed one zeta moves, but the quotient is
    stationary there, like Rayleigh's.
    """
    moving = state.basis.derivative(state.x)
    work = 4.0 * state.omega * twice_kinetic(state) / state.rate
    return float(np.vdot(moving, state.residual.reshape(moving.shape))) / (work or 1.0)


def action_gradient(state: BalanceState) -> Array:
    """The derivatives of `-4` times the action by X, (dimension,), and omega, of a conservative motion: the action is
    `-1/4` times the sum of `k c . (dA/dOmega) c` over its harmonics c.
    """
    bend = state.basis.multiples[:, None, None] ** 2 * state.linear.stiffness(state.frequencies, 2)
    held = apply_blocks(state.slope, state.x)
    return np.append(2.0 * held, float(np.vdot(state.x, apply_blocks(bend, state.x))))


def action_along(state: BalanceState, motion: Array, omega: float) -> float:
    """The change of the action along changes of X, (dimension,), and omega, relative to it."""
    slope = action_gradient(state)
    # the action is a square of X
    whole = 0.5 * float(slope[:-1] @ state.unknowns)
    return float(slope @ np.append(motion, omega)) / (whole or 1.0)


def mean_energy(state: BalanceState) -> float:
    """The mean of the energy over a period, zero at rest."""
    linear, n = state.linear, state.balance.system.n
    still = at_rest(state.balance, state.omega, state.values).recovered[0].real
    moving = state.recovered
    count = 4 * state.basis.harmonics + 4
    tau = 2.0 * np.pi * np.arange(count) / count
    waves = np.exp(1j * np.multiply.outer(tau, np.arange(len(moving))))
    y, rate = np.real(waves @ moving), np.real((waves * (1j * state.frequencies)) @ moving)
    mass, _, stiffness = linear.equation_of_motion()
    way = y - still
    energy = 0.5 * (np.sum(rate * (rate @ mass), axis=1) + np.sum(way * ((y + still) @ stiffness), axis=1))
    for member in state.laws.members:
        inputs, out = (linear.seen(d) for d in (member.element.inputs(n), member.element.direction(n)))
        energy += _mean_force(member, inputs @ still, inputs @ way.T) * (way @ out)
    values = {**state.values, "omega": state.omega}
    for component in state.balance.system.load_components():
        if component.harmonic == 0:
            force = component.amplitude.value(values) * math.cos(component.phase.value(values))
            energy -= force * (way @ linear.seen(component.direction))
    return float(energy.mean())


def _mean_force(member: Member, rest: Array, way: Array) -> Array:
    """The mean of a law's force along straight ways (m, N) from rest (m,) at zero velocity, (N,)."""
    law = as_coupled(member.element)
    corners = [(level - rest[0]) / np.where(way[0] == 0.0, np.inf, way[0]) for level in levels(*member[2:4])]
    count = way.shape[1]
    ends = np.sort(np.clip([np.zeros(count), *corners, np.ones(count)], 0.0, 1.0), axis=0)
    nodes, weights = _gauss()
    spans = np.diff(ends, axis=0)[:, None]
    share = (ends[:-1, None] + spans * nodes[:, None]).reshape(-1, count)
    q = rest[:, None, None] + share * way[:, None]
    still = np.zeros_like(q) if member.element.depends_on_velocity else q[:0]
    states = np.concatenate((q, still)).reshape(-1, share.size)
    force = np.asarray(law.tangent(states, np.zeros(share.size), member.coefficients)[0]).reshape(share.shape)
    mean: Array = np.sum((spans * weights[:, None]).reshape(share.shape) * force, axis=0)
    return mean


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array]:
    """Nodes and weights on (0, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights
