"""Regimes of structures, condensed and projected, against integration in time of all that moves."""

from __future__ import annotations

import numpy as np

import suboctave as so

#: points are this share of both ranges away from where the map says something else
AWAY = 0.03


def points_away(regimes, count, seed):
    """Points (omega, value) of the plane, about which the map says the same as at them."""
    draw = np.random.default_rng(seed)
    sides = np.array([regimes.omega, regimes.bounds])
    margin = AWAY * (sides[:, 1] - sides[:, 0])
    found: list[tuple[float, float]] = []
    while len(found) < count:
        at = draw.uniform(sides[:, 0] + margin, sides[:, 1] - margin)
        beside = [at + margin * (np.cos(a), np.sin(a)) for a in np.arange(8) * np.pi / 4]
        if all(regimes.label(*other) == regimes.label(*at) for other in beside):
            found.append((float(at[0]), float(at[1])))
    return found


def periods_in_time(system, name, points, transient):
    """What a motion from rest settles on at each point: its period in those of the load, 0 for what does not repeat."""
    omega, values = np.array(points).T
    rest = np.zeros((len(points), 2 * system.n))
    sections = so.poincare_sections(
        system,
        start=rest,
        omega=omega,
        parameters={name: values},
        transient=transient,
        periods=24,
        period_tolerance=1e-4,
    )
    return sections.periods


def test_a_chain_of_ten_masses_that_meets_a_stop():
    """T and 2T beside the doubling of the second resonance; every label is what motions from rest settle on."""
    chain = so.library.chain_with_stop(10)
    regimes = so.regime_map(chain, (0.42, 0.45), "gap", (0.95, 1.05), harmonics=7, depth=1, values=2, max_slices=2)
    assert {regime.periods for regime in regimes.regimes} == {(1,), (2,)}
    points = points_away(regimes, 30, 0)
    labels = [regimes.label(*point).periods for point in points]
    assert min(labels.count((1,)), labels.count((2,))) > 10
    assert [(period,) for period in periods_in_time(chain, "gap", points, 200)] == labels
    # from any state, and beside the motions of the map: the very same motions
    checked = regimes.check(points=4, seed=2, starts=1, transient=200)
    assert checked.agreeing == 1.0, checked
