"""`system.natural_frequencies()`: frequencies, damping ratios and shapes of small vibrations against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so

#: two equal masses between three equal springs: 1 and sqrt(3)
MASSES, SPRINGS = np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]])


def test_two_masses_in_a_row():
    damping = {"beta": SPRINGS}
    system = so.System(
        MASSES, damping, {"k": SPRINGS}, parameters={"beta": 0.02, "k": 1.0}, dof_names=["left", "right"]
    )
    found = system.natural_frequencies()
    assert_allclose(found.omega, [1.0, np.sqrt(3.0)], rtol=1e-12)
    assert_allclose(found.hertz, found.omega / (2.0 * np.pi))
    assert_allclose(found.damping_ratio, 0.5 * 0.02 * found.omega, rtol=1e-12)
    assert_allclose(found.damped_omega, found.omega * np.sqrt(1.0 - found.damping_ratio**2))
    assert_allclose(np.abs(found.modes), np.sqrt(0.5), rtol=1e-12)
    assert_allclose(system.natural_frequencies(k=4.0).omega, 2.0 * found.omega)
    assert_allclose(system.natural_frequencies(parameters={"k": 4.0}).omega, 2.0 * found.omega)
    assert len(system.natural_frequencies(1)) == 1
    assert list(found.to_dataframe().columns) == ["omega", "hertz", "damping_ratio", "shape_left", "shape_right"]
    assert str(found).splitlines()[0].split()[-2:] == ["left", "right"]
    with pytest.raises(so.InputError, match="no parameter 'q'"):
        system.natural_frequencies(q=1.0)


def test_a_damper_that_couples_the_modes():
    """An absorber: frequencies and ratios are those of the roots of the characteristic polynomial."""
    mu, k, c = 0.05, 0.05, 0.02
    system = so.System(np.diag([1.0, mu]), [[c, -c], [-c, c]], [[1.0 + k, -k], [-k, k]])
    found = system.natural_frequencies()
    # det(lambda^2 M + lambda C + K)
    roots = np.roots(np.polysub(np.polymul([1.0, c, 1.0 + k], [mu, c, k]), np.polymul([c, k], [c, k])))
    roots = sorted(roots[roots.imag > 0.0], key=abs)
    assert_allclose(found.omega, np.abs(roots), rtol=1e-10)
    assert_allclose(found.damping_ratio, -np.real(roots) / np.abs(roots), rtol=1e-10)
    assert np.iscomplexobj(found.modes)


def test_a_gyroscopic_pair():
    """`x'' + g y' + x = 0`, `y'' - g x' + y = 0`: `omega = sqrt(1 + g^2 / 4) -+ g / 2`."""
    g = 0.5
    found = so.System(np.eye(2), [[0.0, g], [-g, 0.0]], np.eye(2)).natural_frequencies()
    assert_allclose(found.omega, np.sqrt(1.0 + g * g / 4.0) + np.array([-0.5, 0.5]) * g, rtol=1e-12)
    assert_allclose(found.damping_ratio, 0.0, atol=1e-12)


def test_a_critically_damped_mode_and_one_beyond():
    """Proportional damping: the frequency is that without damping, the ratio may be 1 and more."""
    found = so.System(np.eye(2), np.diag([2.0, 20.0]), np.diag([1.0, 4.0])).natural_frequencies()
    assert_allclose(found.omega, [1.0, 2.0])
    assert_allclose(found.damping_ratio, [1.0, 5.0])
    assert np.isnan(found.damped_omega).all()


def test_elements_have_their_slopes():
    """A pendulum hanging and upside down; `linear()` has no elements."""
    system = so.System.from_equations("x'' + 0.1*x' + w2*sin(x) = f*cos(omega*t)", parameters={"w2": 4.0, "f": 1.0})
    found = system.natural_frequencies()
    assert_allclose(found.omega, 2.0, rtol=1e-12)
    assert_allclose(found.damping_ratio, 0.1 / 4.0, rtol=1e-12)
    assert_allclose(system.natural_frequencies(about=[np.pi]).omega, -2.0, rtol=1e-12)
    alone = system.linear()
    assert not alone.elements
    assert dict(alone.parameters) == {"f": 1.0}
    assert alone.natural_frequencies().rigid == 1


def test_structural_damping_is_half_the_loss_factor():
    system = so.System(MASSES, 0.0 * MASSES, SPRINGS, structural={"eta": SPRINGS}, parameters={"eta": 0.04})
    assert_allclose(system.natural_frequencies().damping_ratio, 0.02, rtol=1e-12)


def test_units_are_those_of_the_system():
    system = so.System(1.0, 0.1, 4.0, units="mm, N, ms")
    assert str(system.natural_frequencies()).splitlines()[0].split()[1:3] == ["rad/ms", "kHz"]
    assert "rad per unit time" in str(so.System(1.0, 0.1, 4.0).natural_frequencies())


def test_a_structure_has_the_ratios_of_its_damping():
    beam = so.structures.beam(
        length=0.7, width=0.014, height=0.014, young=2.05e11, density=7800.0, elements=6, supports="clamped-free"
    )
    modal = beam.with_damping(so.ModalDamping([0.01, 0.02, 0.03])).natural_frequencies(3)
    assert_allclose(modal.damping_ratio, [0.01, 0.02, 0.03], rtol=1e-7)
    rayleigh = so.Rayleigh(alpha=3.0, beta=1e-5)
    one, other = (
        beam.with_damping(rayleigh).natural_frequencies(4),
        beam.system(damping=rayleigh).natural_frequencies(4),
    )
    assert_allclose(one.damping_ratio, 1.5 / one.omega + 0.5e-5 * one.omega, rtol=1e-7)
    assert_allclose(one.omega, other.omega)
    assert_allclose(one.damping_ratio, other.damping_ratio, rtol=1e-7)
    open_ = beam.with_damping(so.Rayleigh(alpha="a")).natural_frequencies(2)
    assert_allclose(open_.damping_ratio, 0.0)
    assert "which has parameters" in str(open_)


def test_a_contact_that_just_touches_is_said():
    system = so.System(1.0, 0.1, 4.0, elements=so.ElasticStop(dof=0, stiffness=5.0, gap=0.0))
    assert "just touches there" in str(system.natural_frequencies())
    with pytest.raises(so.InputError, match="about= must be 1 finite displacements"):
        system.natural_frequencies(about=[0.0, 1.0])
