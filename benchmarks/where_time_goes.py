"""Where the time of a response curve goes, point by point, and how far it is from compiled code.

The reference oscillator's curve is computed over and over while a timer looks at the call stack (every few
milliseconds of processor time, so that the code itself runs as always). Each look is booked on what is being done:
locating a bifurcation, Floquet multipliers, the audit, or the plain march (element forces, residual and Jacobian,
factorisation, Newton's method and stepping, bookkeeping).

The limit: a Newton iteration of the same problem (15 harmonics, 256 samples) took 5.7 us in compiled C, a monodromy
matrix 8.5 us, on a machine on which the eigenvalues of a 62 x 62 matrix take 478 us; the table scales both by the
eigenvalues timed here.

    python benchmarks/where_time_goes.py [seconds per case]        (Linux and macOS)
"""

from __future__ import annotations

import signal
import sys
import time
from collections import Counter
from types import FrameType

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

#: what a look is booked on: the first line whose file is anywhere on the stack
PLACES = (
    ("located bifurcations", ("curves/events/monitors", "curves/events/locate", "bifurcation/bordered")),
    ("Floquet multipliers", ("stability/",)),
    ("audit of steps", ("analysis/guard", "analysis/audit", "analysis/crossings", "bifurcation/measures")),
    ("element forces", ("harmonic/group_force", "harmonic/local_force")),
    ("factorisations, solutions", ("continuation/linear",)),
    ("residual and Jacobian", ("harmonic/",)),
    ("Newton's method, stepping", ("continuation/",)),
    ("points, orbits, the rest", ("",)),
)
ITERATION, MONODROMY, EIGENVALUES = 5.7e-6, 8.5e-6, 478e-6


class Looks:
    """Counts where a running program is, by processor time."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def __call__(self, number: int, frame: FrameType | None) -> None:
        files = []
        while frame is not None:
            files.append(frame.f_code.co_filename.replace("\\", "/"))
            frame = frame.f_back
        for name, parts in PLACES:
            if any(f"suboctave/{part}" in file for part in parts for file in files):
                self.counts[name] += 1
                return


def yardstick() -> float:
    matrix = np.random.default_rng(0).standard_normal((62, 62))
    times = []
    for _ in range(60):
        start = time.process_time()
        np.linalg.eigvals(matrix)
        times.append(time.process_time() - start)
    return float(np.median(times))


def case(title: str, system: so.System, seconds: float) -> None:
    def run() -> so.Branch:
        return so.frequency_response(system, (4.5, 1.3))

    branch = run()
    looks = Looks()
    unit = yardstick()
    signal.signal(signal.SIGPROF, looks)
    signal.setitimer(signal.ITIMER_PROF, 1e-3, 1e-3)
    start, repeats = time.process_time(), 0
    while time.process_time() - start < seconds:
        run()
        repeats += 1
    spent = (time.process_time() - start) / repeats
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    unit = 0.5 * (unit + yardstick())
    points = len(branch)
    evaluations = 1.0 + float(np.mean([point.iterations for point in branch.points]))
    limit = (evaluations * ITERATION + MONODROMY) * unit / EIGENVALUES
    print(f"\n{title}: {points} points, {len(branch.bifurcations)} bifurcations, {1e3 * spent:.0f} ms, ", end="")
    print(f"{1e6 * spent / points:.0f} us per point = {spent / points / unit:.2f} eigenvalue problems of 62 x 62")
    total = sum(looks.counts.values())
    for name, _ in PLACES:
        share = looks.counts[name] / total
        print(f"    {name:<28} {1e6 * share * spent / points:7.0f} us per point  {share:6.1%}")
    print(
        f"    compiled limit: {evaluations:.1f} evaluations and a monodromy matrix, {1e6 * limit:.0f} us per point; "
        f"ratio {spent / points / limit:.1f}"
    )


def main(seconds: float) -> None:
    for title, law in (("exact law", {}), ("arctan law, s = 3000", {"regularization": 3000.0})):
        case(title, so.library.reference_oscillator(p=0.55, j=0.0, **law), seconds)


if __name__ == "__main__":
    with threadpool_limits(1):
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 5.0)
