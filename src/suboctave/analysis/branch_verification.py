"""`verify` of a whole branch: every motion, every verdict and every bifurcation held against shooting in time.

The true motion beside each point is found by multiple shooting on the compiled flow (`timedomain.multiple`), with free
frequency: what counts is the distance to the curve of true motions. A bifurcation is confirmed where its test
function, computed in time, changes its sign along that curve within the tolerance; where that does not show it,
`verify` of the bifurcation alone has the last word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.progress import reporting
from suboctave.analysis.shot_branch import LOCATED, Place, Shot, Shots
from suboctave.analysis.time_result import TimeResult
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.bifurcation import CONTACT_KINDS, KINDS, Bifurcation
from suboctave.continuation.linear import one_thread
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import ComplexArray
from suboctave.interruption import Interruption
from suboctave.stability import FloquetResult
from suboctave.store.columns import parameter_column

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

__all__ = ["BranchVerification", "VerifiedBifurcation", "VerifiedPoint", "verify_branch"]

AGREES, DISAGREES, OPEN = "agrees", "disagrees", "cannot tell"


@dataclass(frozen=True, eq=False)
class VerifiedPoint:
    """One point of a branch against the true motion beside it.

    Attributes
    ----------
    index, omega, amplitude
        Which point of the branch, and where it lies.
    distance
        Largest difference of the states at the instants of shooting, relative to the motion, or of the frequencies if
        larger; inf where no true motion was found.
    multipliers, errors
        (2n,): of the true motion over the response period, by falling modulus, and their estimated errors.
    multiplier_error
        Largest difference from those of the branch, paired, relative to those that are larger than one.
    stable, computed
        The verdict of the true motion, None without one, and that of the branch.
    outcome, reason
        "agrees", "disagrees" or "cannot tell", and why.
    """

    index: int
    omega: float
    amplitude: float
    distance: float
    multipliers: ComplexArray
    errors: Array
    multiplier_error: float
    stable: bool | None
    computed: bool | None
    outcome: str
    reason: str

    @property
    def margin(self) -> float:
        """Largest modulus of the true multipliers minus one."""
        return float(np.max(np.abs(self.multipliers))) - 1.0 if len(self.multipliers) else float("nan")

    @property
    def agrees(self) -> bool:
        """Whether it does, for certain."""
        return self.outcome == AGREES

    def __repr__(self) -> str:
        return (
            f"point {self.index} at omega = {self.omega:.8g}: {self.outcome}; distance {self.distance:.1e}, "
            f"multipliers {self.multiplier_error:.1e}. {self.reason}"
        )


@dataclass(frozen=True, eq=False)
class VerifiedBifurcation:
    """A bifurcation of a branch against shooting: its frequency in time, how far that is off, whether it is confirmed.

    `distance` is along the curve of true motions and from it, relative to the motion.
    """

    kind: str
    omega: float
    parameters: Mapping[str, float]
    amplitude: float
    true_omega: float
    distance: float
    agrees: bool
    reason: str

    def __repr__(self) -> str:
        said = "confirmed" if self.agrees else "NOT CONFIRMED"
        return f"{self.kind} at omega = {self.omega:.9g}: {said}; distance {self.distance:.1e}. {self.reason}"


@dataclass(frozen=True, eq=False)
class BranchVerification(TimeResult):
    """What shooting says of a branch.

    Attributes
    ----------
    points, bifurcations
        `VerifiedPoint` and `VerifiedBifurcation` of each that was looked at, in the order of the branch.
    complete
        False where an interruption left some out: `interruption`, Ctrl-C or a time limit.
    """

    branch: Branch
    points: tuple[VerifiedPoint, ...]
    bifurcations: tuple[VerifiedBifurcation, ...]
    tolerance: float
    complete: bool
    interruption: Interruption | None = None

    @property
    def agrees(self) -> bool:
        """Whether nothing was found to be wrong."""
        return not self.disagreements and all(found.agrees for found in self.bifurcations)

    @property
    def disagreements(self) -> list[VerifiedPoint]:
        """The points at which the time domain contradicts."""
        return [point for point in self.points if point.outcome == DISAGREES]

    @property
    def undecided(self) -> list[VerifiedPoint]:
        """The points of which nothing can be told, each with its reason."""
        return [point for point in self.points if point.outcome == OPEN]

    @property
    def summary(self) -> str:
        """What was found, in a sentence or two."""
        bad, left = self.disagreements, self.undecided
        known = [point.distance for point in self.points if np.isfinite(point.distance)]
        text = f"{sum(point.agrees for point in self.points)} of {len(self.points)} points agree with shooting"
        if known:
            text += f" (largest distance {max(known):.1e})"
        if bad:
            text += f", {len(bad)} disagree{'s' * (len(bad) == 1)}, the first at omega = {bad[0].omega:.6g}"
        if left:
            text += f", of {len(left)} nothing can be told"
        confirmed = sum(found.agrees for found in self.bifurcations)
        if self.bifurcations:
            text += f"; {confirmed} of {len(self.bifurcations)} bifurcations are confirmed"
        return text + ("." if self.complete else f"; {self.interruption or Interruption()} before the end.")

    def to_xarray(self) -> xarray.Dataset:
        """Points and bifurcations with their outcomes; the branch itself is `branch.to_xarray()`."""
        from suboctave.analysis.saved_verification import verification_dataset

        return verification_dataset(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per point: distance, true multiplier that leads, errors, verdicts, outcome and reason."""
        import pandas as pd

        names = ("index", "omega", "amplitude", "distance", "multiplier_error", "stable", "computed", "outcome")
        more = ("multiplier_real", "multiplier_imag", "margin", "reason")
        rows = []
        name = self.branch.name
        free = {} if name == "omega" else {parameter_column(name, (*names, *more)): self.branch.parameter(name)}
        for point in self.points:
            leading = point.multipliers[0] if len(point.multipliers) else complex("nan")
            row = {name: getattr(point, name) for name in names} | {n: v[point.index] for n, v in free.items()}
            rows.append(row | {"multiplier_real": leading.real, "multiplier_imag": leading.imag, "margin": point.margin,
                               "reason": point.reason})  # fmt: skip
        columns = [*names[:2], *free, *names[2:], *more]
        return pd.DataFrame(rows, columns=columns)

    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation: kind, frequencies, distance, whether it is confirmed, why."""
        import pandas as pd

        names = ["kind", "omega", "amplitude", "true_omega", "distance", "agrees", "reason"]
        return pd.DataFrame([{name: getattr(b, name) for name in names} for b in self.bifurcations], columns=names)

    def plot(self, path: Any = None, **options: Any) -> Figure:
        """The branch with a mark on each point that was looked at: a tick, a cross where shooting disagrees.

        Options are those of `pictures.plot_verified`: `title`, `size`.
        """
        from suboctave.pictures.verified import plot_verified

        name = self.branch.name
        at = self.branch.parameter(name)
        places = np.array([(at[p.index], p.amplitude) for p in self.points]).reshape(-1, 2)
        wrong = [(b.parameters.get(name, b.omega), b.amplitude) for b in self.bifurcations if not b.agrees]
        outcomes = [point.outcome for point in self.points]
        return plot_verified(self.branch.to_xarray(), places, outcomes, np.array(wrong).reshape(-1, 2), path, **options)

    def __repr__(self) -> str:
        wrong = [*self.disagreements, *(b for b in self.bifurcations if not b.agrees)]
        lines = [f"BranchVerification: {self.summary}", *(f"  {one!r}" for one in wrong[:8])]
        if len(wrong) > 8:
            lines.append(f"  and {len(wrong) - 8} more")
        return "\n".join(lines)


def verify_branch(
    branch: Branch,
    tolerance: float,
    points: int | Iterable[int] | None,
    every: int,
    bifurcations: bool,
    workers: int | None,
    progress: Any,
    alone: Callable[[Bifurcation, float], Any],
    missed: Callable[[Bifurcation, Array, float], float],
) -> BranchVerification:
    """See `verification.verify`, which is `alone` for single bifurcations.

    `missed` is the distance by which a true motion, of a state and a frequency, misses the gap that it should graze.
    """
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
    looked: list[VerifiedPoint] = []
    found: list[VerifiedBifurcation] = []
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
                    looked.append(_judged(branch, i, shot, tolerance))
            quick = _quick(shots, items, tolerance)
            for done, item in enumerate(items):
                if report is not None:
                    report((len(which) + 4 * done) / whole, f"{item.kind} at omega = {item.omega:.6g}")
                found.append(_confirmed(item, quick.get(id(item)), tolerance, branch.observe, alone, missed))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
    return BranchVerification(branch, tuple(looked), tuple(found), tolerance, interruption is None, interruption)


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
    if not shot.found:
        outcome, reason = OPEN, "Shooting did not arrive at a motion from here"
        if shot.distance > 100.0 * tolerance or not np.isfinite(shot.distance):
            outcome, reason = DISAGREES, "Shooting finds no motion near: it leaves the place"
        multipliers = multipliers[:0]
    else:
        margin = float(np.max(np.abs(multipliers))) - 1.0
        doubt = float(np.max(shot.errors[np.abs(multipliers) > 0.5], initial=0.0))
        stable = margin < 0.0
        error = _pairing(floquet.multipliers, multipliers) if known else float("inf")
        allowed = tolerance + 10.0 * (floquet.error + doubt) + 100.0 * shot.distance
        if shot.distance > tolerance:
            outcome, reason = DISAGREES, f"Shooting arrives at another motion (relative distance {shot.distance:.1e})"
        elif not known:
            outcome, reason = OPEN, "The same motion; the branch has no verdict here"
        elif floquet.stable != stable and abs(margin) <= max(tolerance, doubt):
            outcome, reason = (
                OPEN,
                (
                    f"The same motion; the largest multiplier lies {abs(margin):.1e} from the unit circle, too near to "
                    "compare verdicts"
                ),
            )
        elif floquet.stable != stable:
            said = "stable" if stable else "unstable"
            outcome, reason = DISAGREES, f"Shooting calls it {said}, harmonic balance the opposite"
        elif error > allowed:
            outcome, reason = DISAGREES, f"Shooting finds other multipliers (off by {error:.1e}) with the same verdict"
        else:
            outcome, reason = AGREES, "The same motion, the same verdict"
    return VerifiedPoint(
        i, point.orbit.omega, point.orbit.amplitude(branch.observe), shot.distance if shot.found else float("inf"),
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
        found = shots.places([item.orbit for item in part], [item.kind for item in part], tolerance)
        places |= {id(item): place for item, place in zip(part, found, strict=True)}
    return places


def _confirmed(
    item: Bifurcation,
    place: Place | None,
    tolerance: float,
    observe: int,
    alone: Callable[[Bifurcation, float], Any],
    missed: Callable[[Bifurcation, Array, float], float],
) -> VerifiedBifurcation:
    amplitude = item.orbit.amplitude(observe)
    if place is not None and place.shot.found and place.shot.distance <= tolerance:
        if item.kind in CONTACT_KINDS:
            along, words = missed(item, place.shot.state, place.omega), "The same motion, and it just reaches the gap"
        else:
            along, words = abs(place.along), f"Shooting finds {KINDS[item.kind]} at omega = {place.omega:.9g}"
        if along <= tolerance:
            return VerifiedBifurcation(
                item.kind, item.omega, item.parameters, amplitude, place.omega, max(place.shot.distance, along), True,
                words,
            )  # fmt: skip
    try:
        check = alone(item, tolerance)
    except ConvergenceError as failure:
        return VerifiedBifurcation(
            item.kind,
            item.omega,
            item.parameters,
            amplitude,
            float("nan"),
            float("inf"),
            False,
            f"Shooting failed: {failure}",
        )
    omega = float("nan") if check.solution is None else check.solution.omega
    return VerifiedBifurcation(
        item.kind, item.omega, item.parameters, amplitude, omega, check.distance, check.agrees, check.reason
    )


def _pairing(computed: ComplexArray, true: ComplexArray) -> float:
    """Largest difference under the best pairing, relative where multipliers are larger than one."""
    from scipy.optimize import linear_sum_assignment

    cost = np.abs(computed[:, None] - true[None, :]) / np.maximum(1.0, np.abs(true))[None, :]
    rows, columns = linear_sum_assignment(cost)
    return float(cost[rows, columns].max())
