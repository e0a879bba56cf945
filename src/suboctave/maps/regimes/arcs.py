"""Stable arcs of branches over omega, and the edges that end them, as functions of the design parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.curves.points import BranchPoint
from suboctave.maps.pieces import MonotonePiece

__all__ = ["Arc", "Edge"]


@dataclass(frozen=True, eq=False)
class Edge:
    """What ends a stable arc: a border that can be followed, or a frequency that stays as it is.

    `bound` where the range of omega ends it; `kind` of the bifurcation, empty where there is none.
    """

    omega: float
    border: MonotonePiece | None = None
    kind: str = ""
    bound: bool = False

    def across(self, values: Array | float) -> Array:
        """The frequency at values of the design parameter; nan where the border does not reach."""
        if self.border is not None:
            return self.border.across(values)
        return np.full(np.shape(values), self.omega)


@dataclass(frozen=True, eq=False)
class Arc:
    """A stable stretch of a branch at one value of the design parameter: `nu`, whether it lies on an isola, two edges.

    The edges are in ascending order of omega; `points` are its motions. With `followed` False it stands for what leaves
    the deepest branches at period doublings: `nu` is the period of the first such motions, `points` are those of the
    branch that they leave, which is unstable there by one multiplier below -1.
    """

    nu: int
    isolated: bool
    edges: tuple[Edge, Edge]
    points: tuple[BranchPoint, ...]
    followed: bool = True

    @property
    def nearly_doubled(self) -> float:
        """How close a multiplier comes to -1 within the arc and turns back; infinite where none does.

        Where that vanishes, as the parameter changes, a pair of period doublings appears. Of motions of the load's
        period only real multipliers count: a pair passes -1 at some distance wherever omega is twice a frequency of
        the structure.
        """
        gaps = []
        for point in self.points:
            mu = point.floquet.multipliers
            if self.nu == 1:
                mu = mu[np.abs(mu.imag) <= 1e-9 * np.abs(mu)]
            gaps.append(float(np.abs(mu + 1.0).min(initial=np.inf)))
        inner = [b for a, b, c in zip(gaps, gaps[1:], gaps[2:], strict=False) if b <= a and b <= c]
        return min(inner, default=np.inf)

    def range(self, values: Array | float) -> tuple[Array, Array]:
        """Between which frequencies it has a motion, at values of the design parameter."""
        low, high = (edge.across(values) for edge in self.edges)
        return low, high
