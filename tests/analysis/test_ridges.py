"""Ridges: the amplitude is extreme along the response at every point of the curve."""

from __future__ import annotations

import re

import numpy as np
import pytest

import suboctave as so

RIDGES = ["ridge", {"name": "harmonic_ridge", "harmonic": 1}, {"name": "harmonic_ridge", "harmonic": 3}]


def amplitude_of(orbit, onto, dof=0):
    return orbit.amplitude(dof) if onto == "ridge" else abs(orbit.harmonic(onto["harmonic"], dof))


def offset(orbit, name, value, onto):
    """How far the extremum of the amplitude over a parameter lies from a motion, from two parabolas through motions
    beside it.
    """
    here, found = amplitude_of(orbit, onto), []
    for h in (8e-4, 4e-4):
        after, before = (
            amplitude_of(so.continue_branch(orbit, name, (value, value + s * h)).orbits[-1], onto) for s in (1.0, -1.0)
        )
        found.append(0.5 * h * (after - before) / abs(after - 2.0 * here + before))
    return (4.0 * found[1] - found[0]) / 3.0


@pytest.mark.parametrize("onto", RIDGES)
def test_every_point_is_an_extremum_of_its_response(onto):
    system = so.library.duffing(c=0.2, alpha=0.3, F=0.2)
    response = so.frequency_response(system, (0.7, 2.0), harmonics=7)
    start = response.points[int(np.argmax([amplitude_of(orbit, onto) for orbit in response.orbits]))]
    ridge = so.track(start, "F", (0.1, 0.4), onto=onto)
    assert ridge.parameter("F").max() == pytest.approx(0.4)
    for orbit in ridge.orbits[::6]:
        assert abs(offset(orbit, "omega", orbit.omega, onto)) < 2e-8


def test_over_the_load_at_a_frequency():
    """The first of two named parameters is the one along which the amplitude is extreme."""
    system = so.System(1.0, 0.2, "k", [so.CubicSpring(0, 0.3)], [so.HarmonicLoad(0, "F")], {"k": 1.0, "F": 0.2})
    response = so.continue_branch(system, "k", (0.3, 3.0), omega=1.2, harmonics=5)
    start = response.points[int(np.argmax(response.amplitude))]
    ridge = so.track(start, ("k", "F"), ((0.1, 4.0), (0.1, 0.3)), onto="ridge")
    for orbit in ridge.orbits[::6]:
        assert abs(offset(orbit, "k", orbit.values["k"], "ridge")) < 2e-8


def test_a_nonlinear_absorber_has_its_peaks_on_it():
    system = so.library.nltva(F=0.05)
    response = so.frequency_response(system, (0.8, 1.4), harmonics=5)
    ridge = so.track_peak(response, "F", (0.02, 0.08))
    force = ridge.parameter("F")
    for value in np.linspace(0.03, 0.07, 5):
        peaks = so.frequency_response(system.with_parameters(F=value), (0.8, 1.4), harmonics=5, max_step=0.02).amplitude
        inside = peaks[1:-1][(peaks[1:-1] >= peaks[:-2]) & (peaks[1:-1] >= peaks[2:])]
        on_ridge = np.interp(value, force[np.argsort(force)], ridge.amplitude[np.argsort(force)])
        assert np.abs(inside / on_ridge - 1.0).min() < 2e-3


def test_a_ridge_is_saved_and_drawn(tmp_path):
    system = so.library.duffing(c=0.2, alpha=0.3, F=0.2)
    response = so.frequency_response(system, (0.7, 2.0), harmonics=3)
    ridge = so.track(response.points[int(np.argmax(response.amplitude))], "F", (0.15, 0.25), onto="ridge")
    ridge.save(tmp_path / "ridge.nc")
    again = so.load(tmp_path / "ridge.nc")
    assert repr(again) == repr(ridge)
    so.plot([response, again], tmp_path / "ridge.png", x="omega")
    assert (tmp_path / "ridge.png").stat().st_size > 10_000


def test_what_has_no_peak_is_refused():
    system = so.library.duffing(c=0.2, alpha=0.3, F=0.2)
    over_load = so.continue_branch(system, "F", (0.1, 0.2), omega=1.0, harmonics=3)
    with pytest.raises(so.InputError, match="response over omega"):
        so.track_peak(over_load, "c", (0.1, 0.3))
    response = so.frequency_response(system, (0.7, 2.0), harmonics=3)
    with pytest.raises(so.InputError, match="positive multiple"):
        so.track_peak(response, "F", (0.1, 0.3), harmonic=0)
    with pytest.raises(so.InputError, match="did you mean 'alpha'"):
        so.track_peak(response, "alpa", (0.1, 0.3))
    third = so.track_peak(response, "F", (0.15, 0.25), harmonic=3)
    assert third.kind == "harmonic_ridge"
    rising = so.frequency_response(system, (0.5, 0.9), harmonics=3)
    with pytest.raises(so.InputError, match=r"largest at an end of the response, omega = 0.9, .* wider range$"):
        so.track_peak(rising, "F", (0.15, 0.25))


def test_a_response_that_is_highest_at_an_end_names_the_peak_inside_it():
    response = so.frequency_response(so.library.nltva(F=0.05), (0.94, 1.2), harmonics=5)
    heights = response.amplitude
    assert np.argmax(heights) in (0, len(response) - 1)
    with pytest.raises(so.InputError, match=r"give the point beside another peak: response.points\[(\d+)\]") as refused:
        so.track_peak(response, "F", (0.04, 0.06))
    place = int(re.search(r"points\[(\d+)\]", str(refused.value)).group(1))
    assert heights[place - 1] < heights[place] > heights[place + 1]


@pytest.mark.slow
def test_twenty_responses_of_a_nonlinear_absorber_have_their_peaks_on_the_ridge():
    system = so.library.nltva(F=0.05)
    response = so.frequency_response(system, (0.8, 1.4), harmonics=5)
    ridge = so.track_peak(response, "F", (0.02, 0.08))
    assert len(ridge) >= 20
    for i in np.linspace(0, len(ridge) - 1, 20).astype(int):
        orbit = ridge.orbits[i]
        assert abs(offset(orbit, "omega", orbit.omega, "ridge")) < 1e-7


def damped_absorber(zeta):
    """An absorber of a twentieth of the mass, tuned as it should be, on a mass without damping of its own."""
    m, f = 0.05, 1.0 / 1.05
    stiffness = [[1.0 + m * f**2, -m * f**2], [-m * f**2, m * f**2]]
    damping = {"zeta": 2.0 * m * f * np.array([[1.0, -1.0], [-1.0, 1.0]])}
    return so.System(np.diag([1.0, m]), damping, stiffness, loads=[so.HarmonicLoad(0, 1.0)], parameters={"zeta": zeta})


def test_the_lowest_peak_over_the_damping_of_an_absorber():
    """A ridge's own extremum against the closed form of the linear response."""
    from scipy.optimize import minimize_scalar

    def peak(zeta, ends):
        mass, damping, stiffness = damped_absorber(zeta).matrices()

        def response(omega):
            return -abs(np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, [1.0, 0.0])[0])

        return -minimize_scalar(response, bounds=ends, method="bounded", options={"xatol": 1e-12}).fun

    response = so.frequency_response(damped_absorber(0.1), (0.93, 1.15), harmonics=1)
    ridge = so.track_peak(response, "zeta", (0.05, 0.3))
    # the ridge goes on to the valley between the two peaks, which it meets where zeta turns
    lowest = [item for item in ridge.extrema if item.parameter_name == "amplitude"]
    assert [item.extreme for item in lowest] == ["minimum"]
    assert [item.parameter_name for item in ridge.extrema].count("zeta") == 1
    # den Hartog: the height of the fixed points
    assert lowest[0].amplitude == pytest.approx(np.sqrt(1.0 + 2.0 / 0.05), rel=1e-9)
    best = minimize_scalar(
        lambda z: peak(z, (0.95, 1.12)), bounds=(0.08, 0.2), method="bounded", options={"xatol": 1e-9}
    )
    assert lowest[0].parameters["zeta"] == pytest.approx(best.x, abs=1e-5)
    assert lowest[0].amplitude == pytest.approx(best.fun, rel=1e-9)
    assert "minimum of amplitude" in repr(ridge)
    with pytest.raises(so.InputError):
        so.track(lowest[0], "zeta", (0.1, 0.2))


def test_a_ridge_goes_on_through_an_isola_down_to_its_valley():
    """Peaks come off the response where the isola merges with it, and end where it is born: there the ridge turns."""
    response = so.frequency_response(so.library.nltva(F=0.19), (0.8, 6.0))
    ridge = so.track_peak(response, "F", (0.10, 0.25))
    assert ridge.ended.count("reached the end of the range") == 2
    assert ridge.warnings == ()
    turns = {item.extreme: item for item in ridge.extrema if item.parameter_name == "F"}
    # where limit points meet, as in tests/maps/test_isolas.py
    for extreme, omega, force in (("minimum", 1.80265, 0.12466), ("maximum", 1.44059, 0.18562)):
        assert turns[extreme].omega == pytest.approx(omega, abs=1e-5)
        assert turns[extreme].parameter("F") == pytest.approx(force, abs=1e-5)
