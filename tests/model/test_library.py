"""Published systems against the equations and the design rules of their sources."""

from __future__ import annotations

import math

import numpy as np
import pytest

from suboctave.errors import InputError
from suboctave.model import check_derivatives, library


def force(system, x, v):
    """M x'' at t = 0 without loads, from the equation of motion: -(C v + K x + elements)."""
    _, damping, stiffness = system.matrices()
    total = damping @ v + stiffness @ x
    for element in system.elements:
        d = element.direction(system.n)
        c = element.coefficient_values(system.parameters)
        total += d * element.tangent(np.array([d @ x]), np.array([d @ v]), c)[0][0]
    return -total


SYSTEMS = [
    library.reference_oscillator(),
    library.reference_oscillator(j=-0.2, regularization=3000.0),
    library.reference_oscillator_physical(2.0, 0.3, 50.0, 4.0, 200.0, 0.01, 0.004, 3.0),
    library.duffing(),
    library.nltva(),
    library.two_mass_unilateral(),
    library.chain_with_stop(4),
]


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: s.name)
def test_every_element_of_every_system_has_right_derivatives(system):
    for element in system.elements:
        report = check_derivatives(element, parameters=system.parameters)
        assert report.ok, str(report)


@pytest.mark.parametrize("x", [-2.0, -0.5, 0.2, 0.7])
def test_reference_oscillator_is_the_equation_of_the_paper(x):
    zeta, alpha, Kc, j, p, v = 0.03, 0.16, 4.7, 0.3, 0.55, 0.4
    system = library.reference_oscillator(zeta, alpha, Kc, j, p)
    contact = Kc * ((x + 1) * (x < -1) + (x - j) * (x > j))
    expected = -(2 * zeta * v + x + alpha * x**3 + contact)
    assert force(system, np.array([x]), np.array([v]))[0] == pytest.approx(expected, rel=1e-14)
    assert system.force_time(0.3, 2.0)[0] == pytest.approx(p * math.cos(0.6), rel=1e-14)


@pytest.mark.parametrize("regularization", [None, 3e5])
def test_physical_and_dimensionless_forms_are_the_same_motion(regularization):
    """Eq. (39): x = gap1 X, t = T / w0, so that m gap1 w0^2 X'' is the force of the physical system."""
    physical = {"m": 2.0, "c": 0.3, "k": 50.0, "alpha": 4e5, "kc": 240.0, "gap1": 0.01, "gap2": 0.004, "force": 0.3}
    first = library.reference_oscillator_physical(**physical, regularization=regularization)
    numbers = library.nondimensional(**physical, regularization=regularization)
    second = library.reference_oscillator(**numbers)
    w0 = math.sqrt(physical["k"] / physical["m"])
    for X, V in [(-1.7, 0.2), (-0.4, 1.0), (0.1, 0.0), (0.9, -2.0), (2.0, 0.5)]:
        there = force(first, np.array([0.01 * X]), np.array([0.01 * w0 * V]))[0]
        here = force(second, np.array([X]), np.array([V]))[0]
        assert there == pytest.approx(physical["m"] * 0.01 * w0**2 * here, rel=1e-12)
    assert first.force_time(0.0, 1.0)[0] == pytest.approx(physical["k"] * 0.01 * second.force_time(0.0, 1.0)[0])
    with pytest.raises(InputError, match="gap1 must be positive"):
        library.nondimensional(**{**physical, "gap1": 0.0})


def test_absorber_follows_the_generalised_equal_peak_rule():
    """Habib et al. 2015: closed forms for stiffness, damping and cubic stiffness at the mass ratio e."""
    p = library.nltva().parameters
    e = p["m2"] / p["m1"]
    root = math.sqrt(4 + 3 * e)
    k2 = 8 * e * p["k1"] * (16 + 23 * e + 9 * e**2 + 2 * (2 + e) * root)
    k2 /= 3 * (1 + e) ** 2 * (64 + 80 * e + 27 * e**2)
    c2 = math.sqrt(k2 * p["m2"] * (8 + 9 * e - 4 * root) / (4 * (1 + e)))
    knl2 = 2 * e**2 * p["knl1"] / (1 + 4 * e)
    assert (p["k2"], p["c2"], p["knl2"]) == pytest.approx((k2, c2, knl2), abs=6e-5)


def test_two_masses_have_the_frequencies_of_the_golden_ratio():
    mass, _, stiffness = library.two_mass_unilateral().matrices()
    np.testing.assert_array_equal(mass, np.eye(2))
    frequencies = np.sqrt(np.linalg.eigvalsh(stiffness))
    np.testing.assert_allclose(frequencies, [(math.sqrt(5) - 1) / 2, (math.sqrt(5) + 1) / 2], rtol=1e-14)


@pytest.mark.parametrize("masses", [1, 2, 10])
def test_the_chain_has_the_frequencies_of_the_closed_form(masses):
    """Free at the far end: 2 sin((2 i - 1) pi / (4 N + 2))."""
    system = library.chain_with_stop(masses, alpha=0.03, beta=0.2)
    mass, damping, stiffness = system.matrices()
    exact = 2.0 * np.sin((2.0 * np.arange(1, masses + 1) - 1.0) * np.pi / (4 * masses + 2))
    np.testing.assert_allclose(np.sqrt(np.linalg.eigvalsh(stiffness)), exact, rtol=1e-12)
    np.testing.assert_allclose(damping, 0.03 * mass + 0.2 * stiffness, atol=1e-15)
    with pytest.raises(InputError, match=r"masses must be a whole number, not 2\.5"):
        library.chain_with_stop(2.5)


def test_every_argument_is_a_parameter():
    assert set(library.duffing(c=0.12, alpha=-0.1, F=0.2).parameters) == {"m", "c", "k", "alpha", "F"}
    assert library.nltva(0.2).parameters["F"] == 0.2
    assert library.two_mass_unilateral(gap=0.5).parameters["gap"] == 0.5
