"""What the harmonics that a motion neglects do to its states: so much of a difference to shooting is their absence."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from suboctave.harmonic.basis import to_complex
from suboctave.harmonic.orbit import PeriodicOrbit


def left_out(motion: PeriodicOrbit) -> float:
    """How far the neglected harmonics may move a state of the motion, relative to the largest displacement and velocity
    of the unknowns: sums of the moduli of what one step of Newton's method with twice as many harmonics changes.
    """
    state = motion.state()
    finer = state.completed
    own, change = motion.basis.resized(state.x, finer.basis), finer.x
    # what nothing drives may begin at any time, and the equations are singular
    if motion.system.driven:
        # a motion that does not solve its own equations has other errors than that
        rest = finer.residual - motion.basis.resized(state.balance.shaped(state.residual), finer.basis).ravel()
        with suppress(np.linalg.LinAlgError):
            step = np.asarray(np.linalg.solve(finer.jacobian, rest), dtype=float)
            change = change - finer.balance.shaped(step)
    waves, moved = np.abs(to_complex(own)), np.abs(to_complex(change - own))
    speeds = finer.basis.multiples[:, None]
    shares = [
        (moved * factor).sum(axis=0) / max(float((waves * factor).max()), np.finfo(float).tiny)
        for factor in (np.ones_like(speeds), speeds)
    ]
    return float(np.max(shares))


def up_to_harmonics(motion: PeriodicOrbit, distance: float) -> str:
    """What is said where shooting and harmonic balance differ by no more than that."""
    high = motion.basis.harmonics
    return (
        f"The same motion within the truncation error of {high} harmonics (relative distance {distance:.1e}, "
        "velocities included): use more harmonics, or a larger tolerance"
    )
