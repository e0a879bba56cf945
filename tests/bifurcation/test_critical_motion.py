"""The motion that is added where a motion bifurcates."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


def test_at_a_limit_point_it_is_the_change_along_the_curve():
    system = so.System(1.0, 0.05, 1.0, [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(0, 0.1)])
    branch = so.frequency_response(system, (0.6, 2.2), harmonics=7, max_step=0.02)
    for fold in branch.bifurcations["LP"]:
        motion = fold.critical_motion
        assert motion.period == fold.orbit.period
        t = np.linspace(0.0, 1.0, 64, endpoint=False)
        along = motion.displacement(t * motion.period)[0]
        before, after = (
            branch.orbits[np.flatnonzero(side)[pick]]
            for side, pick in (
                (branch.arclength < fold.arclength, -1),
                (branch.arclength > fold.arclength, 0),
            )
        )
        change = after.displacement(t * after.period)[0] - before.displacement(t * before.period)[0]
        cosine = along @ change / np.sqrt((along @ along) * (change @ change))
        assert abs(cosine) == pytest.approx(1.0, abs=2e-3)


def test_at_a_period_doubling_it_is_the_half_of_the_doubled_branch_that_is_odd():
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    (doubling, *_) = so.frequency_response(system, (2.4, 1.2), harmonics=15).bifurcations["PD"]
    motion = doubling.critical_motion
    assert motion.period == pytest.approx(2.0 * doubling.orbit.period)
    t = np.linspace(0.0, 0.5, 50) * motion.period
    odd = motion.displacement(t)
    np.testing.assert_allclose(motion.displacement(t + 0.5 * motion.period), -odd, atol=1e-12)
    beside = so.switch_branch(doubling).orbits[1]
    half = 0.5 * (beside.displacement(t) - beside.displacement(t + 0.5 * motion.period))[0]
    cosine = odd[0] @ half / np.sqrt((odd[0] @ odd[0]) * (half @ half))
    assert abs(cosine) == pytest.approx(1.0, abs=1e-2)


def test_contacts_have_none():
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    branch = so.frequency_response(system, (2.4, 0.4), harmonics=15)
    assert all(item.critical_motion is None for item in branch.grazings)
