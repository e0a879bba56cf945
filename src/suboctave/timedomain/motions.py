"""What a flow brings: states, peaks, growth, and whether they are to be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import ConvergenceError
from suboctave.interruption import Interruption
from suboctave.model.element import Array

__all__ = ["Motions", "check_motions"]


@dataclass(frozen=True, eq=False)
class Motions:
    """What a flow brings.

    Attributes
    ----------
    states
        (B, S, 2n): displacements, then velocities, at the S instants kept.
    peaks
        (B, S, n): the largest |x_i| since the instant before, between the instants too; None if not asked for.
    end
        (B, 2n): the last states.
    failed
        (B,): trajectories that left the range of numbers, or took more than 100 000 steps between two samples; they are
        NaN from there on.
    unsettled
        (B,): steps of Newmark's method whose equations were not solved to the tolerance.
    finished
        (B,): whether the trajectory was followed to its end; not all are where it was interrupted.
    growth
        (B, S, k + 1): of a flow with k tangent vectors, the logarithms by which they grew since the instant before,
        then that by which the volume of states did.
    tangents
        (B, 2n, k): the tangent vectors at the end, as columns.
    interruption
        What stopped them, Ctrl-C or a time limit; None if nothing did.
    """

    states: Array
    peaks: Array | None
    end: Array
    failed: NDArray[np.bool_]
    unsettled: Array
    finished: NDArray[np.bool_]
    growth: Array | None = None
    tangents: Array | None = None
    interruption: Interruption | None = None


def check_motions(motions: Motions) -> None:
    """Refuse motions that failed or whose steps were not solved, with what to change."""
    if motions.failed.any():
        first = int(np.flatnonzero(motions.failed)[0])
        raise ConvergenceError(
            f"{int(motions.failed.sum())} of {len(motions.failed)} trajectories (the first is number {first}) left the "
            "range of numbers, or needed too many steps: the motion grows without bound, a force is not finite where "
            "it goes, or the highest natural frequency is far above that of the load (take Newmark's method)"
        )
    if motions.unsettled.any():
        raise ConvergenceError(
            f"Newmark's method did not solve {int(motions.unsettled.sum())} of its steps: take more steps_per_period "
            'than now, or method="accurate"'
        )
