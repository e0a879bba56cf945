"""Mistakes with files, folders and the command line, and forces that fail midway: told in words, nothing is lost."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import suboctave as so

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")
FIGURE = '\n[outputs]\n[[outputs.figures]]\nfile = "a.png"\n'


# ------------------------------------------------------------------------------------------- files, folders, commands
@pytest.fixture
def results(study_file, suboctave):
    path = study_file(DUFFING.split('[[analyses]]\nname = "up"')[0])
    assert suboctave("run", path)[0] == 0
    return path.parent / "study_results" / "results.nc"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind the superuser")
def test_an_unwritable_folder_is_known_before_the_work(study_file, suboctave, tmp_path):
    path = study_file()
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    status, out, err = suboctave("run", path, "--out", locked)
    assert (status, out) == (2, "")
    assert "not writable" in err


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no place that refuses even the superuser")
def test_a_folder_that_cannot_be_made(study_file, suboctave):
    status, out, err = suboctave("run", study_file(), "--out", "/proc/suboctave")
    assert (status, out) == (2, "")
    assert "cannot be made" in err


def test_a_folder_that_is_a_file(study_file, suboctave, tmp_path):
    path = study_file()
    (tmp_path / "taken").write_text("mine")
    for folder in ("taken", "taken/below"):
        status, _, err = suboctave("run", path, "--out", tmp_path / folder)
        assert status == 2
        assert "--out" in err
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_foreign_file_where_a_figure_would_go(study_file, suboctave, tmp_path):
    path = study_file(DUFFING + FIGURE)
    (tmp_path / "study_results").mkdir()
    (tmp_path / "study_results" / "a.png").write_text("mine")
    status, _, err = suboctave("run", path)
    assert status == 2
    assert "a.png" in err
    assert (tmp_path / "study_results" / "a.png").read_text() == "mine"
    assert [p.name for p in (tmp_path / "study_results").iterdir()] == ["a.png"]


def test_a_foreign_file_in_the_journals_place(study_file, suboctave, tmp_path):
    path = study_file()
    (tmp_path / "study_results").mkdir()
    (tmp_path / "study_results" / "unfinished.journal").write_text("my diary")
    for option in ("--resume", "--overwrite"):
        status, _, err = suboctave("run", path, option)
        assert status == 2
        assert "no journal of suboctave" in err
    assert (tmp_path / "study_results" / "unfinished.journal").read_text() == "my diary"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nowhere.toml"], "there is no such file"),
        (["check", "."], "folder"),
        (["show", "nowhere.nc"], "there is no file"),
        (["show", "."], "folder"),
        (["new", "a.toml", "--example", "nltv"], "did you mean 'nltva'"),
        (["new", "a.txt"], ".toml"),
        (["new", "nowhere/a.toml"], "no folder"),
        (["rnu"], "rnu"),
        (["run"], "Missing argument"),
        (["run", "a.toml", "--overwrit"], "--overwrit"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mistake_on_the_command_line(arguments, words, suboctave, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = suboctave(*arguments)
    assert status == 2
    assert not out
    assert words in err
    assert not list(tmp_path.iterdir())


def test_new_leaves_a_file_alone(suboctave, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    assert suboctave("new", path)[0] == 2
    assert path.read_text() == "mine"
    assert suboctave("new", path, "--overwrite")[0] == 0
    assert "[system]" in path.read_text()


def test_a_study_file_that_is_no_text(suboctave, tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xff\xfe\x00binary")
    status, _, err = suboctave("check", path)
    assert status == 2
    assert "UTF-8" in err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_a_study_file_that_never_ends(suboctave, tmp_path):
    os.mkfifo(tmp_path / "a.toml")
    status, _, err = suboctave("check", tmp_path / "a.toml")
    assert status == 2
    assert "no ordinary file" in err


def test_a_mark_of_byte_order_is_no_mistake(suboctave, tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbf" + DUFFING.replace("\n", "\r\n").encode())
    assert suboctave("check", path)[0] == 0


@pytest.mark.parametrize("command", ["new", "check", "run", "show"])
def test_a_name_too_long_for_the_disk(command, suboctave, tmp_path):
    status, out, err = suboctave(command, tmp_path / f"{'a' * 400}.toml")
    assert (status, out) == (2, "")
    assert "too long" in err
    assert "Errno" not in err


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="names of files are texts")
def test_a_name_that_is_no_utf8(tmp_path):
    """Everything that prints or saves it, on a terminal that takes UTF-8 alone."""
    name = os.fsdecode(b"tr\xe4ger")
    text = DUFFING.split('[[analyses]]\nname = "up"')[0] + '\n[outputs]\nhtml = "a.html"\n'
    (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8:strict", "PYTHONUTF8": "1"}

    def call(*arguments):
        command = [sys.executable, "-m", "suboctave", *arguments]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    for command, file in (("run", f"{name}.toml"), ("show", f"{name}_results/results.nc"), ("new", f"{name}2.toml")):
        answer = call(command, file)
        assert (answer.returncode, answer.stderr) == (0, "")
    answer = call("check", f"{name}3.toml")
    assert (answer.returncode, "tr\\xe4ger3.toml" in answer.stderr) == (2, True)


@pytest.mark.skipif(os.name != "posix", reason="names of files are texts")
def test_a_structure_of_such_a_name_prints_and_is_saved(tmp_path):
    path = tmp_path / os.fsdecode(b"tr\xe4ger.npz")
    np.savez(path, M=np.eye(2), K=np.array([[2.0, -1.0], [-1.0, 2.0]]))
    structure = so.read_structure(path)
    assert structure.name == "tr\\xe4ger"
    system = structure.system([so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.1)])
    str(system).encode("utf-8")
    structure.save(path)
    assert so.read_structure(path).name == structure.name
    with pytest.raises(so.InputError, match="no file") as caught:
        so.read_structure(tmp_path / os.fsdecode(b"gr\xf6\xdfe.npz"))
    str(caught.value).encode("utf-8")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_results_file_cut_short(results, suboctave, share):
    whole = results.read_bytes()
    results.write_bytes(whole[: int(share * len(whole))])
    status, out, err = suboctave("show", results)
    assert (status, out) == (2, "")
    assert "results.nc" in err


def test_a_results_file_that_is_another_file(results, suboctave):
    results.write_text("omega,amplitude\n1.0,2.0\n")
    status, _, err = suboctave("show", results)
    assert status == 2
    assert "not a NetCDF" in err


def test_a_matrix_file_that_is_none(study_file, suboctave, tmp_path):
    for name in ("M.npy", "M.npz", "M.mtx", "M.mat", "M.csv"):
        (tmp_path / name).write_bytes(b"certainly no matrix \x00")
        status, _, err = suboctave("check", study_file(DUFFING.replace("mass = 1.0", f'mass = "{name}"')))
        assert status == 2
        assert f"cannot read {tmp_path / name}" in err


def test_pickled_objects_are_not_loaded(study_file, suboctave, tmp_path):
    class Bomb:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "exploded"),)

    np.save(tmp_path / "M.npy", np.array([Bomb()], dtype=object), allow_pickle=True)
    assert suboctave("check", study_file(DUFFING.replace("mass = 1.0", 'mass = "M.npy"')))[0] == 2
    assert not (tmp_path / "exploded").exists()


# ------------------------------------------------------------------------------------ forces that fail in the middle
OWN = """
import numpy as np
import suboctave as so

class Brittle(so.CubicSpring):
    def tangent(self, u, v, c):
        f, f_u, f_v = super().tangent(u, v, c)
        return np.where(np.abs(u) > 0.8, np.nan, f), f_u, f_v

    def sampling(self, c):
        from suboctave.model.elements.smoothness import AdaptiveSampling
        return AdaptiveSampling()
"""


@pytest.mark.parametrize(
    ("old", "new"), [("alpha = 1.0", "alpha = 1e300"), ("omega = [3.0, 0.5]", "omega = [3.0, 1e300]")]
)
def test_sizes_beyond_numbers_are_a_failure_in_words(old, new, study_file, suboctave):
    text = DUFFING.split('[[analyses]]\nname = "up"')[0].replace(old, new)
    status, out, err = suboctave("run", study_file(text))
    assert status == 1, err
    assert "choose units" in " ".join(out.split())


def test_a_force_that_is_no_number_midway_ends_the_curve_with_a_reason(study_file, suboctave, tmp_path, monkeypatch):
    (tmp_path / "brittle_of_a_test.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    text = DUFFING.replace("CubicSpring", "brittle_of_a_test:Brittle").split('[[analyses]]\nname = "up"')[0]
    path = study_file(text)
    status, out, err = suboctave("run", path, "--allow-code")
    said = " ".join(out.split())
    assert status in (0, 1), err  # what was computed before is kept either way
    assert "finite" in said, said
    branch = so.load(tmp_path / "study_results" / "results.nc")["response"]
    assert len(branch) > 3
    assert branch.amplitude.max() < 0.81
