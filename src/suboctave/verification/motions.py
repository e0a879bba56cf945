"""One motion, or one bifurcation, against shooting from its state at t = 0."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation, TrackedEvent
from suboctave.continuation.problem import Array
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.methods import method_of
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.kinds import KINDS
from suboctave.model.elements.coupled import as_coupled, reads
from suboctave.model.elements.smoothness import CornerSampling
from suboctave.model.projected import ProjectedSystem
from suboctave.model.system import System
from suboctave.projection import system_of_motions
from suboctave.timedomain import PeriodicSolution, integrate, locate_by_shooting, shoot, shoot_along, shoot_cycle
from suboctave.verification.harmonics import left_out, up_to_harmonics
from suboctave.verification.result import AGREES, DISAGREES, OPEN

#: the kinds that shooting locates by themselves, along the curve of motions
LOCATED = ("LP", "BP", "PD", "NS")
#: how far along the curve of motions one is searched, in tolerances, and the passes through it that may be spent
_REACH, _PASSES = 100.0, 120
#: how many times their stated errors multipliers may be off
_COVERED = 10.0
#: share of a motion that its start in time may be off by, whatever its harmonics are
_DIGITS = 1e-12
#: displacements of a motion that are held in memory at once
_AT_ONCE = 10_000_000


@checked(result=True)
@dataclass(frozen=True, eq=False)
class Verification:
    """A harmonic-balance motion held against shooting.

    distance
        Largest difference of the states at t = 0, relative to the motion (displacements by the largest displacement,
        velocities by the largest velocity; of a projected structure both in the norm of its mass); for a bifurcation
        also the relative difference in omega, if larger; for a grazing the distance by which the motion misses the gap,
        relative to the relative displacement, if larger.
    multiplier_error
        Largest difference between multipliers, paired.
    stable
        The verdict of shooting on the motion's stability, None if no motion was found.
    outcome
        "agrees" where shooting arrives at the same motion with the same verdict; at a bifurcation, where no verdict
        exists, where it locates one of the same kind at the same place. Else "disagrees", or "cannot tell"; `reason`
        says why.
    solution
        The motion found by shooting, None if it found none (`reason` says why). Of a large structure its state is
        that of all degrees of freedom, multipliers and monodromy matrix are those of the projection.
    projection
        What a large structure was integrated as, in the basis that the motion was solved in; None for one that was
        taken as it is.
    """

    distance: float
    multiplier_error: float
    stable: bool | None
    outcome: str
    solution: PeriodicSolution | None
    reason: str
    projection: ProjectedSystem | None = None

    @property
    def agrees(self) -> bool:
        """Whether it does, for certain."""
        return self.outcome == AGREES

    def __repr__(self) -> str:
        verdict = self.outcome.upper() if self.outcome == DISAGREES else self.outcome
        errors = f"distance {self.distance:.1e}, multipliers {self.multiplier_error:.1e}"
        basis = "" if self.projection is None else f"\n  {self.projection.words}"
        return f"Verification: {verdict}; {errors}. {self.reason}{basis}"


def verify_motion(what: PeriodicOrbit | BranchPoint | Bifurcation, tolerance: float) -> Verification:
    """A motion against shooting, a bifurcation against its location by shooting (`verification.verify`)."""
    motion = motion_of(what)
    system = system_of_motions([motion])
    known = None if isinstance(what, PeriodicOrbit) else what.floquet
    floquet = known or method_of(None).multipliers(motion.state())
    if floquet.method == "none":
        raise InputError(
            f"no independent check of this motion alone, {floquet.note}: use so.verify(curve, points=[...]), which "
            "integrates motions of its curve with the damping that sustains them"
        )
    whole = motion.start()
    start = system.reduced(whole)
    projection = system if isinstance(system, ProjectedSystem) else None
    touches = isinstance(what, Bifurcation) and what.kind in CONTACT_KINDS
    alone = not motion.system.driven
    located = what if isinstance(what, Bifurcation) and what.kind in LOCATED and not alone else None
    kind = None if located is None else located.kind
    try:
        if alone and np.any(motion.x[1:]):
            folds = isinstance(what, Bifurcation) and what.kind in ("LP", "BP")
            solution = shoot_cycle(system, start, motion.omega, periods=motion.basis.nu, corrected=not folds)
        elif located is None:
            # where a multiplier may be +1, as at a limit point, a true motion of the same omega is as far away as the
            # square root of what separates two curves, or there is none: the nearest one of the curve is taken
            apart, errors = np.abs(1.0 - floquet.multipliers), floquet.errors
            beside_fold = not touches and bool((apart <= np.maximum(errors, tolerance)).any())
            nearest = shoot_along if beside_fold else shoot
            solution = nearest(system, start, motion.omega, periods=motion.basis.nu)
        else:
            solution = _by_shooting(system, located, start, tolerance)
    except ConvergenceError as failure:
        what_failed = "shooting found no motion from here" if kind is None else "shooting did not locate it"
        largest = float(np.abs(floquet.multipliers).max(initial=0.0))
        if kind is None and largest * max(motion.truncation, _DIGITS) > 1.0:
            reason = f"A multiplier of {largest:.1e} amplifies the truncation error to the size of the motion"
            return Verification(math.inf, math.inf, None, OPEN, None, f"{reason}: {what_failed}", projection)
        return Verification(math.inf, math.inf, None, DISAGREES, None, f"{what_failed}: {failure}", projection)
    distance = max(distance_of(system, motion, start, solution), solution.residual)
    if isinstance(what, Bifurcation) and touches:
        distance = max(distance, distance_from_gap(system, what, solution.state, solution.omega))
    error = pairing(floquet.multipliers, solution.multipliers)
    off = pairing(floquet.multipliers, solution.multipliers, True, floquet.errors)

    def verdict(agrees: bool, reason: str, otherwise: str = DISAGREES) -> Verification:
        outcome, found = AGREES if agrees else otherwise, recovered_solution(system, solution)
        return Verification(distance, error, solution.stable, outcome, found, reason, projection)

    if kind is not None:
        words = f"Shooting finds {KINDS[kind].words} at omega = {solution.omega:.9g}"
        if solution.kind is None:
            words = f"Shooting sees multipliers cross as at {KINDS[kind].words} close to omega = {solution.omega:.9g}"
        same = distance <= tolerance
        if same and off > tolerance + floquet.error + 100.0 * distance:
            words += f"; its multipliers differ by {error:.1e}, more than their errors"
        return verdict(same, words if same else f"{words}: another one (relative distance {distance:.1e})")
    if not distance <= tolerance:
        if not touches and distance <= left_out(motion):
            return verdict(False, up_to_harmonics(motion, distance), OPEN)
        other = "a motion that does not graze" if touches else "another motion"
        return verdict(False, f"Shooting converges to {other} (relative distance {distance:.1e})")
    if alone and isinstance(what, Bifurcation) and what.kind in LOCATED:
        return verdict(*_as_critical(what, solution, tolerance))
    # at an extremum or a point of codimension two, and of what nothing drives, a multiplier is critical: no verdict to
    # compare
    if not alone and floquet.stable != solution.stable and not isinstance(what, TrackedEvent):
        margin = abs(float(np.abs(solution.multipliers).max()) - 1.0)
        if margin <= max(tolerance, floquet.error):
            near = f"the largest multiplier lies {margin:.1e} from the unit circle"
            return verdict(False, f"The same motion; {near}, too close to compare stability", OPEN)
        other = "stable" if solution.stable else "unstable"
        return verdict(False, f"By shooting it is {other}, by harmonic balance the opposite")
    if alone or isinstance(what, TrackedEvent):
        return verdict(True, "The same motion")
    if off > tolerance + _COVERED * floquet.error + 100.0 * distance:
        return verdict(False, f"Multipliers of shooting differ by {error:.1e}, stability is the same")
    return verdict(True, "The same motion, the same stability")


def _as_critical(what: Bifurcation, solution: PeriodicSolution, tolerance: float) -> tuple[bool, str]:
    """Whether a motion that nothing drives has the multiplier that makes it a bifurcation, and in words; a second +1 at
    a limit or branch point, where two that meet part like the square root of what is missed.
    """
    folds = what.kind in ("LP", "BP")
    critical = 1.0 if folds else what.critical_multiplier()
    apart = np.sort(np.abs(solution.multipliers - critical))
    miss = float(apart[1] if folds else apart[0])
    allowed = math.sqrt(tolerance) if folds else tolerance
    words = f"The same motion, with a {'second ' if folds else ''}multiplier {miss:.1e} from {critical:.6g}"
    if folds and solution.residual > tolerance:
        return (
            False,
            f"Integrated over a period from there, the motion misses its start by {solution.residual:.1e} of its size",
        )
    return miss <= allowed, words


def distance_of(system: System, motion: PeriodicOrbit, start: Array, solution: PeriodicSolution) -> float:
    """Of a solution from the motion's state (2n,) at t = 0, relative; of their frequencies, if larger."""
    away, sizes = _measured(system, solution.state - start), largest_of(motion, system)
    # a motion at rest differs from another only if that one moves
    distance = max(float(a.max()) / max(size, np.finfo(float).tiny) for a, size in zip(away, sizes, strict=True))
    return max(distance, abs(solution.omega - motion.omega) / motion.omega)


def largest_of(motion: PeriodicOrbit, system: System) -> tuple[float, float]:
    """The largest displacement and the largest velocity of a motion as `_measured`."""
    largest = np.zeros(2)
    instants = np.linspace(0.0, motion.period, 8 * motion.basis.harmonics + 8)
    # so many at once that they fit into memory
    for t in np.array_split(instants, 1 + len(instants) * motion.system.n // _AT_ONCE):
        states = system.reduced(np.hstack([motion.displacement(t).T, motion.velocity(t).T]))
        largest = np.maximum(largest, [part.max() for part in _measured(system, states)])
    return float(largest[0]), float(largest[1])


def _measured(system: System, states: Array) -> tuple[Array, Array]:
    """Sizes of displacements and of velocities, of states (..., 2n) of the system that is integrated.

    Of every degree of freedom its modulus. Of a projected structure, which may have translations, rotations and
    curvatures among its unknowns, the norm of the mass: the root of twice the kinetic energy, and the same of
    displacements.
    """
    x, v = np.split(np.asarray(states), 2, axis=-1)
    if not isinstance(system, ProjectedSystem):
        return np.abs(x), np.abs(v)
    mass = system.mass.value(system.parameters)
    norms = (np.sqrt(np.einsum("...i,ij,...j->...", part, mass, part)) for part in (x, v))
    return next(norms), next(norms)


def distance_from_gap(system: System, what: Bifurcation, state: Array, omega: float) -> float:
    """Distance of the motion's nearest extremum from the gap that it should graze, in units of the displacement."""
    assert what.contact is not None
    contact = what.contact
    period = 2.0 * math.pi * what.orbit.basis.nu / omega
    path = integrate(system, state, (0.0, period), omega)
    window = 0.5 * period / (what.orbit.basis.harmonics + 1)
    read = _read(system, contact.element, contact.gap)
    grid, centre = np.linspace(-1.0, 1.0, 201), contact.time
    for _ in range(3):  # the window closes on the extremum
        times = np.mod(centre + window * grid, period)
        u = read(*path.at(times), omega * times)
        a, b, c = np.polyfit(grid, u, 2)
        at = float(np.clip(-0.5 * b / a, -1.0, 1.0)) if a != 0.0 else 0.0
        value = float(c + at * b + at**2 * a)
        centre, window = centre + at * window, 0.1 * window
    times = np.linspace(0.0, period, 200)
    size = float(np.abs(read(*path.at(times), omega * times)).max())
    return abs(value - contact.gap) / size


def _read(system: System, number: int, gap: float) -> Callable[[Array, Array, Array], Array]:
    """What an element reads of states x (N, n), v and phases (N,) of which a gap is a place: a displacement, or the
    function of a surface, that nearest to zero of several.
    """
    element = system.elements[number]
    c = element.coefficient_values(system.parameters)
    kind, inputs, law = element.sampling(c), element.inputs(system.n), as_coupled(element)
    if not isinstance(kind, CornerSampling) or not kind.surfaces or gap in kind.points:
        direction = reads(element, system.n)
        return lambda x, v, theta: x @ direction

    def function(x: Array, v: Array, theta: Array) -> Array:
        q = np.concatenate((inputs @ x.T, inputs @ v.T)) if element.depends_on_velocity else inputs @ x.T
        values = [law.surface_slopes(which, q, theta, c)[0] for which in range(kind.surfaces)]
        return min(values, key=lambda one: float(np.abs(one).min()))

    return function


def recovered_solution(system: System, solution: PeriodicSolution) -> PeriodicSolution:
    """A motion found by shooting as one of all degrees of freedom."""
    if not isinstance(system, ProjectedSystem):
        return solution
    return replace(solution, state=system.recovered(solution.state)[:], dof=system.watched[solution.dof])


def _by_shooting(system: System, item: Bifurcation, start: Array, tolerance: float) -> PeriodicSolution:
    """The bifurcation located by shooting, or the motion at the same omega.

    The latter where the search loses the multiplier but the count of unstable ones changes as it should within a tenth
    of the tolerance on either side.
    """
    omega, periods, several = item.orbit.omega, item.orbit.basis.nu, item.multiplicity
    reach = _REACH * tolerance
    try:
        return locate_by_shooting(
            system, item.kind, start, omega, periods=periods, reach=reach, budget=_PASSES, multiplicity=several
        )
    except ConvergenceError:
        if item.kind == "LP":
            raise
        sides = [shoot(system, start, omega * (1.0 + s * 0.1 * tolerance), periods=periods) for s in (-1.0, 1.0)]
        counts = [int(np.count_nonzero(np.abs(side.multipliers) > 1.0)) for side in sides]
        if abs(counts[1] - counts[0]) != several * (2 if item.kind == "NS" else 1):
            raise
        return shoot(system, start, omega, periods=periods)


def pairing(computed: ComplexArray, true: ComplexArray, relative: bool = False, errors: Array | None = None) -> float:
    """Largest difference between two sets of multipliers under the best pairing; `relative` to those beyond one.

    errors: of the computed ones; by how much the difference is more than what `_COVERED` times these cover.
    """
    from scipy.optimize import linear_sum_assignment

    cost = np.abs(computed[:, None] - true[None, :])
    if relative:
        cost = cost / np.maximum(1.0, np.abs(true))
    rows, columns = linear_sum_assignment(cost)
    off = cost[rows, columns] if errors is None else cost[rows, columns] - _COVERED * errors[rows]
    return float(off.max(initial=0.0))


def motion_of(what: Any | BranchPoint | Bifurcation) -> PeriodicOrbit:
    if isinstance(what, PeriodicOrbit):
        return what
    if isinstance(what, BranchPoint | Bifurcation):
        return what.orbit
    hint = ": take one of its .orbits or .bifurcations" if hasattr(what, "orbits") else ""
    raise InputError(f"expected a PeriodicOrbit, a point of a branch or a Bifurcation, not {type(what).__name__}{hint}")
