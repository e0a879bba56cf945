"""Newmark's method for batches of trajectories: see `newmark_code` for the equations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.model.element import Array
from suboctave.timedomain.generated import module_of
from suboctave.timedomain.newmark_code import newmark_source, rows_of
from suboctave.timedomain.structure import Numbers, Structure

__all__ = ["NewmarkGroup", "NewmarkKernel"]

#: rows of numbers that many trajectories side by side may fill
_ROOM = 16384


class NewmarkKernel:
    """The compiled integrator of a structure; `lanes` trajectories run side by side."""

    def __init__(self, structure: Structure, steps: int, tolerance: float, lanes: int | None = None) -> None:
        self.structure, self.steps, self.tolerance = structure, steps, tolerance
        rows = rows_of(structure, 1).size
        self.lanes = lanes or next((lanes for lanes in (32, 16) if lanes * rows <= _ROOM // 8), 8)
        self.function: Any = module_of(newmark_source(structure, self.lanes)).newmark
        self.waves = structure.wave_table(steps)
        self.rows = rows_of(structure, self.lanes)

    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        """The rows of the code for every set of parameters, (P, rows) each."""
        n, h = self.structure.n, 2.0 * np.pi / (numbers.omega * self.steps)
        h1 = h[:, None, None]
        d, e = self.structure.channels, self.structure.outputs.T
        inverse = np.linalg.inv(4.0 / h1**2 * numbers.mass + 2.0 / h1 * numbers.damping + numbers.stiffness)
        flat: dict[str, Array] = {
            "A": -2.0 * inverse @ numbers.stiffness,
            "B": inverse @ (4.0 / h1 * numbers.mass),
            "L": inverse @ numbers.loads,
            "E": inverse @ e,
            "G": d @ (inverse @ e),
            "c": numbers.laws,
            "h": h,
            "rate": 2.0 / h,
            "time": 1.0 / numbers.omega,
        }
        assert n == self.structure.n
        return {name: value.reshape(numbers.count, -1) for name, value in flat.items()}


class NewmarkGroup:
    """`lanes` trajectories on their way."""

    def __init__(
        self, kernel: NewmarkKernel, numbers: dict[str, Array], states: Array, which: NDArray[np.int_], address: int
    ) -> None:
        """`states` (lanes, 2n); `which` (lanes,) the set of parameters of each."""
        self.kernel, self.address, self.fresh = kernel, address, True
        n, lanes = kernel.structure.n, kernel.lanes
        self.z = np.zeros(kernel.rows.size * lanes)
        for name, value in {**numbers, "x": states[:, :n], "v": states[:, n:]}.items():
            self._rows(name, value.shape[1])[:] = (value[which] if name in numbers else value).T

    def _rows(self, name: str, count: int) -> Array:
        begin, lanes = self.kernel.rows.begin[name], self.kernel.lanes
        return self.z[begin * lanes : (begin + count) * lanes].reshape(count, lanes)

    def advance(self, begin: int, end: int, stride: int, skip: int, out: Array, peaks: Array | None) -> int:
        """Steps `begin` to `end`; every `stride`-th state after step `skip` goes to `out`: how many did."""
        kernel = self.kernel
        measure = peaks is not None
        used = kernel.function(
            self.z, kernel.waves, begin, end, stride, skip, measure, self.fresh, kernel.tolerance, self.address, out,
            peaks if peaks is not None else np.zeros((0, 0, 0)),
        )  # fmt: skip
        self.fresh = False
        return int(used)

    def states(self) -> Array:
        """Where they are, (lanes, 2n)."""
        n = self.kernel.structure.n
        return np.concatenate([self._rows("x", n), self._rows("v", n)]).T.copy()

    def unsettled(self) -> Array:
        """Steps of each whose equations were not solved to the tolerance."""
        return self._rows("bad", 1)[0].copy()
