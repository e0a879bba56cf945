"""`isola_map`: in which region of two design parameters an isola exists.

`find_isolas` says between which values of one design parameter an isola lives. Its two ends, the centre where it is
born and the point where it merges, are extrema of curves of limit points: `track` follows both in a second design
parameter. Between the two curves the isola exists. At some values of the second parameter a closed branch in the middle
of the range is followed, which no curve of extrema knows of: it must close, and the curve of its limit points must end
where the map says.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from suboctave.analysis.options import SearchOptions
from suboctave.analysis.track import track
from suboctave.bifurcation import Bifurcation
from suboctave.curves.points import TrackedPoint
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import FAILURES, SearchRange, Work, branch_through, carrier_of
from suboctave.maps.inputs import is_count, listed
from suboctave.maps.isolas.region import IsolaMap, IsolaRegion, Probe, spans_of
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.model.inputs import check_bounds, check_parameter
from suboctave.model.system import System
from suboctave.model.timed import timed
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
    regions = _Regions(system, name, parameter, (low, high), options)
    with regions.reporting(progress, f"isolas over {name} and {parameter}"):
        for number, isola in enumerate(items):
            regions.progress(number / len(items), f"isola {number + 1} of {len(items)}")
            regions.follow(isola, probes)
    within = isolas.bounds if isinstance(isolas, Isolas) else None
    return IsolaMap(regions.regions, system, name, parameter, within, (low, high), regions.notes, regions.interruption)


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


@dataclass(eq=False)
class _Regions(Work):
    """The regions of isolas of one search over a second parameter, and the curves of their ends, each once."""

    system: System
    name: str
    second: str
    bounds: tuple[float, float]
    options: SearchOptions
    regions: list[IsolaRegion] = field(default_factory=list)
    tracked: list[tuple[IsolaEnd, TrackedBranch]] = field(default_factory=list)

    def follow(self, isola: Isola, probes: Any) -> None:
        """Follow the ends of an isola, and hold what they enclose against closed branches."""
        region = self._region(isola)
        if region is not None:
            self.regions.append(replace(region, probes=tuple(self._probes(region, probes))))

    def _region(self, isola: Isola) -> IsolaRegion | None:
        """The region of one isola, None where an end could not be followed at all."""
        name, second = self.name, self.second
        here = float(self.system.parameters[second])
        ends: list[MonotonePiece | float] = []
        curves: list[TrackedBranch] = []
        for end, value, reason in zip(isola.ends, isola.range, isola.reasons, strict=True):
            if end is None:
                ends.append(value)
                self.notes.append(
                    f"one end of the isola is no extremum at {second} = {here:g} ({reason}): the map keeps "
                    f"{name} = {value:.7g} there"
                )
                continue
            try:
                curve = self._curve(end)
            except ConvergenceError as failure:
                self.notes.append(f"the {end.kind.replace('_', ' ')} could not be followed over {second}: {failure}")
                return None
            borders = [b for b in pieces_of(curve, second, name) if b.contains(here)]
            if not borders:
                self.notes.append(f"the curve of {end!r} does not pass {second} = {here:g}")
                return None
            ends.append(min(borders, key=lambda b: abs(float(b.across(here)) - float(end))))
            if curve not in curves:
                curves.append(curve)
        span = spans_of(here, (ends[0], ends[1]), self.bounds, second)
        self.notes += [reason for reason, settled in zip(span.reasons, span.settled, strict=True) if not settled]
        return IsolaRegion(isola, second, span, tuple(curves))

    def _curve(self, end: IsolaEnd) -> TrackedBranch:
        """The curve of an extremum, once for all isolas that share it."""
        for known, curve in self.tracked:
            if known.orbit is end.orbit or self._passes(curve, end):
                return curve
        curve = track(end, self.second, self.bounds, **self.options)
        pass_on(curve.interruption)
        self.tracked.append((end, curve))
        return curve

    def _passes(self, curve: TrackedBranch, end: IsolaEnd) -> bool:
        """Whether a curve of extrema passes another one."""
        here, beside = end.parameter(self.second), "omega" if "omega" in end.names else end.names[0]
        for name, slack in ((end.parameter_name, _SAME), (beside, _BESIDE)):
            value = end.parameter(name)
            borders = [b for b in pieces_of(curve, self.second, name) if b.contains(here)]
            if not any(abs(float(b.across(here)) - value) <= slack * abs(value) for b in borders):
                return False
        return True

    # --------------------------------------------------------------------------------------------- independent looks
    def _probes(self, region: IsolaRegion, probes: Any) -> Iterator[Probe]:
        """What closed branches at some values of the second parameter say."""
        span = region.span
        if isinstance(probes, int):
            shares = _PROBED if probes == len(_PROBED) else (np.arange(probes) + 0.5) / max(probes, 1)
            places = [span.low + float(share) * (span.high - span.low) for share in shares]
        else:
            places = [float(value) for value in probes if span.contains(float(value))]
        border = next((e for e in span.ends if isinstance(e, MonotonePiece)), None)
        if border is not None:
            yield from (self._probe(region, border.node_beside(place)) for place in places)

    def _probe(self, region: IsolaRegion, node: TrackedPoint) -> Probe:
        """Follow the limit points at one value of the second parameter, and the branch in the middle of the range.

        Nothing of the curves of extrema is used but one motion to begin with.
        """
        name, options, orbit = self.name, self.options, node.orbit
        place = float(orbit.values[self.second])
        low, high = region.span.range(place)
        middle, width = 0.5 * (low + high), high - low
        context = {"system": self.system.with_parameters({self.second: place}), **options}
        start = Bifurcation("LP", orbit, node.floquet, orbit.residual, 0.0, name, context=context)
        try:
            curve = track(start, name, (low - 0.5 * width, high + 0.5 * width), **options)
            pass_on(curve.interruption)
            pieces = [piece for piece in pieces_of(curve, name) if piece.contains(middle)]
            if not pieces:
                return Probe(place, middle, (low, high), None, "no limit points there")
            nearest = min(pieces, key=lambda piece: abs(float(piece.across(middle)) - orbit.omega))
            branch = branch_through(nearest.solve_at(middle), SearchRange(*region.isola.omega), name, pieces, options)
            pass_on(branch.interruption)
            detached = carrier_of(branch, (), options) is not None
        except FAILURES as failure:
            return Probe(place, middle, (low, high), None, str(failure))
        turns = [e.parameter(name) for e in curve.extrema if e.parameter_name == name]
        ends = [float(end.across(place)) for end in region.span.ends if isinstance(end, MonotonePiece)]
        missed = [end for end in ends if not any(abs(turn - end) <= _AGREES * width for turn in turns)]
        disagreement = "" if detached else "the branch there is not detached"
        if missed and detached:
            disagreement = f"its curve of limit points does not turn at {name} = {missed[0]:.7g}"
        return Probe(place, middle, (low, high), detached, disagreement)
