"""The system that is integrated in the place of a large structure.

What harmonic balance does with a structure is done here too: up to `reduction.COMPLETE` degrees of freedom, and where
forces act along all of them, it is taken as it is; beyond, it is projected onto the basis that `reduction` grows for
the directions of its elements and loads and for the observed degrees of freedom. A motion in time has no highest
harmonic: the basis is made for `HARMONICS` of them, as that of `condense`, and what lies above is known as well as the
basis happens to have it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.condensed import Condensed, acting, independent, linear_part_of
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.reduction import COMPLETE
from suboctave.model.projected import coordinates_along, project
from suboctave.model.system import System

#: multiples of the load's highest frequency that the basis is made for
HARMONICS = 15


def small_system(
    system: System, omega: float, watched: Sequence[int], varied: Mapping[str, Sequence[float]] | None = None
) -> System:
    """A system as it is integrated: itself, or a `ProjectedSystem` in its place.

    Parameters
    ----------
    omega
        Highest circular frequency of the load, rad per unit time.
    watched
        Degrees of freedom whose motion is looked at; they are coordinates.
    varied
        Values of parameters between which those of the computation lie, by name.
    """
    _check_equation(system)
    if system.n <= COMPLETE:
        return system
    linear = linear_part_of(system, None, (HARMONICS + 0.5) * omega, None, watched)
    inside = frozenset[str]().union(*(matrix.names for matrix in system.linear_parts))
    names = [name for name in varied or {} if name in inside]
    if names and isinstance(linear, Condensed):
        corners = [dict(zip(names, values, strict=True)) for values in product(*((varied or {})[n] for n in names))]
        linear = linear.serving(linear.covers, [{**system.parameters, **corner} for corner in corners])
    return in_basis(system, linear, watched)


def system_of_motions(motions: Sequence[PeriodicOrbit]) -> System:
    """What shooting integrates: the system of motions of one curve, at the first one's parameters, or its projection.

    That is the basis which the motions were solved in: shooting holds their harmonics against the same equation of
    motion, and how far that is from the whole structure is what the error of the projection says.
    """
    first = motions[0]
    _check_equation(first.system)
    if first.system.n <= COMPLETE:
        return first.system
    linear = first.state().linear
    if isinstance(linear, Condensed):
        highest = max(motion.omega * float(motion.basis.multiples[-1]) for motion in motions)
        linear = linear.serving(highest, [motion.values for motion in motions])
    return in_basis(first.system, linear, [first.system.observed_dof])


def in_basis(system: System, linear: LinearPart, watched: Sequence[int]) -> System:
    """A system in the basis of its linear part, or itself where that has none of its own."""
    _check_equation(system)
    if not isinstance(linear, Condensed) or linear.projected.shapes is None:
        return system
    shapes, dofs = linear.projected.shapes, list(dict.fromkeys(int(dof) for dof in watched))
    units: list[Array] = [np.eye(1, system.n, dof)[0] for dof in dofs]
    read = independent([*units, *acting(system)])
    mass, _, stiffness = linear.equation_of_motion()
    basis = coordinates_along(shapes, read, (mass, stiffness), dofs)
    return project(system, basis, read, dofs, linear.covers, linear.error)


def _check_equation(system: System) -> None:
    if not system.structural.zero:
        raise InputError(
            "structural damping has no equation of motion in time: system.viscous_equivalent() is a system that has "
            "one, with as much damping of each mode at its own frequency"
        )
