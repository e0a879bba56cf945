"""`isola_map`: in which region of two design parameters an isola exists.

`find_isolas` says between which values of one design parameter an isola lives. Its two ends, the centre where it is
born and the point where it merges, are extrema of curves of limit points: `track` follows both in a second design
parameter. Between the two curves the isola exists. At some values of the second parameter a closed branch in the middle
of the range is followed, which no curve of extrema knows of: it must close, and the curve of its limit points must end
where the map says.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from suboctave.analysis.options import SearchOptions
from suboctave.analysis.track import track
from suboctave.bifurcation import Bifurcation
from suboctave.curves.points import TrackedPoint
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.interruption import Interruption, pass_on
from suboctave.maps.catalogue import SearchRange, branch_through, carrier_of
from suboctave.maps.inputs import is_count, listed
from suboctave.maps.isolas.region import IsolaMap, IsolaRegion, Probe, spans_of
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.model.inputs import check_bounds, check_parameter
from suboctave.model.timed import timed
from suboctave.progress import reporting
from suboctave.results.tracked_branch import TrackedBranch

__all__ = ["isola_map"]

#: where the map is held against closed branches, in shares of the stretch of the second parameter
_PROBED = (0.1, 0.5, 0.9)
#: so much of the range of the design parameter may the ends differ from those of a closed branch
_AGREES = 1e-3
#: ends at places that differ by less, relatively, are one
_SAME = 1e-5
#: omega may turn a corner where a contact begins, and is interpolated worse
_BESIDE = 1e-3


@timed
def isola_map(
    isolas: Isola | Isolas | Sequence[Isola],
    parameter: str,
    bounds: tuple[float, float],
    *,
    probes: int | Sequence[float] = 3,
    max_step: float | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> IsolaMap:
    """Where in two design parameters an isola exists: its birth and its merging followed in a second parameter.

    Parameters
    ----------
    isolas
        What `find_isolas` gave, or one isola (several of one search).
    parameter, bounds
        The second design parameter and its range, in which the value in the system lies; the order is irrelevant.
    probes
        At how many values of the second parameter each region is held against a closed branch that is followed in the
        middle of it, evenly spread; 0 for none; or these values.
    max_step
        As in `track`.
    seconds
        Time limit, after which the map holds the curves that are complete.

    Returns
    -------
    IsolaMap
        With `contains(j=..., Kc=...)`, `ranges(value)`, `plot`, the `regions` and their curves; `notes` says what could
        not be settled. Ctrl-C ends it with the curves that are complete.

    Raises
    ------
    InputError
        Wrong input, before any work.

    Notes
    -----
    Only isolas that exist at the value that the second parameter has in the system are followed. One that exists only
    elsewhere belongs to another search.
    """
    items = _checked(isolas)
    first = items[0]
    system, name = first.system, first.parameter
    check_parameter(system, parameter)
    if parameter in (name, "omega"):
        raise InputError(f"the second parameter must be another one than {name} and omega, not {parameter!r}")
    low, high = sorted(check_bounds(system, parameter, bounds))
    here = float(system.parameters[parameter])
    if not low <= here <= high:
        raise InputError(
            f"the isola was found at {parameter} = {here:g}, outside the bounds ({low:g}, {high:g}): widen them, or "
            f"search with a system whose {parameter} lies within"
        )
    _check_probes(probes, low, high)
    options = first.options if max_step is None else {**first.options, "max_step": max_step}
    notes: list[str] = []
    interruption: Interruption | None = None
    regions: list[IsolaRegion] = []
    cache: list[tuple[IsolaEnd, TrackedBranch]] = []
    with reporting(progress, f"isolas over {name} and {parameter}") as report:
        try:
            for number, isola in enumerate(items):
                if report is not None:
                    report(number / len(items), f"isola {number + 1} of {len(items)}")
                region = _region(isola, parameter, (low, high), options, cache, notes)
                if region is not None:
                    regions.append(_probed(region, isola, probes, options))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
            notes.append(f"{interruption}: what is here is what had been found by then")
    within = isolas.bounds if isinstance(isolas, Isolas) else None
    return IsolaMap(regions, system, name, parameter, within, (low, high), notes, interruption)


def _checked(isolas: Any) -> list[Isola]:
    items = [isolas] if isinstance(isolas, Isola) else list(isolas) if isinstance(isolas, Iterable) else []
    if not items and isinstance(isolas, Isolas):
        raise InputError("there is no isola to follow: find_isolas found none")
    if not items or not all(isinstance(item, Isola) for item in items):
        raise InputError(f"isola_map takes what find_isolas gave, or an isola of it, not {type(isolas).__name__}")
    if len({(id(item.system), item.parameter) for item in items}) > 1:
        raise InputError("the isolas belong to several searches: give those of one find_isolas")
    return items


def _check_probes(probes: Any, low: float, high: float) -> None:
    if not is_count(probes, 0) and not all(is_number(value) and low <= value <= high for value in listed(probes)):
        raise InputError(f"probes must be how many, or numbers within the bounds ({low:g}, {high:g}), not {probes!r}")


def _region(
    isola: Isola,
    parameter: str,
    bounds: tuple[float, float],
    options: SearchOptions,
    cache: list[tuple[IsolaEnd, TrackedBranch]],
    notes: list[str],
) -> IsolaRegion | None:
    """The region of one isola, None where an end could not be followed at all."""
    here = float(isola.system.parameters[parameter])
    ends: list[MonotonePiece | float] = []
    curves: list[TrackedBranch] = []
    for end, value, reason in zip(isola.ends, isola.range, isola.reasons, strict=True):
        if end is None:
            ends.append(value)
            notes.append(
                f"one end of the isola is no extremum at {parameter} = {here:g} ({reason}): the map keeps "
                f"{isola.parameter} = {value:.7g} there"
            )
            continue
        try:
            curve = _tracked(end, parameter, bounds, options, cache)
        except ConvergenceError as failure:
            notes.append(f"the {end.kind.replace('_', ' ')} could not be followed over {parameter}: {failure}")
            return None
        borders = [b for b in pieces_of(curve, parameter, isola.parameter) if b.contains(here)]
        if not borders:
            notes.append(f"the curve of {end!r} does not pass {parameter} = {here:g}")
            return None
        ends.append(min(borders, key=lambda b: abs(float(b.across(here)) - float(end))))
        if curve not in curves:
            curves.append(curve)
    span = spans_of(here, (ends[0], ends[1]), bounds, parameter)
    for reason, settled in zip(span.reasons, span.settled, strict=True):
        if not settled:
            notes.append(reason)
    return IsolaRegion(isola, parameter, span, tuple(curves))


def _tracked(
    end: IsolaEnd,
    parameter: str,
    bounds: tuple[float, float],
    options: SearchOptions,
    cache: list[tuple[IsolaEnd, TrackedBranch]],
) -> TrackedBranch:
    """The curve of an extremum, once for all isolas that share it."""
    for known, curve in cache:
        if known.orbit is end.orbit:
            return curve
    here, beside = end.parameter(parameter), "omega" if "omega" in end.names else end.names[0]
    for _, curve in cache:
        for name, slack in ((end.parameter_name, _SAME), (beside, _BESIDE)):
            near = slack * abs(end.parameter(name))
            borders = [b for b in pieces_of(curve, parameter, name) if b.contains(here)]
            if not any(abs(float(b.across(here)) - end.parameter(name)) <= near for b in borders):
                break
        else:
            return curve
    curve = track(end, parameter, bounds, **options)
    pass_on(curve.interruption)
    cache.append((end, curve))
    return curve


# ------------------------------------------------------------------------------------------------- independent looks
def _probed(region: IsolaRegion, isola: Isola, probes: Any, options: SearchOptions) -> IsolaRegion:
    """The region with what closed branches at some values of the second parameter say."""
    span = region.span
    if isinstance(probes, int):
        shares = _PROBED if probes == len(_PROBED) else (np.arange(probes) + 0.5) / max(probes, 1)
        places = [span.low + float(share) * (span.high - span.low) for share in shares]
    else:
        places = [float(value) for value in probes if span.contains(float(value))]
    probed = []
    for place in places:
        border = next((e for e in span.ends if isinstance(e, MonotonePiece)), None)
        if border is None:
            break
        probed.append(_probe(region, border, border.node_beside(place), isola, options))
    return IsolaRegion(isola, region.second, span, region.curves, tuple(probed))


def _probe(
    region: IsolaRegion, border: MonotonePiece, node: TrackedPoint, isola: Isola, options: SearchOptions
) -> Probe:
    """Follow the limit points at one value of the second parameter, and the branch in the middle of the range.

    Nothing of the curves of extrema is used but one motion to begin with.
    """
    name, second = isola.parameter, region.second
    place = float(node.orbit.values[second])
    low, high = region.span.range(place)
    middle = 0.5 * (low + high)
    system = isola.system.with_parameters({second: place})
    start = Bifurcation(
        "LP", node.orbit, node.floquet, node.orbit.residual, 0.0, name, context={"system": system, **options}
    )
    width = high - low
    try:
        curve = track(start, name, (low - 0.5 * width, high + 0.5 * width), **options)
        pass_on(curve.interruption)
        pieces = [piece for piece in pieces_of(curve, name) if piece.contains(middle)]
        if not pieces:
            return Probe(place, middle, (low, high), None, "no limit points there")
        nearest = min(pieces, key=lambda piece: abs(float(piece.across(middle)) - node.orbit.omega))
        branch = branch_through(nearest.solve_at(middle), SearchRange(*isola.omega), name, pieces, options)
        pass_on(branch.interruption)
        detached = carrier_of(branch, (), options) is not None
    except (ConvergenceError, InputError) as failure:
        return Probe(place, middle, (low, high), None, str(failure))
    turns = [e.parameter(name) for e in curve.extrema if e.parameter_name == name]
    missed = [
        float(end.across(place))
        for end in region.span.ends
        if isinstance(end, MonotonePiece)
        and not any(abs(t - float(end.across(place))) <= _AGREES * width for t in turns)
    ]
    disagreement = "" if detached else "the branch there is not detached"
    if missed and detached:
        disagreement = f"its curve of limit points does not turn at {name} = {missed[0]:.7g}"
    return Probe(place, middle, (low, high), detached, disagreement)
