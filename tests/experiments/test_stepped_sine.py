"""`stepped_sine` against closed forms, harmonic balance, and what a tap must find; mistakes in measured files."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError


@pytest.fixture(scope="module")
def duffing():
    return so.library.duffing(c=0.1, F=0.3)


@pytest.fixture(scope="module")
def both(duffing):
    return so.stepped_sine(duffing, (0.8, 2.2), values=15, direction=("up", "down"), transient=120, periods=20)


def test_a_linear_oscillator_in_closed_form():
    """Amplitude and phase of 1 / (k - m w^2 + i c w), the load shifted and its amplitude negative."""
    system = so.System(
        mass=2.0, damping=0.4, stiffness=3.0, loads=[so.HarmonicLoad(dof=0, amplitude=-0.7, phase=0.4)]
    )  # fmt: skip
    test = so.stepped_sine(system, (0.5, 2.0), values=6, transient=150, periods=4, harmonics=(1, 2))
    gain = 0.7 / (3.0 - 2.0 * test.omega**2 + 0.4j * test.omega)
    np.testing.assert_allclose(test.harmonic(1), gain, rtol=1e-8)
    assert np.abs(test.harmonic(2)).max() < 1e-9
    assert (test.period == 1).all()


def test_sweeps_lie_on_stable_branches_and_jump_at_folds(duffing, both, duffing_curve):
    """Settled amplitudes are those of harmonic balance from the same state, at the same frequency."""
    lower, upper = sorted(b.omega for b in duffing_curve.bifurcations["LP"])
    for s, direction in enumerate(both.directions):
        for v, w in enumerate(both.omega):
            orbit = so.periodic_orbit(duffing, w, start=both.ends[s, v])
            assert abs(both.response[s, v, 0]) == pytest.approx(abs(orbit.harmonic(1)), rel=1e-5)
            third = both.harmonic(3, 0, direction)[v]
            assert third == pytest.approx(orbit.harmonic(3), abs=1e-5 * abs(orbit.harmonic(1)))
    up, down = both.amplitude("up"), both.amplitude("down")
    inside = (both.omega > lower) & (both.omega < upper)
    assert (up[inside] > 1.5 * down[inside]).all()
    np.testing.assert_allclose(up[~inside], down[~inside], rtol=1e-6)


def test_noise_is_seeded_and_averages_out(duffing):
    quiet, loud, again, other = (
        so.stepped_sine(duffing, (0.8, 2.2), values=2, transient=80, periods=100, noise=noise, seed=seed).harmonic(1)
        for noise, seed in ((0.0, 0), (0.1, 1), (0.1, 1), (0.1, 2))
    )
    np.testing.assert_array_equal(loud, again)
    assert (loud != other).all()
    # the standard deviation of one component of N samples is noise sqrt(2 / N)
    expected = 0.1 * np.sqrt(2.0 / (100 * 128))
    assert (np.abs(loud - quiet) < 5.0 * expected).all()
    assert (np.abs(loud - quiet) > 0.01 * expected).all()


def test_a_tap_changes_the_motion(duffing):
    """On the way down the lower motion is held; a tap in the range of two motions leads to the upper one."""
    test = so.stepped_sine(
        duffing, (1.2, 2.2), values=6, direction="down", tap=(1.4, 0, -1.5), transient=150, periods=10
    )
    plain = so.stepped_sine(duffing, (1.2, 2.2), values=6, direction="down", transient=150, periods=10)
    assert test.tapped[0] == pytest.approx(1.4)
    before = test.omega > 1.41
    np.testing.assert_allclose(test.amplitude()[before], plain.amplitude()[before], rtol=1e-9)
    at = np.flatnonzero(~before)[-1]
    assert test.amplitude()[at] > 1.5 * plain.amplitude()[at]


def test_tables_and_a_picture(both, duffing_curve, tmp_path):
    frame = both.to_dataframe()
    assert len(frame) == 2 * len(both.omega)
    assert frame["amplitude"].iloc[0] == pytest.approx(abs(both.response[0, 0, 0]))
    figure = both.plot(tmp_path / "stepped.png", curves=duffing_curve)
    drawn = [line for line in figure.axes[0].lines if str(line.get_gid()).startswith("up")]
    assert sum(len(line.get_xdata()) for line in drawn) == len(both.omega)
    assert set(both.to_xarray()["direction"].to_numpy()) == {"up", "down"}
    assert "up and down" in repr(both)


def test_interrupted(duffing):
    def stop(share, _):
        if share > 0.5:
            raise KeyboardInterrupt

    test = so.stepped_sine(duffing, (0.8, 1.2), values=6, transient=20, periods=6, progress=stop)
    assert not test.complete
    assert 0 < (test.period[0] >= 0).sum() < len(test.omega)
    assert len(test.to_dataframe()) == (test.period >= 0).sum()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"omega": (1.0, 1.0)}, "two different"),
        ({"omega": [0.0, 1.0]}, "frequencies are positive"),
        ({"direction": "upp"}, "did you mean 'up'|up"),
        ({"transient": 0}, "transient"),
        ({"periods": 0}, "periods"),
        ({"harmonics": (0.3,), "periods": 4}, "whole number"),
        ({"harmonics": (50,)}, "multiples of omega"),
        ({"noise": -1.0}, "noise"),
        ({"tap": (1.0, 0)}, "tap must be"),
        ({"tap": (9.0, 0, 1.0)}, "not within"),
        ({"tap": (1.0, 3, 1.0)}, "out of range"),
        ({"start": [1.0]}, "start must be"),
    ],
)
def test_wrong_input(duffing, arguments, words):
    arguments = {"omega": (0.8, 1.2), **arguments}
    with pytest.raises(InputError, match=words):
        so.stepped_sine(duffing, arguments.pop("omega"), **arguments)


def test_a_load_at_omega_is_needed():
    system = so.System(mass=1.0, damping=0.1, stiffness=1.0, loads=[so.HarmonicLoad(dof=0, amplitude=1.0, harmonic=2)])
    with pytest.raises(InputError, match="load with the frequency omega"):
        so.stepped_sine(system, (0.5, 1.0))


# ------------------------------------------------------------------------------------------------------ measured files
def written(tmp_path, text):
    path = tmp_path / "rig.csv"
    path.write_text(text)
    return path


COLUMNS = {"frequency": "f", "amplitude": "X1", "frequency_unit": "Hz"}


def test_measured_data_in_the_units_of_the_model(tmp_path, both):
    path = written(tmp_path, "f,phase, X1\n0.25,1,120\n\n0.3,2,150\n")
    data = so.read_measured(path, **COLUMNS, scale=1e-3, omega_scale=0.5)
    np.testing.assert_allclose(data.omega, [0.25 * np.pi, 0.3 * np.pi])
    np.testing.assert_allclose(data.amplitude, [0.12, 0.15])
    figure = both.plot(measured=data)
    assert any(line.get_gid() == "measured" for line in figure.axes[0].lines)
    with pytest.raises(InputError, match="fundamental"):
        both.plot(measured=data, harmonic=3)


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        ("f,X2\n1,2\n", {}, "line 1: there is no column 'X1'"),
        ("f,X1,f\n1,2,3\n", {}, "line 1: two columns"),
        ("f,X1\n1,2\n1,two\n", {}, "line 3: X1='two' is no finite number"),
        ("f,X1\n1,2\n1\n", {}, "line 3: 1 entries"),
        ("f,X1\n0,2\n", {}, "line 2: f=0 is no frequency"),
        ("f,X1\n1,nan\n", {}, "line 2: X1='nan'"),
        ("f,X1\n", {}, "no rows"),
        ("f,X1\n1,2\n", {"frequency_unit": "hz"}, "Hz or rad/s"),
        ("f,X1\n1,2\n", {"scale": 0.0}, "scale must be"),
    ],
)
def test_mistakes_in_measured_files(tmp_path, text, changes, words):
    with pytest.raises(InputError, match=words):
        so.read_measured(written(tmp_path, text), **{**COLUMNS, **changes})


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        so.read_measured(tmp_path / "none.csv", **COLUMNS)


# ---------------------------------------------------------------------------------------------- the published isola
@pytest.mark.slow
def test_a_tap_leads_onto_the_published_isola():
    """At j = 0.5 sweeps pass the isola by; a tap at omega = 2.3 leads onto it, in both directions to its ends."""
    system = so.library.reference_oscillator(regularization=3000.0, j=0.5)
    low = so.stepped_sine(system, (2.0, 2.9), values=3, direction="down").ends[0, 0]
    options = {"values": 36, "direction": ("up", "down"), "start": low}
    plain = so.stepped_sine(system, (2.0, 2.7), **options)
    assert set(plain.period.ravel()) <= {0, 1}
    tapped = so.stepped_sine(system, (2.0, 2.7), tap=(2.3, 0, 0.9), **options)
    for s, direction in enumerate(tapped.directions):
        on = tapped.period[s] == 2
        after = tapped.omega >= 2.299 if direction == "up" else tapped.omega <= 2.301
        inside = (tapped.omega > 2.200149) & (tapped.omega < 2.514902)
        np.testing.assert_array_equal(on, after & inside)
    for test in (plain, tapped):
        for s in range(2):
            assert (test.period[s] == 0).sum() <= 1  # behind a jump it may not be settled
            for v in np.flatnonzero(test.period[s]):
                orbit = so.periodic_orbit(
                    system, test.omega[v], start=test.ends[s, v], subharmonic=int(test.period[s, v])
                )
                assert abs(test.response[s, v, 0]) == pytest.approx(abs(orbit.harmonic(1)), rel=1e-3)
