"""Every example runs from top to bottom, its assertion holds, what it computes lists the events that are recorded of
it, and its figure is written, without texts that lie on each other."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from event_tables import against_recorded, recording
from overlaps import labels_on_curves, overlapping_texts, written_figures

FOLDER = Path(__file__).parents[2] / "examples"
SCRIPTS = sorted(FOLDER.glob("ex*.py"))


def test_there_are_examples():
    assert len(SCRIPTS) >= 6


#: longer than the others, each on a subject that has tests of its own
LONG = (
    "ex16_isola",
    "ex17_isolas_as_published",
    "ex18_isola_merging",
    "ex21_damping_against_isolas",
    "ex22_regimes",
    "ex23_chaos",
    "ex24_basins",
    "ex26_plate_with_stops",
    "ex27_how_far_from_an_isola",
    "ex31_isola_under_tolerances",
    "ex32_equal_blades",
)


#: what some need beside the package: parts of the extra `fe`
NEEDS = {"ex26_plate_with_stops": "skfem"}


@pytest.mark.parametrize(
    "script",
    [pytest.param(path, marks=[pytest.mark.slow] if path.stem in LONG else []) for path in SCRIPTS],
    ids=lambda path: path.stem,
)
def test_example(script, tmp_path, monkeypatch, capsys):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script)])
    with recording() as tables, written_figures() as figures:
        runpy.run_path(str(script), run_name="__main__")
    assert not against_recorded(script.stem, tables)
    assert [path.name for path in tmp_path.iterdir()] == [f"{script.stem}.png"]
    assert f"figure: {script.stem}.png" in capsys.readouterr().out
    assert [(overlapping_texts(figure), labels_on_curves(figure)) for figure in figures] == [([], [])]
