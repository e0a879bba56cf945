"""Curves of period doublings of little damping: tongues with tips as sharp as steps are short, and the corner at a
closed gap, behind which they go steeply on."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from slow import slow

import suboctave as so

STEPS = [{}, {"max_step": 0.15}]
STEPS += slow({"max_step": 0.02}, {"initial_step": 0.003}, {"initial_step": 0.02}, {"angle": 0.3})


def rattling(damping: float, **values: float) -> so.System:
    elements = [
        so.ElasticStop(dof=0, stiffness=1.5, gap="g", side="right", regularization=60.0),
        so.CubicSpring(dof=0, coefficient=0.2),
    ]
    return so.System(
        mass=1.0,
        damping=damping,
        stiffness=1.0,
        elements=elements,
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"g": 0.1, "F": 0.02, **values},
    )


def tracked(item: so.Bifurcation, name: str, bounds: tuple[float, float], **stepping: float) -> Any:
    options = {"angle": 0.15, "growth": 4.0, **stepping}
    return so.track(item, name, bounds, omega=(1.2, 5.0), stepping=so.SteppingOptions(**options))


@cache
def tongue() -> Any:
    """The one over the gap that several tests look at."""
    return tracked(doublings(rattling(2e-3))[0], "g", (-0.2, 0.6))


def doublings(system: so.System) -> list[so.Bifurcation]:
    return list(so.frequency_response(system, (1.4, 3.2)).bifurcations["PD"])


def events(curve: Any) -> list[tuple[str, str, float, float]]:
    found = [(e.kind, getattr(e, "extreme", ""), e.omega, e.parameter(curve.names[1])) for e in curve.bifurcations]
    return sorted(found, key=lambda item: item[2:])


@pytest.mark.parametrize("stepping", STEPS, ids=str)
@pytest.mark.parametrize("which", [0, *slow(1)])
def test_tongue_over_the_gap_closes_once_round(which, stepping):
    # its two sides pass g = 0, where the law's derivative by g jumps, at 22 g and -3 g; its tips turn within 1e-4
    curve = tracked(doublings(rattling(2e-3))[which], "g", (-0.2, 0.6), **stepping)
    assert curve.closed, curve.ended
    found = events(curve)
    assert [kind for kind, *_ in found].count("GPD") == 4
    assert [extreme for kind, extreme, *_ in found if kind == "extremum"] == [
        "minimum",
        "maximum",
        "minimum",
        "maximum",
    ]
    assert len(found) == 8
    places = np.array([item[2:] for item in found])
    expected = [
        (2.07183325, 0.10798446),
        (2.07183391, 0.10800188),
        (2.07188654, 0.10806718),
        (2.54313954, 0.00682218),
        (2.57484537, 0.00121778),
        (3.07764918, -0.14869604),
        (3.07769492, -0.14862041),
        (3.07769496, -0.14862488),
    ]
    np.testing.assert_allclose(places, expected, atol=1e-7)


@pytest.mark.parametrize("gap", [1e-5, 0.0, -1e-5, -1e-3])
def test_both_sides_of_a_closed_gap_are_those_of_response_curves(gap):
    curve = tongue()
    at = curve.parameter("g")
    crossed = np.flatnonzero((at[:-1] - gap) * (at[1:] - gap) <= 0.0)
    between = [np.sort(curve.omega[[i, i + 1]]) for i in crossed]
    found = doublings(rattling(2e-3, g=gap))
    assert len(found) == 2
    for item in found:
        assert any(low - 1e-6 <= item.omega <= high + 1e-6 for low, high in between)


@pytest.mark.parametrize("which", [0, *slow(1)])
@pytest.mark.parametrize("stepping", STEPS, ids=str)
def test_tip_of_a_tongue_over_the_load_has_one_extremum(which, stepping):
    # its width is 4e-5 of omega, its radius in scaled arclength 1e-6: a step may lead from one side to the other
    curve = tracked(doublings(rattling(1e-3))[which], "F", (0.006, 0.08), **stepping)
    turns = [e for e in curve.bifurcations if e.kind == "extremum"]
    assert "step size fell" not in curve.ended
    assert len(turns) == 1
    assert [e.kind for e in curve.bifurcations].count("GPD") == 1
    assert turns[0].parameter_name == "F"
    assert turns[0].extreme == "minimum"
    assert abs(turns[0].omega - 2.0773824) < 2e-6
    assert abs(turns[0].parameter("F") - 0.00867985) < 1e-8


@pytest.mark.parametrize("max_step", [None, *slow(0.15)])
@pytest.mark.parametrize("inside", [*slow(1e-3), 1e-6])
def test_range_of_omega_that_ends_just_inside_a_turn_ends_the_curve(inside, max_step):
    # the tongue's least and greatest omega: a step may pass the bound and come back
    item = doublings(rattling(0.02, F=0.24))[0]
    whole = so.track(item, "g", (-0.5, 1.0), omega=(1.2, 5.0), max_step=max_step)
    assert whole.closed
    turns = [e.omega for e in whole.extrema if e.parameter_name == "omega"]
    for bounds in ((1.2, max(turns) - inside), (min(turns) + inside, 5.0)):
        part = so.track(item, "g", (-0.5, 1.0), omega=bounds, max_step=max_step)
        assert not part.closed
        bound = next(b for b in bounds if b not in (1.2, 5.0))
        assert part.omega[0] == bound
        assert part.omega[-1] == bound
        assert bounds[0] <= part.omega.min()
        assert part.omega.max() <= bounds[1]
        assert sum(e.parameter_name == "omega" for e in part.extrema) == 1


@pytest.fixture(scope="module")
def between_stops() -> list[so.Bifurcation]:
    stops = [
        so.ElasticStop(dof=0, stiffness=5.0, gap="g", side="right", regularization=200.0),
        so.ElasticStop(dof=0, stiffness=5.0, gap="-g/2", side="left", regularization=200.0),
    ]
    system = so.System(1.0, 0.04, 1.0, stops, [so.HarmonicLoad(0, 0.8)], {"g": 1.0})
    return list(so.frequency_response(system, (0.28, 0.34)).bifurcations["PD"])


@pytest.mark.parametrize(
    "stepping", [{}, *slow({"max_step": 0.15}, {"max_step": 0.1}, {"angle": 0.3}, {"initial_step": 0.02})]
)
def test_two_turns_within_a_step_are_told_from_each_other(between_stops, stepping):
    # omega has a maximum and a minimum 2e-6 apart; more harmonics move the minimum by half of the way between
    options = so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **stepping})
    curve = so.track(between_stops[0], "g", (0.9, 1.25), omega=(0.2, 0.5), stepping=options)
    found = [(e.parameter_name, e.extreme, e.omega, e.parameter("g")) for e in curve.extrema]
    expected = [
        ("omega", "minimum", 0.3001754, 1.04935),
        ("omega", "maximum", 0.3009383, 1.13935),
        ("omega", "minimum", 0.3009362, 1.14474),
        ("g", "maximum", 0.3014528, 1.15833),
        ("omega", "maximum", 0.3018463, 1.14914),
        ("omega", "minimum", 0.3016095, 1.10971),
    ]
    assert [item[:2] for item in found] == [item[:2] for item in expected]
    np.testing.assert_allclose([item[2:] for item in found], [item[2:] for item in expected], atol=1e-5)


@pytest.fixture(scope="module")
def rattle() -> so.Bifurcation:
    """A limit point of a mass between two rounded stops of another one."""
    stops = [so.ElasticStop((0, 1), "k", gap, side=side, regularization=50.0) for gap, side in GAPS]
    system = so.System(
        [[1.0, 0.0], [0.0, 0.3]],
        [[0.03, -0.01], [-0.01, 0.01]],
        [[1.2, -0.2], [-0.2, 0.2]],
        stops,
        [so.HarmonicLoad(0, 0.1)],
        {"k": 2.0},
    )
    return so.frequency_response(system, (0.4, 2.6)).bifurcations["LP"][0]


GAPS = [(0.5, "right"), (-0.5, "left")]


@pytest.mark.parametrize("max_step", [None, *slow(0.02, 0.15)])
def test_pair_that_passes_the_circle_just_before_it_splits_beside_the_critical_multiplier(rattle, max_step):
    # the one real multiplier of it goes on to +1 (R1), within a stride of points whose multipliers are computed
    curve = so.track(rattle, "k", (1.9, 6.0), omega=(0.3, 4.0), max_step=max_step)
    (item,) = (e for e in curve.bifurcations if e.kind == "LPNS")
    assert (item.omega, item.parameter("k")) == pytest.approx((0.8698852, 3.5015484), abs=1e-6)
    pair = item.multipliers[item.multipliers.imag > 0.0]
    assert np.abs(np.abs(pair) - 1.0).min() < 1e-3
    (double,) = (e for e in curve.bifurcations if e.kind == "R1")
    assert (double.omega, double.parameter("k")) == pytest.approx((0.868686, 3.393689), abs=1e-4)


@pytest.mark.parametrize(
    "stepping", [{}, *slow({"max_step": 0.02}, {"max_step": 0.15}, {"initial_step": 0.003})], ids=str
)
def test_minimum_and_maximum_beside_a_cusp(stepping):
    # both parameters turn in the cusp 7e-6 before the extremum, within a step
    system = so.System.from_equations(
        [
            "x'' + 0.004*x' + x + x**3 + c*(x'-y') + 0.045*(x-y) + 0.004*(x-y)**3 = 0.12*cos(omega*t)",
            "0.05*y'' + c*(y'-x') + 0.045*(y-x) + 0.004*(y-x)**3 = 0",
        ],
        parameters={"c": 0.012},
    )
    item = so.frequency_response(system, (0.6, 2.0)).bifurcations["LP"][0]
    options = so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **stepping})
    curve = so.track(item, "c", (0.004, 0.03), omega=(0.4, 3.0), stepping=options)
    (turn,) = (e for e in curve.extrema if abs(e.omega - 1.055034) < 1e-5)
    assert (turn.parameter_name, turn.extreme) == ("omega", "maximum")
    assert turn.parameter("c") == pytest.approx(0.0120186, abs=1e-7)
    # along the curve itself: from the cusp omega rises to there
    (cusp,) = (e for e in curve.bifurcations if e.kind == "CP" and abs(e.omega - turn.omega) < 1e-5)
    assert cusp.omega < turn.omega


@pytest.mark.slow
def test_curves_of_extrema_keep_the_ranges_of_the_curve_that_they_lie_on():
    stop = so.ElasticStop(dof=0, stiffness=1.0, gap=0.3, side="left", regularization=500.0)
    system = so.System(1.0, "2*z", 0.3, [stop], [so.HarmonicLoad(0, "p")], {"z": 0.05, "p": 0.2})
    doubling = so.frequency_response(system, (0.3, 2.6)).bifurcations["PD"][0]
    first = so.track(doubling, "p", (0.02, 1.0), omega=(0.2, 5.0))
    by_name = {name: next(e for e in first.extrema if e.parameter_name == name) for name in ("omega", "p")}
    beside = so.track(by_name["omega"], "z", (0.01, 0.1))
    assert beside.parameter("p").max() == 1.0
    extreme = so.track(by_name["p"], "z", (0.01, 0.1))
    assert extreme.parameter("p").max() == pytest.approx(1.98)
    assert len(extreme) < 400
