"""Does the search for isolas know what a search for sub-harmonic motions finds at single values of the parameter?

One mass on a linear spring between stops whose stiffness, gap, damping and load are drawn from a seed; one in three
has a cubic spring as well. `find_isolas` is asked for isolas of two and three load periods over the gap or the load.
At five other values of that parameter `find_subharmonics` looks for such motions. What it finds there is a closed
branch that nothing leads to, or not: a branch that leaves the range is followed over two octaves more, one that a
period doubling or a branch point leads to is none. Each closed branch has to be that of an isola known there.

Printed for each system: isolas, closed branches that find_subharmonics found, how many of these no isola holds, isolas
listed more than once, isolas that exist at a value and that find_subharmonics did not find there, branches at these
values that do not close or do not agree with `verify`, notes, and both times.

    python benchmarks/isola_search.py [--seeds 0:10] [--verbose]
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so
from suboctave.curves.identity import lies_on

ORDERS = (2, 3)
OMEGA = (1.3, 4.5)
#: share of the bounds at which find_subharmonics looks: none of them is a value at which the search does by default
SHARES = (0.07, 0.19, 0.41, 0.63, 0.88)


def drawn(seed: int) -> tuple[so.System, str, tuple[float, float]]:
    """A system, the design parameter and its bounds."""
    rng = np.random.default_rng([47, seed])
    over_gap = rng.uniform() < 0.6
    stiffness = float(np.exp(rng.uniform(np.log(2.0), np.log(40.0))))
    gap, load = float(rng.uniform(0.0, 0.8)), float(rng.uniform(0.3, 0.8))
    elements: list[Any] = [so.ElasticStop(0, stiffness, "q" if over_gap else gap)]
    if rng.uniform() < 0.3:
        elements.append(so.ElasticStop(0, float(rng.uniform(1.0, 5.0)), -float(rng.uniform(0.5, 1.5))))
    if rng.uniform() < 1.0 / 3.0:
        elements.append(so.CubicSpring(0, float(rng.uniform(0.05, 0.5))))
    bounds = (0.0, 1.0) if over_gap else (0.1, 1.0)
    loads = [so.HarmonicLoad(0, load if over_gap else "q")]
    damping = float(rng.uniform(0.04, 0.12))
    return so.System(1.0, damping, 1.0, elements, loads, parameters={"q": 0.5}), "q", bounds


def closed_at(system: so.System, order: int) -> list[so.Branch]:
    """Closed branches that no branch leads to, as far as their own ends and branch points tell."""
    low, high = OMEGA
    whole: list[so.Branch] = []
    for branch in so.find_subharmonics(system, OMEGA, subharmonic=order):
        if any(lies_on(branch.orbits[len(branch) // 2], known.points) for known in whole):
            continue
        if not branch.closed and branch.departs is None and branch.arrives is None:
            middle = branch.orbits[len(branch) // 2]
            branch = so.continue_branch(middle, "omega", (0.25 * low, 4.0 * high))
        if branch.closed and not branch.bifurcations["BP"]:
            whole.append(branch)
    return whole


def agrees(branch: so.Branch) -> bool:
    """Whether three motions of a branch are those that shooting finds."""
    return all(so.verify(branch.orbits[place]).agrees for place in np.linspace(2, len(branch) - 3, 3).astype(int))


def compared(seed: int, verbose: bool) -> dict[str, Any]:
    """What the search knows of what is found at five values."""
    system, name, bounds = drawn(seed)
    start = time.process_time()
    isolas = so.find_isolas(system, OMEGA, name, bounds, search=ORDERS)
    searched, start = time.process_time() - start, time.process_time()
    counts = dict.fromkeys(("closed", "missed", "twice", "not seen", "wrong"), 0)
    for share in SHARES:
        value = bounds[0] + share * (bounds[1] - bounds[0])
        loops = {}
        for isola in isolas:
            if value in isola:
                try:
                    loops[isola] = isola.at(value)
                except so.ConvergenceError as failure:
                    counts["wrong"] += 1
                    print(f"    {name} = {value:g}: {failure}" if verbose else "", end="\n" * verbose)
        counts["wrong"] += sum(not (loop.closed and agrees(loop)) for loop in loops.values())
        seen = set()
        for order in ORDERS:
            for branch in closed_at(system.with_parameters({name: value}), order):
                counts["closed"] += 1
                middle = branch.orbits[len(branch) // 2]
                held = [i for i, loop in loops.items() if lies_on(middle, loop.points, images=True)]
                seen |= {id(isola) for isola in held}
                counts["missed"] += not held
                counts["twice"] += len(held) > 1
                if verbose and len(held) != 1:
                    where = f"omega = {branch.omega.min():.5f} to {branch.omega.max():.5f}"
                    print(f"    {len(held)} isolas: {order}T at {name} = {value:g}, {where}")
        inside = [i for i, loop in loops.items() if loop.omega.max() > OMEGA[0] and loop.omega.min() < OMEGA[1]]
        counts["not seen"] += sum(id(isola) not in seen for isola in inside)
    if verbose:
        print(isolas)
    looked = time.process_time() - start
    return {"isolas": len(isolas), **counts, "notes": len(isolas.notes), "search s": searched, "values s": looked}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="find_isolas beside find_subharmonics at single values")
    parser.add_argument("--seeds", default="0:10", help="from:to")
    parser.add_argument("--verbose", action="store_true", help="what does not agree, and the isolas")
    given = parser.parse_args()
    first, last = (int(part) for part in given.seeds.split(":"))
    total: dict[str, float] = {}
    for seed in range(first, last):
        row = compared(seed, given.verbose)
        if not total:
            print("| seed | " + " | ".join(row) + " |")
        for key, value in row.items():
            total[key] = total.get(key, 0) + value
        print(f"| {seed:4d} | " + " | ".join(f"{value:{len(key)}.0f}" for key, value in row.items()) + " |", flush=True)
    print("|  all | " + " | ".join(f"{value:{len(key)}.0f}" for key, value in total.items()) + " |")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
