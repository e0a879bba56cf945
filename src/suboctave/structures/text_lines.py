"""Columns of numbers in text files, as finite-element programs write matrices."""

from __future__ import annotations

import gzip
import io
import re
from pathlib import Path

import numpy as np

from suboctave.errors import InputError
from suboctave.model.elements.base import Array

#: bytes that no text has: control characters other than the blanks among them
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
#: exponents as Fortran writes them, as all others know them
_EXPONENTS = str.maketrans("Dd", "Ee")


def text_of(path: Path) -> str:
    """The text of a file, or of a packed one (.gz); InputError where it ends within a line, or is none."""
    text = characters_of(path)
    if not text.endswith("\n"):
        raise InputError(f"{path.name} ends within a line: it seems to be cut off (else end its last line)")
    return text


def characters_of(path: Path) -> str:
    """The same of a file that may end within a line.

    Remarks may have letters of any code page: what is not UTF-8 is read as Latin-1.
    """
    data = path.read_bytes()
    if path.suffix.lower() == ".gz":
        data = gzip.decompress(data)
    odd = _NO_TEXT.search(data)
    if odd:
        line = data.count(b"\n", 0, odd.start()) + 1
        raise InputError(f"{path.name} is no text, or is damaged: a byte {odd[0][0]} in line {line}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def columns_of(text: str, counts: tuple[int, ...], file: str) -> Array:
    """The numbers (m, columns) of a text, divided by blanks or commas; lines that begin with an asterisk are remarks.

    Raises `InputError` for other than one of these counts of columns, for what is no number, and for no line at all.
    """
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("*")), None)
    if first is None:
        raise InputError(f"{file} holds no entries")
    try:
        table = np.loadtxt(
            io.StringIO(text.translate(_EXPONENTS)), delimiter="," if "," in first else None, comments="*", ndmin=2
        )
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


def table_of(text: str) -> Array:
    """The numbers (m, columns) of a text, as many in each line, divided by blanks; lines that begin with % are remarks.

    Raises `ValueError` for what is none.
    """
    if not text.strip():
        return np.zeros((0, 0))
    return np.loadtxt(io.StringIO(text.translate(_EXPONENTS)), comments="%", ndmin=2)


def fortran_number(text: str) -> float:
    """A number as Fortran writes it: 1.5D-3 and 1.5-3 are 1.5E-3."""
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", text.strip().upper().replace("D", "E")))
