"""The command line: what it prints, where it writes, and that a failure is one sentence."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import suboctave
from suboctave.atomic import replace_file
from suboctave.study import cli, demo, shown


def run(*arguments, check=0, cwd=None):
    done = subprocess.run(
        [sys.executable, "-m", "suboctave", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=cwd,
    )
    assert done.returncode == check, done.stdout + done.stderr
    return done


def test_version():
    assert run("--version").stdout.strip() == f"suboctave {suboctave.__version__}"


def test_help_names_the_demo():
    assert "demo" in run("--help").stdout


def test_a_mistyped_command_is_one_message():
    done = run("dmeo", check=2)
    assert "dmeo" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_folder_that_cannot_be_made_is_known_before_the_work(tmp_path):
    (tmp_path / "taken").write_text("a file")
    done = run("demo", "--out", str(tmp_path / "taken"), check=2)
    assert done.stderr.startswith("suboctave: ")
    assert "Traceback" not in done.stderr
    assert not done.stdout


def test_the_demo_prints_tables_of_80_columns_and_writes_figures(tmp_path, capsys):
    demo.run_demo(tmp_path / "new")
    printed = capsys.readouterr()
    assert not printed.err  # nobody watches: no bar
    told = [line for line in printed.out.splitlines() if not line.startswith(("figure:", "up to j"))]
    assert max(map(len, told)) <= 80
    # where shooting puts the border's end and the isola's birth
    assert "gaps up to j = 0.17713" in printed.out
    assert "up to j = 0.57989" in printed.out
    assert len(re.findall(r"^ *PD +\d\.\d{8} +\d\.\d{6,8} +-[01]\.\d{6} +\de-\d+ *$", printed.out, re.M)) == 6
    assert len(re.findall(r"^ *grazing .* ± \d\.\d{5}i", printed.out, re.MULTILINE)) == 4
    assert (
        len(re.findall(r"\d+ points in \d+\.\d\d s; reached the end of the range at omega = 1.25.", printed.out)) == 3
    )
    for name in ("weak_forcing.png", "strong_forcing.png", "cascade.png", "boundary.png", "isola.png"):
        assert (tmp_path / "new" / name).read_bytes().startswith(b"\x89PNG")
        assert name in printed.out


def test_ctrl_c_keeps_what_was_computed(monkeypatch, tmp_path, capsys):
    def stop(share, text):
        if share > 0.3:
            raise KeyboardInterrupt

    whole = demo.compute
    monkeypatch.setattr(demo, "compute", lambda case, progress: whole(case, stop))
    with pytest.raises(KeyboardInterrupt):
        demo.run_demo(tmp_path)
    assert capsys.readouterr().out.count("interrupted at omega = ") == 1  # the other cases are not begun
    assert [path.name for path in tmp_path.iterdir()] == ["weak_forcing.png"]


def test_an_error_of_ours_is_one_sentence(monkeypatch, capsys):
    def refuse():
        raise suboctave.ConvergenceError("no motion found at omega = 4.5; give a start")

    monkeypatch.setattr(cli, "application", refuse)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 1
    assert capsys.readouterr().err == "suboctave: no motion found at omega = 4.5; give a start\n"


def test_ctrl_c_has_the_status_a_shell_expects(monkeypatch, capsys):
    def stop():
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "application", stop)
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 130


def test_negative_damping_is_a_note_once_and_the_study_runs(study_file, suboctave):
    path = study_file()
    path.write_text(path.read_text().replace('damping = "c"', 'damping = "-c"'))
    status, out, err = suboctave("check", path)
    assert status == 0
    assert err.count("note: the damping matrix feeds energy into some motions") == 1
    assert "damping_check" not in err
    assert "in order" in out


def test_ctrl_c_inside_a_command_is_said(monkeypatch, suboctave, study_file):
    """Typer ends a command that is interrupted without a word."""

    def stop(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr("suboctave.study.file.read_study", stop)
    status, _, said = suboctave("check", study_file())
    assert (status, said) == (130, "interrupted\n")


def test_a_sweep_that_is_stopped_before_its_first_point_says_so_and_leaves_nothing(monkeypatch, suboctave, study_file):
    def stop(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr("suboctave.study.sweeps.verb.completed", stop)
    study = study_file()
    folder = study.parent / "swept"
    status, _, said = suboctave("sweep", study, "--grid", "F=0.1,0.2", "--out", folder)
    assert status == 130
    assert said.endswith("interrupted before the first point was computed: nothing is kept\n")
    assert list(folder.iterdir()) == []


def test_the_command_that_goes_on_is_whole(monkeypatch, suboctave, study_file):
    study = study_file()
    folder = study.parent / "else where"
    status, out, _ = suboctave("run", study, "--out", folder, "--seconds", "0.05")
    assert status == 1
    again = out.partition("go on: suboctave ")[2].strip()
    assert shlex.split(again) == ["run", str(study), "--out", str(folder), "--resume"]
    assert suboctave(*shlex.split(again))[0] == 0  # it does


def test_a_full_disk_is_said_with_the_file(tmp_path):
    """/dev/full answers as a full disk does; HDF5 says the number of the failure in its own words."""
    target = tmp_path / "table.csv"
    for fails in (
        lambda place: Path("/dev/full").write_text("x"),
        lambda place: (_ for _ in ()).throw(OSError("Can't write data (file write failed: errno = 28, error message")),
    ):
        with pytest.raises(OSError, match="No space left on device") as full:
            replace_file(target, fails)
        assert (full.value.filename, full.value.errno) == (str(target), 28)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("values", "span"),
    [
        ([2.5, 1.0, 0.5], "2.5 to 0.5"),
        ([0.1, 0.3, 0.1], "between 0.1 and 0.3"),
        ([0.1, 0.4, 0.2], "between 0.1 and 0.4"),
        ([0.1], "at 0.1"),
    ],
)
def test_the_path_of_a_curve_that_turns_back_is_what_it_covers(values, span):
    assert shown._span(np.array(values)) == span
