"""The same structure in other units, and with its DOFs renumbered, has the same curves."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

#: units of length, mass and time
UNITS = (1e-3, 40.0, 0.02)


def structure(length=1.0, mass=1.0, time=1.0, turned=False):
    """Two masses in a row with a cubic spring to the ground and a rounded stop between them."""
    stiffness, damping, force = mass / time**2, mass / time, mass * length / time**2
    first, second = (1, 0) if turned else (0, 1)
    order = [first, second]
    k = stiffness * np.array([[1.6, -0.6], [-0.6, 0.6]])
    c = damping * np.array([[0.05, -0.03], [-0.03, 0.03]])
    return so.System(
        mass=mass * np.diag([1.0, 0.2])[np.ix_(order, order)],
        damping=c[np.ix_(order, order)],
        stiffness=k[np.ix_(order, order)],
        elements=[
            so.CubicSpring(dof=first, coefficient=0.8 * stiffness / length**2),
            so.ElasticStop(dof=(first, second), stiffness="Kc", gap="gap", side="right", regularization=30.0 / length),
        ],
        loads=[so.HarmonicLoad(dof=first, amplitude="F")],
        parameters={"Kc": 0.8 * stiffness, "gap": 0.3 * length, "F": 0.4 * force},
    )


def curves(system, scale, time):
    """The tracked curves of one bifurcation of every kind that the response has."""
    response = so.frequency_response(system, (2.2 / time, 0.6 / time))
    kinds = {b.kind: b for b in reversed(response.bifurcations.met)}
    return {kind: so.track(b, "F", (0.3 * scale, 0.6 * scale)) for kind, b in sorted(kinds.items())}


@pytest.mark.parametrize("turned", [pytest.param(False, marks=pytest.mark.slow), True])
def test_other_units(turned):
    length, mass, time = UNITS
    force = mass * length / time**2
    plain = curves(structure(), 1.0, 1.0)
    other = curves(structure(*UNITS, turned=turned), force, time)
    assert len(plain) >= 2
    assert plain.keys() == other.keys()
    for kind, a in plain.items():
        b = other[kind]
        assert len(a) == len(b), kind
        assert b.omega * time == pytest.approx(a.omega, rel=1e-7)
        assert b.parameter("F") / force == pytest.approx(a.parameter("F"), rel=1e-7)
        assert [e.remark() for e in a.bifurcations] == [e.remark() for e in b.bifurcations]
        assert [e.omega * time for e in b.bifurcations] == pytest.approx([e.omega for e in a.bifurcations], rel=1e-6)


def test_period_doublings_in_physical_units():
    """The oscillator in kg, m and s, and without units."""
    m, k, gap = 2.0, 5e5, 2e-3
    numbers = {
        "m": m,
        "c": 0.06 * np.sqrt(k * m),
        "k": k,
        "alpha": 0.16 * k / gap**2,
        "kc": 4.7 * k,
        "gap1": gap,
        "gap2": 0.05 * gap,
        "force": 0.55 * k * gap,
    }
    unit = np.sqrt(k / m)
    physical = so.library.reference_oscillator_physical(**numbers)
    plain = so.library.reference_oscillator(j=0.05)
    ranges = [(3.3 * unit, 3.0 * unit), (3.3, 3.0)]
    starts = [
        so.frequency_response(system, r).bifurcations["PD"][0]
        for system, r in zip((physical, plain), ranges, strict=True)
    ]
    a, b = so.track(starts[0], "gap2", (0.01 * gap, 0.3 * gap)), so.track(starts[1], "j", (0.01, 0.3))
    assert len(a) == len(b)
    assert a.omega / unit == pytest.approx(b.omega, rel=1e-8)
    assert a.parameter("gap2") / gap == pytest.approx(b.parameter("j"), rel=1e-8)
    assert [e.remark().split()[0] for e in a.extrema] == [e.remark().split()[0] for e in b.extrema]
