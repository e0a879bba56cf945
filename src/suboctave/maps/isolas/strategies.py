"""Where a search for isolas begins: at responses, at responses under other loads, among nonlinear resonances.

Every strategy leads to limit points or closed branches at values of the design parameter; `Search` does the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from suboctave.analysis.diagram import ByDepth
from suboctave.analysis.frequency_response import continue_branch
from suboctave.analysis.subharmonics import Seeds
from suboctave.curves.discretisation import own_linear_part
from suboctave.curves.identity import image_of, lies_on, relation
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import Catalogue, motion_near
from suboctave.maps.isolas.search import PREPARATION, Loop, Search
from suboctave.model.system import System
from suboctave.results.branch import Branch

__all__ = ["from_load_levels", "from_resonances", "from_responses"]

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
    for diagram in catalogue.responses(value, catalogue.omega, ByDepth(depth)):
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
