"""Nastran's .pch, matrices punched as DMIG entries.

They carry node and component; fields are 8 or, with an asterisk, 16 wide. MSC Nastran Quick Reference Guide, "DMIG".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.contents import Contents, Unreadable
from suboctave.structures.text_lines import fortran_number, text_of
from suboctave.structures.triplets import LabelledEntries

#: forms of a matrix in DMIG headers: square, symmetric
_FORMS = {1, 6}


def read_punch(path: Path) -> Contents:
    """All matrices of a .pch file, with node and component of their rows."""
    entries: dict[str, list[tuple[int, int, int, int, float]]] = {}
    others: dict[str, Unreadable] = {}
    column: tuple[str, int, int] | None = None
    for number, line in enumerate(text_of(path).splitlines(), 1):
        text = line[:72].rstrip()
        if not text or text.startswith("$"):
            continue
        try:
            head, fields = _fields(text)
            if head.startswith("DMIG"):
                name = fields[0]
                if fields[1] == "0":
                    other = _other(name, int(fields[2]), int(fields[3]), path.name)
                    others |= {} if other is None else {name: other}
                    entries.setdefault(name, [])
                    column = None
                    continue
                if name in others:
                    column = None
                    continue
                column, fields = (name, int(fields[1]), int(fields[2] or 0)), fields[4:]
                entries.setdefault(name, [])
            elif not head.startswith(("*", "+", " ")) and head:
                column = None  # another entry of the bulk data
                continue
            if column is None:
                continue
            for node, component, value in _groups(fields):
                entries[column[0]].append((node, component, *column[1:], value))
        except (ValueError, IndexError):
            raise InputError(f"{path.name}, line {number} is no DMIG entry: {text[:60]!r}") from None
    if not others and not any(entries.values()):
        raise InputError(f"{path.name} holds no DMIG matrix")
    matrices: dict[str, Any] = dict(others)
    for name, rows in entries.items():
        if name in others:
            continue
        places = np.array([row[:4] for row in rows], dtype=np.int64).reshape(-1, 4)
        values = np.array([row[4] for row in rows], dtype=float)
        matrices[name] = LabelledEntries(places[:, :2], places[:, 2:], values)
    return Contents(matrices)


def _fields(text: str) -> tuple[str, list[str]]:
    """The first field of an entry, and the others."""
    if "," in text:
        head, *fields = [field.strip() for field in text.split(",")]
        return head, fields
    width = 16 if "*" in text[:8] else 8
    fields = [text[start : start + width].strip() for start in range(8, 72, width)]
    return text[:8].strip(), fields


def _other(name: str, form: int, kind: int, file: str) -> Unreadable | None:
    """Why a matrix of this form and type is none of a structure, such as a load; None where it is one."""
    if form not in _FORMS:
        return Unreadable(f"{file}: {name} is a matrix of form {form}; square (1) and symmetric (6) ones are read")
    if kind > 2:
        return Unreadable(f"{file}: {name} is complex: punch its real part, and K4 for structural damping")
    return None


def _groups(fields: list[str]) -> Iterator[tuple[int, int, float]]:
    """Node, component and value of the entries of a line; there is one in a wide line, two in a narrow one."""
    for start in range(0, len(fields) - 2, 4):
        node, component, value = fields[start : start + 3]
        if node:
            yield int(node), int(component or 0), fortran_number(value)
