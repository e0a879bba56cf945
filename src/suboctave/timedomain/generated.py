"""Generated code in files of its own, so that what Numba makes of it is kept between processes.

A file is named by a digest of its content and of everything that its meaning depends on: the same text is never
compiled twice, and never taken for another. It is written beside its place and renamed, so that several processes may
do so at once; where nothing can be written, a directory of this process serves.

The directory is `$SUBOCTAVE_CACHE`, else `suboctave` in the user's directory for caches.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from pathlib import Path
from types import ModuleType

from suboctave.version import __version__

__all__ = ["module_of"]

_lock = threading.Lock()


@functools.cache
def _directory() -> Path:
    """Where generated files are kept; made if it is not there."""
    given = os.environ.get("SUBOCTAVE_CACHE")
    if given:
        place = Path(given)
    elif sys.platform == "win32":
        place = Path(os.environ.get("LOCALAPPDATA", Path.home())) / "suboctave"
    else:
        place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "suboctave"
    try:
        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=place):
            pass
    except (OSError, RuntimeError):
        place = Path(tempfile.mkdtemp(prefix="suboctave-"))
    return place


@functools.cache
def _ground() -> bytes:
    """What the meaning of every generated text depends on: versions, and the functions that it calls."""
    import numba

    names = ("elementary.py", "adaptive_control.py", "tangent_control.py")
    called = [Path(__file__).with_name(name).read_bytes() for name in names]
    return b"\0".join([__version__.encode(), numba.__version__.encode(), *called])


def module_of(source: str) -> ModuleType:
    """The module with this text; its compiled functions are found again by later processes."""
    digest = hashlib.sha256(_ground() + b"\0" + source.encode()).hexdigest()[:32]
    name = f"suboctave_generated_{digest}"
    with _lock:
        if name in sys.modules:
            return sys.modules[name]
        path = _directory() / f"{name}.py"
        if not path.exists() or path.read_text(encoding="utf-8") != source:
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(source)
            os.replace(temporary, path)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
        return module
