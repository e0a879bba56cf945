"""What regime maps are made of: stable arcs of branches at one value of the design parameter, strips, and labels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.curves.junction import period_name
from suboctave.curves.trace import BranchPoint
from suboctave.maps.pieces import MonotonePiece, across
from suboctave.results.branch import Branch


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
        return across(self.omega if self.border is None else self.border, values)


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


@dataclass(eq=False)
class Slice:
    """Branches over omega at one value of the design parameter, and their stable arcs.

    Of each branch whether it lies on an isola, or leaves one.
    """

    value: float
    branches: list[tuple[Branch, bool]] = field(default_factory=list)
    arcs: list[Arc] = field(default_factory=list)


@dataclass(frozen=True)
class Regime:
    """The stable motions that coexist: of each its period in periods of the load, and whether it lies on an isola.

    `beyond`: the same of what leaves the deepest branches at period doublings, with the period of the first such
    motions. It was not followed: it may double again, or be chaotic.
    """

    motions: tuple[tuple[int, bool], ...] = ()
    beyond: tuple[tuple[int, bool], ...] = ()

    @property
    def count(self) -> int:
        """How many stable motions are known; two that differ by a shift in time only are one, mirror images two."""
        return len(self.motions)

    @property
    def periods(self) -> tuple[int, ...]:
        """Their periods in periods of the load, ascending, one for each motion."""
        return tuple(nu for nu, _ in self.motions)

    @property
    def isolated(self) -> bool:
        """Whether one of them lies on an isola."""
        return any(isolated for _, isolated in (*self.motions, *self.beyond))

    def __str__(self) -> str:
        parts = []
        for group, words in ((self.motions, ""), (self.beyond, " or more")):
            for (nu, isolated), number in sorted(Counter(group).items()):
                name = f"{period_name(nu)}{words}{' on an isola' if isolated else ''}"
                parts.append(name if number == 1 else f"{number} x {name}")
        return " + ".join(parts) or "no stable motion known"


@dataclass(frozen=True, eq=False)
class Strip:
    """Values of the parameter from `low` to `high`, the slice that stands for them, and whether it lies within."""

    low: float
    high: float
    slice: Slice | None
    examined: bool

    @property
    def arcs(self) -> list[Arc]:
        """The stable arcs."""
        return [] if self.slice is None else self.slice.arcs

    @property
    def value(self) -> float:
        """The value of the parameter at which branches were followed."""
        return 0.5 * (self.low + self.high) if self.slice is None else self.slice.value


def regime_of(arcs: Sequence[Arc]) -> Regime:
    """The label of motions that coexist."""
    known, beyond = ([(a.nu, a.isolated) for a in arcs if a.followed is followed] for followed in (True, False))
    return Regime(tuple(sorted(known)), tuple(sorted(beyond)))
