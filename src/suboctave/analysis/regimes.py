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

from itertools import pairwise
from typing import Any

from suboctave.analysis.checks import (
    check_bounds,
    check_parameter,
    check_range,
    check_system,
    is_number,
    make_settings,
)
from suboctave.analysis.isola import Isolas
from suboctave.analysis.making import Harmonics, rule_of
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.regime_atlas import Atlas
from suboctave.analysis.regime_map import RegimeMap, Strip
from suboctave.analysis.regime_slices import Slice, looked
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError
from suboctave.model.system import System
from suboctave.stability import StabilityMethod

__all__ = ["regime_map"]

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
    values: int = 3,
    resolution: float = 1e-4,
    isolas: Isolas | None = None,
    max_curves: int = 64,
    max_slices: int = 64,
    max_step: float | None = None,
    observe: int | None = None,
    progress: Any = None,
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
    max_curves, max_slices
        Curves, and values of the parameter, after which no more are followed.

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
    if not is_number(resolution) or not 0.0 < resolution < 0.5:
        raise InputError(f"resolution must be a share of the range between 0 and 0.5, not {resolution!r}")
    if isolas is not None and (not isinstance(isolas, Isolas) or isolas.parameter != parameter):
        raise InputError(f"isolas must be what find_isolas gave over {parameter}, not {isolas!r}")
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
            _fill(atlas, slices, depth, values, resolution, max_slices)
        except KeyboardInterrupt:
            atlas.note("interrupted: the map holds what had been found by then")
    return RegimeMap(atlas, _strips(atlas, slices), depth, resolution)


def _fill(atlas: Atlas, slices: list[Slice], depth: int, count: int, resolution: float, most: int) -> None:
    """Look at values until every strip has one, and nothing known is unexplained at any of them."""
    low, high = atlas.bounds
    waiting = [low + (i + 0.5) / count * (high - low) for i in range(count)]
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
    return found


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
