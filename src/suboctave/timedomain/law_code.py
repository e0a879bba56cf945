"""The laws of a layout as code in which trajectories lie side by side; laws without code as a C function that it calls:
forces given as Python functions, elements of a user's own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.model.elements.batch_form import Names, Tangent
from suboctave.model.elements.coupled import as_coupled
from suboctave.timedomain.generated import Index, Lanes, Rows
from suboctave.timedomain.lane_functions import CALLBACK
from suboctave.timedomain.layout import Layout, PlacedLaw

__all__ = ["LawCode", "PythonCallbacks", "callback_shapes"]

#: output, channel, and whether it is the derivative by the channel's rate
Slope = tuple[int, int, bool]


class LawCode:
    """Writes channels and forces; what integrates them is added by the methods.

    `code` is the function under way, `z` where its numbers lie: among them rows "c" with the numbers of the laws, and
    those of `callback_shapes`.
    """

    def __init__(self, layout: Layout, rows: Rows) -> None:
        self.layout, self.z, self.code = layout, rows, Lanes(rows.lanes)
        self.n, self.m, self.k = layout.n, len(layout.channels), len(layout.outputs)

    def along(self, j: int, entry: Callable[[int], str]) -> str:
        """Channel j of a vector with entries (n,)."""
        factors = self.layout.channels[j].tolist()
        terms = [entry(i) if d == 1.0 else f"{d!r} * {entry(i)}" for i, d in enumerate(factors) if d]
        return " + ".join(terms) or "0.0"

    def names(self, placed: PlacedLaw) -> Names:
        """What a law's arguments are called: `q0`, `r0`, `a0` ... by channel."""
        q, r, a = ([f"{kind}{j}" for j in placed.inputs] for kind in "qra")
        z = self.z
        return Names(
            *(q, r, lambda i: z("c", placed.begin + i)),
            *(f"e{placed.number}", lambda i: z("on", placed.corner + i), a),
        )

    def read(self, channels: list[str]) -> None:
        """These lines, which read `q0`, `r0`, ... and `theta`, and the calls of the laws without code there."""
        z, code = self.z, self.code
        code.each(*channels)
        if not self.layout.called_back:
            return
        for i, placed in enumerate(self.layout.called_back):
            kinds = "qr" if placed.element.depends_on_velocity else "q"
            given = [*(f"{kind}{j}" for kind in kinds for j in placed.inputs), "theta"]
            given += [z("c", placed.begin + c) for c in range(placed.form.count)]
            code.each(*(f"{z(f'callback{i}', row)} = {number}" for row, number in enumerate(given)))
        for i in range(len(self.layout.called_back)):
            begin = z.begin[f"callback{i}"] * z.lanes
            code.raw(f"call_back(address, {i}, {z.lanes}, z[{begin}:])")
        code.each(*channels)

    def _returned(self, i: int, placed: PlacedLaw) -> Tangent:
        """What the law called back as number i has left."""
        first = placed.states + 1 + placed.form.count
        slopes = [self.z(f"callback{i}", first + 1 + row) for row in range(placed.states)]
        inputs = len(placed.inputs)
        return Tangent([], self.z(f"callback{i}", first), slopes[:inputs], slopes[inputs:] or [""] * inputs)

    def forces(self, form: Callable[[PlacedLaw], Tangent]) -> tuple[list[str], dict[Slope, str]]:
        """Lines for all laws in this form, then the texts of the outputs' forces and of their derivatives."""
        forces: list[list[str]] = [[] for _ in range(self.k)]
        slopes: dict[Slope, list[str]] = {}
        callbacks = {placed.number: i for i, placed in enumerate(self.layout.called_back)}
        for placed in self.layout.laws:
            if placed.form.has_code:
                tangent = form(placed)
            else:
                tangent = self._returned(callbacks[placed.number], placed)
            self.code.each(*tangent.lines)
            forces[placed.output].append(tangent.force)
            for by_rate, texts in ((False, tangent.by_q), (True, tangent.by_r)):
                for j, text in zip(placed.inputs, texts, strict=True):
                    if text and text != "0.0":
                        slopes.setdefault((placed.output, j, by_rate), []).append(f"({text})")
        return [" + ".join(texts) for texts in forces], {which: " + ".join(texts) for which, texts in slopes.items()}

    def row_sums(
        self, goal: Callable[[Index], str], start: Callable[[Index], str], x: Callable[[Index], str],
        v: Callable[[Index], str], force: str,
    ) -> None:  # fmt: skip
        """`goal = start + A x + B v - E force` for all degrees of freedom."""
        z = self.z
        self.code.sums(
            self.n,
            goal,
            start,
            [
                (self.n, "+", lambda i, j: f"{z('A', i, j)} * {x(j)} + {z('B', i, j)} * {v(j)}"),
                (self.k, "-", lambda i, o: f"{z('E', i, o)} * {z(force, o)}"),
            ],
        )


def callback_shapes(laws: Sequence[PlacedLaw]) -> dict[str, int]:
    """Rows through which code and laws exchange numbers: states, phase, the law's numbers; force, its derivatives."""
    return {f"callback{i}": 2 * placed.states + placed.form.count + 2 for i, placed in enumerate(laws)}


class PythonCallbacks:
    """One function of C for all laws that have no code; `address` is where it is, 0 without any.

    It is given the number of the law, of trajectories W, and the address of a block of rows of W numbers: the states
    that the law reads, the phase, its numbers, then room for the force and its derivatives. What a law raises is kept
    in `failure`: no exception passes through code of C. Once that, or `halted`, says so, forces are no numbers and no
    law is called any more, so that what waits for them comes to its end.
    """

    def __init__(self, laws: Sequence[PlacedLaw]) -> None:
        self.failure: BaseException | None = None
        #: whether nobody waits for the forces any longer
        self.halted: Callable[[], bool] = bool
        self._laws = [(as_coupled(placed.element), placed.states, placed.form) for placed in laws]
        self._function = CALLBACK(self._call)
        self.address = ctypes.cast(self._function, ctypes.c_void_p).value or 0 if laws else 0

    def _call(self, which: int, lanes: int, address: int) -> None:
        try:
            law, states, form = self._laws[which]
            size = 2 * states + form.count + 2
            block = np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_double)), (size, lanes))
            begin = states + 1 + form.count
            if self.failure is not None or self.halted():
                block[begin:] = np.nan
                return
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
