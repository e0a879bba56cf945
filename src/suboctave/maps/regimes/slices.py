"""All branches at one value of the design parameter, up to a period, and their stable arcs.

The response with the branches that bifurcate from it, begun at both ends of the range; then a branch through every
limit point of a known curve that lies on none of these: isolas, and branches that lead through the range elsewhere.
Between two critical values, in a strip, stable arcs keep their order: a slice stands for it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from suboctave.analysis.branches import continue_branch, frequency_response
from suboctave.analysis.diagram import Followed, grown_from
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.problem import Array
from suboctave.curves.identity import lies_on, mirrored
from suboctave.curves.junction import period_name
from suboctave.curves.points import BranchPoint
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import FAILURES, Catalogue, SearchRange, branch_through
from suboctave.maps.pieces import MonotonePiece, Stretch, across, same_branch, stretches
from suboctave.results.branch import Branch

#: ends of branches this close to the end of the range, relatively, lie on it
_AT_END = 1e-6
#: stretches without a point, narrower than this share of the range, are taken for unstable without a note
_NARROW = 1e-4
#: where along an arc its motions are compared with those of another
_SAMPLES = (0.1, 0.3, 0.5, 0.7, 0.9)


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
    """Branches over omega at one value of the design parameter.

    value, catalogue, longest
        The value, what is known of bifurcations, and the longest period, in periods of the load, that is followed.
    reach
        Range of omega in which the responses were followed; None before they are.
    branches
        Each with whether it lies on an isola, or leaves one.
    arcs
        Its stable arcs.
    explained
        Stretches of curves of limit points that lie on one of the branches there.
    """

    value: float
    catalogue: Catalogue
    longest: int
    reach: SearchRange | None = None
    branches: list[tuple[Branch, bool]] = field(default_factory=list)
    arcs: list[Arc] = field(default_factory=list)
    explained: list[MonotonePiece] = field(default_factory=list)

    def complete(self) -> None:
        """Follow the branches; bifurcations met are followed over the parameter if they are new.

        Called again it adds branches through limit points that have become known since, and begins anew where
        bifurcations beyond the range have, from which branches lead into it.
        """
        places = (p for p in self.catalogue.pieces if p.kind in ("PD", "BP") and p.contains(self.value))
        reach = self.catalogue.omega.holding(float(piece.across(self.value)) for piece in places)
        before = len(self.branches)
        if self.reach is None or reach.low < self.reach.low or reach.high > self.reach.high:
            self.reach, before = reach, -1
            self.branches, self.arcs, self.explained = [], [], []
            for branch in self._responses(reach):
                self._add(branch, False)
        for piece in self._unexplained():
            for branch, isolated in self._through(piece):
                self._add(branch, isolated)
        if len(self.branches) > before:
            self._collect_arcs()

    def _add(self, branch: Branch, isolated: bool) -> None:
        """A branch becomes known, and that its limit points lie on it."""
        self.branches.append((branch, isolated))
        for item in branch.bifurcations["LP"]:
            piece = self.catalogue.known(item, self.value)
            if piece is not None and piece not in self.explained:
                self.explained.append(piece)

    def _is_known(self, branch: Branch) -> bool:
        return any(same_branch(branch, other) for other, _ in self.branches)

    def _responses(self, reach: SearchRange) -> Iterator[Branch]:
        """The response from both ends with all that bifurcates from it."""
        known: list[Branch] = []
        for diagram in self.catalogue.responses(self.value, reach, Followed(longest=self.longest)):
            for branch in diagram.branches:
                if len(branch) and not any(same_branch(branch, other) for other in known):
                    yield branch
            known += diagram.branches

    def _unexplained(self) -> Iterator[MonotonePiece]:
        """Limit points within the range that lie on no branch that is known by then."""
        low, high = self.catalogue.omega
        for piece in self.catalogue.pieces:  # to which more are added on the way
            new = piece.kind == "LP" and piece not in self.explained and piece.contains(self.value)
            if new and low <= float(piece.across(self.value)) <= high:
                yield piece

    def _through(self, piece: MonotonePiece) -> Iterator[tuple[Branch, bool]]:
        """The branch through a limit point, its mirror image if that is another one, and what bifurcates from them."""
        catalogue, value, options = self.catalogue, self.value, self.catalogue.options
        met: list[Branch] = []
        where = f"omega = {float(piece.across(value)):.6g}, {catalogue.name} = {value:.6g}"
        with catalogue.noting(f"the branch through the limit point at {where} could not be followed", FAILURES):
            met = self._both_images(piece)
        for one in met:
            if self._is_known(one):
                self.explained.append(piece)
                continue
            attached = [known for known, isolated in self.branches if not isolated]
            detached = catalogue.carrier(one, value, attached) is not None
            diagram = grown_from(one, Followed(longest=self.longest), options)
            catalogue.note_failures(diagram, value)
            for branch in diagram.branches:
                if not self._is_known(branch):
                    yield branch, detached

    def _both_images(self, piece: MonotonePiece) -> list[Branch]:
        """The branch through a limit point, and its mirror image where that is another branch."""
        catalogue, options = self.catalogue, self.catalogue.options
        start = piece.solve_at(self.value)
        branch = branch_through(start, catalogue.omega, catalogue.name, catalogue.limit_points, options)
        pass_on(branch.interruption)
        if branch.nu > 1 and not branch.closed and branch.departs is None and branch.arrives is None:
            # it may close where no limit point is known yet
            low, high = sorted(branch.options["bounds"]["omega"])
            wider = continue_branch(start, "omega", SearchRange(low, high).around, **options)
            pass_on(wider.interruption)
            branch = wider if wider.closed else branch
        image = mirrored(branch.points[len(branch) // 2].orbit)
        if image is None or lies_on(image, branch.points):
            return [branch]
        other = continue_branch(image, "omega", branch.options["bounds"]["omega"], **options)
        pass_on(other.interruption)
        return [branch, other]

    # ---------------------------------------------------------------------------------------------------------- arcs
    def _collect_arcs(self) -> None:
        """The stable arcs of all branches, what ends them followed over the parameter; each once."""
        self.arcs = []
        located = [item for branch, _ in self.branches for item in branch.bifurcations]
        low, high = self.catalogue.omega
        for branch, isolated in self.branches:
            for stretch in stretches(branch, located):
                if stretch.stable is None and stretch.width > _NARROW * (high - low):
                    self.catalogue.note(
                        f"at {self.catalogue.name} = {self.value:.6g} no motion was computed on a stretch of a "
                        f"{period_name(branch.nu)} branch {stretch.width:.2g} wide in omega: taken for unstable"
                    )
                beyond = 2 * branch.nu > self.longest and stretch.doubled
                if stretch.stable or beyond:
                    self._add_arc(self._arc(stretch, isolated, beyond))

    def _add_arc(self, arc: Arc) -> None:
        """Branches begun at different ends may have a part in common: the longer one shows where it ends."""
        alike = next((i for i, other in enumerate(self.arcs) if other.nu == arc.nu and _shared(arc, other)), None)
        if alike is None:
            self.arcs.append(arc)
        elif sum(edge.bound for edge in arc.edges) < sum(edge.bound for edge in self.arcs[alike].edges):
            self.arcs[alike] = arc

    def _arc(self, stretch: Stretch, isolated: bool, beyond: bool) -> Arc:
        catalogue = self.catalogue
        edges = []
        low, high = catalogue.omega
        slack = _AT_END * (high - low)
        for end in stretch.ends:
            if not isinstance(end, float):
                edges.append(Edge(end.omega, catalogue.known(end, self.value), end.kind))
                continue
            bound = end <= low + slack or end >= high - slack
            if not bound:
                catalogue.note(
                    f"at {catalogue.name} = {self.value:.6g} a branch of stable motions ends at omega = {end:.6g}: "
                    f"{stretch.branch.ended}"
                )
            outside = -float("inf") if end <= low + slack else float("inf")
            edges.append(Edge(outside if bound else end, bound=bound))
        first, last = sorted(edges, key=lambda edge: edge.omega)
        return Arc(stretch.branch.nu * (1 + beyond), isolated, (first, last), stretch.points, not beyond)


def _shared(one: Arc, other: Arc) -> bool:
    """Whether two arcs of one period have motions in common."""
    pairs = ((one.points, other.points), (other.points, one.points))
    return any(
        lies_on(points[min(round(share * len(points)), len(points) - 1)].orbit, others)
        for points, others in pairs
        for share in _SAMPLES
    )


def follow_curves_of(branch: Branch, value: float, catalogue: Catalogue) -> None:
    """Follow the limit points of a branch that no bifurcation leads to: they lead to it at every value."""
    before = len(catalogue.pieces)
    known = [catalogue.known(item, value) for item in branch.bifurcations["LP"]]
    if not any(known) and before == len(catalogue.pieces):
        catalogue.note(
            f"a branch of {period_name(branch.nu)} motions at {catalogue.name} = {value:.6g} has no limit point that "
            "could be followed: it is not on the map"
        )


def follow_curves_beside(value: float, catalogue: Catalogue) -> None:
    """Follow limit points of the response beside the range, between which and others it runs through the range.

    A resonance that begins below the range of omega and folds within it is met so, by no curve within the range.
    """
    low, high = catalogue.omega
    around = catalogue.omega.around
    with catalogue.noting(f"at {catalogue.name} = {value:.6g} the response beside the range of omega was not found"):
        wide = frequency_response(catalogue.at(value), around[::-1], catalogue.harmonics, **catalogue.options)
        pass_on(wide.interruption)
        folds: list[Bifurcation] = wide.bifurcations["LP"]
        places = [float(wide.omega[0]), *(b.omega for b in folds), float(wide.omega[-1])]
        for number, (one, other) in enumerate(pairwise(places)):
            if min(one, other) < high and max(one, other) > low:
                for item in folds[max(number - 1, 0) : number + 1]:
                    catalogue.known(item, value)


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
