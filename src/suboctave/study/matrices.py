"""Matrices of a study file: numbers and expressions inline, or files beside it (.npy, .npz, .mtx, .mat, .csv)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError, suggest

__all__ = ["SUFFIXES", "given_matrix"]

SUFFIXES = (".npy", ".npz", ".mtx", ".mat", ".csv")


def given_matrix(value: Any, folder: Path) -> Any:
    """What a study file says of a matrix, as `System` takes it.

    A number, an expression, nested lists; `{file = "M.npy", key = "M"}` (or the name of a file alone), relative to
    `folder`; `{"expression" = matrix, ...}` for the sum of expression times matrix. Raises InputError.
    """
    if isinstance(value, str) and Path(value).suffix.lower() in SUFFIXES:
        return read_matrix(folder / value, None)
    if isinstance(value, Mapping):
        if "file" in value:
            extra = [name for name in value if name not in ("file", "key")]
            if extra:
                raise InputError(f"a matrix from a file has no key {extra[0]!r}{suggest(extra[0], ['file', 'key'])}")
            if not isinstance(value["file"], str):
                raise InputError(f"file is the name of a file, not {value['file']!r}")
            return read_matrix(folder / value["file"], value.get("key"))
        return {
            float(factor) if _is_number(factor) else factor: given_matrix(matrix, folder)
            for factor, matrix in value.items()
        }
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_matrix(path: Path, key: str | None) -> Any:
    """A matrix from a file, dense or sparse; `key` names it where the file holds several. Raises InputError."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path.name}: matrices are read from {', '.join(SUFFIXES)} files")
    if not path.is_file():
        raise InputError(f"there is no file {path}{suggest(path.name, _beside(path)) if _beside(path) else ''}")
    try:
        matrix = _READERS[suffix](path, key)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes of its reader
        raise InputError(f"cannot read {path}: {type(error).__name__}: {str(error)[:120]}") from None
    if not hasattr(matrix, "tocsr"):
        matrix = np.asarray(matrix)
        if matrix.dtype.kind not in "fiu":
            raise InputError(f"{path}: the matrix holds {matrix.dtype}, not real numbers")
    return matrix


def _beside(path: Path) -> list[str]:
    folder = path.parent
    return [p.name for p in folder.iterdir() if p.suffix.lower() in SUFFIXES] if folder.is_dir() else []


def _npy(path: Path, key: str | None) -> Any:
    return np.load(path, allow_pickle=False)


def _npz(path: Path, key: str | None) -> Any:
    import scipy.sparse

    with np.load(path, allow_pickle=False) as archive:
        if {"format", "shape", "data"} <= set(archive.files):
            sparse: Any = scipy.sparse.load_npz(path)
            return sparse.tocsr()
        return archive[_chosen(path, key, archive.files)]


def _mtx(path: Path, key: str | None) -> Any:
    import scipy.io

    matrix = scipy.io.mmread(path)
    return matrix.tocsr() if hasattr(matrix, "tocsr") else matrix


def _mat(path: Path, key: str | None) -> Any:
    import scipy.io

    content = scipy.io.loadmat(path)
    matrix = content[_chosen(path, key, [name for name in content if not name.startswith("__")])]
    return matrix.tocsr() if hasattr(matrix, "tocsr") else matrix


def _csv(path: Path, key: str | None) -> Any:
    return np.loadtxt(path, delimiter=",", ndmin=2)


_READERS = {".npy": _npy, ".npz": _npz, ".mtx": _mtx, ".mat": _mat, ".csv": _csv}


def _chosen(path: Path, key: str | None, names: list[str]) -> str:
    if key is None and len(names) == 1:
        return names[0]
    if key is None:
        raise InputError(f"{path} holds {', '.join(sorted(names)) or 'nothing'}: choose one with key=")
    if key not in names:
        raise InputError(f"{path} holds no {key!r}{suggest(str(key), names)}")
    return key
