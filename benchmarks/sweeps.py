"""How much faster a sweep is on several processes than on one, start-up included.

    python benchmarks/sweeps.py [points] [workers ...]

Every point is the response of the rattling oscillator at another load. Ratios mean something on idle cores only.
"""

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
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    counts = [int(text) for text in sys.argv[2:]] or sorted({1, 2, processors()})
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(STUDY)
        alone = 0.0
        for workers in counts:
            begin = time.perf_counter()
            sweep = so.sweep(study, {"p": {"from": 0.5, "to": 1.0, "count": points}}, workers=workers)
            seconds = time.perf_counter() - begin
            alone = alone or seconds
            computing = float(sweep["seconds"].sum())
            print(
                f"{workers} workers: {seconds:.2f} s, of computing {computing:.2f} s, {alone / seconds:.2f} times as "
                f"fast as {counts[0]}; {len(sweep.failures)} failures"
            )


if __name__ == "__main__":
    main()
