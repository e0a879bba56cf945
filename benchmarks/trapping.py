"""How often a trajectory of `basins` that was stopped early would have gone elsewhere.

A trajectory is stopped inside an ellipsoid about a stable motion in which the map over some periods contracts; that it
contracts is looked at in 192 points (`suboctave.timedomain.trapping`), which is no proof. Here it is measured, in three
ways:

    starts    states drawn at random from a box, stopped early, and followed for `PERIODS` periods more from there (not
              from the start: where transients are chaotic, two integrations of one state part)
    inside    states drawn inside the ellipsoids, half of them on the boundary, followed for as long
    larger    the norm of the derivative of the map at such states: the share above 0.9 (the bound in the sample) and
              above 1 (where the argument would break), and the largest

    python benchmarks/trapping.py [how many states for each of the first two, default 3000]     (a quarter of an hour)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

import suboctave as so
from suboctave.experiments.basin_attractors import Catalogue
from suboctave.experiments.common import checked_integration
from suboctave.timedomain.flow import Flow
from suboctave.timedomain.trapping import Trap

PERIODS, TOLERANCE = 600, 1e-8
DERIVATIVES = 2000


def cases() -> Iterator[tuple[str, so.System, float, float]]:
    """Name, system, frequency, half width of the box of displacements (velocities: times the frequency)."""
    library = so.library
    yield "three coexisting motions, exact law", library.reference_oscillator(p=0.55, j=0.5), 2.25, 2.0
    rounded = library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
    yield "the same, rounded law", rounded, 2.25, 2.0
    yield "2T beside a large motion, gap closed", library.reference_oscillator(p=1.6, Kc=4.2, j=0.0), 2.40, 3.0
    yield "Duffing", library.duffing(c=0.1, F=0.3), 1.5, 2.0
    yield "Duffing, weakly damped", library.duffing(c=0.02, F=0.1), 1.4, 2.0
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    stops = [so.ElasticStop((0, 1), 5.0, 0.3), so.ElasticStop(0, 5.0, 0.5)]
    yield "two masses with stops", so.System(
        np.eye(2), 0.04 * stiffness, stiffness, stops, [so.HarmonicLoad(0, 0.4)]
    ), 1.2, 1.5  # fmt: skip


def ball(count: int, size: int, random: np.random.Generator) -> np.ndarray:
    """Points of the unit ball, every other one on its boundary."""
    away = random.normal(size=(count, size))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    away[1::2] *= random.uniform(size=(count // 2, 1)) ** (1.0 / size)
    return away


def ends(catalogue: Catalogue, flow: Flow, states: np.ndarray) -> np.ndarray:
    """The attractor that each state comes to, -1 if none."""
    motions = flow.over(states, catalogue.omega, PERIODS, skip=PERIODS)
    reached = np.where(motions.failed[:, None], np.inf, motions.end)
    return nearest(catalogue, reached)


def nearest(catalogue: Catalogue, states: np.ndarray) -> np.ndarray:
    """By distance from the motions' stroboscopic points, a hundred thousandth of their size; knows no ellipsoid."""
    out = np.full(len(states), -1)
    for i, one in enumerate(catalogue.known):
        sizes = catalogue._sizes[i]
        for point in one.points:
            out[(np.abs(states - point) / sizes).max(axis=1) < 1e-5] = i
    return out


def derivatives(trap: Trap, catalogue: Catalogue, nu: int, random: np.random.Generator) -> np.ndarray:
    """Norms of the derivative of the map at states inside the ellipsoid."""
    size = len(trap.point)
    back = np.linalg.inv(trap.factor).T
    states = trap.point + trap.radius * ball(DERIVATIVES, size, random) @ back
    flow = Flow(catalogue.system, "accurate", tolerance=TOLERANCE, tangents=size, transition=True)
    motions = flow.over(states, catalogue.omega, nu * trap.times, skip=nu * trap.times)
    assert motions.tangents is not None
    return np.linalg.norm(trap.factor @ motions.tangents @ back.T, 2, axis=(1, 2))


def measure(system: so.System, omega: float, half: float, count: int) -> None:
    random = np.random.default_rng(7)
    n = system.n
    found = so.basins(
        system, omega=omega, box=((-half, half), (-half * omega, half * omega)), grid=(40, 40), tolerance=TOLERANCE
    )
    catalogue = Catalogue(system, omega, {}, checked_integration(system, {"tolerance": TOLERANCE, "observe": 0}))
    for one in found.attractors:
        catalogue.enter(one.name, one.points, one.amplitude, one.multipliers, False)
    flow = Flow(system, "accurate", tolerance=TOLERANCE)
    width = half * np.repeat([1.0, omega], n)
    states = random.uniform(-1.0, 1.0, (count, 2 * n)) * width
    y, label = states.copy(), catalogue.trapped(states)
    for _ in range(PERIODS // 8):
        active = np.flatnonzero(label == -1)
        if not len(active):
            break
        motions = flow.over(y[active], omega, 8, skip=8)
        y[active] = motions.end
        label[active] = catalogue.trapped(np.where(motions.failed[:, None], np.inf, motions.end))
        label[active[motions.failed]] = -2
    stopped = label >= 0
    truth = ends(catalogue, flow, y[stopped])
    wrong = int(((truth != label[stopped]) & (truth >= 0)).sum())
    print(f"  starts: {stopped.sum()} of {count} stopped early, {wrong} of them elsewhere, "
          f"{int((truth < 0).sum())} not settled {PERIODS} periods later")  # fmt: skip
    for number, one in enumerate(catalogue.known):
        if not one.traps:
            print(f"  {one.name}: no ellipsoid")
            continue
        each = -(-count // len(one.traps))
        inside = np.vstack([
            trap.point + trap.radius * ball(each, 2 * n, random) @ np.linalg.inv(trap.factor).T for trap in one.traps
        ])  # fmt: skip
        truth = ends(catalogue, flow, inside)
        wrong = int(((truth != number) & (truth >= 0)).sum())
        norms = np.concatenate([derivatives(trap, catalogue, one.period, random) for trap in one.traps])
        print(f"  {one.name}, max|x| {one.amplitude:.4g}: {wrong} of {len(inside)} inside go elsewhere, "
              f"{int((truth < 0).sum())} not settled; derivative over 0.9: {(norms > 0.9).mean():.2%}, over 1: "
              f"{(norms > 1.0).mean():.2%}, largest {norms.max():.3f}", flush=True)  # fmt: skip


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
    for name, system, omega, half in cases():
        print(name, flush=True)
        measure(system, omega, half, count)


if __name__ == "__main__":
    main()
