"""Laws without code as a C function that generated code calls: forces given as Python functions, elements of a user's
own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.model.elements.coupled import as_coupled
from suboctave.timedomain.lane_functions import CALLBACK
from suboctave.timedomain.layout import PlacedLaw

__all__ = ["PythonCallbacks", "callback_shapes"]


def callback_shapes(laws: Sequence[PlacedLaw]) -> dict[str, int]:
    """Rows through which code and laws exchange numbers: states, phase, the law's numbers; force, its derivatives."""
    return {f"callback{i}": 2 * placed.states + placed.form.count + 2 for i, placed in enumerate(laws)}


class PythonCallbacks:
    """One function of C for all laws that have no code; `address` is where it is, 0 without any.

    It is given the number of the law, of trajectories W, and the address of a block of rows of W numbers: the states
    that the law reads, the phase, its numbers, then room for the force and its derivatives. What a law raises is kept
    in `failure`: no exception passes through code of C.
    """

    def __init__(self, laws: Sequence[PlacedLaw]) -> None:
        self.failure: BaseException | None = None
        self._laws = [(as_coupled(placed.element), placed.states, placed.form) for placed in laws]
        self._function = CALLBACK(self._call)
        self.address = ctypes.cast(self._function, ctypes.c_void_p).value or 0 if laws else 0

    def _call(self, which: int, lanes: int, address: int) -> None:
        try:
            law, states, form = self._laws[which]
            size = 2 * states + form.count + 2
            block = np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_double)), (size, lanes))
            begin = states + 1 + form.count
            numbers = block[states + 1 + form.corners : begin]
            _evaluate(law, block[:states].copy(), block[states].copy(), numbers.copy(), block[begin:])
        except BaseException as failure:  # nothing may pass through C
            self.failure = self.failure or failure


def _evaluate(law: Any, q: Array, theta: Array, c: Array, out: Array) -> None:
    out[:] = np.nan
    with np.errstate(all="ignore"):
        if (c == c[:, :1]).all():
            out[0], out[1:] = law.tangent(q, theta, c[:, 0].copy())
            return
        for lane in range(len(theta)):
            at = slice(lane, lane + 1)
            out[:1, at], out[1:, at] = law.tangent(q[:, at].copy(), theta[at], c[:, lane].copy())
