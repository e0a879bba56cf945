"""Laws so stiff that the most harmonics do not suffice, held against shooting: what is listed and what is drawn is true
within what is stated, or said to be open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.bordered import NullVectors
from suboctave.curves.events.layer import jumps
from suboctave.timedomain import locate_by_shooting, shoot


def stop(stiffness: float, gap: float, damping: float, load: float) -> so.System:
    """One mass on a spring of one, with an exact stop."""
    return so.System(1.0, damping, 1.0, [so.ElasticStop(0, stiffness, gap)], [so.HarmonicLoad(0, load)])


def true_multipliers(orbit: so.PeriodicOrbit) -> np.ndarray:
    """Of the motion that shooting leads to, by descending modulus."""
    found = shoot(orbit.system, orbit.start(), orbit.omega, values=dict(orbit.values))
    mu = np.asarray(found.multipliers)
    return mu[np.argsort(-np.abs(mu))]


@pytest.fixture(scope="module")
def doubling() -> so.Branch:
    return so.frequency_response(stop(1e3, 0.5, 0.08, 0.4), (0.637, 0.6395))


def test_a_doubling_states_how_far_harmonics_move_it(doubling):
    (item,) = doubling.bifurcations
    assert item.kind == "PD"
    # event-driven shooting, tolerance 1e-12
    true = 0.63819121
    assert item.omega == pytest.approx(true, abs=1e-6)
    assert abs(item.omega - true) <= item.uncertainty + 1e-8
    assert 0.0 < item.uncertainty < 1e-6
    assert abs(item.critical_multiplier() + 1.0) <= item.critical_error


def test_the_most_harmonics_are_said_once_with_the_call_that_raises_them(doubling):
    said = [line for line in doubling.warnings if "leave out up to" in line]
    assert len(said) == 1
    assert "harmonics=so.AdaptiveHarmonics(maximum=255)" in said[0]


def test_stable_motions_are_not_drawn_unstable():
    curve = so.frequency_response(stop(1e4, 1.0, 0.2, 0.6), (0.70, 0.715))
    assert curve.stable.all()
    assert not curve.open.any()
    assert not curve.audit.unsettled
    orbit = curve.orbits[len(curve) // 2]
    mu, errors = (values[len(curve) // 2] for values in (curve.multipliers, curve.multiplier_errors))
    assert np.abs(np.abs(mu) - np.abs(true_multipliers(orbit))).max() < 0.02
    assert errors.max() < 0.2


def test_at_a_given_number_of_harmonics_what_they_do_not_resolve_is_open():
    curve = so.frequency_response(stop(1e4, 1.0, 0.2, 0.6), (0.70, 0.705), harmonics=63)
    vague = curve.multiplier_errors.max(axis=1) > np.maximum(1.0, 0.5 * np.abs(curve.multipliers[:, 0]))
    assert vague.any()
    assert curve.open[vague].all()
    assert not curve.stable[vague].any()
    assert f"{np.count_nonzero(curve.open)} not settled" in repr(curve)
    assert any("multipliers are not resolved" in u.reason for u in curve.audit.unsettled)


def test_several_jumps_at_one_grazing_are_one_or_none():
    # behind a grazing a test function changes like a square root: it comes to zero once, or not at all
    curve = so.frequency_response(stop(1e5, 0.8, 0.1, 0.3), (0.7955, 0.7965), harmonics=63)
    (item,) = curve.bifurcations
    assert item.kind == "PD"
    assert item.discontinuous
    other = replace(item, uncertainty=item.uncertainty + 1e-6, arclength=item.arclength + 1e-6)
    (one,), back = jumps([item, other], curve.points)
    assert not back
    assert one.omega == item.omega
    assert one.uncertainty >= other.uncertainty  # as far as the others may lie
    # the same two between motions that are all stable lead there and back
    stable = [point for point in curve.points if point.floquet.unstable == 0]
    behind = [replace(point, arclength=item.arclength + 1.0) for point in stable]
    assert jumps([item, other], [*stable, *behind]) == ([], [[item, other]])
    # beside another grazing it is another one
    elsewhere = replace(other, contact=replace(other.contact, gap=-0.8))
    assert jumps([item, elsewhere], curve.points) == ([item, elsewhere], [])
    # of pairs the number outside tells the side; one that is solved for comes before one of which a bracket is known
    solved = replace(item, kind="NS", uncertainty=1e-5, null_vectors=NullVectors(np.ones(1), np.ones(1)))
    tori = [solved, replace(other, kind="NS", uncertainty=1e-6, null_vectors=None)]
    pairs = [np.array([size * np.exp(1j), size * np.exp(-1j)]) for size in (0.9, 1.1)]
    inside, outside = (
        replace(stable[0], arclength=item.arclength + way, known=replace(stable[0].floquet, multipliers=pair))
        for way, pair in zip((-1.0, 1.0), pairs, strict=True)
    )
    (one,), back = jumps(tori, [inside, outside])
    assert (one.omega, one.uncertainty, back) == (item.omega, 1e-5, [])
    assert jumps(tori, [inside, replace(inside, arclength=outside.arclength)]) == ([], [tori])


@pytest.mark.slow
def test_a_bubble_has_neither_a_doubling_nor_unstable_motions():
    """True multipliers have moduli of .87 to .90 there (shooting)."""
    text = "x'' + 1.5*x'**2/x + c*x'/x**2 - x**(-5.2) + 1/x - A*cos(omega*t)/x = 0"
    system = so.System.from_equations(text, parameters={"c": 0.1, "A": 0.2})
    curve = so.frequency_response(system, (3.0, 1.4), start=[1.0, 0.0])
    assert not len(curve.bifurcations)
    assert (curve.stable | curve.open).all()
    assert np.count_nonzero(curve.open) <= 3


@pytest.mark.slow
def test_limit_points_of_a_stop_ten_thousand_times_as_stiff():
    curve = so.frequency_response(stop(1e4, 1.0, 0.2, 0.6), (1.55, 1.6))
    for item in curve.bifurcations["LP"]:
        true = locate_by_shooting(item.orbit.system, "LP", item.orbit.start(), item.omega)
        assert abs(item.omega - true.omega) <= item.uncertainty + 1e-8


@pytest.mark.slow
def test_a_doubling_that_fewer_harmonics_have_far_away_is_seen_with_more():
    """The multiplier moves by .003 a step there, the harmonics left out move it by more; shooting: .796420646."""
    elements = [so.ElasticStop(0, 9762.25, -0.75255, side="left"), so.PolynomialSpring(0, coefficients={3: 0.863214})]
    system = so.System(1.927499, 0.263598, 1.028465, elements, [so.HarmonicLoad(0, 0.460884)])
    curve = so.frequency_response(system, (0.791, 0.801))
    (item,) = curve.bifurcations
    true = locate_by_shooting(system, "PD", item.orbit.start(), item.omega)
    assert item.kind == "PD"
    assert abs(item.omega - true.omega) <= item.uncertainty < 1e-3
