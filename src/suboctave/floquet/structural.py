"""Multipliers of a motion with structural damping, which has no equation of motion in time.

Structural damping is a force `i S x` at every frequency, and a perturbation `exp(i kappa t) sum_k phi_k exp(i k w0 t)`
of a motion has frequencies: it exists if

    J_kappa phi = 0,    S acting by the sign of k w0 + Re kappa    (`harmonic.perturbation`),

and decays by `mu = exp(2 pi i kappa / w0)` in a period. At real kappa that is the equation which limit points, period
doublings and Neimark-Sacker points are singularities of, so that multipliers cross the circle where these are. A mean
that does not oscillate is not damped by S, one that oscillates slowly is: pairs of multipliers do not begin exactly
where two real ones meet.

The search begins at the multipliers of the viscous equivalent, whose modes are damped as much at their own frequencies:
Newton's method on the determinant, with Aberth's correction (Math. Comp. 27 (1973) 339-344), which keeps roots that are
searched for together apart. A multiplier without a root near it belongs to a vibration that elements hardly see, and
stays where it is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import operator_at

#: multipliers of the viscous equivalent, in modulus, that structural damping may bring to the circle
_NEAR = 0.1
#: pairs that are searched for at once, the nearest to the circle first, and how many times what structural damping has
#: moved them those are away from the circle that need no search
_AT_ONCE, _BEYOND = 4, 3.0
#: most steps, the last one, and the distance over which a determinant is differentiated, in units of the base frequency
_STEPS, _CLOSE, _APART = 10, 1e-10, 1e-7
#: farthest from where its search began that a root is taken for the same, in units of the base frequency, and distance
#: up to which two are one
_FAR, _SAME = 0.2, 1e-8
#: how much of its decay in a period is in doubt, of a multiplier that was not found
_DOUBT = 0.5


def with_structural_damping(state: BalanceState, viscous: FloquetResult) -> FloquetResult:
    """The multipliers of a motion whose system has structural damping, from those of its viscous equivalent."""
    if not viscous.applicable:
        return viscous
    mu, errors = viscous.multipliers.copy(), viscous.errors.copy()
    with np.errstate(divide="ignore"):
        decay = np.log(np.abs(mu))
    near = np.flatnonzero(np.abs(mu) > _NEAR)
    errors[near] = np.maximum(errors[near], _DOUBT * np.abs(decay[near] * mu[near]))
    real = near[mu[near].imag == 0.0]
    pairs = near[mu[near].imag > 0.0]
    pairs = pairs[np.argsort(np.abs(decay[pairs]), kind="stable")]
    groups = [real[mu[real].real > 0.0], real[mu[real].real < 0.0]]
    groups += [pairs[i : i + _AT_ONCE] for i in range(0, len(pairs), _AT_ONCE)]
    moved = 0.0
    for group in groups:
        if not len(group):
            continue
        on_axis = bool(mu[group[0]].imag == 0.0)
        if not on_axis and 0.0 < _BEYOND * moved < np.abs(decay[group]).min():
            break
        # a pair is found with its conjugate
        others = [int(np.argmin(np.abs(mu - value.conjugate()))) for value in mu[group]]
        kappa, found = _roots(state, np.log(mu[group]) / (2j * math.pi), on_axis)
        for i in np.flatnonzero(found):
            one = np.exp(2j * math.pi * kappa[i])
            one = complex(one.real) if on_axis else complex(one)
            moved = max(moved, abs(math.log(abs(one)) - decay[group[i]]))
            mu[others[i]], mu[group[i]] = one.conjugate(), one
            errors[others[i]] = errors[group[i]] = viscous.errors[group[i]]
    order = np.argsort(-np.abs(mu), kind="stable")
    return replace(viscous, multipliers=mu[order], errors=errors[order], method="structural damping")


def _roots(state: BalanceState, start: ComplexArray, on_axis: bool) -> tuple[ComplexArray, np.ndarray]:
    """Roots kappa of det J_kappa in units of the base frequency, (G,), and which were found.

    start: all with the real part 0, all with 1 / 2 (`on_axis`), or all between.
    """
    high = state.basis.harmonics
    # closed under conjugation where the determinant is real
    waves = np.arange(-high - int(on_axis and start[0].real != 0.0), high + 1)
    kappa, step, ahead = start.copy(), np.full(len(start), np.inf, dtype=complex), 1j * _APART
    left = np.arange(len(start))
    for _ in range(_STEPS):
        both = np.concatenate((kappa[left], kappa[left] + ahead))
        sign, log = np.linalg.slogdet(operator_at(state, (both[:, None] + waves) * state.rate))
        (sign, turned), (log, longer) = np.split(sign, 2), np.split(log, 2)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            newton = np.where(sign == 0.0, 0.0, -ahead / (turned / sign * np.exp(longer - log) - 1.0))
            # Aberth's correction: each stays away from where the others are going
            apart = kappa[left][:, None] - kappa
            apart[np.arange(len(left)), left] = np.inf
            newton = newton / (1.0 + newton * np.sum(1.0 / apart, axis=1))
        step[left] = 1j * newton.imag if on_axis else newton
        kappa[left] += step[left]
        left = left[(np.abs(step[left]) > _CLOSE) & (np.abs(kappa[left] - start[left]) <= _FAR)]
        if not len(left):
            break
    found = (np.abs(step) <= _CLOSE) & (np.abs(kappa - start) <= _FAR)
    if not on_axis:
        found &= (kappa.real > 0.0) & (kappa.real < 0.5)
    for i in range(1, len(kappa)):
        found[i] &= not np.any(found[:i] & (np.abs(kappa[:i] - kappa[i]) <= _SAME))
    return kappa, found
