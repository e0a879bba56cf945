"""Finite-element models with contacts and springs, as they are published or used to measure what sizes cost.

Every function returns a `System` whose parameters have the names of its arguments (numbers of elements and stops are
none).
"""

from __future__ import annotations

from suboctave.errors import InputError, shortened
from suboctave.model.elements.springs import CubicSpring
from suboctave.model.elements.stops import ElasticStop
from suboctave.model.loads import HarmonicLoad
from suboctave.model.system import System
from suboctave.structures.damping import Rayleigh
from suboctave.structures.sources import beam, plate
from suboctave.structures.structure import Structure

__all__ = ["cantilever_beam", "clearance_plate"]

_LENGTH, _WIDTH = 1.0, 0.6
#: where stops stand on the free edge x = 1, by their number: y as a share of the width
_STOPS: dict[int, tuple[float, ...]] = {1: (0.5,), 2: (0.0, 1.0), 5: (0.0, 0.25, 0.5, 0.75, 1.0)}
#: where the load acts: off the centre line, so that it excites torsion too
_LOADED = (0.6, 0.2)


def cantilever_beam(
    elements: int = 20, knl: float = 6e9, F: float = 0.3, alpha: float = 3.0, beta: float = 0.0
) -> System:
    """A clamped beam of steel with a cubic spring `knl` (N/m^3) and a force `F cos(omega t)` (N) at its tip.

    Length 0.7 m, cross-section 14 mm by 14 mm, E = 205 GPa, 7800 kg/m^3; damping `alpha M + beta K`: 1 % in the first
    mode (23.7 Hz) by default. Source: F. Thouverez, Presentation of the ECL benchmark, Mechanical Systems and Signal
    Processing 17 (2003), 195-202, with the numbers of M. Krack, J. Gross, Harmonic Balance for Nonlinear Vibration
    Problems, Springer 2019, and its toolbox NLvib; damping and force are not theirs.
    """
    structure = beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, elements)
    tip = structure.dof(elements, "z")
    parameters = {"knl": knl, "F": F, "alpha": alpha, "beta": beta}
    spring, load = CubicSpring(dof=tip, coefficient="knl"), HarmonicLoad(dof=tip, amplitude="F")
    return structure.system([spring], [load], parameters, Rayleigh("alpha", "beta"), "cantilever with a cubic spring")


def clearance_plate(
    nx: int = 20,
    ny: int = 12,
    stops: int = 1,
    Kc: float = 1.0,
    gap: float = 0.1,
    p: float = 0.2,
    alpha: float = 0.02,
    beta: float = 0.002,
) -> System:
    """A cantilever plate, 1 by 0.6, whose free edge meets `stops` stops (1, 2 or 5) of stiffness `Kc` beyond `gap`.

    `p cos(omega t)` acts at (0.6, 0.2); damping `alpha M + beta K`. No units: mass and first natural frequency are 1
    (to 1e-4, by the mesh). Poisson's ratio is 0.3. `nx`, `ny`: elements along both edges; stops and load act at the
    nodes nearest to their places. (20, 12) are 1040 degrees of freedom, (64, 38) 9984, (204, 122) 100 368.
    Raises `InputError` for other numbers of stops, and where scikit-fem is not installed.
    """
    if stops not in _STOPS:
        raise InputError(f"stops={shortened(stops)}: one of {', '.join(map(str, _STOPS))}", ("stops",))
    structure = clearance_plate_structure(nx, ny)
    places = [_deflection(structure, _LENGTH, share * _WIDTH) for share in _STOPS[stops]]
    elements = [ElasticStop(dof=place, stiffness="Kc", gap="gap", side="right") for place in places]
    load = HarmonicLoad(dof=_deflection(structure, *_LOADED), amplitude="p")
    parameters = {"Kc": Kc, "gap": gap, "p": p, "alpha": alpha, "beta": beta}
    return structure.system(elements, [load], parameters, Rayleigh("alpha", "beta"), "clearance plate")


def clearance_plate_structure(nx: int = 20, ny: int = 12) -> Structure:
    """The plate of `clearance_plate` with its labels and its mesh, for pictures."""
    thickness = 0.01
    density = 1.0 / (_LENGTH * _WIDTH * thickness)
    # of one mesh for all: finer ones are the same plate
    (omega,) = plate(_LENGTH, _WIDTH, thickness, 1.0, 0.3, density, (20, 12)).natural_frequencies(1).omega
    return plate(_LENGTH, _WIDTH, thickness, 1.0 / omega**2, 0.3, density, (nx, ny), name="clearance plate")


def _deflection(structure: Structure, x: float, y: float) -> int:
    """The degree of freedom that is the deflection of the node nearest to (x, y)."""
    assert structure.mesh is not None
    return structure.dof(structure.mesh.nearest(x, y), "z")
