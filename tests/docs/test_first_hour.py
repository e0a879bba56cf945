"""What a newcomer tries in the first hour, line by line, and what each line answers.

The oscillator is Duffing's, `x'' + 2 zeta x' + x + a x^3 = f cos(omega t)`, in mm, N, s. Answers are compared with
closed forms where there are some, else with another way to the same number.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import suboctave as so

ZETA, A, F = 0.02, 0.3, 0.1
TEXT = "x'' + 2*zeta*x' + x + a*x**3 = f*cos(omega*t)"
VALUES = {"zeta": ZETA, "a": A, "f": F}


@pytest.fixture(scope="module")
def system():
    return so.System.from_equations(TEXT, parameters=VALUES, units="mm, N, s")


@pytest.fixture(scope="module")
def curve(system):
    return so.frequency_response(system, omega=(0.5, 2.0), harmonics=5)


@pytest.fixture(scope="module")
def fold(curve):
    return curve.bifurcations["LP"][0]


# ------------------------------------------------------------------------------------------------------------ a system
def test_a_system_says_what_it_is(system):
    text = repr(system)
    assert "1 degree of freedom (x)" in text
    assert "mm, N, s" in text
    assert dict(system.parameters) == VALUES


def test_natural_frequencies(system):
    found = system.natural_frequencies()
    assert_allclose([found.omega[0], found.hertz[0], found.damping_ratio[0]], [1.0, 0.5 / np.pi, ZETA])
    assert "rad/s" in str(found)
    assert "Hz" in str(found)
    assert "<table" in found._repr_html_()
    assert_allclose(system.natural_frequencies(zeta=0.5).damping_ratio, 0.5)


def test_natural_frequencies_of_a_structure():
    """A clamped beam: `omega = 1.8751^2 sqrt(E I / (rho A)) / l^2`."""
    length, side, young, density = 0.7, 0.014, 2.05e11, 7800.0
    beam = so.structures.beam(length, side, side, young, density, elements=10, supports="clamped-free")
    exact = 1.875104068711961**2 * np.sqrt(young * side**2 / 12.0 / density) / length**2
    assert_allclose(beam.natural_frequencies(1).omega, exact, rtol=1e-5)


def test_the_linear_system(system):
    line = system.linear()
    assert not line.elements
    assert dict(line.parameters) == {"zeta": ZETA, "f": F}


# ------------------------------------------------------------------------------------------------------------- a curve
def test_a_response_is_printed(curve):
    text = str(curve)
    assert text.startswith(f"Branch: {len(curve)} points")
    assert "rad/s" in text
    assert text.count("\nLP ") == len(curve.bifurcations) == 2


def test_the_linear_response(curve):
    """The peak lies at `sqrt(1 - 2 zeta^2)` and is `2 zeta` wide."""
    (peak,) = curve.linear().peaks()
    assert_allclose(peak.omega, np.sqrt(1.0 - 2.0 * ZETA**2), rtol=1e-9)
    assert_allclose(peak.height, F / (2.0 * ZETA * np.sqrt(1.0 - ZETA**2)), rtol=1e-9)
    assert_allclose(peak.width, 2.0 * ZETA, rtol=1e-3)
    assert_allclose(peak.hertz, peak.omega / (2.0 * np.pi))


def test_peaks(curve):
    """The first harmonic is largest on the backbone, `omega^2 = 1 + 3/4 a X^2` but for terms of higher order."""
    (peak,) = curve.peaks(harmonic=1)
    assert_allclose(peak.omega**2, 1.0 + 0.75 * A * peak.height**2, rtol=1e-2)
    assert_allclose(peak.phase, -np.pi / 2.0, atol=0.03)
    assert peak.height >= np.abs(curve.harmonic(1)).max()
    assert peak.width is not None
    assert "width" in str(curve.peaks())
    assert isinstance(curve.peaks().to_dataframe(), pd.DataFrame)


def test_the_points_at_a_frequency(curve, system):
    """One harmonic balance by hand: the cubic `((1 - w^2 + 3/4 a X^2)^2 + (2 zeta w)^2) X^2 = f^2`."""
    found = curve.at(omega=1.2)
    assert list(found.stable) == [True, False, True]
    w, b = 1.2, 0.75 * A
    # in X^2
    squares = np.roots([b * b, 2.0 * b * (1.0 - w * w), (1.0 - w * w) ** 2 + (2.0 * ZETA * w) ** 2, -F * F])
    ours = sorted(abs(point.orbit.harmonic(1)) for point in found)
    assert_allclose(ours, np.sqrt(np.sort(squares.real)), rtol=1e-2)
    one_harmonic = so.frequency_response(system, omega=(0.5, 2.0), harmonics=1).at(omega=1.2)
    assert_allclose(sorted(one_harmonic.amplitude), np.sqrt(np.sort(squares.real)), rtol=1e-8)


def test_no_point_there(curve):
    assert list(curve.at(omega=9.0)) == []
    assert "the curve has omega from 0.5 to 2" in str(curve.at(omega=9.0))


def test_a_curve_is_a_sequence(curve):
    assert curve[0].omega == 0.5
    assert curve[-1].omega == 2.0
    assert len(curve[10:20]) == 10
    assert sum(1 for _ in curve) == len(curve)
    assert [point.stable for point in curve] == curve.stable.tolist()


def test_arrays_and_tables(curve):
    assert len(curve.omega) == len(curve.amplitude) == len(curve.to_dataframe()) == len(curve)
    assert list(curve.to_dataframe().columns[:3]) == ["omega", "amplitude", "stable"]
    assert_allclose(curve.rms("x"), curve.rms(0))


def test_save_and_load(curve, tmp_path):
    curve.save(tmp_path / "curve.nc")
    again = so.load(tmp_path / "curve.nc")
    assert_allclose(again.at(omega=1.2).amplitude, curve.at(omega=1.2).amplitude, rtol=1e-12)


def test_csv(curve, tmp_path):
    table = pd.read_csv(curve.to_csv(tmp_path / "curve.csv"))
    assert list(table.columns[:3]) == ["omega (rad/s)", "frequency (Hz)", "amplitude (mm)"]
    assert_allclose(table["frequency (Hz)"], curve.omega / (2.0 * np.pi))


# ------------------------------------------------------------------------------------------------------------ pictures
def test_a_picture(curve, tmp_path):
    figure = curve.plot(tmp_path / "curve.png")
    assert (tmp_path / "curve.png").exists()
    assert figure.axes[0].get_ylabel() == r"amplitude $\max\,|x|$ (mm)"
    assert "rad/s" in figure.axes[0].get_xlabel()
    plt.close(figure)


def test_a_picture_in_hertz(curve):
    (axes,) = curve.plot(frequency="Hz").axes
    assert "Hz" in axes.get_xlabel()
    assert axes.get_xlim()[1] < 2.0 / np.pi


def test_a_logarithmic_axis_in_axes_of_my_own(curve, system):
    figure, axes = plt.subplots(1, 2)
    curve.plot(ax=axes[0], yscale="log")
    assert axes[0].get_yscale() == "log"
    weak = so.frequency_response(system.with_parameters(f=0.02), omega=(0.5, 2.0), harmonics=3)
    so.plot({"0.1 N": curve, "0.02 N": weak}, ax=axes[1])
    texts = [text.get_text() for text in axes[1].get_legend().get_texts()]
    assert {"0.1 N", "0.02 N"} <= set(texts)
    plt.close(figure)


@pytest.mark.parametrize("quantity", ["peak_to_peak", "about_mean", "velocity", "phase"])
def test_a_picture_of_a_quantity(curve, quantity):
    figure = curve.plot(quantity=quantity, dof="x")
    assert "x" in figure.axes[0].get_ylabel()
    plt.close(figure)


def test_a_picture_of_a_function(curve):
    def kinetic(orbit):
        return 0.5 * orbit.velocity_amplitude("x") ** 2

    figure = curve.plot(quantity=kinetic)
    assert figure.axes[0].get_ylabel() == "kinetic"
    assert_allclose(curve.to_dataframe(readings=[kinetic])["kinetic"], 0.5 * curve.velocity() ** 2)
    plt.close(figure)


def test_a_picture_with_the_linear_response(curve):
    figure = curve.plot(linear=True)
    assert "linear response" in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    plt.close(figure)


# ------------------------------------------------------------------------------------------------------- single motions
def test_a_motion(curve):
    orbit = curve.at(omega=0.7)[0].orbit
    assert orbit.stable
    assert_allclose(np.prod(orbit.multipliers).real, np.exp(-4.0 * np.pi * ZETA / 0.7), rtol=1e-6)  # Liouville
    assert_allclose(orbit.spectrum()["amplitude"][1], abs(orbit.harmonic(1)))
    table = orbit.to_dataframe()
    assert_allclose(np.abs(table["x_x"]).max(), orbit.amplitude("x"), rtol=1e-3)
    figure = orbit.plot()
    assert figure.axes[0].get_ylabel() == "$x$ (mm)"
    plt.close(figure)


def test_the_same_motion_in_time(curve, system):
    """Integration from the motion's state stays on it."""
    point = curve.at(omega=0.7)[0]
    trajectory = so.integrate(system, 0.7, start=point.orbit.start(), periods=3)
    assert_allclose(trajectory.largest[0], point.amplitude, rtol=1e-4)


def test_verify(curve):
    assert so.verify(curve.at(omega=1.2)[0]).agrees


# --------------------------------------------------------------------------------------------------------- bifurcations
def test_bifurcations(curve, fold):
    """At a limit point a multiplier is +1, and the curve turns."""
    assert_allclose(fold.critical_multiplier(), 1.0, atol=1e-3)
    assert fold.omega >= curve.omega[curve.amplitude > 1.0].max()
    assert len(curve.at(omega=fold.omega - 1e-6)) == 3
    assert len(curve.at(omega=fold.omega + 1e-6)) == 1
    assert fold.stable in (True, False)
    assert "LP" in repr(fold)


def test_a_bifurcation_in_two_parameters(system, fold):
    """Where the folds of a level of the force lie is where the response at that level has them."""
    track = so.track(fold, "f", (0.08, 0.12))
    level = so.frequency_response(system.with_parameters(f=0.09), omega=(0.5, 2.0), harmonics=5)
    assert_allclose(track.at(f=0.09)[0].omega, level.bifurcations["LP"][0].omega, rtol=1e-8)


def test_the_other_branch_of_a_pitchfork():
    """`x'' + 2 zeta x' - x + x^3 = f cos`: at f = 0 rest is a pitchfork in the stiffness; followed over it."""
    system = so.System.from_equations("x'' + 0.2*x' + k*x + x**3 = 0", parameters={"k": 1.0})
    still = so.equilibria(system, "k", (1.0, -1.0))
    (fork,) = still.bifurcations["BP"]
    other = so.switch_branch(fork, side=1)
    # x^2 = -k
    assert_allclose(other.at(k=-0.5)[0].amplitude, np.sqrt(0.5), rtol=1e-9)
    assert other.at(k=-0.5)[0].stable


def test_an_amplitude_sweep(curve):
    """Along the force, through the same motion."""
    point = curve.at(omega=1.2)[0]
    force = so.continue_branch(point, "f", (0.05, 0.15))
    assert_allclose(force.at(f=F).amplitude.max(), point.amplitude, rtol=1e-9)


# ------------------------------------------------------------------------------------------------------------- mistakes
@pytest.mark.parametrize(
    ("wrong", "answer"),
    [
        (lambda s, c: s.natural_frequencies(zetta=0.1), "did you mean 'zeta'"),
        (lambda s, c: s.with_parameters(zetta=0.1), "did you mean 'zeta'"),
        (lambda s, c: c.at(omga=1.0), "did you mean 'omega'"),
        (lambda s, c: c.at(f=0.1), "the curve was followed in omega"),
        (lambda s, c: c.plot(quantity="velocty"), "did you mean 'velocity'"),
        (lambda s, c: c.peaks("velocty"), "did you mean 'velocity'"),
        (lambda s, c: c.bifurcations["LPC"], "'LP' is what it is called here"),
        (lambda s, c: c.rms("y"), "is none of the degrees of freedom"),
        (lambda s, c: so.frequency_response(s, omega=(-1.0, 2.0)), "omega"),
        (lambda s, c: so.System.from_equations("x'' + k*x = cos(omega*t)"), "k"),
    ],
)
def test_a_mistake_is_answered(system, curve, wrong, answer):
    with pytest.raises(so.InputError) as caught:
        wrong(system, curve)
    assert answer in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_misspelt_verb():
    with pytest.raises(AttributeError, match="did you mean 'frequency_response'"):
        so.frequency_respons  # noqa: B018
