"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period on
panels that follow the laws (`panels`), by kernels for one (`single`) and for several DOFs (`several`).

A motion of H harmonics is not quite the true one: it leaves the force `r = sum d (f - P_H f)` unbalanced, P_H f the
part of the element forces within the basis. One step of Newton's method in the space of periodic functions
(Kantorovich),

    M d'' + (C + sum f_v d d^T) d' + (K + sum f_u d d^T) d = -r,   d periodic,

whose propagator is at hand, gives what the motion lacks: harmonics beyond H without end, and the shift that they cause
in those within. The multipliers are those of the motion so corrected; the distance between theirs and those of the
motion as it stands, propagated with coarser steps, is their error estimate. It bounds what remains: an error of the
second order.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import lapack

from suboctave.harmonic.basis import Array
from suboctave.harmonic.state import BalanceState
from suboctave.stability.linearisation import Linearisation
from suboctave.stability.panels import NODES
from suboctave.stability.result import FloquetResult
from suboctave.stability.several import POWERS, corrected_several, perturbed, standing_several, weighted
from suboctave.stability.single import BETWEEN, STEPS, corrected, standing

#: a correction larger than this share of the motion is cut down to it
_LARGEST = 0.1
#: a correction is taken as it is where its effect stays below this share of what it may be
_MODEST = 0.1

__all__ = ["FloquetResult", "floquet_multipliers"]


def floquet_multipliers(state: BalanceState) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods)."""
    along = Linearisation(state)
    mass, damping, stiffness = state.linear.equation_of_motion()
    if len(mass) == 1:
        return _single(along, mass[0, 0], damping[0, 0], stiffness[0, 0])
    return _several(along, mass, damping, stiffness)


def _single(along: Linearisation, mass: float, damping: float, stiffness: float) -> FloquetResult:
    """One degree of freedom: the multipliers are the roots of `mu^2 - trace mu + exp(-int c dt)`."""
    linear, scale = along.state.linear, 1.0 / along.state.rate
    shape = np.array([linear.expand(direction)[0] for direction in along.directions])
    matrices = (mass, damping, stiffness)
    trace, decay, change, _ = standing(
        along.stretch,
        scale,
        along.path,
        along.law,
        along.base,
        along.moving,
        shape,
        matrices,
        STEPS,
        BETWEEN,
        NODES,
        _LARGEST,
    )
    before = _roots(trace, decay)
    law, kick = along.changed(change)
    after = _roots(*corrected(along.stretch, scale, law, along.base, kick, along.moving, shape, matrices, STEPS))
    shift = [abs(a - b) for a, b in zip(after, before, strict=True)]
    return FloquetResult(np.array(after, dtype=complex), np.array(shift))


def _roots(trace: float, decay: float) -> tuple[complex, complex]:
    """Roots of `mu^2 - trace mu + exp(-decay)`, the larger one first."""
    product = math.exp(-decay)
    square = 0.25 * trace * trace - product
    if square < 0.0:
        part = math.sqrt(-square)
        return complex(0.5 * trace, part), complex(0.5 * trace, -part)
    larger = 0.5 * trace + math.copysign(math.sqrt(square), trace)
    return larger, product / larger if larger != 0.0 else 0.0


def _several(along: Linearisation, mass: Array, damping: Array, stiffness: Array) -> FloquetResult:
    """Several degrees of freedom."""
    n, linear, scale = len(mass), along.state.linear, 1.0 / along.state.rate
    shapes = np.array([linear.expand(direction) for direction in along.directions], dtype=float).reshape(-1, n)
    matrices = weighted(mass, damping, stiffness, shapes)
    about = (along.moving, along.varying, matrices, POWERS, NODES)
    before, change, _, alone = standing_several(
        along.stretch, scale, along.path, along.law, along.base, *about, _LARGEST
    )
    law, kick = along.changed(change)
    after = corrected_several(along.stretch, scale, law, along.base, kick, *about, alone)
    real, imaginary, left, right, _ = lapack.dgeev(after, 1, 1)
    return FloquetResult(*perturbed(real, imaginary, left, right, after, after - before))
