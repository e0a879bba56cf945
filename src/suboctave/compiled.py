"""Numba kernels: compiled once, kept in Numba's cache, and loaded from there by every later process.

`suboctave compile` compiles all of them, and set-up runs it. A kernel that is not in the cache is compiled when it is
first called, and one line on standard error says what the process waits for. Nothing else decides which code runs: the
same input gives the same bits in every process.

The cache is the folder `__pycache__` beside the sources where that can be written, else Numba's folder in the user's
directory for caches (`NUMBA_CACHE_DIR` names another); where none can be written every process compiles for itself.
What has been compiled serves as long as the files of a kernel, and of all that it calls, are what they were.
With `NUMBA_DISABLE_JIT=1` kernels are the Python functions that they are written as.
"""

from __future__ import annotations

import gc
import pickle
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core import event

_Function = TypeVar("_Function", bound=Callable[..., Any])

#: all kernels that have been imported, as Numba's dispatchers
KERNELS: list[Any] = []

#: LLVM's level of optimisation and whether it makes vectors of loops: with `fastmath`, and without
_THOROUGH = (config.OPT, config.LOOP_VECTORIZE)
_SWIFT = (type(config.OPT)(min(int(config.OPT), 1)), 0)

_WAITING = (
    "suboctave compiles code that is not in its cache yet: some seconds, once only (`suboctave compile` compiles "
    "everything beforehand)"
)
_NO_CACHE = (
    "suboctave can write neither beside its sources nor into the user's directory for caches: every process compiles "
    "anew. NUMBA_CACHE_DIR names a folder that can be written"
)
_printed: set[str] = set()


def _print_once(text: str) -> None:
    if text not in _printed:
        _printed.add(text)
        print(text, file=sys.stderr, flush=True)


def without_notice() -> None:
    """Let this process compile without the line that says so: for those who have asked for it."""
    _printed.add(_WAITING)


class _Compilation(event.Listener):
    """Compiles a kernel with no more effort than its kind repays.

    Loops are put into vector registers in kernels with `fastmath` only: elsewhere that gains nothing measurable, and
    half of LLVM's time would go into it. What a kernel calls has been optimised already. Numba makes millions of small
    objects; collecting garbage among them would take a tenth of the time.
    """

    def __init__(self) -> None:
        #: of every compilation under way, each because of the one before: the settings to come back to
        self._before: list[tuple[Any, ...]] = []

    def on_start(self, event: Any) -> None:
        """Numba is about to compile a function, whosever it is."""
        self._before.append((config.OPT, config.LOOP_VECTORIZE, gc.isenabled()))
        function = event.data["dispatcher"]
        if function.py_func.__module__.startswith("suboctave"):
            _print_once(_WAITING)
            gc.disable()
            fast = bool(function.targetoptions.get("fastmath"))
            config.OPT, config.LOOP_VECTORIZE = _THOROUGH if fast else _SWIFT

    def on_end(self, event: Any) -> None:
        """It has done so, or failed."""
        config.OPT, config.LOOP_VECTORIZE, collecting = self._before.pop()
        if collecting:
            gc.enable()


event.register("numba:compile", _Compilation())


def _files(kernel: Any) -> Any:
    """Numba's index of what it has compiled of a kernel; None of anything else, or where nothing is kept."""
    return getattr(getattr(kernel, "_cache", None), "_cache_file", None)


def _keep_apart(dispatcher: Any, called: list[Any]) -> None:
    """Let the cache know a kernel by the files of all kernels that are in it, not by its own alone, and let what other
    versions have left there, which may name classes that are no more, be as if it were not.
    """
    files = _files(dispatcher)
    if files is None:
        return
    stamps = {files._source_stamp}
    for kernel in called:
        if _files(kernel) is not None:
            stamps.update(_files(kernel)._source_stamp)
    files._source_stamp, load = tuple(sorted(stamps)), files._load_index

    def index() -> Any:
        try:
            return load()
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            return {}

    files._load_index = index


def kernel(**options: Any) -> Callable[[_Function], _Function]:
    """Decorator of a kernel: `numba.njit` with its cache and these options.

    Sums that the compiler may reorder (`fastmath`) are inlined wherever they are called, with all that is around them.
    Else each caller would have a copy beside the original, compiled in other company and so reordered otherwise, and
    which of them runs would depend on what the process has compiled or loaded before.
    """

    def decorate(function: _Function) -> _Function:
        if config.DISABLE_JIT:
            return np.errstate(all="ignore")(function)
        called = [function.__globals__.get(name) for name in function.__code__.co_names]
        inlined = "fastmath" in options or any(getattr(k, "targetoptions", {}).get("forceinline") for k in called)
        try:
            result = njit(cache=True, forceinline=inlined, **options)(function)
            _keep_apart(result, called)
        except RuntimeError:  # no folder for the cache
            _print_once(_NO_CACHE)
            result = njit(forceinline=inlined, **options)(function)
        KERNELS.append(result)
        return result

    return decorate
