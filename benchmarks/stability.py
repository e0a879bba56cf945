"""How long one call of each stability method takes on a solved motion, warm, on one thread.

Motions: the reference oscillator with exact stops (1 DOF), an absorber with cubic springs (2 DOFs), ten masses in a
row with a stop (10 DOFs), with 15 and 31 harmonics. Every call is made once to compile and fill caches, then REPEATS
times, all cases interleaved. Reported: median, and the same in units of the eigenvalues of a random 62 x 62 matrix
(NumPy) measured in between; the largest error estimate. "default" is what `so.stability(orbit)` does: the monodromy
matrix, and witnesses where it leaves the verdict open (here nowhere).

    python benchmarks/stability.py [repeats]
"""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

REPEATS = 5
METHODS = {
    "default": None,
    "monodromy": so.Monodromy(),
    "Hill": so.Hill(),
}


def ten_masses() -> so.System:
    n = 10
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stop = so.ElasticStop(dof=n - 1, stiffness=5.0, gap=0.5)
    return so.System(np.eye(n), 0.05 * stiffness, stiffness, [stop], [so.HarmonicLoad(dof=0, amplitude=1.0)])


def orbits() -> dict[str, so.PeriodicOrbit]:
    cases = {
        "n=1": (so.library.reference_oscillator(), (3.3, 3.2)),
        "n=2": (so.library.nltva(0.11), (0.9, 1.1)),
        "n=10": (ten_masses(), (0.6, 0.62)),
    }
    return {
        f"{name}, H={harmonics}": so.frequency_response(system, omega, harmonics=harmonics).orbits[-1]
        for name, (system, omega) in cases.items()
        for harmonics in (15, 31)
    }


def timed(work: Callable[[], object], least: float = 0.0) -> float:
    """Seconds per call; as many calls as fill `least` seconds."""
    calls, start = 0, time.perf_counter()
    while calls == 0 or time.perf_counter() - start < least:
        work()
        calls += 1
    return (time.perf_counter() - start) / calls


def main(repeats: int) -> None:
    motions = orbits()
    results = {(m, o): so.stability(orbit, method=METHODS[m]) for o, orbit in motions.items() for m in METHODS}
    matrix = np.random.default_rng(0).standard_normal((62, 62))
    unit: list[float] = []
    times: dict[tuple[str, str], list[float]] = {key: [] for key in results}
    for _ in range(repeats):
        for (m, o), spent in times.items():
            unit.append(timed(lambda: np.linalg.eigvals(matrix), 0.005))
            method, orbit = METHODS[m], motions[o]
            spent.append(timed(lambda method=method, orbit=orbit: so.stability(orbit, method=method), 0.01))
    eigvals = float(np.median(unit))
    print(
        f"suboctave {so.__version__}, Python {platform.python_version()}, NumPy {np.__version__}, {platform.machine()}"
    )
    print(f"{repeats} repeats, one thread, warm; eigvals of 62 x 62: {1e6 * eigvals:.0f} us\n")
    print(f"| {'method':<28} | {'motion':<10} | median ms | / eigvals 62 | error estimate |")
    print(f"|{'-' * 30}|{'-' * 12}|----------:|-------------:|---------------:|")
    for (m, o), spent in times.items():
        middle, result = float(np.median(spent)), results[m, o]
        error = f"{result.error:.1e}" if result.applicable else "n/a"
        print(f"| {m:<28} | {o:<10} | {1e3 * middle:9.2f} | {middle / eigvals:12.1f} | {error:>14} |")


if __name__ == "__main__":
    with threadpool_limits(1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS)
