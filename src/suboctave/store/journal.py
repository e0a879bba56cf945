"""What a running study has found so far, on disk at once: records appended to a file, each with its own checksum.

The file begins with a line that names it. A record is the length of its body (8 bytes), the first 16 bytes of the
body's SHA-256, and the body: a line of JSON, then, where there is one, a dataset as a block (`blocks`). A process that
is killed can only leave a torn last record; whatever follows the last whole record is dropped when the journal is
opened again.
NetCDF would not do here: HDF5 files do not survive a power cut while they are written.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from suboctave.errors import InputError, path_of
from suboctave.store.blocks import pack, unpack

if TYPE_CHECKING:
    import xarray

__all__ = ["Journal", "Record", "read_journal"]

_MAGIC = b"suboctave journal 1\n"
_LENGTH, _CHECK = 8, 16


@dataclass(frozen=True)
class Record:
    """One entry: what it is, what it says, and its dataset as a block of bytes (empty if it has none)."""

    kind: str
    said: Mapping[str, Any] = field(default_factory=dict)
    block: bytes = b""

    @property
    def dataset(self) -> xarray.Dataset:
        """The dataset that was stored."""
        return unpack(self.block)


def read_journal(path: str | Path) -> tuple[list[Record], int, bool]:
    """The whole records of a journal, where they end (bytes), and whether something torn followed.

    Raises InputError where the file is missing or no journal.
    """
    source = path_of(path)
    try:
        content = source.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror}") from None
    if not content.startswith(_MAGIC):
        if _MAGIC.startswith(content):  # killed while the first line was written
            return [], 0, bool(content)
        raise InputError(f"{source} is no journal of suboctave; move it away, or name another folder")
    records: list[Record] = []
    end = len(_MAGIC)
    while (record := _record_at(content, end)) is not None:
        records.append(record[0])
        end = record[1]
    return records, end, end < len(content)


def _record_at(content: bytes, place: int) -> tuple[Record, int] | None:
    body_at = place + _LENGTH + _CHECK
    if body_at > len(content):
        return None
    end = body_at + int.from_bytes(content[place : place + _LENGTH], "little")
    body = content[body_at:end]
    if end > len(content) or hashlib.sha256(body).digest()[:_CHECK] != content[place + _LENGTH : body_at]:
        return None
    line, _, block = body.partition(b"\n")
    try:
        said = json.loads(line)
        return Record(said.pop("kind"), said, block), end
    except (ValueError, KeyError, AttributeError):
        return None


class Journal:
    """A journal open for appending, by one process at a time; use `create` or `reopen`."""

    def __init__(self, path: Path, file: BinaryIO, records: list[Record], torn: bool = False) -> None:
        self.path = path
        self.records = records
        self.torn = torn
        self._file = file

    @classmethod
    def create(cls, path: str | Path) -> Journal:
        """A new journal; InputError if there is one already."""
        place = path_of(path)
        try:
            file = open(place, "xb")  # noqa: SIM115 - it stays open
        except FileExistsError:
            raise InputError(f"{place} exists: a run that did not finish left it, or one is under way") from None
        except OSError as error:
            raise InputError(f"cannot write {place}: {error.strerror}") from None
        _lock(file, place)
        file.write(_MAGIC)
        journal = cls(place, file, [])
        journal._sync()
        return journal

    @classmethod
    def reopen(cls, path: str | Path) -> Journal:
        """The journal of an earlier run, its torn end cut off."""
        place = path_of(path)
        records, end, torn = read_journal(place)
        try:
            file = open(place, "r+b")  # noqa: SIM115 - it stays open
        except OSError as error:
            raise InputError(f"cannot write {place}: {error.strerror}") from None
        _lock(file, place)
        file.truncate(end)
        file.seek(end)
        if not end:
            file.write(_MAGIC)
        journal = cls(place, file, records, torn)
        journal._sync()
        return journal

    def append(
        self, kind: str, said: Mapping[str, Any] | None = None, dataset: xarray.Dataset | None = None, sync: bool = True
    ) -> None:
        """Write one record; with `sync` it is on the disk when this returns, else in the system's hands."""
        said = dict(said or {})
        block = b"" if dataset is None else pack(dataset)
        body = json.dumps({"kind": kind, **said}, ensure_ascii=False).encode() + b"\n" + block
        check = hashlib.sha256(body).digest()[:_CHECK]
        self._file.write(len(body).to_bytes(_LENGTH, "little") + check + body)
        if sync:
            self._sync()
        else:
            self._file.flush()
        self.records.append(Record(kind, said, block))

    def close(self) -> None:
        """Close it; the file stays."""
        self._file.close()

    def remove(self) -> None:
        """Close it and delete the file: everything is elsewhere."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())


def _lock(file: BinaryIO, place: Path) -> None:
    """Refuse a journal that another process is writing; the lock goes with the process."""
    try:
        import fcntl
    except ImportError:  # not a POSIX system
        return
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise InputError(f"{place} is being written by another run: wait for it, or use another folder") from None
