"""Periods from stroboscopic points alone: settled motions, and points that are still on their way."""

from __future__ import annotations

import numpy as np
import pytest

from suboctave.timedomain.period_recognition import period_of

SIZES = np.ones(2)


def spiral(rate, angle, first, count=60):
    """Points that come to one place in turns: of a motion with the multipliers rate exp(+- i angle)."""
    k = np.arange(count)
    turn = first * rate**k
    return np.column_stack([1.0 + turn * np.cos(angle * k), 0.3 + turn * np.sin(angle * k)])


@pytest.mark.parametrize("rate", [0.5, 0.9, 0.95, 0.99, 0.999])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 7])
def test_a_spiral_is_never_taken_for_a_cycle(rate, n):
    """After n points it has gone about once around: they miss each other by less than neighbours do."""
    for angle in 2.0 * np.pi / n + np.array([-3e-3, -1e-4, 0.0, 1e-4, 3e-3]):
        for first in np.geomspace(1e-7, 1.0, 29):
            assert period_of(spiral(rate, angle, first), SIZES, 1e-6).period in (0, 1)


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("spread", [1e-5, 1e-2, 1.0])
def test_cycles_are_told_while_they_still_settle(n, spread):
    """The approach, by 5 % a cycle, is within the tolerance, the cycle is not."""
    k = np.arange(60)
    cycle = spread * np.column_stack([np.cos(2.0 * np.pi * k / n + 0.4), np.sin(2.0 * np.pi * k / n + 0.4)])
    approach = 1e-9 * 0.95 ** (k / n)
    assert period_of(cycle + approach[:, None], SIZES, 1e-7).period == n
    assert period_of(cycle, SIZES, 1e-7).period == n
    rounding = 1e-15 * np.random.default_rng(0).standard_normal((60, 2))
    assert period_of(cycle + rounding, SIZES, 1e-7).period == n


def test_what_does_not_repeat():
    k = np.arange(60)
    torus = np.column_stack([np.cos(k), np.sin(k)])
    assert period_of(torus, SIZES, 1e-6).period == 0
    torus[-1] = np.nan
    assert period_of(torus, SIZES, 1e-6).defect == np.inf
