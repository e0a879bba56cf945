"""Responses that a formula gives: linear structures under every kind of load, a stop that never opens."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import shoot

M, C, K = 2.0, 0.3, 5.0


def receptance(omega):
    return 1.0 / (K - M * omega**2 + 1j * C * omega)


def linear(loads, **parameters):
    return so.System(M, C, K, loads=loads, parameters=parameters)


def test_one_load():
    curve = so.frequency_response(linear([so.HarmonicLoad(0, 0.7, phase=0.4)]), (0.5, 3.0))
    assert curve.harmonic(1) == pytest.approx(0.7 * np.exp(0.4j) * receptance(curve.omega), rel=1e-9)
    assert curve.amplitude == pytest.approx(np.abs(0.7 * receptance(curve.omega)), rel=1e-9)
    assert curve.stable.all()
    assert not curve.bifurcations


def test_multipliers_of_a_linear_oscillator():
    curve = so.frequency_response(linear([so.HarmonicLoad(0, 0.7)]), (0.5, 3.0))
    poles = np.roots([M, C, K])
    for omega, mu in zip(curve.omega, curve.multipliers, strict=True):
        expected = np.exp(poles * 2.0 * np.pi / omega)
        assert np.sort_complex(mu) == pytest.approx(np.sort_complex(expected), abs=1e-9)


def test_several_harmonics_with_phases_and_a_static_part():
    """Superposition: every harmonic answers alone, the static part by the stiffness."""
    load = so.HarmonicLoad(0, amplitude=[1.0, 0.5, 0.2], harmonic=[1, 2, 7], phase=[0.0, 0.3, -1.1], static=0.4)
    curve = so.frequency_response(linear([load]), (0.4, 1.0))
    assert curve.harmonic(0).real == pytest.approx(np.full(len(curve), 0.4 / K), rel=1e-10)
    for k, a, phase in ((1, 1.0, 0.0), (2, 0.5, 0.3), (7, 0.2, -1.1)):
        assert curve.harmonic(k) == pytest.approx(a * np.exp(1j * phase) * receptance(k * curve.omega), rel=1e-9)
    assert np.abs(curve.harmonic(3)).max() < 1e-12


def test_unbalance():
    """Force `m e omega^2`: the amplitude tends to `m e / M` far above resonance."""
    curve = so.frequency_response(linear([so.HarmonicLoad(0, "me*omega**2")], me=0.2), (0.2, 40.0))
    assert np.abs(curve.harmonic(1)) == pytest.approx(np.abs(0.2 * curve.omega**2 * receptance(curve.omega)), rel=1e-9)
    assert curve.amplitude[-1] == pytest.approx(0.2 / M, rel=3e-3)


def test_sweep_of_a_parameter_of_the_load():
    system = linear([so.HarmonicLoad(0, "me*omega**2")], me=0.2)
    sweep = so.continue_branch(system, "me", (0.1, 0.4), omega=1.3)
    assert sweep.harmonic(1) == pytest.approx(sweep.parameter("me") * 1.3**2 * receptance(1.3), rel=1e-9)


def test_sweep_of_the_stiffness():
    system = so.System(M, C, "k", loads=[so.HarmonicLoad(0, 0.7)], parameters={"k": K})
    sweep = so.continue_branch(system, "k", (K, 0.5), omega=1.1)
    k = sweep.parameter("k")
    assert sweep.harmonic(1) == pytest.approx(0.7 / (k - M * 1.1**2 + 1.1j * C), rel=1e-9)
    assert k[[0, -1]].tolist() == [K, 0.5]


@pytest.mark.parametrize("regularization", [None, 1e6], ids=["exact", "arctan"])
def test_preloaded_stop_that_stays_closed(regularization):
    """A right stop with its gap at -b < 0 is closed at rest; while u > -b the structure is linear with both springs."""
    stop = so.ElasticStop(0, 4.0, -0.5, side="right", regularization=regularization)
    curve = so.frequency_response(so.System(M, C, K, [stop], [so.HarmonicLoad(0, 0.1)]), (0.5, 3.5))
    # the arctan law's force is K/(2 pi s) ln(...) away from the exact one: about 1e-6 here
    accuracy = 1e-8 if regularization is None else 1e-5
    assert curve.harmonic(0).real == pytest.approx(np.full(len(curve), -4.0 * 0.5 / (K + 4.0)), rel=accuracy)
    assert curve.harmonic(1) == pytest.approx(0.1 / (K + 4.0 - M * curve.omega**2 + 1j * C * curve.omega), rel=accuracy)
    assert not curve.bifurcations


def test_preloaded_stop_that_opens():
    """Beyond that no formula: the motion of shooting."""
    stop = so.ElasticStop(0, 4.0, -0.1, side="right")
    system = so.System(M, C, K, [stop], [so.HarmonicLoad(0, 1.2)])
    curve = so.frequency_response(system, (0.5, 3.5))
    assert curve.harmonic(2).__abs__().max() > 1e-3
    for orbit in (curve.orbits[len(curve) // 3], curve.orbits[len(curve) // 2]):
        exact = shoot(system, orbit.start(), orbit.omega)
        assert orbit.start() == pytest.approx(exact.state, abs=1e-4)
        assert orbit.amplitude() == pytest.approx(exact.amplitude, rel=1e-5)


def test_static_load_on_a_nonlinear_oscillator():
    """A constant force bends the symmetric oscillator: even harmonics, and the motion of shooting."""
    loads = [so.HarmonicLoad(0, 0.4, static=0.6)]
    system = so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, 1.0)], loads)
    curve = so.frequency_response(system, (3.5, 0.9), harmonics=25)
    assert np.abs(curve.harmonic(2)).max() > 0.01
    for orbit in curve.orbits[:: len(curve) // 4]:
        check = so.verify(orbit, tolerance=1e-8)
        assert check.agrees, check


def test_loads_of_several_harmonics_on_a_nonlinear_oscillator():
    loads = [so.HarmonicLoad(0, [0.3, 0.2], harmonic=[1, 3], phase=[0.2, 1.0]), so.HarmonicLoad(1, 0.1, phase=-0.7)]
    system = so.System(
        np.diag([1.0, 0.5]), 0.05 * np.eye(2), [[2.0, -1.0], [-1.0, 1.0]], [so.CubicSpring((0, 1), 0.5)], loads
    )
    curve = so.frequency_response(system, (2.6, 2.2), harmonics=25)
    for orbit in (curve.orbits[0], curve.orbits[-1]):
        check = so.verify(orbit, tolerance=1e-8)
        assert check.agrees, check


def test_a_response_with_a_stop_may_have_one_harmonic():
    """There are no fewer ones to tell from what neglected harmonics do beside a grazing."""
    response = so.frequency_response(so.library.reference_oscillator(p=0.55, j=0.0), (4.5, 1.3), harmonics=1)
    assert response.ended == "reached the end of the range at omega = 1.3"
