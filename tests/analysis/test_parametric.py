"""Parametric excitation: the Mathieu tongue in closed form, on branches and at rest; motions against shooting."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import shoot


def boundary(c, eps):
    """Frequencies at which rest of `x'' + c x' + (1 + eps cos omega t) x = 0` loses its stability, to O(eps^3).

    Hill's determinant of the half-odd waves 1/2 and 3/2 (real and imaginary parts of a wave and its neighbour), solved
    for omega; at 2 by the leading order `omega = 2 +- sqrt(eps^2 / 4 - c^2)`.
    """
    from scipy.optimize import brentq

    def determinant(omega):
        # waves exp(i k omega t), k = -5/2 .. 5/2
        k = np.arange(-5.5, 6.0)
        s = 1j * k * omega
        matrix = np.diag(s**2 + c * s + 1.0) + 0.5 * eps * (np.eye(12, k=1) + np.eye(12, k=-1))
        return np.linalg.det(matrix / np.maximum(1.0, np.abs(s) ** 2)[:, None]).real

    spread = np.sqrt(max(eps**2 / 4.0 - c**2, 0.0))
    return [brentq(determinant, 2.0 - 2.0 * spread - 0.01, 2.0), brentq(determinant, 2.0, 2.0 + 2.0 * spread + 0.01)]


def rest(**parameters):
    return so.library.mathieu_duffing(F=0.0, **parameters)


@pytest.mark.parametrize(("c", "eps"), [(0.05, 0.2), (0.02, 0.06)])
def test_rest_loses_its_stability_on_the_boundary_of_the_tongue(c, eps):
    curve = so.frequency_response(rest(c=c, eps=eps), (1.7, 2.3))
    assert not curve.amplitude.any()
    found = [b.omega for b in curve.bifurcations["PD"]]
    np.testing.assert_allclose(found, boundary(c, eps), rtol=1e-8)
    assert len(curve.bifurcations) == 2
    spread = np.sqrt(eps**2 / 4.0 - c**2)  # Nayfeh & Mook, to first order
    np.testing.assert_allclose(found, [2.0 - spread, 2.0 + spread], atol=eps**2 / 8.0 + c**2 + 1e-3)
    inside = (curve.omega > found[0]) & (curve.omega < found[1])
    np.testing.assert_array_equal(curve.stable, ~inside)
    assert so.verify(curve.bifurcations["PD"][0]).agrees


def test_the_tip_of_the_tongue():
    """At omega = 2 rest loses its stability where eps reaches 2 c, up to terms of third order."""
    c = 0.03
    sweep = so.continue_branch(rest(c=c, eps=0.01), "eps", (0.01, 0.2), omega=2.0)
    (tip,) = sweep.bifurcations["PD"]
    assert tip.parameters["eps"] == pytest.approx(2.0 * c, rel=5e-3)
    omega = [o for o in np.linspace(1.97, 2.03, 13) if abs(o - 2.0) > 1e-9]
    others = [
        so.continue_branch(rest(c=c, eps=0.01), "eps", (0.01, 0.2), omega=o).bifurcations["PD"][0] for o in omega[::4]
    ]
    assert all(other.parameters["eps"] > tip.parameters["eps"] - 1e-4 for other in others)


def test_a_curve_with_load_and_its_doublings_against_shooting():
    system = so.library.mathieu_duffing(F=0.1)
    curve = so.frequency_response(system, (1.7, 2.3))
    doublings = curve.bifurcations["PD"]
    assert len(doublings) == 2
    assert all(so.verify(b).agrees for b in doublings)
    orbit = curve.orbits[len(curve) // 2]
    exact = shoot(system, orbit.start(), orbit.omega)
    np.testing.assert_allclose(orbit.start(), exact.state, atol=1e-4)
    np.testing.assert_allclose(
        np.sort_complex(so.stability(orbit).multipliers), np.sort_complex(exact.multipliers), atol=1e-4
    )


def test_motions_of_twice_the_period_see_the_excitation_at_its_own_period():
    """Beyond the tongue's boundary there is a 2T motion about rest: amplitude by averaging, state by shooting."""
    c, eps, gamma, omega = 0.05, 0.2, 0.3, 2.0
    system = rest(c=c, eps=eps, gamma=gamma)
    exact = shoot(system, [0.5, -0.3], omega, periods=2)
    balance = so.HarmonicBalance(system, so.HarmonicBasis(9, 2))
    x = np.zeros((balance.basis.size, 1))
    x[1], x[2] = exact.state[0], exact.state[1]
    for _ in range(30):
        state = balance.at(x, omega)
        x = x - np.linalg.solve(state.jacobian, state.residual).reshape(x.shape)
    k = np.arange(1, 10)
    start = [x[0, 0] + x[1::2, 0].sum(), omega / 2 * (k * x[2::2, 0]).sum()]
    np.testing.assert_allclose(start, exact.state, atol=1e-7)
    # 3/4 gamma a^2 = sqrt(eps^2/4 - c^2) at omega = 2 (averaging, first order)
    a = np.hypot(x[1, 0], x[2, 0])
    assert 0.75 * gamma * a**2 == pytest.approx(np.sqrt(eps**2 / 4 - c**2), rel=0.05)


def test_van_der_pol_locked_to_its_load():
    """x'' - mu (1 - x^2) x' + x = p cos(omega t), from equations, against shooting."""
    system = so.System.from_equations("x'' - mu*(1 - x**2)*x' + x = p*cos(omega*t)", {"mu": 0.4, "p": 0.8})
    locked = shoot(system, [2.0, 0.0], 1.0)
    curve = so.frequency_response(system, (1.0, 1.1), start=locked.state)
    orbit = curve.orbits[len(curve) // 2]
    exact = shoot(system, orbit.start(), orbit.omega)
    np.testing.assert_allclose(orbit.start(), exact.state, atol=1e-4)
    assert bool(curve.stable[len(curve) // 2]) == exact.stable


def test_rest_in_a_corner_has_no_linear_neighbourhood():
    """A contact that is closed at rest, and nothing that pushes: no bifurcation is made up there."""
    text = "x'' + 0.05*x' + (1 + 0.2*cos(omega*t))*x + 3*max(x, 0) = 0"
    curve = so.frequency_response(so.System.from_equations(text), (1.7, 2.3))
    assert not curve.amplitude.any()
    assert len(curve.bifurcations) == 0


def test_neither_load_nor_excitation_is_refused():
    system = so.System.from_equations("x'' + 0.1*x' + x + x**3 = 0")
    with pytest.raises(so.InputError, match="no periodic load"):
        so.frequency_response(system, (0.5, 1.5))


@pytest.mark.parametrize("omega", [(1.1, 0.8), (0.8, 1.1)])
def test_a_response_to_a_force_of_an_element_begins_without_a_doubt(omega):
    """A plate between electrodes: no load moves it, and the guess at rest has no size to measure the motion by."""
    force = so.Expression(0, "-b*(V+a*cos(omega*t))**2/(1-x)**2")
    curve = so.frequency_response(so.System(1.0, 0.02, 1.0, [force], parameters={"b": 1.0, "V": 0.1, "a": 0.02}), omega)
    assert not curve.warnings
