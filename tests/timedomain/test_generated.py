"""Generated code: kept whole or compiled anew, without a trace where nothing can be kept, in bounded memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from suboctave import compiled
from suboctave.timedomain import generated

TEXT = """

@cached(nogil=True)
def {name}(x):
    return x * x + {number}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of its own for what is generated."""
    monkeypatch.setenv("SUBOCTAVE_CACHE", str(tmp_path))
    generated._directory.cache_clear()
    monkeypatch.setattr(generated, "_compiled_here", set())
    monkeypatch.setattr(compiled._waiting, "silent", True)
    monkeypatch.setattr(compiled, "_printed", set())
    yield tmp_path
    monkeypatch.undo()
    generated._directory.cache_clear()


def module(number: int, name: str = "of_a_test"):
    """The module as a process that has not met it yet makes it."""
    for known in [known for known in sys.modules if known.startswith("suboctave_generated")]:
        del sys.modules[known]
    return getattr(generated.module_of(TEXT.format(name=name, number=number)), name)


@pytest.mark.parametrize("how", [b"", b"garbage\xff\x00", None], ids=["empty", "garbage", "truncated"])
def test_what_is_damaged_is_made_anew(folder, how):
    assert module(7)(3.0) == 16.0
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".lock"]
    assert {path.suffix for path in files} == {".py", ".nbi", ".nbc"}  # and nothing that Python itself has compiled
    for path in files:
        path.write_bytes(path.read_bytes()[:40] if how is None else how)
    assert module(7)(3.0) == 16.0
    again = module(7)
    assert again(3.0) == 16.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_where_nothing_can_be_written_nothing_is_left_behind(folder, monkeypatch, capsys):
    monkeypatch.setattr(generated, "_directory", lambda: None)
    before = set(os.listdir(tempfile.gettempdir()))
    assert module(8)(3.0) == 17.0
    assert {name for name in set(os.listdir(tempfile.gettempdir())) - before if "suboctave" in name} == set()
    assert "every process compiles" in capsys.readouterr().err


def test_beyond_the_first_few_texts_another_process_compiles(folder, monkeypatch):
    """And this one loads: a compilation's memory is never given back."""
    monkeypatch.setattr(generated, "_COMPILED_HERE", 1)
    first, second = (module(number) for number in (1, 2))
    assert first(2.0) == 5.0
    assert second(2.0) == 6.0
    assert sum(first.stats.cache_misses.values()) == 1
    assert sum(second.stats.cache_hits.values()) == 1


MEMORY = """
import gc, suboctave as so
from suboctave.compiled import without_notice
from suboctave.timedomain.flow import Flow
def resident():
    gc.collect()
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmRSS")).split()[1]) / 1024
without_notice()
for i in range(14):
    system = so.System(1.0, 0.1, 1.0, [so.Expression(0, f"x**3 + 0.1*tanh({i + 1}*v)")], [so.HarmonicLoad(0, 0.3)])
    Flow(system).over([0.1, 0.0], 1.1, 1)
    if i == 8:
        before = resident()
print((resident() - before) / 5)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_memory_grows_by_little_more_than_the_code_itself(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", MEMORY], env=os.environ | {"SUBOCTAVE_CACHE": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert float(done.stdout) < 3.0  # MB for each text: 8 where this process compiles it
