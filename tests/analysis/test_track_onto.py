"""From points of codimension two onto the other curve, against curves found from responses, and shooting."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.timedomain import shoot

#: range of the load over which the absorber's curves are followed
LOADS = (0.05, 0.2)


def distance(curve, other):
    """Largest distance of a curve's points from another one's chords, in units of both ranges."""
    plane = [np.column_stack([c.omega, c.parameter("F")]) / [0.2, 0.15] for c in (curve, other)]
    worst = 0.0
    for point in plane[0]:
        a, b = plane[1][:-1], plane[1][1:]
        share = np.clip(((point - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0.0, 1.0)[:, None]
        worst = max(worst, float(np.linalg.norm(a + share * (b - a) - point, axis=1).min()))
    return worst


@pytest.fixture(scope="module")
def limits():
    """Limit points of the absorber's structure, through two 1:1 resonances."""
    response = so.frequency_response(so.library.nltva(F=0.16), (0.9, 1.5), harmonics=7)
    return so.track(response.bifurcations["LP"][2], "F", LOADS, omega=(1.0, 2.5))


@pytest.fixture(scope="module")
def tori():
    """Its Neimark-Sacker points, from another response."""
    response = so.frequency_response(so.library.nltva(F=0.11), (0.9, 1.5), harmonics=7)
    return so.track(response.bifurcations["NS"][0], "F", LOADS)


def test_the_tori_that_begin_in_a_one_to_one_resonance(limits, tori):
    event = min(limits.bifurcations["R1"], key=lambda e: e.omega)
    assert (event.omega, event.parameter("F")) == pytest.approx((1.29395, 0.14902), abs=1e-5)
    curve = so.track(event, "F", LOADS)
    assert curve.kind == "NS"
    # steps differ: chords of the two leave each other by what they leave the curve
    assert distance(curve, tori) < 4e-3
    assert distance(tori, curve) < 4e-3
    for name in ("omega", "F"):
        mine, theirs = (next(e for e in c.extrema if e.parameter_name == name) for c in (curve, tori))
        assert mine.orbit.coefficients == pytest.approx(theirs.orbit.coefficients, abs=1e-8)
        assert (mine.omega, mine.kappa) == pytest.approx((theirs.omega, theirs.kappa), abs=1e-8)
    assert "1:1 resonance" in curve.ended
    (end,) = curve.bifurcations["R1"]
    assert (end.omega, end.parameter("F")) == pytest.approx((event.omega, event.parameter("F")), abs=1e-8)
    assert np.all(np.sort(curve.kappa)[1:] > 0.0)


def test_every_point_beside_the_resonance_is_a_torus_and_no_neutral_saddle(limits):
    """On the other side of an R1 two real multipliers have the product one: nothing bifurcates there."""
    for event in limits.bifurcations["R1"]:
        curve = so.track(event, "F", LOADS, max_step=0.05)
        near = sorted(curve.tracked, key=lambda p: p.extra)[1:4]
        for point in near:
            orbit = point.orbit
            found = shoot(orbit.system, orbit.start(), orbit.omega)
            target = cmath.exp(1j * point.extra * orbit.period)
            assert np.abs(found.multipliers - target).min() < 5e-3
            assert found.multipliers[np.abs(found.multipliers - target).argmin()].imag != 0.0


def test_the_limit_points_through_the_end_of_the_tori(limits, tori):
    (end,) = tori.bifurcations["R1"]
    assert end.curve == "NS"
    curve = so.track(end, "F", LOADS, omega=(1.0, 2.5))
    assert curve.kind == "LP"
    assert distance(curve, limits) < 4e-3
    # the resonance in which it starts is met like any other
    kinds = [e.kind for e in limits.bifurcations]
    assert sorted(e.kind for e in curve.bifurcations) == sorted(kinds)
    places = [sorted((e.omega, e.parameter("F")) for e in c.bifurcations["R1"]) for c in (curve, limits)]
    assert np.array(places[0]) == pytest.approx(np.array(places[1]), abs=1e-7)
    again = so.track(end, "F", LOADS, onto="NS")
    assert again.kind == "NS"
    assert distance(again, tori) < 4e-3


def test_other_parameters_than_those_of_the_curve(limits):
    """An R1 is one in any two parameters: the damping of the absorber moves it."""
    event = min(limits.bifurcations["R1"], key=lambda e: e.omega)
    curve = so.track(event, "c2", (0.01, 0.015))
    assert curve.kind == "NS"
    (end,) = curve.bifurcations["R1"]
    assert (end.omega, end.parameter("c2")) == pytest.approx((event.omega, event.parameter("c2")), rel=1e-7)


def test_a_one_to_two_resonance_by_shooting():
    """One DOF: there trace M = -2 and det M = 1; the tori that begin there have det M = 1, |trace M| < 2.

    A neutral saddle has det M = 1 as well, with a larger trace. The damping of a self-excited oscillator of varying
    stiffness vanishes on average.
    """
    system = so.System(
        mass=1.0,
        damping="-e",
        stiffness=1.0,
        elements=[so.Expression(dof=0, expression="mu*x**2*v"), so.Expression(dof=0, expression="eps*cos(omega*t)*x")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"e": 0.05, "mu": 1.0, "eps": 0.4, "F": 1.1},
    )

    def monodromy(orbit):
        return shoot(orbit.system, orbit.start(), orbit.omega).monodromy

    doublings = so.track(so.frequency_response(system, (1.6, 2.6), harmonics=7).bifurcations["PD"][0], "F", (0.5, 2.0))
    (event,) = doublings.bifurcations["R2"]
    there = monodromy(event.orbit)
    assert (np.trace(there), np.linalg.det(there)) == pytest.approx((-2.0, 1.0), abs=1e-8)
    tori = so.track(event, "F", (0.5, 2.0))
    assert tori.kind == "NS"
    assert len(tori) > 5
    for point in tori.tracked:
        there = monodromy(point.orbit)
        assert np.linalg.det(there) == pytest.approx(1.0, abs=1e-8)
        assert np.trace(there) == pytest.approx(2.0 * math.cos(point.extra * point.orbit.period), abs=1e-8)
    (end,) = tori.bifurcations["R2"]
    assert end.critical_multiplier() == pytest.approx(-1.0, abs=1e-4)
    again = so.track(end, "F", (0.5, 2.0))
    assert again.kind == "PD"
    found, expected = (next(iter(c.bifurcations["GPD"])) for c in (again, doublings))
    assert (found.omega, found.parameter("F")) == pytest.approx((expected.omega, expected.parameter("F")), abs=1e-8)


def test_a_one_to_two_resonance_from_both_sides():
    """The tori of two masses with a stop end on period doublings; from there they are found again."""
    response = so.frequency_response(so.library.two_mass_unilateral(), (0.6, 0.65), harmonics=31)
    tori = so.track(response.bifurcations["NS"][0], "F", (0.1, 0.25))
    (end,) = tori.bifurcations["R2"]
    assert np.all(np.sort(tori.kappa / tori.omega)[:-1] < 0.5)
    doublings = so.track(end, "F", (0.1, 0.25))
    assert doublings.kind == "PD"
    met = min(doublings.bifurcations["R2"], key=lambda e: abs(e.omega - end.omega))
    assert (met.omega, met.parameter("F")) == pytest.approx((end.omega, end.parameter("F")), abs=1e-8)
    back = so.track(met, "F", (0.1, 0.25))
    assert back.kind == "NS"
    for order in (3, 4):
        pairs = [[(e.omega, e.parameter("F")) for e in c.bifurcations[f"R{order}"]] for c in (back, tori)]
        assert np.array(pairs[0]) == pytest.approx(np.array(pairs[1]), abs=1e-8)
    # as far as the kept harmonics tell, none of their points is a neutral saddle
    for curve in (tori, back):
        for point in sorted(curve.tracked, key=lambda p: p.extra / p.orbit.omega)[:-1]:
            target = cmath.exp(1j * point.extra * point.orbit.period)
            assert point.floquet.multipliers[np.abs(point.floquet.multipliers - target).argmin()].imag != 0.0


def test_fold_flips_lead_onto_the_other_curve():
    curve = so.frequency_response(so.library.two_mass_unilateral(), (0.6, 0.8), harmonics=15).bifurcations
    folds = so.track(curve["LP"][0], "F", (0.07, 0.12))
    (event,) = folds.bifurcations["LPPD"]
    flips = so.track(event, "F", (0.06, 0.12))
    assert flips.kind == "PD"
    expected = so.track(curve["PD"][1], "F", (0.06, 0.12))
    (a,), (b,) = flips.bifurcations["LPPD"], expected.bifurcations["LPPD"]
    assert (a.omega, a.parameter("F")) == pytest.approx((b.omega, b.parameter("F")), abs=1e-8)
    assert distance(flips, expected) < 4e-3
    assert so.track(a, "F", (0.07, 0.12)).kind == "LP"


def test_refusals(limits, tori):
    event = limits.bifurcations["R1"][0]
    with pytest.raises(InputError, match=r"the curves through a R1 are LP and NS"):
        so.track(event, "F", LOADS, onto="PD")
    with pytest.raises(InputError, match="this is a LP"):
        so.track(
            so.frequency_response(so.library.duffing(F=0.1), (0.7, 2.0), harmonics=3).bifurcations["LP"][0],
            "F",
            LOADS,
            onto="LP",
        )
    (cusp,) = limits.bifurcations["CP"]
    with pytest.raises(InputError, match="this is a CP"):
        so.track(cusp, "F", LOADS)
    # they lie below the load of the resonance
    low = min(limits.bifurcations["R1"], key=lambda e: e.omega)
    with pytest.raises(InputError, match="outside the ranges"):
        so.track(low, "F", (low.parameter("F"), 0.2))


def test_too_few_harmonics_for_a_resonance():
    """With 31 harmonics there is an R2 whose multipliers are far from -1: no tori begin in it, which is said."""
    response = so.frequency_response(so.library.two_mass_unilateral(), (0.6, 0.65), harmonics=31)
    end = so.track(response.bifurcations["NS"][0], "F", (0.1, 0.25)).bifurcations["R2"][0]
    spurious = min(so.track(end, "F", (0.1, 0.25)).bifurcations["R2"], key=lambda e: e.omega)
    assert abs(spurious.critical_multiplier() + 1.0) > 0.1
    with pytest.raises(ConvergenceError, match="no Neimark-Sacker points were found beside the R2"):
        so.track(spurious, "F", (0.1, 0.25))


def test_the_same_from_a_file(limits, tmp_path):
    limits.save(tmp_path / "limits.nc")
    event = min(so.load(tmp_path / "limits.nc").bifurcations["R1"], key=lambda e: e.omega)
    curve = so.track(event, "F", LOADS)
    expected = so.track(min(limits.bifurcations["R1"], key=lambda e: e.omega), "F", LOADS)
    np.testing.assert_array_equal(curve.omega, expected.omega)
    assert math.isclose(curve.kappa[0], expected.kappa[0])
