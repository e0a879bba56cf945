"""The command line: what it prints, where it writes, and that a failure is one sentence."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

import suboctave
from suboctave.study import cli, demo


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
