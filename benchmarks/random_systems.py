"""Is the list of bifurcations the same at any step and in both directions, for systems that nobody chose?

Systems of one to three masses in a row with one to three elements (exact and rounded stops, cubic springs, springs and
stops between masses) and damping, drawn from a seed. Each is followed over a range of frequencies around its first
resonance with several largest steps, from either end. Where the ends lie on several branches the two directions may be
different curves: runs are compared with those that share their ends and length only. Printed for each system: events,
runs that miss or add one against the union, stretches left unsettled, and how many events `so.verify` confirms.

    python benchmarks/random_systems.py [systems] [seed]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

STEPS = (None, 0.1, 0.3)
#: two events of one kind are the same within this, relative to the width of the range, or their stated uncertainty
SAME = 1e-5
#: curves are the same if amplitudes agree at both ends, relative
ALIKE = 1e-4


def random_system(rng: np.random.Generator) -> so.System:
    n = int(rng.integers(1, 4))
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    springs = rng.uniform(0.5, 2.0, n)
    between = np.diag(springs[1:], 1)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0)) - between - between.T
    damping = rng.uniform(0.02, 0.08) * stiffness + rng.uniform(0.0, 0.03) * mass
    elements: list[so.Element] = []
    for _ in range(int(rng.integers(1, 4))):
        dof = int(rng.integers(n))
        at = (dof, (dof + 1) % n) if n > 1 and rng.uniform() < 0.4 else dof
        law = int(rng.integers(4))
        if law == 0:
            elements.append(so.CubicSpring(at, rng.uniform(0.1, 1.0)))
        else:
            gap = rng.uniform(0.05, 1.5) * (1.0 if rng.uniform() < 0.5 else -1.0)
            sharp = None if law < 3 else 10.0 ** rng.uniform(1.0, 3.5)
            elements.append(so.ElasticStop(at, rng.uniform(0.5, 6.0), gap, regularization=sharp))
    return so.System(mass, damping, stiffness, elements, [so.HarmonicLoad(int(rng.integers(n)), rng.uniform(0.1, 0.8))])


def frequencies(system: so.System) -> tuple[float, float]:
    mass, _, stiffness = system.matrices()
    natural = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    return 0.7 * float(natural.min()), 2.4 * float(natural.min())


def same(a: so.Bifurcation, b: so.Bifurcation, width: float) -> bool:
    slack = SAME * width + a.uncertainty + b.uncertainty
    size = max(a.amplitude, b.amplitude)
    return a.kind == b.kind and abs(a.omega - b.omega) < slack and abs(a.amplitude - b.amplitude) < 1e-2 * size


def unmatched(some: list[so.Bifurcation], others: list[so.Bifurcation], width: float) -> list[so.Bifurcation]:
    """Those of one list that have no partner of their own in the other."""
    left, rest = list(others), []
    for item in some:
        partner = min((e for e in left if same(item, e, width)), key=lambda e: abs(e.omega - item.omega), default=None)
        if partner is None:
            rest.append(item)
        else:
            left.remove(partner)
    return rest


def alike(a: so.Branch, b: so.Branch) -> bool:
    """Whether two runs followed the same curve, in either direction."""

    def ends(branch: so.Branch) -> np.ndarray:
        found = sorted((float(branch.omega[i]), float(branch.amplitude[i])) for i in (0, -1))
        return np.array(found)

    one, other = ends(a), ends(b)
    return bool(np.all(np.abs(one - other) <= ALIKE * np.abs(other))) and a.closed == b.closed


def stated(item: so.Bifurcation, branch: so.Branch) -> bool:
    """Whether a branch says that it may have missed an event."""
    slack = 1e-6 * item.omega
    return any(
        min(u.first, u.last) - slack <= item.omega <= max(u.first, u.last) + slack for u in branch.audit.unsettled
    )


def main(count: int, seed: int) -> int:
    missed = added = silent = 0
    print(f"{'system':<8}{'DOFs':>5}{'elements':>9}{'curves':>8}{'events':>8}{'missed':>8}{'stated':>8}", end="")
    print(f"{'added':>7}{'unsettled':>11}{'verified':>10}{'s':>7}")
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        system = random_system(rng)
        low, high = frequencies(system)
        start = time.perf_counter()
        found: dict[tuple[float | None, bool], so.Branch] = {}
        failed = []
        for step in STEPS:
            for upwards in (True, False):
                ends = (low, high) if upwards else (high, low)
                try:
                    found[step, upwards] = so.frequency_response(system, ends, max_step=step)
                except so.ConvergenceError as failure:
                    failed.append(((step, upwards), failure))
        curves: list[list[tuple[float | None, bool]]] = []
        for run, branch in found.items():
            group = next((g for g in curves if alike(found[g[0]], branch)), None)
            if group is None:
                curves.append([run])
            else:
                group.append(run)
        lines, mine, verified, events = [], [0, 0, 0], 0, 0
        for group in curves:
            lists = {run: list(found[run].bifurcations) for run in group}
            # what at least half of the runs found counts as there
            reference = max(lists.values(), key=lambda items: sum(len(items) == len(o) for o in lists.values()))
            events += len(reference)
            for run, items in lists.items():
                lost = unmatched(reference, items, high - low)
                more = unmatched(items, reference, high - low)
                said = [item for item in lost if stated(item, found[run])]
                mine = [mine[0] + len(lost), mine[1] + len(more), mine[2] + len(said)]
                lines += [f"        {run}: missed {item}{', stated' * (item in said)}" for item in lost]
                lines += [f"        {run}: added {item}" for item in more]
            checks = [(item, so.verify(item)) for item in reference]
            verified += sum(check.agrees for _, check in checks)
            lines += [f"        not verified: {item}: {check}" for item, check in checks if not check.agrees]
        lines += [f"        {run}: {failure}" for run, failure in failed]
        unsettled = sum(len(branch.audit.unsettled) for branch in found.values())
        missed, added, silent = missed + mine[0], added + mine[1], silent + mine[0] - mine[2]
        print(
            f"{number:<8}{system.n:>5}{len(system.elements):>9}{len(curves):>8}{events:>8}{mine[0]:>8}{mine[2]:>8}"
            f"{mine[1]:>7}{unsettled:>11}{verified:>10}{time.perf_counter() - start:>7.1f}"
        )
        for line in lines:
            print(line)
        sys.stdout.flush()
    print(f"\nin all: {missed} missed ({silent} without a word), {added} added")
    return 1 if silent or added else 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main(*(int(value) for value in (sys.argv[1:] + ["10", "1"][len(sys.argv) - 1 :]))))
