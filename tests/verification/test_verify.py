"""`verify` contradicts: motions and bifurcations that are right agree with shooting, planted errors do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError
from suboctave.verification import motions
from suboctave.verification.harmonics import left_out
from suboctave.verification.motions import pairing


def test_right_motions_agree(rattling_curve, duffing_curve):
    for curve in (rattling_curve, duffing_curve):
        for at in np.linspace(3, len(curve) - 3, 5).astype(int):
            check = so.verify(curve.orbits[at])
            assert check.agrees, check
            assert check.distance < 3e-4
            assert check.stable == curve.stable[at]
            assert check.solution.amplitude == pytest.approx(curve.amplitude[at], rel=3e-5)
            point = so.verify(curve.points[at])
            assert point.agrees
            assert "agrees" in repr(point)


@pytest.mark.parametrize("size", [0.01, 0.1, 1.0])
def test_a_planted_error_is_seen(duffing_curve, size):
    orbit = duffing_curve.orbits[len(duffing_curve) // 2]
    wrong = replace(orbit, x=orbit.x * (1.0 + size))
    check = so.verify(wrong)
    assert not check.agrees
    assert check.distance > 1e-3
    assert "DISAGREES" in repr(check)


def test_a_missing_harmonic_is_seen(duffing_curve):
    orbit = duffing_curve.orbits[int(duffing_curve.amplitude.argmax())]
    coefficients = orbit.coefficients.copy()
    coefficients[5:] = 0.0
    assert not so.verify(replace(orbit, x=coefficients)).agrees


def test_too_few_harmonics_are_seen():
    """With one harmonic a motion of the order of the strong spring's length is a percent off."""
    curve = so.frequency_response(so.library.duffing(c=0.1, F=5.0), (1.2, 1.5), harmonics=1)
    check = so.verify(curve.orbits[0])
    assert not check.agrees
    assert check.distance > 1e-3


def test_wrong_parameters_are_seen(duffing_curve):
    orbit = duffing_curve.orbits[int(duffing_curve.amplitude.argmax()) - 20]
    assert not so.verify(replace(orbit, values={**orbit.values, "alpha": 1.5})).agrees


@pytest.fixture(scope="module")
def each_kind(duffing_curve, rattling_curve):
    symmetric = so.frequency_response(so.library.duffing(), (0.65, 0.8))
    absorber = so.frequency_response(so.library.nltva(0.11), (1.0, 1.15))
    return {
        "LP": duffing_curve.bifurcations["LP"][0],
        "PD": rattling_curve.bifurcations["PD"][0],
        "BP": symmetric.bifurcations["BP"][0],
        "NS": absorber.bifurcations["NS"][0],
    }


@pytest.mark.parametrize("kind", ["LP", "BP", "PD", "NS"])
def test_bifurcations(each_kind, kind):
    b = each_kind[kind]
    check = so.verify(b)
    assert check.agrees, check
    assert check.solution.omega == pytest.approx(b.omega, abs=1e-6)
    assert check.solution.kind == kind


@pytest.mark.parametrize("kind", ["LP", "PD", "NS"])
def test_misplaced_bifurcations_are_seen(each_kind, kind):
    """A motion beside the bifurcation, 1 % off in frequency, is none."""
    b = each_kind[kind]
    shifted = so.continue_branch(b, "omega", tuple(sorted((b.omega * 0.97, b.omega * 1.03))))
    far = np.argmin(np.abs(np.abs(shifted.omega / b.omega - 1.0) - 0.02))
    assert not so.verify(replace(b, orbit=shifted.orbits[far])).agrees


def test_stability_of_one_motion(rattling_curve):
    for at in (5, len(rattling_curve) // 2):
        result = so.stability(rattling_curve.orbits[at])
        assert result.multipliers == pytest.approx(rattling_curve.multipliers[at], abs=1e-12)
        assert result.stable == rattling_curve.stable[at]
        assert so.stability(rattling_curve.points[at]).stable == result.stable


def test_a_motion_too_unstable_to_be_shot_is_not_wrong():
    """Of a plate between electrodes close to them, with a multiplier of 1e14."""
    forces = [so.CubicSpring(0, "a"), so.Expression(0, "-b*(Vd+Va*cos(omega*t))**2/(1-x)**2")]
    system = so.System(1.0, 0.02, 1.0, forces, parameters={"a": 0.3, "b": 0.1, "Vd": 0.6, "Va": 0.25})
    curve = so.frequency_response(system, (1.0, 0.38), harmonics=21)
    check = so.verify(curve.points[-1])
    assert check.outcome == "cannot tell"
    assert "to the size of the motion" in check.reason
    assert so.verify(curve.points[0]).agrees


def test_differences_of_multipliers_count_beyond_what_their_errors_cover():
    mu, true = np.array([0.9, 0.2j, -0.2j]), np.array([-0.25j, 0.9, 0.25j])
    assert pairing(mu, true) == pytest.approx(0.05)
    for error, left in ((6e-3, 0.0), (1e-3, 0.04)):
        assert pairing(mu, true, True, np.array([1e-6, error, error])) == pytest.approx(left)


def test_where_the_search_loses_a_branch_point_multipliers_that_cross_beside_it_tell(duffing_curve, monkeypatch):
    def lost(*given, **options):
        raise ConvergenceError("lost")

    monkeypatch.setattr(motions, "locate_by_shooting", lost)
    (point,) = so.frequency_response(so.library.duffing(c=0.05, F=1.4261375), (0.9, 0.78)).bifurcations["BP"]
    check = so.verify(point)
    assert check.agrees
    assert "sees multipliers cross as at branch point" in check.reason
    # at a limit point there are no motions on one side
    assert not so.verify(duffing_curve.bifurcations["LP"][0]).agrees


def test_right_behind_a_grazing_few_harmonics_are_no_other_motion():
    # what they leave out moves those that are kept as well: shooting is 1.8e-3 away
    system = so.System(1.0, 0.05, 1.0, [so.ElasticStop(0, 50.0, 0.5)], [so.HarmonicLoad(0, 0.3)])
    before = so.frequency_response(system, (0.63, 0.633)).orbits[-1]
    motion = so.frequency_response(system, (0.633316, 0.633317), harmonics=9, start=before).orbits[0]
    found = so.verify(motion)
    assert found.outcome == "cannot tell"
    assert 1e-3 < found.distance <= left_out(motion) < 2.0 * found.distance
