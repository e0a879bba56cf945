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
from suboctave.floquet.symmetric import symmetric_functions
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


@lru_cache(maxsize=64)
def _vibrations(linear: LinearPart) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Exponents (2 N,), what a force changes in each, (2 N, N), and the displacements of each, (N, 2 N)."""
    mass, damping, stiffness = linear.equation_of_motion()
    n = len(mass)
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    exponents, right = np.linalg.eig(flow)
    order = np.lexsort((exponents.imag, exponents.real, np.abs(exponents)))
    right = right[:, order].astype(complex)
    left = np.linalg.pinv(right)
    return exponents[order].astype(complex), left[:, n:] @ inverse, right[:n]


def grip(state: BalanceState, multipliers: ComplexArray) -> Grip:
    """What elements may do to the vibrations of a structure along a motion with these multipliers."""
    exponents, left, right = _vibrations(state.linear)
    count, turns = len(exponents), np.abs(exponents.imag) / state.rate
    apart = np.abs(turns[:, None] - turns)
    # a vibration with itself resonates at twice its frequency
    apart[np.arange(count), np.arange(count)] = 2.0 * turns
    lowest = np.maximum(apart.astype(int) - 1, 0)
    coupling = np.zeros((count, count))
    for channel in state.channels:
        pushed = np.abs(left @ state.linear.expand(channel.out))
        for i, d in enumerate(channel.ins):
            rate = _envelope(channel.stiffness(i))[np.minimum(lowest, state.balance.top)]
            if channel.moving:  # its mean takes or gives energy by itself
                rate = rate + np.abs(channel.damping(i)).max() * np.abs(exponents)
            coupling += rate * np.multiply.outer(pushed, np.abs(state.linear.expand(d) @ right))
    loss = -exponents.real
    with np.errstate(divide="ignore", invalid="ignore"):
        strengths = coupling * coupling.T / np.multiply.outer(loss, loss)
    strengths[~(loss > 0.0)] = strengths[:, ~(loss > 0.0)] = np.inf
    if len(multipliers) != count:
        return Grip(np.full(count, -1), strengths)
    return Grip(_places(multipliers, np.exp(exponents * (2.0 * np.pi / state.rate))), strengths)


def _envelope(spectrum: ComplexArray) -> Array:
    """The largest modulus among the Fourier coefficients from each one on."""
    largest: Array = np.maximum.accumulate(np.abs(spectrum)[::-1])[::-1]
    return largest


def of_those_moved(motions: Sequence[tuple[ComplexArray, Grip]]) -> list[Array]:
    """The symmetric functions, (2, 3) each, of neighbouring motions without the multipliers that elements cannot bring
    to the circle at any of them; empty where these cannot be told.
    """
    if len({len(mu) for mu, _ in motions}) > 1:
        return []
    coupled = np.max([known.strengths for _, known in motions], axis=0) >= _SMALL
    told = np.all([known.places >= 0 for _, known in motions], axis=0) & ~coupled.diagonal()
    told[(coupled & told & told[:, None]).any(axis=0)] = False
    beside = told & coupled[~told].any(axis=0)
    functions = []
    for mu, known in motions:
        moved, others = np.delete(mu, known.places[told]), mu[known.places[beside]]
        own = symmetric_functions(moved)
        pairs = np.multiply.outer(others, moved).ravel()
        # they come in conjugate pairs, but where both are real
        negative = (np.abs(pairs.imag) <= 1e-12 * np.abs(pairs)) & (pairs.real > 1.0)
        own[0, 2] *= (-1.0) ** np.count_nonzero(negative)
        with np.errstate(divide="ignore"):
            own[1, 2] += float(np.sum(np.log(np.abs(1.0 - pairs)) - 0.5 * np.log1p(np.abs(pairs) ** 2)))
        functions.append(own)
    return functions


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
            away = abs(mu[i] - linear[j])
            if away < best:
                best, nearest[i] = away, j
    for j in range(m):
        best = _SHARE * (1.0 - abs(linear[j]))
        for i in range(m):
            away = abs(mu[i] - linear[j])
            if away <= best:
                best, place[j] = away, i
        if place[j] >= 0 and nearest[place[j]] != j:
            place[j] = -1
    return place
