"""Numba kernels that are compiled when they are worth it.

Compiling a kernel takes some tenths of a second, the first curve of a fresh installation calls a hundred of them, and
most cost less there than their compilation would. So a kernel first runs as the Python function that it is:

- kernels marked `QUICK` are compiled almost at once, all others when they have cost `PATIENCE` seconds, but `LESS` from
  the second computation of a process on and where an earlier process has compiled others;
- a kernel waits until those that it calls are compiled;
- compilation has an allowance, `CREDIT` seconds at first, that grows by `SHARE` of the time in which nothing is
  compiled: however much there is to compile, nobody waits for it all at one go;
- kernels that take seconds of their own (`alone`) wait until that allowance is whole.

What was compiled before, in this process or an earlier one, is used from the first call (Numba's cache). Small
kernels whose arithmetic would differ (sums that the compiler may reorder, complex roots, sines and cosines of the
same angle) are compiled at once, so that both forms agree bit by bit; but where a kernel is compiled into a larger
one the last bit may still change, for rounded laws and several degrees of freedom, until everything is compiled.

All seconds are processor time of the thread: a busy machine changes nothing.

Several threads may compute at once: whatever asks Numba's cache or compiler, or changes what a kernel is, holds the
lock of that compiler, and looks again once it has it.
"""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher

_Function = TypeVar("_Function", bound=Callable[..., Any])

#: seconds that a kernel may cost before it is compiled: in general, where others have been compiled before, and if it
#: is called by the hundred for every motion
PATIENCE, LESS, QUICK = 1.0, 0.03, 0.02
#: seconds of compilation that may follow each other, and what every second of other work adds to what is left of them
CREDIT, SHARE = 2.5, 0.7
#: share of the credit that counts as all of it
_WHOLE = 0.9
#: entries of a kernel's arguments beyond which it is compiled at once: a single call could take long
LARGE = 40000

#: LLVM's level of optimisation and whether it makes vectors of loops: with `fastmath`, and without
_THOROUGH = (config.OPT, config.LOOP_VECTORIZE)
_SWIFT = (type(config.OPT)(min(int(config.OPT), 1)), 0)


class _Ledger:
    """What compilation has cost so far, and what is known of earlier processes."""

    def __init__(self) -> None:
        self.runs = 0
        #: seconds of compilation allowed, and when that was true
        self.credit, self.since = CREDIT, time.thread_time()
        #: whether everything is compiled when it is called
        self.eager = False
        #: whether nothing has been found in the cache
        self.fresh = True
        #: kernels that are being compiled, each because of the one before, and when the first of them began
        self.depth, self.began = 0, 0.0

    def allows(self, alone: bool = False) -> bool:
        """Whether something may be compiled now; alone: a kernel that must not follow others at once."""
        self._worked()
        return self.eager or self.credit > (_WHOLE * CREDIT if alone else 0.0)

    def begins(self) -> None:
        """The compilation of a kernel begins."""
        if self.depth == 0:
            self._worked()
            self.began = time.thread_time()
        self.depth += 1

    def ends(self) -> None:
        """The compilation of a kernel ends."""
        self.depth -= 1
        if self.depth == 0:
            self.since = time.thread_time()
            self.credit -= self.since - self.began

    def _worked(self) -> None:
        now = time.thread_time()
        self.credit = min(CREDIT, self.credit + SHARE * max(0.0, now - self.since))
        self.since = now


_ledger = _Ledger()


class _Nested(threading.local):
    """Seconds that a thread has spent in kernels called by the one that runs."""

    seconds = 0.0


_nested = _Nested()


def computation_begins() -> None:
    """Tell that a user's computation begins: from the second on, kernels are compiled sooner."""
    _ledger.runs += 1


def compile_at_once() -> None:
    """From now on every kernel is compiled when it is called: for measurements of what comes after."""
    _ledger.eager = True


class _Kernel(CPUDispatcher):
    """A kernel that is compiled with no more effort than its kind repays.

    Loops are put into vector registers in kernels with `fastmath` only: elsewhere that gains nothing measurable, and
    half of LLVM's time would go into it. What a kernel calls has been optimised already.
    """

    def compile(self, sig: Any) -> Any:
        if self.overloads.get(tuple(sig)) is not None:
            return super().compile(sig)
        with global_compiler_lock:
            before = config.OPT, config.LOOP_VECTORIZE
            collecting = gc.isenabled()
            fast = bool(self.targetoptions.get("fastmath"))
            config.OPT, config.LOOP_VECTORIZE = _THOROUGH if fast else _SWIFT
            _ledger.begins()
            # Numba makes millions of small objects, and looking through them takes a tenth of the time
            gc.disable()
            try:
                return super().compile(sig)
            finally:
                _ledger.ends()
                config.OPT, config.LOOP_VECTORIZE = before
                if collecting:
                    gc.enable()


class _Patient(_Kernel):
    """A kernel that has not been compiled yet."""

    patience = PATIENCE
    alone = False

    def __call__(self, *args: Any) -> Any:
        # methods by the name of the class: another thread may make it a `_Kernel` at any time
        if "_spent" not in self.__dict__ or _Patient._due(self, args):
            with global_compiler_lock:
                if _patient(self):
                    self._prepare(args)
        if not _patient(self):
            return self(*args)
        before, _nested.seconds = _nested.seconds, 0.0
        start = time.thread_time()
        try:
            with np.errstate(all="ignore"):
                return self.py_func(*args)
        finally:
            took = time.thread_time() - start
            self._spent += took - _nested.seconds
            _nested.seconds = before + took

    def _prepare(self, args: tuple[Any, ...]) -> None:
        """Load it, or compile it if it is due."""
        signature = tuple(self.typeof_pyval(a) for a in args)
        if "_spent" not in self.__dict__:
            if self._cache.load_overload(signature, self.targetctx) is not None:
                _ledger.fresh = False
                compiled(self)
                return
            self._spent = 0.0
        if self._due(args):
            self.compile(signature)
            compiled(self)

    def _due(self, args: tuple[Any, ...]) -> bool:
        """Whether it is to be compiled now."""
        # those that take seconds to compile leave long loops to others
        large = not self.alone and sum(a.size for a in args if isinstance(a, np.ndarray)) > LARGE
        if _ledger.eager or large:
            return True
        patience = self.patience if _ledger.fresh and _ledger.runs < 2 else min(self.patience, LESS)
        if not (self._spent > patience and _ledger.allows(self.alone)):
            return False
        # those that it has called first, one by one: otherwise all of them would be compiled at one go
        waiting = [part for part in _parts(self) if isinstance(part, _Patient) and "_spent" in part.__dict__]
        for part in waiting:
            part.patience = 0.0
        return not waiting


def _patient(kernel: Any) -> bool:
    return isinstance(kernel, _Patient)


def _parts(kernel: CPUDispatcher) -> list[Any]:
    """The kernels that this one calls."""
    known: list[Any] | None = kernel.__dict__.get("_called")
    if known is None:
        names, there = kernel.py_func.__code__.co_names, kernel.py_func.__globals__
        known = kernel._called = [there[name] for name in names if isinstance(there.get(name), CPUDispatcher)]
    return known


def compiled(kernel: _Function) -> _Function:
    """The same kernel, compiled (or loaded) at its next call if it is not yet."""
    if isinstance(kernel, _Patient):
        kernel.__class__ = _Kernel
    return kernel


def ready(kernel: Callable[..., Any]) -> bool:
    """Whether a kernel may be called from another one without a wait for its compilation."""
    return _ledger.eager or not isinstance(kernel, _Patient)


def at_hand(kernel: Callable[..., Any], *args: Any) -> bool:
    """Whether a kernel has been compiled for such arguments, in this process or an earlier one; whether any of them is
    None is all that may differ from call to call.
    """
    if _ledger.eager or not isinstance(kernel, CPUDispatcher):
        return True
    known: dict[tuple[bool, ...], bool] = kernel.__dict__.setdefault("_at_hand", {})
    kind = tuple(a is None for a in args)
    if not known.get(kind, False):
        signature = tuple(kernel.typeof_pyval(a) for a in args)
        with global_compiler_lock:
            known[kind] = kernel.overloads.get(signature) is not None or (
                # another process may have compiled it meanwhile: looked up once
                kind not in known and kernel._cache.load_overload(signature, kernel.targetctx) is not None
            )
    return known[kind]


def kernel(
    patience: float = PATIENCE, at_once: bool = False, alone: bool = False, **options: Any
) -> Callable[[_Function], _Function]:
    """Decorator of a kernel: `numba.njit` with its cache, and patience (none with `at_once`, or with `fastmath`).

    `alone` marks those whose compilation takes seconds. Other options are those of `njit`.
    """

    def decorate(function: _Function) -> _Function:
        result = njit(cache=True, **options)(function)
        if not isinstance(result, CPUDispatcher):  # NUMBA_DISABLE_JIT
            return np.errstate(all="ignore")(function)
        if at_once or options.get("fastmath"):
            result.__class__ = _Kernel
        else:
            result.__class__ = _Patient
            result.patience, result.alone = patience, alone
        return result

    return decorate
