"""The steps "lyapunov_exponents" and "basins": from a file what the verbs give, and their mistakes."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.store.journal import Journal
from suboctave.study.file import read_study
from suboctave.study.runner import Noting, recovered, run_study

STUDY = """
title = "basins"
[system]
library = "duffing"
parameters = { c = 0.1, F = 0.3 }
[[analyses]]
name = "response"
type = "frequency_response"
omega = [3.0, 0.5]
[[analyses]]
name = "rates"
type = "lyapunov_exponents"
omega = 1.5
periods = 200
trajectories = 4
[[analyses]]
name = "shares"
type = "basins"
omega = 1.5
box = [[-2.0, 2.0], [-2.0, 2.0]]
grid = [12, 10]
branches = ["response"]
[[analyses]]
name = "states"
type = "basins"
omega = 1.5
box = [[-2.0, 2.0], [-2.0, 2.0]]
grid = [12, 10]
what = "states"
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The study, and what running it gave."""
    path = tmp_path_factory.mktemp("chaos") / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    study = read_study(path)
    return study, run_study(study)


def test_as_by_a_script(ran):
    done = ran[1].finished
    found_by = dict(zip(("response", "rates", "shares", "states"), (one.result for one in done), strict=True))
    system = so.library.duffing(c=0.1, F=0.3)
    rates = so.lyapunov_exponents(system, omega=1.5, periods=200, trajectories=4)
    assert np.array_equal(found_by["rates"]["exponent"], rates.exponents)
    found = so.basins(system, omega=1.5, box=((-2.0, 2.0), (-2.0, 2.0)), grid=(12, 10))
    assert sorted(found_by["shares"]["share"]) == pytest.approx(sorted(found.shares.values()))
    assert set(found_by["shares"]["name"]) == {"response", "response (2)"}
    names = [found.names[i] for i in found.labels.ravel().tolist()]
    assert found_by["states"]["motion"].tolist() == names
    assert found_by["states"]["x_0"][:12].tolist() == found.x.tolist()


def test_files_and_journals_hold_all_of_it(ran, tmp_path):
    study, outcome = ran
    results = so.load(outcome.files[0])
    journal = Journal.create(tmp_path / "a.journal")
    for step in study.steps:
        table = results[step.name]
        Noting(journal, step.name, step.name).finish(table, 1.0)
        if step.name == "response":
            continue
        (first,) = (one.result for one in outcome.finished if one.step.name == step.name)
        again, _ = Noting(journal, step.name, step.name).finished()
        for other in (table, again):
            xr.testing.assert_identical(first.result.to_xarray(), other.result.to_xarray())
    assert [item.branches for item in recovered(tmp_path / "a.journal")] == [None] * 4
    assert isinstance(results["shares"].result, so.Basins)
    assert isinstance(results["rates"].result, so.LyapunovExponents)
    assert results["states"].result.plot()


@pytest.mark.parametrize(
    ("change", "to", "said"),
    [
        ("omega = 1.5\nperiods", "omega = -1.5\nperiods", "greater than 0"),
        ('branches = ["response"]', 'branches = ["respons"]', "'response'"),
        ("grid = [12, 10]\nbranches", "grid = [12, 0]\nbranches", "positive"),
        ('what = "states"', 'what = "states"\ncoordinates = ["x_0", "v_1"]', "v_0"),
        ("trajectories = 4", "trajectories = 4\ncount = 3", "at most 2"),
        ("trajectories = 4", "trajectories = 4\nstart = [1.0]", "2 finite numbers"),
    ],
)
def test_mistakes(study_file, suboctave, change, to, said):
    assert change in STUDY
    status, _, err = suboctave("run", study_file(STUDY.replace(change, to)))
    assert status != 0
    assert said in err
