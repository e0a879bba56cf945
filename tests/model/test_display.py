"""A system in a notebook: what the schematic connects, and that nothing of a user is taken for markup."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

import suboctave as so
from suboctave.model.display import Schematic

STIFFNESS = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])


def three_masses(name=""):
    elements = [so.ElasticStop((0, 2), 1.0, 0.1), so.CubicSpring(0, "a"), so.TanhFriction(2, 0.1, 0.01)]
    loads = [so.HarmonicLoad(2, 0.1)]
    return so.System(np.eye(3), 0.1 * np.diag([1.0, 0.0, 0.0]), STIFFNESS, elements, loads, {"a": 1.0}, name)


def test_what_the_matrices_and_elements_connect():
    schematic = Schematic.of(three_masses())
    x = [mass[0] + 27.0 for mass in schematic.masses]

    def ends(connection):
        if connection.end[1] == schematic.ground:
            return (int(np.argmin(np.abs(np.array(x) - connection.start[0]))),)
        return tuple(int(np.argmin(np.abs(np.array(x) - place[0]))) for place in (connection.start, connection.end))

    drawn = sorted((c.name, c.glyph, ends(c)) for c in schematic.connections)
    assert drawn == [
        ("c", "damper", (0,)),
        ("e0", "stop", (0, 2)),
        ("e1", "spring", (0,)),
        ("e2", "friction", (2,)),
        ("k", "spring", (0,)),
        ("k", "spring", (0, 1)),
        ("k", "spring", (1, 2)),
    ]
    assert [(name, round(at)) for at, _, name in schematic.loads] == [("p0", round(schematic.masses[2][0]))]


def test_connections_of_the_same_masses_do_not_lie_on_each_other():
    system = so.System(
        np.eye(2), np.zeros((2, 2)), STIFFNESS[:2, :2], [so.CubicSpring((0, 1), 1.0), so.ElasticStop((1, 0), 1.0, 0.1)]
    )
    heights = [c.start[1] for c in Schematic.of(system).connections if c.start[1] == c.end[1]]
    assert len(heights) == len(set(heights)) == 3


def test_html_is_well_formed_and_escaped():
    text = three_masses("<b>&")._repr_html_()
    ElementTree.fromstring(text)
    assert "&lt;b&gt;&amp;" in text
    assert "<script" not in text


def test_large_structures_are_shown_without_matrices_or_schematic():
    text = so.structures.clearance_plate(nx=4, ny=3, stops=5)._repr_html_()
    assert "<svg" not in text
    assert "ElasticStop" in text
