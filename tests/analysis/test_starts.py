"""First points: where Newton's method from the linear response fails, and where coexisting motions are chosen from."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.analysis import starts
from suboctave.timedomain import integrate, shoot


@pytest.mark.parametrize("omega", [0.3, 1.0, 1.3])
def test_contact_closed_at_rest(omega):
    """j = 0: the stop touches at rest. The motion found is that of shooting."""
    system = so.library.reference_oscillator()
    curve = so.frequency_response(system, (omega, omega + 0.02))
    orbit = curve.orbits[0]
    assert orbit.omega == omega
    assert orbit.residual < 1e-10
    exact = shoot(system, orbit.start(), omega)
    assert orbit.start() == pytest.approx(exact.state, abs=2e-4)
    assert orbit.amplitude() == pytest.approx(exact.amplitude, rel=1e-5)


@pytest.fixture
def attempts(monkeypatch):
    """Which of the later attempts were made, each still doing its work."""
    made = []
    for name in ("_homotopy", "_integrated"):
        original = getattr(starts, name)
        monkeypatch.setattr(starts, name, lambda *a, f=original, n=name, **k: (made.append(n), f(*a, **k))[1])
    return made


def test_homotopy_takes_over_where_newton_fails(attempts):
    """Stiff stops, strong load: from the linear response Newton does not arrive at every frequency."""
    used = 0
    for omega in (0.3, 0.6, 1.0, 1.3):
        attempts.clear()
        system = so.library.reference_oscillator(Kc=50.0, p=1.7)
        orbit = so.frequency_response(system, (omega, omega * 1.001), 63).orbits[0]
        used += "_homotopy" in attempts
        assert orbit.amplitude() == pytest.approx(shoot(system, orbit.start(), omega).amplitude, rel=1e-3)
    assert used >= 1


@pytest.fixture(scope="module")
def bistable():
    """Both motions of a Duffing oscillator between its folds, by time integration from two states."""
    system, omega = so.library.duffing(c=0.1, F=0.3), 1.4
    period = 2.0 * np.pi / omega
    states = [integrate(system, start, (0.0, 80 * period), omega, rtol=1e-9).end for start in ([0.0, 0.0], [1.5, 0.0])]
    motions = [shoot(system, state, omega) for state in states]
    assert abs(motions[0].amplitude - motions[1].amplitude) > 0.5
    return system, omega, motions


@pytest.mark.parametrize("which", [0, 1], ids=["small", "large"])
@pytest.mark.parametrize("form", ["state", "orbit", "point", "coefficients", "vector"])
def test_start_chooses_the_motion(bistable, which, form):
    system, omega, motions = bistable
    motion = motions[which]
    start = motion.state
    if form != "state":
        point = so.frequency_response(system, (omega, omega + 0.05), start=start).points[0]
        coefficients = point.orbit.coefficients
        start = {"orbit": point.orbit, "point": point, "coefficients": coefficients, "vector": coefficients[:7, 0]}[
            form
        ]
    curve = so.frequency_response(system, (omega, omega + 0.05), start=start)
    assert curve.amplitude[0] == pytest.approx(motion.amplitude, rel=1e-5)
    assert curve.stable[0] == motion.stable


def test_start_at_a_bifurcation():
    """A fold is a start like any other. Both its sides lie in this range: the curve leaves along one of them."""
    system = so.library.duffing(c=0.1, F=0.3)
    fold = so.frequency_response(system, (3.0, 0.5)).bifurcations["LP"][0]
    curve = so.frequency_response(system, (fold.omega, 3.0), start=fold)
    assert len(curve) > 10
    assert curve.omega[-1] in (fold.omega, 3.0)
    assert curve.omega.min() >= fold.omega


def test_impossible_start_says_what_was_tried():
    """A frictionless resonance has no motion: the message lists the attempts."""
    system = so.System(1.0, 0.0, 1.0, loads=[so.HarmonicLoad(0, 1.0)])
    with pytest.raises(
        so.ConvergenceError, match=r"no motion found to start from at omega = 1.*linear response.*start="
    ):
        so.frequency_response(system, (1.0, 2.0))
