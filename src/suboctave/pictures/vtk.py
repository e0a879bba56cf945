"""Fields on the mesh of a structure for other programs: PyVista's grids, and .vtu files that ParaView reads.

Both need the packages of `pip install suboctave[fe]`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.arguments import checked
from suboctave.atomic import free_place, replace_file
from suboctave.errors import InputError, shortened
from suboctave.pictures.nodal import nodal_displacements

if TYPE_CHECKING:
    from suboctave.structures.structure import Structure


@checked
def to_pyvista(structure: Structure, fields: Mapping[str, Any]) -> Any:
    """A `pyvista.UnstructuredGrid` of the mesh, with displacements (N, 3) of the nodes as point data.

    `fields`: `{name: (n,) displacements of the degrees of freedom}`. `grid.warp_by_vector(name)` is the deformed shape.
    Raises `InputError` for fields of another shape, and where PyVista or meshio is not installed.
    """
    try:
        import pyvista
    except ImportError:
        raise InputError("PyVista is not installed: pip install suboctave[fe]") from None
    return pyvista.from_meshio(_meshio_mesh(structure, fields))


@checked
def write_vtu(structure: Structure, fields: Mapping[str, Any], path: str | Path, *, overwrite: bool = False) -> Path:
    """Write the mesh with displacements of its nodes as a .vtu file, which ParaView reads.

    `fields`: as of `to_pyvista`. Raises `InputError` where the file exists (`overwrite` replaces it), for fields of
    another shape, and where meshio is not installed.
    """
    mesh = _meshio_mesh(structure, fields)
    target = free_place(path, overwrite, (".vtu",))
    replace_file(target, lambda place: mesh.write(place, file_format="vtu"))
    return target


def _meshio_mesh(structure: Structure, fields: Mapping[str, Any]) -> Any:
    try:
        import meshio
    except ImportError:
        raise InputError("meshio is not installed: pip install suboctave[fe]") from None
    if not isinstance(fields, Mapping) or not fields:
        raise InputError(f"fields are a mapping {{name: array (n,)}}, not {shortened(fields)}")
    data = {}
    for name, field in fields.items():
        if np.ndim(field) != 1:
            raise InputError(f"the field {name!r} is an array ({structure.n},), not of the shape {np.shape(field)}")
        data[str(name)] = nodal_displacements(structure, field)
    assert structure.mesh is not None
    cells = [(kind, np.array(rows)) for kind, rows in structure.mesh.cells.items()]
    return meshio.Mesh(np.array(structure.mesh.points), cells, point_data=data)
