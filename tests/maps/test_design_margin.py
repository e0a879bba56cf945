"""Sensitivities of an isola's ends, and the nearest design without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so

SYSTEM = so.library.reference_oscillator(p=0.55, j=0.5)
RANGE = {"omega": (1.3, 4.5), "parameter": "j", "bounds": (0.0, 1.0), "harmonics": 15}


@pytest.fixture(scope="module")
def isola() -> so.Isola:
    (found,) = so.find_isolas(SYSTEM, **RANGE, values=2, levels=(), search=())
    return found


@pytest.mark.parametrize("end", ["born", "merges"])
def test_ends_move_as_ends_that_are_located_anew(isola, end):
    item = getattr(isola, end)
    found = so.sensitivity(item)
    assert set(found) == {"zeta", "alpha", "Kc", "p"}
    for name, rates in found.items():
        step = 1e-5 * SYSTEM.parameters[name]
        after, before = (
            so.locate_extremum(replace(item, orbit=replace(item.orbit, values={**item.orbit.values, name: value})))
            for value in (SYSTEM.parameters[name] + step, SYSTEM.parameters[name] - step)
        )
        for free in ("omega", "j"):
            difference = (after.parameter(free) - before.parameter(free)) / (2.0 * step)
            assert rates[free] == pytest.approx(difference, rel=1e-6, abs=1e-7 * abs(rates["j"]) + 1e-8)


@pytest.mark.slow
def test_the_isola_is_gone_just_beyond_its_margin_and_there_before_it(isola):
    margin = so.design_margin(isola, by=["zeta", "p"])
    assert margin.end.parameter("j") == pytest.approx(0.5, abs=1e-9)
    assert margin.distance == pytest.approx(np.hypot(*margin.scaled.values()))
    for share, there in ((0.97, True), (1.03, False)):
        changed = {name: margin.design[name] + share * change for name, change in margin.changes.items()}
        isolas = so.find_isolas(SYSTEM.with_parameters(changed), **RANGE)
        assert any(0.5 in found for found in isolas) == there


def test_it_is_the_nearest_such_design(isola):
    margin = so.design_margin(isola, by=["zeta", "p", "j"])
    # the change points along the gradient of the birth, in scaled parameters
    known = so.sensitivity(margin.end)
    slope = np.array([known["zeta"]["j"] * 0.03, known["p"]["j"] * 0.55, -0.5])
    change = np.array(list(margin.scaled.values()))
    assert abs(change @ slope) == pytest.approx(np.linalg.norm(change) * np.linalg.norm(slope), rel=1e-8)
    one = so.design_margin(isola, by=["j"])
    assert one.values["j"] == pytest.approx(float(isola.born))
    assert margin.distance < one.distance


def test_scales_and_the_other_end(isola):
    to_merging = so.design_margin(isola, by=["j"], end="merges", scales={"j": 0.1})
    assert to_merging.distance == pytest.approx((0.5 - float(isola.merges)) / 0.1)
    coarse = so.design_margin(isola, by=["zeta"], scales={"zeta": 0.3})
    fine = so.design_margin(isola, by=["zeta"])
    assert coarse.distance == pytest.approx(fine.distance / 10.0)
    assert coarse.linear == pytest.approx(fine.linear / 10.0)


def test_what_has_no_margin_is_refused(isola):
    for arguments, words in (
        ({"by": ["zetta"]}, "did you mean 'zeta'"),
        ({"by": []}, "is empty"),
        ({"by": ["p"], "at": 0.9}, "exists from 0.177"),
        ({"by": ["p"], "end": "birth"}, "'born' or 'merges'"),
        ({"by": ["p"], "scales": {"p": 0.0}}, "give scales"),
    ):
        with pytest.raises(so.InputError, match=words):
            so.design_margin(isola, **arguments)
    with pytest.raises(so.InputError, match="must be an Isola"):
        so.design_margin(0.5, by=["p"])
