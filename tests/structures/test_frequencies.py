"""Natural frequencies of matrices as files have them: DOFs without mass or stiffness, and meshes as fine as may be."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose, assert_array_equal

import suboctave as so
from suboctave.model.modes import modes_of
from suboctave.structures import beam

#: three masses in a row that nothing holds: 0, 1, sqrt(3)
FREE = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
#: roots of cos x cosh x = -1, of a clamped beam, and +1, of one with free ends
CLAMPED, LOOSE = (1.875104068711961, 4.694091132974174), (4.730040744862704, 7.853204624095838)
STEEL = {"width": 0.1, "height": 0.01, "young": 2e11, "density": 7800.0}


def placed(matrix, n, where):
    """A matrix in a larger one of zeros."""
    whole = np.zeros((n, n))
    whole[np.ix_(where, where)] = matrix
    return whole


def chain(springs):
    """Stiffness of masses in a row with springs between them, nothing holds it."""
    n = len(springs) + 1
    stiffness = np.zeros((n, n))
    for i, k in enumerate(springs):
        stiffness[i : i + 2, i : i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return stiffness


@pytest.mark.parametrize("place", [0, 1, 3])
def test_a_dof_with_neither_mass_nor_stiffness_is_left_out(place):
    where = [i for i in range(4) if i != place]
    dofs = [(node, "x") for node in range(4)]
    found = so.Structure(placed(np.eye(3), 4, where), placed(FREE, 4, where), dofs=dofs).natural_frequencies()
    assert_allclose(found.omega, [0.0, 1.0, np.sqrt(3.0)], atol=1e-14)
    assert (found.rigid, found.left_out) == (1, (place,))
    assert f"left out, as they move with neither mass nor stiffness: {place} x" in str(found)
    assert_array_equal(found.modes[place], 0.0)


def test_so_are_motions_of_several_such_dofs():
    """Two, and three, massless DOFs that springs join to each other and to nothing else: one each may be held."""
    stiffness = scipy.linalg.block_diag(FREE, chain([2.0]), 7.0 * FREE)
    found = so.Structure(np.diag([1.0, 1, 1, 0, 0, 0, 0, 0]), stiffness).natural_frequencies()
    assert_allclose(found.omega, [0.0, 1.0, np.sqrt(3.0)], atol=1e-14)
    assert len(found.left_out) == 2
    assert found.left_out[0] in (3, 4)
    assert found.left_out[1] in (5, 6, 7)


def test_mass_without_stiffness_is_a_rigid_body():
    found = so.Structure(np.eye(4), placed(FREE, 4, [0, 2, 3])).natural_frequencies()
    assert_allclose(found.omega, [0.0, 0.0, 1.0, np.sqrt(3.0)], atol=1e-14)
    assert (found.rigid, found.left_out) == (2, ())


@pytest.mark.parametrize("unit", [1.0, 1e6, 1e-6])
def test_stiffness_without_mass_is_condensed(unit):
    """Springs over eight decades; the motions solve `K x = omega^2 M x` row by row."""
    stiffness = unit * chain(10.0 ** np.random.default_rng(0).uniform(-3.0, 5.0, 7))
    mass, rest = np.ones(8), [2, 5, 6]
    mass[rest] = 0.0
    own = np.setdiff1d(np.arange(8), rest)
    inner = stiffness[np.ix_(rest, rest)]
    condensed = stiffness[np.ix_(own, own)] - stiffness[np.ix_(own, rest)] @ np.linalg.solve(
        inner, stiffness[np.ix_(rest, own)]
    )
    found = so.Structure(np.diag(mass), stiffness).natural_frequencies()
    assert_allclose(found.omega[1:] ** 2, scipy.linalg.eigvalsh(condensed)[1:], rtol=1e-7)
    assert (found.rigid, found.omega[0]) == (1, 0.0)
    assert_allclose(stiffness @ found.modes, mass[:, None] * found.modes * found.omega**2, atol=1e-9 * stiffness.max())


def test_a_singular_mass_without_a_zero_on_its_diagonal():
    """Both DOFs move alike where there is inertia: springs 1 and 3 in a row."""
    found = so.Structure(np.ones((2, 2)), np.diag([1.0, 3.0])).natural_frequencies()
    assert_allclose(found.omega, [np.sqrt(3.0 / 4.0)], rtol=1e-13)


@pytest.mark.parametrize("elements", [100, 400])
def test_large_ones_leave_them_out_too(elements):
    structure = beam(1.0, **STEEL, elements=elements, supports="free-free")
    n, gone = structure.n + 3, [0, 51, structure.n + 2]
    into = scipy.sparse.csr_array(np.eye(n)[:, np.setdiff1d(np.arange(n), gone)])
    found = so.Structure(into @ structure.mass @ into.T, into @ structure.stiffness @ into.T).natural_frequencies(5)
    assert found.left_out == tuple(gone)
    assert found.rigid == 2
    assert_allclose(found.omega[2:], structure.natural_frequencies(5).omega[2:], rtol=1e-8)


# ---------------------------------------------------------------------------------------------- soft modes, rigid ones
@pytest.mark.parametrize("elements", [100, 300, 1000])
@pytest.mark.parametrize("young", [2e11, 2e5])
def test_the_lowest_modes_of_fine_meshes_are_no_rigid_bodies(elements, young):
    """Against the closed form; with free ends two are."""
    unit = np.sqrt(young * 0.01**2 / 12.0 / 7800.0)
    for supports, roots, rigid in (("clamped-free", CLAMPED, 0), ("free-free", LOOSE, 2)):
        found = beam(1.0, **{**STEEL, "young": young}, elements=elements, supports=supports).natural_frequencies(4)
        assert found.rigid == rigid
        assert_allclose(found.omega[rigid : rigid + 2], unit * np.square(roots), rtol=2e-5)


@pytest.mark.parametrize("elements", [100, 200, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("supports", ["clamped-free", "free-free"])
def test_each_mode_keeps_half_the_loss_factor(elements, supports):
    """A loss factor of 0.02 damps every mode by 0.01, and no rigid body."""
    structure = beam(1.0, **STEEL, elements=elements, supports=supports)
    system = structure.system(loads=[so.HarmonicLoad(0, 1.0)], structural=0.02)
    damping, found = system.viscous_equivalent().matrices()[1], structure.natural_frequencies(6)
    rates = np.einsum("ij,ij->j", found.modes, damping @ found.modes)
    assert_allclose(rates, 2.0 * 0.01 * found.omega, rtol=1e-5, atol=1e-6 * rates[-1])


@pytest.mark.parametrize("elements", [30, 200, 1000])
def test_the_linear_part_says_the_frequencies_of_the_structure(elements):
    """Projected, beyond 40 DOFs, and as it is; a soft mode is none of a rigid body, and the other way round."""
    for supports, rigid in (("clamped-free", 0), ("free-free", 2)):
        structure = beam(1.0, **STEEL, elements=elements, supports=supports)
        tip = structure.dof(elements, "z")
        system = structure.system([so.CubicSpring(tip, 1.0)], [so.HarmonicLoad(tip, 1.0)])
        omega = structure.natural_frequencies(4).omega
        found = so.condense(system, 1.1 * omega[-1]).frequencies[:4]
        assert_allclose(found, omega, rtol=2e-5)
        assert np.count_nonzero(found == 0.0) == rigid


@pytest.mark.parametrize("unit", [1.0, 1e6, 1e-6])
def test_springs_ten_decades_apart(unit):
    """The first three frequencies against the chain whose stiff springs are rods: masses 2, 3 and 1."""
    springs = unit * np.array([1e10, 1.0, 1e10, 1e10, 2.0])
    rods = scipy.linalg.eigh(unit * (chain([1.0, 2.0]) + np.diag([1.0, 0.0, 0.0])), np.diag([2.0, 3.0, 1.0]))[0]
    stiffness = chain(springs)
    stiffness[0, 0] += unit
    held = so.Structure(np.eye(6), stiffness).natural_frequencies()
    assert held.rigid == 0
    assert_allclose(held.omega[:3] ** 2, rods, rtol=2e-5)
    assert so.Structure(np.eye(6), chain(springs)).natural_frequencies().rigid == 1


def test_a_soft_support_beside_stiff_springs_is_damped():
    """Each of three masses by itself: C = eta sqrt(k m)."""
    stiffness = np.diag([1.0, 4e10, 9e10])
    system = so.System(
        np.eye(3), np.zeros((3, 3)), stiffness, [], [so.HarmonicLoad(0, 1.0)], structural=0.02 * stiffness
    )
    assert_allclose(system.viscous_equivalent().matrices()[1], np.diag([0.02, 4000.0, 6000.0]), rtol=1e-12)


def test_modes_are_modes_over_twelve_decades():
    """`Phi^T M Phi = 1` and `K phi = omega^2 M phi`, of a mesh whose squares lie 1e12 apart."""
    structure = beam(1.0, **STEEL, elements=250, supports="clamped-free")
    mass, stiffness = structure.mass.toarray(), structure.stiffness.toarray()
    squares, shapes, _ = modes_of(mass, stiffness)
    assert_allclose(shapes.T @ mass @ shapes, np.eye(len(mass)), atol=1e-9)
    unit = 2e11 * 0.01**2 / 12.0 / 7800.0
    assert_allclose(squares[:2], unit * np.power(CLAMPED, 4), rtol=1e-6)
