"""Is a pitchfork one branch point, and nothing else, from whichever motions it is met?

Five symmetric oscillators, each followed on its symmetric motions and on the unsymmetric ones that leave them, in both
directions, with several largest steps. On the unsymmetric motions the branch turns back exactly at the branch point.
Every run must have the branch points where the finest run along the symmetric motions has them, within 3e-7 (that much
is due to the harmonics left out), all limit points of the finest run of its branch, and no others. Printed: events of
the finest runs; points, stretches left unsettled, events missed and added of each run.

    python benchmarks/branch_points.py
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

import suboctave as so

STEPS = (0.02, 0.04, 0.06, 0.08, 0.15, 0.3)
SAME = 3e-7
Events = list[tuple[str, float]]


def oscillators() -> dict[str, tuple[so.System, tuple[float, float]]]:
    """Systems with `x -> -x` for a symmetry, and the ranges of omega in which their motions lose it."""

    def single(stiffness: float, damping: float, force: float, *elements: so.Element) -> so.System:
        return so.System(
            mass=1.0,
            damping=damping,
            stiffness=stiffness,
            elements=list(elements),
            loads=[so.HarmonicLoad(dof=0, amplitude=force)],
        )

    def stops(**law: float) -> list[so.Element]:
        return [so.ElasticStop(dof=0, stiffness=20.0, gap=gap, **law) for gap in (1.0, -1.0)]

    masses = so.System(
        mass=[[1.0, 0.0], [0.0, 0.5]],
        damping=[[0.2, -0.1], [-0.1, 0.1]],
        stiffness=[[1.5, -0.5], [-0.5, 0.5]],
        elements=[so.CubicSpring(dof=0, coefficient=1.0), so.CubicSpring(dof=(1, 0), coefficient=2.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude=8.0)],
    )
    return {
        "cubic spring": (single(0.0, 0.2, 7.5, so.CubicSpring(dof=0, coefficient=1.0)), (2.5, 0.6)),
        "exact stops": (single(1.0, 0.1, 6.0, *stops()), (2.5, 0.6)),
        "rounded stops": (single(1.0, 0.1, 6.0, *stops(regularization=100.0)), (2.5, 0.6)),
        "arctan law": (single(0.2, 0.1, 6.0, so.Expression(dof=0, expression="10*(x - atan(x))")), (2.0, 0.5)),
        "two masses": (masses, (2.5, 1.5)),
    }


@dataclass
class Case:
    """A branch to follow: where it begins, where it leads, and its motions at either end."""

    title: str
    system: so.System
    omega: tuple[float, float]
    motions: tuple[so.PeriodicOrbit, so.PeriodicOrbit]

    def run(self, backwards: bool, max_step: float) -> so.Branch:
        """The branch from its first motion on, or from its last one back."""
        start = self.motions[backwards]
        there = max(self.omega, key=lambda end: abs(end - start.omega))
        return so.frequency_response(self.system, (start.omega, there), start=start, max_step=max_step)


def cases(title: str, system: so.System, omega: tuple[float, float]) -> list[Case]:
    """The symmetric motions over a range, and the unsymmetric ones beside each of their branch points."""
    whole = so.frequency_response(system, omega, max_step=STEPS[0])
    found = [Case(f"{title}, symmetric", system, omega, (whole.orbits[0], whole.orbits[-1]))]
    for item in whole.bifurcations["BP"]:
        half = so.switch_branch(item, side=1, max_step=STEPS[0])
        # as far as the unsymmetric motions lead away from the branch point without turning back
        way = abs(half.omega - item.omega)
        last = next((i for i in range(1, len(way)) if way[i] < way[i - 1]), len(way)) - 1
        orbit = half.orbits[max(1, last // 2)]
        beyond = item.omega - 0.5 * (orbit.omega - item.omega)
        mirrored = so.frequency_response(system, (orbit.omega, beyond), start=orbit, max_step=STEPS[0]).orbits[-1]
        found.append(
            Case(f"{title}, unsymmetric at {item.omega:.6f}", system, (orbit.omega, beyond), (orbit, mirrored))
        )
    return found


def events(branch: so.Branch) -> Events:
    """What bifurcates, in ascending order; grazings are no bifurcations."""
    return sorted((item.kind, item.omega) for item in branch.bifurcations if item.kind != "grazing")


def unmatched(some: Events, others: Events, within: float) -> Events:
    """Events of one list that have no partner of their own in the other."""
    left, rest = list(others), []
    for kind, omega in some:
        partner = next((e for e in left if e[0] == kind and abs(e[1] - omega) < within), None)
        if partner is None:
            rest.append((kind, omega))
        else:
            left.remove(partner)
    return rest


def main() -> int:
    wrong = unsettled = runs = 0
    for title, (system, omega) in oscillators().items():
        points: Events = []
        for case in cases(title, system, omega):
            start = time.perf_counter()
            finest = events(case.run(False, STEPS[0]))
            points = points or [event for event in finest if event[0] == "BP"]
            listed = ", ".join(f"{kind} {value:.7f}" for kind, value in finest)
            print(f"\n{case.title}: {listed}")
            for max_step in STEPS:
                for backwards in (False, True):
                    branch = case.run(backwards, max_step)
                    mine = events(branch)
                    lost, more = unmatched(finest, mine, SAME), unmatched(mine, finest, SAME)
                    strange = unmatched([e for e in mine if e[0] == "BP"], points, SAME)
                    runs, wrong = runs + 1, wrong + len(lost) + len(more) + len(strange)
                    unsettled += len(branch.audit.unsettled)
                    print(
                        f"    {max_step:<6}{'back' if backwards else 'on':<6}{len(branch):>5} points "
                        f"{len(branch.audit.unsettled):>3} unsettled"
                        + (f"  missed {lost}" if lost else "")
                        + (f"  added {more}" if more else "")
                        + (f"  elsewhere {strange}" if strange else "")
                        + "".join(f"\n            {stretch}" for stretch in branch.audit.unsettled)
                    )
            print(f"    {time.perf_counter() - start:.1f} s")
    print(f"\n{runs} runs: {wrong} events missed, added or elsewhere; {unsettled} stretches unsettled")
    return 1 if wrong else 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
