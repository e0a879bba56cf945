"""`find_isolas`: closed branches that no sweep leads to, over a design parameter.

1. At several values of the parameter the response is followed, with the branches that bifurcate from it.
2. Every limit point met is followed over the parameter, through its extrema; every period doubling as well.
3. Where the curve of limit points has a definite extremum a closed branch shrinks to a point. Limit points at the
   values of 1. that lie on none of the branches met there lie on others.
4. A branch through such a limit point is followed. If it closes, `isola_life` finds the range in which it does.

None of this depends on the value that the parameter happens to have, nor begins at an extremum of period doublings,
where sub-harmonic motions appear beside their parent (Alcorta et al., Nonlinear Dynamics 98, 2019, section 3.6, begin
there).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.checks import (
    check_bounds,
    check_parameter,
    check_range,
    check_system,
    is_number,
    make_settings,
)
from suboctave.analysis.isola import Isola
from suboctave.analysis.isola_life import Life, extend
from suboctave.analysis.isola_survey import Loop, Survey
from suboctave.analysis.isolas_found import Isolas
from suboctave.analysis.junction import period_name
from suboctave.analysis.limit_curves import Leg
from suboctave.analysis.load_levels import branches_by_load
from suboctave.analysis.making import Harmonics, rule_of
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.subharmonics import Seeds, isolated_branches
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.interruption import Interruption, pass_on
from suboctave.model.system import System
from suboctave.stability import StabilityMethod

__all__ = ["MOST_VALUES", "find_isolas"]

#: values of a parameter at which whole responses are followed
MOST_VALUES = 10_000

#: share of the work that the responses make, for progress
_SHARE = 0.6
#: a search among resonances: coarse, since the closed branch itself is followed afterwards
_SEEDS = Seeds(8, 4, 3)
#: levels of the loads that are looked at, and periods that are searched, where nothing else leads to an isola
_LEVELS, _SEARCHED = (1.5, 2.2, 3.2, 4.7), (2,)


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
    seconds: float | None = None,
    max_step: float | None = None,
    observe: int | None = None,
    progress: Any = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
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
    seconds
        Time limit, after which what has been found is given.
    max_step
        As in `frequency_response` and `track`.

    Other parameters as `frequency_response`.

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
    check_parameter(system, parameter)
    if parameter == "omega":
        raise InputError("parameter is the design parameter; omega varies anyway, in the range omega=(from, to)")
    low, high = sorted(check_bounds(system, parameter, bounds))
    first, last = sorted(check_range("omega", omega, positive=True))
    check_system(system, (first, last))
    rule_of(harmonics)
    make_settings(system, max_step, observe, (), newton, stepping, stability, None)
    places = _checked_values(values, low, high)
    strengths, orders = _checked_levels(levels), _checked_search(search)
    for name, number, least in (("depth", depth, 0), ("max_curves", max_curves, 1)):
        if isinstance(number, bool) or not isinstance(number, int) or number < least:
            raise InputError(f"{name} must be a whole number of at least {least}, not {number!r}")
    if seeds is not None and not isinstance(seeds, Seeds):
        raise InputError(f"seeds must be a Seeds, not {type(seeds).__name__}")
    options = {
        "max_step": max_step,
        "observe": observe,
        "newton": newton,
        "stepping": stepping,
        "stability": stability,
    }
    with reporting(progress, f"isolas over {parameter}") as report:
        survey = Survey(
            system, parameter, (low, high), (first, last), harmonics, depth, options, max_curves, report=report
        )
        lives: list[Life] = []
        interruption: Interruption | None = None
        few = sorted({places[0], places[len(places) // 2], places[-1]})
        try:
            for number, value in enumerate(places):
                survey.say(_SHARE * number / len(places), f"{parameter} = {value:.6g}")
                survey.look(value)
            survey.say(_SHARE, "closed branches")
            _live(survey, lives, places)
            for level in _LEVELS if strengths is None else strengths:
                if strengths is None and lives:
                    break
                for value in places if strengths else few:
                    _by_loads(survey, lives, value, level)
            if orders or (orders is None and not lives):
                for value in places if orders else few:
                    for order in orders or _SEARCHED:
                        _by_resonance(survey, lives, value, order, seeds or _SEEDS)
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
            survey.note(f"{interruption}: what is here is what had been found by then")
    found = [
        Isola(
            system,
            parameter,
            (first, last),
            life.ends,
            (life.low, life.high),
            life.reasons,
            life.legs,
            options,
            life.notes,
            [(loop.value, loop.branch) for loop in life.loops],
        )
        for life in lives
    ]
    said = _said(found, survey, places)
    return Isolas(
        found,
        system,
        parameter,
        (low, high),
        (first, last),
        survey.curves,
        survey.doublings,
        survey.notes,
        said,
        interruption,
    )


def _checked_values(values: Any, low: float, high: float) -> list[float]:
    if isinstance(values, int) and not isinstance(values, bool):
        if not 2 <= values <= MOST_VALUES:
            raise InputError(
                f"values must be at least 2 and at most {MOST_VALUES}, or the values of the parameter themselves, not "
                f"{shortened(values)}"
            )
        return [float(v) for v in np.linspace(low, high, values)]
    given = list(values) if isinstance(values, Sequence | np.ndarray) and not isinstance(values, str) else []
    if not given or not all(is_number(v) and low <= v <= high for v in given):
        raise InputError(f"values must be how many, or numbers within the bounds ({low:g}, {high:g}), not {values!r}")
    return sorted({float(v) for v in given})


def _checked_levels(levels: Any) -> tuple[float, ...] | None:
    if levels is None:
        return None
    given = tuple(levels) if isinstance(levels, Sequence | np.ndarray) and not isinstance(levels, str) else (None,)
    if not all(is_number(level) and level > 0.0 for level in given):
        raise InputError(f"levels must be positive numbers, those of the loads in units of their own, not {levels!r}")
    if any(level == 1.0 for level in given):
        raise InputError(
            "levels are other ones than 1, that of the loads themselves: responses there are followed anyway"
        )
    return tuple(float(level) for level in given)


def _checked_search(search: Any) -> tuple[int, ...] | None:
    if search is None:
        return None
    given = tuple(search) if isinstance(search, Sequence) and not isinstance(search, str) else (None,)
    if not all(isinstance(order, int) and not isinstance(order, bool) and order >= 2 for order in given):
        raise InputError(f"search must be periods of at least 2 periods of the load, as (2, 3), not {search!r}")
    return given


def _said(found: Sequence[Isola], survey: Survey, places: Sequence[float]) -> str:
    """The result in one sentence."""
    (low, high), (first, last) = survey.bounds, survey.omega
    where = f"for {survey.name} from {low:g} to {high:g}, omega from {first:g} to {last:g}"
    looked = f"{len(survey.curves)} curves of limit points from the responses at {len(places)} values of {survey.name}"
    if found:
        return f"{len(found)} isola{'s' * (len(found) > 1)} {where}; {looked}."
    periods = " and ".join(period_name(nu) for nu in sorted({leg.nu for leg in survey.legs} | {1}))
    return f"No isola of {periods} motions was found {where}: {looked} show none."


# -------------------------------------------------------------------------------------------------------------- isolas
def _live(survey: Survey, lives: list[Life], places: Sequence[float]) -> None:
    """The isolas that limit points known lie on."""
    for leg, value in _starts(survey, lives, places):
        loop = survey.loop(leg, value)
        if loop is not None:
            _consider(survey, lives, loop)


def _consider(survey: Survey, lives: list[Life], loop: Loop) -> None:
    """A branch that is detached lives over some range, unless it is known; any other is known from now on."""
    if any(life.covers(leg, loop.value) for life in lives for leg in loop.legs):
        return
    if loop.detached and loop.legs:
        survey.say(_SHARE, f"closed branch at {survey.name} = {loop.value:.6g}")
        life = Life.of(loop)
        lives.append(life)
        extend(life, survey, lives[:-1])
    else:
        survey.attach(loop)


def _starts(survey: Survey, lives: list[Life], places: Sequence[float]) -> Iterator[tuple[Leg, float]]:
    """Limit points that may lie on an isola: beside centres, then those that no branch met explains.

    Curves that are found on the way are looked at as well.
    """
    done: set[int] = set()
    while True:
        centre = next((c for c in _centres(survey) if id(c[1]) not in done), None)
        if centre is None:
            break
        leg, event, upper = centre
        done.add(id(event))
        if any(life.ends_at(event) for life in lives):
            continue
        value = event.parameter(survey.name)
        bound = survey.bounds[0] if upper else survey.bounds[1]
        beyond, _ = next(survey.critical(leg.nu, value, not upper), (bound, []))
        yield leg, 0.5 * (value + beyond)
    for value in places:
        for leg in list(survey.legs):
            unexplained = leg.contains(value) and not survey.explained(leg, value)
            if unexplained and not any(life.covers(leg, value) for life in lives):
                yield leg, value


def _centres(survey: Survey) -> Iterator[tuple[Leg, TrackedEvent, bool]]:
    """Ends of legs at which a closed branch may shrink to a point, and whether it lives below.

    Where a contact grazes, the quadratic form says nothing.
    """
    for leg in survey.legs:
        for upper in (False, True):
            event = leg.end(upper)
            if event is not None and event.kind == "extremum" and event.isola != "isola_merging":
                yield leg, event, upper


def _by_loads(survey: Survey, lives: list[Life], value: float, level: float) -> None:
    """Isolas at a value that responses at another level of the loads lead to."""
    survey.say(_SHARE, f"{level:g} times the loads at {survey.name} = {value:.6g}")
    for branch in branches_by_load(survey, value, level):
        _met(survey, lives, branch, value)


def _by_resonance(survey: Survey, lives: list[Life], value: float, order: int, seeds: Seeds) -> None:
    """Isolas at a value that a search among resonances meets."""
    where = f"searching {period_name(order)} motions at {survey.name} = {value:.6g}"
    survey.say(_SHARE, where)
    system = survey.system.with_parameters({survey.name: value})
    known = [branch for branch in survey.met.get(value, []) if branch.nu == order]
    try:
        found = isolated_branches(system, survey.omega, order, known, survey.harmonics, seeds=seeds, **survey.options)
    except ConvergenceError as failure:
        survey.note(f"{where}: {failure}")
        return
    for branch in found:
        _met(survey, lives, branch, value)


def _met(survey: Survey, lives: list[Life], branch: Branch, value: float) -> None:
    """A branch that a search has met: an isola unless it is attached, or one that is known."""
    pass_on(branch.interruption)
    loop = survey.loop_of(branch, value)
    _consider(survey, lives, loop)
    _live(survey, lives, ())
