"""Do structures that nobody chose hold? Each result against shooting, or against the same computed another way.

    python benchmarks/random_structures.py [--seeds 0:100]

Networks of 5 to 46 masses are drawn from a seed (every fourth is large enough to be projected), with Rayleigh or modal
damping or a dashpot, and one to three stops, plays and springs where a mode moves. Followed at default options: the
response around that mode, branches from its first doublings and branch points, and its first limit point, doubling,
Neimark-Sacker point and grazing over the load. Responses and branches are verified by shooting; on the curves over the
load a point is looked for in a response at its own load.

Printed for each seed: masses, bifurcations of the response, seconds, and what does not agree. Not all of that is an
error: a response may have left its range before the point, or the point lies on an isola.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

#: seconds that one curve, or the verification of one, may take
PATIENCE = 60.0


def network(rng: np.random.Generator, n: int) -> tuple[Any, Any, Any, Any, Any]:
    """Mass, damping and stiffness (n, n), natural frequencies, the first of which is 1, and modes as columns."""
    mass, stiffness = rng.uniform(0.5, 1.5, n) / n, np.zeros((n, n))

    def tie(i: int, j: int, k: float) -> None:
        ends = np.zeros(n)
        ends[i] = 1.0
        if j >= 0:
            ends[j] = -1.0
        stiffness[...] += k * np.outer(ends, ends)

    for i in range(n):
        tie(i, i - 1 if i == 0 or rng.random() < 0.8 else int(rng.integers(0, i)), rng.uniform(0.5, 2.0))
    for _ in range(rng.integers(0, 3)):
        i, j = rng.choice(n, 2, replace=False)
        tie(int(i), int(j), 0.4 * rng.uniform(0.2, 1.0))
    root = np.sqrt(mass)
    squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
    stiffness /= squares[0]
    omega, modes, zeta = np.sqrt(squares / squares[0]), vectors / root[:, None], rng.uniform(0.005, 0.02)
    damping = zeta * (np.diag(mass) + 0.6 * stiffness)
    kind = rng.integers(0, 3)
    if kind == 1:
        damping = (root[:, None] * vectors) @ np.diag(2.0 * zeta * omega) @ (root[:, None] * vectors).T
    elif kind == 2:
        at = rng.integers(0, n)
        damping = zeta * (2.0 * np.diag(mass) + 0.1 * stiffness)
        damping[at, at] += 0.05 * n * mass[at] * rng.random()
    return np.diag(mass), damping, stiffness, omega, modes


def element(rng: np.random.Generator, place: Any, stiffness: float, size: float) -> Any:
    """Something that acts where displacements of a size come, about as stiff as the mode there."""
    k, gap = stiffness * rng.uniform(0.3, 3.0), size * rng.uniform(0.2, 0.6)
    choices: list[Callable[[], Any]] = [
        lambda: so.ElasticStop(place, k, gap),
        lambda: so.ElasticStop(place, k, -gap),
        lambda: so.ElasticStop(place, k, gap, regularization=40.0 / size),
        lambda: so.Freeplay(place, k, gap),
        lambda: so.CubicSpring(place, k / size**2),
        lambda: so.PolynomialSpring(place, {2: 0.3 * k / size, 3: k / size**2}),
    ]
    return choices[rng.choice(6, p=[0.4, 0.1, 0.15, 0.1, 0.15, 0.1])]()


def drawn(seed: int) -> tuple[so.System, tuple[float, float]]:
    """A structure with its load "F", and a range of omega around one of its first two modes."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(41, 47) if seed % 4 == 0 else rng.integers(5, 13))
    mass, damping, stiffness, omega, modes = network(rng, n)
    mode = int(rng.random() < 0.3)
    shape, w = modes[:, mode], omega[mode]
    tip = int(np.argmax(np.abs(shape)))
    load = next(dof for dof in (int(rng.integers(0, n)), tip) if abs(shape[dof]) >= 0.3 * abs(shape[tip]))
    # the linear peak at the tip is about 1
    force = (shape @ damping @ shape) * w / abs(shape[load] * shape[tip]) * rng.uniform(0.6, 1.5)
    modal = (w / shape[tip]) ** 2
    elements = [element(rng, tip, modal, 1.0)]
    for _ in range(rng.integers(0, 3)):
        i, j = (int(dof) for dof in rng.choice(n, 2, replace=False))
        pair = rng.random() < 0.3
        size = abs(shape[i] - (shape[j] if pair else 0.0)) / abs(shape[tip])
        if size > 0.2:
            elements.append(element(rng, (i, j) if pair else i, modal, size))
    system = so.System(mass, damping, stiffness, elements, [so.HarmonicLoad(load, "F")], {"F": force})
    low, high = w * rng.uniform(0.6, 0.8), w * rng.uniform(1.25, 1.5)
    return system, (high, low) if rng.random() < 0.5 else (low, high)


class Trial:
    """One structure, and what was found to disagree."""

    def __init__(self, seed: int) -> None:
        self.system, self.omega = drawn(seed)
        self.found: list[str] = []
        self.events = 0

    def attempt(self, name: str, work: Callable[[], Any]) -> Any:
        """The result of some work; None where it raises, which is noted."""
        try:
            return work()
        except Exception as failure:
            self.found.append(f"{name}: {type(failure).__name__}: {str(failure)[:160]}")
            return None

    def verified(self, name: str, branch: so.Branch, points: int) -> None:
        """Note what shooting contradicts."""
        check = self.attempt(f"verify {name}", lambda: so.verify(branch, points=points, seconds=PATIENCE))
        if check is not None:
            wrong = [*check.disagreements, *(item for item in check.bifurcations if not item.agrees)]
            self.found += [f"{name}: {str(item)[:200]}" for item in wrong]

    def run(self) -> None:
        """All of it."""
        response = self.attempt("response", lambda: so.frequency_response(self.system, self.omega, seconds=PATIENCE))
        if response is None:
            return
        self.events = len(response.bifurcations)
        self.verified("response", response, 5)
        for item in (*response.bifurcations["PD"][:2], *response.bifurcations["BP"][:2]):
            name = f"branch from {item.kind} {item.omega:.6f}"
            branch = self.attempt(name, lambda item=item: so.switch_branch(item, seconds=PATIENCE))
            if branch is not None:
                self.verified(name, branch, 3)
        for kind in ("LP", "PD", "NS", "grazing"):
            for item in response.bifurcations[kind][:1]:
                self.tracked(item)

    def tracked(self, item: so.Bifurcation) -> None:
        """A curve over the load, and one of its points in a response."""
        force, name = self.system.parameters["F"], f"{item.kind} {item.omega:.6f} over F"
        curve = self.attempt(name, lambda: so.track(item, "F", (0.7 * force, 1.4 * force), seconds=PATIENCE))
        if curve is None or curve.interrupted:
            return
        # not an end, where it may be one of codimension two
        at = 3 * len(curve) // 4
        load, where = curve.parameter("F")[at], curve.omega[at]
        system = self.system.moved_to({"F": load})
        again = self.attempt(name, lambda: so.frequency_response(system, self.omega, seconds=PATIENCE))
        known = [] if again is None else [other.omega for other in again.bifurcations[item.kind]]
        if again is not None and not any(abs(other - where) < 1e-4 * where for other in known):
            told = f"none of {np.round(known, 6)}, with {len(again.warnings)} notes"
            self.found.append(f"{name}: at F = {load:.6g} omega = {where:.7g} is {told}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="0:100", help="first:last, or first:last:step")
    seeds = range(*(int(part) for part in parser.parse_args().seeds.split(":")))
    warnings.simplefilter("ignore", so.NegativeDampingWarning)
    print(f"{'seed':>5}{'n':>4}{'events':>8}{'s':>8}")
    with threadpool_limits(1):
        for seed in seeds:
            begin, trial = time.perf_counter(), Trial(seed)
            trial.run()
            took = time.perf_counter() - begin
            print(
                f"{seed:>5}{trial.system.n:>4}{trial.events:>8}{took:>8.1f}", *trial.found, sep="\n        ", flush=True
            )


if __name__ == "__main__":
    main()
