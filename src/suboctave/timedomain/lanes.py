"""Text of code in which many trajectories lie side by side, and inner loops run over them."""

from __future__ import annotations

from collections.abc import Sequence

from suboctave.timedomain.structure import PlacedLaw, Structure

__all__ = ["HEADER", "MOST_UNROLLED", "Lanes", "Rows", "add_asked", "asked_states"]

HEADER = '''"""Generated: do not edit."""

from math import pi

import numpy as np
from numba import njit

from suboctave.timedomain.elementary import absolute, arccos, arcsin, arctan, arctan_log, call_back, cos, cosh, exp
from suboctave.timedomain.elementary import heaviside, log, maximum, sign, sin, sine_cosine, sinh, sqrt, tan, tanh
'''
#: products of matrices of this many rows or fewer are written out
MOST_UNROLLED = 4


class Rows:
    """Where everything lies: `count` rows of W numbers under each name."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.begin: dict[str, int] = {}
        self.size = 0

    def add(self, name: str, count: int) -> None:
        """Room for `count` rows."""
        self.begin[name] = self.size
        self.size += count

    def __call__(self, name: str, i: int = 0) -> str:
        """The entry of row i in the lane l."""
        return f"z[{(self.begin[name] + i) * self.lanes} + l]"

    def at(self, name: str, index: str) -> str:
        """The entry in the lane l of a row whose index is computed."""
        return f"z[({self.begin[name]} + {index}) * {self.lanes} + l]"


class Lanes:
    """Lines of code; statements on lanes that follow each other share one loop."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.lines: list[str] = []
        self.indent = 1
        self._pending: list[str] = []

    def each(self, lines: Sequence[str]) -> None:
        """Statements for every lane l."""
        self._pending += lines

    def raw(self, *lines: str) -> None:
        """Statements outside of the loop over lanes."""
        self._flush()
        self.lines += ["    " * self.indent + line for line in lines]

    def _flush(self) -> None:
        if self._pending:
            pending, self._pending = self._pending, []
            self.raw(f"for l in range({self.lanes}):")
            self.lines += ["    " * (self.indent + 1) + line for line in pending]

    def text(self) -> str:
        """All of it."""
        self._flush()
        return "\n".join(self.lines)


def asked_states(placed: PlacedLaw) -> int:
    """How many states a law reads that is asked."""
    return len(placed.inputs) * (2 if placed.element.depends_on_velocity else 1)


def add_asked(rows: Rows, structure: Structure) -> None:
    """Room for the questions to laws without code, and their answers: see `asked`."""
    for i, placed in enumerate(structure.asked):
        states = asked_states(placed)
        rows.add(f"asked{i}", states + 1 + placed.law.count + 1 + states)
