"""Is the list of bifurcations on a curve the same at any step size, in both directions?

Reference curves, each followed with several largest steps from either end; every run is held against all events that
any run of its curve found (two are the same within 3e-6 in omega). Printed: points and probes of each run, events
missed, events added to those of the finest run, and what the audit left unsettled.

    python benchmarks/completeness.py
"""

from __future__ import annotations

import sys
import time

from threadpoolctl import threadpool_limits

import suboctave as so

STEPS = (0.01, 0.03, None, 0.1, 0.3)
SAME = 3e-6
Events = list[tuple[str, float]]


def curves() -> dict[str, tuple[so.System, tuple[float, float]]]:
    found = {}
    for title, parameters in (
        ("p=0.55 j=0", {"p": 0.55, "j": 0.0}),
        ("p=0.55 j=1", {"p": 0.55, "j": 1.0}),
        ("p=1.7 j=0", {"p": 1.7, "j": 0.0}),
    ):
        for law, sharpness in (("s=3000", {"regularization": 3000.0}), ("exact", {})):
            system = so.library.reference_oscillator(**parameters, **sharpness)
            found[f"{title} {law}"] = (system, (4.5, 1.25))
    found["NLTVA F=0.11"] = (so.library.nltva(0.11), (0.8, 1.5))
    found["NLTVA F=0.12"] = (so.library.nltva(0.12), (0.8, 1.5))
    found["symmetric Duffing"] = (so.library.duffing(), (0.3, 6.0))
    return found


def events(branch: so.Branch) -> Events:
    return sorted((item.kind, item.omega) for item in branch.bifurcations if item.kind != "grazing")


def unmatched(some: Events, others: Events) -> Events:
    """Events of one list that have no partner of their own in the other."""
    left, rest = list(others), []
    for kind, omega in some:
        partner = next((e for e in left if e[0] == kind and abs(e[1] - omega) < SAME), None)
        if partner is None:
            rest.append((kind, omega))
        else:
            left.remove(partner)
    return rest


def runs(system: so.System, omega: tuple[float, float]) -> dict[tuple[float | None, bool], so.Branch]:
    """The curve with every largest step, upwards (True) and downwards."""
    low, high = min(omega), max(omega)
    result = {}
    for step in STEPS:
        for upwards in (False, True):
            ends = (low, high) if upwards else (high, low)
            options = {} if step is None else {"max_step": step}
            result[step, upwards] = so.frequency_response(system, ends, **options)
    return result


def main() -> int:
    missed = added = unsettled = 0
    for title, (system, omega) in curves().items():
        start = time.perf_counter()
        found = runs(system, omega)
        finest = events(found[STEPS[0], False])
        listed = ", ".join(f"{kind} {value:.6f}" for kind, value in finest)
        print(f"\n{title}: {listed}   ({time.perf_counter() - start:.1f} s)")
        print(f"    {'max_step':<10}{'way':<6}{'points':>7}{'probes':>8}{'missed':>8}{'added':>7}{'unsettled':>11}")
        for (step, upwards), branch in found.items():
            mine = events(branch)
            lost, more = unmatched(finest, mine), unmatched(mine, finest)
            missed, added = missed + len(lost), added + len(more)
            unsettled += len(branch.audit.unsettled)
            print(
                f"    {'default' if step is None else step!s:<10}{'up' if upwards else 'down':<6}{len(branch):>7}"
                f"{branch.audit.probes:>8}{len(lost):>8}{len(more):>7}{len(branch.audit.unsettled):>11}"
                + (f"  missed {lost}" if lost else "")
                + (f"  added {more}" if more else "")
            )
    print(f"\nin all: {missed} missed, {added} added, {unsettled} stretches unsettled")
    return 1 if missed or added else 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
