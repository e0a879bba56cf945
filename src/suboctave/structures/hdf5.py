"""HDF5 files, and MATLAB's .mat of version 7.3, which are such.

Dense matrices are datasets (n, n). Sparse ones are groups of `data`, `indices`, `indptr` and `shape` (compressed rows,
or columns where an attribute says "csc", as in anndata's files), of `row`, `col`, `data` (and `shape`), or MATLAB's
`data`, `ir`, `jc` (compressed columns, the attribute `MATLAB_sparse` is the number of rows).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.contents import Contents, Unreadable, compressed, labels_of


def read_hdf5(path: Path) -> Contents:
    """All matrices of an HDF5 file, those inside groups by "group/name"."""
    import h5py

    with h5py.File(path, "r") as file:
        matrices: dict[str, Any] = {}
        arrays: dict[str, Any] = {}
        _walk(file, "", path.name, matrices, arrays)
    labels = labels_of(arrays)
    return Contents(matrices, {} if labels is None else {"dofs": labels})


def _walk(group: Any, prefix: str, file: str, matrices: dict[str, Any], arrays: dict[str, Any]) -> None:
    import h5py

    for name, item in group.items():
        if name.startswith("#"):  # where MATLAB keeps what variables refer to
            continue
        place = f"{prefix}{name}"
        if isinstance(item, h5py.Dataset):
            array = _dataset(item)
            arrays[place] = array
            if array.ndim == 2 and array.dtype.kind in "fiuc":
                matrices[place] = array
        elif isinstance(item, h5py.Group):
            try:
                matrix = _sparse(item, f"{file}, {place}")
            except (InputError, ValueError) as error:
                matrix = Unreadable(" ".join(str(error).split()))
            if matrix is None:
                _walk(item, f"{place}/", file, matrices, arrays)
            else:
                matrices[place] = matrix


def _dataset(item: Any) -> np.ndarray:
    array = np.asarray(item)
    if array.dtype.names == ("real", "imag"):  # a complex number of MATLAB
        array = array["real"] + 1j * array["imag"]
    # MATLAB stores by columns
    return array.T if "MATLAB_class" in item.attrs else array


def _sparse(group: Any, what: str) -> Any:
    """The sparse matrix that a group holds, None where it holds none."""
    import scipy.sparse

    keys = set(group)
    shape = group["shape"] if "shape" in keys else group.attrs.get("shape", group.attrs.get("h5sparse_shape"))
    parts: dict[str, Any] = {} if shape is None else {"shape": np.asarray(shape)}
    if {"ir", "jc"} <= keys or "MATLAB_sparse" in group.attrs:
        parts = {"data": np.zeros(0), "indices": np.zeros(0, dtype=np.int64), "indptr": np.asarray(group["jc"])}
        if "data" in keys:  # there is none in a matrix of zeros
            parts |= {"data": _dataset(group["data"]).ravel(), "indices": np.asarray(group["ir"])}
        columns = len(parts["indptr"]) - 1
        parts["shape"] = (int(group.attrs.get("MATLAB_sparse", columns)), columns)
        return compressed(parts, by_columns=True, what=what)
    if {"data", "indices", "indptr"} <= keys:
        told = " ".join(str(group.attrs.get(name, "")) for name in ("encoding-type", "h5sparse_format", "format"))
        parts |= {name: np.asarray(group[name]) for name in ("data", "indices", "indptr")}
        return compressed(parts, by_columns="csc" in told, what=what)
    if {"row", "col", "data"} <= keys:
        row, col, data = (np.asarray(group[name]) for name in ("row", "col", "data"))
        if "shape" not in parts:
            n = int(max(row.max(initial=-1), col.max(initial=-1))) + 1
            parts["shape"] = (n, n)
        try:
            return scipy.sparse.coo_array((data, (row, col)), shape=tuple(map(int, parts["shape"]))).tocsr()
        except ValueError as error:
            raise InputError(f"{what}: {error}") from None
    return None
