"""How long the whole search for isolas takes, warm, on one thread, and what it finds.

The reference oscillator over its gap (arctan and exact law) and the tuned absorber over its load. Times are those of
the processor, the least and the median of REPEATS runs, also in units of the eigenvalues of a 62 x 62 matrix timed in
between. On a machine on which these take 478 us, 3 s are a ratio of 6276.

    python benchmarks/isolas.py [repeats]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

REPEATS = 5


def cases() -> dict[str, Callable[[], so.Isolas]]:
    arctan, exact = so.library.reference_oscillator(regularization=3000.0), so.library.reference_oscillator()
    absorber = so.library.nltva(F=0.11)
    return {
        "s=3000, over j": lambda: so.find_isolas(arctan, (1.3, 4.5), "j", (0.0, 1.0)),
        "exact, over j": lambda: so.find_isolas(exact, (1.3, 4.5), "j", (0.0, 1.0)),
        "NLTVA, over F": lambda: so.find_isolas(absorber, (0.7, 4.0), "F", (0.05, 0.25)),
    }


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def main(repeats: int) -> None:
    matrix = np.random.default_rng(0).standard_normal((62, 62))
    works = cases()
    found = {name: work() for name, work in works.items()}
    times: dict[str, list[float]] = {name: [] for name in works}
    yardstick = []
    for _ in range(repeats):
        for name, work in works.items():
            times[name].append(seconds(work))
            yardstick += [seconds(lambda: np.linalg.eigvals(matrix)) for _ in range(20)]
    unit = min(yardstick)
    print(f"{repeats} repeats, one thread, warm; eigvals 62: least {unit * 1e6:.0f} us\n")
    print("| search         | born     | merges   | least s | median s | least / eigvals |")
    print("|----------------|---------:|---------:|--------:|---------:|----------------:|")
    for name, isolas in found.items():
        (isola,) = isolas
        ends = " | ".join("        " if end is None else f"{float(end):.6f}" for end in (isola.born, isola.merges))
        least, median = min(times[name]), float(np.median(times[name]))
        print(f"| {name:<14} | {ends} | {least:7.2f} | {median:8.2f} | {least / unit:15.0f} |")


if __name__ == "__main__":
    with threadpool_limits(1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS)
