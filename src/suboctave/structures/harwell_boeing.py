"""Harwell-Boeing files, as Ansys' HBMAT writes them: one matrix a file, with labels in Fname.mapping.

Four lines of header, a fifth where there are right-hand sides, then the columns: where each begins, the rows of its
entries, their values; right-hand sides, which are passed over. Of a symmetric matrix there is one triangle. The mapping
has a line for each equation of the matrix: its number, node, and direction (UX, ROTZ). I. S. Duff, R. G. Grimes, J. G.
Lewis, Users' guide for the Harwell-Boeing sparse matrix collection (1992); Mechanical APDL Command Reference, "HBMAT".
SciPy reads files of unsymmetric matrices without right-hand sides, which HBMAT does not write.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError, shortened
from suboctave.structures.contents import Contents, compressed
from suboctave.structures.text_lines import fortran_number, text_of
from suboctave.structures.triplets import mirrored

#: type of a matrix, by letters: real, complex or a pattern; its symmetry; assembled or by elements
_TYPE = re.compile(r"[RCP][USHZR][AE]", re.IGNORECASE)
_SYMMETRIES = {"U": "general", "R": "general", "S": "symmetric", "Z": "skew-symmetric", "H": "hermitian"}
#: a format of Fortran, such as (8I10), (1P,3E25.16), (d25.15): the width of a number
_FORMAT = re.compile(r"\(\s*(?:\d*P\s*,?\s*)?\d*\s*[IEDFG](\d+)", re.IGNORECASE)
#: lines of a mapping: number of the equation, node, direction
_EQUATION = re.compile(r"\s*(\d+)\s+([+-]?\d+)\s+(\S+)\s*")
#: how a mapping begins
_MAPPING = re.compile(r"\s*Matrix\s+Eqn\s+Node\s+DOF", re.IGNORECASE)


def is_harwell_boeing(beginning: str) -> bool:
    """Whether the beginning of a file is the header of one."""
    lines = beginning.splitlines()[:4]
    return len(lines) == 4 and bool(_TYPE.match(lines[2])) and len(_FORMAT.findall(lines[3])) >= 2


def read_harwell_boeing(path: Path) -> Contents:
    """The matrix of a file, with its labels where there is a mapping beside it."""
    text = text_of(path)
    if not is_harwell_boeing(text):
        raise InputError(
            f"{path.name} does not begin as a Harwell-Boeing file in text does: write it by HBMAT with the form ASCII"
        )
    lines = text.splitlines()
    counts = [int(word) for word in lines[1].split()]
    kind, symmetry, assembled = tuple(lines[2][:3].upper())
    if assembled == "E" or kind == "P":
        what = "by elements, not assembled" if assembled == "E" else "a pattern without values"
        raise InputError(f"{path.name} holds a matrix {what}: write the assembled matrix with its values")
    rows, columns, entries = (int(word) for word in lines[2][3:].split()[:3])
    widths = [int(width) for width in _FORMAT.findall(lines[3])]
    at = 5 if len(counts) > 4 and counts[4] > 0 else 4
    parts = 2 if kind == "C" else 1
    arrays = []
    for lines_of, width, count in zip(
        counts[1:4], [*widths, widths[-1]], (columns + 1, entries, parts * entries), strict=False
    ):
        arrays.append(_numbers(lines[at : at + lines_of], width, count, path.name))
        at += lines_of
    indptr, indices = (array.astype(np.int64) - 1 for array in arrays[:2])
    values = arrays[2] if parts == 1 else arrays[2][::2] + 1j * arrays[2][1::2]
    columns_of = {"data": values, "indices": indices, "indptr": indptr, "shape": (rows, columns)}
    matrix = mirrored(compressed(columns_of, by_columns=True, what=path.name), _SYMMETRIES[symmetry], path.name)
    labels = _mapping_of(path)
    if labels is not None and len(labels) != rows:
        raise InputError(
            f"{path.name} has {rows} rows, {labels_file(path).name} {len(labels)}: they do not belong together"
        )
    return Contents({"": matrix}, {} if labels is None else {"dofs": labels})


def _numbers(lines: Sequence[str], width: int, count: int, file: str) -> Any:
    """The numbers in lines: divided by blanks, or as wide as the format says."""
    words = " ".join(lines).upper().replace("D", "E").split()
    if len(words) != count:
        words = [line[i : i + width] for line in lines for i in range(0, len(line.rstrip()), width)]
    if len(words) != count:
        raise InputError(f"{file} has {len(words)} numbers where its header says {count}: it may be cut off")
    try:
        return np.array(words, dtype=float)
    except ValueError:  # an exponent without its letter
        return np.array([fortran_number(word) for word in words])


# ------------------------------------------------------------------------------------------------------------- mappings
def labels_file(path: Path) -> Path:
    """The mapping that belongs to a matrix."""
    return path.with_suffix(".mapping")


def _mapping_of(path: Path) -> list[tuple[int, str]] | None:
    beside = {file.name.lower(): file for file in path.parent.glob("*")}
    file = beside.get(labels_file(path).name.lower())
    return None if file is None else labels_of_mapping(text_of(file), file.name)


def is_mapping(text: str) -> bool:
    """Whether a text is a mapping."""
    return bool(_MAPPING.match(text))


def labels_of_mapping(text: str, file: str) -> list[tuple[int, str]]:
    """Node and direction of each equation of a mapping, in the order of the equations."""
    labels: dict[int, tuple[int, str]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or _MAPPING.match(line):
            continue
        match = _EQUATION.fullmatch(line)
        if match is None or int(match[1]) in labels:
            raise InputError(f"{file}, line {number}: the equation's number, node and direction, not {shortened(line)}")
        labels[int(match[1])] = int(match[2]), match[3]
    if sorted(labels) != list(range(1, len(labels) + 1)):
        raise InputError(f"{file} does not number its {len(labels)} equations from 1 on")
    return [labels[number] for number in sorted(labels)]
