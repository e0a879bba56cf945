"""Every figure of the gallery runs from top to bottom, its assertion holds, what it computes lists the events that are
recorded of it, and no texts of its figures lie on each other."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from event_tables import against_recorded, recording
from overlaps import labels_on_curves, overlapping_texts, written_figures

FOLDER = Path(__file__).parents[2] / "examples" / "gallery"
SCRIPTS = sorted(FOLDER.glob("fig*.py"))
PAGE = Path(__file__).parents[2] / "docs" / "published_study.md"


def run(script, arguments, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr(sys, "argv", [str(script), *arguments])
    runpy.run_path(str(script), run_name="__main__")


def test_the_page_tells_of_all_figures():
    page = PAGE.read_text()
    assert len(SCRIPTS) >= 10
    for script in SCRIPTS:
        assert f"examples/gallery/{script.name}" in page
    for picture in (PAGE.parent / "images" / "gallery").iterdir():
        assert f"images/gallery/{picture.name}" in page


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_figure(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    several = "space.png]" in script.read_text()
    names = ["figure.png", "space.png"] if several else ["figure.png"]
    with recording() as tables, written_figures() as figures:
        run(script, names, monkeypatch)
    assert [(overlapping_texts(figure), labels_on_curves(figure)) for figure in figures] == [([], []) for _ in names]
    assert not against_recorded(script.stem, tables)
    assert sorted(path.name for path in tmp_path.iterdir()) == names


@pytest.mark.slow
def test_without_a_path_the_figure_has_the_name_of_the_script(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(FOLDER / "fig08_phase_portraits.py", [], monkeypatch)
    assert [path.name for path in tmp_path.iterdir()] == ["fig08_phase_portraits.png"]
