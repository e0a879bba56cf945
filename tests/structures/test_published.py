"""Published structures against closed forms, and their places."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so
from suboctave.structures import beam, cantilever_beam, clearance_plate, clearance_plate_structure


def frequencies(system):
    mass, _, stiffness = system.matrices()
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))


def test_cantilever_has_the_frequencies_of_the_closed_form():
    roots = np.array([1.87510406871196, 4.69409113297417, 7.85475743823761])
    unit = np.sqrt(2.05e11 * 0.014**2 / 12.0 / 7800.0) / 0.7**2
    assert_allclose(frequencies(cantilever_beam())[:3], roots**2 * unit, rtol=2e-5)
    assert set(cantilever_beam().parameters) == {"knl", "F", "alpha", "beta"}


def test_cantilever_stiffens_as_its_normal_form_says():
    """Weakly nonlinear, one mode: the shift of the resonance is 3 knl phi^4 a^2 / (8 omega) at the modal amplitude a
    (Nayfeh & Mook, Nonlinear Oscillations, 1979, section 4.1), here seen as the phase at the linear resonance."""
    structure = beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 3)
    found = structure.natural_frequencies(1)
    omega, phi = found.omega[0], found.modes[structure.dof(3, "z"), 0]
    system = cantilever_beam(elements=3, F=0.02)
    curve = so.frequency_response(system, (0.98 * omega, 1.02 * omega), observe=structure.dof(3, "z"))
    tip = curve.amplitude.max()
    shift = 3.0 * system.parameters["knl"] * phi**2 * tip**2 / (8.0 * omega)
    peak = curve.omega[np.argmax(curve.amplitude)]
    assert shift > 0.002 * omega
    assert_allclose(peak - omega, shift, rtol=0.05)


@pytest.mark.parametrize(("stops", "places"), [(1, [0.3]), (2, [0.0, 0.6]), (5, [0.0, 0.15, 0.3, 0.45, 0.6])])
def test_clearance_plate(stops, places):
    pytest.importorskip("skfem")
    structure, system = clearance_plate_structure(), clearance_plate(stops=stops)
    assert system.n == structure.n == 1040
    mass, damping, stiffness = system.matrices()
    assert_allclose(damping, 0.02 * mass + 0.002 * stiffness, atol=1e-12 * np.abs(stiffness).max())
    assert_allclose(structure.natural_frequencies(1).omega, 1.0, rtol=1e-6)
    labels = [structure.dofs.labels[int(np.argmax(element.direction(system.n)))] for element in system.elements]
    at = np.array([structure.mesh.points[node] for node, _ in labels])
    assert_allclose(at[:, :2], [[1.0, y] for y in places], atol=1e-12)
    node, what = structure.dofs.labels[system.observed_dof]
    assert what == "z"
    assert_allclose(structure.mesh.points[node][:2], [0.6, 0.2], atol=1e-12)
    lift = np.array([1.0 if what == "z" else 0.0 for _, what in structure.dofs.labels])
    assert 0.9 < lift @ mass @ lift < 1.0  # all of the mass but what the clamped edge carries


def test_other_stops_are_refused():
    with pytest.raises(so.InputError, match="stops=3: one of 1, 2, 5"):
        clearance_plate(stops=3)
