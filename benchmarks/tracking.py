"""How long bifurcations tracked in two parameters take per point, warm, on one thread, and where the time goes.

Period doublings of the reference oscillator's T branch (motions of the load's period) and 2T branch, over its gap (j),
contact stiffness (Kc) and load (p), in both directions: all of it, with extrema and points of codimension two located,
and the points alone, tests for these among it. All cases run once, then REPEATS times, interleaved. Times are those of
the processor, so that a busy machine matters less: the least and the median of each, and both in units of the
eigenvalues of a 62 x 62 matrix timed in between. On a machine on which these take 478 us, 0.5 ms per point is a ratio
of 1.05 and 1.5 ms one of 3.14.

The median point: what half of a curve's points cost at most, each with the events behind it, the least of REPEATS runs.
A last run of each case counts the evaluations of the augmented equations and of their Jacobian.

    python benchmarks/tracking.py [repeats]
"""

from __future__ import annotations

import platform
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so
from suboctave.continuation import newton
from suboctave.curves.motion import MotionProblem
from suboctave.curves.tracked import events as tracked_events, follow as track_follow
from suboctave.results.branch import TrackedBranch

REPEATS = 7


def cases() -> dict[str, Callable[[], TrackedBranch]]:
    def doubling(p: float, **law: float) -> so.Bifurcation:
        system = so.library.reference_oscillator(p=p, **law)
        return so.frequency_response(system, (4.5, 1.3)).bifurcations["PD"][0]

    def tracked(item: so.Bifurcation, name: str, bounds: tuple[float, float]) -> Callable[[], TrackedBranch]:
        return lambda: so.track(item, name, bounds)

    exact, arctan = doubling(0.55), doubling(0.55, regularization=3000.0)
    doubled = so.switch_branch(doubling(1.7, regularization=3000.0)).bifurcations["PD"][0]
    found = {}
    for law, item in (("s=3000", arctan), ("exact", exact)):
        for name, bounds in (("j", (0.0, 1.0)), ("Kc", (1.0, 30.0)), ("p", (0.3, 2.0))):
            found[f"T, {law}, over {name}"] = tracked(item, name, bounds)
    found["2T, s=3000, over p"] = tracked(doubled, "p", (0.5, 2.0))
    found["2T, s=3000, over Kc"] = tracked(doubled, "Kc", (1.0, 30.0))
    return found


def nothing(*_: object) -> None:
    """In the place of what locates an event."""


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def between_points(work: Callable[[], object], repeats: int) -> Any:
    """Seconds from each point of a curve to the next, (points - 1,): the least of several runs."""
    own, stamps, runs = track_follow._Tracker._accept, [], []

    def accept(self: Any, point: Any) -> Any:
        try:
            return own(self, point)
        finally:
            stamps.append(time.process_time())

    with patch.object(track_follow._Tracker, "_accept", accept):
        for _ in range(repeats):
            stamps.clear()
            work()
            runs.append(np.diff(stamps))
    return np.min(runs, axis=0)


def counted(work: Callable[[], object]) -> Counter[str]:
    """How often the augmented equations and their Jacobian are evaluated."""
    counts: Counter[str] = Counter()

    def counting(kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any) -> Any:
            counts[kind] += 1
            return function(*args)

        return called

    with ExitStack() as stack:
        for kind, owner, name in (
            ("evaluations", MotionProblem, "evaluate"),
            ("jacobians", newton, "bordered"),
        ):
            stack.enter_context(patch.object(owner, name, counting(kind, getattr(owner, name))))
        work()
    return counts


def main(repeats: int) -> None:
    matrix = np.random.default_rng(0).standard_normal((62, 62))
    work = cases()
    curves = {name: run() for name, run in work.items()}
    unit: list[float] = []
    times: dict[str, list[float]] = {name: [] for name in work}
    alone: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, run in work.items():
            unit += [seconds(lambda: np.linalg.eigvals(matrix)) for _ in range(20)]
            times[name].append(seconds(run))
            with patch.object(tracked_events, "located", nothing):
                alone[name].append(seconds(run))
    least, middle = min(unit), float(np.median(unit))
    print(
        f"suboctave {so.__version__}, Python {platform.python_version()}, NumPy {np.__version__}, {platform.machine()}"
    )
    print(f"{repeats} repeats, one thread, warm; eigvals 62: least {1e6 * least:.0f} us, median {1e6 * middle:.0f} us")
    print("a point in ms and in units of the eigenvalues, of least and of median times\n")
    head = ("points", "events", "all, least    ", "all, median   ", "points, least ", "points, median")
    head = (*head, "median point", "evaluations/point", "Jacobians/point")
    print("| " + f"{'curve':<19}" + " | " + " | ".join(head) + " |")
    print("|" + "-" * 21 + "|" + "".join("-" * (len(title) + 1) + ":|" for title in head))
    for name, curve in curves.items():
        n, counts = len(curve), counted(work[name])
        row = [f"{n}", f"{len(curve.bifurcations)}"]
        for taken in (times, alone):
            for value, by in ((min(taken[name]), least), (float(np.median(taken[name])), middle)):
                row.append(f"{1e3 * value / n:.2f} ms = {value / n / by:.2f}")
        typical = float(np.median(between_points(work[name], repeats)))
        row.append(f"{1e3 * typical:.2f} ms")
        row += [f"{counts[kind] / n:.1f}" for kind in ("evaluations", "jacobians")]
        cells = [text.rjust(len(title)) for text, title in zip(row, head, strict=True)]
        print("| " + f"{name:<19}" + " | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    with threadpool_limits(1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS)
