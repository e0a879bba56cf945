"""`find_isolas`: closed branches that no sweep leads to, over a design parameter.

1. At several values of the parameter the response is followed, with the branches that bifurcate from it
   (`_from_responses`); motions of the periods asked for are looked for among the resonances (`_from_resonances`). Where
   that leads to no isola, responses under other loads and further resonances (`_from_load_levels`).
2. Every limit point met is followed over the parameter, through its extrema; every period doubling as well.
3. Where the curve of limit points has a definite extremum a closed branch shrinks to a point. Limit points at the
   values of 1. that lie on none of the branches met there lie on others.
4. A branch through such a limit point is followed. If it closes, the search finds the range in which it does
   (`maps.isolas.search`).

None of this depends on the value that the parameter happens to have, nor begins at an extremum of period doublings,
where sub-harmonic motions appear beside their parent (Alcorta et al., Nonlinear Dynamics 98, 2019, section 3.6, begin
there).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.analysis.options import DesignOptions
from suboctave.analysis.subharmonics import Seeds
from suboctave.arguments import Range
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import period_name
from suboctave.curves.starts import Harmonics
from suboctave.errors import InputError, is_number, refuse_idle
from suboctave.maps.catalogue import UNASKED, Catalogue, checked_orders, checked_values, listed
from suboctave.maps.isolas.responses import FROM_LOADS, Responses, UnderOtherLoads, followed_doublings
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.isolas.search import Loop, Search, Stage
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.workers import check_workers


@with_options(DesignOptions)
@timed
def find_isolas(
    system: System,
    omega: Range,
    parameter: str,
    bounds: Range,
    *,
    harmonics: Harmonics = "adaptive",
    values: int | Sequence[float] = 5,
    depth: int = 1,
    levels: Sequence[float] | None = None,
    search: Sequence[int] | None = None,
    seeds: Seeds | None = None,
    max_curves: int = 64,
    **options: Unpack[DesignOptions],
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
        Periods (2 for 2T, 3 for 3T, ...) of which isolas are looked for at these values, and halfway between them,
        among the nonlinear resonances of the linear modes as well (`find_subharmonics`). Default: 2 where no isola was
        found otherwise, at three of the values; () for never.
    seeds
        How finely that is done; default as of `find_subharmonics`.
    max_curves
        Curves of bifurcations after which no more are followed.

    Responses at the values, and at other levels of the loads, are divided among `workers`; curves over the parameter
    and closed branches, which start from each other, are followed in this process.

    Returns
    -------
    Isolas
        A sequence of `Isola`, in the order of the values at which they are born; `notes` says what could not be
        settled, `limit_points` and `doublings` are the curves that were followed. Ctrl-C ends it with what was found.

    Notes
    -----
    An isola is met if one of its limit points, followed over the parameter, leads to a branch that bifurcates from the
    response at one of `values`, or if the search meets it. One that does so nowhere within the bounds may be missed:
    widen the bounds, or search for its period; one that exists only between the values at which it is searched asks for
    more `values`.
    """
    catalogue = Catalogue.checked(system, parameter, bounds, omega, harmonics, max_curves, options)
    search_at = checked_values("values", values, catalogue.bounds, least=2)
    if isinstance(search_at, int):
        search_at = np.linspace(*catalogue.bounds, search_at).tolist()
    check_count("depth", depth, 0)
    processes = check_workers(options.get("workers"))
    other_levels, fine = checked_levels(levels), seeds
    orders = None if search is None else checked_orders(search, 2)
    if orders == ():
        refuse_idle("search=() looks for no periods; leave seeds out", seeds=seeds is not None)
    state = Search(catalogue, sorted(set(search_at)), orders or ())
    with catalogue.reporting(options.get("progress"), f"isolas over {parameter}"):
        responses, branches, loads, periods = _planned(state, other_levels, orders)
        _from_responses(state, depth, processes, responses, branches)
        _from_load_levels(state, other_levels, depth, processes, loads)
        _from_resonances(state, orders is not None, fine, periods)
    return state.result()


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


#: levels of the loads that are tried where nothing else leads to an isola
_LEVELS = (1.5, 2.2, 3.2, 4.7)


def _planned(
    search: Search, levels: Sequence[float] | None, orders: Sequence[int] | None
) -> tuple[Stage, Stage, Stage, dict[int, Stage]]:
    """What the search looks at, in order: responses, branches that they leave open, other loads, periods."""
    name, count = search.catalogue.name, len(search.values)

    def stage(words: str, planned: int, leads: bool = True, spare: bool = False) -> Stage:
        search.stages.append(Stage(words, planned, leads=leads, spare=spare))
        return search.stages[-1]

    responses = stage(f"the responses at {{}} values of {name}", count)
    branches = stage(f"the other branches that their limit points lie on at {{}} values of {name}", count, leads=False)
    count = len(_LEVELS if levels is None else levels)
    others = stage("those at {} other levels of the loads", count, spare=levels is None)
    words = "a search for {} motions at {{}} values of " + name
    count = len(search.few if orders is None else search.closer)
    periods = {
        order: stage(words.format(period_name(order)), count, spare=orders is None)
        for order in (UNASKED if orders is None else orders)
    }
    return responses, branches, others, periods


def _from_responses(search: Search, depth: int, workers: int, responses: Stage, branches: Stage) -> None:
    """Responses at all values, with what bifurcates from them so many bifurcations deep."""
    catalogue, count = search.catalogue, len(search.values)
    search.at(f"{catalogue.name} = {search.values[0]:.6g}")
    found = Responses(catalogue.emptied(), depth).over(list(search.values), workers, catalogue)
    for number, (value, met) in enumerate(zip(search.values, found, strict=True), 1):
        for part, branch in enumerate(followed_doublings(catalogue, value, met), 1):
            search.attach(Loop(value, branch, search.pieces_on(branch, value), False))
            search.at(f"{catalogue.name} = {value:.6g}", part / (len(met) + 1))
        responses.done = number
        if number < count:
            search.at(f"{catalogue.name} = {search.values[number]:.6g}")
    search.at("closed branches")
    search.settle(search.values, branches)


def _from_load_levels(search: Search, levels: Sequence[float] | None, depth: int, workers: int, stage: Stage) -> None:
    """Responses at other levels of all loads together, in units of their own: most isolas join the main branch there.

    Limit points met there are followed over the level to the loads' own one, where they lie on branches of the system
    itself. Without levels some, as long as no isola is known, and at few values.
    """
    catalogue = search.catalogue
    for level in _LEVELS if levels is None else levels:
        if levels is None and search.isolas:
            return
        values = search.few if levels is None else list(search.values)
        found = UnderOtherLoads(catalogue.emptied(), depth, level).over(values, workers, catalogue)
        for value, orbits in zip(values, found, strict=True):
            search.at(f"{level:g} times the loads at {catalogue.name} = {value:.6g}")
            known = list(search.met.get(value, []))
            for orbit in orbits:
                if any(lies_on(orbit, branch.points, images=True) for branch in known):
                    continue
                with catalogue.noting(catalogue.open(FROM_LOADS, value, kind="LP")):
                    bounds = (min(catalogue.omega.low, orbit.omega), max(catalogue.omega.high, orbit.omega))
                    known.append(continue_branch(orbit, "omega", bounds, **catalogue.options))
                    search.meet(known[-1], value)
        stage.done += 1


def _from_resonances(search: Search, chosen: bool, seeds: Seeds | None, stages: Mapping[int, Stage]) -> None:
    """Motions of some periods near nonlinear resonances of the linear modes (`find_subharmonics`).

    Periods that nobody has `chosen` are looked for where no isola is known, at few values.
    """
    fine = seeds or Seeds()
    for value in search.closer if chosen else search.few:
        for order, stage in stages.items():
            if not chosen and search.isolas:
                return
            known = [branch for branch in search.met.get(value, []) if branch.nu == order]
            search.at(f"{period_name(order)} motions at {search.catalogue.name} = {value:.6g}")
            for branch in search.catalogue.resonant(value, order, fine, known):
                search.meet(branch, value)
            stage.done += 1
