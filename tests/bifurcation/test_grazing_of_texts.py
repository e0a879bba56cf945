"""Corners of forces given as text are contacts: their grazings are found where those of an elastic stop are."""

from __future__ import annotations

import numpy as np

import suboctave as so

PARAMETERS = {"Kc": 4.7, "j": 0.8, "p": 0.55}


def curve(element):
    loads = [so.HarmonicLoad(0, "p")]
    system = so.System(1.0, 0.06, 1.0, [so.CubicSpring(0, 0.16), element], loads, PARAMETERS)
    return so.frequency_response(system, (2.4, 0.9), 15)


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
    grazings = so.frequency_response(system, (0.6, 0.7), 25).bifurcations["grazing"]
    assert [g.contact.change for g in grazings] == ["begins to touch"]
    (grazing,) = grazings
    x, v = grazing.orbit.displacement(grazing.contact.time), grazing.orbit.velocity(grazing.contact.time)
    np.testing.assert_allclose([x[0] - x[1], v[0] - v[1]], [0.4, 0.0], atol=1e-9)
