"""The step "find_isolas" of study files: as by a script, kept when a run is stopped, drawn, and its mistakes told."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import suboctave as so
from suboctave.store.journal import Journal
from suboctave.study.file import read_study
from suboctave.study.runner import JOURNAL, Noting, recovered, run_study
from suboctave.study.steps.maps import FindIsolas

SYSTEM = """
title = "a third of the frequency"
[system]
mass = 1.0
damping = 0.02
stiffness = 1.0
parameters = { F = 5.0, alpha = 0.05 }
elements = [{ type = "CubicSpring", dof = 0, coefficient = "alpha" }]
loads = [{ type = "HarmonicLoad", dof = 0, amplitude = "F" }]
"""
ISOLAS = """
[[analyses]]
name = "isolas"
type = "find_isolas"
omega = [2.5, 9.0]
parameter = "F"
bounds = [0.1, 5.0]
values = [5.0]
search = [3]
harmonics = 3
at = [4.0, 1.0]
"""
#: with a few seeds of sub-harmonic motions, and nothing else
QUICK = ISOLAS + "depth = 0\nlevels = []\nseeds = { frequencies = 4, phases = 2, modes = 1 }\n"
LATER = """
[[analyses]]
name = "witness"
type = "verify"
branch = { analysis = "isolas", isola = 0, at = 4.0 }
what = "points"
every = 20
[[analyses]]
name = "births"
type = "track"
start = { analysis = "isolas", isola = 0, bifurcation = "isola_centre" }
parameter = "alpha"
bounds = [0.04, 0.06]
[[analyses]]
name = "beyond"
type = "continue_branch"
start = { analysis = "isolas", isola = 0, at = 4.0, bifurcation = "LP", index = 0 }
parameter = "omega"
bounds = [2.0, 9.0]
"""
OUTPUTS = """
[outputs]
csv = true
html = "report.html"
[[outputs.figures]]
kind = "boundary"
file = "plane.svg"
analyses = ["isolas"]
[[outputs.figures]]
kind = "space"
file = "space.png"
analyses = ["isolas"]
at = [4.0]
[[outputs.figures]]
file = "closed.png"
analyses = ["isolas"]
labels = ["closed"]
at = [4.0]
[[outputs.figures]]
kind = "phase"
file = "birth.png"
motions = [{ analysis = "isolas", isola = 0, bifurcation = "isola_centre" }]
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    path = tmp_path_factory.mktemp("isolas") / "study.toml"
    path.write_text(SYSTEM + QUICK + LATER + OUTPUTS, encoding="utf-8")
    return run_study(read_study(path)), path.parent / "study_results"


def test_as_by_a_script(ran):
    outcome, folder = ran
    assert not outcome.failed
    found = so.load(folder / "results.nc")["isolas"]
    study = read_study(folder.parent / "study.toml")
    few = {"depth": 0, "levels": (), "seeds": so.Seeds(4, 2, 1)}
    isolas = so.find_isolas(study.system, (2.5, 9.0), "F", (0.1, 5.0), harmonics=3, values=[5.0], search=(3,), **few)
    assert found[0].range == pytest.approx(isolas[0].range, rel=1e-9)
    assert found[0].known[4.0].omega == pytest.approx(isolas[0].at(4.0).omega, rel=1e-9)
    assert found.notes == ("no isola was found at F = 1",)


def test_what_starts_from_it(ran):
    results = {item.step.name: item.result for item in ran[0].finished}
    # the first point is a limit point: there verdicts cannot be compared
    assert len(results["witness"]) > 3
    assert all(results["witness"]["agrees"][1:])
    births = results["births"]
    assert set(births.isola) == {"isola_centre"}
    # in units of x sqrt(alpha) one load alone counts
    assert births.parameter("alpha") * births.parameter("F") ** 2 == pytest.approx(
        0.05 * results["isolas"][0].born ** 2
    )
    assert results["beyond"].closed


def test_what_is_written(ran):
    _, folder = ran
    frame = pd.read_csv(folder / "isolas.csv")
    assert "shrinks to a point" in frame["at_from"][0]
    assert len(pd.read_csv(folder / "isolas_points.csv")) == len(ran[0].finished[0].result.limit_points[0])
    assert (folder / "isolas_bifurcations.csv").exists()
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "shrinks to a point (isola centre)" in page
    assert "isola at F = 4" in page
    assert "no isola was found at F = 1" in page
    assert 'gid="isola"' in (folder / "plane.svg").read_text() or 'id="isola"' in (folder / "plane.svg").read_text()
    for name in ("space.png", "closed.png", "birth.png"):
        assert (folder / name).stat().st_size > 5000


def test_the_terminal(ran, suboctave):
    status, out, err = suboctave("show", ran[1] / "results.nc")
    assert status == 0, err
    assert "isola 0 at F = 4: omega from" in out
    assert "note: no isola was found at F = 1" in out
    said = json.loads(suboctave("show", ran[1] / "results.nc", "--json")[1])
    (isola,) = said["analyses"]["isolas"]["isolas"]
    assert isola["merges"] is None
    assert isola["born"] == float(ran[0].finished[0].result[0].born)
    assert {part["at"] for part in isola["closed"]} >= {4.0}


def test_a_finished_search_is_kept_by_the_journal(ran, tmp_path):
    result = ran[0].finished[0].result
    journal = Journal.create(tmp_path / "journal")
    Noting(journal, "isolas", "key").finish(result, 1.0)
    journal.close()
    journal = Journal.reopen(tmp_path / "journal")
    again, said = Noting(journal, "isolas", "key").finished()
    journal.close()
    assert repr(again) == repr(result)
    assert said["seconds"] == 1.0
    assert np.array_equal(again[0].known[4.0].omega, result[0].known[4.0].omega)
    (item,) = recovered(tmp_path / "journal")
    assert (item.state, item.branches) == ("finished", 1 + len(result[0].known))


def test_resume_does_not_search_again(ran, study_file, monkeypatch):
    study = read_study(study_file(SYSTEM + ISOLAS))
    result = ran[0].finished[0].result
    # as if it had been killed before the results were written
    study.folder.mkdir()
    held = Journal.create(study.folder / JOURNAL)
    Noting(held, "isolas", study.keys[study.steps[0].name]).finish(result, 1.0)
    held.close()
    monkeypatch.setattr(FindIsolas, "run", None)
    again = run_study(study, resume=True)
    assert again.finished[0].reused
    assert repr(again.finished[0].result) == repr(result)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('parameter = "F"', 'parameter = "f"', "unknown parameter 'f'"),
        ('parameter = "F"', 'parameter = "omega"', "is the design parameter, beside omega"),
        ("bounds = [0.1, 5.0]", "bounds = [5.0, 5.0]", "two different finite ends"),
        ("values = [5.0]", "values = 1", "must be at least 2"),
        ("values = [5.0]", "values = [6.0]", "from 0.1 to 5, not [6.0]"),
        ("at = [4.0, 1.0]", "at = [4.0, 0.0]", "0 lies outside the bounds"),
        ("search = [3]", "search = [0]", "2 or more"),
        ("search = [3]", "levels = [-2.0]", "positive numbers"),
        ("search = [3]", "serach = [3]", "did you mean 'search'"),
        ("search = [3]", "seeds = { frequencys = 3 }", "did you mean 'frequencies'"),
        ("harmonics = 3", 'harmonics = "adaptve"', "adaptive"),
        ("harmonics = 3", "seconds = 0.0", "greater than 0"),
        ("harmonics = 3", "events = []", "there is no such key"),
        ("omega = [2.5, 9.0]", "omega = [0.0, 9.0]", "frequencies are positive"),
        ("isola = 0, at = 4.0 }", "at = 4.0 }", "say which, and at which value"),
        ("isola = 0, at = 4.0 }", "branch = 0 }", "gives isolas, not a diagram"),
        ('isola = 0, bifurcation = "isola_centre" }', 'isola = 0, bifurcation = "isola_center" }', "isola_centre"),
        ('bifurcation = "isola_centre" }', 'at = 4.0, bifurcation = "isola_centre" }', "leave at out"),
        ('{ analysis = "isolas", isola = 0, bifurcation', '{ analysis = "witness", bifurcation', "no branch"),
        ('analyses = ["isolas"]\nat', 'analyses = ["isola"]\nat', "no analysis 'isola' gives a curve"),
    ],
)
def test_mistakes(study_file, suboctave, old, new, message):
    text = SYSTEM + ISOLAS + LATER + OUTPUTS
    line = 1 + text.count("\n", 0, text.index(old))
    status, _, err = suboctave("check", study_file(text.replace(old, new, 1)))
    assert status == 2
    assert message in " ".join(err.split()), err
    assert f"line {line}:" in err, err


def test_a_branch_that_is_not_there(ran):
    from suboctave.study.steps.base import Motion

    results = {"isolas": ran[0].finished[0].result}
    with pytest.raises(so.InputError, match="only 1 isola"):
        Motion(analysis="isolas", isola=3, at=4.0).chosen(results)
    with pytest.raises(so.InputError, match="cuts its range"):
        Motion(analysis="isolas", isola=0, bifurcation="isola_merging").chosen(results)
