"""Equilibria as motions, and Hopf points among them.

An equilibrium is a motion of any frequency that does not move. In a basis of one harmonic of a frequency beyond all at
which it may oscillate, J_kappa falls into blocks, one for each of `kappa - omega, kappa, kappa + omega`, so that a pair
of eigenvalues i Omega is a Neimark-Sacker point with kappa = Omega: what holds of motions holds of equilibria.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation.linear import length
from suboctave.curves.events.locate import Guess, locate_singular
from suboctave.curves.kinds.limit_cycle import oscillating
from suboctave.curves.sample import Sample
from suboctave.curves.still import BEYOND, at_rest
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import truncation

#: how far a Hopf point may lie from the cycles that end in it, in units of the motion and of the parameter's range
_BESIDE = 0.1
#: position of rest, in units of the cycles beside it, that is rounding
_ROUNDING = 1e-12


def hopf_beside(a: Sample, b: Sample) -> TrackedEvent:
    """The Hopf point in which limit cycles end between two neighbours; ConvergenceError if it is not found there."""
    curve, near = b.curve, min((a, b), key=lambda sample: length(oscillating(sample.state)))
    rate, name = near.state.rate, curve.name
    guess = Guess(at_rest(near.state, BEYOND * rate), name, curve.span, rate, size=curve.unit(b.point.weights))
    found = locate_singular(guess, Kind.FREE)
    state = found.state
    moved = abs(guess.value(state) - guess.parameter) / curve.span, abs(found.kappa / rate - 1.0)
    if max(moved) > _BESIDE:
        raise ConvergenceError(f"the Hopf point found lies elsewhere, at {name} = {guess.value(state):.6g}")
    residual, own = found.residual, found.balance_residual
    x = state.x
    if np.abs(x).max() <= _ROUNDING * np.abs(near.state.x).max():
        # the position of rest is zero but for what Newton's method leaves of it
        x, residual, own = np.zeros_like(x), 0.0, 0.0
    orbit = stilled(PeriodicOrbit(state.balance, x, state.omega, dict(state.values), own, truncation(state), None))
    return TrackedEvent(
        "Hopf", orbit, found.floquet, residual, 0.0, name, found.vectors, found.kappa,
        curve=curve.augmentation.name, names=curve.names,
    )  # fmt: skip


def stilled(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """An equilibrium without what rounding leaves of an oscillation."""
    x = orbit.x.copy()
    x[1:] = 0.0
    return replace(orbit, x=x)


def shape_of(hopf_vector: np.ndarray, size: int, scale: Array) -> Array:
    """The oscillation that begins at a Hopf point as coefficients (3, size), of unit size in the weights of the masses.

    `hopf_vector`: the right null vector, of waves at kappa - omega, kappa, kappa + omega; `scale`: of its rows.
    """
    amplitudes = (hopf_vector * scale)[size : 2 * size]
    x = np.stack((np.zeros(size), amplitudes.real, -amplitudes.imag))
    own = scale[size : 2 * size]
    result: Array = x / np.linalg.norm(x / own)
    return result
