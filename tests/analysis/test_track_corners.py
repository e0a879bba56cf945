"""Corners of tracked curves with stops of the exact law: what lies behind one, and what turns in it."""

from functools import lru_cache

import numpy as np
import pytest
from slow import slow

import suboctave as so

STEPS = [{}, *slow({"angle": 0.3}, {"max_step": 0.02}, {"initial_step": 0.003}, {"initial_step": 0.02})]


def options(stepping: dict[str, float]) -> so.SteppingOptions:
    return so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **stepping})


def one_stop(r: float = 0.7) -> so.System:
    stop = so.ElasticStop(dof=0, stiffness="6*r", gap="r**2", side="right")
    return so.System(1.0, 0.05, 1.0, [stop], [so.HarmonicLoad(0, 0.6)], {"r": r})


@lru_cache
def doublings() -> tuple[so.Bifurcation, ...]:
    return tuple(so.frequency_response(one_stop(), (0.4, 5.0)).bifurcations["PD"])


@lru_cache
def closed(which: int, **stepping: float) -> so.Branch:
    return so.track(doublings()[which], "r", (0.05, 1.2), omega=(0.2, 8.0), stepping=options(stepping))


@lru_cache
def border() -> so.Branch:
    return so.track(doublings()[0], "r", (0.05, 1.2), omega=(0.2, 8.0))


@lru_cache
def limit_point() -> so.Bifurcation:
    stops = [
        so.ElasticStop(dof=0, stiffness=4.7, gap="g", side="right"),
        so.ElasticStop(dof=0, stiffness=4.7, gap=-1.0, side="left"),
    ]
    system = so.System(1.0, 0.03, 1.0, stops, [so.HarmonicLoad(0, 0.55)], {"g": 0.1})
    points = so.frequency_response(system, (1.3, 4.5)).bifurcations["LP"]
    return min(points, key=lambda known: abs(known.omega - 1.6058618))


@pytest.mark.parametrize("stepping", STEPS, ids=str)
@pytest.mark.parametrize("which", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_behind_a_corner_the_curve_goes_on_not_another_one_beside_it(which, stepping):
    # a second closed curve of period doublings comes within 1e-3 of the corner
    curve = closed(which, **stepping)
    assert curve.closed, curve.ended
    turns = sorted((e.parameter_name, e.extreme, e.omega, e.parameter("r")) for e in curve.bifurcations)
    assert [turn[:2] for turn in turns] == [(n, e) for n in ("omega", "r") for e in ("maximum", "minimum")]
    expected = [(0.485372, 0.730648), (0.454176, 0.699832), (0.464988, 0.744828), (0.457402, 0.681390)]
    np.testing.assert_allclose([turn[2:] for turn in turns], expected, atol=2e-6)


def test_an_event_that_cannot_be_resolved_in_a_corner_does_not_end_a_curve():
    """The turn in a corner is found once, its place uncertain or not found again with more harmonics; the curve goes
    on.
    """
    curve = closed(1)
    assert curve.closed
    (turn,) = [event for event in curve.extrema if abs(event.omega - 0.485372) < 1e-5]
    noted = any(note.startswith("extremum") and "not found again" in note for note in curve.warnings)
    assert noted or 0.0 < turn.uncertainty < 1e-4


@pytest.mark.parametrize("r", [0.71, 0.7306, 0.732])
def test_both_sides_of_a_corner_are_those_of_response_curves(r):
    curve = border()
    found = so.frequency_response(one_stop(r), (0.43, 0.52)).bifurcations["PD"]
    at = curve.parameter("r")
    crossed = np.flatnonzero((at[:-1] - r) * (at[1:] - r) < 0.0)
    assert len(crossed) == 2
    # the other two of the response curve belong to the other closed curve
    known = [item.omega for item in found][:2]
    for i, omega in zip(sorted(crossed, key=lambda k: curve.omega[k]), known, strict=True):
        low, high = sorted(curve.omega[[i, i + 1]])
        assert low - 5e-5 < omega < high + 5e-5


@pytest.mark.parametrize("stepping", STEPS, ids=str)
def test_a_corner_passed_monotonically_is_no_extremum(stepping):
    curve = so.track(limit_point(), "g", (-0.4, 0.9), omega=(1.0, 5.0), stepping=options(stepping))
    assert np.all(np.diff(curve.parameter("g")) * np.sign(curve.parameter("g")[-1] - curve.parameter("g")[0]) > 0.0)
    assert not curve.extrema
    np.testing.assert_allclose(np.sort(curve.parameter("g")[[0, -1]]), (-0.4, 0.9))


@pytest.mark.parametrize("max_step", [None, 0.02, *slow(0.005)])
def test_limit_points_that_turn_back_in_a_corner_and_again_in_a_cusp(max_step):
    """The left stop grazes at p = 0.37660353; the curve comes back from there, and turns in a cusp 1e-6 farther."""
    system = so.library.reference_oscillator(p=0.4, j=0.0)
    (fold,) = so.frequency_response(system, (0.6, 0.8)).bifurcations["LP"][:1]
    folds = so.track(fold, "p", (0.36, 0.41), max_step=max_step)
    turned = [(event.kind, event.extreme, event.parameter_name) for event in folds.bifurcations]
    assert sorted(turned) == [("CP", "", "p"), ("extremum", "maximum", "omega"), ("extremum", "maximum", "p")]
    for event in folds.bifurcations:
        at = 0.37660262 if event.kind == "CP" else 0.37660353
        assert event.parameter("p") == pytest.approx(at, abs=2e-8 + event.uncertainty)
        assert event.amplitude == pytest.approx(1.0, abs=1e-5)
        assert event.uncertainty < 1e-6
