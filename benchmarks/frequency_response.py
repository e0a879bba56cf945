"""How long whole response curves take, with stability and located bifurcations, warm, on one thread.

Every case runs once to compile and fill caches, then REPEATS times; the cases are interleaved, so that a busy moment of
the machine hits all of them. Reported: median and spread (half the range between the quartiles), points, time per
point, and the latter in units of two yardsticks measured in between: eigenvalues of a random 62 x 62 matrix (NumPy) and
the solution of a 32 x 32 linear system (LAPACK's dgesv through SciPy). Ratios travel between machines better than
seconds.

    python benchmarks/frequency_response.py [repeats]
"""

from __future__ import annotations

import functools
import json
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.linalg import lapack
from threadpoolctl import threadpool_limits

import suboctave as so

REPEATS = 9
CHAIN = Path(__file__).resolve().parents[1] / "tests" / "data" / "chain.json"


def chain_of_ten() -> so.System:
    data = json.loads(CHAIN.read_text())
    n = data["masses"]
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    damping = data["damping"]["of_mass"] * np.eye(n) + data["damping"]["of_stiffness"] * stiffness
    stop = so.ElasticStop(dof=n - 1, stiffness=data["stop"]["stiffness"], gap=data["stop"]["gap"])
    return so.System(np.eye(n), damping, stiffness, [stop], [so.HarmonicLoad(dof=0, amplitude=data["force"])])


def cases() -> dict[str, Callable[[], so.Branch]]:
    exact = so.library.reference_oscillator(p=0.55, j=0.0)
    arctan = so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0)
    absorber, chain, duffing = so.library.nltva(0.11), chain_of_ten(), so.library.duffing()

    def response(system: so.System, omega: tuple[float, float], harmonics: int | str) -> Callable[[], so.Branch]:
        return lambda: so.frequency_response(system, omega, harmonics=harmonics)

    found = {}
    for law, system in (("exact", exact), ("s=3000", arctan)):
        for harmonics in ("adaptive", 15, 31):
            found[f"p=0.55, {law}, H {harmonics}"] = response(system, (4.5, 1.3), harmonics)
    for p in (0.55, 1.7):
        for law, sharpness in (("exact", None), ("s=3000", 3000.0)):
            curve = so.frequency_response(so.library.reference_oscillator(p=p, regularization=sharpness), (4.5, 1.3))
            found[f"2T branch, p={p:g}, {law}"] = functools.partial(so.switch_branch, curve.bifurcations["PD"][0])
    found["NLTVA, F=0.11"] = response(absorber, (0.8, 1.5), "adaptive")
    found["Duffing, F=1"] = response(duffing, (0.3, 6.0), "adaptive")
    found["10 masses, stop"] = response(chain, (0.4, 0.6), "adaptive")
    return found


def yardsticks() -> dict[str, Callable[[], object]]:
    rng = np.random.default_rng(0)
    large, small, right = rng.standard_normal((62, 62)), rng.standard_normal((32, 32)), rng.standard_normal(32)
    return {"eigvals 62": lambda: np.linalg.eigvals(large), "dgesv 32": lambda: lapack.dgesv(small, right)}


def timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def per_call(work: Callable[[], object], least: float = 0.02) -> float:
    """Seconds per call of something short: as many calls as fill `least` seconds."""
    calls, spent = 0, 0.0
    while spent < least:
        calls, spent = calls + 1, spent + timed(work)
    return spent / calls


def summary(values: list[float]) -> tuple[float, float]:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return float(middle), float(high - low) / 2.0


def main(repeats: int) -> None:
    work, sticks = cases(), yardsticks()
    branches = {name: run() for name, run in work.items()}
    times: dict[str, list[float]] = {name: [] for name in (*work, *sticks)}
    for _ in range(repeats):
        for name, stick in sticks.items():
            times[name].append(per_call(stick))
        for name, run in work.items():
            times[name].append(timed(run))
    print(
        f"suboctave {so.__version__}, Python {platform.python_version()}, NumPy {np.__version__}, {platform.machine()}"
    )
    print(f"{repeats} repeats, one thread, warm\n")
    units = {name: summary(times[name])[0] for name in sticks}
    for name in sticks:
        print(f"{name:<12} {1e6 * units[name]:8.1f} us  +- {1e6 * summary(times[name])[1]:.1f}")
    head = ("case", "points", "events", "median ms", "spread ms", "ms/point", *(f"point / {name}" for name in sticks))
    print("\n| " + f"{head[0]:<26}" + " | " + " | ".join(head[1:]) + " |")
    print("|" + "-" * 28 + "|" + "".join("-" * (len(title) + 1) + ":|" for title in head[1:]))
    for name, branch in branches.items():
        middle, spread = summary(times[name])
        point = middle / len(branch)
        row = [f"{len(branch)}", f"{len(branch.bifurcations)}", f"{1e3 * middle:.1f}", f"{1e3 * spread:.1f}"]
        row += [f"{1e3 * point:.3f}", *(f"{point / units[stick]:.2f}" for stick in sticks)]
        cells = [text.rjust(len(title)) for text, title in zip(row, head[1:], strict=True)]
        print("| " + f"{name:<26}" + " | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    with threadpool_limits(1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS)
