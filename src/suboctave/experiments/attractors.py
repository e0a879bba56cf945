"""The motions that trajectories settle on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.model.system import System
from suboctave.timedomain.period_recognition import extents, period_of, same_cycle

__all__ = ["Attractor", "attractor_of", "distinct", "state_sizes"]

#: by how much more the points of two trajectories on one attractor may miss each other than those of one motion
_WIDER = 100.0


@dataclass(frozen=True, eq=False)
class Attractor:
    """What a trajectory has settled on, by its stroboscopic points.

    Attributes
    ----------
    kind
        "periodic", or "aperiodic": quasi-periodic, chaotic, of a longer period than is recognised, or not settled yet.
    period
        In periods of the load; 0 of an aperiodic motion.
    points
        (period, 2n): its states at phase 0 of the load; of an aperiodic motion all that were kept.
    amplitude
        Largest |x| of the observed degree of freedom.
    largest
        (n,): the same of all of them.
    defect
        By how much the points repeat, relative to the motion; of an aperiodic motion the best repetition found.
    omega, parameters
        Of the load, and all of the system's by name.
    count
        How many trajectories have settled on it.
    """

    kind: str
    period: int
    points: Array
    amplitude: float
    largest: Array
    defect: float
    omega: float
    parameters: Mapping[str, float]
    observed: int
    count: int = 1

    @property
    def state(self) -> Array:
        """A state (2n,) at phase 0 of the load, from which other verbs may start."""
        return self.points[0]

    def __repr__(self) -> str:
        what = f"{self.period}T" if self.period > 1 else "T" if self.period else "aperiodic"
        times = f", {self.count} trajectories" if self.count > 1 else ""
        return f"Attractor({what} at omega={self.omega:.8g}, max|x_{self.observed}|={self.amplitude:.8g}{times})"


def attractor_of(
    system: System,
    points: Array,
    peaks: Array,
    omega: float,
    parameters: Mapping[str, float],
    tolerance: float,
    observe: int,
) -> Attractor:
    """The attractor of one trajectory from its points (P, 2n) and its largest displacements (P, n) in between."""
    sizes = state_sizes(system, peaks, omega, parameters)
    repeat = period_of(points, sizes, tolerance)
    last = repeat.period or len(points)
    largest = peaks[-last:].max(axis=0)
    return Attractor(
        "periodic" if repeat.period else "aperiodic",
        repeat.period,
        points[-last:].copy(),
        float(largest[observe]),
        largest,
        repeat.defect,
        omega,
        dict(parameters),
        observe,
    )


def distinct(system: System, all_of: Sequence[Attractor], tolerance: float) -> list[Attractor]:
    """Each once, with the number of trajectories on it, by falling amplitude; those that are not periodic are one.

    Periodic ones are the same if their points are, to a hundred times the tolerance.
    """
    kept: list[tuple[Attractor, Array]] = []
    counts: list[int] = []
    for one in all_of:
        sizes = state_sizes(system, one.largest[None], one.omega, one.parameters)
        for i, (other, _) in enumerate(kept):
            if other.period == one.period and (
                not one.period or same_cycle(other.points, one.points, sizes, _WIDER * tolerance)
            ):
                counts[i] += 1
                break
        else:
            kept.append((one, sizes))
            counts.append(1)
    counted = [replace(one, count=count) for (one, _), count in zip(kept, counts, strict=True)]
    return sorted(counted, key=lambda one: -one.amplitude)


def state_sizes(system: System, peaks: Array, omega: float, parameters: Mapping[str, Any]) -> Array:
    """Sizes (2n,) of a motion's displacements and velocities, from its largest displacements (P, n) in each period."""
    mass = np.diagonal(system.mass.value({**system.parameters, **parameters}))
    with np.errstate(invalid="ignore"):
        return extents(peaks.max(axis=0), omega, mass)
