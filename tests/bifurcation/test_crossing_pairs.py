"""Complex pairs of multipliers that cross the unit circle beside real ones that pass +1 or -1."""

from __future__ import annotations

import numpy as np
import pytest

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
