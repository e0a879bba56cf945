"""Nastran's binary files, byte by byte as their manuals lay them out.

MSC Nastran DMAP Programmer's Guide, "OUTPUT4" and "OUTPUT2"; the keys of the latter as pyYeti (nastran/op2.py) and
pyNastran (op2_interface/read_matrix.py) read them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Machine:
    """Byte order ("<", ">") and bytes of a word (4, 8)."""

    order: str = "<"
    size: int = 4

    def whole(self, *numbers: int) -> bytes:
        return struct.pack(f"{self.order}{len(numbers)}{'iq'[self.size == 8]}", *numbers)

    def record(self, *parts: bytes) -> bytes:
        """A record of Fortran: its length before and after it."""
        data = b"".join(parts)
        length = struct.pack(f"{self.order}i", len(data))
        return length + data + length

    def key(self, *numbers: int) -> bytes:
        return b"".join(self.record(self.whole(number)) for number in numbers)

    def text(self, name: str, words: int = 2) -> bytes:
        """Four characters a word, blanks behind them in one of eight bytes."""
        groups = [name.ljust(4 * words)[4 * i : 4 * i + 4] for i in range(words)]
        return "".join(group.ljust(self.size) for group in groups).encode()

    def values(self, values: np.ndarray, single: bool) -> bytes:
        size = self.size if single else 8
        if np.iscomplexobj(values):
            values = np.stack([values.real, values.imag], axis=1).ravel()
        return values.astype(f"{self.order}f{size}").tobytes()


def runs(column: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Row of the first value, from 1, and values, of what is not zero in a column."""
    rows = np.flatnonzero(column)
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        if len(part):
            yield int(part[0]) + 1, column[part]


def kind_of(matrix: np.ndarray, single: bool) -> int:
    return (1 if single else 2) + 2 * np.iscomplexobj(matrix)


def output4(
    matrices: Mapping[str, np.ndarray], form: str = "dense", single: bool = False, machine: Machine | None = None
) -> bytes:
    """An .op4 file of matrices in form "dense", "sparse", or "big", sparse with two words before each string."""
    m = machine or Machine()
    data = b""
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        shape = m.whole(columns, -rows if form == "big" else rows, 6, kind_of(matrix, single))
        data += m.record(shape, m.text(name))
        for j in range(columns):
            if form == "dense":
                nonzero = np.flatnonzero(matrix[:, j])
                parts = [(int(nonzero[0]) + 1, matrix[nonzero[0] : nonzero[-1] + 1, j])] if len(nonzero) else []
            else:
                parts = list(runs(matrix[:, j]))
            body, row = b"", 0
            for first, entries in parts:
                values = m.values(entries, single)
                length = len(values) // m.size + 1
                if form == "dense":
                    row = first
                else:
                    body += m.whole(length, first) if form == "big" else m.whole(first + 65536 * length)
                body += values
            if parts:
                data += m.record(m.whole(j + 1, row, len(body) // m.size), body)
        data += m.record(m.whole(columns + 1, 1, 1), m.values(np.ones(1), single))
    return data


def output2(
    matrices: Mapping[str, np.ndarray],
    single: bool = False,
    machine: Machine | None = None,
    label: bool = True,
    tables: bool = True,
) -> bytes:
    """An .op2 file of matrices, with the label of a tape or without; `tables` puts one before them and one behind."""
    m = machine or Machine()
    data = b""
    if label:
        for words, what in (
            (3, m.whole(11, 25, 26)),
            (7, m.text("NASTRAN FORT TAPE ID CODE - ", 7)),
            (2, m.text("NX", 2)),
        ):
            data += m.key(words) + m.record(what)
        data += m.key(-1, 0)
    data += table("GEOM1S", m) if tables else b""
    for number, (name, matrix) in enumerate(matrices.items()):
        rows, columns = matrix.shape
        trailer = m.whole(101 + number, columns, rows, 6, kind_of(matrix, single), 2 * rows, 5000)
        data += _beginning(name, trailer, m)
        for j in range(columns):
            data += m.key(-3 - j, 1, 1)
            for first, entries in runs(matrix[:, j]):
                values = m.values(entries, single)
                data += m.key(len(values) // m.size) + m.record(m.whole(first), values)
        data += m.key(-3 - columns, 1, 0, 0)
    return data + (table("BGPDTS", m) if tables else b"") + m.key(0)


def table(name: str, m: Machine) -> bytes:
    """A data block of two parts that is no matrix."""
    data = _beginning(name, m.whole(102, 5, 0, 0, 0, 0, 0), m) + m.key(-3, 1, 0)
    data += m.key(3) + m.record(m.whole(4501, 45, 1)) + m.key(2) + m.record(m.whole(7, 8))
    data += m.key(-4, 1, 0) + m.key(1) + m.record(m.whole(9))
    return data + m.key(-5, 1, 0, 0)


def _beginning(name: str, trailer: bytes, m: Machine) -> bytes:
    data = m.key(2) + m.record(m.text(name)) + m.key(-1, 7) + m.record(trailer)
    return data + m.key(-2, 1, 0, 4) + m.record(m.text(name), m.whole(170, 170))
