"""Trajectories that are followed together: what their integrators begin with, and a group of them side by side."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.model.elements.base import Array
from suboctave.timedomain.generated import Rows
from suboctave.timedomain.layout import Numbers

__all__ = ["Batch", "Group", "Method"]


@dataclass(frozen=True, eq=False)
class Batch:
    """B trajectories from `states` (B, 2n) of motions as large as `sizes` (B, n).

    Attributes
    ----------
    rows, which
        The numbers of the code for every set of parameters, and the set of each (B,).
    total, skip
        Samples that are due, and those at the beginning that are not kept.
    first
        At which sample of the period each begins, (B,); 0 for all without it.
    address
        Where the code finds the laws that are called back.
    """

    rows: dict[str, Array]
    which: NDArray[np.int_]
    states: Array
    sizes: Array
    total: int
    skip: int
    first: Array | None
    address: int


class Method(ABC):
    """A compiled integrator; `lanes` trajectories run side by side. `effort` is what a group is asked for first."""

    rows: Rows
    lanes: int
    effort: int
    #: how many tangent vectors go with a trajectory
    count: int = 0

    @abstractmethod
    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        """The rows of the code for every set of parameters, (P, rows) each."""

    @abstractmethod
    def group(self, batch: Batch, members: NDArray[np.int_], alive: int) -> Group:
        """These trajectories (lanes,) of a batch at their beginning; only the first `alive` must move."""


class Group(ABC):
    """`lanes` trajectories on their way."""

    def __init__(self, method: Method, batch: Batch, members: NDArray[np.int_]) -> None:
        self.batch, self.fresh, self._places = batch, True, method.rows
        self.z = np.zeros(method.rows.size * method.lanes)
        for name, value in batch.rows.items():
            self.row(name)[:] = value[batch.which[members]].T

    def row(self, name: str) -> Array:
        """The rows of one name, (rows, lanes)."""
        places = self._places
        begin, count = places.begin[name], prod(places.shapes[name])
        return self.z[begin * places.lanes : (begin + count) * places.lanes].reshape(count, places.lanes)

    @abstractmethod
    def advance(self, effort: int, out: Array, peaks: Array | None) -> bool:
        """Go on by so many steps; samples go to `out` (samples, 2n, lanes). Whether all have arrived."""

    @abstractmethod
    def left(self) -> float:
        """Samples that are still due, of all together."""

    @abstractmethod
    def results(self) -> dict[str, Any]:
        """What is known at the end, by the names of `Motions`; arrays with one entry for each lane."""
