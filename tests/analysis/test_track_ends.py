"""Where tracked curves end: closed behind corners, at the parent's period doublings, in 1:1 resonances.

And curves that begin where the equations have a size of zero: at rest, on the unit circle.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module

import numpy as np
import pytest
from slow import slow

import suboctave as so


def test_a_curve_that_closes_behind_corners_is_run_through_once():
    """Limit points between two preloaded stops: rounded they close with two cusps, exact with two corners instead."""
    found = {}
    for law in ({}, {"regularization": 3000.0}):
        stops = [
            so.ElasticStop(0, 4.0, "g", side="right", **law),
            so.ElasticStop(0, 2.0, -1.0, side="left", **law),
        ]
        system = so.System(1.0, 0.06, 1.0, stops, [so.HarmonicLoad(0, 0.4)], {"g": -0.5})
        limit_points = so.frequency_response(system, (1.2, 1.8)).bifurcations["LP"]
        first = min(limit_points, key=lambda b: abs(b.omega - 1.465))
        curve = so.track(first, "g", (-1.0, 0.9), omega=(0.36, 4.95))
        assert curve.closed
        assert len(curve) < 100
        found[bool(law)] = curve
    crossed = np.diff(np.sign(found[False].parameter("g") + 0.6)) != 0
    assert crossed.sum() == 2
    cusps = [(e.omega, e.parameter("g")) for e in found[True].bifurcations if e.kind == "CP"]
    corners = [(e.omega, e.parameter("g")) for e in found[False].bifurcations]
    assert len(cusps) == 2
    assert len(corners) == 4
    for omega, gap in cusps:
        beside = [c for c in corners if abs(c[0] - omega) < 5e-3 and abs(c[1] - gap) < 5e-3]
        assert len(beside) == 2


STEPS = [{}, {"max_step": 0.15}]
STEPS += slow({"max_step": 0.1}, {"angle": 0.3}, {"initial_step": 0.003}, {"initial_step": 0.02})


@cache
def doubled_limit_point(damping):
    """With damping and load smaller alike, the tip of a narrow tongue moves to F = 5 damping at omega = 2."""
    spring = so.PolynomialSpring(0, {2: 0.6, 3: 0.5})
    system = so.System(1.0, damping, 1.0, [spring], [so.HarmonicLoad(0, "F")], {"F": 10.0 * damping})
    doubling = so.frequency_response(system, (1.5, 2.6)).bifurcations["PD"][0]
    return so.switch_branch(doubling).bifurcations["LP"][0]


@pytest.mark.parametrize("steps", STEPS, ids=str)
@pytest.mark.parametrize("damping", [1e-2, 1e-3, 1e-4])
def test_doubled_limit_points_of_little_damping_end_where_they_leave_the_parent(damping, steps):
    """There residuals tell limit points and period doublings apart for a small part of the way, if at all."""
    stepping = so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **steps})
    bounds = (damping, 100.0 * damping)
    curve = so.track(doubled_limit_point(damping), "F", bounds, omega=(1.3, 3.0), stepping=stepping)
    found = [e.kind for e in curve.bifurcations]
    assert found == ["GPD"] if damping > 1e-4 else found in ([], ["GPD"])
    ends = [(e.omega, e.parameter("F")) for e in curve.bifurcations] or [(curve.omega[0], curve.parameter("F")[0])]
    ((omega, load),) = ends
    # the end moves with the square of the damping, as far as 1e-7 of the ranges tell
    assert omega - 2.0 == pytest.approx(9.4 * damping**2, rel=0.05, abs=6e-7)
    assert load / damping - 5.0 == pytest.approx(270.0 * damping**2, rel=0.1, abs=3e-5)
    assert "period doublings of the parent motion" in curve.ended
    assert len(curve) < 150


@pytest.mark.parametrize("options", [{}, *slow({"max_step": 0.02})])
@pytest.mark.parametrize("low", [0.45, 0.4])
def test_torus_curves_end_in_resonances_of_symmetric_motions(low, options):
    """Forced van der Pol oscillator: at both ends kappa vanishes, once on a curve of branch points.

    (0.50031, 1.0589) by shooting: the multipliers are on the unit circle up to F = 1.0585, with angles that vanish like
    a square root in F.
    """
    system = so.System.from_equations("x'' - mu*(1 - x**2)*x' + x = F*cos(omega*t)", {"mu": 0.2, "F": 0.3})
    torus = so.frequency_response(system, (0.5, 2.0)).bifurcations["NS"][0]
    curve = so.track(torus, "F", (0.02, 3.0), omega=(low, 2.2), **options)
    ends = [(e.omega, e.parameter("F")) for e in curve.bifurcations if e.kind == "R1"]
    assert ends[0] == pytest.approx((0.949342, 0.192401), abs=2e-6)
    assert ends[1] == pytest.approx((0.500306, 1.058939), abs=2e-5)
    assert [e.kind for e in curve.bifurcations] == ["R1", "R4", "R3", "R3", "R4", "R1"]


def test_branch_points_of_rest_are_tracked():
    """No forces balance there: the unfolding has the size of those that a motion would need."""
    system = so.library.mathieu_duffing(eps=0.6)
    first = so.frequency_response(system, (0.4, 3.0)).bifurcations["BP"][0]
    curve = so.track(first, "eps", (0.05, 1.0))
    (tip,), (turn,) = curve.extrema, curve.bifurcations["GPF"]
    assert tip.remark().startswith("minimum of eps")
    low, high = tip.parameter("eps"), turn.parameter("eps")
    # beside the tip both pitchforks are of one kind, farther up the tongue one of each
    for eps, kinds in ((0.5 * (low + high), 1), (2.0 * high - low, 2)):
        beside = so.frequency_response(system.with_parameters({"eps": eps}), (0.9, 1.08), max_step=0.01)
        assert len(beside.bifurcations["BP"]) == 2
        assert len({item.criticality for item in beside.bifurcations["BP"]}) == kinds
    assert curve.amplitude.max() == 0.0
    eps = curve.parameter("eps")
    crossings = np.flatnonzero(np.diff(np.sign(eps - 0.65)))
    assert len(crossings) == 2
    beside = so.frequency_response(system.with_parameters({"eps": 0.65}), (0.85, 1.1)).bifurcations["BP"]
    found = sorted(
        np.interp(0.65, sorted(eps[i : i + 2]), curve.omega[i : i + 2][np.argsort(eps[i : i + 2])]) for i in crossings
    )
    assert found == pytest.approx(sorted(b.omega for b in beside), abs=2e-4)


def test_a_branch_from_a_torus_point_finds_it():
    """With one degree of freedom the product of the multipliers is one there, as without damping."""
    system = so.System.from_equations(
        "x'' - mu*(1 - x**2)*x' + x + a*x**3 = F*cos(omega*t)", {"mu": 0.5, "a": 0.2, "F": 0.6}
    )
    torus = so.frequency_response(system, (0.5, 2.0)).bifurcations["NS"][0]
    curve = so.track(torus, "F", (0.3, 1.0), omega=(0.45, 2.2))
    found = 0
    inside = curve.orbits[1:-1:3]
    for orbit in inside:
        branch = so.continue_branch(orbit, "omega", (0.985 * orbit.omega, 1.015 * orbit.omega))
        found += [b.kind for b in branch.bifurcations].count("NS")
        assert not any("undamped" in words for words in branch.warnings)
    assert found == len(inside)


def test_multipliers_contradict_a_double_one():
    """Constant damping keeps the product of the multipliers below one: a Helmholtz oscillator has no 1:1 resonance.

    Close to its homoclinic motions few harmonics say otherwise.
    """
    spring = so.PolynomialSpring(0, {2: -1.0})
    system = so.System(1.0, 0.1, 1.0, [spring], [so.HarmonicLoad(0, "F")], {"F": 0.05})
    limit_point = so.frequency_response(system, (0.3, 2.2)).bifurcations["LP"][1]
    curve = so.track(limit_point, "F", (0.005, 0.2), omega=(0.15, 3.3))
    assert [e.kind for e in curve.bifurcations] == ["CP"]
    assert any("R1" in words and "too few harmonics" in words for words in curve.warnings)
    # nor are some of its points told by their multipliers
    assert any("the critical multiplier is off by more than 0.05" in words for words in curve.warnings)
    usual = so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 0.5)).bifurcations["LP"][0]
    assert so.track(usual, "F", (0.05, 0.5)).warnings == ()


def test_limit_points_end_where_their_motions_become_symmetric():
    """Behind the end a tracker would drift along the branch points of the symmetric motions, from event to event."""
    stops = [
        so.ElasticStop(0, 5.0, gap, side=side, regularization=50.0) for gap, side in (("g", "right"), ("-g", "left"))
    ]
    system = so.System(1.0, 0.08, 1.0, stops, [so.HarmonicLoad(0, "F")], {"g": 1.0, "F": 3.0})
    curve = so.frequency_response(system, (0.3, 0.5), harmonics=31)
    branch = so.switch_branch(curve.bifurcations["BP"][0])
    limit_points = so.track(branch.bifurcations["LP"][0], "F", (0.3, 8.0), omega=(0.27, 5.5))
    assert limit_points.ended.count("the motions become symmetric") == 2
    assert len(limit_points) < 80
    assert [e.kind for e in limit_points.bifurcations] == ["CP", "CP"]
    # the branch points pass there
    found = so.track(curve.bifurcations["BP"][0], "F", (2.0, 6.0), omega=(0.27, 5.5))
    for orbit in (limit_points.orbits[0], limit_points.orbits[-1]):
        apart = np.hypot(found.omega - orbit.omega, found.parameter("F") - orbit.values["F"])
        assert apart.min() < 0.2


@pytest.mark.slow
def test_a_system_that_is_symmetric_at_one_value_only_does_not_end_a_curve():
    """Stops at g**2 and g - 1 are mirror images at g = 0.618, where the limit points' motions are nearly symmetric."""
    stops = [
        so.ElasticStop(0, 4.7, "g**2", side="right", regularization=300.0),
        so.ElasticStop(0, 4.7, "-1 + g", side="left", regularization=300.0),
    ]
    system = so.System(1.0, 0.03, 1.0, stops, [so.HarmonicLoad(0, 0.55)], {"g": 0.2})
    limit_point = so.frequency_response(system, (0.8, 5.0)).bifurcations["LP"][0]
    curve = so.track(limit_point, "g", (0.0, 0.9), omega=(0.2, 8.0), max_step=0.1)
    assert "symmetric" not in curve.ended
    ends = sorted((curve.omega[i], curve.parameter("g")[i]) for i in (0, -1))
    assert ends == [pytest.approx((0.717156, 0.0), abs=1e-6), pytest.approx((0.798715, 0.0), abs=1e-6)]


@pytest.mark.slow
def test_behind_a_corner_no_other_part_of_the_curve_is_taken():
    """The only solution at a given height of the grazing lay far from it, on a part that led back to the start."""
    stops = [
        so.ElasticStop(0, 3.0, -0.2, side="right"),
        so.ElasticStop(0, 6.0, -1.04, side="left"),
    ]
    system = so.System(1.0, 0.04, 1.0, stops, [so.HarmonicLoad(0, "F")], {"F": 0.8})
    limit_point = so.frequency_response(system, (0.5, 5.0)).bifurcations["LP"][0]
    curve = so.track(limit_point, "F", (0.2, 3.0), omega=(0.2, 8.0))
    cusps = [(e.omega, e.parameter("F")) for e in curve.bifurcations if e.kind == "CP"]
    for one in range(len(cusps)):
        for other in range(one):
            assert np.hypot(*(np.array(cusps[one]) - cusps[other])) > 1e-6
    start, end = ((curve.omega[i], curve.parameter("F")[i]) for i in (0, -1))
    assert np.hypot(start[0] - end[0], start[1] - end[1]) > 1e-3


@pytest.mark.slow
def test_a_cubic_coefficient_that_jumps_in_a_corner_is_no_generalised_doubling():
    """c3 changes sign where a contact grazes, without vanishing: doublings are supercritical on both sides."""

    def system(g):
        stop = so.ElasticStop(0, 6.0, "g", side="right")
        return so.System(1.0, 0.05, 1.0, [stop], [so.HarmonicLoad(0, 0.6)], {"g": g})

    doubling = so.frequency_response(system(0.5), (0.4, 5.0)).bifurcations["PD"][0]
    curve = so.track(doubling, "g", (0.0, 1.0), omega=(0.2, 8.0))
    assert curve.closed
    assert not curve.bifurcations["GPD"]
    for g in (0.5505, 0.55095, 0.552):
        doublings = so.frequency_response(system(g), (0.44, 0.5)).bifurcations["PD"]
        assert [event.criticality for event in doublings] == ["supercritical", "supercritical"]


def test_a_bound_just_inside_a_turn_ends_a_curve_from_either_side():
    """Each cusp once, and none beyond the bound."""
    spring = so.PolynomialSpring(0, {2: 0.8, 3: 0.5})
    system = so.System(1.0, 0.03, 1.0, [spring], [so.HarmonicLoad(0, "F")], {"F": 0.4})
    for limit_point in so.frequency_response(system, (0.3, 3.0)).bifurcations["LP"][:2]:
        whole = so.track(limit_point, "F", (0.01, 1.0))
        assert whole.closed
        low = min(e.parameter("F") for e in whole.bifurcations["CP"])
        inside = so.track(limit_point, "F", (low + 1e-5, 1.0))
        assert not inside.closed
        assert inside.ended.startswith("reached the end of the range")
        assert inside.parameter("F").min() == low + 1e-5
        assert len(inside.bifurcations["CP"]) == 1


def test_a_curve_that_closes_the_other_way_is_whole(monkeypatch):
    """Where following it the first way fails, what that gave is part of the closed curve and not told twice."""
    spring = so.PolynomialSpring(0, {2: 0.8, 3: 0.5})
    system = so.System(1.0, 0.03, 1.0, [spring], [so.HarmonicLoad(0, "F")], {"F": 0.4})
    limit_point = so.frequency_response(system, (0.3, 3.0)).bifurcations["LP"][0]
    expected = so.track(limit_point, "F", (0.01, 1.0))
    module = import_module("suboctave.analysis.track")
    own, calls = module.follow_tracked, []

    def followed(*given):
        found = own(*given)
        calls.append(found)
        if len(calls) == 1:
            found.closed, found.ended = False, "step size fell"
        return found

    monkeypatch.setattr(module, "follow_tracked", followed)
    curve = so.track(limit_point, "F", (0.01, 1.0))
    assert len(calls) == 2
    assert curve.closed
    assert [e.kind for e in curve.bifurcations] == [e.kind for e in expected.bifurcations][::-1]


@pytest.mark.parametrize(
    "stepping", [{}, *slow({"max_step": 0.02}, {"max_step": 0.1}, {"initial_step": 0.02})], ids=str
)
def test_nothing_turns_falsely_where_doubled_limit_points_of_little_damping_come_to_their_end(stepping):
    # within 1e-6 of the end the parameters run as the tolerance of points would have them, were it all that is asked
    spring = so.PolynomialSpring(0, {2: "a2", 3: 0.5})
    system = so.System(1.0, 1e-3, 1.0, [spring], [so.HarmonicLoad(0, 0.02)], {"a2": 0.8})
    doubling = so.frequency_response(system, (1.3, 3.0)).bifurcations["PD"][0]
    parent = so.track(doubling, "a2", (0.0, 1.3), omega=(1.2, 4.0))
    ends = {e.omega: e.parameter("a2") for e in parent.bifurcations if e.kind == "GPD"}
    assert len(ends) == 3
    doubled = so.switch_branch(doubling).bifurcations["LP"]
    assert len(doubled) == 3
    options = {"angle": 0.15, "growth": 4.0, **stepping}
    met = set()
    for item in doubled:
        curve = so.track(item, "a2", (0.0, 1.3), omega=(1.2, 4.0), stepping=so.SteppingOptions(**options))
        assert "in a GPD" in curve.ended
        (end,) = (e for e in curve.bifurcations if e.kind == "GPD")
        omega = min(ends, key=lambda known: abs(known - end.omega))
        met.add(omega)
        np.testing.assert_allclose((end.omega, end.parameter("a2")), (omega, ends[omega]), rtol=1e-8)
        rest = [e for e in curve.bifurcations if e is not end]
        assert all(e.kind == "extremum" for e in rest)
        assert all(abs(e.parameter("a2") - end.parameter("a2")) > 1e-3 for e in rest)
    assert met == set(ends)


@pytest.fixture(scope="module")
def entrained() -> list[so.Bifurcation]:
    """NS points of a van der Pol-Duffing oscillator, in two gaps between which it follows its load."""
    system = so.System.from_equations(
        "x'' - 0.2*(1 - x**2)*x' + x + a*x**3 = F*cos(omega*t)", parameters={"a": 0.2, "F": 1.5}
    )
    return list(so.frequency_response(system, (0.3, 3.0)).bifurcations["NS"])


STEPPINGS = [{}, {"max_step": 0.15}, *slow({"max_step": 0.02}, {"initial_step": 0.003}, {"angle": 0.3})]


@pytest.mark.parametrize("stepping", STEPPINGS, ids=str)
def test_of_two_resonances_close_by_an_ns_curve_ends_in_its_own(entrained, stepping):
    """Another 1:1 resonance lies 3e-3 further on, on the curve of limit points through both."""
    item = min(entrained, key=lambda known: abs(known.omega - 0.376684))
    options = so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **stepping})
    curve = so.track(item, "F", (0.2, 3.0), omega=(0.3, 4.0), stepping=options)
    found = sorted((e.omega, e.parameter("F")) for e in curve.bifurcations if e.kind == "R1")
    np.testing.assert_allclose(found, [(0.3143185, 1.6421045), (0.3963500, 1.2138676)], atol=2e-6)


@pytest.mark.parametrize("stepping", STEPPINGS, ids=str)
def test_a_turn_just_before_the_end_is_met(entrained, stepping):
    """omega turns 1e-4 before the 1:1 resonance, within the last step."""
    item = min(entrained, key=lambda known: abs(known.omega - 0.376684))
    options = so.SteppingOptions(**{"angle": 0.15, "growth": 4.0, **stepping})
    curve = so.track(item, "a", (0.0, 1.0), omega=(0.3, 4.0), stepping=options)
    (turn,) = curve.extrema
    (end,) = (e for e in curve.bifurcations if e.kind == "R1")
    assert (turn.parameter_name, turn.extreme) == ("omega", "maximum")
    assert turn.omega > end.omega
    np.testing.assert_allclose((turn.omega, turn.parameter("a")), (0.4656724, 0.4786963), atol=1e-6)
    np.testing.assert_allclose((end.omega, end.parameter("a")), (0.4656711, 0.4787943), atol=1e-5)


def test_a_curve_towards_heteroclinic_motions_ends_where_multipliers_tell_nothing():
    """A softening spring at low frequencies: the motions stay symmetric, but for what rounding makes of them."""
    system = so.System.from_equations("x'' + 0.1*x' + x - a*x**3 = 0.2*cos(omega*t)", parameters={"a": 0.15})
    limit_point = so.frequency_response(system, (0.3, 1.6)).bifurcations["LP"][0]
    curve = so.track(limit_point, "a", (0.01, 0.4), omega=(0.1, 3.0))
    assert "symmetric" not in curve.ended
    assert "the critical multiplier is lost at" in curve.ended
    assert len(curve) < 400
    # up to there they are those of response curves
    found = so.frequency_response(system.with_parameters({"a": 0.1}), (0.3, 1.6)).bifurcations["LP"]
    at = curve.parameter("a")
    crossed = np.flatnonzero((at[:-1] - 0.1) * (at[1:] - 0.1) < 0.0)
    assert len(crossed) > 0
    for i in crossed:
        low, high = sorted(curve.omega[[i, i + 1]])
        assert any(low - 1e-4 < item.omega < high + 1e-4 for item in found)
