"""NumPy's .npz and .npy.

An .npz is one sparse matrix as SciPy writes it, or an archive of arrays: dense matrices by their names, sparse ones by
`NAME_data`, `NAME_indices`, `NAME_indptr`, `NAME_shape` (compressed rows). `write` makes such an archive, with

    mass, stiffness, damping    sparse, damping as `rayleigh` (two numbers or expressions) or `modal` (ratios) also
    structural                  sparse, or `loss_factor`, a number or an expression
    dof_nodes, dof_directions   labels, texts (n,); fixed_nodes, fixed_directions
    points, point_nodes         of the mesh; cells_KIND
    name
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError, damage
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.structures.contents import Contents, Unreadable, compressed, labels_of
from suboctave.structures.damping import ModalDamping, Rayleigh
from suboctave.structures.dof_map import DofMap
from suboctave.structures.mesh import Mesh

_PARTS = ("data", "indices", "indptr", "shape")


def read_npz(path: Path) -> Contents:
    """All matrices of an .npz."""
    import scipy.sparse

    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        names = set(archive.files)
        if "format" in names:
            return Contents({"": scipy.sparse.csr_array(scipy.sparse.load_npz(path))})
        arrays = {name: archive[name] for name in archive.files}
    matrices = {name: array for name, array in arrays.items() if array.ndim == 2 and array.dtype.kind in "fiuc"}
    for name in {name.removesuffix("_indptr") for name in names if name.endswith("_indptr")}:
        parts = {part: arrays[f"{name}_{part}"] for part in _PARTS if f"{name}_{part}" in arrays}
        try:
            matrices[name] = compressed(parts, by_columns=False, what=f"{path.name}, {name}")
        except (InputError, KeyError, ValueError) as error:
            matrices[name] = Unreadable(f"{path.name}, {name} is no sparse matrix: {damage(error)}")
    return Contents(matrices, _more(arrays))


def _more(arrays: Mapping[str, Any]) -> dict[str, Any]:
    more: dict[str, Any] = {}
    labels = labels_of(arrays)
    if labels is not None:
        fixed = labels_of({f"dof_{part}": arrays.get(f"fixed_{part}", []) for part in ("nodes", "directions")})
        more["dofs"] = DofMap(labels, fixed or ())
    if "rayleigh" in arrays:
        alpha, beta = arrays["rayleigh"].tolist()
        more["damping"] = Rayleigh(alpha, beta)
    if "modal" in arrays:
        more["damping"] = ModalDamping(arrays["modal"].tolist())
    if "modal_ratio" in arrays:
        ratio, count = arrays["modal_ratio"].tolist()
        more["damping"] = ModalDamping(ratio, int(count) or None)
    if "loss_factor" in arrays:
        more["structural"] = str(arrays["loss_factor"])
    if "points" in arrays:
        cells = {name.removeprefix("cells_"): array for name, array in arrays.items() if name.startswith("cells_")}
        nodes = arrays["point_nodes"].tolist() if "point_nodes" in arrays else None
        more["mesh"] = Mesh(arrays["points"], cells, nodes)
    if "name" in arrays:
        more["name"] = str(arrays["name"])
    return more


def read_npy(path: Path) -> Contents:
    """The matrix of an .npy."""
    return Contents({"": np.load(path, allow_pickle=False)})


def write(
    path: Path,
    matrices: Mapping[str, Any],
    dofs: DofMap | None,
    mesh: Mesh | None,
    damping: Any,
    structural: Any,
    name: str,
) -> None:
    """Write an archive; `damping`: `Rayleigh` or `ModalDamping`, `structural`: a loss factor, where no matrices."""
    arrays: dict[str, Any] = {"name": np.array(name)}
    for what, matrix in matrices.items():
        values = (matrix.data, matrix.indices, matrix.indptr, np.array(matrix.shape))
        arrays |= {f"{what}_{part}": value for part, value in zip(_PARTS, values, strict=True)}
    if isinstance(damping, Rayleigh):
        arrays["rayleigh"] = np.array([damping.text("alpha"), damping.text("beta")])
    elif isinstance(damping, ModalDamping):
        single = not isinstance(damping.ratios, tuple)
        ratios: Any = [damping.ratios, damping.count or 0] if single else damping.ratios
        arrays["modal_ratio" if single else "modal"] = np.array(ratios, dtype=float)
    if isinstance(structural, Coefficient):
        arrays["loss_factor"] = np.array(structural.text)
    if dofs is not None:
        for kind, labels in (("dof", dofs.labels), ("fixed", sorted(dofs.fixed, key=str))):
            for part, column in (("nodes", 0), ("directions", 1)):
                arrays[f"{kind}_{part}"] = np.array([str(label[column]) for label in labels], dtype=str)
    if mesh is not None:
        arrays |= {"points": mesh.points, "point_nodes": np.array(list(map(str, mesh.nodes)))}
        arrays |= {f"cells_{kind}": rows for kind, rows in mesh.cells.items()}
    np.savez_compressed(path, **arrays)
