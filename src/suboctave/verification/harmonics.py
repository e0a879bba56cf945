"""What the harmonics that a motion neglects do to its states: so much of a difference to shooting is their absence."""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.basis import to_complex
from suboctave.harmonic.orbit import PeriodicOrbit


def left_out(motion: PeriodicOrbit) -> float:
    """How far the neglected harmonics may move a state of the motion, relative to the largest displacement and velocity
    of the unknowns: sums of their moduli, to first order.
    """
    wide, completed = motion.state().completed_x
    waves = np.abs(to_complex(completed))
    speeds = waves * wide.multiples[:, None]
    kept = motion.basis.harmonics + 1
    shares = [part[kept:].sum(axis=0) / max(part[:kept].max(), np.finfo(float).tiny) for part in (waves, speeds)]
    return float(np.max(shares))


def up_to_harmonics(motion: PeriodicOrbit, distance: float) -> str:
    """What is said where shooting and harmonic balance differ by no more than that."""
    high = motion.basis.harmonics
    return (
        f"The same motion within the truncation error of {high} harmonics (relative distance {distance:.1e}, "
        "velocities included): use more harmonics, or a larger tolerance"
    )
