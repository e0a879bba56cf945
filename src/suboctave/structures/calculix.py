"""CalculiX' matrices of `*FREQUENCY, SOLVER=MATRIXSTORAGE`: job.sti, job.mas and job.dof.

Lines of `.sti` and `.mas` are row, column, value; line i of `.dof` is `node.direction` of row i. CalculiX CrunchiX
User's Manual, "*FREQUENCY".
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from suboctave.errors import InputError
from suboctave.structures.contents import Contents
from suboctave.structures.text_lines import columns_of, text_of, whole
from suboctave.structures.triplets import from_triplets


def read_calculix(path: Path) -> Contents:
    """Matrices and labels of a job, given by one of its three files."""
    files = {suffix: path.with_suffix(suffix) for suffix in (".sti", ".mas", ".dof")}
    for file in files.values():
        if not file.is_file():
            raise InputError(f"{path.name}: there is no {file.name} beside it; CalculiX writes .sti, .mas and .dof")
    labels = []
    for number, line in enumerate(text_of(files[".dof"]).split(), 1):
        node, dot, direction = line.partition(".")
        if not (dot and node.lstrip("-").isdigit() and direction.isdigit()):
            raise InputError(f"{files['.dof'].name}, line {number}: {line!r} is not node.direction, such as 12.3")
        labels.append((int(node), direction))
    matrices: dict[str, Any] = {}
    for what, suffix in (("stiffness", ".sti"), ("mass", ".mas")):
        name = files[suffix].name
        table = columns_of(text_of(files[suffix]), (3,), name)
        places = whole(table[:, :2], name)
        matrices[what] = from_triplets(places[:, 0] - 1, places[:, 1] - 1, table[:, 2], len(labels), name)
        if not places.max() == len(labels):
            raise InputError(f"{name} has {places.max()} rows, {files['.dof'].name} {len(labels)}: one may be cut off")
    return Contents(matrices, {"dofs": labels})
