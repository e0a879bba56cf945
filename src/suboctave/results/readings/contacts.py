"""What an element does along a motion: its largest force, how long it is in contact, how often it is struck.

Contact is told by the place of the gap: a piecewise-linear law is in contact where one of its pieces acts, a law with a
rounded corner (`SharpSampling`) or a corner in a text where the displacement is beyond the place at which it is sharp,
on its stiffer side. The instants at which gaps are crossed are exact up to rounding (`harmonic.instants`).
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.bifurcation.gaps import contact_side, levels
from suboctave.harmonic.orbit import PeriodicOrbit, force_along
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import crossings, extrema
from suboctave.model.elements.smoothness import levels as levels_of
from suboctave.model.system import System

#: samples around each candidate, and how often the search narrows around the best of them: 16^-9 = 1e-11 of a sample
_AROUND, _ROUNDS = 33, 9
#: candidates whose surroundings are searched
_CANDIDATES = 8


def gapped_elements(system: System) -> list[int]:
    """Indices of the elements that have a gap: a displacement at which contact begins."""
    coefficients = [(element, element.coefficient_values(system.parameters)) for element in system.elements]
    return [index for index, (element, c) in enumerate(coefficients) if levels_of(element.sampling(c), c)]


def contact_of(orbit: PeriodicOrbit, element: int) -> tuple[float, int]:
    """Share of the period in which an element is in contact, and how often contact begins in one period of the motion.

    An element with several gaps is in contact where any of its sides is. One that is always in contact is never struck.
    """
    local = orbit.state().local(element)
    grid = search_grid(local.motion.shape[0] - 1)
    sides = []
    for index, level in enumerate(levels(local)):
        crossed, above = crossings(local.motion, level, grid.zr, grid.zi)
        sides.append((np.sort(crossed), bool(above), contact_side(local, index) > 0))
    every = np.sort(np.concatenate([crossed for crossed, _, _ in sides]))
    if every.size == 0:
        return (1.0 if any(above == right for _, above, right in sides) else 0.0), 0
    ends = np.append(every, every[0] + 2.0 * math.pi)
    middle = np.mod(0.5 * (ends[:-1] + ends[1:]), 2.0 * math.pi)
    touching = np.zeros(middle.size, dtype=bool)
    for crossed, above, right in sides:
        now = (np.searchsorted(crossed, middle) % 2 == 1) != above
        touching |= now == right
    share = float(np.sum(np.diff(ends)[touching]) / (2.0 * math.pi))
    return share, int(np.count_nonzero(touching & ~np.roll(touching, 1)))


def peak_force(orbit: PeriodicOrbit, element: int) -> float:
    """Largest |f| of an element over a period, of its law on the motion (not of a truncated series of the force).

    Candidates are the extrema of the displacements it reads, where a law of displacement alone that only grows has its
    peaks, and the largest samples; the surroundings of each are narrowed down to rounding.
    """
    state = orbit.state()
    motions, force = state.local(element).motions, force_along(state, element)
    high = motions[0].shape[0] - 1
    step = 2.0 * math.pi / (8 * high + 64)
    grid = search_grid(high)
    turns = np.concatenate([extrema(motion, grid.zr, grid.zi)[0] for motion in motions])
    tau = np.concatenate([turns, step * np.arange(8 * high + 64)])

    size = np.abs(force(tau))
    best = float(size.max())
    centres = tau[np.argsort(-size, kind="stable")[:_CANDIDATES]]
    offsets = np.linspace(-1.0, 1.0, _AROUND)
    for _ in range(_ROUNDS):
        around = centres[:, None] + step * offsets
        size = np.abs(force(around.ravel())).reshape(around.shape)
        centres = around[np.arange(len(centres)), size.argmax(axis=1)]
        best = max(best, float(size.max()))
        step *= 2.0 / (_AROUND - 1)
    return best
