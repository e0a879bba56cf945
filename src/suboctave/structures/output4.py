"""Nastran's OUTPUT4, .op4: matrices by columns, in text or in binary of either byte order.

Of each matrix a header: columns, rows, form, type, name. Of each column that is not zero its number, the row where it
begins, and how many words it has. With row 0 it is sparse: strings of values, each after its length + 1 and its row,
two words where the number of rows is written negative, else one, row + 65536 (length + 1). A column beyond the last,
with one value, ends the matrix. MSC Nastran DMAP Programmer's Guide, "OUTPUT4"; words of 8 bytes as pyYeti
(nastran/op4.py) has met them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.columns import Columns, by_name
from suboctave.structures.contents import Contents
from suboctave.structures.fortran import Records
from suboctave.structures.text_lines import fortran_number, text_of

#: rows from which on strings have two words before them, whatever the sign
_BIG = 65536
#: numbers of a text: 3E23.16 is three in a line, 23 characters each
_FORMAT = re.compile(r"\d[ED](\d+)\.\d+", re.IGNORECASE)
_USUAL = 23


def read_op4(path: Path) -> Contents:
    """All matrices of an .op4 file."""
    records = Records(path, {24: 4, 48: 8})
    matrices = by_name(_binary(records) if records.order else _text(path), path.name)
    if not matrices:
        raise InputError(f"{path.name} holds no matrix")
    return Contents(matrices)


def _binary(records: Records) -> list[Columns]:
    found = []
    while records.more:
        header = records.next()
        if len(header) != 6 * records.size:
            raise InputError(f"{records.file} is damaged: a header of {len(header)} bytes, not {6 * records.size}")
        columns, rows, form, kind = (int(i) for i in np.frombuffer(header[: 4 * records.size], records.kind("i")))
        matrix = Columns(_name(header[4 * records.size :]), abs(rows), columns, form, kind, records.file)
        big = rows < 0 or rows >= _BIG
        number = records.kind("f") if kind % 2 else records.kind("f", 8)
        while True:
            record = records.next()
            head = np.frombuffer(record[: 3 * records.size], records.kind("i"))
            if len(head) < 3:
                raise InputError(f"{records.file} is damaged: a column of {matrix.name} has no beginning")
            column, row = int(head[0]), int(head[1])
            if column > columns:
                break
            words = record[3 * records.size :]
            if row:
                matrix.add(row, column, np.frombuffer(words, number))
            else:
                _strings(matrix, column, words, big, records, number)
        found.append(matrix)
    return found


def _strings(
    matrix: Columns, column: int, words: bytes, big: bool, records: Records, number: np.dtype[np.floating]
) -> None:
    """Adds the strings of a sparse column."""
    size, at = records.size, 0
    while at < len(words):
        first = np.frombuffer(words[at : at + (2 if big else 1) * size], records.kind("i"))
        length, row = (int(first[0]), int(first[-1])) if big else divmod(int(first[0]), _BIG)
        at += len(first) * size
        end = at + (length - 1) * size
        if length < 2 or end > len(words):
            raise InputError(f"{records.file} is damaged: a string of {length - 1} words in column {column}")
        matrix.add(row, column, np.frombuffer(words[at:end], number))
        at = end


def _text(path: Path) -> list[Columns]:
    """Lines of values have decimal points, all others are whole numbers; a value of two parts may run on over the end
    of a line.
    """
    lines = text_of(path).splitlines()
    found: list[Columns] = []
    at = 0

    def next_line() -> str:
        nonlocal at
        if at == len(lines):
            raise InputError(f"{path.name} is cut off: {found[-1].name} has no end")
        at += 1
        return lines[at - 1]

    while at < len(lines):
        header = next_line()
        if not header.strip():
            continue
        columns, rows, form, kind = (int(header[8 * i : 8 * i + 8]) for i in range(4))
        found.append(Columns(_name(header[32:40].encode()), abs(rows), columns, form, kind, path.name))
        stated = _FORMAT.search(header[40:])
        width = int(stated[1]) if stated else _USUAL
        column = row = 0
        values: list[float] = []
        while column <= columns:
            line = next_line()
            if "." in line:
                values += [fortran_number(line[i : i + width]) for i in range(0, len(line.rstrip()), width)]
                continue
            if values:
                found[-1].add(row, column, np.array(values))
                values = []
            numbers = [int(word) for word in line.split()]
            if len(numbers) == 3:
                column, row = numbers[:2]
            else:
                row = numbers[1] if len(numbers) == 2 else numbers[0] % _BIG
        next_line()  # the value of the column beyond the last
    return found


def _name(text: bytes) -> str:
    return "".join(text.replace(b"\0", b" ").decode("ascii", "replace").split())
