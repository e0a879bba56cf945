"""Extrema along curves of bifurcations, as systems of their own and over a third parameter, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import state_transition


@pytest.fixture(scope="module")
def folds():
    """Limit points of a Duffing oscillator under the load `F0 (1 - q^2)`, over q and F0: upper and lower one.

    The amplitude over the load is an S at this frequency. Over q there is a closed branch where F0 lies above the load
    of one fold, an isola, and it meets the rest where F0 reaches that of the other, both at q = 0.
    """
    system = so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F0*(1 - q**2)")],
        parameters={"q": 0.1, "F0": 0.1, "c": 0.05},
    )
    upper, lower = so.frequency_response(system, (0.7, 2.0), harmonics=1).bifurcations["LP"]
    return [so.track(b, ("q", "F0"), ((-0.9, 0.9), (0.01, 0.3))) for b in (upper, lower)]


def fold_of_duffing(curve):
    """What must vanish at a limit point with one harmonic: two residuals at every point."""
    a, w, c = np.abs(curve.harmonic(1)), curve.omega, curve.parameter("c")
    stiff = 1.0 - w**2 + 0.75 * a**2
    load = curve.parameter("F0") * (1.0 - curve.parameter("q") ** 2)
    return a * np.hypot(stiff, c * w) - load, stiff**2 + (c * w) ** 2 + 1.5 * a**2 * stiff


def test_isola_centre_and_merging_told_apart(folds):
    for curve, expected in zip(folds, ("isola_centre", "isola_merging"), strict=True):
        (extremum,) = curve.extrema
        assert (extremum.isola, extremum.extreme, extremum.parameter_name) == (expected, "minimum", "F0")
        assert extremum.parameter("q") == pytest.approx(0.0, abs=1e-9)
        assert expected.replace("_", " ") in repr(curve)


@pytest.mark.parametrize("index", [0, 1])
def test_extrema_of_limit_points_over_the_damping(folds, index):
    """At q = 0 the load of the fold itself: its closed form, whatever the damping, and through the cusp."""
    curve = so.track(folds[index].extrema[0], "c", (0.01, 0.17))
    assert curve.names == ("q", "F0", "c")
    assert (curve.turning, curve.kind, curve.name) == ("F0", "LP", "c")
    for residual in fold_of_duffing(curve):
        assert np.abs(residual).max() < 1e-8
    assert np.abs(curve.parameter("q")).max() < 1e-9
    assert set(curve.extreme) == {"minimum"}
    if index == 0:
        assert curve.parameter("c")[[0, -1]] == pytest.approx([0.01, 0.17])
        assert not curve.bifurcations.met


def test_isola_centre_becomes_a_merging_at_the_cusp(folds):
    """The two folds meet at a cusp; there is no isola any more. Neither parameter has an extremum of its own there."""
    curve = so.track(folds[1].extrema[0], "c", (0.01, 0.25))
    (cusp,) = curve.bifurcations.met
    assert cusp.kind == "CP"
    # at a cusp the second derivative of the load's square by that of the amplitude vanishes as well
    a, w, c = abs(cusp.orbit.harmonic(1, 0)), cusp.omega, cusp.parameter("c")
    assert 3.0 * (1.0 - w**2 + 0.75 * a**2) + 1.125 * a**2 == pytest.approx(0.0, abs=1e-7)
    assert c == pytest.approx(curve.parameter("c").max(), rel=1e-2)
    kinds = np.array(curve.isola)
    before = curve.arclength < cusp.arclength
    assert {len(set(kinds[before])), len(set(kinds[~before]))} == {1}
    assert set(kinds) == {"isola_centre", "isola_merging"}
    assert curve.parameter("c")[[0, -1]] == pytest.approx([0.01, 0.01])


def test_omega_as_the_third_parameter(folds):
    curve = so.track(folds[0].extrema[0], "omega", (1.2, 1.6))
    for residual in fold_of_duffing(curve):
        assert np.abs(residual).max() < 1e-8
    assert sorted(curve.omega[[0, -1]]) == pytest.approx([1.2, 1.6])


@pytest.mark.parametrize("formulation", ["bordered", "alcorta2019"])
def test_newton_from_elsewhere_on_the_curve(folds, formulation):
    """Both systems lead from another point of the curve to the same extremum."""
    for curve in folds:
        (extremum,) = curve.extrema
        index = int(np.argmin(np.abs(curve.parameter("q") - 0.15)))
        orbit = curve.orbits[index]
        assert abs(orbit.values["q"]) > 0.05
        found = so.locate_extremum(replace(extremum, orbit=orbit), formulation=formulation)
        assert found.parameter("F0") == pytest.approx(extremum.parameter("F0"), rel=1e-10)
        assert found.parameter("q") == pytest.approx(0.0, abs=1e-8)
        assert found.isola == extremum.isola


def test_peak_of_a_grazing_curve_over_the_damping():
    """The largest gap that the resonance of a linear oscillator touches."""
    load = 0.5
    system = so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.ElasticStop(dof=0, stiffness=10.0, gap="gap", side="right")],
        loads=[so.HarmonicLoad(dof=0, amplitude=load)],
        parameters={"gap": 1.0, "c": 0.1},
    )
    touch = so.frequency_response(system, (0.4, 0.95)).grazings[0]
    (peak,) = (e for e in so.track(touch, "gap", (0.6, 6.0)).extrema if e.parameter_name == "gap")
    curve = so.track(peak, "c", (0.08, 0.2))
    c = curve.parameter("c")
    assert sorted(c[[0, -1]]) == pytest.approx([0.08, 0.2])
    assert curve.omega == pytest.approx(np.sqrt(1.0 - c**2 / 2.0), rel=1e-9)
    assert curve.parameter("gap") == pytest.approx(load / (c * np.sqrt(1.0 - c**2 / 4.0)), rel=1e-9)
    assert set(curve.extreme) == {"maximum"}


def test_tip_of_a_tongue_of_parametric_resonance():
    """The weakest excitation that doubles the period of rest, over the damping; the witness is shooting."""
    system = so.library.mathieu_duffing(c=0.05)
    doubling = so.frequency_response(system, (1.7, 2.3)).bifurcations["PD"][0]
    (tip,) = (e for e in so.track(doubling, "eps", (0.05, 0.6)).extrema if e.parameter_name == "eps")
    curve = so.track(tip, "c", (0.01, 0.3))
    assert sorted(curve.parameter("c")[[0, -1]]) == pytest.approx([0.01, 0.3])

    def excess(orbit, omega, eps):
        """Trace of the transition matrix plus its value where a multiplier is -1."""
        values = {**orbit.values, "eps": eps}
        period = 2.0 * math.pi / omega
        _, transition = state_transition(orbit.system, np.zeros(2), (0.0, period), omega, values)
        return float(np.trace(transition)) + 1.0 + math.exp(-values["c"] * period)

    for orbit in curve.orbits[:: max(1, len(curve) // 5)]:
        omega, eps, d = orbit.omega, orbit.values["eps"], 1e-3
        assert excess(orbit, omega, eps) == pytest.approx(0.0, abs=1e-6)
        by_omega = (excess(orbit, omega + d, eps) - excess(orbit, omega - d, eps)) / (2.0 * d)
        by_eps = (excess(orbit, omega, eps + d) - excess(orbit, omega, eps - d)) / (2.0 * d)
        assert abs(by_omega) < 1e-4 * abs(by_eps)


def test_saved_and_loaded(folds, tmp_path):
    curve = so.track(folds[0].extrema[0], "c", (0.04, 0.06))
    other = so.load(curve.save(tmp_path / "extrema.nc"))
    assert (other.kind, other.names, other.turning) == (curve.kind, curve.names, curve.turning)
    for name in ("q", "F0", "c", "omega"):
        assert np.array_equal(other.parameter(name), curve.parameter(name))
    assert (other.extreme, other.isola) == (curve.extreme, curve.isola)
    assert repr(other) == repr(curve)
    assert "extrema of F0" in repr(curve)
    assert other.to_dataframe().equals(curve.to_dataframe())
    loaded = so.load(folds[0].save(tmp_path / "folds.nc"))
    again = so.track(loaded.extrema[0], "c", (0.04, 0.06))
    assert np.array_equal(again.parameter("F0"), curve.parameter("F0"))
    assert loaded.extrema[0].isola == "isola_centre"


def test_a_range_of_omega_and_a_start_on_a_bound(folds):
    (extremum,) = folds[0].extrema
    curve = so.track(extremum, "c", (0.05, 0.06))
    assert curve.parameter("c")[[0, -1]] == pytest.approx([0.05, 0.06])
    with pytest.raises(so.InputError, match="omega= bounds omega where it is free"):
        so.track(extremum, "c", (0.05, 0.06), omega=(1.0, 2.0))


def test_wrong_input_is_refused(folds):
    (extremum,) = folds[0].extrema
    for parameter, bounds, message in (
        ("F0", (0.0, 1.0), "F0 is free on the curve of this extremum already"),
        ("cc", (0.0, 1.0), "unknown parameter 'cc'"),
        (("q", "c"), (0.0, 1.0), "followed in one more parameter"),
        ("c", (0.2, 0.3), "the bifurcation has c=0.05, outside"),
        ("c", 1.0, r"bounds must be two numbers \(from, to\)"),
    ):
        with pytest.raises(so.InputError, match=message):
            so.track(extremum, parameter, bounds)
    with pytest.raises(so.InputError, match=r"extremum must be a TrackedEvent"):
        so.locate_extremum(folds[0])
    with pytest.raises(so.InputError, match="unknown formulation 'alcorta'"):
        so.locate_extremum(extremum, formulation="alcorta")
    with pytest.raises(so.InputError, match='"bordered" and "alcorta2019"'):
        so.locate_extremum(extremum, formulation="extended")
