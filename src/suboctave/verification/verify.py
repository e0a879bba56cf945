"""The verbs `stability` and `verify`: what the time domain says of a motion, a bifurcation or all of a branch.

A single motion or bifurcation is held against shooting from its states at t = 0. Of a branch every motion, every
verdict and every bifurcation is held against shooting in time: the true motion beside each point is found by
`timedomain.multiple_shooting` on the compiled flow (`verification.shots`), so that what counts is the distance to the
curve of true motions. A bifurcation is confirmed where its test function, computed in time, changes its sign along that
curve within the tolerance; where that does not show it, shooting of the bifurcation alone has the last word.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import partial
from operator import index
from typing import Any, overload

import numpy as np

from suboctave.arguments import Count, Positive, Progress, Share, checked
from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.continuation.linear import one_thread
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.floquet.methods import StabilityMethod, method_of
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption, limited
from suboctave.kinds import KINDS
from suboctave.model.projected import ProjectedSystem
from suboctave.progress import reporting
from suboctave.results.branch import Branch
from suboctave.results.modes import ON_CIRCLE, ModeCurve
from suboctave.verification.harmonics import left_out, up_to_harmonics
from suboctave.verification.motions import (
    LOCATED,
    Verification,
    distance_from_gap,
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
from suboctave.verification.shots import Shot, Shots


@checked
def stability(
    orbit: PeriodicOrbit | BranchPoint | Bifurcation, *, method: StabilityMethod | str | None = None
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
    if not len(branch):
        raise InputError("the branch has no points to verify")
    which = _chosen(len(branch), points, every)
    items = list(branch.bifurcations.met) if bifurcations else []
    shots = Shots(branch, [*(branch.points[i].orbit for i in which), *(item.orbit for item in items)], workers)
    checked: list[VerifiedPoint] = []
    confirmed: list[VerifiedBifurcation] = []
    whole = len(which) + 4 * len(items)
    interruption: Interruption | None = None
    with reporting(progress, "verifying") as report, one_thread():
        try:
            for i, shot in zip(which, shots.motions(range(len(which))), strict=True):
                if report is not None:
                    report(len(checked) / whole, f"{len(checked)} of {len(which)} points")
                checked.append(_judged(branch, i, shot, tolerance))
            quick = _quick(shots, branch, dict(enumerate(items, len(which))), tolerance)
            for done, item in enumerate(items):
                if report is not None:
                    report((len(which) + 4 * done) / whole, f"{item.kind} at omega = {item.omega:.6g}")
                own = quick.get(len(which) + done)
                confirmed.append(_confirmed(item, own, tolerance, branch.observe))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
    basis = shots.system.words if isinstance(shots.system, ProjectedSystem) else ""
    return BranchVerification(
        branch, tuple(checked), tuple(confirmed), tolerance, interruption is None, interruption, basis
    )


def _chosen(count: int, points: int | Iterable[int] | None, every: int) -> list[int]:
    """Indices of the points that are looked at."""
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
            raise InputError(f"points={shortened(points)}: give a number of points, or indices of a branch of {count}")
    return sorted({i % count for i in listed})


def _judged(branch: Branch, i: int, shot: Shot, tolerance: float) -> VerifiedPoint:
    """The verdict on one point."""
    point = branch.points[i]
    floquet, distance, multipliers = point.floquet, shot.distance, shot.multipliers
    stable, error, off, known, undecided = None, math.inf, math.inf, floquet.applicable, False
    computed = branch.stable_at(point)
    if not shot.converged:
        outcome, reason = OPEN, "Shooting did not converge from here"
        if distance > 100.0 * tolerance or not np.isfinite(distance):
            outcome, reason = DISAGREES, "Shooting finds no motion nearby"
        distance, multipliers = math.inf, multipliers[:0]
    else:
        deciding = branch.deciding(point, multipliers)
        margin = float(np.max(np.abs(multipliers[deciding]), initial=0.0)) - 1.0
        doubt = float(np.max(shot.errors[np.abs(multipliers) > 0.5], initial=0.0))
        stable = margin < (max(ON_CIRCLE, doubt) if isinstance(branch, ModeCurve) else 0.0)
        allowed = tolerance + 10.0 * (floquet.error + doubt) + 100.0 * distance
        if known:
            own = floquet.multipliers
            kept = branch.deciding(point, own)
            # critical ones that meet part like a root of what is missed
            meeting = pairing(own[~kept], multipliers[~deciding]) ** (np.count_nonzero(~kept) or 1)
            error = max(meeting, pairing(own[kept], multipliers[deciding], relative=True))
            off = max(meeting, pairing(own[kept], multipliers[deciding], True, floquet.errors[kept]))
            # one outside the circle by more than its error decides, whatever the others do
            outside = np.abs(own[kept]) - 1.0 > floquet.errors[kept]
            undecided = bool(floquet.open[kept].any() and not outside.any())
        if tolerance < distance <= left_out(point.orbit):
            outcome, reason = OPEN, up_to_harmonics(point.orbit, distance)
        elif distance > tolerance:
            outcome, reason = DISAGREES, f"Shooting converges to another motion (relative distance {distance:.1e})"
        elif isinstance(branch, ModeCurve) and branch.damped:
            stable, outcome, reason = None, AGREES, "The same motion, sustained by the same damping"
        elif not known:
            outcome, reason = OPEN, "The same motion; the branch leaves its stability open"
        elif computed != stable and abs(margin) <= max(tolerance, doubt):
            near = f"the largest multiplier lies {abs(margin):.1e} from the unit circle"
            outcome, reason = OPEN, f"The same motion; {near}, too close to compare stability"
        elif computed != stable and undecided:
            outcome, reason = (
                OPEN,
                "The same motion; a multiplier of harmonic balance lies within its error of the unit circle",
            )
        elif computed != stable:
            verdict = "stable" if stable else "unstable"
            outcome, reason = DISAGREES, f"By shooting it is {verdict}, by harmonic balance the opposite"
        elif off > allowed:
            outcome, reason = DISAGREES, f"Multipliers of shooting differ by {error:.1e}, stability is the same"
        else:
            outcome, reason = AGREES, "The same motion, the same stability"
    return VerifiedPoint(
        i, point.orbit.omega, point.orbit.amplitude(branch.observe), distance, multipliers, shot.errors, error,
        stable, computed if known else None, outcome, reason,
    )  # fmt: skip


def _quick(shots: Shots, branch: Branch, items: Mapping[int, Bifurcation], tolerance: float) -> dict[int, Shot]:
    """The true motions at bifurcations, by number: of those with a test function along the curve, and of contacts."""
    along: tuple[str, ...] = LOCATED
    if isinstance(branch, ModeCurve):
        # its limit points are turns of the energy
        along = ("BP", "PD", "extremum")
    elif shots.alone:
        along = (*LOCATED, "extremum")
    found: dict[int, Shot] = {}
    for kinds, reach in ((CONTACT_KINDS, None), (along, tolerance)):
        own = [which for which, item in items.items() if item.kind in kinds]
        found |= zip(own, shots.motions(own, [items[which].kind for which in own], reach), strict=True)
    return found


def _named(item: Bifurcation) -> str:
    return "extremum of omega" if item.kind == "extremum" else KINDS[item.kind].words


def _confirmed(item: Bifurcation, shot: Shot | None, tolerance: float, observe: int) -> VerifiedBifurcation:
    verdict = partial(VerifiedBifurcation, item.kind, item.omega, item.parameters, item.orbit.amplitude(observe))
    if shot is not None and shot.converged and shot.distance <= tolerance:
        if item.kind in CONTACT_KINDS:
            along = distance_from_gap(shot.system.moved_to(item.orbit.values), item, shot.state, shot.omega)
            words = "The same motion, which just reaches the gap"
        else:
            along, words = abs(shot.along), f"Shooting finds {_named(item)} at omega = {shot.omega_there:.9g}"
        if along <= tolerance:
            return verdict(shot.omega_there, max(shot.distance, along), True, words)
    if item.floquet.method == "none":
        return verdict(math.nan, math.inf, False, f"Shooting finds no {_named(item)} within the tolerance")
    try:
        check = verify_motion(item, tolerance)
    except ConvergenceError as failure:
        return verdict(math.nan, math.inf, False, f"Shooting failed: {failure}")
    omega = math.nan if check.solution is None else check.solution.omega
    return verdict(omega, check.distance, check.agrees, check.reason)


@overload
def verify(
    what: PeriodicOrbit | BranchPoint | Bifurcation, *, tolerance: Share = 1e-3, seconds: float | None = None
) -> Verification: ...
@overload
def verify(
    what: Branch,
    *,
    tolerance: Share = 1e-3,
    points: int | Iterable[int] | None = None,
    every: int = 1,
    bifurcations: bool = True,
    workers: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> BranchVerification: ...
@checked
@limited
def verify(
    what: PeriodicOrbit | BranchPoint | Bifurcation | Branch,
    *,
    tolerance: Share = 1e-3,
    points: int | Iterable[int] | None = None,
    every: Count = 1,
    bifurcations: bool = True,
    workers: Count | None = None,
    progress: Progress = None,
    seconds: Positive | None = None,
) -> Verification | BranchVerification:
    """Contradict a motion, a located bifurcation, or all of a branch, by shooting from the states at t = 0.

    Parameters
    ----------
    what
        A motion, at its omega, or with free omega where a multiplier may be +1; a `Bifurcation` is located again by
        shooting, with free omega; at a grazing the motion found at the same omega must just reach the gap. Of a
        `Branch` every point and every bifurcation is held against the curve of true motions, found by multiple
        shooting; the answer is a `BranchVerification`. Limit cycles are corrected with their parameter, motions of
        nonlinear modes with the artificial damping that keeps them going.
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
    if isinstance(what, Branch):
        return _verify_branch(what, tolerance, points, every, bifurcations, workers, progress)
    if points is not None or every != 1:
        raise InputError("points= and every= choose among the points of a branch; this is a single motion")
    if not bifurcations or workers is not None or progress:
        raise InputError("bifurcations=, workers= and progress= are those of a branch; this is a single motion")
    return verify_motion(what, tolerance)
