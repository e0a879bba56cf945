"""Shapes of structures: nodes are drawn where they move to, surfaces and outlines are those of the mesh, files open."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so
from suboctave.pictures.nodal import nodal_displacements, outline, surface
from suboctave.structures import beam, join

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)


@pytest.fixture
def cantilever():
    return beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 10)


def square_plate(clamped=True):
    """A square of 2 x 2 quads that moves in x and z, without any element behind it."""
    x, y = np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij")
    numbers = np.arange(9).reshape(3, 3)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], axis=-1).reshape(-1, 4)
    mesh = so.Mesh(np.stack([x.ravel(), y.ravel()], axis=1), {"quad": quads})
    labels = [(node, what) for node in range(9) for what in ("x", "z")]
    free = so.Structure(np.eye(18), np.eye(18), dofs=so.DofMap(labels), mesh=mesh)
    return free.fixed([(node, what) for node in range(3) for what in ("x", "z")]) if clamped else free


def test_displacements_of_nodes_are_those_of_the_labels(cantilever):
    slope = 0.1
    field = cantilever.direction({(node, "z"): slope * node for node in range(1, 11)})
    moved = nodal_displacements(cantilever, field)
    assert_allclose(moved, np.stack([np.zeros(11), np.zeros(11), slope * np.arange(11)], axis=1))
    several = nodal_displacements(cantilever, [field, -2.0 * field])
    assert_allclose(several, [moved, -2.0 * moved])


def test_the_surface_of_a_solid_is_its_outside():
    """Two cubes share a face that is not seen; the outline of the box has twelve edges, of which four are halved."""
    points = np.concatenate([CUBE, CUBE[[1, 2, 5, 6]] + [1.0, 0.0, 0.0]])
    second = [1, 8, 9, 2, 5, 10, 11, 6]
    (faces,) = surface({"hexahedron": np.array([range(8), second])})
    assert len(faces) == 10
    corners = points[faces]
    normals = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert_allclose(
        np.einsum("ij,ij->", normals, corners.mean(axis=1)) / 3.0, 2.0
    )  # Gauss: the volume, normals outwards
    assert len(outline(points, [faces])) == 16
    assert_allclose(np.linalg.norm(np.diff(points[outline(points, [faces])], axis=1), axis=-1), 1.0)


@pytest.mark.parametrize(
    ("kind", "corners", "count"),
    [("tetra", 4, 4), ("tetra10", 10, 4), ("wedge", 6, 5), ("pyramid", 5, 5), ("quad8", 8, 1), ("triangle6", 6, 1)],
)
def test_every_kind_of_cell_has_its_sides(kind, corners, count):
    assert sum(map(len, surface({kind: np.arange(corners)[None]}))) == count


def test_a_shape_is_drawn_where_its_nodes_are():
    structure = square_plate()
    field = structure.direction({(8, "z"): 2.0, (4, "x"): -0.5})
    figure = so.plot_shape(structure, field, scale=0.25, title="lifted")
    axes = figure.axes[0]
    (faces,) = [c for c in axes.collections if type(c).__name__ == "Poly3DCollection"]
    at = np.unique(np.round(np.concatenate(faces._faces), 12), axis=0)
    expected = structure.mesh.points + 0.25 * nodal_displacements(structure, field)
    assert_allclose(at, np.unique(np.round(expected, 12), axis=0))
    assert figure._suptitle.get_text() == "lifted"
    assert any("0.25" in text.get_text() for text in figure.texts)
    figure.canvas.draw()
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    seen = axes.transData.transform(np.stack(proj_transform(*at.T, axes.get_proj())[:2], axis=1))
    assert seen.min() >= 0.0  # all of it on the page
    assert np.all(seen <= [0.81 * figure.bbox.width, figure.bbox.height])


def test_the_largest_displacement_is_drawn_at_a_share_of_the_extent(cantilever):
    field = 1e-6 * cantilever.natural_frequencies(1).modes[:, 0]
    figure = so.plot_shape(cantilever, field)
    line = figure.axes[0].collections[-1]
    ends = np.array(line._segments3d).reshape(-1, 3)
    assert_allclose(np.abs(ends[:, 2]).max(), 0.15 * 0.7)


def test_signs_have_colours_where_all_moves_along_one_axis(cantilever):
    mode = cantilever.natural_frequencies(2).modes[:, 1]
    assert so.plot_shape(cantilever, mode).axes[-1].get_ylim()[0] < 0.0
    both = square_plate()
    field = both.direction({(8, "z"): -2.0, (4, "x"): 1.5})
    assert_allclose(so.plot_shape(both, field).axes[-1].get_ylim(), (0.0, 2.0))


def test_a_shape_is_saved_and_the_same_twice(cantilever, tmp_path):
    mode = cantilever.natural_frequencies(1).modes[:, 0]
    for name in ("a.png", "b.png"):
        so.plot_shape(cantilever, mode, tmp_path / name, size="single-column")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_motion_is_a_gif_that_lasts_as_long_as_it_should(cantilever, tmp_path):
    from PIL import Image

    two = join(cantilever, cantilever, names=["upper", "lower"], places=[[0.0, 0.0, 0.0], [0.0, 0.0, -0.1]])
    angles = 2.0 * np.pi * np.arange(7) / 7
    path = so.animate_shape(
        two, np.outer(np.cos(angles + 0.3), np.ones(two.n)), tmp_path / "new" / "two.gif", duration=1.0
    )
    with Image.open(path) as picture:
        assert picture.n_frames == 7
        assert picture.info["loop"] == 0
        lasts = 0
        for index in range(7):
            picture.seek(index)
            lasts += picture.info["duration"]
    assert lasts == 1000
    assert [item.name for item in path.parent.iterdir()] == ["two.gif"]


def test_fields_go_to_pyvista_and_vtu(cantilever, tmp_path):
    pytest.importorskip("pyvista")
    meshio = pytest.importorskip("meshio")
    modes = cantilever.natural_frequencies(2).modes
    fields = {"first": modes[:, 0], "second": modes[:, 1]}
    grid = so.to_pyvista(cantilever, fields)
    assert (grid.n_points, grid.n_cells) == (11, 10)
    path = so.write_vtu(cantilever, fields, tmp_path / "modes.vtu")
    read = meshio.read(path)
    for name, field in fields.items():
        assert_allclose(grid.point_data[name], nodal_displacements(cantilever, field))
        assert_allclose(read.point_data[name], nodal_displacements(cantilever, field))
    assert_allclose(read.points, cantilever.mesh.points)
    with pytest.raises(so.InputError, match="left as it is"):
        so.write_vtu(cantilever, fields, path)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda s, _: so.plot_shape(s, np.zeros(s.n + 1)), "a field has 20 values"),
        (lambda s, _: so.animate_shape(s, np.zeros((s.n, 3)), "a.gif"), "transposed"),
        (lambda s, _: so.plot_shape(s, np.full(s.n, 1.0j)), "real numbers"),
        (lambda s, _: so.plot_shape(s, np.full(s.n, np.nan)), "not finite"),
        (lambda s, _: so.plot_shape(so.Structure(s.mass, s.stiffness), np.zeros(s.n)), "no mesh"),
        (lambda s, _: so.animate_shape(s, np.zeros((3, s.n)), "a.mp4"), ".gif files"),
        (lambda s, path: so.plot_shape(s, np.zeros(s.n), path / "a.txt"), "suffix"),
        (lambda s, path: so.write_vtu(s, {"two": np.zeros((2, s.n))}, path / "a.vtu"), "'two' is an array"),
    ],
)
def test_mistakes(cantilever, call, text, tmp_path):
    if "two" in text:
        pytest.importorskip("meshio")
    with pytest.raises(so.InputError, match=text):
        call(cantilever, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("package", "call"), [("pyvista", "to_pyvista"), ("meshio", "write_vtu")])
def test_a_missing_package_is_named(cantilever, monkeypatch, tmp_path, package, call):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    given = (cantilever, {"one": np.zeros(cantilever.n)})
    with pytest.raises(so.InputError, match=r"pip install suboctave\[fe\]"):
        so.write_vtu(*given, tmp_path / "a.vtu") if call == "write_vtu" else so.to_pyvista(*given)


def test_motions_are_taken_as_they_are(tmp_path):
    """An orbit, or what has one: instants of its period, and the largest displacements."""
    structure = so.structures.beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 4)
    tip = structure.dof(4, "z")
    system = structure.system([so.CubicSpring(tip, 1e9)], [so.HarmonicLoad(tip, 0.3)], damping=so.Rayleigh(3.0, 0.0))
    branch = so.frequency_response(system, (100.0, 101.0), harmonics=3)
    orbit = branch.points[0].orbit
    instants = orbit.displacement(np.arange(48) / 48 * orbit.period).T
    largest = instants[np.linalg.norm(instants, axis=1).argmax()]
    for name, given in (("a", branch.points[0]), ("b", largest)):
        so.plot_shape(structure, given, tmp_path / f"{name}.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    for name, motion in (("a", orbit), ("b", instants)):
        so.animate_shape(structure, motion, tmp_path / f"{name}.gif")
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
