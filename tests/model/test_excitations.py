"""Loads of gravity, moving bases and unbalance: their forces in time, and responses in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError

M = np.array([[2.0, 0.3], [0.3, 1.0]])
C = np.array([[0.3, -0.1], [-0.1, 0.2]])
K = np.array([[3.0, -1.0], [-1.0, 2.0]])
R = np.array([1.0, 1.0])
OMEGA = 1.3
T = np.linspace(0.0, 7.0, 9)


def force(load, **parameters):
    system = so.System(M, C, K, loads=[load], parameters=parameters)
    return system.force_time(T, OMEGA)


def test_static_load_and_gravity():
    np.testing.assert_allclose(force(so.StaticLoad(1, "2*g"), g=3.0), [[0.0] * 9, [6.0] * 9])
    np.testing.assert_allclose(force(so.Gravity("g"), g=9.8), np.outer(M @ R * 9.8, np.ones(9)))
    np.testing.assert_allclose(force(so.Gravity(9.8, direction=[0, -1])), np.outer(M @ [0, -9.8], np.ones(9)))


def test_unbalance_of_one_and_two_directions():
    plain = force(so.RotatingUnbalance(0, "me", phase=0.2, harmonic=2), me=0.5)
    np.testing.assert_allclose(plain, [0.5 * (2 * OMEGA) ** 2 * np.cos(2 * OMEGA * T + 0.2), 0.0 * T], atol=1e-14)
    both = force(so.RotatingUnbalance(1, 0.5, perpendicular=0))
    np.testing.assert_allclose(both[1], 0.5 * OMEGA**2 * np.cos(OMEGA * T), atol=1e-14)
    np.testing.assert_allclose(both[0], 0.5 * OMEGA**2 * np.sin(OMEGA * T), atol=1e-14)


def test_base_motion_in_both_coordinates():
    """-M r y'' in relative coordinates, K r y + C r y' in absolute ones, from displacement or acceleration."""
    y = 0.4 * np.cos(OMEGA * T + 0.3)
    rate, acceleration = -0.4 * OMEGA * np.sin(OMEGA * T + 0.3), -(OMEGA**2) * y
    relative = np.outer(-M @ R, acceleration)
    absolute = np.outer(K @ R, y) + np.outer(C @ R, rate)
    given = f"{-(OMEGA**2) * 0.4!r}"
    for coordinates, expected in (("relative", relative), ("absolute", absolute)):
        by_displacement = so.BaseDisplacement("Y", coordinates=coordinates, phase=0.3)
        np.testing.assert_allclose(force(by_displacement, Y=0.4), expected, atol=1e-13)
        by_acceleration = so.BaseAcceleration(given, coordinates=coordinates, phase=0.3)
        np.testing.assert_allclose(force(by_acceleration), expected, atol=1e-13)


def test_matrices_with_parameters_and_other_directions():
    load = so.BaseDisplacement(1.0, direction=[1, 0])
    system = so.System([["m", 0], [0, 1]], C, K, loads=[load], parameters={"m": 3.0})
    assert system.with_parameters(m=5.0).force_time(0.0, 2.0) == pytest.approx([20.0, 0.0])


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_transmissibility(coordinates):
    """|x / y| = sqrt((1 + (2 zeta r)^2) / ((1 - r^2)^2 + (2 zeta r)^2)) of the absolute motion."""
    zeta = 0.1
    system = so.System(
        1.0, 2 * zeta, 1.0, loads=[so.BaseDisplacement("Y", coordinates=coordinates)], parameters={"Y": 0.3}
    )
    curve = so.frequency_response(system, (0.3, 3.0), harmonics=1)
    base = 0.3 if coordinates == "relative" else 0.0
    ratio = np.array([abs(p.harmonic(1) + base) / 0.3 for p in curve.orbits])
    w = curve.omega
    exact = np.sqrt((1 + (2 * zeta * w) ** 2) / ((1 - w**2) ** 2 + (2 * zeta * w) ** 2))
    np.testing.assert_allclose(ratio, exact, rtol=1e-7)


def test_unbalance_response_of_a_rotor():
    """A Jeffcott rotor whirls in a circle of radius `e omega^2 / |k/m - omega^2 + i omega c/m|`."""
    rotor = so.library.jeffcott_rotor(clearance=None)
    m, c, k, me = (rotor.parameters[name] for name in ("m", "c", "k", "me"))
    curve = so.frequency_response(rotor, (0.3, 2.5), harmonics=1)
    w = curve.omega
    exact = me * w**2 / np.abs(k - m * w**2 + 1j * w * c)
    np.testing.assert_allclose([abs(o.harmonic(1, 0)) for o in curve.orbits], exact, rtol=1e-8)
    quarter = [o.harmonic(1, 1) / o.harmonic(1, 0) for o in curve.orbits]
    np.testing.assert_allclose(quarter, -1j * np.ones(len(w)), atol=1e-8)


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: so.RotatingUnbalance(0), "needs mass_eccentricity"),
        (lambda: so.RotatingUnbalance((0, 1), 1.0), r"dof must be a whole number, not \(0, 1\)"),
        (lambda: so.RotatingUnbalance(0, 1.0, 0), "two different DOFs"),
        (lambda: so.RotatingUnbalance(0, 1.0, harmonic=0), "integer from 1 on"),
        (lambda: so.BaseDisplacement(), "needs amplitude"),
        (lambda: so.BaseDisplacement(1.0, coordinates="absolut"), "did you mean 'absolute'"),
        (lambda: so.Gravity(), "needs acceleration"),
        (lambda: so.StaticLoad(0), "needs force"),
        (lambda: so.System(M, C, K, loads=[so.Gravity("g0")], parameters={"g": 1.0}), "unknown parameter 'g0'"),
        (lambda: so.System(M, C, K, loads=[so.Gravity(1.0, direction=[1.0])]), "1 entries, the structure 2"),
        (
            lambda: so.System(
                M, C, K, elements=[so.CubicSpring(0, 1.0)], loads=[so.BaseDisplacement(1.0, coordinates="absolute")]
            ),
            "relative coordinates",
        ),
    ],
)
def test_wrong_loads_are_refused_in_one_line(make, part):
    with pytest.raises(InputError, match=part) as caught:
        make()
    assert "\n" not in str(caught.value)
