"""How much faster a sweep is on several processes than on one, start-up included.

    python benchmarks/sweeps.py [points] [workers ...]

Every point is the response of the rattling oscillator at another load, a sixth of a second; a process takes some two
seconds to start. Ratios of times mean something on idle cores only. That of the processor times of each process is
what idle cores would give at best.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import suboctave as so
from suboctave.workers import processors

STUDY = """
[system]
library = "reference_oscillator"
parameters = { p = 0.55, j = 0.0 }
[[analyses]]
name = "response"
type = "frequency_response"
omega = [4.5, 1.3]
harmonics = 15
"""


def main() -> None:
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 240
    counts = [int(text) for text in sys.argv[2:]] or sorted({1, 2, processors()})
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(STUDY)
        alone = least = 0.0
        for workers in counts:
            begin, before = time.perf_counter(), children()
            sweep = so.sweep(study, {"p": {"from": 0.5, "to": 1.0, "count": points}}, workers=workers)
            seconds = time.perf_counter() - begin
            each = (children() - before) / workers
            alone, least = alone or seconds, least or each
            print(
                f"{workers} workers: {seconds:.2f} s, {alone / seconds:.2f} times as fast as {counts[0]}; processor "
                f"{each:.2f} s each, {least / each:.2f} times; {len(sweep.failures)} failures"
            )


def children() -> float:
    """Processor time of all processes that have ended."""
    times = os.times()
    return times.children_user + times.children_system


if __name__ == "__main__":
    main()
