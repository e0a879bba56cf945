"""What a new user waits for: the import, the first curve with nothing compiled, the first curves of later processes.

Later processes compile what the first left uncompiled, a few seconds each, so that they are shown one after another.
"Silence" is the longest time without a report of progress. Each number is the median of whole processes. "Nothing
compiled" means an empty folder for Numba's cache; the package's own bytecode and the operating system's file cache
are warm.

    python benchmarks/cold_start.py
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

IMPORTS, FIRST, LATER = 10, 2, 4
SOURCE = Path(__file__).resolve().parents[1] / "src"

IMPORT = "import suboctave"
NAMES = "import suboctave as so; so.System; so.frequency_response; so.library"
CURVE = "import suboctave as so; so.frequency_response(so.library.{case}, progress=lambda *_: seen.append(now()))"
CASES = (
    ("exact law", "reference_oscillator(), (4.5, 1.3)"),
    ("arctan law", "reference_oscillator(regularization=3000.0), (4.5, 1.3)"),
    ("two DOFs (NLTVA)", "nltva(0.11), (0.8, 1.3)"),
)
TIMED = """
from time import perf_counter as now
seen = [now()]
{statement}
seen.append(now())
print(seen[-1] - seen[0], max(b - a for a, b in zip(seen, seen[1:])))
"""


def inside(statement: str, environment: dict[str, str]) -> tuple[float, float, float]:
    """Seconds of a statement in a process of its own: by its own clock, the longest silence, and the whole process."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", TIMED.format(statement=statement)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    own, silence = map(float, done.stdout.split())
    return own, silence, time.perf_counter() - start


def report(title: str, runs: list[tuple[float, float, float]]) -> None:
    own, silence, whole = (statistics.median(run[i] for run in runs) for i in range(3))
    print(f"| {title:<48} | {own:8.3f} | {silence:7.3f} | {whole:8.3f} |", flush=True)


def main() -> None:
    base = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    base["PYTHONPATH"] = os.pathsep.join(filter(None, [str(SOURCE), base.get("PYTHONPATH", "")]))
    print(f"| {'':<48} | median s | silence | process  |\n|{'-' * 50}|----------|---------|----------|")
    inside(IMPORT, base)
    report("import suboctave", [inside(IMPORT, base) for _ in range(IMPORTS)])
    report("import, and the names of a first script", [inside(NAMES, base) for _ in range(IMPORTS)])
    for title, case in CASES:
        statement = CURVE.format(case=case)
        runs = []
        for _ in range(FIRST):
            with tempfile.TemporaryDirectory() as folder:
                runs.append([inside(statement, {**base, "NUMBA_CACHE_DIR": folder}) for _ in range(1 + LATER)])
        for number, same in enumerate(zip(*runs, strict=True)):
            report(f"{title}: {'first curve ever' if number == 0 else f'of a later process ({number})'}", list(same))


if __name__ == "__main__":
    main()
