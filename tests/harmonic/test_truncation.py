"""The stated truncation against what it estimates: the distance from the same motion with many more harmonics."""

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic import AdaptiveHarmonics, HarmonicBalance, HarmonicBasis
from suboctave.harmonic.truncation import choose_harmonics, truncation

CASES = {
    # the motion's harmonics decay geometrically, like a power of k, and like that power up to the sharpness
    "duffing": (so.library.duffing(c=0.1, k=1.0, alpha=1.0, F=1.0), (0.6, 1.4), 31),
    "exact": (so.library.reference_oscillator(p=0.55, j=0.0), (1.6, 3.5), 255),
    "regularised": (so.library.reference_oscillator(p=0.55, j=0.0, regularization=200.0), (1.6, 3.5), 127),
}


def with_harmonics(solve, system, high, omega, start):
    balance = HarmonicBalance(system, HarmonicBasis(high))
    x = start.basis.resized(start.x, balance.basis) if start is not None else None
    return balance.at(solve(balance, omega, x), omega)


@pytest.mark.parametrize("name", CASES)
def test_estimate_is_honest(solve, name):
    """The estimate is of first order in what is neglected: within a third of the true error, wherever that can be
    seen.
    """
    system, frequencies, many = CASES[name]
    for omega in frequencies:
        branch = so.frequency_response(system, (5.0, omega), harmonics=5)
        x = branch.orbits[-1].coefficients
        reference = with_harmonics(solve, system, many, omega, branch.orbits[-1].state())
        assert x.shape == (11, 1)
        ratios = []
        for high in (5, 7, 9, 15, 25):
            state = with_harmonics(solve, system, high, omega, reference)
            error = np.linalg.norm(state.basis.resized(state.x, reference.basis) - reference.x)
            relative = error / np.linalg.norm(reference.x)
            if relative < 1e-11:
                break
            ratios.append(truncation(state) / relative)
        assert len(ratios) >= 3
        assert 2 / 3 < min(ratios) <= max(ratios) < 4 / 3


def test_the_tolerance_is_kept_along_a_curve(solve):
    """Adaptive harmonics: at every point the stated truncation is below the tolerance, and so is the error."""
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    rule = AdaptiveHarmonics(tolerance=1e-4, event_tolerance=1e-6)
    branch = so.frequency_response(system, (0.6, 1.5), harmonics=rule)
    orbits = branch.orbits
    assert max(orbit.truncation for orbit in orbits) <= 1.5e-4
    assert len({orbit.basis.harmonics for orbit in orbits}) > 1
    for orbit in orbits[:: len(orbits) // 6]:
        reference = with_harmonics(solve, system, 127, orbit.omega, orbit.state())
        error = np.linalg.norm(orbit.basis.resized(orbit.coefficients, reference.basis) - reference.x)
        assert error <= 3e-4 * np.linalg.norm(reference.x)
    for event in branch.bifurcations:
        assert event.orbit.truncation <= 1e-6


def test_choice_of_the_number_of_harmonics():
    """More where the tail is long, fewer where it is short, none changed in between, and never below a load's own."""
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    rule = AdaptiveHarmonics(tolerance=1e-4, event_tolerance=1e-4)
    for high, wanted in ((5, 9), (127, 60)):
        balance = HarmonicBalance(system, HarmonicBasis(high))
        x = np.zeros((balance.basis.size, 1))
        x[1] = 1.0
        state = balance.at(x, 1.0)
        chosen = choose_harmonics(state, rule, rule.tolerance).harmonics
        assert chosen >= wanted if high < wanted else chosen < wanted
        rest = balance.at(np.zeros_like(x), 3.0)
        assert choose_harmonics(rest, rule, rule.tolerance) == balance.basis
    # without any nonlinear force nothing is neglected: down to the least allowed
    linear = so.System(1.0, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0), so.HarmonicLoad(0, 0.1, harmonic=7)])
    for nu in (1, 2):
        state = HarmonicBalance(linear, HarmonicBasis(15 * nu, nu)).at(np.eye(30 * nu + 1)[:, 1:2], 0.9)
        low = choose_harmonics(state, rule, rule.tolerance)
        assert (low.harmonics, low.nu) == (7 * nu, nu)


def test_an_undamped_vibration_right_at_a_neglected_harmonic_has_a_large_response():
    """Natural frequencies 5 and 6, the load at 1: the fifth harmonic of the cubic's force meets a resonance."""
    system = so.System(
        np.eye(2), np.zeros((2, 2)), np.diag([25.0, 36.0]), [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 1.0)]
    )
    balance = HarmonicBalance(system, HarmonicBasis(3))
    x = np.zeros((7, 2))
    x[1, 0], x[5, 0] = 0.1, 0.01
    state = balance.at(x, 1.0)
    assert np.isfinite(state.neglected).all()
    # the resonance outgrows what the other harmonics do
    assert np.abs(state.neglected[1, 0]) > 1e3 * np.abs(state.neglected[[0, 2, 3]]).max()
    one = so.System(1.0, 0.0, 25.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 1.0)])
    assert np.isfinite(truncation(HarmonicBalance(one, HarmonicBasis(3)).at(x[:, :1], 1.0)))
