"""Isolas of structures: unknowns along the stops alone find what all degrees of freedom find."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from chains import chain_matrices

import suboctave as so
from suboctave.curves import starts
from suboctave.curves.identity import gap_to
from suboctave.harmonic import HarmonicBalance, StructuralMatrices, reduction


def between_stops(system_of, tip, Kc, p):
    """A structure whose tip vibrates between two stops, at 1 to the left and at j to the right."""
    stops = [so.ElasticStop(tip, "Kc", "j", side="right"), so.ElasticStop(tip, "Kc", -1.0, side="left")]
    return system_of(stops, [so.HarmonicLoad(tip, "p")], {"Kc": Kc, "j": 0.2, "p": p})


def chain(n=10):
    mass, stiffness = chain_matrices(n)
    return between_stops(
        lambda *parts: so.System(mass, 0.02 * mass + 0.04 * stiffness, stiffness, *parts), n - 1, 4.7, 0.8
    )


def beam(elements=100):
    """As the chain, a cantilever of Hermite elements."""
    density = 1.0 / (0.25 * 0.02**2)
    young = density / so.structures.beam(1.0, 0.02, 0.02, 1.0, 1.0, elements).natural_frequencies(1).omega[0] ** 2
    structure = so.structures.beam(1.0, 0.02, 0.02, young, density, elements)
    damping = so.Rayleigh(alpha=0.02, beta=0.04)
    return between_stops(lambda *parts: structure.system(*parts, damping), structure.dof(elements, "z"), 2.0, 0.8)


@pytest.fixture(scope="module")
def of_chain():
    return so.find_isolas(chain(), (1.9, 3.0), "j", (0.16, 0.3), harmonics=15, values=2, levels=(), search=())


@pytest.mark.slow
def test_two_isolas_of_a_chain(of_chain):
    """One unknown for ten masses; the numbers are those with ten (below)."""
    assert of_chain[0].known[min(of_chain[0].known)].orbits[0].balance.size == 1
    births = sorted((float(isola.born), isola.born.omega) for isola in of_chain)
    np.testing.assert_allclose(births, [(0.247847191, 2.37135034), (0.248643538, 2.43187641)], rtol=3e-9)


def born_with(linear, isola, omega, x):
    """Where an isola is born, along the limit points of its closed branch solved with another linear part."""
    value = float(isola.born) - 0.1 * abs(float(isola.merges) - float(isola.born))
    orbit = isola.at(value).orbits[0]
    balance = HarmonicBalance(orbit.balance.system, orbit.basis, linear=linear, samples=orbit.balance.samples)
    loop = so.continue_branch(dataclasses.replace(orbit, balance=balance, x=x(orbit)), "omega", omega, max_step=0.3)
    assert loop.closed
    assert loop.orbits[0].balance.size == linear.size
    curve = so.track(loop.bifurcations["LP"][0], "j", (value - 0.01, float(isola.born) + 0.01))
    births = [e for e in curve.extrema if e.isola == "isola_centre"]
    assert curve.orbits[0].balance.size == linear.size
    return min(births, key=lambda e: abs(e.omega - isola.born.omega))


@pytest.mark.slow
def test_the_same_births_with_all_masses_unknown(of_chain, monkeypatch):
    isola = next(one for one in of_chain if float(one.born) < 0.248)
    system = of_chain.system
    monkeypatch.setattr(starts, "linear_part_of", lambda system, values=None, *_: StructuralMatrices(system, values))
    event = born_with(StructuralMatrices(system), isola, (2.2, 2.7), lambda orbit: orbit.coefficients)
    assert event.parameter("j") == pytest.approx(float(isola.born), rel=1e-9)
    assert event.omega == pytest.approx(isola.born.omega, rel=1e-9)


@pytest.mark.slow
def test_the_same_birth_with_all_modes_of_a_beam(monkeypatch):
    """Nine modes against two hundred."""
    (isola,) = so.find_isolas(beam(), (1.8, 2.6), "j", (0.2, 0.6), harmonics=15, values=2)
    monkeypatch.setattr(reduction, "COMPLETE", 200)
    linear = so.condense(beam(), 2.6)
    assert len(linear.equation_of_motion()[0]) == 200
    event = born_with(linear, isola, (1.9, 2.5), lambda orbit: orbit.x)
    # the beam of all modes in double is good to 1e-7
    assert event.parameter("j") == pytest.approx(float(isola.born), rel=1e-6)
    assert event.omega == pytest.approx(isola.born.omega, rel=1e-6)


def test_a_doubling_lies_on_its_curve_whatever_the_basis():
    """Motions in two bases of different size are compared in one unit."""
    system = beam(40)
    item = so.frequency_response(system, (1.8, 2.6)).bifurcations["PD"][0]
    wide = so.condense(system, 2.6, harmonics=150)
    other = so.frequency_response(system, (1.8, 2.6), linear=wide).bifurcations["PD"][0]
    curve = so.track(other, "j", (0.1, 0.3), max_step=0.3)
    modes = [len(orbit.balance.linear.equation_of_motion()[0]) for orbit in (item.orbit, curve.orbits[0])]
    assert modes[0] < modes[1]
    assert gap_to(item.orbit, curve.points, "j") is not None


def test_one_basis_serves_all_responses():
    """What a system at another gap, or a further curve, asks for has been made; nobody's basis changes under him."""
    system = beam(40)
    one, again, other = (
        so.condense(system.with_parameters(j=j), 2.6, harmonics=harmonics)
        for j, harmonics in ((0.2, 15), (0.4, 15), (0.2, 30))
    )
    assert again.reduction is one.reduction
    assert other.reduction is not one.reduction
    before = one.equation_of_motion()[0].copy()
    wider = one.covering(2.0 * one.covers)
    assert again.covering(1.9 * one.covers).reduction is wider.reduction
    np.testing.assert_array_equal(one.equation_of_motion()[0], before)
    assert one.rebuilt(system.parameters).reduction is one.reduction


def test_a_basis_grows_to_what_the_rule_of_harmonics_may_ask_for():
    """Events of stiff contacts may need all of its 127 harmonics, where 15 were expected."""
    system = beam(40)
    linear = so.condense(system, 2.6)
    wide = linear.covering(127.5 / 15.5 * linear.covers)
    top = 127.5 * 2.6
    np.testing.assert_allclose(
        1.0 / wide.stiffness(np.array([top]))[0, 0, 0],
        reduction.exact_flexibility(system, linear.reduction.directions, top, system.parameters)[0, 0],
        rtol=1e-8,
    )
