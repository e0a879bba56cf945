"""Multipliers of motions with corners, sharp friction, coupled and parametric forces: every method against shooting."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import shoot

SYSTEMS = {
    "one DOF, corners and friction": (
        lambda: so.System(
            1.0, 0.05, 1.0,
            elements=[so.QuadraticDamper(0, 0.1), so.TanhFriction(0, 0.05, 0.02), so.Expression(0, "0.5*max(x, 0)**2")],
            loads=[so.HarmonicLoad(0, 0.5)],
        ),
        (0.98, 1.27),
        (1.0, 1.25),
    ),
    "contact after Hertz, one-way damper": (
        lambda: so.System(
            1.0, 0.05, 1.0,
            elements=[so.Expression(0, "5*max(x - 0.3, 0)**1.5*(1 + 0.5*v)"), so.Expression(0, "0.1*max(-v, 0)")],
            loads=[so.HarmonicLoad(0, 0.5)],
        ),
        (1.18, 1.42),
        (1.2, 1.4),
    ),
    "two DOFs, not symmetric, parametric": (
        lambda: so.System.from_equations(
            [
                "x'' + 0.1*x' + (1 + 0.2*cos(2*omega*t))*x - 0.3*y + 0.4*x*y**2 = 0.3*cos(omega*t)",
                "1.5*y'' + 0.1*y' + 2*y - 0.3*x + 0.2*x**2*y' + 0.3*abs(x')*x' + 0.5*max(x - y - 0.1, 0)*x = 0",
            ]
        ),
        (0.88, 1.22),
        (0.9, 1.2),
    ),
    "rotor against its stator": (so.library.jeffcott_rotor, (0.78, 1.22), (0.8, 1.2)),
}  # fmt: skip


@pytest.fixture(scope="module", params=SYSTEMS, ids=list(SYSTEMS))
def motions(request):
    make, bounds, wanted = SYSTEMS[request.param]
    system = make()
    curve = so.frequency_response(system, bounds, harmonics=15)
    found = []
    for omega in wanted:
        orbit = curve.orbits[int(np.argmin(np.abs(curve.omega - omega)))]
        found.append((orbit, shoot(system, orbit.start(), orbit.omega)))
    return found


@pytest.mark.parametrize("method", ["monodromy", "hill"])
def test_multipliers_agree_with_shooting_as_they_state(motions, method):
    for orbit, exact in motions:
        found = so.stability(orbit, method=method)
        assert found.applicable
        for mu, error in zip(found.multipliers, found.errors, strict=True):
            assert np.abs(exact.multipliers - mu).min() <= 2.0 * error + 1e-7
            assert error < 0.02


def test_the_motion_itself_is_that_of_shooting(motions):
    for orbit, exact in motions:
        size = np.abs(exact.state).max()
        assert np.abs(orbit.start() - exact.state).max() < 5e-3 * size


def test_products_follow_liouville(motions):
    for orbit, exact in motions:
        product = np.prod(so.stability(orbit, method="monodromy").multipliers).real
        assert product == pytest.approx(np.prod(exact.multipliers).real, rel=2e-3)
