"""Stable arcs of branches over omega: the stretches between two bifurcations on which motions are stable.

Between two consecutive bifurcations a branch runs one way in omega (limit points are bifurcations), so that an arc has
one motion at each frequency within it. What ends it is a bifurcation, or the end of the branch.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from suboctave.analysis.borders import Border
from suboctave.analysis.branch import Branch, BranchPoint
from suboctave.analysis.identity import lies_on
from suboctave.analysis.junction import Junction
from suboctave.bifurcation import Bifurcation
from suboctave.continuation.problem import Array

__all__ = ["Arc", "Edge", "Stretch", "same_branch", "stretches"]


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a branch between two bifurcations: what ends it, its points, whether these are stable.

    An end is a bifurcation, or the frequency at which the branch itself ends.
    """

    branch: Branch
    ends: tuple[Bifurcation | float, Bifurcation | float]
    points: tuple[BranchPoint, ...]
    stable: bool | None

    @property
    def doubled(self) -> bool:
        """Whether it lies between period doublings and is unstable by one multiplier below -1 alone."""
        if self.stable is not False or not all(isinstance(e, Bifurcation) and e.kind == "PD" for e in self.ends):
            return False
        middle = self.points[len(self.points) // 2].floquet.multipliers
        outside = middle[np.abs(middle) > 1.0]
        return len(outside) == 1 and bool(outside[0].real < -1.0)

    @property
    def width(self) -> float:
        """How far it reaches in omega."""
        first, last = (end if isinstance(end, float) else end.omega for end in self.ends)
        return abs(last - first)


@dataclass(frozen=True, eq=False)
class Edge:
    """What ends a stable arc: a border that can be followed, or a frequency that stays as it is.

    `bound` where the range of omega ends it; `kind` of the bifurcation, empty where there is none.
    """

    omega: float
    border: Border | None = None
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


def stretches(branch: Branch, others: Iterable[Bifurcation]) -> list[Stretch]:
    """The stretches of a branch, in order; `others` are the bifurcations at which it may leave or meet its parent."""
    places = branch.arclength
    changes = sorted(branch.bifurcations, key=lambda b: b.arclength)
    whole = float(places[-1])
    points = branch.points
    marks: list[tuple[float, Bifurcation | float]] = [(b.arclength, b) for b in changes]
    if branch.closed and marks:
        # the seam is no end
        places = np.concatenate((places, places[1:] + whole))
        points = points + points[1:]
        marks.append((marks[0][0] + whole, marks[0][1]))
    elif not branch.closed:
        known = list(others)
        first, last = (
            _met(j, known, branch, i) or float(branch.omega[i]) for j, i in ((branch.departs, 0), (branch.arrives, -1))
        )
        marks = [(-1.0, first), *marks, (whole + 1.0, last)]
    found = []
    for (begin, one), (end, other) in pairwise(marks):
        # on a located bifurcation itself the verdict is open
        inside = tuple(p for p, place in zip(points, places, strict=True) if begin < place < end)
        stable = bool(np.median([p.floquet.stable for p in inside]) > 0.5) if inside else None
        found.append(Stretch(branch, (one, other), inside, stable))
    return found


def _met(junction: Junction | None, known: Sequence[Bifurcation], branch: Branch, end: int) -> Bifurcation | None:
    """The bifurcation of another branch at which one leaves or meets it, at its first (0) or last (-1) point."""
    if junction is None:
        return None
    first, last = branch.options["bounds"][branch.name]
    span, beside = abs(last - first), branch.points[end].orbit
    found = [b for b in known if b.orbit.basis.nu == junction.nu and junction.same_place(b, span, beside)]
    return min(found, key=lambda b: abs(b.omega - junction.omega), default=None)


def same_branch(one: Branch, other: Branch) -> bool:
    """Whether the middle motion of a branch lies on another branch of the same period."""
    return one.nu == other.nu and bool(len(one)) and lies_on(one.points[len(one) // 2].orbit, other.points)
