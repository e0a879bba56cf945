"""`regime_map`: which motions are stable over the plane of omega and a design parameter, from curves of bifurcations.

1. At some values of the parameter all branches are followed, the response, what bifurcates from it, isolas; every
   bifurcation that borders stable motions is followed over the parameter, and so is every limit point.
2. Between two neighbouring critical values (where curves turn, end, or meet a second condition) the stable arcs of
   branches have the same order at every value. So one value within each such strip is looked at.
3. A stable arc is known there by the two borders that end it. At other values of the strip it reaches from one border
   to the other.

Steps 1 and 2 are repeated until no new curve is met. What is counted are motions on branches that something leads to;
quasi-periodic and chaotic ones, and branches that nothing leads to, are not known: `RegimeMap.check` looks for them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from suboctave.analysis.branch import Branch
from suboctave.analysis.checks import (
    check_bounds,
    check_parameter,
    check_range,
    check_system,
    is_number,
    make_settings,
)
from suboctave.analysis.identity import lies_on
from suboctave.analysis.isolas import MOST_VALUES
from suboctave.analysis.isolas_found import Isolas
from suboctave.analysis.junction import period_name
from suboctave.analysis.making import Harmonics, rule_of
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.regime_atlas import Atlas
from suboctave.analysis.regime_map import RegimeMap, Strip
from suboctave.analysis.regime_slices import Slice, beyond, introduce, looked
from suboctave.analysis.subharmonics import Seeds, isolated_branches
from suboctave.analysis.verbs import continue_branch
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption, pass_on, unlimited
from suboctave.model.system import System
from suboctave.stability import StabilityMethod

__all__ = ["regime_map"]

#: a search among resonances: coarse, since the branch itself is followed afterwards
_SEEDS = Seeds(8, 4, 3)
#: a multiplier this close to -1 asks for a look at values beside it, as far as this share of the range apart
_NEARLY, _FINE = 0.6, 1.0 / 32.0
#: a value within a strip keeps this share of its width away from the ends
_INSIDE = 0.02


@timed
def regime_map(
    system: System,
    omega: tuple[float, float],
    parameter: str,
    bounds: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    depth: int = 2,
    values: int = 5,
    resolution: float = 1e-4,
    isolas: Isolas | None = None,
    search: Sequence[int] = (),
    seeds: Seeds | None = None,
    motions: Sequence[PeriodicOrbit] = (),
    max_curves: int = 64,
    max_slices: int = 64,
    max_step: float | None = None,
    observe: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
) -> RegimeMap:
    """Which stable motions exist, by their periods, over the plane of omega and a design parameter.

    Parameters
    ----------
    system, omega, parameter, bounds, harmonics
        As in `find_isolas`.
    depth
        How many period doublings deep branches are followed: 0 for T, 1 for 2T as well, 2 for 4T, ...
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
        the linear modes (`find_subharmonics`), and how finely.
    motions
        Motions that are known from elsewhere, as from `RegimeCheck.unknown`: the branches that they lie on are mapped.
    max_curves, max_slices
        Curves, and values of the parameter, after which no more are followed.
    seconds
        Time limit, after which the map holds what is known by then.

    Other parameters as `frequency_response`.

    Returns
    -------
    RegimeMap
        With `label(omega, value)`, `regions`, `plot`, `check`; `notes` says what could not be settled. Ctrl-C ends it
        with what is known by then.

    Raises
    ------
    InputError
        Wrong input, before any work.
    """
    check_parameter(system, parameter)
    if parameter == "omega":
        raise InputError("the design parameter is one of the system's: omega is the other axis of the map")
    low, high = sorted(check_bounds(system, parameter, bounds))
    first, last = sorted(check_range("omega", omega, positive=True))
    check_system(system, (first, last))
    rule_of(harmonics)
    make_settings(system, max_step, observe, (), newton, stepping, stability, None)
    wanted = (("depth", depth, 0), ("values", values, 1), ("max_curves", max_curves, 1), ("max_slices", max_slices, 1))
    for name, number, least in wanted:
        if isinstance(number, bool) or not isinstance(number, int) or number < least:
            raise InputError(f"{name} must be a whole number of at least {least}, not {number!r}")
        if name == "values" and number > MOST_VALUES:
            raise InputError(f"values={shortened(number)}: whole responses are followed at each, at most {MOST_VALUES}")
    if not is_number(resolution) or not 0.0 < resolution < 0.5:
        raise InputError(f"resolution must be a share of the range between 0 and 0.5, not {resolution!r}")
    if isolas is not None and (not isinstance(isolas, Isolas) or isolas.parameter != parameter):
        raise InputError(f"isolas must be what find_isolas gave over {parameter}, not {isolas!r}")
    orders = _checked_search(search, seeds)
    given = _checked_motions(motions, system, parameter, (low, high), (first, last))
    options = {
        "max_step": max_step,
        "observe": observe,
        "newton": newton,
        "stepping": stepping,
        "stability": stability,
    }
    with reporting(progress, f"regimes over omega and {parameter}") as report:
        atlas = Atlas(system, parameter, (low, high), (first, last), harmonics, options, max_curves, report=report)
        slices: list[Slice] = []
        try:
            if isolas is not None:
                for curve in (*isolas.limit_points, *isolas.doublings):
                    atlas.add(curve)
            _introduced(atlas, orders, seeds or _SEEDS, given, values)
            _fill(atlas, slices, depth, values, resolution, max_slices)
        except KeyboardInterrupt as cause:
            atlas.interruption = Interruption.of(cause)
            atlas.note(f"{atlas.interruption}: the map holds what had been found by then")
    with unlimited():
        return RegimeMap(atlas, _strips(atlas, slices), depth, resolution)


def _checked_search(search: Any, seeds: Any) -> tuple[int, ...]:
    given = tuple(search) if isinstance(search, Sequence) and not isinstance(search, str) else (None,)
    if not all(isinstance(order, int) and not isinstance(order, bool) and order >= 1 for order in given):
        raise InputError(f"search must be periods in periods of the load, as (3, 5), not {search!r}")
    if seeds is not None and not isinstance(seeds, Seeds):
        raise InputError(f"seeds must be a Seeds, not {type(seeds).__name__}")
    return given


def _checked_motions(
    motions: Any, system: System, name: str, bounds: tuple[float, float], omega: tuple[float, float]
) -> list[PeriodicOrbit]:
    given = list(motions) if isinstance(motions, Sequence) else [motions]
    for orbit in given:
        if not isinstance(orbit, PeriodicOrbit):
            raise InputError(f"motions must be PeriodicOrbit objects, not {type(orbit).__name__}")
        if set(orbit.values) != set(system.parameters):
            raise InputError(f"the motion {orbit!r} is one of another system")
        inside = bounds[0] <= orbit.values[name] <= bounds[1] and omega[0] <= orbit.omega <= omega[1]
        if not inside:
            raise InputError(f"the motion {orbit!r} does not lie in the plane of the map")
        others = [n for n, v in system.parameters.items() if n != name and orbit.values[n] != v]
        if others:
            raise InputError(f"the motion {orbit!r} has another {others[0]} than the system")
    return given


def _introduced(
    atlas: Atlas, orders: Sequence[int], seeds: Seeds, motions: Sequence[PeriodicOrbit], count: int
) -> None:
    """Branches that no bifurcation leads to: through motions given, and those that a search meets."""
    low, high = atlas.bounds
    known: list[tuple[float, Branch]] = []
    for orbit in motions:
        value = orbit.values[atlas.name]
        if any(v == value and lies_on(orbit, b.points) for v, b in known):
            continue
        atlas.say(0.0, f"{period_name(orbit.basis.nu)} at {atlas.name} = {value:.6g}")
        try:
            branch = continue_branch(orbit, "omega", (0.5 * atlas.omega[0], 2.0 * atlas.omega[1]), **atlas.options)
        except ConvergenceError as failure:
            atlas.note(f"the branch through {orbit!r} could not be followed: {failure}")
            continue
        pass_on(branch.interruption)
        known.append((value, branch))
        introduce(branch, value, atlas)
    for value in (low + (i + 0.5) / count * (high - low) for i in range(count)):
        system = atlas.system.with_parameters({atlas.name: value})
        for order in orders:
            atlas.say(0.0, f"searching {period_name(order)} motions at {atlas.name} = {value:.6g}")
            try:
                found = isolated_branches(system, atlas.omega, order, [], atlas.harmonics, seeds=seeds, **atlas.options)
            except ConvergenceError as failure:
                atlas.note(f"searching {period_name(order)} motions at {atlas.name} = {value:.6g}: {failure}")
                continue
            for branch in found:
                introduce(branch, value, atlas)


def _fill(atlas: Atlas, slices: list[Slice], depth: int, count: int, resolution: float, most: int) -> None:
    """Look at values until every strip has one, and nothing known is unexplained at any of them."""
    low, high = atlas.bounds
    waiting = [low + (i + 0.5) / count * (high - low) for i in range(count)]
    for value in dict.fromkeys((waiting[0], waiting[-1])):
        beyond(value, atlas)
    while waiting:
        value = waiting.pop(0)
        if len(slices) >= most:
            atlas.note(f"max_slices={most} values of {atlas.name} were looked at: narrow strips were not")
            break
        atlas.say(len(slices) / (len(slices) + len(waiting) + 4.0), f"{atlas.name} = {value:.6g}")
        slices.append(looked(value, atlas, depth))
        if waiting:
            continue
        # limit points that have become known later may lie on branches that were not met before
        curves = -1
        while curves != len(atlas.curves):
            curves = len(atlas.curves)
            for known in slices:
                looked(known.value, atlas, depth, known)
        waiting = _unseen(atlas, slices, resolution)


def _unseen(atlas: Atlas, slices: list[Slice], resolution: float) -> list[float]:
    """The middles of strips that no value looked at lies in."""
    marks = atlas.critical()
    found = []
    for a, b in pairwise(marks):
        if b - a >= resolution * atlas.span and not any(_inside(s.value, a, b) for s in slices):
            found.append(0.5 * (a + b))
    return found or _doubtful(marks, slices, atlas)


def _doubtful(marks: list[float], slices: list[Slice], atlas: Atlas) -> list[float]:
    """Values beside those at which a motion nearly doubles its period: a pair of doublings may begin between them.

    It would lie on no branch that was met, so that no curve tells.
    """
    found = []
    for a, b in pairwise(marks):
        within = sorted((s for s in slices if a <= s.value <= b), key=lambda s: s.value)
        places = [a, *(s.value for s in within), b]
        for i, near in enumerate(within, 1):
            gap = min((arc.nearly_doubled for arc in near.arcs if arc.followed), default=math.inf)
            if gap < _NEARLY:
                sides = ((places[i - 1] + places[i]) / 2.0, (places[i] + places[i + 1]) / 2.0)
                found += [v for v in sides if abs(v - near.value) > 0.5 * _FINE * atlas.span]
    return sorted(set(found))


def _inside(value: float, low: float, high: float) -> bool:
    margin = _INSIDE * (high - low)
    return low + margin <= value <= high - margin


def _strips(atlas: Atlas, slices: list[Slice]) -> list[Strip]:
    """The strips with what was seen in them; those that nobody looked at take over from their neighbours."""
    marks = atlas.critical()
    strips = []
    for a, b in pairwise(marks):
        within = [s for s in slices if _inside(s.value, a, b)]
        middle = 0.5 * (a + b)
        nearest = min(within or slices, key=lambda s: abs(s.value - middle), default=None)
        strips.append(Strip(a, b, nearest, bool(within)))
    return strips
