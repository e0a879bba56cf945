"""The same structure in other units, or with its degrees of freedom numbered otherwise, has the same bifurcations."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

TOLERANCE = 1e-8


def oscillator(length=1.0, time=1.0, regularization=None, mass=1.0):
    """The reference oscillator with its units of length, time and mass divided by the given factors."""
    stiffness = mass / time**2
    s = None if regularization is None else regularization / length
    return so.System(
        mass=mass,
        damping=0.06 * mass / time,
        stiffness=stiffness,
        elements=[
            so.CubicSpring(dof=0, coefficient=0.16 * stiffness / length**2),
            so.ElasticStop(dof=0, stiffness=4.7 * stiffness, gap=0.0, side="right", regularization=s),
            so.ElasticStop(dof=0, stiffness=4.7 * stiffness, gap=-length, regularization=s),
        ],
        loads=[so.HarmonicLoad(dof=0, amplitude=0.55 * stiffness * length)],
    )


@pytest.fixture(scope="module", params=[None, 3000.0], ids=["exact", "arctan"])
def original(request):
    return request.param, so.frequency_response(oscillator(regularization=request.param), (4.5, 1.3))


#: one unit at a time
ALONE = [(1e-6, 1.0, 1.0), (1e3, 1.0, 1.0), (1.0, 1e-3, 1.0), (1.0, 1e3, 1.0), (1.0, 1.0, 1e-9)]


@pytest.mark.parametrize(
    ("length", "time", "mass"),
    [(1e-6, 1e-3, 1e5), *(pytest.param(*one, marks=pytest.mark.slow) for one in ALONE)],
)
def test_units(original, length, time, mass):
    regularization, first = original
    system = oscillator(length, time, regularization, mass)
    other = so.frequency_response(system, (4.5 / time, 1.3 / time))
    assert len(other) == len(first)
    assert [b.kind for b in other.bifurcations] == [b.kind for b in first.bifurcations]
    omega = np.array([[a.omega, b.omega * time] for a, b in zip(first.bifurcations, other.bifurcations, strict=True)])
    size = [[a.amplitude, b.amplitude / length] for a, b in zip(first.bifurcations, other.bifurcations, strict=True)]
    assert omega[:, 1] == pytest.approx(omega[:, 0], rel=TOLERANCE)
    assert np.array(size)[:, 1] == pytest.approx(np.array(size)[:, 0], rel=TOLERANCE)
    assert other.multipliers == pytest.approx(first.multipliers, abs=1e-6)
    # eps has the unit length * sqrt(mass), omega that of 1 / time
    for a, b in zip(first.bifurcations, other.bifurcations, strict=True):
        assert b.criticality == a.criticality
        if a.normal_form is not None:
            curvature = b.normal_form["curvature"] * time * length**2 * mass
            assert curvature == pytest.approx(a.normal_form["curvature"], rel=1e-4)


def two_masses(order):
    """The textbook pair with a stop, its DOFs in the order told."""
    place = {dof: at for at, dof in enumerate(order)}
    stiffness = np.array([[1.0, -1.0], [-1.0, 2.0]])[np.ix_(order, order)]
    return so.System(
        np.diag(np.array([1.0, 0.4])[list(order)]),
        0.03 * stiffness,
        stiffness,
        [
            so.ElasticStop(dof=place[0], stiffness=10.0, gap=0.5),
            so.CubicSpring(dof=(place[0], place[1]), coefficient=0.2),
        ],
        [so.HarmonicLoad(dof=place[1], amplitude=0.1)],
    )


def test_degrees_of_freedom_exchanged():
    first = so.frequency_response(two_masses((0, 1)), (0.5, 1.2))
    other = so.frequency_response(two_masses((1, 0)), (0.5, 1.2))
    assert len(first.bifurcations) >= 2
    assert [b.kind for b in other.bifurcations] == [b.kind for b in first.bifurcations]
    for a, b in zip(first.bifurcations, other.bifurcations, strict=True):
        assert b.omega == pytest.approx(a.omega, rel=TOLERANCE)
        assert b.amplitude == pytest.approx(a.amplitude, rel=TOLERANCE)
        assert b.orbit.coefficients[:, ::-1] == pytest.approx(a.orbit.coefficients, abs=TOLERANCE)
        assert b.criticality == a.criticality


def test_absorber_exchanged_and_in_other_units():
    """Two DOFs in units of their own: the absorber's displacement in thousandths (a congruence x = S y)."""
    first = so.frequency_response(so.library.nltva(0.11), (0.9, 1.4))
    mass, damping, stiffness = so.library.nltva(0.11).matrices()
    s = np.diag([1.0, 1e-3])
    other = so.frequency_response(
        so.System(
            s @ mass @ s,
            s @ damping @ s,
            s @ stiffness @ s,
            [so.CubicSpring(0, 1.0), so.CubicSpring(direction=[1.0, -1e-3], coefficient=0.0042)],
            [so.HarmonicLoad(0, 0.11)],
        ),
        (0.9, 1.4),
    )
    assert [b.kind for b in other.bifurcations] == [b.kind for b in first.bifurcations] == ["NS", "NS", "LP", "LP"]
    for a, b in zip(first.bifurcations, other.bifurcations, strict=True):
        assert b.omega == pytest.approx(a.omega, rel=TOLERANCE)
        assert b.orbit.coefficients @ s == pytest.approx(a.orbit.coefficients, abs=TOLERANCE)
