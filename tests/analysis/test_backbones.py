"""`phase_resonance`: the resonance is found and followed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

import suboctave as so


def free_frequency(amplitude):
    """Of `x'' + x + x^3` at an amplitude, by the elliptic integral."""
    square = amplitude**2
    return 0.5 * np.pi * np.sqrt(1.0 + square) / ellipk(0.5 * square / (1.0 + square))


def test_it_lies_on_the_free_vibration_but_for_the_square_of_the_damping():
    distances = []
    for zeta in (0.01, 0.02, 0.04):
        force = zeta
        system = so.System(1.0, 2.0 * zeta, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, "F")], {"F": force})
        curve = so.phase_resonance(
            system, parameter="F", bounds=(0.2 * force, 4.0 * force), omega=(0.7, 2.5), harmonics=15
        )
        free = free_frequency(curve.amplitude)
        at = np.argmin(np.abs(curve.amplitude - 0.8))
        distances.append(abs(curve.omega[at] / free[at] - 1.0))
    assert distances[1] / distances[0] == pytest.approx(4.0, rel=0.15)
    assert distances[2] / distances[1] == pytest.approx(4.0, rel=0.15)


def test_it_is_what_track_follows_from_the_peak():
    system = so.library.duffing(c=0.05, alpha=1.0, F=0.1)
    curve = so.phase_resonance(system, parameter="F", bounds=(0.05, 0.2), omega=(0.7, 2.0), harmonics=3)
    np.testing.assert_allclose(curve.omega, free_frequency(curve.amplitude), rtol=2e-3)
    response = so.frequency_response(system, (0.7, 2.0), harmonics=3)
    peak = response.points[int(np.argmax(response.amplitude))]
    same = so.track(peak, "F", (0.05, 0.2), onto="phase_resonance")
    by_force = np.argsort(curve.parameter("F"))
    np.testing.assert_allclose(
        np.interp(same.parameter("F"), curve.parameter("F")[by_force], curve.omega[by_force]), same.omega, rtol=1e-3
    )


@pytest.mark.parametrize(("harmonic", "order", "omega", "force"), [(3, 1, (0.3, 0.6), 0.5), (1, 3, (2.9, 5.0), 3.0)])
def test_superharmonic_and_subharmonic_resonances(harmonic, order, omega, force):
    system = so.library.duffing(c=0.02, alpha=1.0, F=force)
    curve = so.phase_resonance(
        system,
        parameter="F",
        bounds=(0.97 * force, 1.03 * force),
        omega=omega,
        harmonic=harmonic,
        subharmonic=order,
        harmonics=7,
    )
    assert len(curve) > 3
    for orbit in curve.orbits:
        z = orbit.harmonic(harmonic / order)
        assert abs((z**order).real) < 1e-7 * abs(z) ** order


def test_what_has_no_phase_is_refused():
    two = so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, ["F", 0.1], [1, 2])], {"F": 0.1})
    with pytest.raises(so.InputError, match="multiples 1, 2 of omega"):
        so.phase_resonance(two, parameter="F", bounds=(0.05, 0.2), omega=(0.7, 2.0))
    one = so.library.duffing(F=0.1)
    with pytest.raises(so.InputError, match="common factor"):
        so.phase_resonance(one, parameter="F", bounds=(0.05, 0.2), omega=(0.7, 2.0), harmonic=2, subharmonic=2)
    with pytest.raises(so.ConvergenceError, match="in quadrature"):
        so.phase_resonance(one, parameter="F", bounds=(0.05, 0.2), omega=(0.1, 0.2), harmonics=3)
