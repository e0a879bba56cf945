"""Numba kernels: compiled once, kept in Numba's cache, and loaded from there by every later process.

`suboctave compile` compiles all of them, and set-up runs it. A kernel that is not in the cache is compiled when it is
first called, and one line on standard error, or a bar in a notebook, says what the process waits for. Nothing else
decides which code runs: the same input gives the same bits in every process.

The cache is the folder `__pycache__` beside the sources where that can be written, else Numba's folder in the user's
directory for caches (`NUMBA_CACHE_DIR` names another); where none can be written every process compiles for itself.
Several processes compile a kernel once: the others wait for it.
What has been compiled serves as long as the files of a kernel, and of all that it calls, are what they were, and as
long as its own file is whole: a digest tells, and what is damaged is compiled anew. Ctrl-C waits until a compilation is
over, for it would leave Numba's compiler in a state in which it compiles nothing any more.
With `NUMBA_DISABLE_JIT=1` kernels are the Python functions that they are written as.
"""

from __future__ import annotations

import copy
import gc
import hashlib
import itertools
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numpy as np
from numba import config, njit
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.misc import unliteral

from suboctave.progress import notebook_line
from suboctave.session import in_notebook

_Function = TypeVar("_Function", bound=Callable[..., Any])

#: all kernels that have been imported, as Numba's dispatchers
KERNELS: list[Any] = []

#: the same, by module and name; and by its symbol, each that other kernels call, with the types of its arguments
_NAMED: dict[str, Any] = {}
_CALLED: dict[str, tuple[str, Any]] = {}

#: LLVM's level of optimisation and whether it makes vectors of loops: with `fastmath`, and without
_THOROUGH = (config.OPT, config.LOOP_VECTORIZE)
_SWIFT = (type(config.OPT)(min(int(config.OPT), 1)), 0)

_WAITING = "suboctave compiles its kernels, once: up to a minute (`suboctave compile` compiles all of them beforehand)"
_NO_CACHE = (
    "suboctave can write neither beside its sources nor into the user's directory for caches: every process compiles "
    "anew. NUMBA_CACHE_DIR names a folder that can be written"
)
_printed: set[str] = set()


def _print_once(text: str) -> None:
    if text not in _printed:
        _printed.add(text)
        print(text, file=sys.stderr, flush=True)


class _Waiting:
    """What a process shows while it compiles: one line on standard error, once; in a notebook, where that would be a
    red box, a bar that runs while something is compiled.
    """

    def __init__(self) -> None:
        self.silent = False
        #: functions compiled, seconds spent, and where a notebook shows them
        self._count, self._seconds, self._begun = 0, 0.0, 0.0
        self._line: Callable[[str, bool], None] | None = None

    def begins(self) -> None:
        """A compilation begins that is no part of another one."""
        if self.silent:
            return
        if not in_notebook():
            _print_once(_WAITING)
            return
        self._begun, self._line = monotonic(), self._line or notebook_line()
        self._line(_WAITING, True)

    def ends(self) -> None:
        """It is over."""
        if self._line is not None:
            self._count, self._seconds = self._count + 1, self._seconds + monotonic() - self._begun
            self._line(f"suboctave has compiled {self._count} of its kernels in {self._seconds:.0f} s, once", False)


_waiting = _Waiting()


def notice() -> None:
    """Say what this process waits for, which another one compiles."""
    _waiting.begins()
    _waiting.ends()


def without_notice() -> None:
    """Let this process compile without a word: for those who have asked for it."""
    _waiting.silent = True


class _Compilation(event.Listener):
    """Compiles a kernel with no more effort than its kind repays.

    Loops are put into vector registers in kernels with `fastmath` only: elsewhere that gains nothing measurable, and
    half of LLVM's time would go into it. Numba makes millions of small objects; collecting garbage among them would
    take a tenth of the time.
    """

    def __init__(self) -> None:
        #: of every compilation under way, each because of the one before: the settings to come back to
        self._before: list[tuple[Any, ...]] = []

    def on_start(self, event: Any) -> None:
        """Numba is about to compile a function, whosever it is."""
        function = event.data["dispatcher"]
        own = function.py_func.__module__.startswith("suboctave")
        outermost = own and not any(before[-1] for before in self._before)
        self._before.append((config.OPT, config.LOOP_VECTORIZE, gc.isenabled(), own))
        if own:
            if outermost:
                _waiting.begins()
            gc.disable()
            fast = bool(function.targetoptions.get("fastmath"))
            config.OPT, config.LOOP_VECTORIZE = _THOROUGH if fast else _SWIFT

    def on_end(self, event: Any) -> None:
        """It has done so, or failed."""
        config.OPT, config.LOOP_VECTORIZE, collecting, own = self._before.pop()
        if collecting:
            gc.enable()
        if own and not any(before[-1] for before in self._before):
            _waiting.ends()


event.register("numba:compile", _Compilation())


class _Files(IndexDataCacheFile):
    """The files of a kernel: an index of what has been compiled by the types of its arguments, and a file for each.

    Each begins with a digest of the rest. What is damaged, cannot be read, or is of another version or other sources,
    is as if it were not there. What cannot be written is left.
    """

    #: length of a digest
    _DIGEST = 16

    def save(self, key: Any, data: Any) -> None:
        """Keep what has been compiled."""
        names = self._names()
        if key not in names:
            names[key] = next(name for n in itertools.count(1) if (name := self._data_name(n)) not in names.values())
        try:
            self._write(self._data_path(names[key]), key, data)
            self._write(self._index_path, None, names)
        except OSError:
            _print_once(_NO_CACHE)

    def load(self, key: Any) -> Any:
        """What has been compiled, None if there is nothing."""
        name = self._names().get(key)
        return None if name is None else self._read(self._data_path(name), key)

    def flush(self) -> None:
        """Forget what has been compiled."""
        self._write(self._index_path, None, {})

    def _names(self) -> dict[Any, str]:
        """The index."""
        return self._read(self._index_path, None) or {}

    def _write(self, path: str, key: Any, content: Any) -> None:
        block = self._dump((self._version, self._source_stamp, key, content))
        try:
            with self._open_for_write(path) as file:
                file.write(self._digest(block) + block)
        except BaseException:
            for left in Path(path).parent.glob(f"{Path(path).name}.tmp.*"):
                left.unlink(missing_ok=True)
            raise

    def _read(self, path: str, key: Any) -> Any:
        try:
            whole = Path(path).read_bytes()
            digest, block = whole[: self._DIGEST], whole[self._DIGEST :]
            if digest != self._digest(block):
                return None
            version, stamp, kept, content = pickle.loads(block)
        except Exception:  # of whatever kind: unpickling may raise anything
            return None
        return content if (version, stamp, kept) == (self._version, self._source_stamp, key) else None

    @classmethod
    def _digest(cls, block: bytes) -> bytes:
        return hashlib.blake2b(block, digest_size=cls._DIGEST).digest()


class _Kept(CompileResultCacheImpl):
    """What is kept of a kernel: its code, and which kernels that calls."""

    def reduce(self, result: Any) -> Any:
        """What can be pickled."""
        symbols = {function.name for function in result.library._final_module.functions if function.is_declaration}
        return [called for symbol, called in _CALLED.items() if symbol in symbols], super().reduce(result)

    def rebuild(self, target: Any, kept: Any) -> Any:
        """The kernel, after those that it calls."""
        called, result = kept
        for name, types in called:
            _NAMED[name].compile(types)
        return super().rebuild(target, result)


class Cache(FunctionCache):
    """Numba's cache of a kernel, which is known by the files of all kernels that are in it, not by its own alone."""

    _impl_class = _Kept

    def __init__(self, function: Callable[..., Any], called: list[Any]) -> None:
        super().__init__(function)
        stamps = {self._impl.locator.get_source_stamp()}
        for kernel in called:
            stamps.update(getattr(getattr(kernel, "_cache", None), "stamps", ()))
        self.stamps = tuple(sorted(stamps))
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, self.stamps)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Let other processes wait that would compile the same, and find it here then; without a word where files
        cannot be locked.
        """
        # the compiler before the file: no thread waits for a file while it holds what another one needs
        with global_compiler_lock, ExitStack() as held:
            with suppress(ImportError, OSError):
                import fcntl

                place = Path(f"{self._cache_file._index_path}.lock")
                place.parent.mkdir(parents=True, exist_ok=True)
                file = held.enter_context(place.open("ab"))  # which lets the lock go when it is closed
                fcntl.flock(file, fcntl.LOCK_EX)
            yield

    def holds(self, signature: Any, target: Any) -> bool:
        """Whether something that was compiled for these types is kept."""
        return self._cache_file.load(self._index_key(signature, target.codegen())) is not None

    def holds_any(self) -> bool:
        """Whether anything that was compiled is kept."""
        return bool(self._cache_file._names())

    def load_overload(self, signature: Any, target: Any) -> Any:
        """What has been compiled for these types; None where there is nothing that this process can use."""
        try:
            return super().load_overload(signature, target)
        except Exception:  # code of another processor or compiler: rebuilding it may raise anything
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep what has been compiled, where that can be written."""
        try:
            super().save_overload(signature, data)
        except OSError:  # no folder
            _print_once(_NO_CACHE)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait until this is over."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    arrived: list[tuple[int, Any]] = []
    signal.signal(signal.SIGINT, lambda number, frame: arrived.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if arrived:
            before(*arrived[0])


def cached(**options: Any) -> Callable[[_Function], Any]:
    """Decorator of a function that is compiled when it is first called: `numba.njit` with the cache of this module."""

    def decorate(function: _Function) -> Any:
        result = njit(**options)(function)
        if config.DISABLE_JIT:
            return result
        called = [function.__globals__.get(name) for name in function.__code__.co_names]
        try:
            result._cache = Cache(function, called)
        except RuntimeError:  # no folder for the cache
            _print_once(_NO_CACHE)
        else:
            compile_one, cache = result.compile, result._cache

            def alone(signature: Any) -> Any:
                with cache.alone():
                    return compile_one(signature)

            result.compile = alone
        compile_for = result._compile_for_args

        def uninterrupted(*arguments: Any, **named: Any) -> Any:
            with _uninterrupted():
                return compile_for(*arguments, **named)

        result._compile_for_args = uninterrupted
        template = result.get_call_template
        # for every literal among its arguments a kernel would be compiled anew
        result.get_call_template = lambda arguments, named: template(
            tuple(map(unliteral, arguments)), {name: unliteral(kind) for name, kind in named.items()}
        )
        return result

    return decorate


def _called_by_symbol(function: Any, name: str) -> None:
    """Have kernels call this one where it is.

    Numba would put a copy into each of its callers, and so on upwards, and optimise it anew in each. Where sums may be
    reordered (`fastmath`), each copy would be another function, and which of them runs would depend on what the process
    has compiled or loaded before.
    """
    add_overload, target = function.add_overload, function.targetctx

    def add(result: Any) -> None:
        add_overload(result)
        types = result.signature.args
        symbol = f"{name}.{hashlib.blake2b(str(types).encode(), digest_size=8).hexdigest()}"
        llvm.add_symbol(symbol, result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
        _CALLED[symbol] = name, types
        elsewhere = copy.copy(result.fndesc)
        elsewhere.mangled_name = symbol
        target.remove_user_function(result.entry_point)
        target.insert_user_function(result.entry_point, elsewhere)

    function.add_overload = add


def kernel(*, inner: bool = False, **options: Any) -> Callable[[_Function], Any]:
    """Decorator of a kernel: `cached` with these options; a quotient by zero is not finite, without an exception.

    One that only other kernels call is `inner`: a seventh of the time to compile it would go into making it callable
    from Python. What innermost loops call takes `forceinline` and becomes a part of each caller: arrays are counted at
    every call by symbol.
    """

    def decorate(function: _Function) -> Any:
        if config.DISABLE_JIT:
            return np.errstate(all="ignore")(function)
        name = f"{function.__module__}.{function.__name__}"
        usual = {"error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True, "no_cpython_wrapper": inner}
        result = cached(**usual | options)(function)
        if inner:

            def refuse(*_: Any, **__: Any) -> None:
                raise TypeError(f"{name} is called by kernels only: it is `inner`")

            result._compile_for_args, result._insert = refuse, lambda *_: None
        if not options.get("forceinline"):
            _called_by_symbol(result, name)
        _NAMED[name] = result
        KERNELS.append(result)
        return result

    return decorate
