"""The modes of a system's small vibrations about its position of rest.

With K and C the stiffness and damping of the structure and the slopes of the laws at rest: of `lambda^2 M + lambda C +
K`, those that oscillate, by ascending frequency Im lambda; with C = 0 and K symmetric of `K - omega^2 M`.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState

#: share of the largest eigenvalue, or of the size of a matrix, that is rounding
_ROUNDING = 1e-12


def linear_modes(rest: BalanceState) -> tuple[Array, ComplexArray]:
    """Circular frequencies (m,) and shapes in the unknowns (m, size), of unit modal mass but for the damping.

    `rest`: the position of rest, as a motion of one harmonic (`energy.at_rest`).
    """
    linear, n = rest.linear, rest.balance.size
    mass, damping, stiffness = linear.equation_of_motion()
    slopes, expand = rest.force_jacobian, linear.expand(np.eye(n))
    stiffness = stiffness + expand.T @ slopes[n : 2 * n, n : 2 * n] @ expand
    damping = damping + expand.T @ slopes[n : 2 * n, 2 * n : 3 * n] @ expand / rest.rate
    skew = np.abs(stiffness - stiffness.T).max() > _ROUNDING * np.abs(stiffness).max()
    if skew or damping.any():
        values, vectors = _oscillating(mass, damping, stiffness)
    else:
        squares, shapes = scipy.linalg.eigh(stiffness, mass)
        moving = squares > _ROUNDING * np.abs(squares).max()
        values, vectors = np.sqrt(squares[moving]), shapes[:, moving].astype(complex)
    sizes = np.sqrt(np.einsum("im,ij,jm->m", vectors.conj(), mass, vectors).real)
    return values, (expand @ (vectors / sizes)).T


def _oscillating(mass: Array, damping: Array, stiffness: Array) -> tuple[Array, ComplexArray]:
    """Frequencies and shapes (N, m), turned so that they are as real as can be."""
    n = len(mass)
    inverse = np.linalg.inv(mass)
    whole = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    values, vectors = np.linalg.eig(whole)
    moving = values.imag > _ROUNDING * np.abs(values).max()
    order = np.flatnonzero(moving)[np.argsort(values.imag[moving], kind="stable")]
    shapes = vectors[:n, order]
    turns = np.exp(-0.5j * np.angle(np.sum(shapes * (mass @ shapes), axis=0)))
    return values.imag[order], shapes * turns
