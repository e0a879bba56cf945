"""Beams and plates against closed forms, published values, and what scikit-fem assembles of the whole mesh."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so
from suboctave.structures import beam, from_skfem, join, plate

STEEL = {"young": 2.05e11, "density": 7800.0}
# Blevins, Formulas for Natural Frequency and Mode Shape, 1979, Table 8-1: roots of the characteristic equations
CLOSED_FORMS = {
    "clamped-free": (1.87510406871196, 4.69409113297417, 7.85475743823761),
    "clamped-clamped": (4.73004074486270, 7.85320462409584, 10.9956078380017),
    "pinned-pinned": (np.pi, 2.0 * np.pi, 3.0 * np.pi),
    "clamped-pinned": (3.92660231204792, 7.06858274562873, 10.2101761228130),
    "free-free": (4.73004074486270, 7.85320462409584, 10.9956078380017),
}


def roots(supports, elements):
    """`(omega^2 rho A L^4 / E I)^(1/4)` of the elastic modes."""
    length, width, height = 0.7, 0.02, 0.014
    found = beam(length, width, height, **STEEL, elements=elements, supports=supports).natural_frequencies(6)
    unit = np.sqrt(STEEL["young"] * height**2 / 12.0 / STEEL["density"]) / length**2
    return np.sqrt(found.omega[found.rigid :][:3] / unit)


@pytest.mark.parametrize("supports", CLOSED_FORMS)
def test_beam_frequencies_are_those_of_the_closed_form(supports):
    exact = np.array(CLOSED_FORMS[supports])
    coarse, fine = (np.abs(roots(supports, elements) / exact - 1.0) for elements in (12, 24))
    assert np.all(fine < 1e-4)
    assert_allclose(np.log2(coarse / fine), 4.0, atol=0.15)  # the order of convergence of Hermite cubics


def test_static_deflection_of_the_tip():
    """A tip force F gives F L^3 / (3 E I) and the slope -F L^2 / (2 E I) about y, exactly, with one element already."""
    one = beam(2.0, 0.1, 0.2, 3.0, 1.0, elements=1)
    deflection = np.linalg.solve(one.stiffness.toarray(), one.direction({(1, "z"): 1.0}))
    bending = 3.0 * 0.1 * 0.2**3 / 12.0
    assert_allclose(deflection, [2.0**3 / (3.0 * bending), -(2.0**2) / (2.0 * bending)], rtol=1e-12)


def test_free_structures_move_as_rigid_bodies():
    """Translation and rotation need no force, and have the inertia of the body."""
    free = beam(2.0, 0.1, 0.2, 3.0, 5.0, elements=4, supports="free-free")
    x = free.mesh.points[:, 0]
    lift = np.array([1.0 if what == "z" else 0.0 for _, what in free.dofs.labels])
    turn = np.array([-x[node] if what == "z" else 1.0 for node, what in free.dofs.labels])
    for motion, inertia in ((lift, 0.2), (turn, 0.2 * 2.0**2 / 3.0)):
        assert np.abs(free.stiffness @ motion).max() < 1e-13 * abs(free.stiffness).max()
        assert_allclose(motion @ free.mass @ motion, inertia, rtol=1e-13)
    assert free.natural_frequencies(4).rigid == 2


def test_free_plate_moves_as_a_rigid_body():
    pytest.importorskip("skfem")
    free = plate(2.0, 1.2, 0.01, 1.0, 0.3, 5.0, (10, 6), clamped=())
    mass = 2.0 * 1.2 * 0.01 * 5.0
    x, y, _ = free.mesh.points.T
    turns = {
        "lift": (lambda node: {"z": 1.0}, mass),
        "about x": (lambda node: {"z": y[node], "rx": 1.0}, mass * 1.2**2 / 3.0),
        "about y": (lambda node: {"z": -x[node], "ry": 1.0}, mass * 2.0**2 / 3.0),
    }
    for motion_at, inertia in turns.values():
        motion = np.array([motion_at(node).get(what, 0.0) for node, what in free.dofs.labels])
        assert np.abs(free.stiffness @ motion).max() < 1e-12 * abs(free.stiffness).max()
        assert_allclose(motion @ free.mass @ motion, inertia, rtol=1e-12)
    assert free.natural_frequencies(5).rigid == 3


def flexural(structure, count, poisson=0.3):
    """`omega a^2 sqrt(rho h / D)` of a unit square with unit modulus and density, 0.01 thick."""
    return structure.natural_frequencies(count).omega / np.sqrt(0.01**2 / 12.0 / (1.0 - poisson**2))


def test_plate_frequencies_are_those_published():
    """A. W. Leissa, The free vibration of rectangular plates, Journal of Sound and Vibration 31 (1973), a square with
    Poisson's ratio 0.3: cantilever (CFFF) and free (FFFF). Those are Ritz's upper bounds, up to 0.7 per cent high."""
    pytest.importorskip("skfem")
    published = {
        ("left",): (3.4917, 8.5246, 21.429, 27.331, 31.111, 54.443),
        (): (13.489, 19.789, 24.432, 35.024, 35.024),
    }
    for clamped, values in published.items():
        square = plate(1.0, 1.0, 0.01, 1.0, 0.3, 1.0, (12, 12), clamped)
        elastic = flexural(square, 8)[0 if clamped else 3 :][: len(values)]
        assert_allclose(elastic, values, rtol=0.01)
        assert np.all(elastic < np.array(values) * (1.0 + 1e-4))


def test_plate_frequencies_fall_as_the_mesh_is_refined():
    """All sides simply supported there is a closed form, pi^2 (i^2 + j^2); conforming elements lie above, order 4."""
    pytest.importorskip("skfem")
    errors = []
    for count in (4, 8):
        free = plate(1.0, 1.0, 0.01, 1.0, 0.3, 1.0, (count, count), clamped=())
        points = free.mesh.points
        edge = [
            (node, what)
            for node, (x, y, _) in enumerate(points)
            for what in ("z", *("rx",) * (x in (0.0, 1.0)), *("ry",) * (y in (0.0, 1.0)))
            if x in (0.0, 1.0) or y in (0.0, 1.0)
        ]
        exact = np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])
        errors.append(flexural(free.fixed(dict.fromkeys(edge)), 4) / exact - 1.0)
    assert np.all(errors[1] > 0.0)
    assert_allclose(np.log2(errors[0] / errors[1]), 4.0, atol=0.3)


def test_plate_is_what_scikit_fem_assembles_of_the_whole_mesh():
    skfem = pytest.importorskip("skfem")
    from skfem.helpers import dd, ddot, eye, trace

    mesh = skfem.MeshQuad.init_tensor(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 0.6, 4)).with_defaults()
    basis = skfem.Basis(mesh, skfem.ElementQuadBFS(), intorder=6)
    rigidity = 2.0 * 0.01**3 / 12.0 / (1.0 - 0.3**2)
    # moments D ((1 - nu) w + nu tr(w) 1) of the curvatures w
    bending = skfem.BilinearForm(
        lambda u, v, _: rigidity * ddot(0.7 * dd(u) + eye(0.3 * trace(dd(u)), 2), dd(v))
    ).assemble(basis)
    inertia = skfem.BilinearForm(lambda u, v, _: 5.0 * 0.01 * u * v).assemble(basis)
    theirs = from_skfem(bending, inertia, basis, basis.get_dofs("left"))
    ours = plate(1.0, 0.6, 0.01, 2.0, 0.3, 5.0, (4, 3))
    names = {"z": ("z", 1.0), "u_y": ("rx", 1.0), "u_x": ("ry", -1.0), "u_xy": ("zxy", 1.0)}
    order = [ours.dof(node, names[what][0]) for node, what in theirs.dofs.labels]
    sign = np.array([names[what][1] for _, what in theirs.dofs.labels])
    for what in ("mass", "stiffness"):
        mine = getattr(ours, what).toarray()[np.ix_(order, order)] * np.outer(sign, sign)
        assert_allclose(mine, getattr(theirs, what).toarray(), rtol=1e-9, atol=1e-12 * abs(mine).max())
    assert_allclose(theirs.mesh.points, ours.mesh.points, atol=1e-15)


def test_solids_of_scikit_fem_have_nodes_and_directions():
    """A bar in tension: u = F L / (E A) at the end, from linear hexahedra without contraction."""
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import linear_elasticity

    mesh = skfem.MeshHex.init_tensor(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 0.5, 3), np.linspace(0.0, 0.5, 2))
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0.0})
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex1()))
    stiffness = linear_elasticity(0.0, 1.5).assemble(basis)  # Lame's coefficients of E = 3, nu = 0
    mass = skfem.BilinearForm(lambda u, v, _: 5.0 * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])).assemble(basis)
    bar = from_skfem(stiffness, mass, basis, basis.get_dofs("left"), name="bar")
    assert bar.mesh.cells["hexahedron"].shape == (8, 8)
    end = np.flatnonzero(bar.mesh.points[:, 0] == 2.0)
    area = {node: (0.125 / 4 if bar.mesh.points[node, 1] in (0.0, 0.5) else 0.125 / 2) / 0.0625 * 0.25 for node in end}
    force = bar.direction({(int(node), "x"): share for node, share in area.items()})
    assert_allclose(force.sum(), 1.0)
    moved = np.linalg.solve(bar.stiffness.toarray(), force)
    assert_allclose(moved[bar.dof(int(end[0]), "x")], 1.0 * 2.0 / (3.0 * 0.25), rtol=1e-12)
    # corners in meshio's order: the bottom around, then the top; Gauss's theorem gives the volume of such a cell
    corners = bar.mesh.points[bar.mesh.cells["hexahedron"]]
    edges = np.stack([corners[:, i] - corners[:, 0] for i in (1, 3, 4)], axis=1)
    assert_allclose(np.linalg.det(edges), 2.0 * 0.25 / 8, rtol=1e-12)


def test_two_beams_joined_are_each_as_before():
    upper, lower = (beam(1.0, 0.02, h, **STEEL, elements=6, name=n) for h, n in ((0.01, "upper"), (0.02, "lower")))
    both = join(upper, lower, places=[[0.0, 0.0, 0.0], [0.5, 0.0, -0.1]])
    alone = np.sort(np.concatenate([upper.natural_frequencies(3).omega, lower.natural_frequencies(3).omega]))
    assert_allclose(both.natural_frequencies(4).omega, alone[:4], rtol=1e-8)
    assert both.dof("lower:6 z") == upper.n + lower.dof(6, "z")
    assert both.mesh.nearest(1.5, 0.0, -0.1) == "lower:6"
    damped = join(upper.with_damping(so.Rayleigh(1.0)), lower)
    assert_allclose(damped.damping.toarray()[: upper.n, : upper.n], upper.mass.toarray())
    assert np.all(damped.damping.toarray()[upper.n :] == 0.0)
    with pytest.raises(so.InputError, match="a name for each"):
        join(upper, upper)
    stop = so.ElasticStop(dof=(both.dof("upper:6", "z"), both.dof("lower:6", "z")), stiffness=1e4, gap=1e-3)
    assert both.system([stop]).n == both.n


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: beam(-1.0, 1.0, 1.0, 1.0, 1.0, 3), "length=-1.0: must be above 0"),
        (lambda: beam(1.0, 1.0, 1.0, 1.0, 1.0, 0), "elements=0"),
        (lambda: beam(1.0, 1.0, 1.0, 1.0, 1.0, 3, "clamped"), "supports are two of clamped, pinned, free"),
        (lambda: plate(1.0, 1.0, 1.0, 1.0, 0.6, 1.0, (2, 2)), "Poisson's ratio"),
        (lambda: plate(1.0, 1.0, 1.0, 1.0, 0.3, 1.0, 4), "two numbers"),
        (lambda: plate(1.0, 1.0, 1.0, 1.0, 0.3, 1.0, (2, 2), "lift"), "did you mean 'left'"),
        (lambda: join(beam(1.0, 1.0, 1.0, 1.0, 1.0, 1)), "two structures or more"),
    ],
)
def test_mistakes(call, text):
    with pytest.raises(so.InputError, match=text):
        call()


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "skfem", None)
    with pytest.raises(so.InputError, match=r"pip install suboctave\[fe\]"):
        plate(1.0, 0.6, 0.01, 1.0, 0.3, 1.0, (2, 2))


@pytest.mark.slow
def test_a_hundred_thousand_degrees_of_freedom():
    """The lowest frequency is that of the coarse mesh but for the order of convergence."""
    pytest.importorskip("skfem")
    from scipy.sparse.linalg import splu

    large, small = (plate(1.0, 0.6, 0.01, 1.0, 0.3, 1.0, elements) for elements in ((204, 122), (20, 12)))
    assert (large.n, small.n) == (100368, 1040)
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    solved = splu(large.stiffness.tocsc(), **options)
    shape = np.ones(large.n)
    for _ in range(30):  # inverse iteration
        shape = solved.solve(large.mass @ (shape / np.abs(shape).max()))
    square = shape @ (large.stiffness @ shape) / (shape @ (large.mass @ shape))
    assert_allclose(np.sqrt(square), small.natural_frequencies(1).omega[0], rtol=2e-4)
