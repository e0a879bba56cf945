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
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.analysis.options import SearchOptions
from suboctave.analysis.subharmonics import Seeds
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.curves.discretisation import Harmonics
from suboctave.curves.identity import lies_on
from suboctave.curves.junction import period_name
from suboctave.errors import InputError, is_number, shortened
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on, unlimited
from suboctave.maps.catalogue import COARSE, MOST_VALUES, Catalogue, check_seeds, checked_orders
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.slices import Slice, Strip, follow_curves_beside, follow_curves_of
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.branch import Branch, TrackedBranch

#: a multiplier this close to -1 asks for slices beside it, as far as this share of the range apart
_NEARLY, _FINE = 0.6, 1.0 / 32.0
#: a value within a strip keeps this share of its width away from the ends
_INSIDE = 0.02
#: critical values closer to each other, in shares of the parameter's range, are one
_TOGETHER = 1e-9


@with_options(SearchOptions)
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
    **options: Unpack[SearchOptions],
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
        the linear modes (`find_subharmonics`), and how finely.
    motions
        Motions that are known from elsewhere, as from `RegimeCheck.unknown`: the branches that they lie on are mapped.
    max_curves, max_slices
        Curves, and values of the parameter, after which no more are followed.

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
    orders, fine, given = checked_orders(search, 1), check_seeds(seeds) or COARSE, _checked_motions(motions, catalogue)
    places = [catalogue.bounds[0] + (i + 0.5) / values * catalogue.span for i in range(values)]
    plan = _Survey(catalogue, 2**depth, resolution, max_slices)
    kept = "the map holds what had been found by then"
    with catalogue.reporting(options.get("progress"), f"regimes over omega and {parameter}", kept):
        for curve in followed:
            catalogue.add(curve)
        _follow_motions(given, catalogue)
        for value, order in product(places, orders):
            for branch in catalogue.resonant(value, order, fine, []):
                follow_curves_of(branch, value, catalogue)
        plan.fill(places)
    with unlimited():
        return RegimeMap(catalogue, plan.strips(), depth, resolution)


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
        with catalogue.noting(f"the branch through {orbit!r} could not be followed"):
            branch = continue_branch(orbit, "omega", catalogue.omega.around, **catalogue.options)
            pass_on(branch.interruption)
            known.append((value, branch))
            follow_curves_of(branch, value, catalogue)


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
    slices: list[Slice] = field(default_factory=list)

    def fill(self, values: Sequence[float]) -> None:
        """Add slices until every strip has one, and no limit point known is unexplained at any of them."""
        catalogue, waiting = self.catalogue, list(values)
        for value in dict.fromkeys((values[0], values[-1])):
            follow_curves_beside(value, catalogue)
        while waiting:
            for number, value in enumerate(waiting):
                if len(self.slices) >= self.most:
                    catalogue.note(
                        f"max_slices={self.most} values of {catalogue.name} were looked at: narrow strips were not"
                    )
                    return
                share = len(self.slices) / (len(self.slices) + len(waiting) - number + 3.0)
                catalogue.progress(share, f"{catalogue.name} = {value:.6g}")
                new = Slice(value, catalogue, self.longest)
                new.complete()
                self.slices.append(new)
            # limit points that have become known later may lie on branches that were not met before
            count = -1
            while count != len(catalogue.curves):
                count = len(catalogue.curves)
                for known in self.slices:
                    known.complete()
            waiting = self._empty_strips() or self._doubtful()

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

    def _empty_strips(self) -> list[float]:
        """The middles of strips that no slice lies in."""
        wide = self.resolution * self.catalogue.span
        strips = ((a, b) for a, b in pairwise(self.critical()) if b - a >= wide)
        return [0.5 * (a + b) for a, b in strips if not any(_inside(s.value, a, b) for s in self.slices)]

    def _doubtful(self) -> list[float]:
        """Values beside those at which a motion nearly doubles its period: a pair of doublings may begin between them.

        It would lie on no branch that was met, so that no curve shows it.
        """
        values = []
        for a, b in pairwise(self.critical()):
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
        for a, b in pairwise(self.critical()):
            within = [s for s in self.slices if _inside(s.value, a, b)]
            middle = 0.5 * (a + b)
            nearest = min(within or self.slices, key=lambda s: abs(s.value - middle), default=None)
            strips.append(Strip(a, b, nearest, bool(within)))
        return strips


def _inside(value: float, low: float, high: float) -> bool:
    margin = _INSIDE * (high - low)
    return low + margin <= value <= high - margin
