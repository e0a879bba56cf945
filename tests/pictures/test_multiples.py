"""Components of the motion over frequency: the mean, harmonics, and those of sub-harmonic motions."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures import plot, plot_space


@pytest.fixture(scope="module")
def loaded():
    """x'' + 0.1 x' + 2 x = 3 + cos(omega t): a mean of 3/2, |1/(2 - omega^2 + 0.1 i omega)| around it."""
    system = so.System.from_equations("x'' + 0.1*x' + 2*x = 3 + F*cos(omega*t)", {"F": 1.0})
    return so.frequency_response(system, (2.0, 1.0), harmonics=2)


@pytest.fixture(scope="module")
def tripled():
    system = so.System.from_equations("x'' + 0.02*x' + x + 0.05*x**3 = F*cos(omega*t)", {"F": 5.0})
    return so.frequency_response(system, (5.0, 5.3), harmonics=9, subharmonic=3)


def drawn(figure, among=0):
    """Vertices of all lines of one colour, by the order in which the colours come."""
    lines = [line for line in figure.axes[0].get_lines() if line.get_gid() in ("stable", "unstable")]
    colours = list(dict.fromkeys(line.get_color() for line in lines))
    return np.concatenate([line.get_xydata() for line in lines if line.get_color() == colours[among]])


def test_harmonic_0_is_the_mean(loaded, tmp_path):
    figure = plot(loaded, tmp_path / "live.svg", harmonic=0)
    np.testing.assert_allclose(drawn(figure)[:, 1], 1.5, rtol=1e-9)
    assert figure.axes[0].get_ylabel() == "mean of $x$, in modulus"
    plot(loaded.to_xarray(readings=["harmonic_0"]), tmp_path / "dataset.svg", harmonic=0)
    assert (tmp_path / "live.svg").read_bytes() == (tmp_path / "dataset.svg").read_bytes()
    first = drawn(plot(loaded, harmonic=1))
    np.testing.assert_allclose(first[:, 1], 1.0 / abs(2.0 - first[:, 0] ** 2 + 0.1j * first[:, 0]), rtol=0.02)


@pytest.mark.parametrize("third", [1 / 3, "1/3"])
def test_a_third_of_the_frequency_is_drawn_and_motions_without_it_lie_at_zero(loaded, tripled, third):
    figure = plot([loaded, tripled], harmonic=third)
    assert figure.axes[0].get_ylabel() == "harmonic 1/3 of $x$"
    assert not drawn(figure)[:, 1].any()
    upper = drawn(figure, 1)
    for point, value in zip(tripled.omega, np.abs(tripled.harmonic(1 / 3)), strict=True):
        assert np.any(np.all(np.isclose(upper, [point, value], rtol=1e-9), axis=1))
    assert np.abs(tripled.harmonic(1 / 3)).min() > 1.0
    space = plot_space([loaded, tripled], y="F", harmonic=third)
    assert space.axes[0].get_zlabel() == "harmonic 1/3 of $x$"
    phases = plot([loaded, tripled], quantity="phase", harmonic=third)
    assert np.isnan(drawn(phases)[:, 1]).all()


def test_read_offs_are_named_by_numbers_that_give_the_fraction_back(tripled):
    name = "harmonic_0.3333333333333333"
    column = tripled.to_xarray(readings=["harmonic_1/3"])[name]
    # in a table, as it was asked for
    np.testing.assert_array_equal(tripled.to_dataframe(readings=["harmonic_1/3"])["harmonic_1/3"], column)
    np.testing.assert_allclose(column, np.abs(tripled.harmonic(1 / 3)), rtol=1e-15)
    assert tripled.reading(name).tolist() == tripled.reading("harmonic_1/3").tolist()


def test_components_that_no_motion_has_are_refused_with_the_nearest(loaded, tripled):
    for curves in (loaded, [loaded, loaded], loaded.to_xarray()):
        with pytest.raises(InputError, match="period T, which has whole multiples"):
            plot(curves, harmonic=0.5)
    with pytest.raises(InputError, match="did you mean 1/3"):
        plot([loaded, tripled], harmonic=0.333)
    with pytest.raises(InputError, match="period T, which has whole multiples"):
        loaded.to_dataframe(readings=["harmonic_0.5"])
    for wrong in (-1, "half", "1/0"):
        with pytest.raises(InputError, match="is no multiple of omega"):
            plot(loaded, harmonic=wrong)
    for wrong in (True, float("inf"), [1]):
        with pytest.raises(InputError, match="harmonic must be a finite number or a text"):
            plot(loaded, harmonic=wrong)
