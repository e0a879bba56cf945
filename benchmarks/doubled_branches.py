"""Do branches of doubled motions arrive where they should? Random systems, every doubling of the response switched at.

A branch that leaves the response at a period doubling comes back to it at another one, or leaves the range. If it
arrives, the branch that leaves the other doubling is the same curve walked the other way: the same range of omega, the
same limit points, the same motions. Systems are those of `random_systems.py`, of even seeds with strong loads.

Printed for each system: its doublings, how many of the branches arrive at a doubling of the response, leave the range,
close, or were stopped; then, in lines of their own, what does not hold:

    end         it ends for a reason that is none of these, or where it began
    elsewhere   it arrives at a doubling that the response does not list, or shooting does not confirm
    one way     from the doubling at which it arrives, the branch leads elsewhere
    other       switched at both ends the two curves differ
    false BP    a branch point where the system has no symmetry, or where the motion is its parent

    python benchmarks/doubled_branches.py [--seeds 1000:1020] [--masses 4] [--seconds 60] [--verbose]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from random_systems import Description, describe, short, stated, system_of
from threadpoolctl import threadpool_limits

import suboctave as so
from suboctave.continuation.ending import EndReason
from suboctave.curves.identity import apart, lies_on
from suboctave.curves.trace import BranchPoint

#: distance of two doublings that are one: in omega, as a share of the range, and of their motions
PLACE, ALIKE = 1e-4, 0.02
#: motions of one curve that are looked for on the other
SAMPLES = 9
#: distance of a multiplier by shooting from -1, up to which a doubling is one
CRITICAL = 0.02
#: ends of a branch that are no fault
FINE = (EndReason.MET_BRANCH, EndReason.RANGE_END, EndReason.CLOSED)
STOPPED = (EndReason.INTERRUPTED, EndReason.TIME_LIMIT)


@dataclass
class Doubled:
    """A branch of doubled motions: which doublings it leaves and meets, None where it meets none that is listed."""

    start: int
    branch: so.Branch
    end: int | None = None


@dataclass
class Row:
    """What became of one system."""

    doublings: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    warnings: int = 0
    branches: list[Doubled] = field(default_factory=list)


def symmetric(description: Description) -> bool:
    """Whether x(t + T/2) = -x(t) maps the equations onto themselves."""
    odd = all(law["kind"] in ("play", "damper") or (law["kind"] == "polynomial" and not any(law["coefficients"][1::2]))
              or (law["kind"] == "parametric" and law["harmonic"] % 2 == 0) for law in description["laws"])  # fmt: skip
    return odd and all(load["harmonic"] % 2 for load in description["loads"])


def judged(seed: int, seconds: float) -> Row:
    """All branches that leave the doublings of one response."""
    description = describe(seed, seed % 2 == 0)
    system, ends = system_of(description), tuple(description["omega"])
    width = abs(ends[1] - ends[0])
    response = so.frequency_response(system, ends, seconds=2.0 * seconds)
    if response.interrupted:
        raise so.ConvergenceError(f"the response takes longer than {2.0 * seconds:g} s")
    doublings = [item for item in response.bifurcations["PD"] if item.orbit.basis.nu == 1]
    row = Row(len(doublings))
    for i, doubling in enumerate(doublings):
        name = f"{doubling.omega:.9g}"
        try:
            branch = so.switch_branch(doubling, seconds=seconds)
        except so.ConvergenceError as failure:
            row.faults.append(f"no branch  {name}: {failure}")
            continue
        row.warnings += len(branch.warnings)
        item = Doubled(i, branch)
        row.branches.append(item)
        reason = branch.endings[-1].reason
        row.ends[str(reason.value)] += 1
        if branch.arrives is not None:
            item.end = number(branch, doublings, width)
            row.faults += [f"elsewhere  {name}: {text}" for text in elsewhere(item)]
        if reason not in FINE + STOPPED or item.end == i:
            row.faults.append(f"end        {name}: {branch.ended}")
        row.faults += [f"false BP   {name}: at {place:.9g}" for place in false_ones(branch, symmetric(description))]
    row.faults += both_ends(row.branches, doublings, width)
    return row


def number(branch: so.Branch, doublings: list[so.Bifurcation], width: float) -> int | None:
    """Which of the doublings a branch arrives at."""
    last = branch.arrives
    distances = [
        abs(item.omega - last.omega) / width if apart(item.orbit, branch.orbits[-1]) <= ALIKE else np.inf
        for item in doublings
    ]
    best = int(np.argmin(distances))
    return best if distances[best] <= PLACE else None


def elsewhere(item: Doubled) -> Iterator[str]:
    """What is wrong with an arrival at a doubling that is not listed."""
    if item.end is not None:
        return
    last = item.branch.arrives
    found = so.verify(item.branch.orbits[-1])
    critical = np.inf if found.solution is None else float(np.abs(found.solution.multipliers - 1.0).min())
    yield f"arrives at {last.omega:.9g}, not listed (by shooting a multiplier is {critical:.1e} from +1 there)"


def false_ones(branch: so.Branch, mirrored: bool) -> list[float]:
    """Branch points that are none: of a system without symmetry, or where a motion is as good as its parent."""
    return [item.omega for item in branch.bifurcations["BP"] if not mirrored or odd_share(item.orbit) < 1e-3]


def odd_share(orbit: so.PeriodicOrbit) -> float:
    """Size of the half-odd harmonics of a motion of twice the period as a share of the motion."""
    return float(np.linalg.norm(orbit.amplitudes[1::2]) / np.linalg.norm(orbit.amplitudes))


def both_ends(branches: list[Doubled], doublings: list[so.Bifurcation], width: float) -> Iterator[str]:
    """What differs between the branches that leave the two doublings of one curve."""
    by_start = {item.start: item for item in branches}
    for item in branches:
        back = by_start.get(item.end) if item.end is not None and item.end != item.start else None
        if back is None or back.branch.endings[-1].reason in STOPPED:
            continue
        name = f"{doublings[item.start].omega:.9g} - {doublings[item.end].omega:.9g}"
        if back.end != item.start:
            yield f"one way    {name}: back it {back.branch.ended}"
        elif item.start < back.start:
            tips = [doublings[i].orbit for i in (item.start, item.end)]
            yield from (f"other      {name}: {text}" for text in differences(item.branch, back.branch, tips, width))


def differences(one: so.Branch, other: so.Branch, tips: list[so.PeriodicOrbit], width: float) -> Iterator[str]:
    """How two curves differ that should be one; `tips`: the motions at their ends, in the order of the first."""
    for a, b in zip(extent(one), extent(other), strict=True):
        if abs(a - b) > 1e-3 * width:
            yield f"omega reaches {a:.9g} and {b:.9g}"
    folds = [[item.omega for item in branch.bifurcations["LP"]] for branch in (one, other)]
    # a branch may say of one of them that it could not be located
    untold = [[f for f in folds[1 - i] if not stated(f, (one, other)[i], width)] for i in (0, 1)]
    if len(folds[0]) != len(folds[1]) and (len(folds[0]) < len(untold[0]) or len(folds[1]) < len(untold[1])):
        yield f"limit points {' '.join(f'{f:.9g}' for f in folds[0])} and {' '.join(f'{f:.9g}' for f in folds[1])}"
    first, last = (BranchPoint(tip, None, 0.0, 0) for tip in tips)
    for a, b, ends in ((one, other, (last, first)), (other, one, (first, last))):
        at = np.unique(np.linspace(0, len(a.points) - 1, SAMPLES).astype(int))
        lost = [a.omega[i] for i in at if not lies_on(a.orbits[i], [ends[0], *b.points, ends[1]])]
        if lost:
            yield "motions of one are not on the other at omega " + " ".join(f"{value:.9g}" for value in lost)


def extent(branch: so.Branch) -> tuple[float, float]:
    """Least and largest frequency of a branch, limit points included."""
    values = [*branch.omega, *(item.omega for item in branch.bifurcations["LP"])]
    return min(values), max(values)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", default="1000:1020", help="first:last but one, or several, 3,7,10:20")
    parser.add_argument("--systems", type=int, default=None, help="stop after as many systems with doublings")
    parser.add_argument("--masses", type=int, default=4, help="leave out systems of more")
    parser.add_argument("--seconds", type=float, default=60.0, help="for one branch")
    parser.add_argument("--verbose", action="store_true", help="print every branch and its warnings")
    options = parser.parse_args()
    seeds: list[int] = []
    for part in options.seeds.split(","):
        first, _, last = part.partition(":")
        seeds += range(int(first), int(last) if last else int(first) + 1)
    seeds = [seed for seed in seeds if len(describe(seed)["mass"]) <= options.masses]
    print(f"{'seed':>5}  {'system':<38}{'PD':>4}{'arrive':>8}{'leave':>7}{'close':>7}{'stop':>6}{'notes':>7}{'s':>7}")
    total: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    for seed, row, seconds in islice(rows(seeds, options.seconds), options.systems):
        numbers = [row.ends[str(reason.value)] for reason in FINE]
        stopped = sum(row.ends[str(reason.value)] for reason in STOPPED)
        words = short(describe(seed, seed % 2 == 0))
        print(f"{seed:>5}  {words:<38}{row.doublings:>4}{numbers[0]:>8}{numbers[1]:>7}{numbers[2]:>7}{stopped:>6}"
              f"{row.warnings:>7}{seconds:>7.1f}")  # fmt: skip
        for fault in row.faults:
            print(f"         {fault}")
            kinds[fault[:10].strip()] += 1
        if options.verbose:
            for item in row.branches:
                print(f"         from {item.branch.departs.omega:.9g}, {len(item.branch.points)} points: "
                      f"{item.branch.ended}")  # fmt: skip
                for warning in item.branch.warnings:
                    print(f"           note: {warning}")
        sys.stdout.flush()
        total.update(
            systems=1, doublings=row.doublings, faulty=int(bool(row.faults)), notes=row.warnings, stopped=stopped
        )
        total.update(dict(zip(("arrive", "leave", "close"), numbers, strict=True)))
    print("\nin all: " + ", ".join(f"{value} {what}" for what, value in total.items()))
    print("faults: " + (", ".join(f"{value} {what}" for what, value in kinds.items()) or "none"))
    return 1 if kinds else 0


def rows(seeds: list[int], seconds: float) -> Iterator[tuple[int, Row, float]]:
    """The systems whose responses have doublings."""
    for seed in seeds:
        began = time.process_time()
        try:
            row = judged(seed, seconds)
        except so.ConvergenceError as failure:
            print(f"{seed:>5}  not computed: {failure}")
            continue
        if row.doublings:
            yield seed, row, time.process_time() - began


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
