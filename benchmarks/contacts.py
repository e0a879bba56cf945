"""What contacts cost: responses of chains over the number of contacts, in units of the same chain with one.

    python benchmarks/contacts.py [--kind stop|cubic|all] [--contacts 1,2,5,10] [--chain NAME] [--harmonics 15]

The chain `plain` has springs and masses of one, damping .01 (K + M), a load of .1 at its free end, and stops (stiffness
1, gap .2) or cubic springs (coefficient 1) at its last masses. The others have contacts at other places, other gaps and
stiffnesses, damping, loads and ranges. Every chain runs in this process, the chain with one contact first; times are
processor time, of each chain without what the first curve of its kind compiles.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so


@dataclass(frozen=True)
class Chain:
    """Masses in a row, and where their contacts are."""

    masses: int = 20
    mass_damping: float = 0.01
    stiffness_damping: float = 0.01
    load: float = 0.1
    loaded: int = -1
    stiffness: float = 1.0
    gap: float = 0.2
    #: masses from one contact to the next, from the free end
    apart: int = 1
    spread: float = 0.0
    range: tuple[float, float] = (0.7, 1.5)

    def system(self, kind: str, contacts: int) -> tuple[so.System, tuple[float, float]]:
        """The chain with so many contacts, and the range of omega about its first natural frequency."""
        n = self.masses
        stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        stiffness[-1, -1] = 1.0
        elements = []
        for i in range(contacts):
            dof, share = (n - 1 - self.apart * i) % n, 1.0 + self.spread * i
            if kind == "stop":
                elements.append(so.ElasticStop(dof, self.stiffness * share, self.gap * share))
            else:
                elements.append(so.PolynomialSpring(dof, coefficients={3: self.stiffness * share}))
        damping = self.mass_damping * np.eye(n) + self.stiffness_damping * stiffness
        loads = [so.HarmonicLoad(self.loaded % n, self.load)]
        first = float(np.sqrt(np.linalg.eigvalsh(stiffness)[0]))
        system = so.System(np.eye(n), damping, stiffness, elements=elements, loads=loads)
        return system, (self.range[0] * first, self.range[1] * first)


CHAINS = {
    "plain": Chain(),
    "apart": Chain(apart=3, spread=0.1),
    "stiff": Chain(stiffness=20.0, gap=0.3, load=0.05),
    "damped": Chain(mass_damping=0.02, stiffness_damping=0.03, load=0.2),
    "second": Chain(masses=15, range=(2.5, 3.4), load=0.2, loaded=7, spread=0.05),
    "short": Chain(masses=10, apart=2, gap=0.1, load=0.03, spread=0.2),
}


def run(name: str, kind: str, contacts: list[int], harmonics: int | str, seconds: float) -> None:
    """Print a line for every number of contacts."""
    chain, first = CHAINS[name], 0.0
    so.frequency_response(*chain.system(kind, 1), harmonics=harmonics, max_step=0.3)
    for count in contacts:
        if count * chain.apart > chain.masses:
            continue
        system, omega = chain.system(kind, count)
        begin = time.process_time()
        curve = so.frequency_response(system, omega, harmonics=harmonics, seconds=seconds)
        spent = 1e3 * (time.process_time() - begin) / len(curve)
        first = first or spent
        kinds = Counter(item.kind for item in curve.bifurcations)
        listed = " ".join(f"{number} {kind}" for kind, number in sorted(kinds.items())) or "none"
        whole = "" if curve.interruption is None else f", cut at omega = {curve.omega[-1]:.4g}"
        print(
            f"{name:8} {kind:6} {count:4d} {len(curve):6d} {spent:9.1f} {spent / first:7.1f}"
            f" {curve.audit.probes / len(curve):7.2f} {len(curve.audit.unsettled):5d}  {listed}{whole}",
            flush=True,
        )


def main() -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=("stop", "cubic", "all"), default="all")
    parser.add_argument("--contacts", default="1,2,5,10")
    parser.add_argument("--chain", choices=(*CHAINS, "all"), default="all")
    parser.add_argument("--harmonics", default="15", help="a number, or adaptive")
    parser.add_argument("--seconds", type=float, default=60.0, help="time limit of a curve")
    given = parser.parse_args()
    harmonics = given.harmonics if given.harmonics == "adaptive" else int(given.harmonics)
    counts = [int(part) for part in given.contacts.split(",")]
    print("chain    law    contacts points  ms/point  over 1  probes  open  bifurcations")
    with threadpool_limits(limits=1):
        for kind in ("stop", "cubic") if given.kind == "all" else (given.kind,):
            for name in CHAINS if given.chain == "all" else (given.chain,):
                run(name, kind, counts, harmonics, given.seconds)


if __name__ == "__main__":
    main()
