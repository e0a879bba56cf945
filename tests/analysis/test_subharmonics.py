"""Sub-harmonic motions that no period doubling leads to, against shooting."""

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.timedomain import shoot


@pytest.fixture(scope="module")
def oscillator():
    return so.System.from_equations("x'' + 0.02*x' + x + 0.05*x**3 = 5*cos(omega*t)")


@pytest.fixture(scope="module")
def isola(oscillator):
    return so.frequency_response(oscillator, (2.0, 12.0), subharmonic=3)


def test_the_third_of_the_load_frequency_is_answered_on_a_closed_branch(isola):
    """One isolated curve, with two limit points that shooting finds in the same places, and nothing else."""
    assert isola.closed
    assert isola.nu == 3
    assert [b.kind for b in isola.bifurcations] == ["LP", "LP"]
    for item in isola.bifurcations:
        assert so.verify(item).agrees
    assert np.ptp(isola.omega) > 3.0
    # half of it is stable, and what is, shooting finds so
    for share in (0.2, 0.7):
        orbit = isola.orbits[int(share * len(isola))]
        exact = shoot(orbit.system, orbit.start(), orbit.omega, periods=3)
        np.testing.assert_allclose(orbit.start(), exact.state, atol=1e-4)
        assert exact.stable == bool(isola.stable[int(share * len(isola))])


def test_all_that_is_found_is_found_once(oscillator, isola):
    found = so.find_subharmonics(oscillator, (4.0, 6.0), subharmonic=3, seeds=so.Seeds(frequencies=5))
    # the closed curve is cut into its two sides by the range
    assert len(found) == 2
    assert all(not branch.closed for branch in found)
    levels = sorted(level for branch in found for level in levels_at(branch, 5.0))
    np.testing.assert_allclose(levels, sorted(levels_at(isola, 5.0)), rtol=1e-3)
    assert len(levels) == 2


def levels_at(branch, omega):
    """Amplitudes with which a branch passes a frequency."""
    found = []
    for i in np.flatnonzero((branch.omega[:-1] - omega) * (branch.omega[1:] - omega) < 0.0):
        share = (omega - branch.omega[i]) / (branch.omega[i + 1] - branch.omega[i])
        found.append(float(branch.amplitude[i] + share * (branch.amplitude[i + 1] - branch.amplitude[i])))
    return found


def test_from_a_state_in_time(oscillator, isola):
    """Integration settles on the stable motion; harmonic balance continues it."""
    known = isola.orbits[int(np.argmax(isola.stable))]
    orbit = so.periodic_orbit(oscillator, known.omega, start=1.02 * known.start(), subharmonic=3, transient=20)
    assert orbit.basis.nu == 3
    np.testing.assert_allclose(orbit.amplitude(), known.amplitude(), rtol=1e-5)
    again = so.continue_branch(orbit, "omega", (2.0, 12.0))
    assert again.closed
    np.testing.assert_allclose(
        sorted(b.omega for b in again.bifurcations), sorted(b.omega for b in isola.bifurcations), atol=1e-7
    )


def test_nothing_there(oscillator):
    """A linear oscillator has none, and says so."""
    linear = so.System(1.0, 0.05, 1.0, loads=[so.HarmonicLoad(0, 1.0)])
    assert so.find_subharmonics(linear, (0.5, 4.0), subharmonic=3) == []
    with pytest.raises(ConvergenceError, match="no motion of 2 load periods was found"):
        so.frequency_response(linear, (0.5, 4.0), subharmonic=2)


def test_wrong_input(oscillator, isola):
    with pytest.raises(InputError, match="subharmonic must be a whole number"):
        so.frequency_response(oscillator, (2.0, 5.0), subharmonic=2.5)
    with pytest.raises(InputError, match="leave one of them out"):
        so.frequency_response(oscillator, (5.0, 6.0), subharmonic=2, start=isola.orbits[0])
    with pytest.raises(InputError, match="start must be 2 finite numbers"):
        so.periodic_orbit(oscillator, 5.0, start=[1.0])
    with pytest.raises(InputError, match="Seeds: phases"):
        so.Seeds(phases=0)


@pytest.mark.parametrize(("omega", "asked"), [(1.0, 2), (1.0, 3), (1.0, 6)])
def test_a_motion_that_repeats_earlier_has_its_own_period(omega, asked):
    """Nothing but the load's motion is near: it is none of three periods because three were asked for."""
    system = so.library.duffing(c=0.1, F=0.1)
    orbit = so.periodic_orbit(system, omega, start=[0.1, 0.0], subharmonic=asked)
    assert orbit.basis.nu == orbit.own_period == 1
    same = so.periodic_orbit(system, omega, start=[0.1, 0.0])
    assert orbit.amplitude() == pytest.approx(same.amplitude(), rel=1e-8)
