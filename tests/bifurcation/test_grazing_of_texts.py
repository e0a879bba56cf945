"""Corners of forces given as text are contacts: their grazings are found where those of an elastic stop are."""

from __future__ import annotations

import numpy as np

import suboctave as so
from suboctave.curves import refine
from suboctave.curves.events import layer
from suboctave.timedomain import shoot

PARAMETERS = {"Kc": 4.7, "j": 0.8, "p": 0.55}


def curve(element):
    loads = [so.HarmonicLoad(0, "p")]
    system = so.System(1.0, 0.06, 1.0, [so.CubicSpring(0, 0.16), element], loads, PARAMETERS)
    return so.frequency_response(system, (2.4, 0.9), harmonics=15)


def test_a_stop_as_text_and_a_stop_have_the_same_events():
    told, exact = curve(so.Expression(0, "Kc*max(x - j, 0)")), curve(so.ElasticStop(0, "Kc", "j"))
    events, others = (list(c.bifurcations) + c.bifurcations["grazing"] for c in (told, exact))
    assert [b.kind for b in events] == [b.kind for b in others]
    assert "grazing" in [b.kind for b in events]
    np.testing.assert_allclose([b.omega for b in events], [b.omega for b in others], rtol=1e-8)
    (mine,), (theirs,) = told.bifurcations["grazing"], exact.bifurcations["grazing"]
    assert mine.contact.change == theirs.contact.change
    assert mine.contact.gap == theirs.contact.gap
    assert "Expression" in mine.contact.label
    assert so.verify(mine).agrees


def test_a_coupled_contact_touches_where_its_own_displacement_reaches_the_corner():
    force = "3*max(x - y - 0.4, 0)*(1 + 0.2*x')"
    system = so.System.from_equations(
        [f"x'' + 0.05*x' + x + 0.1*y + {force} = 0.5*cos(omega*t)", f"y'' + 0.1*y' + 2*y + 0.1*x - {force} = 0"]
    )
    (element,) = system.elements
    np.testing.assert_array_equal(element.direction(2), [1.0, -1.0])
    grazings = so.frequency_response(system, (0.6, 0.7), harmonics=25).bifurcations["grazing"]
    assert [g.contact.change for g in grazings] == ["begins to touch"]
    (grazing,) = grazings
    x, v = grazing.orbit.displacement(grazing.contact.time), grazing.orbit.velocity(grazing.contact.time)
    np.testing.assert_allclose([x[0] - x[1], v[0] - v[1]], [0.4, 0.0], atol=1e-9)


def gear():
    """A gear pair whose meshing stiffness varies, with backlash (Kahraman, Singh, J. Sound Vib. 146, 1991)."""
    teeth = so.Expression(0, "(1 + eps*cos(omega*t))*(max(x - 1, 0) + min(x + 1, 0))")
    parameters = {"zeta": 0.05, "eps": 0.3, "T": 0.1268, "fa": 0.2}
    return so.System(1.0, "2*zeta", 0.0, [teeth], [so.HarmonicLoad(0, "fa", static="T")], parameters)


def test_a_period_doubling_at_the_grazing_of_a_text_is_found_from_the_grazing():
    """Back sides touch, and the multiplier beyond -1 returns in a sliver, as shooting on both sides of it shows."""
    curve = so.frequency_response(gear(), (0.6, 0.53))
    first, second = curve.bifurcations["PD"]
    (grazing,) = curve.grazings
    assert not any("unstable" in note for note in curve.warnings)
    assert first.smooth
    assert second.discontinuous
    assert abs(second.omega - grazing.omega) < 1e-7
    before, behind = (shoot(gear(), grazing.orbit.start(), second.omega + way).multipliers for way in (1e-6, -1e-6))
    assert before.real.min() < -1.002
    assert np.abs(behind).max() < 0.9


def test_a_bifurcation_that_more_harmonics_lead_away_from_keeps_its_place(monkeypatch):
    """From a few harmonics' period doubling at the grazing more lead to that far off, which is listed already."""
    for module in (refine, layer):
        monkeypatch.setattr(module, "behind_grazing", lambda kind, guess: None)
    # nor is it looked for between motions with more harmonics, where it is found
    monkeypatch.setattr(refine, "_between", lambda kind, curve, a, b: None)
    curve = so.frequency_response(gear(), (0.6, 0.53))
    doublings = [b.omega for b in curve.bifurcations["PD"]]
    np.testing.assert_allclose(doublings, [0.547233, 0.541815], atol=2e-6)
    assert any(
        "not found again with more (79: it leads to another one, at omega = 0.5472" in note for note in curve.warnings
    )


def test_a_fold_behind_the_grazing_of_a_text_is_laid_at_its_door():
    text, stop = (
        so.frequency_response(so.System(1.0, 0.1, 1.0, [element], [so.HarmonicLoad(0, 1.0)]), (1.3, 1.0), harmonics=9)
        for element in (so.Expression(0, "200*max(x - 5, 0)"), so.ElasticStop(0, 200.0, 5.0))
    )
    (mine,), (theirs,) = text.bifurcations["LP"], stop.bifurcations["LP"]
    assert not mine.smooth
    np.testing.assert_allclose([mine.omega, mine.contact.parameter], [theirs.omega, theirs.contact.parameter], 1e-9)
    np.testing.assert_allclose(
        [mine.uncertainty, mine.contact.distance], [theirs.uncertainty, theirs.contact.distance], 0.01
    )
