"""Unformatted records of Fortran, as Nastran writes its binary files: each with its length before and after it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError


class Records:
    """The records of a file, one after the other.

    Raises `InputError` where a record is not complete, or longer or shorter than asked for.

    path
        The file.
    first
        Bytes of its first record, and with it those of a word: {24: 4, 48: 8}.
    """

    def __init__(self, path: Path, first: dict[int, int]) -> None:
        self._data = path.read_bytes()
        self._at = 0
        self.file = path.name
        #: byte order, as NumPy writes it; empty where the file has no such records
        self.order = next((order for order in "<>" if self._length(order) in first), "")
        self.size = first[self._length(self.order)] if self.order else 0

    def _length(self, order: str) -> int:
        return int.from_bytes(self._data[self._at : self._at + 4], "little" if order == "<" else "big", signed=True)

    @property
    def more(self) -> bool:
        """Whether there is another record."""
        return self._at < len(self._data)

    def kind(self, letter: str, size: int | None = None) -> np.dtype[Any]:
        """The type of whole ("i") or other ("f") numbers of the file, of a word unless `size` says how long."""
        return np.dtype(f"{self.order}{letter}{self.size if size is None else size}")

    def next(self) -> bytes:
        """The next record."""
        begin = self._at + 4
        end = begin + self._length(self.order)
        length = self._data[self._at : begin]
        if end < begin or len(length) < 4 or self._data[end : end + 4] != length:
            raise InputError(f"{self.file} is damaged or cut off: no complete record begins at byte {self._at}")
        self._at = end + 4
        return self._data[begin:end]

    def whole(self, count: int) -> list[int]:
        """The next record, of `count` whole numbers."""
        record = self.next()
        if len(record) != count * self.size:
            raise InputError(
                f"{self.file} is damaged: {len(record)} bytes before byte {self._at}, not {count} whole numbers"
            )
        return [int(number) for number in np.frombuffer(record, self.kind("i"))]
