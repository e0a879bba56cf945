"""Every example runs from top to bottom, its assertion holds, what it computes lists the events that are recorded of
it, and it draws its figure only when told where."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from event_tables import against_recorded, recording

FOLDER = Path(__file__).parents[2] / "examples"
SCRIPTS = sorted(FOLDER.glob("ex*.py"))


def test_there_are_examples():
    assert len(SCRIPTS) >= 6


#: longer than the others, each on a subject that has tests of its own
LONG = (
    "ex16_isola",
    "ex17_isolas_as_published",
    "ex21_damping_against_isolas",
    "ex22_regimes",
    "ex23_chaos",
    "ex24_basins",
    "ex27_how_far_from_an_isola",
    "ex31_isola_under_tolerances",
)


#: what some need beside the package: parts of the extra `fe`
NEEDS = {"ex26_plate_with_stops": "skfem"}


@pytest.mark.parametrize(
    "script",
    [pytest.param(path, marks=[pytest.mark.slow] if path.stem in LONG else []) for path in SCRIPTS],
    ids=lambda path: path.stem,
)
def test_example(script, tmp_path, monkeypatch):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script), "figure.png"])
    with recording() as tables:
        runpy.run_path(str(script), run_name="__main__")
    assert not against_recorded(script.stem, tables)
    assert [path.name for path in tmp_path.iterdir()] == ["figure.png"]


def test_without_a_path_nothing_is_written(tmp_path, monkeypatch):
    script = FOLDER / "ex02_tuned_absorber.py"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")
    assert not list(tmp_path.iterdir())
