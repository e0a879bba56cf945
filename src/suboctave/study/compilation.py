"""`suboctave compile`: all kernels compiled before anybody waits for them.

A record beside what has been compiled says for which sources, versions and processor that was, and by digests that it
is whole: where all of this is as it was there is nothing to do.
"""

from __future__ import annotations

import hashlib
import json
import platform
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any

import llvmlite
import numba

from suboctave import compiled
from suboctave.atomic import replace_file
from suboctave.errors import SuboctaveError
from suboctave.version import __version__
from suboctave.workers import Lost, completed

Report = Callable[[float, str], None]

_PACKAGE = Path(compiled.__file__).parent
#: seconds between changes of the bar
_LOOK = 1.0
#: share of the work from which on the time that is left is worth telling
_KNOWN = 0.1


def _state() -> str:
    """What kernels in the cache are compiled for: sources, versions, processor."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    sources = [(str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in sorted(_PACKAGE.rglob("*.py"))]
    versions = (__version__, platform.python_version(), numba.__version__, llvmlite.__version__)
    processor = (get_host_cpu_name(), get_host_cpu_features().flatten())
    return hashlib.sha256(repr((sources, versions, processor)).encode()).hexdigest()


def _record() -> Path | None:
    """The file that says what has been compiled; None where there is no folder for a cache."""
    try:
        return Path(compiled.Cache(_state, []).cache_path) / "suboctave_compiled.json"
    except RuntimeError:
        return None


def _digest(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()


def _is_compiled(record: Path, state: str) -> bool:
    """Whether everything has been compiled, for what is here now, and is whole."""
    try:
        known: dict[str, Any] = json.loads(record.read_text())
        return known["state"] == state and all(_digest(Path(path)) == d for path, d in known["files"].items())
    except (OSError, ValueError, KeyError, AttributeError):
        return False


def _write(record: Path, state: str) -> None:
    """Remember what has been compiled, and for which state."""
    with suppress(OSError):  # the next call looks again at everything
        folders = {Path(kernel._cache.cache_path) for kernel in compiled.KERNELS}
        files = {str(path): _digest(path) for folder in sorted(folders) for path in sorted(folder.glob("*.nb[ic]"))}
        text = json.dumps({"state": state, "files": files})
        replace_file(record, lambda place: place.write_text(text))


@contextmanager
def _watched(report: Report) -> Iterator[None]:
    """Report meanwhile how much has been compiled: kernels in the cache, by the lengths of their code."""
    lengths = {kernel: len(kernel.py_func.__code__.co_code) for kernel in compiled.KERNELS}
    begin, over = monotonic(), threading.Event()
    there: set[Any] = {kernel for kernel in lengths if kernel._cache.holds_any()}
    work = sum(length for kernel, length in lengths.items() if kernel not in there) or 1

    def watch() -> None:
        while True:
            there.update(kernel for kernel in lengths if kernel not in there and kernel._cache.holds_any())
            left = sum(length for kernel, length in lengths.items() if kernel not in there)
            share, seconds = 1.0 - left / work, monotonic() - begin
            rest = f", about {seconds * (1.0 / share - 1.0):.0f} s left" if share > _KNOWN else ""
            report(share, f"{len(there)} of {len(lengths)} kernels{rest}")
            if over.wait(_LOOK):
                return

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def compile_all(report: Report) -> int:
    """Compile every kernel that is not in the cache; `report(share done, what is left)` is called. Returns how many
    kernels there are, 0 if all had been compiled before.
    """
    record, state = _record(), _state()
    if record is not None and _is_compiled(record, state):
        return 0
    from suboctave.study import computations  # and with it all kernels

    names = [name for name, _ in computations.COMPUTATIONS]
    with _watched(report):
        for number, result in completed(computations.run, range(len(names)), 2):
            if isinstance(result, Lost):
                raise SuboctaveError(f"kernels of {names[number]} were not compiled: {result.words}")
    if record is not None:
        _write(record, state)
    return len(compiled.KERNELS)
