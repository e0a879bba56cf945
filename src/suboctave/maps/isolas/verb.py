"""`find_isolas`: closed branches that no sweep leads to, over a design parameter.

1. At several values of the parameter the response is followed, with the branches that bifurcate from it
   (`from_responses`; where that leads to no isola, responses under other loads and resonances).
2. Every limit point met is followed over the parameter, through its extrema; every period doubling as well.
3. Where the curve of limit points has a definite extremum a closed branch shrinks to a point. Limit points at the
   values of 1. that lie on none of the branches met there lie on others (`search`).
4. A branch through such a limit point is followed. If it closes, the search finds the range in which it does.

None of this depends on the value that the parameter happens to have, nor begins at an extremum of period doublings,
where sub-harmonic motions appear beside their parent (Alcorta et al., Nonlinear Dynamics 98, 2019, section 3.6, begin
there).

Where a search begins, at responses, at responses under other loads, among nonlinear resonances, is a strategy. Each
leads to limit points or closed branches at values of the design parameter; `Search` does the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.analysis.diagram import Followed
from suboctave.analysis.options import SearchOptions
from suboctave.analysis.subharmonics import Seeds
from suboctave.curves.discretisation import Harmonics, own_linear_part
from suboctave.curves.identity import image_of, lies_on, relation
from suboctave.curves.junction import period_name
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import (
    COARSE,
    Catalogue,
    check_seeds,
    checked_orders,
    checked_values,
    listed,
    motion_near,
)
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.isolas.search import PREPARATION, Loop, Search
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.branch import Branch


@with_options(SearchOptions)
@timed
def find_isolas(
    system: System,
    omega: tuple[float, float],
    parameter: str,
    bounds: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    values: int | Sequence[float] = 5,
    depth: int = 1,
    levels: Sequence[float] | None = None,
    search: Sequence[int] | None = None,
    seeds: Seeds | None = None,
    max_curves: int = 64,
    **options: Unpack[SearchOptions],
) -> Isolas:
    """Isolated responses over a design parameter: where each is born, where it merges, the closed branch in between.

    Parameters
    ----------
    system
        What vibrates. The value that `parameter` has in it does not matter.
    omega
        Range of frequencies in which responses are followed, rad per unit time; the order is irrelevant.
    parameter, bounds
        The design parameter and its range; the order is irrelevant.
    harmonics
        As in `frequency_response`.
    values
        At how many values of the parameter, evenly spread over the bounds, responses are followed to begin with (at
        least 2); or these values themselves.
    depth
        How many bifurcations deep branches are followed there: 0 the response alone, 1 with what leaves it (2T), 2 with
        what leaves these (4T). Isolas of those periods are found.
    levels
        Other levels of the loads, in units of their own, at which responses are followed at these values as well: most
        isolas join the main branch under stronger loads. Default: where no isola was found otherwise some between
        1.5 and 5, at three of the values, until one is found; () for never.
    search
        Periods (2 for 2T, 3 for 3T, ...) of which isolas are looked for at these values among the nonlinear resonances
        of the linear modes as well (`find_subharmonics`). Default: 2 where no isola was found otherwise, at three
        of the values; () for never.
    seeds
        How finely that is done.
    max_curves
        Curves of bifurcations after which no more are followed.

    Returns
    -------
    Isolas
        A sequence of `Isola`, in the order of the values at which they are born; `notes` says what could not be
        settled, `limit_points` and `doublings` are the curves that were followed. Ctrl-C ends it with what was found.

    Notes
    -----
    An isola is met if one of its limit points, followed over the parameter, leads to a branch that bifurcates from the
    response at one of `values`, or if the search meets it. One that does so nowhere within the bounds may be missed:
    widen the bounds, or search for its period.
    """
    catalogue = Catalogue.checked(system, parameter, bounds, omega, harmonics, max_curves, options)
    search_at = checked_values("values", values, catalogue.bounds, least=2)
    if isinstance(search_at, int):
        search_at = np.linspace(*catalogue.bounds, search_at).tolist()
    check_count("depth", depth, 0)
    other_levels, fine = checked_levels(levels), check_seeds(seeds) or COARSE
    orders = None if search is None else checked_orders(search, 2)
    state = Search(catalogue, sorted(set(search_at)))
    with catalogue.reporting(options.get("progress"), f"isolas over {parameter}"):
        from_responses(state, depth)
        from_load_levels(state, other_levels, depth)
        from_resonances(state, orders, fine)
    return _result(state)


def checked_levels(levels: Any) -> tuple[float, ...] | None:
    """Levels of the loads at which responses are followed besides; None where the search chooses."""
    if levels is None:
        return None
    given = listed(levels)
    if not all(is_number(level) and level > 0.0 for level in given):
        raise InputError(f"levels must be positive numbers, those of the loads in units of their own, not {levels!r}")
    if any(level == 1.0 for level in given):
        raise InputError(
            "levels are other ones than 1, that of the loads themselves: responses there are followed anyway"
        )
    return tuple(float(level) for level in given)


def _result(search: Search) -> Isolas:
    """The isolas of a search, and the curves that were followed, with the outcome in one sentence."""
    catalogue, isolas = search.catalogue, search.isolas
    (low, high), (first, last) = catalogue.bounds, catalogue.omega
    limit_points, doublings = ([c for c in catalogue.curves if c.kind == kind] for kind in ("LP", "PD"))
    where = f"for {catalogue.name} from {low:g} to {high:g}, omega from {first:g} to {last:g}"
    begun = f"the responses at {len(search.values)} values of {catalogue.name}"
    followed = f"{len(limit_points)} curves of limit points from {begun}"
    if isolas:
        summary = f"{len(isolas)} isola{'s' * (len(isolas) > 1)} {where}; {followed}."
    else:
        periods = " and ".join(period_name(nu) for nu in sorted({p.nu for p in catalogue.limit_points} | {1}))
        summary = f"No isola of {periods} motions was found {where}: {followed} show none."
    asked = catalogue.system, catalogue.name, catalogue.bounds, (first, last)
    return Isolas(isolas, *asked, limit_points, doublings, catalogue.notes, summary, catalogue.interruption)


#: levels of the loads, and periods of motions, that are tried where nothing else leads to an isola
_LEVELS, _ORDERS = (1.5, 2.2, 3.2, 4.7), (2,)
#: motions of a branch whose mirror images lead to another one, if there is any
_IMAGES = 12
#: name of the parameter that scales all loads
_LEVEL = "load_level"


def from_responses(search: Search, depth: int) -> None:
    """Responses at all values, with what bifurcates from them so many bifurcations deep."""
    catalogue = search.catalogue
    for number, value in enumerate(search.values):
        catalogue.progress(PREPARATION * number / len(search.values), f"{catalogue.name} = {value:.6g}")
        for branch in _responses(catalogue, value, depth):
            search.attach(Loop(value, branch, search.pieces_on(branch, value), False))
    catalogue.progress(PREPARATION, "closed branches")
    search.settle(search.values)


def _responses(catalogue: Catalogue, value: float, depth: int) -> Iterator[Branch]:
    """Branches at a value that a response leads to, their period doublings followed over the parameter."""
    for diagram in catalogue.responses(value, catalogue.omega, Followed(depth)):
        for node in diagram:
            if node.depth < depth:
                _follow_doublings(catalogue, node.branch, value)
            yield node.branch
        for branch in _mirror_images(diagram.branches, catalogue, value):
            if depth > 0:
                _follow_doublings(catalogue, branch, value)
            yield branch


def _follow_doublings(catalogue: Catalogue, branch: Branch, value: float) -> None:
    for item in branch.bifurcations["PD"]:
        catalogue.known(item, value)


def _mirror_images(branches: list[Branch], catalogue: Catalogue, value: float) -> Iterator[Branch]:
    """Branches through motions beside the mirror images of others.

    What would be two halves of a loop between pitchforks, were the system symmetric, is taken apart by a small load
    that is not: the response runs over one half, and the other is reached from its image.
    """
    low, high = catalogue.omega
    known = list(branches)
    for branch in branches:
        for place in np.linspace(0, len(branch) - 1, min(_IMAGES, len(branch))).round().astype(int):
            orbit = branch.orbits[place]
            image = image_of(orbit)
            if not low <= orbit.omega <= high or relation(orbit, image).one:
                continue
            try:
                motion = motion_near(image, catalogue.at(value), orbit.omega)
                if any(lies_on(motion, other.points, images=True) for other in known):
                    continue
                known.append(continue_branch(motion, "omega", catalogue.omega, **catalogue.options))
            except ConvergenceError:
                continue
            pass_on(known[-1].interruption)
            yield known[-1]


def from_load_levels(search: Search, levels: Sequence[float] | None, depth: int) -> None:
    """Responses at other levels of all loads together, in units of their own: most isolas join the main branch there.

    Limit points met there are followed over the level to the loads' own one, where they lie on branches of the system
    itself. Without levels some, as long as no isola is known, and at few values.
    """
    catalogue = search.catalogue
    for level in _LEVELS if levels is None else levels:
        if levels is None and search.isolas:
            break
        for value in search.few if levels is None else search.values:
            catalogue.progress(PREPARATION, f"{level:g} times the loads at {catalogue.name} = {value:.6g}")
            for branch in _under_other_loads(search, value, level, depth):
                search.meet(branch, value)


def _under_other_loads(search: Search, value: float, level: float, depth: int) -> Iterator[Branch]:
    """Branches at a value that a level of the loads leads to and the search has not met, each once.

    Where nothing oscillates but elements there are none.
    """
    catalogue = search.catalogue
    system = catalogue.at(value)
    if not any(c.harmonic for c in system.load_components()):
        return
    bounds = (min(1.0, level), max(1.0, level))
    scaled = system.with_scaled_loads(_LEVEL)
    other = Catalogue(scaled, _LEVEL, bounds, catalogue.omega, catalogue.harmonics, catalogue.options, catalogue.most)
    try:
        for branch in _responses(other, level, depth):
            for item in branch.bifurcations["LP"]:
                other.known(item, level)
    finally:
        for note in other.notes:
            catalogue.note(f"at {catalogue.name} = {value:.6g}, looking at {level:g} times the loads: {note}")
    known = list(search.met.get(value, []))
    for piece in other.limit_points:
        if not piece.contains(1.0):
            continue
        with catalogue.noting(f"at {catalogue.name} = {value:.6g}, a limit point from stronger loads"):
            orbit = _unscaled(piece.solve_at(1.0).orbit, system)
            if any(lies_on(orbit, branch.points, images=True) for branch in known):
                continue
            bounds = (min(catalogue.omega.low, orbit.omega), max(catalogue.omega.high, orbit.omega))
            known.append(continue_branch(orbit, "omega", bounds, **catalogue.options))
            yield known[-1]


def _unscaled(orbit: PeriodicOrbit, system: System) -> PeriodicOrbit:
    """A motion of the system with scaled loads, at their own level, as one of the system itself."""
    values = {name: value for name, value in orbit.values.items() if name != _LEVEL}
    balance = HarmonicBalance(system, orbit.basis, linear=own_linear_part(orbit))
    balance = balance.settle(orbit.coefficients, orbit.omega)
    return PeriodicOrbit(
        balance, orbit.coefficients, orbit.omega, values, orbit.residual, orbit.truncation, orbit.adaptive
    )


def from_resonances(search: Search, orders: Sequence[int] | None, seeds: Seeds) -> None:
    """Motions of some periods near nonlinear resonances of the linear modes (`find_subharmonics`).

    Without periods those of 2T, where no isola is known, at few values.
    """
    if orders is None and search.isolas:
        return
    for value in search.few if orders is None else search.values:
        for order in _ORDERS if orders is None else orders:
            known = [branch for branch in search.met.get(value, []) if branch.nu == order]
            for branch in search.catalogue.resonant(value, order, seeds, known, PREPARATION):
                search.meet(branch, value)
