"""The steps "regime_map" and "isola_map" of study files: tables as by a script; mistakes are told with their keys."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.store.table import Table
from suboctave.study.file import read_study
from suboctave.study.screen import console
from suboctave.study.shown import print_result

ONE_MASS = (Path(__file__).parent / "one_mass.toml").read_text(encoding="utf-8")
STUDY = f"""
title = "regimes"
{ONE_MASS}[[analyses]]
name = "regimes"
type = "regime_map"
omega = [2.0, 0.8]
parameter = "F"
bounds = [0.05, 0.4]
harmonics = 1
depth = 0
values = 2
"""
ISOLAS = (
    STUDY[: STUDY.index('name = "regimes"')]
    + """
name = "region"
type = "isola_map"
omega = [0.8, 3.0]
parameter = "F"
bounds = [0.1, 0.25]
second = "k1"
second_bounds = [0.95, 1.3]
"""
)


def test_as_by_a_script(study_file, suboctave):
    path = study_file(STUDY)
    status, _, err = suboctave("run", path)
    assert status == 0, err
    table = so.load(path.parent / "study_results" / "results.nc")["regimes"]
    study = read_study(path)
    expected = so.regime_map(study.system, (2.0, 0.8), "F", (0.05, 0.4), harmonics=1, depth=0, values=2).to_table()
    assert list(table.columns) == list(expected.columns)
    for name in ("period", "F", "from omega", "to omega"):
        np.testing.assert_allclose(table[name], expected[name], rtol=1e-9)
    assert set(table["to kind"]) == {"LP", "range"}
    assert table.result.label(1.0, 0.1).count == 1  # the map itself is kept with it


@pytest.mark.slow
def test_a_region_of_isolas(study_file, suboctave):
    head = '[system]\nlibrary = "nltva"\nparameters = { F = 0.15 }\n'
    path = study_file('title = "isolas"\n' + head + "[[analyses]]\n" + ISOLAS[ISOLAS.index('name = "region"') :])
    status, _, err = suboctave("run", path)
    assert status == 0, err
    table = so.load(path.parent / "study_results" / "results.nc")["region"]
    # the two ends meet at k1 = 1.1552
    assert table["k1"].max() == pytest.approx(1.15517, abs=1e-4)
    assert set(table["border"]) == {"birth (isola centre)", "merging"}


def test_an_analysis_that_found_nothing_is_shown(capsys):
    print_result(console(), "region", Table({}, "no isola was found"))
    assert capsys.readouterr().out == "\nregion: no isola was found\n"


@pytest.mark.parametrize(
    ("text", "old", "new", "words"),
    [
        (STUDY, 'parameter = "F"', 'parameter = "f"', ["parameter", "did you mean 'F'"]),
        (STUDY, 'parameter = "F"', 'parameter = "omega"', ["parameter", "omega varies anyway"]),
        (STUDY, "bounds = [0.05, 0.4]", "bounds = [0.4, 0.4]", ["bounds", "different"]),
        (STUDY, "omega = [2.0, 0.8]", "omega = [2.0, -0.8]", ["omega", "positive"]),
        (STUDY, "depth = 0", "depth = -1", ["depth"]),
        (STUDY, "depth = 0", "search = [3, 0]", ["search", "1 or more"]),
        (STUDY, "depth = 0", "parameters = { F = 1.0 }", ["parameters", "varies"]),
        (STUDY, "depth = 0", "observe = 3", ["observe", "out of range"]),
        (ISOLAS, 'second = "k1"', 'second = "F"', ["second", "another parameter"]),
        (ISOLAS, 'second = "k1"', 'second = "alph"', ["second", "did you mean 'alpha'"]),
        (ISOLAS, 'second = "k1"', 'second = "alpha"\nvalues = [0.3]', ["values", "not [0.3]"]),
        (ISOLAS, 'second = "k1"\nsecond_bounds = [0.95, 1.3]', 'second = "alpha"\nsecond_bounds = [2.0, 3.0]',
         ["second_bounds", "system's own alpha = 1"]),
    ],
)  # fmt: skip
def test_mistakes(study_file, suboctave, text, old, new, words):
    assert old in text
    status, _, err = suboctave("check", study_file(text.replace(old, new)))
    assert status != 0
    for word in words:
        assert word in err, err
