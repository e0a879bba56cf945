"""MATLAB's .mat: versions 5 to 7 by SciPy, version 7.3 as HDF5. Fields of structures are named "model.K"."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from suboctave.structures.contents import Contents, labels_of
from suboctave.structures.hdf5 import read_hdf5


def read_matlab(path: Path) -> Contents:
    """All matrices of a .mat file."""
    import h5py
    import scipy.io

    if h5py.is_hdf5(path):
        return read_hdf5(path)
    arrays: dict[str, Any] = {}
    _flatten("", scipy.io.loadmat(path, simplify_cells=True), arrays)
    matrices = {}
    for name, value in arrays.items():
        is_number = isinstance(value, int | float | complex | np.number) and not isinstance(value, bool)
        array = np.full((1, 1), value) if is_number else value  # a matrix (1, 1) comes as a number
        if hasattr(array, "tocsr") or (array.ndim == 2 and array.dtype.kind in "fiuc"):
            matrices[name] = array
    labels = labels_of({name: value for name, value in arrays.items() if isinstance(value, np.ndarray)})
    return Contents(matrices, {} if labels is None else {"dofs": labels})


def _flatten(prefix: str, values: dict[str, Any], arrays: dict[str, Any]) -> None:
    for name, value in values.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            _flatten(f"{prefix}{name}.", value, arrays)
        elif hasattr(value, "tocsr") or isinstance(value, np.ndarray | int | float | complex | np.number):
            arrays[f"{prefix}{name}"] = value
