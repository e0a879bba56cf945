"""The adaptive method with tangent vectors for batches of trajectories: see `tangent_code` and `tangent_control`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.model.element import Array
from suboctave.timedomain.adaptive import AdaptiveGroup, AdaptiveKernel
from suboctave.timedomain.adaptive_control import FIELDS
from suboctave.timedomain.generated import module_of
from suboctave.timedomain.structure import Numbers, Structure
from suboctave.timedomain.tangent_code import tangent_rows, tangent_source
from suboctave.timedomain.tangent_control import MORE

__all__ = ["TangentGroup", "TangentKernel"]

_ROOM = 16384


class TangentKernel(AdaptiveKernel):
    """The compiled integrator of a structure with `count` tangent vectors for each trajectory.

    `plain`: they begin as unit vectors and are left as they are: columns of the state-transition matrix. Otherwise they
    begin as orthonormal ones in no special direction, and are kept orthonormal.
    """

    def __init__(
        self, structure: Structure, samples: int, tolerance: float, count: int, plain: bool, lanes: int | None = None
    ) -> None:
        self.structure, self.samples, self.tolerance = structure, samples, tolerance
        self.count, self.plain = count, plain
        rows = tangent_rows(structure, 1, count).size
        self.lanes = lanes or (16 if 16 * rows <= _ROOM // 8 else 8)
        self.function: Any = module_of(tangent_source(structure, self.lanes, count)).adaptive
        self.rows = tangent_rows(structure, self.lanes, count)
        self.offsets = np.array([self.rows.begin[name] for name in FIELDS], dtype=np.int64)
        self.more = np.array([self.rows.begin[name] for name in MORE], dtype=np.int64)
        size = 2 * structure.n
        generic = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))[0]
        self.first = (np.eye(size) if plain else generic)[:, :count]

    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        """The rows of the code for every set of parameters, (P, rows) each."""
        flat = super().numbers(numbers)
        inverse = np.linalg.inv(numbers.mass)
        g = self.structure.channels @ (inverse @ self.structure.outputs.T)
        weight, omega = flat["weight"], numbers.omega[:, None]
        flat |= {
            "G": g.reshape(numbers.count, -1),
            "trace": -np.trace(inverse @ numbers.damping, axis1=1, axis2=2)[:, None],
            "metric": np.hstack([omega * weight, weight]),
        }
        return flat


class TangentGroup(AdaptiveGroup):
    """`lanes` trajectories on their way, with their tangent vectors."""

    kernel: TangentKernel

    def __init__(
        self,
        kernel: TangentKernel,
        numbers: dict[str, Array],
        states: Array,
        which: NDArray[np.int_],
        sizes: Array,
        count: int,
        address: int,
        alive: int,
    ) -> None:
        super().__init__(kernel, numbers, states, which, sizes, count, address, alive)
        size = states.shape[1]
        if kernel.plain:
            self._rows("plain", 1)[:] = 1.0
        for c in range(kernel.count):
            # orthonormal in the metric of the parameters
            scale = 1.0 if kernel.plain else numbers["metric"][which].T
            self._rows("w", size * kernel.count)[c * size : (c + 1) * size] = kernel.first[:, c, None] / scale
        self.grown = np.full((0, kernel.count + 1, kernel.lanes), np.nan)

    def advance(self, budget: int, skip: int, out: Array, peaks: Array | None) -> bool:
        """Try `budget` steps of each; samples after the first `skip` go to `out`. Whether all are there."""
        kernel = self.kernel
        done = kernel.function(
            self.z, kernel.offsets, kernel.more, budget, self.fresh, kernel.samples, skip, kernel.tolerance,
            self.address, out, peaks if peaks is not None else np.zeros((0, 0, 0)), peaks is not None, self.grown,
        )  # fmt: skip
        self.fresh = False
        return bool(done)

    def tangents(self) -> Array:
        """The tangent vectors as columns, (lanes, 2n, count)."""
        size, count = 2 * self.kernel.structure.n, self.kernel.count
        return self._rows("w", size * count).reshape(count, size, -1).transpose(2, 1, 0).copy()
