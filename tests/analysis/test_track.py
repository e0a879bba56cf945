"""Period doublings of the reference oscillator in two parameters, held against shooting."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import suboctave as so

NUMBERS = json.loads((Path(__file__).parents[1] / "data" / "tracked.json").read_text())


@cache
def doublings(p: float, sharpness: float | None = 3000.0):
    """The two period doublings of the motion of one load period: upper, lower."""
    system = so.library.reference_oscillator(p=p, regularization=sharpness)
    return so.frequency_response(system, (4.1, 2.2)).bifurcations["PD"]


@cache
def doubled_branch(p: float):
    """The motions of two load periods between the two."""
    return so.switch_branch(doublings(p)[0])


def extreme(curve, name):
    """The extrema of a parameter as (omega, value)."""
    return [(e.omega, e.parameter(name)) for e in curve.extrema if e.parameter_name == name]


def ends(curve):
    return sorted((curve.omega[0], curve.omega[-1]))


def test_over_the_load_from_both_doublings():
    expected = NUMBERS["s3000_Kc4.7_j0_over_p"]["first_stage"]
    curves = [so.track(b, "p", (0.2, 1.7)) for b in doublings(0.55)]
    for i, p in enumerate(("0.2", "1.7")):
        assert [c.parameter("p")[-i] for c in curves] == [float(p)] * 2
        assert sorted(c.omega[-i] for c in curves) == pytest.approx(expected[p], abs=1e-6)
    assert not any(c.warnings or c.closed for c in curves)
    for curve in curves:
        assert np.abs(curve.multipliers + 1.0).min(axis=1).max() < 1e-4


@pytest.mark.parametrize("max_step", [0.01, None, 0.1])
def test_the_extremum_over_the_gap_at_any_step(max_step):
    curve = so.track(doublings(0.55)[0], "j", (0.0, 1.0), max_step=max_step)
    numbers = NUMBERS["s3000_Kc4.7_p0.55_over_j"]
    assert extreme(curve, "j") == [pytest.approx(numbers["extremum"], abs=1e-6)]
    assert curve.extrema[0].extreme == "maximum"
    # from one doubling at j = 0 to the other
    assert ends(curve) == pytest.approx(NUMBERS["s3000_Kc4.7_j0_over_p"]["first_stage"]["0.55"], abs=1e-6)
    assert curve.parameter("j")[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert curve.ended.startswith("reached the end of the range")
    largest = 0.06 if max_step is None else max_step
    assert np.diff(curve.arclength).max() < 1.01 * largest
    assert not curve.warnings


@pytest.mark.parametrize(("start", "place"), [(0, 2), (0, 6), (1, 7), (1, 8), (1, 11)])
def test_points_of_the_curve_over_the_gap(start, place):
    """The curve ends where the reference has a point: before the fold and behind it."""
    omega, j = NUMBERS["s3000_Kc4.7_p0.55_over_j"]["curve"][place]
    curve = so.track(doublings(0.55)[start], "j", (j, 0.0))
    other = np.argmin(curve.parameter("j"))
    assert curve.omega[-1 - other] == pytest.approx(omega, abs=1e-5)


def test_stiffness_of_the_stops_under_strong_load():
    numbers = NUMBERS["s3000_p1.7_j0_over_Kc"]
    curve = so.track(doublings(1.7)[0], "Kc", (0.1, 4.7))
    assert extreme(curve, "Kc") == [pytest.approx(numbers["first_stage_minimum"], abs=1e-6)]
    assert ends(curve) == pytest.approx(numbers["first_stage"]["4.7"], abs=1e-6)
    curve = so.track(doublings(1.7)[1], "Kc", (2.0, 4.7))
    assert curve.omega[-1] == pytest.approx(numbers["first_stage"]["2"][0], abs=1e-6)


@pytest.mark.parametrize("harmonics", ["adaptive", 31])
def test_exact_law(harmonics):
    gap = so.track(doublings(0.55, None)[0], "j", (0.0, 1.0), harmonics=harmonics)
    assert extreme(gap, "j") == [pytest.approx(NUMBERS["exact_Kc4.7_p0.55_over_j"]["extremum"], abs=2e-6)]
    assert {e.kind for e in gap.bifurcations} == {"extremum"}  # its doublings are generic everywhere
    stops = so.track(doublings(0.55, None)[1], "Kc", (0.05, 4.7), harmonics=harmonics)
    assert extreme(stops, "Kc") == [pytest.approx(NUMBERS["exact_p0.55_j0_over_Kc"]["minimum"], abs=1e-6)]


def second_doubling():
    return doubled_branch(1.7).bifurcations["PD"][0]


@pytest.mark.parametrize("max_step", [0.03, None, 0.1])
def test_second_stage_over_the_load(max_step):
    numbers = NUMBERS["s3000_Kc4.7_j0_over_p"]
    curve = so.track(second_doubling(), "p", (1.7, 0.5), max_step=max_step)
    minima = [(e.omega, e.parameter("p")) for e in curve.extrema if e.remark() == "minimum of p"]
    assert len(minima) == 2
    assert [e.remark() for e in curve.extrema].count("maximum of p") == 1
    assert max(minima) == pytest.approx(numbers["second_stage_minimum"], abs=2e-6)
    assert ends(curve) == pytest.approx(numbers["second_stage"]["1.7"], abs=1e-6)


def test_second_stage_over_the_stiffness_of_the_stops():
    curve = so.track(second_doubling(), "Kc", (2.0, 4.7))
    expected = NUMBERS["s3000_p1.7_j0_over_Kc"]["second_stage_minimum"]
    assert extreme(curve, "Kc") == [pytest.approx(expected, abs=2e-6)]


def test_doubled_limit_points_end_on_the_period_doublings():
    """The isola's birth and merger, the cusp, and both ends: the same GPDs as on the curve of period doublings."""
    numbers = NUMBERS["s3000_Kc4.7_p0.55_doubled_limit_points_over_j"]
    limits = doubled_branch(0.55).bifurcations["LP"]
    upper, lower = (so.track(b, "j", (0.0, 1.0)) for b in sorted(limits[:2], key=lambda b: b.omega))
    born, merges = extreme(lower, "j")
    assert born == pytest.approx(numbers["born"], abs=1e-6)
    assert merges == pytest.approx(numbers["merges"], abs=1e-6)
    (cusp,) = lower.bifurcations["CP"]
    assert (cusp.omega, cusp.parameter("j")) == pytest.approx(numbers["cusp"], abs=1e-6)
    doubling = so.track(doublings(0.55)[0], "j", (0.0, 1.0))
    expected = [(e.omega, e.parameter("j")) for e in doubling.bifurcations["GPD"]]
    assert len(expected) == 2
    for curve, place in zip((upper, lower), expected, strict=True):
        (end,) = curve.bifurcations["GPD"]
        assert (end.omega, end.parameter("j")) == pytest.approx(place, abs=3e-5)
        assert (curve.omega[-1], curve.parameter("j")[-1]) == (end.omega, end.parameter("j"))
        assert "period doublings of the parent" in curve.ended
    dataset = doubling.to_xarray()
    told = {str(text) for text in dataset["event_extreme"].values}
    assert told == {"", "maximum of j", "minimum of omega"}
    after = dataset["event_after"].values
    assert np.array_equal(dataset["event_stable_after"].values == 1, doubling.stable[after])
    # c3 is negative, the doublings supercritical, outside the two
    first, last = sorted(e.arclength for e in doubling.bifurcations["GPD"])
    inside = (doubling.arclength > first) & (doubling.arclength < last)
    assert inside.sum() > 1
    assert np.all(doubling.coefficient[inside] > 0.0)
    assert np.all(doubling.coefficient[~inside] < 0.0)


def test_corners_of_the_exact_law_where_another_contact_grazes():
    """The limit point behind the first touch of the left stop, over the right gap, passes from one stop to the other.

    As the right gap grows to that of the left, both contacts graze at once. With sharp but rounded stops the curve is
    smooth and runs beside it.
    """
    exact, rounded = (
        so.track(
            so.frequency_response(so.library.reference_oscillator(regularization=s), (1.8, 1.6)).bifurcations["LP"][0],
            "j",
            (0.0, 1.0),
            harmonics=harmonics,
        )
        for s, harmonics in ((None, 63), (3e4, "adaptive"))
    )
    for curve in (exact, rounded):
        assert (curve.parameter("j")[0], curve.parameter("j")[-1]) == pytest.approx((0.0, 1.0)), curve.ended
    # a step of the least length may happen to pass a corner, which is not noted then
    assert any("corner" in note for note in exact.warnings) or np.diff(exact.arclength).min() < 1e-6
    assert exact.omega[-1] == pytest.approx(rounded.omega[-1], abs=2e-3)
    inside = np.linspace(0.05, 0.95, 10)
    beside = np.interp(inside, rounded.parameter("j"), rounded.omega)
    assert np.interp(inside, exact.parameter("j"), exact.omega) == pytest.approx(beside, abs=2e-3)
