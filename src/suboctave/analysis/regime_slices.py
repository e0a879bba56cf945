"""All branches at one value of the design parameter, as deep as asked, and their stable arcs.

The response with the branches that bifurcate from it, begun at both ends of the range; then a branch through every
limit point of a known curve that lies on none of these: isolas, and branches that lead through the range elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from suboctave.analysis.borders import Border
from suboctave.analysis.branch import Branch
from suboctave.analysis.diagram import bifurcation_diagram, grown_from
from suboctave.analysis.identity import lies_on, mirrored
from suboctave.analysis.isola import carrier_of
from suboctave.analysis.junction import period_name
from suboctave.analysis.regime_arcs import Arc, Edge, Stretch, same_branch, stretches
from suboctave.analysis.regime_atlas import Atlas
from suboctave.analysis.verbs import continue_branch, frequency_response
from suboctave.bifurcation import Bifurcation
from suboctave.errors import ConvergenceError, InputError
from suboctave.interruption import pass_on

__all__ = ["Slice", "beyond", "introduce", "looked"]

#: ends of branches this close to the end of the range, relatively, lie on it
_AT_END = 1e-6
#: stretches without a point, narrower than this share of the range, are taken for unstable without a word
_NARROW = 1e-4
#: responses are followed this share of the range beyond a bifurcation that lies outside of it
_BESIDE = 0.02
#: where along an arc its motions are compared with those of another
_SAMPLES = (0.1, 0.3, 0.5, 0.7, 0.9)
#: and begin so many times beyond its ends where limit points beside it are looked for
_FAR = 2.0


@dataclass(eq=False)
class Slice:
    """Branches over omega at one value of the design parameter.

    reach
        Range of omega in which the responses were followed.
    branches
        Each with whether it lies on an isola, or leaves one.
    arcs
        Its stable arcs.
    explained
        Borders of limit points that lie on one of the branches there.
    """

    value: float
    reach: tuple[float, float] = (0.0, 0.0)
    branches: list[tuple[Branch, bool]] = field(default_factory=list)
    arcs: list[Arc] = field(default_factory=list)
    explained: list[Border] = field(default_factory=list)

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """Everything located on its branches."""
        return [item for branch, _ in self.branches for item in branch.bifurcations]


def looked(value: float, atlas: Atlas, depth: int, slices: Slice | None = None) -> Slice:
    """The branches at a value; bifurcations met there are followed over the parameter if they are new.

    With a slice given it is completed by branches through limit points that have become known since.
    """
    reach = _reach(value, atlas)
    if slices is not None and (reach[0] < slices.reach[0] or reach[1] > slices.reach[1]):
        # bifurcations beyond the range have become known, from which branches lead into it
        slices.branches, slices.arcs, slices.explained = [], [], []
        slices.reach = reach
        fresh = True
    else:
        fresh = slices is None
    found = slices or Slice(value, reach)
    before = len(found.branches)
    if fresh:
        for branch in _responses(found, atlas, depth):
            found.branches.append((branch, False))
            _explain(found, branch, atlas)
    done: list[Border] = []
    while True:
        missing = [b for b in atlas.borders if b.kind == "LP" and b.contains(value) and b not in found.explained + done]
        missing = [b for b in missing if _within(float(b.across(value)), atlas)]
        if not missing:
            break
        done.append(missing[0])
        for branch, isolated in _through(missing[0], value, atlas, depth, found):
            found.branches.append((branch, isolated))
            _explain(found, branch, atlas)
    if fresh or len(found.branches) > before:
        found.arcs = _arcs(found, atlas, 2**depth)
    return found


def _reach(value: float, atlas: Atlas) -> tuple[float, float]:
    """The range of omega, made wider to hold bifurcations beside it from which branches lead into it."""
    low, high = atlas.omega
    places = [float(b.across(value)) for b in atlas.borders if b.kind in ("PD", "BP") and b.contains(value)]
    margin = _BESIDE * (high - low)
    return min([low, *(w - margin for w in places if w < low)]), max([high, *(w + margin for w in places if w > high)])


def _within(omega: float, atlas: Atlas) -> bool:
    low, high = atlas.omega
    return low <= omega <= high


def _responses(found: Slice, atlas: Atlas, depth: int) -> Iterator[Branch]:
    """The response from both ends with all that bifurcates from it."""
    value = found.value
    system = atlas.system.with_parameters({atlas.name: value})
    low, high = found.reach
    known: list[Branch] = []
    for ends in ((high, low), (low, high)):
        try:
            diagram = bifurcation_diagram(system, ends, depth, harmonics=atlas.harmonics, **atlas.options)
        except ConvergenceError as failure:
            atlas.note(f"at {atlas.name} = {value:.6g}: {failure}")
            continue
        pass_on(diagram.interruption)
        for node in diagram:
            for item, why in node.failures:
                atlas.note(f"at {atlas.name} = {value:.6g}, {item.kind} at omega = {item.omega:.6g}: {why}")
            if len(node.branch) and not any(same_branch(node.branch, other) for other in known):
                yield node.branch
        root = diagram.root.branch
        known += diagram.branches
        if len(diagram.responses) > 1 or (len(root) and root.points[-1].orbit.omega == ends[1]):
            return


def _through(border: Border, value: float, atlas: Atlas, depth: int, found: Slice) -> Iterator[tuple[Branch, bool]]:
    """The branch through a limit point, its mirror image where that is another one, and what bifurcates from them."""
    where = f"omega = {float(border.across(value)):.6g}, {atlas.name} = {value:.6g}"
    places = [float(v) for b in atlas.borders if b.kind == "LP" and b.contains(value) for v in [b.across(value)]]
    low, high = min([*places, *atlas.omega]), max([*places, *atlas.omega])
    margin = 0.02 * (high - low)
    bounds = (max(low - margin, 0.5 * low), high + margin)
    try:
        start = atlas.limit_point(border, value)
        branch = continue_branch(start, "omega", bounds, **atlas.options)
        pass_on(branch.interruption)
        if branch.nu > 1 and not branch.closed and branch.departs is None and branch.arrives is None:
            # it may close where no limit point is known yet
            wider = continue_branch(start, "omega", (0.5 * low, 2.0 * high), **atlas.options)
            pass_on(wider.interruption)
            branch = wider if wider.closed else branch
        met = [branch]
        image = mirrored(branch.points[len(branch) // 2].orbit)
        if image is not None and not lies_on(image, branch.points):
            met.append(continue_branch(image, "omega", branch.options["bounds"]["omega"], **atlas.options))
    except (ConvergenceError, InputError) as failure:
        atlas.note(f"the branch through the limit point at {where} could not be followed: {failure}")
        return
    levels = max(0, math.floor(math.log2(2**depth / branch.nu)))
    for one in met:
        pass_on(one.interruption)
        if any(same_branch(one, other) for other, _ in found.branches):
            found.explained.append(border)
            continue
        try:
            attached = [known for known, isolated in found.branches if not isolated]
            detached = carrier_of(one, attached, atlas.options) is not None
        except (ConvergenceError, InputError) as failure:
            atlas.note(f"whether the branch through the limit point at {where} is isolated is open: {failure}")
            detached = False
        diagram = grown_from(one, levels, atlas.options)
        pass_on(diagram.interruption)
        for node in diagram:
            for item, why in node.failures:
                atlas.note(f"at {atlas.name} = {value:.6g}, {item.kind} at omega = {item.omega:.6g}: {why}")
            if not any(same_branch(node.branch, other) for other, _ in found.branches):
                yield node.branch, detached


def introduce(branch: Branch, value: float, atlas: Atlas) -> None:
    """A branch that was found by other means: its limit points are followed, and lead to it at every value."""
    before = len(atlas.borders)
    known = [atlas.known(item, value) for item in branch.bifurcations["LP"]]
    if not any(known) and before == len(atlas.borders):
        atlas.note(
            f"a branch of {period_name(branch.nu)} motions at {atlas.name} = {value:.6g} has no limit point that could "
            "be followed: it is not on the map"
        )


def beyond(value: float, atlas: Atlas) -> None:
    """Limit points of the response beside the range, between which and others it runs through the range.

    A resonance that begins below the range of omega and folds within it is met so, by no curve within the range.
    """
    system = atlas.system.with_parameters({atlas.name: value})
    low, high = atlas.omega
    try:
        wide = frequency_response(system, (_FAR * high, low / _FAR), atlas.harmonics, **atlas.options)
    except ConvergenceError as failure:
        atlas.note(f"at {atlas.name} = {value:.6g} the response beside the range of omega was not found: {failure}")
        return
    pass_on(wide.interruption)
    folds = wide.bifurcations["LP"]
    places = [float(wide.omega[0]), *(b.omega for b in folds), float(wide.omega[-1])]
    for number, (one, other) in enumerate(pairwise(places)):
        if min(one, other) < high and max(one, other) > low:
            for item in folds[max(number - 1, 0) : number + 1]:
                atlas.known(item, value)


def _explain(found: Slice, branch: Branch, atlas: Atlas) -> None:
    """Limit points of a branch are followed over the parameter, and known from now on to lie on a branch."""
    for item in branch.bifurcations["LP"]:
        border = atlas.known(item, found.value)
        if border is not None and border not in found.explained:
            found.explained.append(border)


def _arcs(found: Slice, atlas: Atlas, deepest: int) -> list[Arc]:
    """The stable arcs of all branches, what ends them followed over the parameter; each once."""
    arcs: list[Arc] = []
    others = found.bifurcations
    low, high = atlas.omega
    for branch, isolated in found.branches:
        for stretch in stretches(branch, others):
            if stretch.stable is None and stretch.width > _NARROW * (high - low):
                atlas.note(
                    f"at {atlas.name} = {found.value:.6g} no motion was computed on a stretch of a "
                    f"{period_name(branch.nu)} branch {stretch.width:.2g} wide in omega: taken for unstable"
                )
            beyond = 2 * branch.nu > deepest and stretch.doubled
            if not stretch.stable and not beyond:
                continue
            made = _arc(stretch, isolated, found.value, atlas, beyond)
            # branches begun at different ends may have a part in common: the longer one says where it ends
            alike = [i for i, arc in enumerate(arcs) if arc.nu == made.nu and _shared(made, arc)]
            if not alike:
                arcs.append(made)
            elif sum(edge.bound for edge in made.edges) < sum(edge.bound for edge in arcs[alike[0]].edges):
                arcs[alike[0]] = made
    return arcs


def _shared(one: Arc, other: Arc) -> bool:
    """Whether two arcs of one period have motions in common."""
    pairs = ((one.points, other.points), (other.points, one.points))
    return any(
        lies_on(points[min(round(share * len(points)), len(points) - 1)].orbit, others)
        for points, others in pairs
        for share in _SAMPLES
    )


def _arc(stretch: Stretch, isolated: bool, value: float, atlas: Atlas, beyond: bool) -> Arc:
    edges = []
    low, high = atlas.omega
    slack = _AT_END * (high - low)
    for end in stretch.ends:
        if isinstance(end, float):
            bound = end <= low + slack or end >= high - slack
            if not bound:
                atlas.note(
                    f"at {atlas.name} = {value:.6g} a branch of stable motions ends at omega = {end:.6g}: "
                    f"{stretch.branch.ended}"
                )
            outside = -float("inf") if end <= low + slack else float("inf")
            edges.append(Edge(outside if bound else end, bound=bound))
            continue
        edges.append(Edge(end.omega, atlas.known(end, value), end.kind))
    edges.sort(key=lambda edge: edge.omega)
    nu = stretch.branch.nu * (2 if beyond else 1)
    return Arc(nu, isolated, (edges[0], edges[1]), stretch.points, not beyond)
