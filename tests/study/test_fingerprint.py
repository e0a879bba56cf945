"""Digests of a user's code: the same in every process, another one whenever the code computes something else."""

from __future__ import annotations

import functools
import importlib
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from suboctave.study.file import read_study
from suboctave.study.fingerprint import fingerprint


def made(text: str):
    """The function `f` of a module with this text."""
    module = {"__name__": "of_a_user", "np": np, "functools": functools}
    exec(textwrap.dedent(text), module)
    return module["f"]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("f = lambda x: x", "f = lambda x: -x"),
        ("f = lambda x: 2 * x", "f = lambda x: 3 * x"),
        ("f = lambda x, k=1.0: k * x", "f = lambda x, k=2.0: k * x"),
        ("f = lambda x: x.min()", "f = lambda x: x.max()"),
        ("k = 1.0\ndef f(x): return k * x", "k = 2.0\ndef f(x): return k * x"),
        ("k = np.ones(3)\ndef f(x): return k * x", "k = np.zeros(3)\ndef f(x): return k * x"),
        ("def g(x): return x\ndef f(x): return g(x)", "def g(x): return x + 1\ndef f(x): return g(x)"),
        ("def f(x): return [y + 1 for y in x]", "def f(x): return [y + 2 for y in x]"),
        ("f = functools.partial(max, 1)", "f = functools.partial(max, 2)"),
        ("f = functools.partial(max, 1)", "f = functools.partial(min, 1)"),
        ("def a(k): return lambda x: k * x\nf = a(1)", "def a(k): return lambda x: k * x\nf = a(2)"),
        ("class A:\n k = 1\n def __call__(self, x): return x\nf = A()",
         "class A:\n k = 1\n def __call__(self, x): return x + self.k\nf = A()"),
        ("class A:\n def __init__(self, k): self.k = k\n def __call__(self, x): return x\nf = A(1)",
         "class A:\n def __init__(self, k): self.k = k\n def __call__(self, x): return x\nf = A(2)"),
        ("class A:\n def g(self): return 1\nf = A", "class A:\n def g(self): return 2\nf = A"),
    ],
)  # fmt: skip
def test_other_code_has_another_digest(one, other):
    assert fingerprint(made(one)) == fingerprint(made(one)) != fingerprint(made(other))


def test_where_it_stands_does_not_count():
    assert fingerprint(made("def f(x): return x")) == fingerprint(made("\n\nother = 1\ndef f(x): return x"))


def test_code_that_names_itself_comes_to_an_end():
    assert fingerprint(made("def f(x): return f(x - 1) if x else 0"))


SCRIPT = """
from suboctave.study.fingerprint import fingerprint
names = {"a", "b", "c"}
def f(results): return {n: 1.0 for n in names if n in {"peak", "low", "high"}}
print(fingerprint(f))
"""


def test_it_is_the_same_in_every_process():
    """Sets come in another order in each."""
    runs = [subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, check=True).stdout for _ in range(3)]
    assert len(set(runs)) == 1


STUDY = """
[system]
mass = 1.0
damping = 0.1
stiffness = 1.0
elements = [{ type = "Callable", dof = 0, function = { callable = "law_of_a_user:force" } }]
loads = [{ type = "HarmonicLoad", dof = 0, amplitude = 1.0 }]
[[analyses]]
name = "response"
type = "frequency_response"
omega = [3.0, 0.5]
"""


def test_an_analysis_is_not_taken_over_once_a_law_has_changed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    keys = []
    for text in ("x**3", "x**3", "x**5"):
        (tmp_path / "law_of_a_user.py").write_text(f"def force(x, v):\n    return {text}\n" + "#" * len(keys))
        sys.modules.pop("law_of_a_user", None)
        importlib.invalidate_caches()
        keys.append(read_study(tmp_path / "study.toml", allow_code=True).keys["response"])
    sys.modules.pop("law_of_a_user", None)
    assert keys[0] == keys[1] != keys[2]
