"""The rattling oscillator held against shooting: every limit point and period doubling, none missing, none added."""

from __future__ import annotations

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.timedomain import locate_by_shooting, shoot

CASES = [(0.55, 0.0), (0.55, 1.0), (1.7, 0.0)]


@pytest.mark.parametrize("harmonics", ["adaptive", 31])
@pytest.mark.parametrize(("p", "j"), CASES)
def test_arctan_law_of_sharpness_3000(oscillator_curve, reference, same_events, p, j, harmonics):
    curve = oscillator_curve(p, j, 3000.0, harmonics=harmonics)
    expected = reference["reference_oscillator"][f"s3000_p{p:g}_j{j:g}"]
    same_events(curve.bifurcations, expected, omega=1e-6, amplitude=1e-5)
    assert not curve.warnings


@pytest.mark.parametrize(("p", "j"), CASES)
def test_the_same_bifurcations_from_the_other_end(oscillator_curve, reference, same_events, p, j):
    curve = oscillator_curve(p, j, 3000.0, omega=(1.25, 4.5))
    same_events(curve.bifurcations, reference["reference_oscillator"][f"s3000_p{p:g}_j{j:g}"], omega=1e-6)


@pytest.mark.parametrize(("harmonics", "tolerance"), [("adaptive", 3e-7), (31, 3e-7), (63, 2e-8)])
def test_exact_law(oscillator_curve, reference, same_events, harmonics, tolerance):
    """The exact law's period doublings lie 0.01 and 0.02 below those of the arctan law: no sharpness replaces it."""
    curve = oscillator_curve(0.55, omega=(4.5, 1.3), harmonics=harmonics)
    same_events(curve.bifurcations, reference["reference_oscillator"]["exact_p0.55_j0"], omega=tolerance)


@pytest.fixture(scope="module")
def doublings_near_grazing(oscillator_curve):
    """Those of the exact law below omega = 1.3, by shooting from the default curve."""
    curve = oscillator_curve(0.55, omega=(4.5, 1.2))
    starts = [shoot(curve.system, b.orbit.start(), b.omega * (1.0 + 1e-4)) for b in curve.bifurcations["PD"][2:]]
    return [locate_by_shooting(curve.system, "PD", start.state, start.omega) for start in starts]


@pytest.mark.parametrize("max_step", [None, 0.01], ids=["default", "small-steps"])
def test_exact_law_near_grazing_by_shooting(oscillator_curve, reference, doublings_near_grazing, max_step):
    """Just before the left stop is left for good the exact law has two more period doublings, close together.

    With default steps both lie within one: the pair of multipliers meets at -1 and parts again.
    """
    expected = reference["reference_oscillator"]["exact_p0.55_j0_below_1.3"]
    curve = oscillator_curve(0.55, omega=(4.5, 1.2), max_step=max_step)
    found = [b for b in curve.bifurcations["PD"] if b.omega < 1.3]
    assert [b.omega for b in found] == pytest.approx([e[1] for e in expected], abs=1e-6)
    for b, (_, omega, _), witness in zip(found, expected, doublings_near_grazing, strict=True):
        assert witness.omega == pytest.approx(omega, abs=1e-9)
        assert b.omega == pytest.approx(witness.omega, abs=3e-7)
        assert b.amplitude == pytest.approx(witness.amplitude, abs=1e-5)


@pytest.mark.parametrize("omega", [(3.7, 1.9), (1.9, 3.7)], ids=["down", "up"])
@pytest.mark.parametrize("max_step", [0.03, 0.3, *slow(0.01, 0.1)])
def test_no_false_folds_at_any_step(oscillator_curve, max_step, omega):
    """With 256 samples a harmonic balance shows 24 false folds here; an exactly integrated force shows none."""
    curve = oscillator_curve(1.7, omega=omega, max_step=max_step)
    assert sorted(b.omega for b in curve.bifurcations["LP"]) == pytest.approx([2.1312752, 3.5921913], abs=1e-6)
    turns = np.count_nonzero(np.diff(np.sign(np.diff(curve.omega))))
    assert turns == 2


@pytest.mark.parametrize("harmonics", ["adaptive", 31])
def test_multipliers_by_shooting(reference, harmonics):
    system = so.library.reference_oscillator(regularization=3000.0)
    curve = so.frequency_response(system, (3.0, 2.95), harmonics=harmonics)
    expected = reference["reference_oscillator"]["s3000_p0.55_j0_multipliers_at_omega_3"]
    assert np.sort(curve.multipliers[0].real) == pytest.approx(expected, abs=1e-4)
    assert np.abs(curve.multipliers[0].imag).max() < 1e-12
    assert not curve.stable[0]


def test_liouville_along_the_curve(oscillator_curve):
    """The product of the multipliers is exp(-2 zeta T), whatever the stops do: they have no damping."""
    curve = oscillator_curve(0.55, omega=(4.5, 1.3))
    expected = np.exp(-0.06 * 2.0 * np.pi / curve.omega)
    assert np.prod(curve.multipliers, axis=1) == pytest.approx(expected, rel=1e-4)


def test_stability_changes_at_every_bifurcation_and_nowhere_else(oscillator_curve):
    """One degree of freedom: each LP and PD carries one multiplier through the circle."""
    curve = oscillator_curve(1.7, 0.0, 3000.0)
    places = np.searchsorted(curve.arclength, [b.arclength for b in curve.bifurcations])
    changes = np.flatnonzero(np.diff(curve.stable.astype(int))) + 1
    assert changes.tolist() == places.tolist()
