"""What a point of a nonlinear mode takes, beside a point of the response of the same system.

    python benchmarks/nonlinear_modes.py [repeats]

Everything counts that a verb does, divided by the points that it gives. Medians of alternating runs, one thread, warm.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import suboctave as so


def chain(n: int) -> so.System:
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return so.System(np.eye(n), 0.02 * stiffness, stiffness, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.2)])


def cases() -> dict[str, tuple[so.System, tuple[float, float], float]]:
    """Systems with the range of their response and the amplitude of the mode."""
    return {
        "Duffing": (so.library.duffing(c=0.05, alpha=1.0, F=0.3), (0.5, 3.0), 30.0),
        "2 masses": (chain(2), (0.5, 1.6), 2.0),
        "20 masses": (chain(20), (0.05, 0.4), 1.0),
    }


def per_point(work: Callable[[], so.Branch]) -> float:
    """Milliseconds."""
    start = time.process_time()
    branch = work()
    return 1e3 * (time.process_time() - start) / len(branch)


def main(repeats: int) -> None:
    print(f"{'case':<12}{'response':>14}{'conservative':>20}{'damped':>20}   ms a point, and ratio to the response")
    for name, (system, omega, amplitude) in cases().items():
        # of many undamped masses some is in resonance with every higher harmonic: there the rule asks for more and more
        for harmonics in (9, "adaptive") if system.n < 10 else (9,):
            works: list[Callable[[], so.Branch]] = [
                lambda s=system, w=omega, h=harmonics: so.frequency_response(s, w, harmonics=h)
            ]
            for damped in (False, True):
                works.append(
                    lambda s=system, a=amplitude, h=harmonics, d=damped: so.nonlinear_mode(
                        s, amplitude=(1e-2, a), damped=d, harmonics=h
                    )
                )
            times = np.array([[per_point(work) for work in works] for _ in range(repeats + 1)])[1:]
            response, *modes = np.median(times, axis=0)
            shown = "".join(f"{mode:>12.2f} ({mode / response:.2f})" for mode in modes)
            print(f"{name:<12}{response:>14.2f}{shown}   harmonics {harmonics}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
