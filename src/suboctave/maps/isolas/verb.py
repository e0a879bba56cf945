"""`find_isolas`: closed branches that no sweep leads to, over a design parameter.

1. At several values of the parameter the response is followed, with the branches that bifurcate from it
   (`strategies.from_responses`; where that leads to no isola, responses under other loads and resonances).
2. Every limit point met is followed over the parameter, through its extrema; every period doubling as well.
3. Where the curve of limit points has a definite extremum a closed branch shrinks to a point. Limit points at the
   values of 1. that lie on none of the branches met there lie on others (`search`).
4. A branch through such a limit point is followed. If it closes, the search finds the range in which it does.

None of this depends on the value that the parameter happens to have, nor begins at an extremum of period doublings,
where sub-harmonic motions appear beside their parent (Alcorta et al., Nonlinear Dynamics 98, 2019, section 3.6, begin
there).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from suboctave.analysis.options import SearchOptions
from suboctave.analysis.subharmonics import Seeds
from suboctave.curves.discretisation import Harmonics
from suboctave.curves.junction import period_name
from suboctave.errors import InputError, is_number
from suboctave.maps.catalogue import Catalogue
from suboctave.maps.inputs import COARSE, check_count, check_seeds, checked_orders, checked_values, listed
from suboctave.maps.isolas.result import Isola, Isolas
from suboctave.maps.isolas.search import Search
from suboctave.maps.isolas.strategies import from_load_levels, from_resonances, from_responses
from suboctave.model.system import System
from suboctave.model.timed import timed
from suboctave.options import with_options

__all__ = ["find_isolas"]


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

    Raises
    ------
    InputError
        Wrong input, before any work.

    Notes
    -----
    An isola is met if one of its limit points, followed over the parameter, leads to a branch that bifurcates from the
    response at one of `values`, or if the search meets it. One that does so nowhere within the bounds may be missed:
    widen the bounds, or search for its period.
    """
    catalogue = Catalogue.checked(system, parameter, bounds, omega, harmonics, max_curves, options)
    search_at = checked_values(values, catalogue.bounds)
    check_count("depth", depth, 0)
    other_levels, fine = _checked_levels(levels), check_seeds(seeds) or COARSE
    orders = None if search is None else checked_orders(search, 2)
    state = Search(catalogue, search_at)
    with catalogue.reporting(options.get("progress"), f"isolas over {parameter}"):
        from_responses(state, depth)
        from_load_levels(state, other_levels, depth)
        from_resonances(state, orders, fine)
    return _result(state)


def _checked_levels(levels: Any) -> tuple[float, ...] | None:
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
    catalogue = search.catalogue
    (low, high), (first, last) = catalogue.bounds, catalogue.omega
    isolas = [
        Isola(
            catalogue.system,
            catalogue.name,
            (first, last),
            one.ends,
            (one.low, one.high),
            one.reasons,
            tuple(one.pieces),
            catalogue.options,
            tuple(one.notes),
            {loop.value: loop.branch for loop in one.loops},
        )
        for one in search.isolas
    ]
    curves = {kind: [curve for curve in catalogue.curves if curve.kind == kind] for kind in ("LP", "PD")}
    where = f"for {catalogue.name} from {low:g} to {high:g}, omega from {first:g} to {last:g}"
    begin = f"the responses at {len(search.values)} values of {catalogue.name}"
    followed = f"{len(curves['LP'])} curves of limit points from {begin}"
    if isolas:
        summary = f"{len(isolas)} isola{'s' * (len(isolas) > 1)} {where}; {followed}."
    else:
        periods = " and ".join(period_name(nu) for nu in sorted({p.nu for p in catalogue.limit_points} | {1}))
        summary = f"No isola of {periods} motions was found {where}: {followed} show none."
    return Isolas(
        isolas,
        catalogue.system,
        catalogue.name,
        catalogue.bounds,
        (first, last),
        curves["LP"],
        curves["PD"],
        catalogue.notes,
        summary,
        catalogue.interruption,
    )
