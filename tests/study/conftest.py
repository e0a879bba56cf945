"""Small studies that run in a second, and the command line in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from suboctave.study import cli

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")


@pytest.fixture
def study_file(tmp_path):
    """Writes a study file; by default the Duffing one."""

    def write(text=DUFFING, name="study.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def suboctave(monkeypatch, capsys):
    """The command line: returns its exit status, what it printed and what it complained of."""

    def call(*arguments):
        monkeypatch.setattr("sys.argv", ["suboctave", *map(str, arguments)])
        status = 0
        try:
            cli.main()
        except SystemExit as stop:
            status = stop.code or 0
        said = capsys.readouterr()
        assert "Traceback" not in said.err + said.out
        return status, said.out, said.err

    return call
