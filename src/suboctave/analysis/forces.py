"""Whether forces are continuous along a motion: derivatives of the flow take that for granted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from suboctave.errors import InputError
from suboctave.interruption import pass_on
from suboctave.model.coupled import as_coupled
from suboctave.model.element import Array
from suboctave.model.system import System
from suboctave.timedomain.batch import Flow

__all__ = ["check_forces"]

_SAMPLES, _PERIODS = 200, 30
_HALVINGS = 40
#: the share of a force's range that remains between two neighbours if it jumps there
_JUMP = 1e-3


def check_forces(system: System, state: Array, omega: float, values: Mapping[str, float]) -> None:
    """Refuse elements of a user's own whose force jumps on the way of the motion from `state` (2n,).

    Between the two samples of the motion that differ most in force, the place is halved again and again: what is left
    of a continuous force is nothing.
    """
    asked = Flow(system, "accurate", lanes=8).structure.asked
    if not asked:
        return
    flow = Flow(system, "newmark", _SAMPLES, _SAMPLES, lanes=8)
    motions = flow.over(state, omega, _PERIODS, values)
    pass_on(motions.interruption)
    states = motions.states[0]
    states = np.vstack([state[None], states[np.isfinite(states).all(axis=1)]])
    n = system.n
    for placed in asked:
        element = placed.element
        law = as_coupled(element)
        rows = law.inputs(n)
        q = rows @ states[:, :n].T
        if element.depends_on_velocity:
            q = np.vstack([q, rows @ states[:, n:].T])
        phase = 2.0 * np.pi * (np.arange(q.shape[1]) % _SAMPLES) / _SAMPLES
        c = element.coefficient_values({**system.parameters, **values})
        f = np.asarray(law.tangent(q, phase, c)[0], dtype=float)
        largest = float(np.ptp(f))
        if len(f) < 2 or not largest > 0.0:
            continue
        k = int(np.argmax(np.abs(np.diff(f))))
        # the phase stands still: a force that jumps at an instant, whatever the motion, does no harm
        low, high, at = q[:, k : k + 1], q[:, k + 1 : k + 2], phase[k : k + 1]
        first, last = (float(law.tangent(y, at, c)[0][0]) for y in (low, high))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            force = float(law.tangent(middle, at, c)[0][0])
            if abs(force - first) >= abs(last - force):
                high, last = middle, force
            else:
                low, first = middle, force
        if abs(last - first) > _JUMP * largest:
            place = ", ".join(f"{value:.4g}" for value in low[:, 0])
            raise InputError(
                f"{element.label}: the force jumps by {abs(last - first):.3g} at ({place}); the derivative of the flow "
                "does not contain that. Write the law with a steep but continuous passage"
            )
