"""Sensitivities of bifurcations against bifurcations that are located anew."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


def moved(compute, system, name, of, share=1e-4):
    """Central differences of what `compute` gives of a system, by one of its parameters."""
    value = system.parameters[name]
    step = share * (abs(value) or 1.0)
    after, before = (compute(system.with_parameters({name: value + s * step})) for s in (1.0, -1.0))
    return {key: (after[key] - before[key]) / (2.0 * step) for key in of}


def located(item, *free):
    return {name: item.parameter(name) for name in free} | {"amplitude": item.amplitude}


OSCILLATOR = so.library.reference_oscillator(p=0.55, j=0.05)


@pytest.mark.parametrize(("kind", "share"), [("PD", 1e-4), ("grazing", 1e-4), ("LP", 1e-5)])
def test_of_a_response(kind, share):
    def first(system):
        branch = so.frequency_response(system, (2.4, 1.6), harmonics=15)
        return located(branch.bifurcations[kind][0], "omega")

    item = so.frequency_response(OSCILLATOR, (2.4, 1.6), harmonics=15).bifurcations[kind][0]
    found = so.sensitivity(item)
    assert set(found) == set(OSCILLATOR.parameters)
    for name in found:
        expected = moved(first, OSCILLATOR, name, ("omega", "amplitude"), share)
        assert found[name]["omega"] == pytest.approx(expected["omega"], rel=2e-6, abs=1e-7)
        assert found[name]["amplitude"] == pytest.approx(expected["amplitude"], rel=2e-6, abs=1e-7)


def test_of_a_neimark_sacker_point_and_by_omega_where_it_is_held():
    system = so.library.nltva()

    def first(system):
        branch = so.frequency_response(system, (1.09, 1.13), harmonics=7)
        return located(branch.bifurcations["NS"][0], "omega")

    branch = so.frequency_response(system, (1.09, 1.13), harmonics=7)
    found = so.sensitivity(branch.bifurcations["NS"][0])
    for name in system.parameters:
        expected = moved(first, system, name, ("omega",))
        assert found[name]["omega"] == pytest.approx(expected["omega"], rel=1e-5, abs=1e-6)


def test_of_the_extremum_of_a_border():
    def first(system):
        doubling = so.frequency_response(system, (2.4, 1.6), harmonics=7).bifurcations["PD"][0]
        extremum = so.track(doubling, "j", (0.0, 1.0)).extrema[0]
        return located(extremum, "omega", "j"), extremum

    (_, item) = first(OSCILLATOR)
    found = so.sensitivity(item)
    assert set(found) == set(OSCILLATOR.parameters) - {"j"}
    for name in ("p", "Kc"):
        expected = moved(lambda system: first(system)[0], OSCILLATOR, name, ("omega", "j"))
        assert found[name]["omega"] == pytest.approx(expected["omega"], rel=2e-5, abs=1e-6)
        assert found[name]["j"] == pytest.approx(expected["j"], rel=2e-5, abs=1e-6)


def test_a_branch_point_is_none_where_the_symmetry_is_broken():
    system = so.System.from_equations("x'' + 0.1*x' - k*x + x**3 = F*cos(omega*t) + s", {"k": -1.0, "F": 8.0, "s": 0.0})
    points = so.frequency_response(system, (0.4, 3.0), harmonics=15).bifurcations["BP"]
    assert points
    found = so.sensitivity(points[0])
    assert np.isnan(found["s"]["omega"])
    again = moved(
        lambda other: located(so.frequency_response(other, (0.4, 3.0), harmonics=15).bifurcations["BP"][0], "omega"),
        system, "F", ("omega",),
    )  # fmt: skip
    assert found["F"]["omega"] == pytest.approx(again["omega"], rel=1e-5)


def test_a_table_shows_the_strongest_first():
    item = so.frequency_response(OSCILLATOR, (2.4, 1.6), harmonics=15).bifurcations["PD"][0]
    found = so.sensitivity(item)
    order = found.ranked("omega")
    effects = [abs(found.per_cent(name, "omega")) for name in order]
    assert effects == sorted(effects, reverse=True)
    text = repr(found)
    assert text.index(order[0]) < text.index(order[-1])
    frame = found.to_dataframe()
    assert frame.loc["p", "d omega"] == found["p"]["omega"]


def test_what_has_none_is_refused():
    branch = so.frequency_response(OSCILLATOR, (2.4, 1.6), harmonics=7)
    item = branch.bifurcations["PD"][0]
    for of, by, words in (
        (branch, "zeta", "bifurcation must be a Bifurcation, not Branch"),
        (item, ["zetta"], "did you mean 'zeta'"),
        (item, ["omega"], "omega is free"),
    ):
        with pytest.raises(so.InputError, match=words):
            so.sensitivity(of, by=by)
