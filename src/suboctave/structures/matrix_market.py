"""Matrix Market's .mtx and .mtx.gz: one matrix a file; symmetric headers are honoured.

R. F. Boisvert, R. Pozo, K. A. Remington, The Matrix Market exchange formats, NISTIR 5935 (1996).
"""

from __future__ import annotations

from pathlib import Path

from suboctave.errors import InputError
from suboctave.structures.contents import Contents

#: rows beyond which a header is taken for damaged: no such matrix can be solved
_MOST = 50_000_000


def read_matrix_market(path: Path) -> Contents:
    """The matrix of a file in Matrix Market's format."""
    import scipy.io

    rows, *_ = scipy.io.mminfo(path)
    if rows > _MOST:
        raise InputError(f"{path.name}: a matrix of {rows} rows is more than can be solved: the header may be damaged")
    return Contents({"": scipy.io.mmread(path)})
