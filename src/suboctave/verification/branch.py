"""`verify` of a whole branch: every motion, every verdict and every bifurcation held against shooting in time.

The true motion beside each point is found by `timedomain.multiple_shooting` on the compiled flow, with free frequency:
what counts is the distance to the curve of true motions. A bifurcation is confirmed where its test function, computed
in time, changes its sign along that curve within the tolerance; where that does not show it, `verify` of the
bifurcation alone has the last word."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import index
from typing import Any

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.continuation.linear import one_thread
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.result import FloquetResult
from suboctave.interruption import Interruption
from suboctave.kinds import KINDS
from suboctave.progress import reporting
from suboctave.results.branch import Branch
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.verification.motion import distance_from_gap, pairing, verify_motion
from suboctave.verification.result import (
    AGREES,
    DISAGREES,
    OPEN,
    BranchVerification,
    VerifiedBifurcation,
    VerifiedPoint,
)
from suboctave.verification.shots import LOCATED, Place, Shot, Shots

__all__ = ["verify_branch"]


def verify_branch(
    branch: Branch,
    tolerance: float,
    points: int | Iterable[int] | None,
    every: int,
    bifurcations: bool,
    workers: int | None,
    progress: Any,
) -> BranchVerification:
    """See `verification.verify`."""
    if isinstance(branch, TrackedBranch):
        raise InputError(
            "this is a curve of bifurcations in two parameters: take its points or its .bifurcations one by one"
        )
    if not len(branch):
        raise InputError("the branch has no points to verify")
    which = _chosen(len(branch), points, every)
    first = branch.points[0].orbit
    if first.coefficients.shape[1] != first.system.n:
        raise InputError("only motions with all DOFs of the system can be verified by shooting")
    shots = Shots(first, workers)
    checked: list[VerifiedPoint] = []
    confirmed: list[VerifiedBifurcation] = []
    items = list(branch.bifurcations.met) if bifurcations else []
    whole = len(which) + 4 * len(items)
    interruption: Interruption | None = None
    with reporting(progress, "verifying") as report, one_thread():
        try:
            for begin in range(0, len(which), shots.at_once):
                if report is not None:
                    report(begin / whole, f"{begin} of {len(which)} points")
                part = which[begin : begin + shots.at_once]
                for i, shot in zip(part, shots.motions([branch.points[i].orbit for i in part]), strict=True):
                    checked.append(_judged(branch, i, shot, tolerance))
            quick = _quick(shots, items, tolerance)
            for done, item in enumerate(items):
                if report is not None:
                    report((len(which) + 4 * done) / whole, f"{item.kind} at omega = {item.omega:.6g}")
                confirmed.append(_confirmed(item, quick.get(id(item)), tolerance, branch.observe))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
    return BranchVerification(branch, tuple(checked), tuple(confirmed), tolerance, interruption is None, interruption)


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
    floquet: FloquetResult = point.floquet
    known = floquet.applicable
    stable, error, multipliers = None, float("inf"), shot.multipliers
    if not shot.converged:
        outcome, reason = OPEN, "Shooting did not arrive at a motion from here"
        if shot.distance > 100.0 * tolerance or not np.isfinite(shot.distance):
            outcome, reason = DISAGREES, "Shooting finds no motion near: it leaves the place"
        multipliers = multipliers[:0]
    else:
        margin = float(np.max(np.abs(multipliers))) - 1.0
        doubt = float(np.max(shot.errors[np.abs(multipliers) > 0.5], initial=0.0))
        stable = margin < 0.0
        error = pairing(floquet.multipliers, multipliers, relative=True) if known else float("inf")
        allowed = tolerance + 10.0 * (floquet.error + doubt) + 100.0 * shot.distance
        if shot.distance > tolerance:
            outcome, reason = DISAGREES, f"Shooting arrives at another motion (relative distance {shot.distance:.1e})"
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
        i, point.orbit.omega, point.orbit.amplitude(branch.observe), shot.distance if shot.converged else float("inf"),
        multipliers, shot.errors, error, stable, floquet.stable if known else None, outcome, reason,
    )  # fmt: skip


def _quick(shots: Shots, items: Sequence[Bifurcation], tolerance: float) -> dict[int, Place]:
    """The places of those bifurcations that have a test function along the curve; of contacts the true motions."""
    located = [item for item in items if item.kind in LOCATED]
    places: dict[int, Place] = {}
    contacts = [item for item in items if item.kind in CONTACT_KINDS]
    for begin in range(0, len(contacts), shots.at_once):
        part = contacts[begin : begin + shots.at_once]
        for item, shot in zip(part, shots.motions([item.orbit for item in part]), strict=True):
            places[id(item)] = Place(shot, float("nan"), shot.omega)
    for begin in range(0, len(located), shots.at_once):
        part = located[begin : begin + shots.at_once]
        places_of_part = shots.places([item.orbit for item in part], [item.kind for item in part], tolerance)
        places |= {id(item): place for item, place in zip(part, places_of_part, strict=True)}
    return places


def _confirmed(
    item: Bifurcation,
    place: Place | None,
    tolerance: float,
    observe: int,
) -> VerifiedBifurcation:
    amplitude = item.orbit.amplitude(observe)

    def verdict(omega: float, distance: float, agrees: bool, reason: str) -> VerifiedBifurcation:
        place = (item.kind, item.omega, item.parameters, amplitude)
        return VerifiedBifurcation(*place, omega, distance, agrees, reason)

    if place is not None and place.shot.converged and place.shot.distance <= tolerance:
        if item.kind in CONTACT_KINDS:
            along = distance_from_gap(item, place.shot.state, place.omega)
            words = "The same motion, and it just reaches the gap"
        else:
            along, words = abs(place.along), f"Shooting finds {KINDS[item.kind].words} at omega = {place.omega:.9g}"
        if along <= tolerance:
            return verdict(place.omega, max(place.shot.distance, along), True, words)
    try:
        check = verify_motion(item, tolerance)
    except ConvergenceError as failure:
        return verdict(float("nan"), float("inf"), False, f"Shooting failed: {failure}")
    omega = float("nan") if check.solution is None else check.solution.omega
    return verdict(omega, check.distance, check.agrees, check.reason)
