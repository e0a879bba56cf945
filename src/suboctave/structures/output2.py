"""Nastran's OUTPUT2, .op2: matrices by columns among tables, in binary of either byte order.

Keys, records of one whole number, say what follows: a positive one a record of so many words, 0 the end of a data block
or of the file, a negative one the next part of a data block. The parts of a matrix from -3 on are its columns: runs of
values, each after its first row. Other data blocks are tables and passed over; so is MATPOOL, whose matrices have
labels in them. Nastran DMAP Programmer's Guide, "OUTPUT2"; as pyYeti (nastran/op2.py) and pyNastran
(op2_interface/read_matrix.py) read it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from suboctave.errors import InputError
from suboctave.structures.columns import Columns, by_name
from suboctave.structures.contents import Contents
from suboctave.structures.fortran import Records

#: words of the date, with which a file begins that has a label
_DATE = 3
#: words of a trailer: a number, columns, rows, form, type of the matrix, and two more
_TRAILER = 7


def read_op2(path: Path) -> Contents:
    """All matrices of an .op2 file, but for those of MATPOOL."""
    records = Records(path, {4: 4, 8: 8})
    if not records.order:
        raise InputError(f"{path.name} is no OUTPUT2 file: it does not begin with a record of one number")
    key = _key(records)
    if key == _DATE:
        for _ in range(3):  # date, tape label, version
            records.next()
            key = _key(records)
        _expect(records, key, -1)
        _expect(records, _key(records), 0)
        key = _key(records) if records.more else 0
    blocks: list[Columns | None] = []
    while key:
        blocks.append(_data_block(records))
        key = _key(records) if records.more else 0
    matrices = by_name((block for block in blocks if block is not None), path.name)
    if not matrices:
        raise InputError(
            f"{path.name} holds no matrix such as KGG; write them to .op4, or punch them (EXTOUT, DMIGPCH)"
        )
    return Contents(matrices)


def _data_block(records: Records) -> Columns | None:
    """The matrix of a data block, None for a table; the key before its name is read."""
    name = "".join(records.next().replace(b"\0", b" ").decode("ascii", "replace").split())
    _expect(records, _key(records), -1)
    _expect(records, _key(records), _TRAILER)
    trailer = records.whole(_TRAILER)
    for key in (-2, 1, 0):
        _expect(records, _key(records), key)
    while _key(records) > 0:  # the name once more; the key after it is -3
        records.next()
    _expect(records, _key(records), 1)
    if not _key(records):
        _pass_over(records)
        return None
    matrix = Columns(name, trailer[2], trailer[1], trailer[3], trailer[4], records.file)
    number = records.kind("f") if matrix.type % 2 else records.kind("f", 8)
    column = 0
    while True:
        column += 1
        while _key(records) > 0:
            record = records.next()
            row = int(np.frombuffer(record[: records.size], records.kind("i"))[0])
            matrix.add(row, column, np.frombuffer(record[records.size :], number))
        _expect(records, _key(records), 1)
        if not _key(records):
            break
    _expect(records, _key(records), 0)
    return matrix


def _pass_over(records: Records) -> None:
    """What is left of a table, of which the first part is to come."""
    while _key(records) > 0:
        records.next()
        while _key(records) > 0:
            records.next()
        _expect(records, _key(records), 1)
        _expect(records, _key(records), 0)


def _key(records: Records) -> int:
    return records.whole(1)[0]


def _expect(records: Records, key: int, wanted: int) -> None:
    if key != wanted:
        raise InputError(f"{records.file} is damaged: the number {key} where {wanted} is due")
