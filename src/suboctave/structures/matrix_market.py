"""Matrix Market's .mtx and .mtx.gz: one matrix a file; symmetric headers are honoured.

R. F. Boisvert, R. Pozo, K. A. Remington, The Matrix Market exchange formats, NISTIR 5935 (1996). SciPy's reader takes
1.5D+3 for 1.5, and a zero byte in a number ends the process.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.contents import Contents
from suboctave.structures.text_lines import characters_of, table_of, whole
from suboctave.structures.triplets import mirrored

#: rows beyond which a header is taken for damaged: no such matrix can be solved
_MOST = 50_000_000
#: how a file begins
BEGINNING = b"%%matrixmarket"
#: what else may stand in its first line
_LAYOUTS, _SYMMETRIES = ("coordinate", "array"), ("general", "symmetric", "skew-symmetric", "hermitian")
_FIELDS = ("real", "double", "integer", "unsigned-integer", "complex")


def read_matrix_market(path: Path) -> Contents:
    """The matrix of a file in Matrix Market's format."""
    text = characters_of(path)
    if not text.endswith("\n"):
        raise ValueError("it ends within a line: if nothing is missing, end its last line")
    first, _, rest = text.partition("\n")
    words = first.lower().split()
    if len(words) != 5 or words[0].encode() != BEGINNING or words[1] != "matrix":
        raise ValueError(f"it begins with {first[:60]!r}, not with '%%MatrixMarket matrix ...'")
    layout, field, symmetry = words[2:]
    for given, known in ((layout, _LAYOUTS), (field, _FIELDS), (symmetry, _SYMMETRIES)):
        if given not in known:
            raise InputError(f"{path.name} is a matrix of the kind {given!r}; {', '.join(known)} are read")
    sizes: list[str] = []
    while rest and not sizes:
        line, _, rest = rest.partition("\n")
        sizes = [] if line.startswith("%") else line.split()
    count = 3 if layout == "coordinate" else 2
    if len(sizes) != count:
        raise ValueError(f"{len(sizes)} sizes where there should be {count}")
    rows, columns = (int(size) for size in sizes[:2])
    if max(rows, columns) > _MOST:
        raise InputError(f"{path.name}: a matrix of {rows} rows is more than can be solved: the header may be damaged")
    values = table_of(rest)
    parts = 2 if field == "complex" else 1
    if layout == "array":
        return Contents({"": _full(values, rows, columns, parts, symmetry)})
    return Contents({"": _sparse(values, rows, columns, int(sizes[2]), parts, symmetry, path.name)})


def _sparse(table: Any, rows: int, columns: int, entries: int, parts: int, symmetry: str, file: str) -> Any:
    import scipy.sparse

    if len(table) != entries or (entries and table.shape[1] != 2 + parts):
        raise ValueError(
            f"{len(table)} lines of {table.shape[1]} numbers where there should be {entries} of {2 + parts}"
        )
    places = table[:, :2] if entries else np.zeros((0, 2))
    if not np.all((places >= 1) & (places <= (rows, columns))):
        raise ValueError(f"an entry outside of {rows} rows and {columns} columns")
    i, j = whole(places, file).T - 1
    values = _values(table[:, 2:], parts) if entries else np.zeros(0)
    matrix = scipy.sparse.coo_array((values, (i, j)), shape=(rows, columns)).tocsr()
    return mirrored(matrix, symmetry, file)


def _full(table: Any, rows: int, columns: int, parts: int, symmetry: str) -> Any:
    """Values down the columns, of a symmetric matrix from the diagonal on, of a skew one from below it."""
    begin = int(symmetry == "skew-symmetric")
    below = [np.arange(0 if symmetry == "general" else j + begin, rows) for j in range(columns)]
    count = sum(map(len, below))
    if len(table) != count or (count and table.shape[1] != parts):
        raise ValueError(f"{len(table)} lines of {table.shape[1]} numbers where there should be {count} of {parts}")
    values = _values(table, parts)
    matrix = np.zeros((rows, columns), dtype=values.dtype)
    matrix[np.concatenate(below), np.repeat(np.arange(columns), list(map(len, below)))] = values
    return mirrored(matrix, symmetry, "")


def _values(table: Any, parts: int) -> Any:
    return table[:, 0] + 1j * table[:, 1] if parts == 2 else table[:, 0]
