"""Branches that responses at values of the design parameter lead to, and motions that responses under other loads do.

What is found at one value does not depend on what is found at others: values are divided among processes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from suboctave.analysis.branches import continue_branch
from suboctave.analysis.diagram import Followed
from suboctave.curves.identity import image_of, lies_on, relation
from suboctave.curves.starts import own_linear_part
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import AtValues, Catalogue, motion_near
from suboctave.model.system import System
from suboctave.results.branch import Branch

#: motions of a branch whose mirror images lead to another one, if there is any
_IMAGES = 12
#: name of the parameter that scales all loads
_LEVEL = "load_level"
#: what is noted of limit points that responses under other loads lead to
FROM_LOADS = "found under other loads, could not be reached at the loads' own level"


@dataclass(frozen=True, eq=False)
class Responses(AtValues):
    """Branches that a response leads to, `depth` bifurcations deep, each with whether its period doublings are to be
    followed.
    """

    depth: int

    def found(self, catalogue: Catalogue, value: float) -> list[tuple[Branch, bool]]:
        """See the class."""
        branches: list[tuple[Branch, bool]] = []
        for diagram in catalogue.responses(value, catalogue.omega, Followed(self.depth)):
            met = [(node.branch, node.depth < self.depth) for node in diagram]
            images = ((branch, self.depth > 0) for branch in _images(diagram.branches, catalogue, value))
            branches += chain(met, images)
        return branches


def followed_doublings(catalogue: Catalogue, value: float, branches: Sequence[tuple[Branch, bool]]) -> Iterator[Branch]:
    """The branches at a value, their period doublings followed over the parameter."""
    for branch, doubles in branches:
        for item in branch.bifurcations["PD"] if doubles else ():
            catalogue.known(item, value)
        yield branch


def _images(branches: list[Branch], catalogue: Catalogue, value: float) -> Iterator[Branch]:
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


@dataclass(frozen=True, eq=False)
class UnderOtherLoads(AtValues):
    """Limit points that a level of the loads leads to, `depth` bifurcations deep, as motions at the loads' own level.

    Where nothing oscillates but elements there are none.
    """

    depth: int
    level: float

    def found(self, catalogue: Catalogue, value: float) -> list[PeriodicOrbit]:
        """See the class."""
        system, level = catalogue.at(value), self.level
        if not any(c.harmonic for c in system.load_components()):
            return []
        bounds, scaled = (min(1.0, level), max(1.0, level)), system.with_scaled_loads(_LEVEL)
        other = replace(catalogue.emptied(), system=scaled, name=_LEVEL, bounds=bounds)
        try:
            branches = Responses(other, self.depth).found(other, level)
            for branch in followed_doublings(other, level, branches):
                for item in branch.bifurcations["LP"]:
                    other.known(item, level)
        finally:
            # at this value of the parameter, whatever the level of the loads
            for note in other.notes:
                place = ", ".join(filter(None, (note.where, f"{catalogue.name} = {value:.6g}")))
                catalogue.notes.append(replace(note, parameter=catalogue.name, first=value, last=value, where=place))
        orbits = []
        for piece in other.limit_points:
            if piece.contains(1.0):
                with catalogue.noting(catalogue.open(FROM_LOADS, value, kind="LP")):
                    orbits.append(_unscaled(piece.solve_at(1.0).orbit, system))
        return orbits


def _unscaled(orbit: PeriodicOrbit, system: System) -> PeriodicOrbit:
    """A motion of the system with scaled loads, at their own level, as one of the system itself."""
    values = {name: value for name, value in orbit.values.items() if name != _LEVEL}
    balance = HarmonicBalance(system, orbit.basis, linear=own_linear_part(orbit))
    balance = balance.settle(orbit.x, orbit.omega)
    return PeriodicOrbit(balance, orbit.x, orbit.omega, values, orbit.residual, orbit.truncation, orbit.adaptive)
