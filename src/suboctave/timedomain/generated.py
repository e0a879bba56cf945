"""Code for many trajectories side by side: text in which inner loops run over lanes, and modules made of it.

All numbers of W trajectories lie in one array of rows of W numbers. The place of every row and every size is a constant
of the text, so that the compiler makes vector instructions of the loops over lanes. A module is kept in a file, and
with it what Numba makes of it: it is named by a digest of its content and of everything that its meaning depends on, so
that the same text is never compiled twice, and never taken for another. The file is written beside its place and
renamed: several processes may do so at once; where nothing can be written, nothing is kept.

A compiler never gives back the memory in which it has made a text's code, 7 MB of it; what is loaded from its file
takes 1 MB. So a process that comes by many texts has others compile those beyond the first few.

The directory is `$SUBOCTAVE_CACHE`, else `suboctave` in the user's directory for caches.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import accumulate
from math import prod
from pathlib import Path
from types import ModuleType
from typing import Any

from suboctave.atomic import replace_file
from suboctave.compiled import Cache, notice, without_notice
from suboctave.errors import SuboctaveError
from suboctave.version import __version__
from suboctave.workers import completed

__all__ = ["Index", "Lanes", "Rows", "module_of"]

#: the index of a row: a number, or the name of the loop's variable that holds it
Index = int | str
#: texts that a process compiles itself: that is a second quicker, and takes 7 MB for good
_COMPILED_HERE = 8
#: loops over as many rows or fewer are written out
_MOST_UNROLLED = 4

_HEADER = '''"""Generated: do not edit."""

from math import pi

import numpy as np

from suboctave.compiled import cached
from suboctave.timedomain.adaptive_control import ERROR_3, ERROR_5, NODES, STAGES, control, follow
from suboctave.timedomain.lane_functions import arccos, arcsin, arctan, arctan_log, call_back, cos, cosh, exp
from suboctave.timedomain.lane_functions import log, sin, sine_cosine, sinh, sqrt, tan, tanh

absolute, maximum, sign = abs, max, np.sign
'''
_DECORATOR = '@cached(nogil=True, error_model="numpy", fastmath={"contract"})'


class Rows:
    """Where everything lies: under each name an array of rows of W numbers, of the shape given."""

    def __init__(self, lanes: int, shapes: Mapping[str, int | tuple[int, ...]]) -> None:
        self.lanes = lanes
        self.shapes = {name: shape if isinstance(shape, tuple) else (shape,) for name, shape in shapes.items()}
        ends = list(accumulate((prod(shape) for shape in self.shapes.values()), initial=0))
        #: the first row of each name
        self.begin = dict(zip(self.shapes, ends[:-1], strict=True))
        self.size = ends[-1]

    def __call__(self, name: str, *index: Index) -> str:
        """The number in the lane l of one row; without an index that of the first.

        One index counts all rows of the name, whatever their shape.
        """
        row: Index = 0
        for length, i in zip(self.shapes[name][-len(index) :], index, strict=False):
            if isinstance(row, int) and isinstance(i, int):
                row = row * length + i
            else:
                row = f"{i}" if row == 0 else f"({row}) * {length} + {i}"
        if isinstance(row, int):
            return f"z[{(self.begin[name] + row) * self.lanes} + l]"
        return f"z[({self.begin[name]} + {row}) * {self.lanes} + l]"


class Lanes:
    """Lines of code; statements on lanes that follow each other share one loop."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self._lines: list[str] = []
        self._indent = 1
        self._pending: list[str] = []

    def each(self, *lines: str) -> None:
        """Statements for every lane l."""
        self._pending += lines

    def raw(self, *lines: str) -> None:
        """Statements outside of the loop over lanes."""
        self._flush()
        self._lines += ["    " * self._indent + line for line in lines]

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """What is written meanwhile stands indented below this line."""
        self.raw(head)
        self._indent += 1
        before = len(self._lines)
        yield
        self._flush()
        if len(self._lines) == before:
            self.raw("pass")
        self._indent -= 1

    def rows(self, variable: str, count: Index, body: Callable[[Index], None], first: Index = 0) -> None:
        """`body` for rows `first` to `count`: written out if they are few, else in a loop over this variable."""
        if isinstance(count, int) and isinstance(first, int) and count <= _MOST_UNROLLED:
            for i in range(first, count):
                body(i)
        else:
            with self.block(f"for {variable} in range({first}, {count}):"):
                body(variable)

    def sums(
        self,
        count: int,
        goal: Callable[[Index], str],
        start: Callable[[Index], str],
        terms: Sequence[tuple[int, str, Callable[[Index, Index], str]]],
    ) -> None:
        """`goal(i) = start(i) +- sum_j term(i, j) +- ...`, each sum given by its length, its sign and its term."""

        def written_out(i: Index) -> None:
            parts = [f" {sign} {term(i, j)}" for size, sign, term in terms for j in range(size)]
            self.each(f"{goal(i)} = {start(i)}{''.join(parts)}")

        def in_loops(i: Index) -> None:
            self.each(f"{goal(i)} = {start(i)}")
            for size, sign, term in terms:
                if size:
                    with self.block(f"for o in range({size}):"):
                        self.each(f"{goal(i)} {sign}= {term(i, 'o')}")

        self.rows("i", count, written_out if count <= _MOST_UNROLLED else in_loops)

    def function(self, head: str) -> str:
        """All of it, as a compiled function."""
        self._flush()
        text = "\n".join(self._lines)
        return f"\n\n{_DECORATOR}\ndef {head}:\n{text}\n"

    def _flush(self) -> None:
        if self._pending:
            pending, self._pending = self._pending, []
            self.raw(f"for l in range({self.lanes}):")
            self._lines += ["    " * (self._indent + 1) + line for line in pending]


@functools.cache
def _directory() -> Path | None:
    """Where generated files are kept, made if it is not there; None where nothing can be written."""
    given = os.environ.get("SUBOCTAVE_CACHE")
    try:
        if given:
            place = Path(given)
        elif sys.platform == "win32":
            place = Path(os.environ.get("LOCALAPPDATA", Path.home())) / "suboctave"
        else:
            place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "suboctave"
        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=place):
            pass
    except (OSError, RuntimeError):
        return None
    return place


@functools.cache
def _ground() -> bytes:
    """What the meaning of every generated text depends on: versions, and the functions that it calls."""
    import numba

    called = [Path(__file__).with_name(name).read_bytes() for name in ("lane_functions.py", "adaptive_control.py")]
    return b"\0".join([__version__.encode(), numba.__version__.encode(), *called])


_lock = threading.Lock()
#: names of the modules of which this process has compiled functions itself
_compiled_here: set[str] = set()


def module_of(*functions: str) -> ModuleType:
    """The module with these functions; what they are compiled to is loaded by later processes."""
    source = _HEADER + "".join(functions)
    digest = hashlib.sha256(_ground() + b"\0" + source.encode()).hexdigest()[:32]
    return _module(f"suboctave_generated_{digest}", source)


def _module(name: str, source: str) -> ModuleType:
    with _lock:
        if name in sys.modules:
            return sys.modules[name]
        module = ModuleType(name)
        module.__file__ = _kept(name, source)
        # not imported from its file: Python would keep, and trust, a compiled form beside it
        exec(compile(source, module.__file__, "exec"), module.__dict__)
        for function in vars(module).values():
            if getattr(function, "__module__", "") == name and hasattr(function, "_compile_for_args"):
                _compiled_elsewhere(function, source)
        sys.modules[name] = module
        return module


def _compiled_elsewhere(function: Any, source: str) -> None:
    """Have another process compile a function, and load what it gives, where this one has compiled enough."""
    compile_here = function._compile_for_args

    def compile_for(*arguments: Any, **named: Any) -> Any:
        types, cache = tuple(function.typeof_pyval(argument) for argument in arguments), function._cache
        if isinstance(cache, Cache) and not cache.holds(types, function.targetctx):
            if len(_compiled_here - {function.__module__}) < _COMPILED_HERE:
                _compiled_here.add(function.__module__)
            else:
                notice()
                with suppress(SuboctaveError):  # no other process can: this one does
                    deque(completed(_compile, [(function.__module__, source, function.__name__, types)]), maxlen=0)
        return compile_here(*arguments, **named)

    function._compile_for_args = compile_for


def _compile(task: tuple[str, str, str, Any]) -> None:
    """What another process does."""
    name, source, function, types = task
    without_notice()
    getattr(_module(name, source), function).compile(types)


def _kept(name: str, source: str) -> str:
    """The file with this text, which Numba keeps what it has compiled with; no file's name where none can be kept."""
    folder = _directory()
    if folder is not None:
        path = folder / f"{name}.py"
        with suppress(OSError):
            if not path.exists() or path.read_bytes() != source.encode():
                replace_file(path, lambda place: place.write_bytes(source.encode()))
            return str(path)
    return f"<{name}>"
