"""Other multipliers that become critical along a curve of bifurcations: LPNS, PDNS, NSNS; pairs inside one step."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import shoot

VAN_DER_POL = "mu*x**2*v"


def two(stiffness, damping, elements, loads, coupling=0.0, **parameters):
    """Two unit masses, coupled by a spring or not at all; a self-excited one has the damping -e + mu x^2."""
    return so.System(
        mass=[[1.0, 0.0], [0.0, 1.0]],
        damping=[[damping[0], 0.0], [0.0, damping[1]]],
        stiffness=[[stiffness[0] + coupling, -coupling], [-coupling, stiffness[1] + coupling]],
        elements=elements,
        loads=[so.HarmonicLoad(dof=dof, amplitude=amplitude) for dof, amplitude in loads.items()],
        parameters={"e": 0.05, "mu": 1.0, **parameters},
    )


def duffing_and_self_excited(coupling=0.0):
    elements = [so.CubicSpring(dof=0, coefficient=1.0), so.Expression(dof=1, expression=VAN_DER_POL)]
    return two((1.0, 2.89), (0.05, "-e"), elements, {0: "F", 1: "F"}, coupling, F=0.2)


def mathieu_and_self_excited(load="2.4*eps"):
    elements = [so.Expression(dof=0, expression="eps*cos(omega*t)*x"), so.Expression(dof=1, expression=VAN_DER_POL)]
    return two((1.0, 1.69), (0.05, "-e"), elements, {1: load}, eps=0.2)


def self_excited(stiffness, load):
    return so.System(
        mass=1.0,
        damping="-e",
        stiffness=stiffness,
        elements=[so.Expression(dof=0, expression=VAN_DER_POL)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"e": 0.05, "mu": 1.0, "F": load},
    )


def places(events, name):
    return np.array(sorted((e.omega, e.parameter(name)) for e in events))


def shot(event):
    """Multipliers by shooting, falling modulus."""
    orbit = event.orbit
    return shoot(orbit.system, orbit.start(), orbit.omega, orbit.basis.nu).multipliers


def torus_alone(stiffness, omega, load):
    """Distance of the self-excited oscillator alone from its nearest Neimark-Sacker point over omega."""
    found = so.frequency_response(
        self_excited(stiffness, load), (omega - 0.05, omega + 0.05), harmonics=5
    ).bifurcations["NS"]
    return min(abs(b.omega - omega) for b in found)


def test_fold_neimark_sacker_of_two_oscillators_that_do_not_know_each_other():
    """It is where the limit points of one, in closed form, have the load of the other's tori."""
    response = so.frequency_response(duffing_and_self_excited(), (0.9, 1.6), harmonics=1)
    tori = so.track(response.bifurcations["NS"][0], "F", (0.05, 0.5), omega=(0.5, 3.0))
    events = tori.bifurcations["LPNS"]
    assert len(events) == 2
    for event in events:
        omega = event.omega
        square = float(np.sum(event.orbit.coefficients[1:3, 0] ** 2))
        stiff = 1.0 - omega**2 + 0.75 * square
        assert stiff**2 + (0.05 * omega) ** 2 + 1.5 * square * stiff == pytest.approx(0.0, abs=1e-8)
        # one harmonic does, without the cubic damping's third
        alone = so.frequency_response(
            self_excited(2.89, event.parameter("F")), (omega - 0.05, omega + 0.05), harmonics=1
        ).bifurcations["NS"]
        assert min(abs(b.omega - omega) for b in alone) < 1e-8


def test_fold_neimark_sacker_from_both_curves_and_by_shooting():
    response = so.frequency_response(duffing_and_self_excited(0.02), (0.9, 1.6), harmonics=7)
    tori = so.track(response.bifurcations["NS"][0], "F", (0.05, 0.5), omega=(0.5, 2.0))
    assert tori.bifurcations["LPNS"]
    event = tori.bifurcations["LPNS"][0]
    mu = shot(event)
    assert np.abs(mu - 1.0).min() < 1e-4
    assert np.abs(mu - np.exp(1j * event.kappa * event.orbit.period)).min() < 1e-6
    limits = so.track(event, "F", (0.05, 0.5), omega=(0.5, 2.0))
    assert limits.kind == "LP"
    there = places(limits.bifurcations["LPNS"], "F")
    assert np.abs(there - [event.omega, event.parameter("F")]).max(1).min() < 1e-8
    back = so.track(limits.bifurcations["LPNS"][0], "F", (0.05, 0.5), omega=(0.5, 2.0))
    assert back.kind == "NS"
    assert any(e.kind == "LPNS" for e in back.bifurcations)


def test_flip_neimark_sacker_from_both_curves_and_by_shooting():
    response = so.frequency_response(mathieu_and_self_excited(), (1.7, 2.3), harmonics=5)
    tongue = so.track(response.bifurcations["PD"][0], "eps", (0.05, 0.6))
    tori = so.track(response.bifurcations["NS"][0], "eps", (0.05, 0.6))
    found = places(tongue.bifurcations["PDNS"], "eps")
    assert len(found) == 2
    assert found == pytest.approx(places(tori.bifurcations["PDNS"], "eps"), abs=1e-8)
    for event in (*tongue.bifurcations["PDNS"], *tori.bifurcations["PDNS"]):
        mu = shot(event)
        assert np.abs(mu + 1.0).min() < 1e-6
        assert np.abs(np.abs(mu[mu.imag > 0.0]) - 1.0).min() < 1e-7
        assert torus_alone(1.69, event.omega, 2.4 * event.parameter("eps")) < 1e-8
    other = so.track(tongue.bifurcations["PDNS"][0], "eps", (0.05, 0.6))
    assert other.kind == "NS"
    assert places(other.bifurcations["PDNS"], "eps") == pytest.approx(found, abs=1e-8)
    assert so.track(tori.bifurcations["PDNS"][0], "eps", (0.05, 0.6)).kind == "PD"


def test_a_pitchfork_takes_the_place_of_limit_points():
    """A symmetric Duffing oscillator's branch points; the equations of a limit point are singular along them."""
    elements = [so.CubicSpring(dof=0, coefficient=1.0), so.Expression(dof=1, expression=VAN_DER_POL)]
    system = two((1.0, 4.84), (0.1, "-e"), elements, {0: "F", 1: "0.152*F"}, F=6.0)
    response = so.frequency_response(system, (1.6, 1.2), harmonics=7)
    (event,) = so.track(response.bifurcations["NS"][0], "F", (4.0, 7.0)).bifurcations["LPNS"]
    assert np.abs(shot(event) - 1.0).min() < 1e-2
    curve = so.track(event, "F", (4.0, 7.0))
    assert curve.kind == "BP"
    expected = so.track(response.bifurcations["BP"][0], "F", (4.0, 7.0))
    assert curve.omega[[0, -1]] == pytest.approx(expected.omega[[0, -1]], abs=1e-8)


def test_double_neimark_sacker_and_a_curve_through_half_the_frequency():
    """With a half-wave symmetry two multipliers pass each other at -1: no 1:2 resonance, and no end."""
    elements = [so.Expression(dof=dof, expression=VAN_DER_POL) for dof in (0, 1)]
    system = two((0.3, 2.89), ("-e", "-e"), elements, {0: "F", 1: "F"}, F=0.25)
    response = so.frequency_response(system, (0.8, 1.6), harmonics=5)
    curves = [so.track(start, "F", (0.05, 0.6)) for start in response.bifurcations["NS"]]
    (one,), (other,) = (curve.bifurcations["NSNS"] for curve in curves)
    assert (one.omega, one.parameter("F")) == pytest.approx((other.omega, other.parameter("F")), abs=1e-8)
    assert np.abs(shot(one)) == pytest.approx(np.ones(4), abs=1e-6)
    for stiffness in (0.3, 2.89):
        assert torus_alone(stiffness, one.omega, one.parameter("F")) < 1e-8
    again = so.track(one, "F", (0.05, 0.6))
    assert places(again.bifurcations["R3"], "F") == pytest.approx(places(curves[1].bifurcations["R3"], "F"), abs=1e-8)
    for curve in curves:
        assert not curve.bifurcations["R2"]
        assert curve.parameter("F")[[0, -1]] == pytest.approx([0.05, 0.6])
        assert (curve.kappa / curve.omega).min() < 0.5 < (curve.kappa / curve.omega).max()


def test_a_neutral_saddle_is_no_torus():
    """Along limit points two real multipliers may pass the product one: counted, it would be a pair."""
    response = so.frequency_response(so.library.nltva(F=0.16), (0.9, 1.5), harmonics=7)
    curve = so.track(response.bifurcations["LP"][2], "F", (0.05, 0.2), omega=(1.0, 2.5))
    assert not curve.bifurcations["LPNS"]
    counts = [int((np.abs(p.floquet.multipliers) > 1.01).sum()) for p in curve.tracked]
    assert max(counts) == 1


@pytest.mark.parametrize("load", ["7.15*eps", "7.2*eps"])
def test_two_events_within_one_step(load):
    """The tori's curve just cuts the tip of the tongue: det J_half has the same sign at both ends of the step."""
    response = so.frequency_response(mathieu_and_self_excited(load), (1.7, 2.6), harmonics=3)
    start = response.bifurcations["NS"][0]
    expected = places(so.track(start, "eps", (0.05, 0.6), max_step=0.02).bifurcations["PDNS"], "eps")
    assert len(expected) == 2
    for max_step in (None, 0.5):
        tori = so.track(start, "eps", (0.05, 0.6), max_step=max_step)
        events = tori.bifurcations["PDNS"]
        assert places(events, "eps") == pytest.approx(expected, abs=1e-8)
        first, last = sorted(e.arclength for e in events)
        assert not any(first < p.arclength < last for p in tori.points)
        assert [e.arclength for e in tori.bifurcations] == sorted(e.arclength for e in tori.bifurcations)


def test_a_curve_that_misses_the_tip():
    response = so.frequency_response(mathieu_and_self_excited("7.4*eps"), (1.7, 2.6), harmonics=3)
    for max_step in (None, 0.5):
        tori = so.track(response.bifurcations["NS"][0], "eps", (0.05, 0.6), max_step=max_step)
        assert not tori.bifurcations["PDNS"]
        assert not tori.warnings


def test_coefficients_that_are_not_linear_in_the_parameter():
    """The same curve whether the gap is a parameter or its square root is."""
    found = []
    for gap, bounds in (("g", (0.01, 0.04)), ("r**2", (0.1, 0.2))):
        stop = so.ElasticStop(0, stiffness=4.0, gap=gap, side="right", regularization=300.0)
        loads, values = [so.HarmonicLoad(0, "p")], {"g": 0.0225, "r": 0.15, "p": 0.5}
        system = so.System(1.0, 0.06, 1.0, [stop], loads, {gap[0]: values[gap[0]], "p": values["p"]})
        item = so.frequency_response(system, (4.5, 1.3), harmonics=15).bifurcations["PD"][0]
        curve = so.track(item, gap[0], bounds)
        found.append(curve)
    for end in (0, -1):
        assert found[0].parameter("g")[end] == pytest.approx(found[1].parameter("r")[end] ** 2, rel=1e-12)
        assert found[0].omega[end] == pytest.approx(found[1].omega[end], rel=1e-9)
