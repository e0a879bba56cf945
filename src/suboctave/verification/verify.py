"""The verb `verify`: what the time domain says of a motion, a bifurcation or all of a branch."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, overload

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.points import BranchPoint
from suboctave.errors import InputError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import limited
from suboctave.results.branch import Branch
from suboctave.verification.branch import verify_branch
from suboctave.verification.motion import Verification, verify_motion
from suboctave.verification.result import BranchVerification

__all__ = ["verify"]


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
        If the orbit's unknowns are not all DOFs of its system (a condensed model has no state to shoot from).

    A bifurcation is looked for within a hundred tolerances along the curve of true motions, and given up after 120
    passes through the motion with its tangent flow: `reason` says so.
    """
    if not (isinstance(tolerance, (int, float)) and 0.0 < tolerance < 1.0):
        raise InputError(f"tolerance must be a number between 0 and 1, not {tolerance!r}")
    if isinstance(what, Branch):
        return verify_branch(what, tolerance, points, every, bifurcations, workers, progress)
    if points is not None or every != 1:
        raise InputError("points= and every= choose among the points of a branch; this is a single motion")
    return verify_motion(what, tolerance)
