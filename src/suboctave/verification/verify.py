"""The verbs `stability` and `verify`: what the time domain says of a motion, a bifurcation or all of a branch.

A single motion or bifurcation is held against shooting from its states at t = 0. Of a branch every motion, every
verdict and every bifurcation is held against shooting in time: the true motion beside each point is found by
`timedomain.multiple_shooting` on the compiled flow, with free frequency, so that what counts is the distance to the
curve of true motions. A bifurcation is confirmed where its test function, computed in time, changes its sign along that
curve within the tolerance; where that does not show it, shooting of the bifurcation alone has the last word.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import index
from typing import Any, overload

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.methods import StabilityMethod, method_of
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption, limited
from suboctave.kinds import KINDS
from suboctave.model.projected import ProjectedSystem
from suboctave.model.system import System
from suboctave.progress import reporting
from suboctave.projection import system_of_motions
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.timedomain import shoot
from suboctave.timedomain.multiple_shooting import MultipleShooting, ShotMotions
from suboctave.verification.harmonics import left_out, up_to_harmonics
from suboctave.verification.motions import (
    LOCATED,
    Verification,
    distance_from_gap,
    distance_of,
    largest_of,
    motion_of,
    pairing,
    verify_motion,
)
from suboctave.verification.result import (
    AGREES,
    DISAGREES,
    OPEN,
    BranchVerification,
    VerifiedBifurcation,
    VerifiedPoint,
)


def stability(
    orbit: PeriodicOrbit | BranchPoint | Bifurcation, method: StabilityMethod | str | None = None
) -> FloquetResult:
    """Floquet multipliers of a motion with error estimates and the verdict (`stable`, `decided`).

    Parameters
    ----------
    method
        `Monodromy()`, `Hill()`, or their names "monodromy", "hill". Default: the monodromy matrix, and where a
        multiplier lies within its error of the unit circle the root of Hill's determinant beside it. A method that
        cannot say anything says so (`applicable`, `note`).

    Raises
    ------
    InputError
        If there is no such method.
    """
    chosen = method_of(method)
    motion = motion_of(orbit)
    if isinstance(orbit, BranchPoint | Bifurcation) and orbit.floquet.method == "none":
        # the motion of no system that stands by itself
        return orbit.floquet
    with one_thread():
        return chosen.multipliers(motion.state())


# ------------------------------------------------------------------------------------------------------------ a branch
def _verify_branch(
    branch: Branch,
    tolerance: float,
    points: int | Iterable[int] | None,
    every: int,
    bifurcations: bool,
    workers: int | None,
    progress: Any,
) -> BranchVerification:
    if isinstance(branch, TrackedBranch):
        raise InputError(
            f"a {branch.kind} curve is verified motion by motion: take its points or its .bifurcations one by one"
        )
    if not len(branch):
        raise InputError("the branch has no points to verify")
    which = _chosen(len(branch), points, every)
    items = list(branch.bifurcations.met) if bifurcations else []
    orbits = [branch.points[i].orbit for i in which]
    shots = Shots([*orbits, *(item.orbit for item in items)], workers)
    checked: list[VerifiedPoint] = []
    confirmed: list[VerifiedBifurcation] = []
    whole = len(which) + 4 * len(items)
    interruption: Interruption | None = None
    with reporting(progress, "verifying") as report, one_thread():
        try:
            for i, shot in zip(which, shots.motions(orbits), strict=True):
                if report is not None:
                    report(len(checked) / whole, f"{len(checked)} of {len(which)} points")
                checked.append(_judged(branch, i, shot, tolerance))
            quick = _quick(shots, items, tolerance)
            for done, item in enumerate(items):
                if report is not None:
                    report((len(which) + 4 * done) / whole, f"{item.kind} at omega = {item.omega:.6g}")
                confirmed.append(_confirmed(shots.system, item, quick.get(id(item)), tolerance, branch.observe))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
    basis = shots.system.words if isinstance(shots.system, ProjectedSystem) else ""
    return BranchVerification(
        branch, tuple(checked), tuple(confirmed), tolerance, interruption is None, interruption, basis
    )


def _chosen(count: int, points: int | Iterable[int] | None, every: int) -> list[int]:
    """Indices of the points that are looked at."""
    if isinstance(every, bool) or not isinstance(every, int | np.integer) or every < 1:
        raise InputError(f"every must be a positive whole number, not {every!r}")
    if points is None:
        return list(range(0, count, int(every)))
    if every != 1:
        raise InputError("choose points= or every=, not both")
    if isinstance(points, int | np.integer):
        if isinstance(points, bool) or points < 1:
            raise InputError(f"points must be a positive number of points, or their indices, not {points!r}")
        return sorted({int(i) for i in np.linspace(0, count - 1, min(int(points), count)).round()})
    try:
        listed = [index(i) for i in points]
    except TypeError:
        listed = [count]
    for i in listed:
        if not -count <= i < count:
            raise InputError(f"points={points!r}: give a number of points, or indices of a branch of {count}")
    return sorted({i % count for i in listed})


def _judged(branch: Branch, i: int, shot: Shot, tolerance: float) -> VerifiedPoint:
    """The verdict on one point."""
    point = branch.points[i]
    floquet, distance, multipliers = point.floquet, shot.distance, shot.multipliers
    stable, error, known = None, math.inf, floquet.applicable
    if not shot.converged:
        outcome, reason = OPEN, "Shooting did not arrive at a motion from here"
        if distance > 100.0 * tolerance or not np.isfinite(distance):
            outcome, reason = DISAGREES, "Shooting finds no motion near: it leaves the place"
        distance, multipliers = math.inf, multipliers[:0]
    else:
        margin = float(np.max(np.abs(multipliers))) - 1.0
        doubt = float(np.max(shot.errors[np.abs(multipliers) > 0.5], initial=0.0))
        stable = margin < 0.0
        if known:
            error = pairing(floquet.multipliers, multipliers, relative=True)
        allowed = tolerance + 10.0 * (floquet.error + doubt) + 100.0 * distance
        if tolerance < distance <= left_out(point.orbit):
            outcome, reason = OPEN, up_to_harmonics(point.orbit, distance)
        elif distance > tolerance:
            outcome, reason = DISAGREES, f"Shooting arrives at another motion (relative distance {distance:.1e})"
        elif not known:
            outcome, reason = OPEN, "The same motion; the branch has no verdict here"
        elif floquet.stable != stable and abs(margin) <= max(tolerance, doubt):
            near = f"the largest multiplier lies {abs(margin):.1e} from the unit circle"
            outcome, reason = OPEN, f"The same motion; {near}, too near to compare verdicts"
        elif floquet.stable != stable:
            verdict = "stable" if stable else "unstable"
            outcome, reason = DISAGREES, f"Shooting calls it {verdict}, harmonic balance the opposite"
        elif error > allowed:
            outcome, reason = DISAGREES, f"Shooting finds other multipliers (off by {error:.1e}) with the same verdict"
        else:
            outcome, reason = AGREES, "The same motion, the same verdict"
    return VerifiedPoint(
        i, point.orbit.omega, point.orbit.amplitude(branch.observe), distance, multipliers, shot.errors, error,
        stable, floquet.stable if known else None, outcome, reason,
    )  # fmt: skip


def _quick(shots: Shots, items: Sequence[Bifurcation], tolerance: float) -> dict[int, Shot]:
    """The true motions at bifurcations: of those that have a test function along the curve, and of contacts."""
    found: dict[int, Shot] = {}
    for kinds, reach in ((CONTACT_KINDS, None), (LOCATED, tolerance)):
        own = [item for item in items if item.kind in kinds]
        motions = shots.motions([item.orbit for item in own], [item.kind for item in own], reach)
        found |= {id(item): shot for item, shot in zip(own, motions, strict=True)}
    return found


def _confirmed(
    system: System, item: Bifurcation, shot: Shot | None, tolerance: float, observe: int
) -> VerifiedBifurcation:
    verdict = partial(VerifiedBifurcation, item.kind, item.omega, item.parameters, item.orbit.amplitude(observe))
    if shot is not None and shot.converged and shot.distance <= tolerance:
        if item.kind in CONTACT_KINDS:
            along = distance_from_gap(system.moved_to(item.orbit.values), item, shot.state, shot.omega)
            words = "The same motion, and it just reaches the gap"
        else:
            along, words = abs(shot.along), f"Shooting finds {KINDS[item.kind].words} at omega = {shot.omega_there:.9g}"
        if along <= tolerance:
            return verdict(shot.omega_there, max(shot.distance, along), True, words)
    try:
        check = verify_motion(item, tolerance)
    except ConvergenceError as failure:
        return verdict(math.nan, math.inf, False, f"Shooting failed: {failure}")
    omega = math.nan if check.solution is None else check.solution.omega
    return verdict(omega, check.distance, check.agrees, check.reason)


# ---------------------------------------------------------------------------------------- multiple shooting, in batches
@dataclass(frozen=True)
class Shot:
    """The true motion beside one of harmonic balance, if `converged`.

    A bifurcation lies `along` the curve of true motions from there, in units of the motion's size, at `omega_there`;
    nan where none of the kind lies within the distance that was looked at, or none was looked for.
    """

    converged: bool
    distance: float
    state: Array
    omega: float
    multipliers: ComplexArray
    errors: Array
    along: float
    omega_there: float


class Shots:
    """Multiple shooting from motions of one curve, which have one period.

    Its differences take four trajectories for every coordinate and piece: projected structures, with dozens of
    coordinates, are shot at once over the period, at the motion's frequency.
    """

    def __init__(self, orbits: Sequence[PeriodicOrbit], workers: int | None = None) -> None:
        self.system = system_of_motions(orbits)
        self.shooting = MultipleShooting(self.system, orbits[0].basis.nu, workers)
        self.projected = isinstance(self.system, ProjectedSystem)

    def motions(
        self, orbits: Sequence[PeriodicOrbit], kinds: Sequence[str] = (), reach: float | None = None
    ) -> Iterator[Shot]:
        """The true motions beside these; where bifurcations of these kinds lie within `reach` on either side."""
        if self.projected:
            yield from map(self._single, orbits)
            return
        count = self.shooting.at_once
        for begin in range(0, len(orbits), count):
            end = begin + count
            yield from self._batch(orbits[begin:end], kinds[begin:end], reach)

    def _single(self, orbit: PeriodicOrbit) -> Shot:
        start = self.system.reduced(orbit.start())
        try:
            found = shoot(self.system, start, orbit.omega, orbit.basis.nu, orbit.values)
        except ConvergenceError:
            none = np.zeros(0, dtype=complex)
            return Shot(False, math.inf, start, orbit.omega, none, none.real, math.nan, math.nan)
        distance = distance_of(self.system, orbit, start, found)
        doubt = np.full(len(found.multipliers), found.residual)
        return Shot(True, distance, found.state, found.omega, found.multipliers, doubt, math.nan, found.omega)

    def _batch(self, orbits: Sequence[PeriodicOrbit], kinds: Sequence[str], reach: float | None) -> list[Shot]:
        states, omega, parameters, sizes = self._starts(orbits)
        middle = self.shooting.solve(states, omega, parameters, sizes)
        multipliers, errors = middle.multipliers()
        distance = np.max(np.abs(middle.states - states) / sizes[:, None, :], axis=(1, 2))
        distance = np.maximum(distance, np.abs(middle.omega - omega) / omega)
        places = [(math.nan, float(there)) for there in middle.omega]
        if reach is not None:
            t = np.where(np.isfinite(middle.tangent), middle.tangent, 0.0)
            sides = []
            for way in (-reach, reach):
                y = middle.states + way * t[:, :-1].reshape(states.shape) * sizes[:, None, :]
                sides.append(self.shooting.solve(y, middle.omega * (1.0 + way * t[:, -1]), parameters, sizes, along=t))
            places = [_place(kind, [sides[0], middle, sides[1]], b, reach) for b, kind in enumerate(kinds)]
        return [
            Shot(bool(middle.converged[b]), float(distance[b]), middle.states[b, 0], float(middle.omega[b]),
                 multipliers[b], errors[b], *place)
            for b, place in enumerate(places)
        ]  # fmt: skip

    def _starts(self, orbits: Sequence[PeriodicOrbit]) -> tuple[Array, Array, dict[str, Array], Array]:
        share = np.arange(self.shooting.pieces) / self.shooting.pieces
        states, sizes = [], []
        for orbit in orbits:
            t = share * orbit.period
            states.append(self.system.reduced(np.hstack([orbit.displacement(t).T, orbit.velocity(t).T])))
            x, v = largest_of(orbit, self.system)
            # a motion at rest has no size of its own
            sizes.append(np.repeat([x or 1.0, v or orbit.omega], self.system.n))
        values = {name: np.array([orbit.values[name] for orbit in orbits]) for name in self.system.parameters}
        parameters = {name: own for name, own in values.items() if (own != self.system.parameters[name]).any()}
        return np.array(states), np.array([o.omega for o in orbits]), parameters, np.array(sizes)


def _place(kind: str, at: list[ShotMotions], b: int, reach: float) -> tuple[float, float]:
    """Where the test function of a kind vanishes along the curve, and omega there; nan where it keeps its sign."""
    if not all(motions.converged[b] for motions in at):
        return math.nan, math.nan
    values = [_test(kind, motions, b) for motions in at]
    if kind == "NS":
        values = _pair(values)
    if not values[0] * values[2] < 0.0:
        return math.nan, math.nan
    # a parabola through the three, and where it vanishes between the sides
    c, a, d = (float(value) for value in np.polyfit((-1.0, 0.0, 1.0), values, 2))
    roots = np.roots([c, a, d]) if c != 0.0 else np.array([-d / a])
    inside = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and abs(root.real) <= 1.0]
    share = min(inside, key=abs) if inside else 0.0
    bend = np.polyfit((-1.0, 0.0, 1.0), [float(motions.omega[b]) for motions in at], 2)
    return reach * share, float(np.polyval(bend, share))


def _test(kind: str, motions: ShotMotions, b: int) -> Any:
    """What changes its sign at a bifurcation; of a Neimark-Sacker point all multipliers of pairs."""
    monodromy = motions.monodromy[b]
    if kind == "LP":
        return float(motions.tangent[b, -1])
    if kind == "BP":
        return float(motions.border[b])
    if kind == "PD":
        return float(np.linalg.det(monodromy + np.eye(len(monodromy))))
    multipliers = np.linalg.eigvals(monodromy)
    return multipliers[multipliers.imag > 1e-9 * np.abs(multipliers)]


def _pair(pairs: list[Any]) -> list[float]:
    """|mu|^2 - 1 of the pair that is nearest to the unit circle in the middle, followed to either side."""
    if not all(map(len, pairs)):
        return [1.0, 1.0, 1.0]
    own = pairs[1][np.argmin(np.abs(np.abs(pairs[1]) - 1.0))]
    return [float(abs(solved[np.argmin(np.abs(solved - own))]) ** 2 - 1.0) for solved in pairs]


@overload
def verify(
    what: PeriodicOrbit | BranchPoint | Bifurcation, tolerance: float = 1e-3, *, seconds: float | None = None
) -> Verification: ...
@overload
def verify(
    what: Branch,
    tolerance: float = 1e-3,
    *,
    points: int | Iterable[int] | None = None,
    every: int = 1,
    bifurcations: bool = True,
    workers: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> BranchVerification: ...
@limited
def verify(
    what: PeriodicOrbit | BranchPoint | Bifurcation | Branch,
    tolerance: float = 1e-3,
    *,
    points: int | Iterable[int] | None = None,
    every: int = 1,
    bifurcations: bool = True,
    workers: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> Verification | BranchVerification:
    """Contradict a motion, a located bifurcation, or all of a branch, by shooting from the states at t = 0.

    Parameters
    ----------
    what
        A motion; a `Bifurcation` is located again by shooting, with free omega; at a grazing the motion found at the
        same omega must just reach the gap. Of a `Branch` every point and every bifurcation is held against the curve of
        true motions, found by multiple shooting; the answer is a `BranchVerification`.
    tolerance
        Relative distance up to which two motions, and two frequencies, count as the same. Verdicts that differ where
        the true multiplier lies so near to the unit circle are not compared.
    points, every
        Of a branch: how many points, spread over it, or their indices; or every so many-th. Default all.
    bifurcations
        Of a branch: whether its bifurcations are confirmed too.
    workers, progress
        Of a branch: threads (default: one for each processor); True for a bar, or a callable (share, text). Ctrl-C
        keeps what is done.
    seconds
        Time limit: of a branch what is done by then is given; a single motion raises a TimeLimitError.

    Raises
    ------
    InputError
        If an element of a large structure does not say by directions where it acts.

    A structure that harmonic balance projects (more than 40 degrees of freedom, few of which forces act on) is
    integrated in the basis which the motion was solved in: the same equation of motion. How far that is from the whole
    structure is printed with the result; multipliers are those of the projection.

    A bifurcation is looked for within a hundred tolerances along the curve of true motions, and given up after 120
    passes through the motion with its tangent flow: `reason` says so.
    """
    if not (isinstance(tolerance, (int, float)) and 0.0 < tolerance < 1.0):
        raise InputError(f"tolerance must be a number between 0 and 1, not {tolerance!r}")
    if isinstance(what, Branch):
        return _verify_branch(what, tolerance, points, every, bifurcations, workers, progress)
    if points is not None or every != 1:
        raise InputError("points= and every= choose among the points of a branch; this is a single motion")
    return verify_motion(what, tolerance)
