"""Columns of numbers in text files, as finite-element programs write matrices."""

from __future__ import annotations

import gzip
import io
import re
from pathlib import Path

import numpy as np

from suboctave.errors import InputError
from suboctave.model.elements.base import Array


def text_of(path: Path) -> str:
    """The text of a file, or of a packed one (.gz); InputError where it ends within a line, or is none."""
    data = path.read_bytes()
    if path.suffix == ".gz":
        data = gzip.decompress(data)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path.name} is no text") from None
    if not text.endswith("\n"):
        raise InputError(f"{path.name} ends within a line: it seems to be cut off (else end its last line)")
    return text


def columns_of(text: str, counts: tuple[int, ...], file: str) -> Array:
    """The numbers (m, columns) of a text, divided by blanks or commas; lines that begin with an asterisk are remarks.

    Raises `InputError` for other than one of these counts of columns, for what is no number, and for no line at all.
    """
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("*")), None)
    if first is None:
        raise InputError(f"{file} holds no entries")
    try:
        table = np.loadtxt(io.StringIO(text), delimiter="," if "," in first else None, comments="*", ndmin=2)
    except ValueError as error:
        raise InputError(f"{file} holds what is no table of numbers: {str(error).splitlines()[0][:120]}") from None
    if table.shape[1] not in counts:
        wanted = " or ".join(map(str, counts))
        raise InputError(f"{file} has lines of {table.shape[1]} numbers; {wanted} are known")
    return table


def whole(numbers: Array, file: str) -> np.ndarray:
    """These numbers as whole ones; InputError where they are not."""
    if not np.isfinite(numbers).all() or np.any(numbers != np.round(numbers)) or np.any(np.abs(numbers) > 2**52):
        raise InputError(f"{file}: nodes, directions, rows and columns must be whole numbers")
    return numbers.astype(np.int64)


def fortran_number(text: str) -> float:
    """A number as Fortran writes it: 1.5D-3 and 1.5-3 are 1.5E-3."""
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", text.strip().upper().replace("D", "E")))
