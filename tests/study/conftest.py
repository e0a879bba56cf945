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


@pytest.fixture(scope="session")
def equal():
    """Compares two branches, bit for bit: points, bifurcations, multipliers, options."""

    def compare(a, b):
        assert len(a) == len(b)
        for x, y in zip(a.points, b.points, strict=True):
            assert x.orbit.coefficients.tobytes() == y.orbit.coefficients.tobytes()
            assert (x.orbit.omega, dict(x.orbit.values)) == (y.orbit.omega, dict(y.orbit.values))
            assert x.floquet.multipliers.tobytes() == y.floquet.multipliers.tobytes()
            assert x.arclength == y.arclength
        assert repr(a) == repr(b)
        assert a.options == b.options

    return compare
