"""What a new user waits for: the import, the first curve with nothing compiled, the first curve of a later process.

Each number is the median of whole processes. "Nothing compiled" means an empty folder for Numba's cache; the package's
own bytecode and the operating system's file cache are warm.

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

IMPORTS, FIRST, LATER = 10, 3, 5
SOURCE = Path(__file__).resolve().parents[1] / "src"

IMPORT = "import suboctave"
NAMES = "import suboctave as so; so.System; so.frequency_response; so.library"
CURVE = "import suboctave as so; so.frequency_response(so.library.reference_oscillator({law}), (4.5, 1.3))"
TIMED = """
import time
start = time.perf_counter()
{statement}
print(time.perf_counter() - start)
"""


def inside(statement: str, environment: dict[str, str]) -> tuple[float, float]:
    """Seconds of a statement in a process of its own: by its own clock, and of the whole process."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", TIMED.format(statement=statement)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout), time.perf_counter() - start


def report(title: str, runs: list[tuple[float, float]]) -> None:
    own, whole = ([run[i] for run in runs] for i in (0, 1))
    spread = (max(own) - min(own)) / 2.0
    print(f"| {title:<48} | {statistics.median(own):8.3f} | {spread:7.3f} | {statistics.median(whole):8.3f} |")


def main() -> None:
    base = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    base["PYTHONPATH"] = os.pathsep.join(filter(None, [str(SOURCE), base.get("PYTHONPATH", "")]))
    print(f"| {'':<48} | median s | spread  | process  |\n|{'-' * 50}|----------|---------|----------|")
    inside(IMPORT, base)
    report("import suboctave", [inside(IMPORT, base) for _ in range(IMPORTS)])
    report("import, and the names of a first script", [inside(NAMES, base) for _ in range(IMPORTS)])
    for title, law in (("exact law", ""), ("arctan law", "regularization=3000.0")):
        statement = CURVE.format(law=law)
        first, later = [], []
        for _ in range(FIRST):
            with tempfile.TemporaryDirectory() as folder:
                environment = {**base, "NUMBA_CACHE_DIR": folder}
                first.append(inside(statement, environment))
                later += [inside(statement, environment) for _ in range(LATER)]
        report(f"first curve ever, {title} (compiles)", first)
        report(f"first curve of a later process, {title}", later)


if __name__ == "__main__":
    main()
