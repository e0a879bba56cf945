"""Kernels are compiled once, at their first call or beforehand, and the user knows what is waited for."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import pickle
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numba import config
from numba.core import caching
from numba.core.errors import TypingError

from suboctave import compiled
from suboctave.study import compilation, computations

SOURCE = """
from suboctave.compiled import kernel

@kernel(inner=True)
def inner(x):
    return x * x

@kernel()
def total(values):
    result = 0.0
    for i in range(values.shape[0]):
        result += inner(values[i])
    return result
"""
VALUES = np.arange(5.0)


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Makes the module's kernels as a process of its own would."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "KERNELS", [])
    path = tmp_path / "kernels_of_a_test.py"
    path.write_text(SOURCE)

    def make():
        monkeypatch.setattr(compiled, "_printed", set())
        monkeypatch.setattr(compiled, "_waiting", compiled._Waiting())
        spec = importlib.util.spec_from_file_location("suboctave_kernels_of_a_test", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.total

    return make


def test_a_kernel_is_compiled_at_its_first_call_with_one_line_that_says_so(made, capsys):
    total = made()
    assert [total(VALUES), total(VALUES)] == [30.0] * 2
    assert total(np.arange(5)) == 30.0  # another type
    assert len(total.signatures) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "once: up to a minute" in error


def test_a_notebook_shows_a_bar_and_no_red_box(made, capsys, monkeypatch):
    shown = []
    monkeypatch.setattr(compiled, "in_notebook", lambda: True)
    monkeypatch.setattr(compiled, "notebook_line", lambda: lambda text, running: shown.append((running, text)))
    assert made()(VALUES) == 30.0
    assert [running for running, _ in shown] == [True, False]
    assert "compiled 1 of its kernels" in shown[-1][1]
    assert not capsys.readouterr().err


def test_what_an_earlier_process_has_compiled_is_loaded_without_a_word(made, capsys):
    made()(VALUES)
    capsys.readouterr()
    total = made()
    assert total(VALUES) == 30.0
    assert sum(total.stats.cache_hits.values()) == 1
    assert not capsys.readouterr().err


def test_a_kernel_that_has_been_loaded_calls_one_that_is_compiled_anew(made, tmp_path):
    made()(VALUES)
    for path in (tmp_path / "cache").rglob("*inner*"):
        path.unlink()
    total = made()
    assert total(VALUES) == 30.0
    assert sum(total.stats.cache_hits.values()) == 1
    assert sum(total.py_func.__globals__["inner"].stats.cache_misses.values()) == 1


def test_an_inner_kernel_is_refused_to_python(made):
    total = made()
    for _ in range(2):
        with pytest.raises(TypeError, match="called by kernels only"):
            total.py_func.__globals__["inner"](2.0)
        assert total(VALUES) == 30.0


CALLED = """
from suboctave.compiled import kernel

@kernel()
def inner(x):
    return {power}
"""
CALLING = """
from suboctave.compiled import kernel
from suboctave_called_by_a_test import inner

@kernel()
def outer(x):
    return inner(x) + 1.0
"""


LITERALS = """
from suboctave.compiled import kernel

@kernel()
def scaled(x, times):
    return x * times

@kernel()
def outer(x):
    return scaled(x, 2) + scaled(x, 3) + scaled(x, True)
"""


def test_a_kernel_called_with_literals_is_compiled_once_for_their_type(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "KERNELS", [])
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "suboctave_literals_of_a_test.py").write_text(LITERALS)
    module = importlib.import_module("suboctave_literals_of_a_test")
    assert module.outer(1.5) == 9.0
    assert [str(types[1]) for types in module.scaled.signatures] == ["int64", "bool"]


def test_a_kernel_is_compiled_anew_when_another_file_that_it_calls_has_changed(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "KERNELS", [])
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "suboctave_calling_of_a_test.py").write_text(CALLING)
    results = []
    for power in ("x * x", "x * x * x", "x * x * x"):
        (tmp_path / "suboctave_called_by_a_test.py").write_text(CALLED.format(power=power))
        for name in ("suboctave_called_by_a_test", "suboctave_calling_of_a_test"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        outer = importlib.import_module("suboctave_calling_of_a_test").outer
        results.append(outer(2.0))
    assert results == [5.0, 9.0, 9.0]
    for name in ("suboctave_called_by_a_test", "suboctave_calling_of_a_test"):
        sys.modules.pop(name, None)


def test_what_another_version_has_left_in_the_cache_does_no_harm(made, tmp_path):
    """Not even where it names a class that is no more."""
    made()(VALUES)
    written = list((tmp_path / "cache").rglob("*total*.nb?"))
    assert len(written) == 2
    for path in written:
        block = pickle.dumps(None)[:-1] + b"csuboctave.compiled\nNoSuchClass\n."
        path.write_bytes(hashlib.blake2b(block, digest_size=16).digest() + block)
    assert made()(VALUES) == 30.0
    assert made()(VALUES) == 30.0


def damaged(path: Path, how: str) -> None:
    """Spoil a file."""
    whole = path.read_bytes()
    if how == "one bit":
        at = len(whole) * 3 // 4
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    elif how == "unreadable":
        path.unlink()
        path.mkdir()
    else:
        path.write_bytes({"truncated": whole[: len(whole) // 2], "garbage": b"garbage\n" * 9, "empty": b""}[how])


@pytest.mark.parametrize("how", ["truncated", "garbage", "empty", "one bit", "unreadable"])
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_what_is_damaged_in_the_cache_is_compiled_anew(made, tmp_path, suffix, how):
    """One bit of machine code too, which would compute something else."""
    made()(VALUES)
    files = list((tmp_path / "cache").rglob(f"*{suffix}"))
    assert files
    for path in files:
        damaged(path, how)
    assert made()(VALUES) == 30.0
    if how != "unreadable":  # the cache is whole again
        total = made()
        assert total(VALUES) == 30.0
        assert sum(total.stats.cache_hits.values()) == 1


def test_a_disk_that_takes_nothing_more_costs_the_cache_alone(made, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_open_for_write", full)
    assert made()(VALUES) == 30.0
    assert "NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_ctrl_c_waits_for_the_compiler_and_is_a_keyboard_interrupt(made):
    """Raised in the middle of a compilation it would leave the compiler useless, or come out as a SystemError."""
    total, handled = made(), []

    def interrupt(*_):
        handled.append(None)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt)
    alarm = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, 0.02)
    try:
        with pytest.raises(KeyboardInterrupt):
            total(VALUES)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, alarm)
        assert signal.signal(signal.SIGINT, before) is interrupt
    assert handled
    assert total(VALUES) == 30.0
    assert made()(np.arange(5)) == 30.0


def test_without_a_folder_for_the_cache_kernels_are_compiled_in_memory(made, capsys, monkeypatch):
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert made()(VALUES) == 30.0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "NUMBA_CACHE_DIR" in lines[0]


def test_a_failure_leaves_the_compilers_settings_as_they_were(made):
    before = config.OPT, config.LOOP_VECTORIZE
    with pytest.raises(TypingError):
        made()(np.array([None]))
    assert before == (config.OPT, config.LOOP_VECTORIZE)


def test_several_threads_may_call_a_kernel_while_one_of_them_compiles_it(made):
    total = made()
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            results = list(pool.map(total, [np.arange(5.0)] * 2000))
    finally:
        sys.setswitchinterval(interval)
    assert results == [30.0] * 2000
    assert len(total.signatures) == 1


def test_a_process_waits_for_another_one_that_compiles_the_same(made):
    fcntl = pytest.importorskip("fcntl")
    total = made()
    with open(f"{total._cache._cache_file._index_path}.lock", "ab") as file, ThreadPoolExecutor(1) as pool:
        fcntl.flock(file, fcntl.LOCK_EX)
        waiting = pool.submit(total, VALUES)
        with pytest.raises(TimeoutError):
            waiting.result(timeout=0.3)
        fcntl.flock(file, fcntl.LOCK_UN)
        assert waiting.result() == 30.0


@pytest.fixture
def command(tmp_path, monkeypatch):
    """`compile_all` with one small kernel in the place of all, in a cache of its own; how often it has computed."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "KERNELS", [])
    path, computed, reports = tmp_path / "kernels_of_the_command.py", [], []
    path.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("suboctave_kernels_of_the_command", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def compute(function, tasks, workers):
        computed.append(module.total(VALUES))
        yield 0, None

    monkeypatch.setattr(compilation, "completed", compute)
    return lambda: (compilation.compile_all(lambda *of: reports.append(of)), len(computed), reports)


def test_the_command_does_nothing_where_everything_is_compiled(command):
    count, computed, reports = command()
    assert (count, computed) == (2, 1)
    assert reports[0][0] == 0.0
    assert command()[:2] == (0, 1)


@pytest.mark.parametrize("how", ["one bit", "unreadable", "other sources"])
def test_the_command_computes_again_where_something_has_changed(command, tmp_path, monkeypatch, how):
    command()
    if how == "other sources":
        monkeypatch.setattr(compilation, "_PACKAGE", tmp_path)
    else:
        damaged(next((tmp_path / "cache").rglob("*total*.nbc")), how)
    assert command()[1] == 2


DIGITS = """
import numpy as np
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import extrema, motion, spectra

high = np.arange(1.0, 41.0)
c, grid = np.append(0.1, np.exp(1j * high**2) / high**2), search_grid(40)
turns = extrema(c, grid.zr, grid.zi)
values = motion(c, grid.zr, grid.zi)
sums = spectra(values, grid.weights, grid.zr, grid.zi, 80)
print(turns.tobytes().hex(), values.tobytes().hex(), sums.tobytes().hex())
"""


def test_the_process_that_compiles_computes_the_same_digits_as_those_that_load(tmp_path):
    """Sums that may be reordered are compiled once, not a second time as a part of what calls them."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def digits() -> str:
        done = subprocess.run(
            [sys.executable, "-c", DIGITS], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout

    assert digits() == digits()


def signatures() -> dict[str, list[str]]:
    """The signatures with which each kernel has been called in this process."""
    called: dict[str, set[str]] = {}
    for kernel in compiled.KERNELS:
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
        called.setdefault(name, set()).update(map(str, kernel.signatures))
    return {name: sorted(texts) for name, texts in called.items() if texts}


def after(script: str, generated: Path) -> dict[str, list[str]]:
    """`signatures` of a process that has run this; generated code kept before would hide the kernels that it calls."""
    code = f"import json, test_compiled; from suboctave.study import computations\n{script}\n"
    code += "print('\\n' + json.dumps(test_compiled.signatures()))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True, check=True,
        env={**os.environ, "SUBOCTAVE_CACHE": str(generated)},
    )  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_after_the_command_no_example_compiles_anything(tmp_path):
    examples = [str(path) for path in sorted((Path(__file__).parents[1] / "examples").glob("ex*.py"))]
    there = after(f"for i in range({len(computations.COMPUTATIONS)}): computations.run(i)", tmp_path / "command")
    script = f"import runpy, sys; sys.argv = ['']\nfor path in {examples!r}: runpy.run_path(path)"
    used = after(script, tmp_path / "examples")
    missing = {name: set(texts) - set(there.get(name, ())) for name, texts in used.items()}
    assert not {name: texts for name, texts in missing.items() if texts}
