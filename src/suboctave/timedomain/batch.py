"""Trajectories that are followed together: what their integrators begin with, and a group of them side by side."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from suboctave.model.elements.base import Array
from suboctave.timedomain.generated import Rows
from suboctave.timedomain.layout import Layout, Numbers

__all__ = ["ROOM", "Batch", "Group", "Method"]

#: numbers that the rows of a group may fill: what stays in a processor's cache
ROOM = 2048


@dataclass(frozen=True, eq=False)
class Batch:
    """B trajectories from `states` (B, 2n) of motions as large as `sizes` (B, n).

    Attributes
    ----------
    rows, which
        The numbers of the code for every set of parameters, and the set of each (B,).
    total, skip
        Samples that are due, and those at the beginning that are not kept.
    measure
        Whether the largest displacements are wanted.
    first
        At which sample of the period each begins, (B,); 0 for all without it.
    folded
        Whether the largest displacements of angles are taken within half a turn.
    address
        Where the code finds the laws that are called back.
    """

    rows: dict[str, Array]
    which: NDArray[np.int_]
    states: Array
    sizes: Array
    total: int
    skip: int
    measure: bool
    first: Array | None
    address: int
    folded: bool = True

    @property
    def kept(self) -> int:
        """Samples that are kept."""
        return self.total - self.skip


class Group:
    """`lanes` trajectories on their way: their numbers `z`, steps taken, samples kept.

    `states`, `peaks` and `growth` are those of `Motions`, with the trajectories along the last axis.
    """

    def __init__(self, method: Method, batch: Batch, members: NDArray[np.int_], alive: int) -> None:
        self.batch, self.members, self.rows = batch, members, method.rows
        n, samples, lanes, count = method.layout.n, batch.kept, method.rows.lanes, method.count
        self.z = np.zeros(method.rows.size * lanes)
        for name, value in batch.rows.items():
            self.row(name)[:] = value[batch.which[members]].T
        self.step = self.slot = 0
        self.states = np.full((samples, 2 * n, lanes), np.nan)
        self.peaks = np.full((samples * batch.measure, n, lanes), np.nan)
        self.growth = np.full((samples * (count > 0), count + 1, lanes), np.nan)
        method.start(self, alive)

    def row(self, name: str) -> Array:
        """The rows of one name, (rows, lanes)."""
        lanes, begin, count = self.rows.lanes, self.rows.begin[name], prod(self.rows.shapes[name])
        return self.z[begin * lanes : (begin + count) * lanes].reshape(count, lanes)


class Method(ABC):
    """A compiled integrator of trajectories side by side, each with `count` tangent vectors.

    `effort` is what a group is asked for first.
    """

    effort: int

    def __init__(self, layout: Layout, rows: Rows, count: int = 0) -> None:
        self.layout, self.rows, self.count = layout, rows, count

    @abstractmethod
    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        """The rows of the code for every set of parameters, (P, ...) each."""

    @abstractmethod
    def start(self, group: Group, alive: int) -> None:
        """Put trajectories at their beginning; only the first `alive` must move."""

    @abstractmethod
    def advance(self, group: Group, effort: int) -> bool:
        """Go on by so many steps. Whether all have arrived."""

    @abstractmethod
    def left(self, group: Group) -> float:
        """Samples that are still due, of all together."""

    @abstractmethod
    def results(self, group: Group) -> dict[str, Array]:
        """What is known at the end besides samples, by the names of `Motions`; arrays with one entry for each lane."""
