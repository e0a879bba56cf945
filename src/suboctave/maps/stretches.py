"""Branches over omega in stretches between two bifurcations, on which motions keep their stability.

Between two consecutive bifurcations a branch runs one way in omega (limit points are bifurcations), so that a stretch
has one motion at each frequency within it. What ends it is a bifurcation, or the end of the branch.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from suboctave.bifurcation import Bifurcation
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import Junction
from suboctave.curves.points import BranchPoint
from suboctave.results.branch import Branch

__all__ = ["Stretch", "same_branch", "stable_ranges", "stretches"]


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
    def omega(self) -> tuple[float, float]:
        """Between which frequencies it lies, ascending."""
        first, last = (end if isinstance(end, float) else float(end.omega) for end in self.ends)
        return min(first, last), max(first, last)

    @property
    def width(self) -> float:
        """How far it reaches in omega."""
        return self.omega[1] - self.omega[0]


def stretches(branch: Branch, others: Iterable[Bifurcation] = ()) -> list[Stretch]:
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
    cut = []
    for (begin, one), (end, other) in pairwise(marks):
        # on a located bifurcation itself the verdict is open
        inside = tuple(p for p, place in zip(points, places, strict=True) if begin < place < end)
        stable = bool(np.median([p.floquet.stable for p in inside]) > 0.5) if inside else None
        cut.append(Stretch(branch, (one, other), inside, stable))
    return cut


def _met(junction: Junction | None, known: Sequence[Bifurcation], branch: Branch, end: int) -> Bifurcation | None:
    """The bifurcation of another branch at which one leaves or meets it, at its first (0) or last (-1) point."""
    if junction is None:
        return None
    first, last = branch.options["bounds"][branch.name]
    span, beside = abs(last - first), branch.points[end].orbit
    alike = [b for b in known if b.orbit.basis.nu == junction.nu and junction.same_place(b, span, beside)]
    return min(alike, key=lambda b: abs(b.omega - junction.omega), default=None)


def same_branch(one: Branch, other: Branch) -> bool:
    """Whether the middle motion of a branch lies on another branch of the same period."""
    return one.nu == other.nu and bool(len(one)) and lies_on(one.points[len(one) // 2].orbit, other.points)


def stable_ranges(branch: Branch) -> list[tuple[float, float]]:
    """Between which frequencies a branch has stable motions; pairs of omega, ascending, overlapping ones joined."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(stretch.omega for stretch in stretches(branch) if stretch.stable):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined
