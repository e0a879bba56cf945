"""Multipliers of a motion with structural damping, which has no equation of motion in time.

Structural damping is a force `i S x` at every frequency, and a perturbation `exp(i kappa t) sum_k phi_k exp(i k w0 t)`
of a motion has frequencies: it exists if

    J_kappa phi = 0,    S acting by the sign of k w0 + Re kappa    (`harmonic.perturbation`),

and decays by `mu = exp(2 pi i kappa / w0)` in a period. At real kappa that is the equation which limit points, period
doublings and Neimark-Sacker points are singularities of, so that multipliers cross the circle where these are. A mean
that does not oscillate is not damped by S, one that oscillates slowly is: pairs of multipliers do not begin exactly
where two real ones meet.

The search begins at the multipliers of the viscous equivalent, whose modes are damped as much at their own frequencies:
Newton's method on the determinant, with Aberth's correction (Math. Comp. 27 (1973) 339-344), which keeps roots apart,
and for pairs within 0 < Re kappa < w0 / 2, where the determinant is analytic. Two real multipliers of the equivalent
without roots may be a pair: structural damping parts or joins two at another place. A multiplier without a root near it
belongs to a vibration that elements hardly see, and stays where it is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suboctave.floquet.result import FloquetResult
from suboctave.floquet.symmetric import EQUAL
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import operator_at

#: multipliers of the viscous equivalent, in modulus, that structural damping may bring to the circle
_NEAR = 0.1
#: pairs that are searched for at once, the nearest to the circle first, and how many times what structural damping has
#: moved them those are away from the circle that need no search
_AT_ONCE, _BEYOND = 4, 3.0
#: most steps, the last one, and the distance over which a determinant is differentiated, in units of the base frequency
_STEPS, _CLOSE, _APART = 20, 1e-10, 1e-7
#: farthest from where its search began that a root is taken for the same, in units of the base frequency, and distance
#: up to which two are one
_FAR, _SAME = 0.2, 1e-8
#: least distance from 0 and w0 / 2 at which the search for a pair begins, in units of the base frequency, and the share
#: of its distance that one step leaves
_INSIDE, _LEFT = 0.01, 0.3
#: how much of its decay in a period is in doubt, of a multiplier that was not found
_DOUBT = 0.5


def with_structural_damping(state: BalanceState, viscous: FloquetResult) -> FloquetResult:
    """The multipliers of a motion whose system has structural damping, from those of its viscous equivalent."""
    if not viscous.applicable:
        return viscous
    mu, errors = viscous.multipliers.copy(), viscous.errors.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        decay, exponent = np.log(np.abs(mu)), np.log(mu) / (2j * math.pi)
    near = np.flatnonzero(np.abs(mu) > _NEAR)
    errors[near] = np.maximum(errors[near], _DOUBT * np.abs(decay[near] * mu[near]))
    known: list[complex] = []
    pairs = [(own, _equal_to(mu, mu[own[0]].conjugate())) for own in _families(mu, near[mu[near].imag > 0.0])]
    for side in (1.0, -1.0):
        real = _families(mu, near[(mu[near].imag == 0.0) & (side * mu[near].real > 0.0)])
        roots = _roots(state, exponent[[own[0] for own in real]], real, known, True)
        for own, root in zip(real, roots, strict=True):
            if root is not None:
                mu[own], errors[own] = np.exp(2j * math.pi * root).real, viscous.errors[own]
        left = [own for own, root in zip(real, roots, strict=True) if root is None]
        pairs += zip(left[::2], left[1::2], strict=False)
    moved = float(np.abs(np.log(np.abs(mu[near])) - decay[near]).max(initial=0.0))
    middle = [complex(exponent[own[0]].real, exponent[[own[0], other[0]]].imag.mean()) for own, other in pairs]
    order = sorted(range(len(pairs)), key=lambda i: abs(middle[i].imag))
    for group in (order[k : k + _AT_ONCE] for k in range(0, len(order), _AT_ONCE)):
        if 0.0 < _BEYOND * moved < 2.0 * math.pi * abs(middle[group[0]].imag):
            break
        roots = _roots(state, np.array([middle[i] for i in group]), [pairs[i][0] for i in group], known, False)
        for i, root in zip(group, roots, strict=True):
            if root is not None:
                (own, other), one = pairs[i], complex(np.exp(2j * math.pi * root))
                moved = max(moved, 2.0 * math.pi * abs(root.imag - middle[i].imag))
                mu[own], mu[other] = one, one.conjugate()
                errors[own] = errors[other] = viscous.errors[own[0]]
    falling = np.argsort(-np.abs(mu), kind="stable")
    return replace(viscous, multipliers=mu[falling], errors=errors[falling], method="structural damping")


def _equal_to(mu: ComplexArray, one: complex) -> np.ndarray:
    """Which multipliers equal one."""
    return np.flatnonzero(np.abs(mu - one) <= EQUAL * abs(one))


def _families(mu: ComplexArray, which: np.ndarray) -> list[np.ndarray]:
    """Some multipliers as sets of equal ones, which those of equal sectors are."""
    families: list[np.ndarray] = []
    for i in which:
        if not any(i in own for own in families):
            families.append(np.intersect1d(_equal_to(mu, complex(mu[i])), which))
    return families


def _roots(
    state: BalanceState, start: ComplexArray, families: list[np.ndarray], known: list[complex], on_axis: bool
) -> list[complex | None]:
    """Roots kappa of det J_kappa in units of the base frequency, None where none was found; `known` are those found
    before, to which they are added.

    start: all with the real part 0, all with 1 / 2 (`on_axis`), or all between; families: a root is as many fold as it
    has multipliers.
    """
    if not len(start):
        return []
    high = state.basis.harmonics
    # closed under conjugation where the determinant is real
    waves = np.arange(-high - int(on_axis and start[0].real != 0.0), high + 1)
    kappa, step = start.copy(), np.full(len(start), np.inf, dtype=complex)
    if not on_axis:
        kappa.real = np.clip(kappa.real, _INSIDE, 0.5 - _INSIDE)
    left, fold = np.arange(len(start)), np.array([float(len(own)) for own in families])
    for _ in range(_STEPS):
        # near a root of several folds the determinant is no line over more than a part of the way
        ahead = 1j * np.minimum(_APART, 0.1 * np.abs(step[left]))
        both = np.concatenate((kappa[left], kappa[left] + ahead))
        sign, log = np.linalg.slogdet(operator_at(state, (both[:, None] + waves) * state.rate))
        (sign, turned), (log, longer) = np.split(sign, 2), np.split(log, 2)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            newton = np.where(sign == 0.0, 0.0, -ahead / (turned / sign * np.exp(longer - log) - 1.0))
            # Aberth's correction: each stays away from where the others are going
            apart = kappa[left][:, None] - np.append(kappa, known)
            apart[np.arange(len(left)), left] = np.inf
            newton = fold[left] * newton / (1.0 + newton * np.sum(np.append(fold, np.ones(len(known))) / apart, axis=1))
        if on_axis:
            newton = 1j * newton.imag
        else:
            room = _LEFT * np.minimum(kappa[left].real, 0.5 - kappa[left].real)
            newton.real = np.clip(kappa[left].real + newton.real, room, 0.5 - room) - kappa[left].real
        step[left] = newton
        kappa[left] += newton
        left = left[(np.abs(step[left]) > _CLOSE) & (np.abs(kappa[left] - start[left]) <= _FAR)]
        if not len(left):
            break
    roots: list[complex | None] = []
    for root, last, begun, own in zip(kappa.tolist(), step.tolist(), start.tolist(), families, strict=True):
        found = abs(last) <= _CLOSE and abs(root - begun) <= _FAR and all(abs(root - one) > _SAME for one in known)
        roots.append(root if found else None)
        known += [root] * len(own) if found else []
    return roots
