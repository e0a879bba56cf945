"""A single motion or bifurcation held against shooting from its states at t = 0."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation, TrackedEvent
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.curves.points import BranchPoint
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.methods import StabilityMethod, method_of
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.kinds import KINDS
from suboctave.model.elements.coupled import reads
from suboctave.timedomain import PeriodicSolution, integrate, locate_by_shooting, shoot

__all__ = ["Verification", "distance_from_gap", "stability", "verify_motion"]

#: the kinds that shooting locates by themselves, along the curve of motions
LOCATED = ("LP", "BP", "PD", "NS")
#: how far along the curve of motions one is searched, in tolerances, and the passes through it that may be spent
_REACH, _PASSES = 100.0, 120


def stability(
    orbit: PeriodicOrbit | BranchPoint | Bifurcation, method: StabilityMethod | str | None = None
) -> FloquetResult:
    """Floquet multipliers of a motion with error estimates and the verdict (`stable`, `decided`).

    Parameters
    ----------
    method
        `Monodromy()`, `Hill()`, `KoopmanHill()`, or their names "monodromy", "hill", "koopman-hill". Default: the
        monodromy matrix, and where a multiplier lies within its error of the unit circle the others as witnesses. A
        method that cannot say anything says so (`applicable`, `note`).

    Raises
    ------
    InputError
        If there is no such method.
    """
    chosen = method_of(method)
    motion = _orbit(orbit)
    with one_thread():
        return chosen.multipliers(motion.state())


@dataclass(frozen=True, eq=False)
class Verification:
    """A harmonic-balance motion held against shooting.

    distance
        Largest difference of the states at t = 0, relative to the motion (displacements by the largest displacement,
        velocities by the largest velocity); for a bifurcation also the relative difference in omega, if larger; for a
        grazing the distance by which the motion misses the gap, relative to the relative displacement, if larger.
    multiplier_error
        Largest difference between multipliers, paired.
    stable
        The verdict of shooting on the motion's stability, None if no motion was found.
    agrees
        Whether shooting arrives at the same motion with the same verdict; at a bifurcation, where no verdict exists,
        whether it locates one of the same kind at the same place.
    solution
        The motion found by shooting, None if it found none (`reason` says why).
    """

    distance: float
    multiplier_error: float
    stable: bool | None
    agrees: bool
    solution: PeriodicSolution | None
    reason: str

    def __repr__(self) -> str:
        verdict = "agrees" if self.agrees else "DISAGREES"
        errors = f"distance {self.distance:.1e}, multipliers {self.multiplier_error:.1e}"
        return f"Verification: {verdict}; {errors}. {self.reason}"


def verify_motion(what: PeriodicOrbit | BranchPoint | Bifurcation, tolerance: float) -> Verification:
    """A motion against shooting, a bifurcation against its location by shooting (`verification.verify`)."""
    motion = _orbit(what)
    system = motion.system
    if motion.coefficients.shape[1] != system.n:
        raise InputError("only motions with all DOFs of the system can be verified by shooting")
    floquet = what.floquet if isinstance(what, BranchPoint | Bifurcation) else stability(motion)
    start = motion.start()
    touches = isinstance(what, Bifurcation) and what.kind in CONTACT_KINDS
    kind = what.kind if isinstance(what, Bifurcation) and what.kind in LOCATED else None
    try:
        if kind is None:
            solution = shoot(system, start, motion.omega, periods=motion.basis.nu)
        else:
            solution = _by_shooting(motion, kind, start, tolerance)
    except ConvergenceError as failure:
        what_failed = "shooting found no motion from here" if kind is None else "shooting did not locate it"
        return Verification(math.inf, math.inf, None, False, None, f"{what_failed}: {failure}")
    t = np.linspace(0.0, motion.period, 8 * motion.basis.harmonics + 8)
    sizes = np.repeat([np.abs(motion.displacement(t)).max(), np.abs(motion.velocity(t)).max()], system.n)
    # a motion at rest differs from another only if that one moves
    distance = float(np.max(np.abs(solution.state - start) / np.maximum(sizes, np.finfo(float).tiny)))
    distance = max(distance, abs(solution.omega - motion.omega) / motion.omega)
    if isinstance(what, Bifurcation) and touches:
        distance = max(distance, distance_from_gap(what, solution.state, solution.omega))
    error = pairing(floquet.multipliers, solution.multipliers)

    def verdict(agrees: bool, reason: str) -> Verification:
        return Verification(distance, error, solution.stable, agrees, solution, reason)

    if kind is not None:
        words = f"Shooting finds {KINDS[kind].words} at omega = {solution.omega:.9g}"
        if solution.kind is None:
            words = f"Shooting sees multipliers cross as at {KINDS[kind].words} close to omega = {solution.omega:.9g}"
        same = distance <= tolerance
        return verdict(same, words if same else f"{words}: another one (relative distance {distance:.1e})")
    if not distance <= tolerance:
        other = "a motion that does not graze" if touches else "another motion"
        return verdict(False, f"Shooting arrives at {other} (relative distance {distance:.1e})")
    # at an extremum or a point of codimension two a multiplier is critical: no verdict to compare
    if floquet.stable != solution.stable and not isinstance(what, TrackedEvent):
        doubt = "" if floquet.decided else ": a multiplier lies within its error of the unit circle"
        other = "stable" if solution.stable else "unstable"
        return verdict(False, f"Shooting calls it {other}, harmonic balance the opposite{doubt}")
    return verdict(True, "The same motion" if isinstance(what, TrackedEvent) else "The same motion, the same verdict")


def distance_from_gap(what: Bifurcation, state: Array, omega: float) -> float:
    """Distance of the motion's nearest extremum from the gap that it should graze, in units of the displacement."""
    assert what.contact is not None
    system, contact = what.orbit.system, what.contact
    period = 2.0 * math.pi * what.orbit.basis.nu / omega
    path = integrate(system, state, (0.0, period), omega)
    window = 0.5 * period / (what.orbit.basis.harmonics + 1)
    direction = reads(system.elements[contact.element], system.n)
    grid, centre = np.linspace(-1.0, 1.0, 201), contact.time
    for _ in range(3):  # the window closes on the extremum
        u = path.at(np.mod(centre + window * grid, period))[0] @ direction
        a, b, c = np.polyfit(grid, u, 2)
        at = float(np.clip(-0.5 * b / a, -1.0, 1.0)) if a != 0.0 else 0.0
        value = float(c + at * b + at**2 * a)
        centre, window = centre + at * window, 0.1 * window
    size = float(np.abs(path.at(np.linspace(0.0, period, 200))[0] @ direction).max())
    return abs(value - contact.gap) / size


def _by_shooting(motion: PeriodicOrbit, kind: str, start: Array, tolerance: float) -> PeriodicSolution:
    """The bifurcation located by shooting, or the motion at the same omega.

    The latter where the search loses the multiplier but the count of unstable ones changes as it should within a tenth
    of the tolerance on either side.
    """
    system, omega, periods = motion.system, motion.omega, motion.basis.nu
    try:
        return locate_by_shooting(system, kind, start, omega, periods=periods, reach=_REACH * tolerance, budget=_PASSES)
    except ConvergenceError:
        crossing = {"PD": 1, "NS": 2}.get(kind)
        if crossing is None:
            raise
        sides = [shoot(system, start, omega * (1.0 + s * 0.1 * tolerance), periods=periods) for s in (-1.0, 1.0)]
        counts = [int(np.count_nonzero(np.abs(side.multipliers) > 1.0)) for side in sides]
        if abs(counts[1] - counts[0]) != crossing:
            raise
        return shoot(system, start, omega, periods=periods)


def pairing(computed: ComplexArray, true: ComplexArray, relative: bool = False) -> float:
    """Largest difference between two sets of multipliers under the best pairing; `relative` to those beyond one."""
    from scipy.optimize import linear_sum_assignment

    cost = np.abs(computed[:, None] - true[None, :])
    if relative:
        cost = cost / np.maximum(1.0, np.abs(true))
    return float(cost[linear_sum_assignment(cost)].max())


def _orbit(what: Any | BranchPoint | Bifurcation) -> PeriodicOrbit:
    if isinstance(what, PeriodicOrbit):
        return what
    if isinstance(what, BranchPoint | Bifurcation):
        return what.orbit
    hint = ": take one of its .orbits or .bifurcations" if hasattr(what, "orbits") else ""
    raise InputError(f"expected a PeriodicOrbit, a point of a branch or a Bifurcation, not {type(what).__name__}{hint}")
