"""Complex pairs of multipliers that cross the unit circle beside real ones that pass +1 or -1."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.measures import crossing_pair

LEAVING = (0.97 + 0.07j, 1.02 + 0.05j)


def with_pair(mu, *real):
    return np.array([mu, mu.conjugate(), *real], dtype=complex)


@pytest.mark.parametrize(
    ("first", "last", "change", "accounted", "pair"),
    [
        pytest.param((1.07,), (0.96,), 1, 1, LEAVING, id="a real one enters as the pair leaves: 1, 3, 2 outside"),
        pytest.param((0.96, -0.9), (1.07, -1.1), 4, 2, LEAVING, id="two real ones leave with it"),
        pytest.param((1.07, -1.1), (0.96, -0.9), 0, 2, LEAVING, id="two real ones enter as it leaves"),
        pytest.param((1.3,), (1.4,), 2, 0, LEAVING, id="alone"),
        pytest.param((0.96,), (1.07,), 1, 1, (0.97 + 0.07j, 0.96 + 0.05j), id="a real one alone"),
    ],
)
def test_as_many_are_complex_at_both(first, last, change, accounted, pair):
    a, b = with_pair(pair[0], *first), with_pair(pair[1], *last)
    crosses = pair if abs(pair[1]) > 1.0 else None
    assert crossing_pair(a, b, change, accounted) == crosses
    assert crossing_pair(b, a, -change, accounted) == (crosses and crosses[::-1])


def test_real_ones_that_meet_do_not_cross_as_a_pair():
    """One passes +1 and meets another outside: a pair is outside behind it, as if it had left the circle."""
    first, last = np.array([1.07, 0.95, 0.5], dtype=complex), with_pair(1.02 + 0.05j, 0.5)
    assert crossing_pair(first, last, 1, 1) is None
    # beside a pair that leaves the circle the number outside grows by more
    pair = np.array([0.9 + 0.4j, 0.9 - 0.4j]), np.array([0.95 + 0.4j, 0.95 - 0.4j])
    assert crossing_pair(np.append(first, pair[0]), np.append(last, pair[1]), 3, 1) == (0.9 + 0.4j, 0.95 + 0.4j)


@pytest.mark.parametrize(("harmonics", "max_step"), [(5, 0.06), (5, 0.1), (7, 0.02), (7, 0.06)])
def test_a_torus_that_few_harmonics_have_beside_the_step_is_listed(harmonics, max_step):
    """Multipliers are those of the completed motion, J_kappa that of the truncated one: where both cross differs."""
    n = 6
    gyroscopic, circulatory = np.zeros((n, n)), np.zeros((n, n))
    gyroscopic[0, 1], gyroscopic[3, 4], circulatory[2, 3] = 0.3, 0.2, 0.02
    gyroscopic, circulatory = gyroscopic - gyroscopic.T, circulatory - circulatory.T
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = so.System(
        np.eye(n) + 0.1 * np.eye(n, k=1) + 0.1 * np.eye(n, k=-1),
        0.05 * stiffness + gyroscopic,
        stiffness + circulatory + np.diag([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]),
        [so.CubicSpring(5, 0.8), so.ElasticStop((3, 5), 2.0, 0.3)],
        [so.HarmonicLoad(1, 0.4), so.HarmonicLoad(0, 0.1, phase=0.7)],
    )
    branch = so.frequency_response(system, (0.565, 0.58), harmonics=harmonics, max_step=max_step)
    first, last = branch.bifurcations["NS"]
    # with more harmonics
    assert first.omega == pytest.approx(0.56958, abs=2e-4)
    assert last.omega == pytest.approx(0.57506, abs=5e-4)
    assert not branch.audit.unsettled
    # on the other side of a motion than multipliers show them
    if max_step == 0.06:
        assert 1e-6 < max(first.uncertainty, last.uncertainty) < 2e-4
