"""The three formulations of period doublings side by side: where they find them, in how many steps, in what time.

The two period doublings of the reference oscillator at p = 0.55, each from the motion 5e-3 above in omega, with fixed
numbers of harmonics. "By shooting" is the same place without harmonics; "off" is the distance from it. Times
are the shortest of 20. For "alcorta2019" also

- s(20), s(phase): smallest singular value of the published Jacobian (Eq. 20) at the solution, as printed and with the
  row of the phase condition below it; columns and rows are scaled by the unknowns' and equations' sizes;
- plain: steps of plain Newton iteration with Eq. 20 until the increment test (Eq. 22) with 1e-8 is met, of 50;
- misfit: distance of `exp(i omega t / 2) phi(t)` from the null vector of J_half, up to a complex factor.

    python benchmarks/formulations.py
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so
from suboctave.bifurcation.bordered import null_vectors
from suboctave.curves.events.alcorta import locate_doubling
from suboctave.curves.events.locate import Guess, Singular, locate_singular
from suboctave.curves.kinds.extended import ExtendedOperator
from suboctave.harmonic.perturbation import Kind

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from published import equations, jacobian, published_vector

REPEATS, STEPS, AWAY = 20, 50, 5e-3
#: positions by shooting
EXACT = (2.2937534169, 3.9697105128)
SHARP = (2.3031529690, 3.9934523291)
CASES = [("exact law", None, h, EXACT) for h in (7, 15, 31, 63)] + [("s = 3000", 3000.0, 63, SHARP)]


def start(regularization: float | None, harmonics: int, omega: float) -> Guess:
    """The motion some way above a period doubling."""
    system = so.library.reference_oscillator(p=0.55, regularization=regularization)
    orbit = so.frequency_response(system, (omega + 2.0 * AWAY, omega + AWAY), harmonics=harmonics).orbits[-1]
    return Guess(orbit.state(), "omega", 3.2)


def timed(solve: Callable[[], Any]) -> tuple[Any, float]:
    """What was found, and the shortest time in ms."""
    found, times = solve(), []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        solve()
        times.append(1e3 * (time.perf_counter() - begin))
    return found, min(times)


def singular_values(found: Singular) -> tuple[float, float]:
    """Smallest singular value of Eq. 20 at a solution, as it stands and with the phase condition."""
    state, n = found.state, found.state.balance.dimension
    phi, q, _ = published_vector(state)
    matrix = jacobian(state, phi, q)
    scale = state.omega**2
    matrix[: 3 * n] /= scale
    phase = np.zeros((1, 3 * n + 1))
    phase[0, n : 2 * n] = q
    printed, completed = (np.linalg.svd(m, compute_uv=False)[-1] for m in (matrix, np.vstack((matrix, phase))))
    return float(printed), float(completed)


def plain(guess: Guess, found: Singular, tolerance: float = 1e-8) -> str:
    """Steps of plain Newton iteration with Eq. 20 from the guess, or "never" and its smallest increment."""
    balance, n = guess.state.balance, guess.state.balance.dimension
    x, omega, (phi, q, b) = guess.state.unknowns.copy(), guess.state.omega, published_vector(found.state)
    least = np.inf
    for step in range(1, STEPS + 1):
        state = balance.at(x, omega)
        change = np.linalg.solve(jacobian(state, phi, q), equations(state, phi, q, b))
        size = np.linalg.norm(np.concatenate((x, phi.real, phi.imag, [omega])))
        x, omega = x - change[:n], omega - float(change[-1])
        phi = phi - change[n : 2 * n] - 1j * change[2 * n : 3 * n]
        increment = float(np.linalg.norm(change) / size)
        least = min(least, increment)
        if increment < tolerance:
            return f"{step}"
        if not 0.0 < omega < 10.0:
            return f"left at {step} ({least:.0e})"
    return f"never ({least:.0e})"


def misfit(found: Singular) -> float:
    """Relative distance of the two null vectors as functions of time, best complex factor."""
    state, (phi, _, _) = found.state, published_vector(found.state)
    half = null_vectors(state, Kind.HALF).right
    tau = np.linspace(0.0, 2.0 * np.pi, 512, endpoint=False)
    high = state.basis.harmonics
    k = np.arange(1, high + 1)[:, None]
    phi = phi[0] + phi[1::2] @ np.cos(k * tau) + phi[2::2] @ np.sin(k * tau)
    published = np.exp(0.5j * tau) * phi
    k = np.arange(high + 1)[:, None] + 0.5
    real = half[::2] @ np.cos(k * tau) + half[1::2] @ np.sin(k * tau)
    factor = np.vdot(real, published) / np.vdot(real, real)
    return float(np.linalg.norm(published - factor * real) / np.linalg.norm(published))


def main() -> None:
    print("| law | H | by shooting | formulation | omega | off | steps | ms | s(20) | s(phase) | plain | misfit |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for law, regularization, harmonics, places in CASES:
        for omega in places:
            guess = start(regularization, harmonics, omega)
            published = locate_doubling(guess)
            bare, completed = singular_values(published)
            more = f"| {bare:.0e} | {completed:.2f} | {plain(guess, published)} | {misfit(published):.0e} |"
            for name, solve, extra in (
                ("bordered", lambda g=guess: locate_singular(g, Kind.HALF), "| | | | |"),
                ("extended", lambda g=guess: locate_singular(g, Kind.HALF, ExtendedOperator), "| | | | |"),
                ("alcorta2019", lambda g=guess: locate_doubling(g), more),
            ):
                found, ms = timed(solve)
                at = found.state.omega
                row = f"{name} | {at:.10f} | {at - omega:+.1e} | {found.iterations} | {ms:.1f}"
                print(f"| {law} | {harmonics} | {omega:.10f} | {row} {extra}", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
