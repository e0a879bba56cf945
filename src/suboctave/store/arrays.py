"""Arrays as files hold them: complex numbers as pairs of real variables, texts as texts, rows of one length."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray


_PARTS = ("real", "imag")


def flat(variables: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    """Variables (dimensions, values, ...) with complex ones as pairs `..._real`, `..._imag`, objects as texts."""
    for name, (dims, values, *attributes) in variables.items():
        array = np.asarray(values)
        if array.dtype.kind == "c":
            for part in _PARTS:
                yield f"{name}_{part}", (dims, getattr(array, part), *attributes)
        else:
            yield str(name), (dims, array.astype(str) if array.dtype.kind == "O" else array, *attributes)


def array_of(dataset: xarray.Dataset, name: str) -> np.ndarray:
    """A variable that `flat` wrote, complex again if it was."""
    if name in dataset:
        return np.asarray(dataset[name].values)
    real, imag = (np.asarray(dataset[f"{name}_{part}"].values) for part in _PARTS)
    # arithmetic would change zeros and spread what is not finite
    joined = np.empty(real.shape, dtype=complex)
    joined.real, joined.imag = real, imag
    return joined


def padded(rows: Sequence[Any], kind: type) -> np.ndarray:
    """Rows of several lengths as a table, nan behind the shorter ones."""
    table: np.ndarray = np.full((len(rows), max((len(row) for row in rows), default=0)), np.nan, dtype=kind)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table
