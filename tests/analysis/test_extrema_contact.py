"""Extrema along curves of bifurcations of systems with contacts and of several DOFs, against runs of their own."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from slow import slow

import suboctave as so

NUMBERS = json.loads((Path(__file__).parents[1] / "data" / "tracked.json").read_text())
#: five stiffnesses of the stops
STIFFNESSES = np.random.default_rng(20).uniform(2.0, 8.0, 5)


def extreme_gap(sharpness, stiffness):
    """The extremum of the gap along the period doublings, found by itself at one stiffness of the stops."""
    system = so.library.reference_oscillator(p=0.55, Kc=stiffness, regularization=sharpness)
    doubling = so.frequency_response(system, (4.7, 2.2)).bifurcations["PD"][0]
    (found,) = (e for e in so.track(doubling, "j", (0.0, 1.0)).extrema if e.parameter_name == "j")
    return found


@cache
def reference_extremum(sharpness):
    return extreme_gap(sharpness, 4.7)


@pytest.mark.parametrize("sharpness", [3000.0, None])
@pytest.mark.parametrize(
    "stiffness", [STIFFNESSES[0], *(pytest.param(value, marks=pytest.mark.slow) for value in STIFFNESSES[1:])]
)
def test_extrema_of_period_doublings_over_the_stops(sharpness, stiffness):
    extremum = reference_extremum(sharpness)
    curve = so.track(extremum, "Kc", (4.7, stiffness))
    expected = extreme_gap(sharpness, stiffness)
    assert (curve.parameter("Kc")[0], curve.parameter("Kc")[-1]) == pytest.approx((4.7, stiffness))
    assert curve.omega[-1] == pytest.approx(expected.omega, abs=1e-5)
    assert curve.parameter("j")[-1] == pytest.approx(expected.parameter("j"), abs=1e-5)
    assert set(curve.extreme) == {"maximum"}
    assert np.abs(curve.multipliers + 1.0).min(axis=1).max() < 1e-4


@pytest.mark.parametrize("max_step", [None, *slow(0.02, 0.2)])
def test_the_whole_curve_in_one_call_at_any_step(max_step):
    extremum = reference_extremum(3000.0)
    place = NUMBERS["s3000_Kc4.7_p0.55_over_j"]["extremum"]
    assert (extremum.omega, extremum.parameter("j")) == pytest.approx(place, abs=1e-6)
    curve = so.track(extremum, "Kc", (2.0, 8.0), max_step=max_step)
    assert curve.parameter("Kc")[[0, -1]] == pytest.approx([2.0, 8.0])
    assert curve.ended.count("reached the end of the range") == 2
    for i, stiffness in enumerate((2.0, 8.0)):
        other = extreme_gap(3000.0, stiffness)
        assert (curve.omega[-i], curve.parameter("j")[-i]) == pytest.approx(
            (other.omega, other.parameter("j")), abs=1e-5
        )
    # its own extremum: omega turns
    (turn,) = (e for e in curve.extrema if e.parameter_name == "omega")
    assert turn.parameter("Kc") == pytest.approx(7.4, abs=0.1)


@pytest.mark.parametrize("sharpness", [3000.0, None])
def test_both_formulations_from_beside_the_extremum(sharpness):
    """Newton's method for both systems, from a motion of other frequency and gap, 1e-3 away and wrong by as much."""
    extremum = reference_extremum(sharpness)
    orbit = extremum.orbit
    values = {**orbit.values, "j": orbit.values["j"] - 1e-3}
    beside = replace(orbit, omega=orbit.omega + 1e-3, values=values, x=1.001 * orbit.x)
    for formulation in ("bordered", "alcorta2019"):
        found = so.locate_extremum(replace(extremum, orbit=beside), formulation=formulation)
        assert found.omega == pytest.approx(extremum.omega, abs=1e-9)
        assert found.parameter("j") == pytest.approx(extremum.parameter("j"), abs=1e-10)
        assert found.residual < 1e-9


def test_isola_of_doubled_motions_is_born_and_merges():
    """Definite form where it is born, indefinite where it merges; both over the stiffness of the stops."""
    numbers = NUMBERS["s3000_Kc4.7_p0.55_doubled_limit_points_over_j"]
    system = so.library.reference_oscillator(p=0.55, regularization=3000.0)
    doubling = so.frequency_response(system, (4.1, 2.2)).bifurcations["PD"][0]
    limits = so.switch_branch(doubling).bifurcations["LP"]
    curve = so.track(sorted(limits[:2], key=lambda b: b.omega)[1], "j", (0.0, 1.0))
    born, merges = (e for e in curve.extrema if e.parameter_name == "j")
    assert (born.isola, merges.isola) == ("isola_centre", "isola_merging")
    assert (born.omega, born.parameter("j")) == pytest.approx(numbers["born"], abs=1e-6)
    assert (merges.omega, merges.parameter("j")) == pytest.approx(numbers["merges"], abs=1e-6)
    for extremum in (born, merges):
        over = so.track(extremum, "Kc", (4.2, 5.2))
        assert sorted(over.parameter("Kc")[[0, -1]]) == pytest.approx([4.2, 5.2])
        assert set(over.isola) == {extremum.isola}
        # both stay extrema of motions of twice the period: their critical multiplier is +1
        assert np.abs(over.multipliers - 1.0).min(axis=1).max() < 1e-3


@pytest.fixture(scope="module")
def vibration_absorber():
    """Limit points of an absorber's isola over the load, from the curve that it has merged with."""
    merged = so.frequency_response(so.library.nltva(0.19), (0.8, 3.0))
    (limit,) = (b for b in merged.bifurcations["LP"] if b.omega > 2.0)
    return so.track(limit, "F", (0.1, 0.25))


def test_isola_of_the_nonlinear_absorber(vibration_absorber):
    merges, born = (e for e in vibration_absorber.extrema if e.parameter_name == "F")
    for event, kind, name in ((born, "isola_centre", "isola_centre"), (merges, "isola_merging", "isola_merges")):
        assert event.isola == kind
        assert (event.omega, event.parameter("F")) == pytest.approx(NUMBERS["nltva"][name], abs=2e-5)


def test_isola_centre_and_merging_meet(vibration_absorber):
    """With a stiffer structure the isola exists in an ever narrower range of the load, and then no more."""
    merges, born = (e for e in vibration_absorber.extrema if e.parameter_name == "F")
    curve = so.track(merges, "k1", (0.9, 1.8))
    (end,) = (e for e in curve.extrema if e.parameter_name == "k1")
    assert end.extreme == "maximum"
    assert "a minimum and a maximum of F meet" in end.remark()
    assert not [e for e in curve.extrema if e.parameter_name == "F"]  # F turns there too, which is no event of its own
    first, last = (curve.arclength < end.arclength), (curve.arclength > end.arclength)
    natures = [set(np.array(curve.isola)[part]) for part in (first, last)]
    assert sorted(map(sorted, natures)) == [["isola_centre"], ["isola_merging"]]
    assert [set(np.array(curve.extreme)[part]) for part in (first, last)] in (
        [{"minimum"}, {"maximum"}],
        [{"maximum"}, {"minimum"}],
    )
    # at the stiffness of the start the curve passes both
    other = so.track(born, "k1", (0.9, 1.8))
    assert [e.parameter("k1") for e in other.extrema if e.parameter_name == "k1"] == pytest.approx(
        [end.parameter("k1")], rel=1e-9
    )
    # limit points at a stiffness beyond: none of the two extrema is left
    for factor, count in ((0.98, 2), (1.02, 0)):
        moved = so.library.nltva(0.19).with_parameters(k1=end.parameter("k1") * factor)
        limits = [b for b in so.frequency_response(moved, (1.0, 3.5)).bifurcations["LP"] if b.omega > 1.6]
        turns = so.track(limits[0], "F", (0.05, 0.4)).extrema
        assert len([e for e in turns if e.parameter_name == "F"]) == count


def test_least_load_of_tori_over_the_damping_of_the_absorber():
    """Neimark-Sacker points, whose frequency kappa is an unknown as well."""
    curve = so.frequency_response(so.library.nltva(0.15), (0.9, 1.3))
    c2 = curve.system.parameters["c2"]

    def least(item):
        (found,) = (e for e in so.track(item, "F", (0.05, 0.2)).extrema if e.parameter_name == "F")
        return found

    extremum = least(curve.bifurcations["NS"][0])
    over = so.track(extremum, "c2", (c2, 0.9 * c2))
    moved = so.frequency_response(so.library.nltva(0.15).with_parameters(c2=0.9 * c2), (0.9, 1.3))
    expected = least(moved.bifurcations["NS"][0])
    assert over.parameter("c2")[-1] == pytest.approx(0.9 * c2)
    assert over.omega[-1] == pytest.approx(expected.omega, abs=1e-6)
    assert over.parameter("F")[-1] == pytest.approx(expected.parameter("F"), abs=1e-6)
    assert over.kappa[-1] == pytest.approx(expected.kappa, abs=1e-6)
