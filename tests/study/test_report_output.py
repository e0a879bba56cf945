"""Report pages that a study asks for: checked before the run, written with its curves."""

from __future__ import annotations

import importlib.machinery
import sys
import types
from pathlib import Path

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")


def test_a_report_page_gets_the_curves(study_file, suboctave, monkeypatch):
    report = types.ModuleType("suboctave.pictures.report")
    report.__spec__ = importlib.machinery.ModuleSpec("suboctave.pictures.report", None)
    got = {}

    def write_report(results, path, *, title, overwrite=False, failures=None):
        got.update(names=list(results), title=title, overwrite=overwrite, omega=results["up"].omega.size)
        Path(path).write_text("<html>")

    report.write_report = write_report
    monkeypatch.setitem(sys.modules, "suboctave.pictures.report", report)
    path = study_file(DUFFING + '[outputs]\nhtml = "report.html"\n')
    assert suboctave("run", path)[0] == 0
    assert (path.parent / "study_results" / "report.html").read_text() == "<html>"
    assert got["names"] == ["response", "up"]
    assert (got["title"], got["overwrite"]) == ("Duffing", True)
    assert got["omega"] > 3


def test_a_report_page_is_in_order_and_a_mistake_in_it_is_not(study_file, suboctave):
    assert suboctave("check", study_file(DUFFING + '[outputs]\nhtml = "report.html"\n'))[0] == 0
    status, _, err = suboctave("check", study_file(DUFFING + "[outputs]\nhtml = 3\n"))
    assert status == 2
    assert "html" in err
