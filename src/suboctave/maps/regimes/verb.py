"""`regime_map`: which motions are stable over the plane of omega and a design parameter, from curves of bifurcations.

1. At some values of the parameter all branches are followed, the response, what bifurcates from it, isolas; every
   bifurcation that borders stable motions is followed over the parameter, and so is every limit point.
2. Between two neighbouring critical values (where curves turn, end, or meet a second condition) the stable arcs of
   branches have the same order at every value. So branches are followed at one value within each such strip.
3. A stable arc is known there by the two borders that end it. At other values of the strip it reaches from one border
   to the other.

Steps 1 and 2 are repeated until no new curve is met. What is counted are motions on branches that something leads to;
quasi-periodic and chaotic ones, and branches that nothing leads to, are not known: `RegimeMap.check` looks for them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product, repeat
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.branches import continue_branch, frequency_response
from suboctave.analysis.diagram import Followed, grown_from
from suboctave.analysis.options import DesignOptions
from suboctave.analysis.subharmonics import Seeds
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.continuation.notes import Note
from suboctave.curves.identity import lies_on, mirrored
from suboctave.curves.junction import period_name
from suboctave.curves.starts import Harmonics
from suboctave.errors import InputError, is_number, refuse_idle, shortened
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on, unlimited
from suboctave.maps.catalogue import (
    FAILURES,
    MOST_VALUES,
    THROUGH,
    UNASKED,
    AtValues,
    Catalogue,
    SearchRange,
    branch_through,
    checked_orders,
    few,
)
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.pieces import MonotonePiece, Stretch, same_branch, stretches
from suboctave.maps.regimes.arcs import Arc, Edge, Slice, Strip
from suboctave.maps.regimes.map import RegimeMap
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.workers import check_workers, in_order

#: a multiplier this close to -1 asks for slices beside it, as far as this share of the range apart
_NEARLY, _FINE = 0.6, 1.0 / 32.0
#: a value within a strip keeps this share of its width away from the ends
_INSIDE = 0.02
#: critical values closer to each other, in shares of the parameter's range, are one
_TOGETHER = 1e-9
#: ends of branches this close to the end of the range, relatively, lie on it
_AT_END = 1e-6
#: stretches without a point, narrower than this share of the range, are taken for unstable without a note
_NARROW = 1e-4
#: where along an arc its motions are compared with those of another
_SAMPLES = (0.1, 0.3, 0.5, 0.7, 0.9)


@with_options(DesignOptions)
@timed
def regime_map(
    system: System,
    omega: Range,
    parameter: str,
    bounds: Range,
    *,
    harmonics: Harmonics = "adaptive",
    depth: int = 2,
    values: int = 5,
    resolution: float = 1e-4,
    isolas: Isolas | None = None,
    search: Sequence[int] | None = None,
    seeds: Seeds | None = None,
    motions: Sequence[PeriodicOrbit] = (),
    max_curves: int = 64,
    max_slices: int = 64,
    **options: Unpack[DesignOptions],
) -> RegimeMap:
    """Which stable motions exist, by their periods, over the plane of omega and a design parameter.

    Parameters
    ----------
    system, omega, parameter, bounds, harmonics
        As in `find_isolas`.
    depth
        How many period doublings deep branches are followed: 0 for T, 1 for 2T as well, 2 for 4T, ... Branch points on
        the way, at which unsymmetric motions leave, do not count.
    values
        At how many values of the parameter, evenly spread, branches are followed to begin with; others follow where
        curves of bifurcations turn or end.
    resolution
        Strips between critical values that are narrower than this share of the range are not looked at: there the
        nearest one is continued, and `label` says what its borders say.
    isolas
        What `find_isolas` found over the same parameter: its curves need not be followed again.
    search, seeds
        Periods (3 for 3T, ...) of which isolas are looked for at the first `values` among the nonlinear resonances of
        the linear modes (`find_subharmonics`), and how finely. Default: 2 where no closed branch was met otherwise and
        2T motions are followed, at three of the values; () for never.
    motions
        Motions that are known from elsewhere, as from `RegimeCheck.unknown`: the branches that they lie on are mapped.
    max_curves, max_slices
        Curves, and values of the parameter, after which no more are followed.

    Branches at values of the parameter, and the search among resonances, are divided among `workers`; curves over the
    parameter are followed in this process.

    Returns
    -------
    RegimeMap
        With `label(omega, value)`, `regions`, `plot`, `check`; `notes` says what could not be settled. Ctrl-C ends it
        with what is known by then.
    """
    catalogue = Catalogue.checked(system, parameter, bounds, omega, harmonics, max_curves, options)
    for name, number, least in (("depth", depth, 0), ("values", values, 1), ("max_slices", max_slices, 1)):
        check_count(name, number, least)
    if values > MOST_VALUES:
        raise InputError(f"values={shortened(values)}: whole responses are followed at each, at most {MOST_VALUES}")
    if not is_number(resolution) or not 0.0 < resolution < 0.5:
        raise InputError(f"resolution must be a share of the range between 0 and 0.5, not {resolution!r}")
    followed = _checked_isolas(isolas, parameter)
    orders, given = checked_orders(search or (), 1), _checked_motions(motions, catalogue)
    if search is not None and not orders:
        refuse_idle("no periods are looked for; name them in search=, or leave seeds out", seeds=seeds is not None)
    places = [catalogue.bounds[0] + (i + 0.5) / values * catalogue.span for i in range(values)]
    processes = check_workers(options.get("workers"))
    plan = _Survey(catalogue, 2**depth, resolution, max_slices, processes)
    kept = "the map holds what had been found by then"
    with catalogue.reporting(options.get("progress"), f"regimes over omega and {parameter}", kept):
        for curve in followed:
            catalogue.add(curve)
        _follow_motions(given, catalogue)
        _search_resonances(orders, places, seeds, processes, catalogue)
        plan.begin(places)
        if search is None and depth and not plan.isolated:
            orders = UNASKED
            _search_resonances(orders, few(places), seeds, processes, catalogue)
            plan.fill()
    with unlimited():
        return RegimeMap(catalogue, plan.strips(), depth, resolution, orders)


def _checked_isolas(isolas: Any, parameter: str) -> Sequence[TrackedBranch]:
    """The curves that a search for isolas has followed."""
    if isolas is None:
        return ()
    if not isinstance(isolas, Isolas) or isolas.parameter != parameter:
        raise InputError(f"isolas must be what find_isolas gave over {parameter}, not {isolas!r}")
    return (*isolas.limit_points, *isolas.doublings)


def _checked_motions(motions: Any, catalogue: Catalogue) -> list[PeriodicOrbit]:
    system, name, (low, high) = catalogue.system, catalogue.name, catalogue.bounds
    given = list(motions) if isinstance(motions, Sequence) else [motions]
    for orbit in given:
        if not isinstance(orbit, PeriodicOrbit):
            raise InputError(f"motions must be PeriodicOrbit objects, not {type(orbit).__name__}")
        if set(orbit.values) != set(system.parameters):
            raise InputError(f"the motion {orbit!r} is one of another system")
        if not (low <= orbit.values[name] <= high and catalogue.omega.low <= orbit.omega <= catalogue.omega.high):
            raise InputError(f"the motion {orbit!r} does not lie in the plane of the map")
        others = [n for n, v in system.parameters.items() if n != name and orbit.values[n] != v]
        if others:
            raise InputError(f"the motion {orbit!r} has another {others[0]} than the system")
    return given


def _follow_motions(motions: Sequence[PeriodicOrbit], catalogue: Catalogue) -> None:
    """Follow the branches that motions given lie on, each once, and the curves of their limit points."""
    known: list[tuple[float, Branch]] = []
    for orbit in motions:
        value = orbit.values[catalogue.name]
        if any(v == value and lies_on(orbit, b.points) for v, b in known):
            continue
        catalogue.progress(0.0, f"{period_name(orbit.basis.nu)} at {catalogue.name} = {value:.6g}")
        with catalogue.noting(
            catalogue.open("the branch through a motion given could not be followed", value, orbit.omega)
        ):
            branch = continue_branch(orbit, "omega", catalogue.omega.around, **catalogue.options)
            pass_on(branch.interruption)
            known.append((value, branch))
            _follow_curves_of(branch, value, catalogue)


# --------------------------------------------------------------------------------------------------------- slices
@dataclass(frozen=True, eq=False)
class _Resonant(AtValues):
    """Branches of a period that a search among resonances meets, by value and period."""

    seeds: Seeds | None

    def found(self, catalogue: Catalogue, place: tuple[float, int]) -> list[Branch]:
        """See the class."""
        return catalogue.resonant(*place, self.seeds, [])


@dataclass(frozen=True, eq=False)
class _Diagrams(AtValues):
    """The response from both ends with all that bifurcates from it, by value and range of omega."""

    longest: int

    def found(self, catalogue: Catalogue, place: tuple[float, SearchRange]) -> list[BifurcationDiagram]:
        """See the class."""
        return list(catalogue.responses(*place, Followed(longest=self.longest)))


@dataclass(frozen=True, eq=False)
class _Foreseen:
    """What the response leads to at a value, if it is followed in the range `reach`, and what could not be settled."""

    reach: SearchRange
    diagrams: Sequence[BifurcationDiagram]
    notes: Sequence[Note]


def _search_resonances(
    orders: Sequence[int], values: Sequence[float], seeds: Seeds | None, workers: int, catalogue: Catalogue
) -> None:
    """Look for branches of some periods among resonances at values; the curves of their limit points lead to them."""
    places = list(product(values, orders))
    found = _Resonant(catalogue.emptied(), seeds).over(places, workers, catalogue)
    for value, order in places:
        catalogue.progress(0.0, f"searching {period_name(order)} motions at {catalogue.name} = {value:.6g}")
        for branch in next(found):
            _follow_curves_of(branch, value, catalogue)


def _foresee(catalogue: Catalogue, longest: int, place: tuple[float, SearchRange]) -> _Foreseen:
    diagrams, notes = _Diagrams(catalogue.emptied(), longest)(place)
    return _Foreseen(place[1], diagrams, notes)


def _reach(catalogue: Catalogue, value: float) -> SearchRange:
    """In which range of omega responses are followed at a value: what leads into the range from beside it is in it."""
    places = (piece for piece in catalogue.pieces if piece.kind in ("PD", "BP") and piece.contains(value))
    return catalogue.omega.holding(float(piece.across(value)) for piece in places)


@dataclass(eq=False, kw_only=True)
class _GrowingSlice(Slice):
    """All branches at one value of the design parameter, up to a period, followed as curves become known.

    The response with the branches that bifurcate from it, begun at both ends of the range; then a branch through every
    limit point of a known curve that lies on none of these: isolas, and branches that lead through the range elsewhere.

    catalogue, longest
        What is known of bifurcations, and the longest period, in periods of the load, that is followed.
    reach
        Range of omega in which the responses were followed; None before they are.
    explained
        Stretches of curves of limit points that lie on one of the branches there.
    """

    catalogue: Catalogue
    longest: int
    reach: SearchRange | None = None
    explained: list[MonotonePiece] = field(default_factory=list)

    def complete(self, foreseen: _Foreseen | None = None) -> None:
        """Follow the branches; bifurcations met are followed over the parameter if they are new.

        `foreseen`: what the response leads to there, which holds if it was followed in the range that is needed.

        Called again it adds branches through limit points that have become known since, and begins anew where
        bifurcations beyond the range have, from which branches lead into it.
        """
        reach = _reach(self.catalogue, self.value)
        before = len(self.branches)
        if self.reach is None or reach.low < self.reach.low or reach.high > self.reach.high:
            self.reach, before = reach, -1
            self.branches, self.arcs, self.explained = [], [], []
            # the response from both ends with all that bifurcates from it
            if foreseen is None or foreseen.reach != reach:
                foreseen = _foresee(self.catalogue, self.longest, (self.value, reach))
            self.catalogue.notes += foreseen.notes
            for diagram in foreseen.diagrams:
                known = [branch for branch, _ in self.branches]
                for branch in diagram.branches:
                    if len(branch) and not any(same_branch(branch, other) for other in known):
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
        with catalogue.noting(catalogue.open(THROUGH, value, float(piece.across(value)), "LP"), FAILURES):
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
                    text = (
                        f"a {period_name(branch.nu)} branch has no points on a stretch of omega "
                        f"({stretch.width:.2g} wide), which counts as unstable. Use a smaller max_step"
                    )
                    self.catalogue.notes.append(self.catalogue.open(text, self.value))
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
                text = f"a branch of stable motions ends here ({stretch.branch.ended})"
                catalogue.notes.append(catalogue.open(text, self.value, end))
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


def _follow_curves_of(branch: Branch, value: float, catalogue: Catalogue) -> None:
    """Follow the limit points of a branch that no bifurcation leads to: they lead to it at every value."""
    before = len(catalogue.pieces)
    known = [catalogue.known(item, value) for item in branch.bifurcations["LP"]]
    if not any(known) and before == len(catalogue.pieces):
        text = f"a {period_name(branch.nu)} branch is not on the map: none of its limit points could be followed"
        catalogue.notes.append(catalogue.open(text, value))


def _follow_curves_beside(value: float, catalogue: Catalogue) -> None:
    """Follow limit points of the response beside the range, between which and others it runs through the range.

    A resonance that begins below the range of omega and folds within it is met so, by no curve within the range.
    """
    low, high = catalogue.omega
    around = catalogue.omega.around
    with catalogue.noting(catalogue.open("the response beside the range of omega was not found", value)):
        wide = frequency_response(catalogue.at(value), around[::-1], harmonics=catalogue.harmonics, **catalogue.options)
        pass_on(wide.interruption)
        folds: list[Bifurcation] = wide.bifurcations["LP"]
        places = [float(wide.omega[0]), *(b.omega for b in folds), float(wide.omega[-1])]
        for number, (one, other) in enumerate(pairwise(places)):
            if min(one, other) < high and max(one, other) > low:
                for item in folds[max(number - 1, 0) : number + 1]:
                    catalogue.known(item, value)


@dataclass
class _Survey:
    """Slices of the plane: at first values, then one in every strip between critical values.

    catalogue, longest
        The curves of bifurcations, and the longest period that is followed.
    resolution, most
        Strips narrower than this share of the range get no slice; how many slices there may be.
    """

    catalogue: Catalogue
    longest: int
    resolution: float
    most: int
    workers: int = 1
    slices: list[_GrowingSlice] = field(default_factory=list)

    @property
    def isolated(self) -> bool:
        """Whether a closed branch that nothing leads to was met."""
        return any(isolated for known in self.slices for _, isolated in known.branches)

    def begin(self, values: Sequence[float]) -> None:
        """Slices at first values, and at all that these ask for."""
        for value in dict.fromkeys((values[0], values[-1])):
            _follow_curves_beside(value, self.catalogue)
        self.fill(values)

    def fill(self, values: Sequence[float] = ()) -> None:
        """Add slices until every strip has one, and no limit point known is unexplained at any of them."""
        catalogue, waiting = self.catalogue, list(values)
        while True:
            foreseen = self._foreseen(waiting)
            for number, value in enumerate(waiting):
                if len(self.slices) >= self.most:
                    text = (
                        f"narrow strips may be missing after {self.most} values of {catalogue.name}. Raise max_slices"
                    )
                    catalogue.notes.append(Note(text))
                    return
                share = len(self.slices) / (len(self.slices) + len(waiting) - number + 3.0)
                catalogue.progress(share, f"{catalogue.name} = {value:.6g}")
                new = _GrowingSlice(value, catalogue=catalogue, longest=self.longest)
                new.complete(next(foreseen))
                self.slices.append(new)
            # limit points that have become known later may lie on branches that were not met before
            count = -1
            while count != len(catalogue.curves):
                count = len(catalogue.curves)
                for known in self.slices:
                    known.complete()
            empty = [0.5 * (a + b) for a, b, within in self._strips(self.resolution) if not within]
            waiting = empty or self._doubtful()
            if not waiting:
                return

    def _foreseen(self, values: Sequence[float]) -> Iterator[_Foreseen | None]:
        """What the response leads to at each value in the range that is known to be needed by now; None for one
        process, which may wait until all is known that was met before.
        """
        if self.workers == 1:
            yield from repeat(None, len(values))
        else:
            places = [(value, _reach(self.catalogue, value)) for value in values]
            found = in_order(_Diagrams(self.catalogue.emptied(), self.longest), places, self.workers)
            for (_, reach), (diagrams, notes) in zip(places, found, strict=True):
                for diagram in diagrams:
                    for branch in diagram.branches:
                        self.catalogue.show(branch)
                yield _Foreseen(reach, diagrams, notes)

    def critical(self) -> list[float]:
        """Values of the parameter, ascending, bounds included, at which the order of the regimes may change.

        Curves turn, end, have a point of codimension two, or leave the range of omega there, or the other multipliers
        of their motions cross the unit circle.
        """
        catalogue = self.catalogue
        name, (low, high) = catalogue.name, catalogue.bounds
        marks = [high]
        for curve in catalogue.curves:
            for event in curve.bifurcations.met:
                if isinstance(event, TrackedEvent) and (event.kind != "extremum" or event.parameter_name == name):
                    marks.append(event.parameter(name))
            values, stable = curve.parameter(name), curve.stable
            events = np.array([e.arclength for e in curve.bifurcations.met])
            for i in np.nonzero(stable[:-1] != stable[1:])[0]:
                start, stop = curve.arclength[i], curve.arclength[i + 1]
                if not np.any((events >= start) & (events <= stop)):
                    marks.append(float(0.5 * (values[i] + values[i + 1])))
            if not curve.closed:
                marks += [float(values[0]), float(values[-1])]
        for piece in catalogue.pieces:
            for end in catalogue.omega:
                marks += piece.values_at(end)
        distinct = [low]
        for value in sorted(v for v in marks if low <= v <= high):
            if value - distinct[-1] > _TOGETHER * catalogue.span:
                distinct.append(value)
        return distinct

    def _doubtful(self) -> list[float]:
        """Values beside those at which a motion nearly doubles its period: a pair of doublings may begin between them.

        It would lie on no branch that was met, so that no curve shows it.
        """
        values = []
        for a, b, _ in self._strips():
            within = sorted((s for s in self.slices if a <= s.value <= b), key=lambda s: s.value)
            places = [a, *(s.value for s in within), b]
            for i, near in enumerate(within, 1):
                gap = min((arc.nearly_doubled for arc in near.arcs if arc.followed), default=math.inf)
                if gap < _NEARLY:
                    sides = ((places[i - 1] + places[i]) / 2.0, (places[i] + places[i + 1]) / 2.0)
                    values += [v for v in sides if abs(v - near.value) > 0.5 * _FINE * self.catalogue.span]
        return sorted(set(values))

    def strips(self) -> list[Strip]:
        """The strips with their slices; those without one take that of a neighbour."""
        strips = []
        for a, b, within in self._strips():
            middle = 0.5 * (a + b)
            nearest = min(within or self.slices, key=lambda s: abs(s.value - middle), default=None)
            strips.append(Strip(a, b, nearest, bool(within)))
        return strips

    def _strips(self, least: float = 0.0) -> Iterator[tuple[float, float, list[_GrowingSlice]]]:
        """Stretches between critical values, at least this share of the range wide, with the slices well inside."""
        for a, b in pairwise(self.critical()):
            if b - a >= least * self.catalogue.span:
                margin = _INSIDE * (b - a)
                yield a, b, [s for s in self.slices if a + margin <= s.value <= b - margin]
