"""Two blades with a friction damper between them, whose law is sharp: hairpins, folds, and a damper that is idle.

x_i'' + 0.02 x_i' + x_i + 0.5 x_i^3 + 0.02 (x_i - x_j) + limit tanh((x_i' - x_j') / width) = 0.1 cos(omega t + phase_i)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.floquet.result import FloquetResult
from suboctave.timedomain import shoot


def blades(limit: float, width: float, phase: float) -> so.System:
    cubic = [so.CubicSpring(0, 0.5), so.CubicSpring(1, 0.5)]
    friction = so.TanhFriction((0, 1), limit, width)
    loads = [so.HarmonicLoad(0, 0.1), so.HarmonicLoad(1, 0.1, phase=phase)]
    return so.System(np.eye(2), 0.02 * np.eye(2), [[1.02, -0.02], [-0.02, 1.02]], [*cubic, friction], loads)


def test_a_hairpin_is_passed_with_harmonics_of_its_own_choice():
    """At omega = 1.2328 the curve turns within less than its harmonics move it: it does not turn back along itself."""
    curve = so.frequency_response(blades(0.05, 0.003, np.pi / 2), (1.0, 1.7))
    assert curve.ended == "reached the end of the range at omega = 1.7"
    # as with 61 harmonics all along, where nothing changes on the way
    fixed = [1.66141, 1.23276, 1.50803, 1.17766, 1.28944, 1.11886]
    np.testing.assert_allclose([item.omega for item in curve.bifurcations["LP"]], fixed, atol=3e-4)
    assert len(curve.bifurcations) == len(fixed)
    assert curve.audit.complete


@pytest.fixture(scope="module")
def folds():
    found = so.frequency_response(blades(0.05, 0.01, np.pi), (1.8, 0.8)).bifurcations["LP"]
    assert len(found) > 1
    return found[0], found[-1]


def test_at_a_limit_point_all_multipliers_are_within_their_errors(folds):
    """The step towards the motion of the same frequency carries the critical multiplier far off, to meet another one:
    the multiplier +1 of the motion as it stands says that there is no such step.
    """
    for fold in folds:
        found = so.verify(fold)
        assert found.agrees
        true = found.solution.multipliers
        for mu, error in zip(fold.multipliers, fold.floquet.errors, strict=True):
            assert abs(mu - true).min() <= error
        assert abs(fold.multipliers - 1.0).min() < 1e-3
        assert fold.critical_error < 0.02


def test_a_motion_right_at_a_limit_point_is_held_against_the_curve(folds):
    """Of the same frequency there is no true motion, or one as far away as the square root of what they differ by."""
    for fold in folds:
        check = so.verify(fold.orbit)
        assert check.outcome in ("agrees", "cannot tell"), check
        assert check.distance < 1e-4
        assert abs(check.solution.omega / fold.omega - 1.0) < 1e-4


def test_multipliers_that_are_not_those_of_shooting_are_spoken_of(folds):
    fold = folds[-1]
    wrong = FloquetResult(fold.multipliers + 0.1, fold.floquet.errors)
    check = so.verify(replace(fold, floquet=wrong))
    assert check.agrees
    assert "its multipliers differ by" in check.reason
    assert "its multipliers differ by" not in so.verify(fold).reason


def test_an_idle_damper_leaves_no_doubt():
    """Equal blades that move as one: what rounding leaves between them is no motion to measure corrections by."""
    system = blades(0.01, 0.01, 0.0)
    curve = so.frequency_response(system, (0.8, 1.8))
    assert curve.warnings == ()
    assert curve.multiplier_errors.max() < 1e-4
    # those of one blade alone are among them
    one = so.System(1.0, 0.02, 1.0, [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(0, 0.1)])
    for at in (5, len(curve) // 2, len(curve) - 5):
        orbit = curve.orbits[at]
        alone = shoot(one, [orbit.start()[0], orbit.start()[2]], orbit.omega).multipliers
        apart = np.abs(curve.multipliers[at][:, None] - alone).min(axis=0)
        assert apart.max() < 1e-6
