"""Multipliers that elements cannot bring to the unit circle, and the symmetric functions of all others.

A structure has many vibrations in a period. The multiplier of each turns fast as the frequency changes, and with it
the symmetric functions of all of them, though elements may do next to nothing to most. How much they may do is bounded:
with s_j the exponents of the linear structure, l_j and r_j its left and right vectors, and k_q the Fourier coefficients
of the elements' stiffness along d, elements couple two vibrations by at most

    c_ij = sum |k_q| |l_i . d_out| |d_in . r_j|,    q omega / nu = |Im s_i| + |Im s_j| or the difference,

which makes them grow, at a resonance between them, at the rate `sqrt(c_ij c_ji)`, to first order; a damping takes
`sqrt(Re s_i Re s_j)` from it (Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, section 5.4). A pair may only become
unstable where `g_ij = c_ij c_ji / (Re s_i Re s_j)` is at least one. A vibration with small ones, whose multiplier is
found close to that of the linear structure, is left out of the functions, or of the product of pairs all but those with
the vibrations with which it is not small.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.symmetric import multiply
from suboctave.harmonic.aft.channel import Group
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.linear_part import LinearPart

#: `g_ij` up to which a pair stays what it is; the share of its distance from the circle by which a multiplier may
#: then be moved
_SMALL, _SHARE = 0.25, 0.5


class Grip(NamedTuple):
    """For every vibration of the linear structure, in an order that no frequency changes: which multiplier of a motion
    it has, -1 if none can be told, (2 N,), and what elements may do to each pair, g_ij (2 N, 2 N).
    """

    places: np.ndarray
    strengths: Array


class _Exchange(NamedTuple):
    """Vibrations and the channels that couple them: exponents (2 N,), and of every input of a channel how much a force
    there pushes each, and how much of each is read there, (C, 2 N).
    """

    exponents: ComplexArray
    pushed: Array
    read: Array


@lru_cache(maxsize=16)
def _exchange(linear: LinearPart, groups: tuple[Group, ...]) -> _Exchange:
    mass, damping, stiffness = linear.equation_of_motion()
    n = len(mass)
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    exponents, right = np.linalg.eig(flow)
    order = np.lexsort((exponents.imag, exponents.real, np.abs(exponents)))
    right = right[:, order].astype(complex)
    left = np.linalg.pinv(right)[:, n:] @ inverse
    pairs = [(linear.expand(group.direction), linear.expand(d)) for group in groups for d in group.inputs]
    pushed = np.array([np.abs(left @ out) for out, _ in pairs]).reshape(-1, 2 * n)
    read = np.array([np.abs(d @ right[:n]) for _, d in pairs]).reshape(-1, 2 * n)
    return _Exchange(exponents[order].astype(complex), pushed, read)


def grip(state: BalanceState, multipliers: ComplexArray) -> Grip:
    """What elements may do to the vibrations of a structure along a motion with these multipliers."""
    exchange = _exchange(state.linear, state.balance.all_groups)
    count, (of_stiffness, of_damping) = len(exchange.exponents), np.abs(state.tangent_spectra)
    # the largest among the Fourier coefficients from each one on; the mean of damping takes or gives energy by itself
    stiffness = np.ascontiguousarray(np.maximum.accumulate(of_stiffness[:, ::-1], axis=1)[:, ::-1])
    damping = np.maximum.reduce(of_damping, axis=1)
    strengths = np.empty((count, count))
    _strengths(exchange.exponents, exchange.pushed, exchange.read, stiffness, damping, state.rate, strengths)
    if len(multipliers) != count:
        return Grip(np.full(count, -1), strengths)
    return Grip(_places(multipliers, np.exp(exchange.exponents * (2.0 * np.pi / state.rate))), strengths)


@kernel(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")
def _strengths(exponents, pushed, read, stiffness, damping, rate, out):
    """g_ij into `out` (2 N, 2 N); stiffness (C, top + 1): the largest of the Fourier coefficients from each one on,
    damping (C,): that of all; others: see `_Exchange`.
    """
    count, top = exponents.shape[0], stiffness.shape[1] - 1
    coupling, lowest = np.zeros((count, count)), np.empty(count, dtype=np.int64)
    turns, sizes = np.abs(exponents.imag) / rate, np.abs(exponents)
    for i in range(count):
        for j in range(count):
            # a vibration with itself resonates at twice its frequency
            apart = abs(turns[i] - turns[j]) if i != j else 2.0 * turns[i]
            lowest[j] = max(int(min(apart, top + 1.0)) - 1, 0)
        for c in range(pushed.shape[0]):
            for j in range(count):
                held = stiffness[c, lowest[j]] + damping[c] * sizes[j]
                coupling[i, j] += held * pushed[c, i] * read[c, j]
    for i in range(count):
        for j in range(count):
            a, b = -exponents[i].real, -exponents[j].real
            out[i, j] = coupling[i, j] * coupling[j, i] / (a * b) if a > 0.0 and b > 0.0 else np.inf


def of_those_moved(multipliers: Sequence[ComplexArray], grips: Sequence[Grip], k: int) -> Array:
    """fold, double or torus (k = 0, 1, 2) of neighbouring motions with multipliers (m,) each, without those that
    elements cannot bring to the circle at any of them, (N, 2, 1).
    """
    coupled = np.zeros(grips[0].strengths.shape, dtype=bool)
    for one in grips:
        coupled |= one.strengths >= _SMALL
    function = np.empty((len(grips), 2, 1))
    _moved(np.array(multipliers), np.array([one.places for one in grips]), coupled, k, function)
    return function


@kernel()
def _moved(multipliers, places, coupled, k, function):
    """`of_those_moved` into `function` (N, 2, 1); multipliers, places (N, m), coupled (m, m): which pairs may become
    unstable.
    """
    motions, count = places.shape
    alone = np.ones(count, dtype=np.bool_)
    for i in range(count):
        alone[i] = not coupled[i, i]
        for q in range(motions):
            alone[i] = alone[i] and places[q, i] >= 0
    told, beside = alone.copy(), np.zeros(count, dtype=np.bool_)
    for i in range(count):
        for j in range(count):
            if alone[i] and alone[j] and coupled[j, i]:
                told[i] = False
    for i in range(count):
        for j in range(count):
            beside[i] = beside[i] or (told[i] and not told[j] and coupled[j, i])
    for q in range(motions):
        # of each multiplier: 2 if it is moved, 1 if it counts with these all the same, 0 if not
        counts = np.full(multipliers.shape[1], 2)
        for i in range(count):
            if told[i]:
                counts[places[q, i]] = 1 if beside[i] else 0
        column = np.empty((counts.shape[0], counts.shape[0]), dtype=np.int64)
        for i in range(counts.shape[0]):
            for j in range(counts.shape[0]):
                column[i, j] = 0 if counts[i] + (counts[j] if k == 2 else 1) > 2 else -1
        multiply(multipliers[q], k, column, function[q, :, :1])


@kernel()
def _places(mu, linear):
    """For every multiplier of the linear structure (m,) which of `mu` (m,) it is, each the other's nearest and closer
    than a share of the distance from the circle; -1 for none.
    """
    m = mu.shape[0]
    place, nearest = np.full(m, -1), np.full(m, -1)
    for i in range(m):
        best = np.inf
        for j in range(m):
            away = (mu[i].real - linear[j].real) ** 2 + (mu[i].imag - linear[j].imag) ** 2
            if away < best:
                best, nearest[i] = away, j
    for j in range(m):
        best = max(_SHARE * (1.0 - abs(linear[j])), 0.0) ** 2
        for i in range(m):
            away = (mu[i].real - linear[j].real) ** 2 + (mu[i].imag - linear[j].imag) ** 2
            if away <= best:
                best, place[j] = away, i
        if place[j] >= 0 and nearest[place[j]] != j:
            place[j] = -1
    return place
