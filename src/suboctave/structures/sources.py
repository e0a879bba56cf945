"""Structures that need no other program: beams, plates, several structures in one, and what scikit-fem assembles.

Axes are right-handed: z is the deflection, `rx = dz/dy` and `ry = -dz/dx` are the rotations about x and y; the twist
`zxy = d2z/dxdy`, in 1 / length, is no direction in space.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, check_numbers, shortened, suggest
from suboctave.model.elements.base import Array
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.updated import block_diagonal
from suboctave.structures.damping import ModalDamping, Rayleigh
from suboctave.structures.dof_map import DofMap, Label
from suboctave.structures.mesh import Mesh
from suboctave.structures.structure import Structure

#: what a support holds of the end of a beam
SUPPORTS: dict[str, tuple[str, ...]] = {"clamped": ("z", "ry"), "pinned": ("z",), "free": ()}
EDGES = ("left", "right", "bottom", "top")
_PLATE = ("z", "rx", "ry", "zxy")
#: directions that names of scikit-fem's degrees of freedom stand for; other names are kept
_DIRECTIONS = {"u": "z", "u^1": "x", "u^2": "y", "u^3": "z"}
#: meshio's names of scikit-fem's cells, and the order of their corners
_CELLS: dict[str, tuple[str, Any]] = {
    "RefLine": ("line", slice(None)),
    "RefTri": ("triangle", slice(None)),
    "RefQuad": ("quad", slice(None)),
    "RefTet": ("tetra", slice(None)),
    "RefHex": ("hexahedron", [0, 3, 6, 2, 1, 5, 7, 4]),
}


# ----------------------------------------------------------------------------------------------------------------- beam
def beam(
    length: float,
    width: float,
    height: float,
    young: float,
    density: float,
    elements: int,
    supports: str = "clamped-free",
    name: str = "beam",
) -> Structure:
    """An Euler-Bernoulli beam along x that bends in z: Hermite cubics, consistent mass.

    Nodes 0 to `elements` at equal distances from x = 0 to `length`, directions z and ry. `height`: of the cross-section
    along z; `width`: along y; `density`: mass per volume. `supports`: of the two ends, each "clamped", "pinned" or
    "free", with a hyphen between. The error of a natural frequency falls as `elements**-4`.

    Source of the element: J. S. Przemieniecki, Theory of Matrix Structural Analysis, McGraw-Hill 1968, chapters 5
    and 11, without shear and rotary inertia. Raises `InputError` for lengths that are not positive, unknown supports.
    """
    _check_positive(length=length, width=width, height=height, young=young, density=density)
    _check_count("elements", elements)
    ends = supports.split("-") if isinstance(supports, str) else []
    if len(ends) != 2 or not set(ends) <= set(SUPPORTS):
        known = ", ".join(SUPPORTS)
        raise InputError(f"supports are two of {known} with a hyphen between, not {shortened(supports)}", ("supports",))
    first = np.arange(elements)
    nodes = np.stack([first, first + 1], axis=1)
    bending, line_density = young * width * height**3 / 12.0, density * width * height
    mass, stiffness = (
        _assembled(matrix, nodes, 2) for matrix in _beam_element(length / elements, bending, line_density)
    )
    labels = [(node, direction) for node in range(elements + 1) for direction in ("z", "ry")]
    held = [(node, what) for node, end in zip((0, elements), ends, strict=True) for what in SUPPORTS[end]]
    mesh = Mesh(np.linspace(0.0, length, elements + 1)[:, None], {"line": nodes})
    structure = Structure(mass, stiffness, None, DofMap(labels), mesh, name)
    return structure.fixed(held) if held else structure


def _beam_element(length: float, bending: float, line_density: float) -> tuple[Array, Array]:
    """Mass and stiffness (4, 4) of one element, by z and ry of its two ends."""
    l = length
    stiffness = np.array([
        [12.0, -6.0 * l, -12.0, -6.0 * l],
        [-6.0 * l, 4.0 * l**2, 6.0 * l, 2.0 * l**2],
        [-12.0, 6.0 * l, 12.0, 6.0 * l],
        [-6.0 * l, 2.0 * l**2, 6.0 * l, 4.0 * l**2],
    ])  # fmt: skip
    mass = np.array([
        [156.0, -22.0 * l, 54.0, 13.0 * l],
        [-22.0 * l, 4.0 * l**2, -13.0 * l, -3.0 * l**2],
        [54.0, -13.0 * l, 156.0, 22.0 * l],
        [13.0 * l, -3.0 * l**2, 22.0 * l, 4.0 * l**2],
    ])  # fmt: skip
    return line_density * l / 420.0 * mass, bending / l**3 * stiffness


# ---------------------------------------------------------------------------------------------------------------- plate
def plate(
    length: float,
    width: float,
    thickness: float,
    young: float,
    poisson: float,
    density: float,
    elements: tuple[int, int],
    clamped: Sequence[str] = ("left",),
    name: str = "plate",
) -> Structure:
    """A thin (Kirchhoff) rectangular plate in the plane of x and y: Bogner-Fox-Schmit elements, consistent mass.

    `elements`: along x (`length`) and y (`width`), all alike. Nodes are numbered from the corner x = y = 0, along y
    first; directions z, rx, ry and zxy. `clamped`: edges, of "left" (x = 0), "right", "bottom" (y = 0) and "top"; the
    others are free. `(20, 12)` are 1040 degrees of freedom with the left edge clamped, `(204, 122)` are 100 368.

    The matrices of one element are those of scikit-fem's `ElementQuadBFS` on the unit square, scaled to its size: on
    small elements in a large plate the element of that size itself would lose half the digits. Source: F. K. Bogner,
    R. L. Fox, L. A. Schmit, Matrix Methods in Structural Mechanics (AFFDL-TR-66-80), 1966. Raises `InputError` for
    lengths that are not positive, unknown edges, and where scikit-fem is not installed.
    """
    _check_positive(length=length, width=width, thickness=thickness, young=young, density=density)
    check_numbers(poisson=poisson)
    if not -1.0 < poisson <= 0.5:
        raise InputError(f"poisson={poisson}: Poisson's ratio lies between -1 and 0.5", ("poisson",))
    if isinstance(elements, str) or not isinstance(elements, Sequence) or len(elements) != 2:
        raise InputError(f"elements are two numbers, along x and y, not {shortened(elements)}", ("elements",))
    for count in elements:
        _check_count("elements", count)
    clamped = [clamped] if isinstance(clamped, str) or not isinstance(clamped, Sequence) else clamped
    for edge in clamped:
        if edge not in EDGES:
            raise InputError(f"there is no edge {shortened(edge)}{suggest(str(edge), EDGES)}", ("clamped",))
    nx, ny = elements
    numbers = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    corners = np.stack([numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]], axis=-1).reshape(-1, 4)
    bending = young * thickness**3 / (12.0 * (1.0 - poisson**2))
    one = _plate_element(length / nx, width / ny, bending, poisson, density * thickness)
    mass, stiffness = (_assembled(matrix, corners, 4) for matrix in one)
    edges = {"left": numbers[0], "right": numbers[-1], "bottom": numbers[:, 0], "top": numbers[:, -1]}
    held = [4 * edges[edge][:, None] + np.arange(4) for edge in clamped]
    x, y = np.meshgrid(np.linspace(0.0, length, nx + 1), np.linspace(0.0, width, ny + 1), indexing="ij")
    mesh = Mesh(np.stack([x.ravel(), y.ravel()], axis=1), {"quad": corners[:, [0, 2, 3, 1]]})
    labels = [(node, direction) for node in range(numbers.size) for direction in _PLATE]
    structure = Structure(mass, stiffness, None, DofMap(labels), mesh, name)
    return structure.fixed(np.unique(np.concatenate(held, axis=None)).tolist()) if held else structure


def _plate_element(dx: float, dy: float, bending: float, poisson: float, density: float) -> tuple[Array, Array]:
    """Mass and stiffness (16, 16) of an element dx by dy, by z, rx, ry, zxy of (0, 0), (0, 1), (1, 0), (1, 1).

    `density` per area, `bending` the flexural rigidity: energy `D/2 int z_xx^2 + z_yy^2 + 2 nu z_xx z_yy
    + 2 (1 - nu) z_xy^2`.
    """
    skfem = _scikit_fem()
    from skfem.helpers import dd

    square = skfem.Basis(skfem.MeshQuad.init_tensor(np.arange(2.0), np.arange(2.0)), skfem.ElementQuadBFS(), intorder=6)
    # the DOFs of the unit square, z, z_xi, z_eta, z_xi_eta, by those of the plate: z_xi = dx z_x = -dx ry
    scales = np.array([[1, 0, 0, 0], [0, 0, -dx, 0], [0, dy, 0, 0], [0, 0, 0, dx * dy]])
    change = np.kron(np.eye(4), scales)

    @skfem.BilinearForm
    def curvatures(u: Any, v: Any, _: Any) -> Any:
        (uxx, uxy), (_, uyy) = dd(u)
        (vxx, vxy), (_, vyy) = dd(v)
        across = poisson * (uxx * vyy + uyy * vxx) + 2.0 * (1.0 - poisson) * uxy * vxy
        return uxx * vxx / dx**4 + uyy * vyy / dy**4 + across / (dx * dy) ** 2

    @skfem.BilinearForm
    def product(u: Any, v: Any, _: Any) -> Any:
        return u * v

    forms = (density, product), (bending, curvatures)
    mass, stiffness = (factor * dx * dy * change.T @ form.assemble(square).toarray() @ change for factor, form in forms)
    return mass, stiffness


# ----------------------------------------------------------------------------------------------- several, and others
def join(*structures: Structure, names: Sequence[str] = (), places: ArrayLike | None = None) -> Structure:
    """Several structures as one that nothing connects: elements between them do, such as a stop between two beams.

    Node 20 of the structure "upper" is "upper:20" then. `names`: for the structures; their own where none are given.
    `places`: where each stands, (count, 3), added to the points of its mesh. Damping of one kind stays as it is; where
    the kinds differ, matrices are made. Raises `InputError` for names that are missing or not different, and for
    structures without labels.
    """
    from scipy.sparse import block_diag

    if len(structures) < 2 or not all(isinstance(one, Structure) for one in structures):
        raise InputError("join takes two structures or more")
    called = [str(name) for name in (names or [one.name for one in structures])]
    if len(called) != len(structures) or len(set(called)) < len(called) or not all(called):
        raise InputError(f"join needs a name for each of {len(structures)} structures, not {called}", ("names",))
    labels: list[Label] = []
    for name, one in zip(called, structures, strict=True):
        if one.dofs is None:
            raise InputError(f"the structure {name!r} has no labels: give it dofs=")
        labels += [(f"{name}:{node}", direction) for node, direction in one.dofs.labels]
    mass, stiffness = (block_diag([getattr(one, what) for one in structures]) for what in ("mass", "stiffness"))
    mesh = _joined_mesh(structures, called, places)
    damping, structural = _joined_damping(structures), _joined_losses(structures)
    return Structure(mass, stiffness, damping, DofMap(labels), mesh, " and ".join(called), structural)


def _joined_damping(structures: Sequence[Structure]) -> Any:
    first = structures[0].damping
    if (first is None or isinstance(first, Rayleigh)) and all(one.damping == first for one in structures[1:]):
        return first
    blocks = []
    for one in structures:
        damping = one.damping
        if isinstance(damping, Rayleigh | ModalDamping):
            damping = damping.matrix(one.mass, one.stiffness)
            if isinstance(damping, Mapping):
                raise InputError(f"the damping of {one.name!r} has parameters: give damping to the joined structure")
        blocks.append(0.0 * one.mass if damping is None else damping)
    return block_diagonal(blocks)


def _joined_losses(structures: Sequence[Structure]) -> Any:
    from scipy.sparse import block_diag

    first = structures[0].structural
    if (first is None or isinstance(first, Coefficient)) and all(one.structural == first for one in structures[1:]):
        return None if first is None else first.text
    blocks = [one.losses() for one in structures]
    if any(isinstance(block, Mapping) for block in blocks):
        raise InputError("a loss factor has parameters: give structural= to the system of the joined structure")
    return block_diag([0.0 * one.mass if own is None else own for one, own in zip(structures, blocks, strict=True)])


def _joined_mesh(structures: Sequence[Structure], names: Sequence[str], places: ArrayLike | None) -> Mesh | None:
    meshes = [one.mesh for one in structures]
    if any(mesh is None for mesh in meshes):
        return None
    shifts = np.zeros((len(meshes), 3)) if places is None else np.asarray(places, dtype=float)
    if shifts.shape != (len(meshes), 3):
        raise InputError(f"places are an array of the shape ({len(meshes)}, 3), not {shifts.shape}", ("places",))
    points, nodes, cells, start = [], [], dict[str, list[np.ndarray]](), 0
    for mesh, name, shift in zip(meshes, names, shifts, strict=True):
        if mesh is not None:
            points.append(mesh.points + shift)
            nodes += [f"{name}:{node}" for node in mesh.nodes]
            for kind, rows in mesh.cells.items():
                cells.setdefault(kind, []).append(rows + start)
            start += len(mesh.points)
    return Mesh(np.concatenate(points), {kind: np.concatenate(rows) for kind, rows in cells.items()}, nodes)


def from_skfem(
    stiffness: Any,
    mass: Any,
    basis: Any,
    fixed: Any = (),
    damping: Any = None,
    directions: Mapping[str, str] | None = None,
    name: str = "",
) -> Structure:
    """What scikit-fem has assembled, with labels and mesh.

    `basis`: a `skfem.Basis` (n degrees of freedom) of the two matrices. `fixed`: numbers of degrees of freedom, or what
    `basis.get_dofs("left")` gives. `damping`: as of `Structure`. Nodes are the vertices of the mesh, from 0; degrees of
    freedom on edges, facets and inside elements have nodes such as "facet 12". `directions`: what names of the
    element's degrees of freedom stand for, other than `{"u": "z", "u^1": "x", "u^2": "y", "u^3": "z"}`; names that are
    in neither are kept ("u_x").
    """
    called = {**_DIRECTIONS, **(directions or {})}
    element_names = iter(basis.elem.dofnames)
    labels: list[Any] = [None] * basis.N
    parts = (
        ("", basis.nodal_dofs),
        ("facet ", basis.facet_dofs),
        ("edge ", basis.edge_dofs),
        ("cell ", basis.interior_dofs),
    )
    for kind, table in parts:
        for row in table if table is not None else ():
            direction = str(next(element_names))
            for place, dof in enumerate(row):
                labels[dof] = (f"{kind}{place}" if kind else place, called.get(direction, direction))
    cell, corners = _CELLS[basis.mesh.elem.refdom.__name__]
    cells = basis.mesh.t.T[:, corners]
    mesh = Mesh(basis.mesh.p.T[: cells.max() + 1], {cell: cells})
    structure = Structure(mass, stiffness, damping, DofMap(labels), mesh, name)
    held = np.asarray(fixed.flatten() if hasattr(fixed, "flatten") else list(fixed), dtype=int)
    return structure.fixed(np.unique(held).tolist()) if held.size else structure


# ------------------------------------------------------------------------------------------------------------ assembly
def _assembled(element: Array, nodes: np.ndarray, directions: int) -> Any:
    """The matrix of elements that are all alike: `nodes` (count, k), `directions` degrees of freedom at each node."""
    from scipy.sparse import coo_array

    dofs = (directions * nodes[:, :, None] + np.arange(directions)).reshape(len(nodes), -1)
    rows = np.repeat(dofs, dofs.shape[1], axis=1)
    columns = np.tile(dofs, dofs.shape[1])
    entries = np.tile(element.ravel(), len(nodes))
    size = directions * (int(nodes.max()) + 1)
    return coo_array((entries, (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()


def _scikit_fem() -> Any:
    try:
        import skfem
    except ImportError:
        text = "plates are assembled by scikit-fem, which is not installed: pip install suboctave[fe]"
        raise InputError(text) from None
    return skfem


def _check_positive(**given: float) -> None:
    check_numbers(**given)
    for name, value in given.items():
        if not value > 0.0:
            raise InputError(f"{name}={value}: must be above 0", (name,))


def _check_count(name: str, count: Any) -> None:
    if isinstance(count, bool) or not isinstance(count, Integral) or count < 1:
        raise InputError(f"{name}={shortened(count)}: whole numbers from 1 on", (name,))
