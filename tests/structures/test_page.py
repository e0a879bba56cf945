"""docs/structures.md: what it tells its readers to do works, and prints what it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import suboctave as so
from suboctave.study.file import read_study

PAGE = (Path(__file__).parents[2] / "docs" / "structures.md").read_text(encoding="utf-8")
FILES = PAGE.split("## Matrices from files")[1].split("\n## ")[0]


def blocks(kind):
    return re.findall(rf"^```{kind}\n(.*?)^```", FILES, re.M | re.S)


def test_matrices_from_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written, shown, system = blocks("python")
    scope: dict = {}
    exec(compile(written + shown, "docs/structures.md", "exec"), scope)
    (printed,) = blocks("text")
    assert capsys.readouterr().out == printed
    squares = scipy.linalg.eigvalsh(scope["springs"].toarray(), scope["masses"].toarray())
    np.testing.assert_allclose(scope["frame"].natural_frequencies().omega, np.sqrt(squares))
    exec(compile(system, "docs/structures.md", "exec"), scope)
    curve = scope["curve"]
    np.testing.assert_allclose(np.sort(curve.omega)[[0, -1]], [3.0, 6.0])
    assert curve.amplitude.max() > 0.02  # the stop is reached

    (study,) = blocks("toml")
    Path("study.toml").write_text(study)
    read = read_study("study.toml").system
    for ours, theirs in zip(read.matrices(), scope["system"].matrices(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert isinstance(scope["frame"], so.Structure)


@pytest.mark.slow
def test_structural_damping(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    exec(compile("".join(blocks("python")[:2]), "docs/structures.md", "exec"), scope)
    capsys.readouterr()
    section = PAGE.split("## Structural damping")[1].split("\n## ")[0]
    (code,), (printed,) = (re.findall(rf"^```{kind}\n(.*?)^```", section, re.M | re.S) for kind in ("python", "text"))
    exec(compile(code, "docs/structures.md", "exec"), scope)
    assert capsys.readouterr().out == printed
    with np.testing.assert_raises(so.InputError):
        so.verify(scope["response"].orbits[0])
    equivalent = scope["hysteretic"].viscous_equivalent()
    assert so.verify(so.frequency_response(equivalent, (3.5, 3.4)).orbits[0]).agrees


def test_in_time(capsys):
    """The last part of the page."""
    section = PAGE.split("## In time")[1]
    (code,), (printed,) = (re.findall(rf"^```{kind}\n(.*?)^```", section, re.M | re.S) for kind in ("python", "text"))
    exec(compile(code, "docs/structures.md", "exec"), {"np": np, "so": so, "scipy": scipy})
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == len(printed.splitlines())
    numbers = [[float(one) for one in re.findall(r"\d+\.?\d*", text.split("error")[0])] for text in (shown[0], printed)]
    np.testing.assert_allclose(numbers[0], numbers[1][: len(numbers[0])], rtol=1e-5)
