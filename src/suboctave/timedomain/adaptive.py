"""The adaptive method for batches of trajectories: see `adaptive_code` and `adaptive_control`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.model.element import Array
from suboctave.timedomain.adaptive_code import adaptive_rows, adaptive_source
from suboctave.timedomain.adaptive_control import FIELDS
from suboctave.timedomain.generated import module_of
from suboctave.timedomain.structure import Numbers, Structure

__all__ = ["AdaptiveGroup", "AdaptiveKernel"]

_ROOM = 16384
_FIRST_STEP = 0.01


class AdaptiveKernel:
    """The compiled integrator of a structure; `lanes` trajectories run side by side."""

    def __init__(self, structure: Structure, samples: int, tolerance: float, lanes: int | None = None) -> None:
        self.structure, self.samples, self.tolerance = structure, samples, tolerance
        rows = adaptive_rows(structure, 1).size
        self.lanes = lanes or (16 if 16 * rows <= _ROOM // 8 else 8)
        self.function: Any = module_of(adaptive_source(structure, self.lanes)).adaptive
        self.rows = adaptive_rows(structure, self.lanes)
        self.offsets = np.array([self.rows.begin[name] for name in FIELDS], dtype=np.int64)

    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        """The rows of the code for every set of parameters, (P, rows) each."""
        inverse = np.linalg.inv(numbers.mass)
        flat: dict[str, Array] = {
            "A": -inverse @ numbers.stiffness,
            "B": -inverse @ numbers.damping,
            "L": inverse @ numbers.loads,
            "E": inverse @ self.structure.outputs.T,
            "c": numbers.laws,
            "omega": numbers.omega,
            "period": 2.0 * np.pi / numbers.omega,
            "weight": np.sqrt(np.diagonal(numbers.mass, axis1=1, axis2=2)),
        }
        return {name: value.reshape(numbers.count, -1) for name, value in flat.items()}


class AdaptiveGroup:
    """`lanes` trajectories on their way."""

    def __init__(
        self,
        kernel: AdaptiveKernel,
        numbers: dict[str, Array],
        states: Array,
        which: NDArray[np.int_],
        sizes: Array,
        count: int,
        address: int,
        alive: int,
    ) -> None:
        """`states` (lanes, 2n), `sizes` (lanes, n), `which` (lanes,) the set of parameters; `count` samples are due.

        Only the first `alive` lanes move.
        """
        self.kernel, self.address, self.fresh = kernel, address, True
        lanes = kernel.lanes
        self.z = np.zeros(kernel.rows.size * lanes)
        for name, value in numbers.items():
            self._rows(name, value.shape[1])[:] = value[which].T
        self._rows("y", states.shape[1])[:] = states.T
        weight = numbers["weight"][which]
        largest = np.max(sizes * weight, axis=1, keepdims=True)
        self._rows("past", sizes.shape[1])[:] = sizes.T
        self._rows("floor", sizes.shape[1])[:] = np.maximum(1e-3 * largest / weight, 1e-300).T
        period = numbers["period"][which, 0]
        self._rows("h", 1)[:] = self._rows("next", 1)[:] = np.minimum(_FIRST_STEP, 1.0 / kernel.samples) * period
        self._rows("left", 1)[:, :alive] = count
        self._rows("h", 1)[:, alive:] = 0.0

    def begin_at(self, first: Array) -> None:
        """Let every lane begin at a sample of the period, (lanes,), instead of at phase 0."""
        self._rows("sample", 1)[0] = first
        self._rows("t", 1)[0] = first / self.kernel.samples * self._rows("period", 1)[0]

    def _rows(self, name: str, count: int) -> Array:
        begin, lanes = self.kernel.rows.begin[name], self.kernel.lanes
        return self.z[begin * lanes : (begin + count) * lanes].reshape(count, lanes)

    def advance(self, budget: int, skip: int, out: Array, peaks: Array | None) -> bool:
        """Try `budget` steps of each; samples after the first `skip` go to `out`. Whether all are there."""
        kernel = self.kernel
        done = kernel.function(
            self.z, kernel.offsets, budget, self.fresh, kernel.samples, skip, kernel.tolerance, self.address, out,
            peaks if peaks is not None else np.zeros((0, 0, 0)), peaks is not None,
        )  # fmt: skip
        self.fresh = False
        return bool(done)

    def left(self) -> float:
        """Samples that are still due, of all together."""
        return float(self._rows("left", 1).sum())

    def states(self) -> Array:
        """Where they are, (lanes, 2n)."""
        return self._rows("y", 2 * self.kernel.structure.n).T.copy()

    def failed(self) -> NDArray[np.bool_]:
        """Which of them came to an end: their steps became too short, or their numbers too large."""
        return self._rows("failed", 1)[0] > 0.0
