"""Speed and accuracy of time integration, one core: steps per second of Newmark's method, time per period of the other.

    python benchmarks/integration.py

The reference oscillator, 320 trajectories from different states, 1000 steps per period. Seconds are of the processor,
the best of three; compilation is not in them. The error is that after ten periods, against integration with SciPy.
"""

from __future__ import annotations

import time

import numpy as np

import suboctave as so
from suboctave.timedomain import integrate
from suboctave.timedomain.flow import Flow

OMEGA, STEPS, PERIODS, TRAJECTORIES = 2.3, 1000, 40, 320


def seconds(flow: Flow, states: np.ndarray) -> float:
    """Best of three."""
    flow.over(states, OMEGA, 1, workers=1)
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        flow.over(states, OMEGA, PERIODS, skip=PERIODS, workers=1)
        best = min(best, time.process_time() - start)
    return best


def main() -> None:
    """Print the table."""
    states = np.random.default_rng(0).normal(size=(TRAJECTORIES, 2))
    end = 10 * 2.0 * np.pi / OMEGA
    print(f"{'law':18} {'method':10} {'us per period':>14} {'million steps/s':>16} {'largest error':>14}")
    for law, sharpness in (("exact", None), ("arctan, s = 3000", 3000.0)):
        system = so.library.reference_oscillator(regularization=sharpness)
        truth = np.array([integrate(system, x, (0.0, end), OMEGA, rtol=1e-13).end for x in states[:5]])
        for method in ("newmark", "accurate"):
            flow = Flow(system, method, steps_per_period=STEPS)
            error = np.abs(flow.over(states[:5], OMEGA, 10).end - truth).max()
            took = seconds(flow, states) / (TRAJECTORIES * PERIODS)
            rate = f"{STEPS / took / 1e6:16.0f}" if method == "newmark" else " " * 16
            print(f"{law:18} {method:10} {took * 1e6:14.1f} {rate} {error:14.1e}")


if __name__ == "__main__":
    main()
