"""Abaqus' .mtx, one matrix a file, of `*MATRIX GENERATE` and `*MATRIX OUTPUT`.

Each line is `node, direction, node, direction, value` (FORMAT=MATRIX INPUT, and LABELS), or `row, column, value`
(FORMAT=COORDINATE); of symmetric matrices one triangle, or all. Internal nodes, such as those of Lagrange multipliers,
have negative numbers, and are kept. Abaqus Analysis User's Guide, "Generating matrices"; Keywords Reference Guide,
"*MATRIX INPUT", for the lines.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from suboctave.structures.contents import Contents
from suboctave.structures.text_lines import columns_of, text_of, whole
from suboctave.structures.triplets import LabelledEntries, from_triplets


def read_abaqus(path: Path) -> Contents:
    """The matrix of a file."""
    table = columns_of(text_of(path), (3, 5), path.name)
    places = whole(table[:, :-1], path.name)
    matrix: Any
    if table.shape[1] == 5:
        matrix = LabelledEntries(places[:, :2], places[:, 2:], table[:, 4])
    else:
        matrix = from_triplets(places[:, 0] - 1, places[:, 1] - 1, table[:, 2], int(places.max()), path.name)
    return Contents({"": matrix})


def companions(path: Path) -> dict[str, Path]:
    """The files of the same job, by what they are, where the name is Abaqus' own: job_STIF1.mtx and the like."""
    stem = path.name
    parts = {"stiffness": "_STIF", "mass": "_MASS", "damping": "_DMPV", "structural": "_DMPS"}
    for what, part in parts.items():
        if part in stem:
            found = {role: path.with_name(stem.replace(part, other)) for role, other in parts.items()}
            return {role: file for role, file in found.items() if file.is_file() or role in (what, "mass", "stiffness")}
    return {}
