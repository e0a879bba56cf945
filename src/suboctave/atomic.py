"""Files that are there as a whole or not at all: written beside their place, synced to the disk, renamed."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from suboctave.errors import InputError, path_of


def free_place(path: str | Path, overwrite: bool = False, suffixes: tuple[str, ...] = ()) -> Path:
    """The path, if a file can be written there; found out before any work.

    Raises InputError where a file exists and `overwrite` is not given, or the folder is missing or not writable.
    """
    target = path_of(path)
    if suffixes and target.suffix.lower() not in suffixes:
        raise InputError(f"{target}: the name must end in {' or '.join(suffixes)}")
    if target.is_dir():
        raise InputError(f"{target} is a folder, not a file")
    if target.exists() and not overwrite:
        raise InputError(
            f"{target} exists and is left as it is: choose another name, or overwrite it on purpose "
            "(overwrite=True, --overwrite)"
        )
    folder = target.parent
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: make it, or write elsewhere")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"the folder {folder} is not writable: write elsewhere, or ask for the right to")
    return target


def _cannot_write(target: Path, error: OSError) -> OSError:
    """The same failure by the name of the file that was asked for: a disk is full, a name is too long, ..."""
    number = error.errno
    if number is None and (stated := re.search(r"errno = (\d+)", str(error))):  # as the HDF5 library says it
        number = int(stated[1])
    if number is not None:
        return OSError(number, f"cannot write it: {os.strerror(number)}", str(target))
    return OSError(f"cannot write {target}: {' '.join(str(error).split())}")


def replace_file(target: Path, make: Callable[[Path], Any]) -> None:
    """Have `make(path)` write a file beside `target`, sync it to the disk and rename it: all of it, or nothing."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}-", suffix=".part", dir=target.parent)
    except OSError as error:
        raise _cannot_write(target, error) from error
    os.close(handle)
    try:
        make(Path(name))
        with open(name, "rb+") as written:
            os.fsync(written.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, target)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _cannot_write(target, error) from error
        raise
    if os.name == "posix":
        handle = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
