"""What a running computation has so far, on disk at once: records in an SQLite database, one transaction each.

SQLite writes ahead (WAL) and syncs at every transaction: a kill or a power cut at any time leaves whole records only.
Others may read while one process writes. HDF5 files do not survive a power cut while they are written.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from suboctave.errors import InputError, path_of
from suboctave.store.files import pack, unpack

if TYPE_CHECKING:
    import xarray


_TABLE = "suboctave_journal"
#: how journals begin that were no databases yet
_FORMER = b"suboctave journal 1\n"


@dataclass(frozen=True)
class Record:
    """One entry: its kind, its fields (what JSON holds), and its dataset as a block of bytes (empty if it has none)."""

    kind: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    block: bytes = b""

    @property
    def dataset(self) -> xarray.Dataset:
        """The dataset that was stored."""
        return unpack(self.block)


def read_journal(path: str | Path) -> list[Record]:
    """The records of a journal, which another process may be writing.

    Raises InputError where the file is missing or no journal.
    """
    source = path_of(path)
    if not source.is_file():
        raise InputError(f"cannot read {source}: there is no such file")
    with closing(_connected(source, "ro")) as database:
        return _records(database)


class Journal:
    """A journal open for appending, by one process at a time; use `create` or `reopen`."""

    def __init__(self, path: Path, lock: BinaryIO) -> None:
        self.path = path
        self._lock = lock
        try:
            self._database = _connected(path, "rw")
        except BaseException:
            lock.close()
            raise
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")
        self._database.execute(
            f"CREATE TABLE IF NOT EXISTS {_TABLE} (number INTEGER PRIMARY KEY, kind TEXT, fields TEXT, block BLOB)"
        )

    @classmethod
    def create(cls, path: str | Path) -> Journal:
        """A new journal; InputError if there is one already."""
        place = path_of(path)
        try:
            return cls(place, _locked(place, "xb"))
        except FileExistsError:
            raise InputError(f"{place} exists: a run that did not finish left it, or one is under way") from None

    @classmethod
    def reopen(cls, path: str | Path) -> Journal:
        """The journal of an earlier run."""
        place = path_of(path)
        return cls(place, _locked(place, "r+b"))

    @property
    def records(self) -> list[Record]:
        """All that it holds, in the order in which it was appended."""
        return _records(self._database)

    def append(self, kind: str, fields: Mapping[str, Any] | None = None, dataset: xarray.Dataset | None = None) -> None:
        """Write one record, on the disk when this returns."""
        self.extend([(kind, fields or {}, dataset)])

    def extend(self, entries: list[tuple[str, Mapping[str, Any], xarray.Dataset | None]]) -> None:
        """Write records, each of kind, fields and dataset, all of them or none; on the disk when this returns."""
        rows = [
            (kind, json.dumps(dict(fields), ensure_ascii=False), b"" if dataset is None else pack(dataset))
            for kind, fields, dataset in entries
        ]
        try:
            with self._database:
                self._database.executemany(f"INSERT INTO {_TABLE} (kind, fields, block) VALUES (?, ?, ?)", rows)
        except sqlite3.OperationalError as error:  # no space is left, ...
            raise OSError(f"cannot write {self.path}: {error}") from None

    def close(self) -> None:
        """Close it; the file stays."""
        self._database.close()
        self._lock.close()  # last: to close any handle of the file gives up SQLite's own locks

    def remove(self) -> None:
        """Close it and delete the file: everything is elsewhere."""
        self.close()
        for suffix in ("", "-wal", "-shm"):
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)


def _connected(place: Path, mode: str) -> sqlite3.Connection:
    """The database of a journal; InputError where the file is something else."""
    database = None
    try:
        database = sqlite3.connect(f"{place.absolute().as_uri()}?mode={mode}", uri=True)
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if tables <= {_TABLE}:
            return database
    except sqlite3.OperationalError as error:
        raise InputError(f"cannot read {place}: {error}") from None
    except sqlite3.DatabaseError:
        pass
    if database is not None:
        database.close()
    with open(place, "rb") as file:
        if file.read(len(_FORMER)) == _FORMER:
            raise InputError(
                f"{place} is the journal of an earlier version of suboctave, which this one does not read: finish it "
                "with that version, or delete the file and start anew"
            )
    raise InputError(f"{place} is no journal of suboctave; move it away, or name another folder")


def _records(database: sqlite3.Connection) -> list[Record]:
    if database.execute("SELECT 1 FROM sqlite_master").fetchone() is None:  # killed before there was a table
        return []
    rows = database.execute(f"SELECT kind, fields, block FROM {_TABLE} ORDER BY number")
    return [Record(kind, json.loads(fields), block) for kind, fields, block in rows]


def _locked(place: Path, mode: str) -> BinaryIO:
    """The open file, which no other process may write; the lock goes with the process."""
    try:
        file: Any = open(place, mode)  # noqa: SIM115 - it stays open
    except FileExistsError:
        raise
    except OSError as error:
        raise InputError(f"cannot write {place}: {error.strerror}") from None
    try:
        import fcntl
    except ImportError:  # not a POSIX system
        return file
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise InputError(f"{place} is being written by another run: wait for it, or use another folder") from None
    return file
