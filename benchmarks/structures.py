"""What a structure costs over its size: chains of masses and clamped plates with stops, each in a process of its own.

    python benchmarks/structures.py              chains, and plates of 1 000 and 10 000 degrees of freedom
    python benchmarks/structures.py --large      also the plate of 100 000
    python benchmarks/structures.py --tracks     also a doubling on the plates, its branch and its border

Columns: degrees of freedom, what holds it, seconds until the linear part is ready (without assembly, compiling, and the
direct solution that tells the error), the highest memory of the process in GB, modes of the projection, error of its
flexibility at (H + 1/2) omega_max against a direct solution of the whole structure, points of a response with stability
and events, milliseconds for each point (of the processor, the best of three runs), and how many events were located.
Fifteen harmonics, one thread of linear algebra. Ratios within one run count: the first line is one mass.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time

import numpy as np
import scipy.sparse as sp
from threadpoolctl import threadpool_limits

import suboctave as so

HARMONICS = 15
_MESHES = {1_000: (20, 12), 10_000: (64, 38), 100_000: (204, 122)}


def chain(n: int, kind: str) -> tuple[so.System, tuple[float, float]]:
    """Equal masses, the first held, the last with a stop or a spring and the load; the first frequency is 1."""
    stiffness = sp.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1]).tolil()
    stiffness[n - 1, n - 1] = 1.0
    angle = 0.5 * np.pi / (n + 0.5)
    stiffness = stiffness.tocsr() / (2.0 * np.sin(0.5 * angle)) ** 2
    tip = np.sin(angle * n) ** 2 / np.sum(np.sin(angle * np.arange(1, n + 1)) ** 2)
    mass = tip * sp.eye_array(n).tocsr()
    element = so.ElasticStop(n - 1, 1.0, 0.5) if kind == "stop" else so.CubicSpring(n - 1, 0.3)
    stiffness = tip * stiffness
    system = so.System(mass, 0.02 * mass + 0.002 * stiffness, stiffness, [element], [so.HarmonicLoad(n - 1, 0.05)])
    return system, (1.3, 0.8)


def plate(n: int, stops: int) -> tuple[so.System, tuple[float, float]]:
    """The clearance plate of the library."""
    nx, ny = _MESHES[n]
    return so.structures.clearance_plate(nx, ny, stops=stops), (2.8, 2.0)


def measured(family: str, n: int, kind: str, tracks: bool) -> str:
    """One line of the table."""
    system, omega = chain(n, kind) if family == "chain" else plate(n, int(kind))
    warm = so.library.reference_oscillator(p=0.55, j=0.0)
    so.frequency_response(warm, (2.4, 2.2), harmonics=HARMONICS)
    start = time.perf_counter()
    linear = so.condense(system, omega, harmonics=HARMONICS)
    ready = time.perf_counter() - start
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        branch = so.frequency_response(system, omega, harmonics=HARMONICS, linear=linear)
        best = min(best, time.process_time() - start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    modes, error = len(linear.equation_of_motion()[0]), getattr(linear, "error", 0.0)
    line = (
        f"{family:<6}{system.n:>8} {kind:<6}{ready:>8.2f} s{memory:>7.2f} GB{modes:>6}{error:>10.1e}{len(branch):>7}"
        f"{1e3 * best / len(branch):>8.2f} ms{len(branch.bifurcations):>5}"
    )
    return line + (_tracks(branch) if tracks else "")


def _tracks(branch: so.Branch) -> str:
    """A period doubling, the branch of twice the period, its border over the gap, and isolas."""
    out, doublings = [], branch.bifurcations["PD"]
    if not doublings:
        return "\n    no period doubling"
    start = time.perf_counter()
    doubled = so.switch_branch(doublings[0], max_step=0.2)
    out.append(f"2T: {len(doubled)} points, {time.perf_counter() - start:.1f} s")
    start = time.perf_counter()
    border = so.track(doublings[0], "gap", (0.09, 0.2))
    out.append(f"border: {len(border)} points, {time.perf_counter() - start:.1f} s")
    farthest = max(border.parameter("gap"))
    out.append(f"PD at omega = {doublings[0].omega:.9f}, largest gap on its border {farthest:.9f}")
    return "".join(f"\n    {line}" for line in out)


def main() -> None:
    """Print the table, a process for every line."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--large", action="store_true")
    arguments.add_argument("--tracks", action="store_true")
    arguments.add_argument("--row", nargs=3, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    if given.row:
        family, n, kind = given.row
        with threadpool_limits(1):
            print(measured(family, int(n), kind, given.tracks), flush=True)
        return
    rows = [("chain", n, kind) for kind in ("stop", "cubic") for n in (1, 10, 50, 200, 1000)]
    sizes = [n for n in _MESHES if given.large or n < 100_000]
    rows += [("plate", n, stops) for stops in ("1", "2", "5") for n in sizes]
    print("                      ready   memory modes  error    points  a point  events")
    for row in rows:
        flags = ["--tracks"] if given.tracks and row[0] == "plate" and row[2] == "1" else []
        subprocess.run([sys.executable, __file__, "--row", *map(str, row), *flags], check=False)


if __name__ == "__main__":
    main()
