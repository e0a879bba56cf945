"""Studies with a time limit, of one analysis or of all: what is there is kept, what is not complete is done again."""

from __future__ import annotations

import json

import pytest

import suboctave as so
from suboctave import interruption
from suboctave.interruption import Interruption
from suboctave.study.file import read_study
from suboctave.study.mistakes import StudyError
from suboctave.study.runner import JOURNAL, run_study

SYSTEM = """
title = "limits"

[system]
mass = 1.0
damping = 0.1
stiffness = 1.0
parameters = { F = 0.3 }
elements = [ { type = "CubicSpring", dof = 0, coefficient = 1.0 } ]
loads = [ { type = "HarmonicLoad", dof = 0, amplitude = "F" } ]
"""
DOWN = """
[[analyses]]
name = "down"
type = "frequency_response"
omega = [3.0, 0.5]
max_step = 0.3
harmonics = 5
"""
ALONG = """
[[analyses]]
name = "along"
type = "continue_branch"
start = { analysis = "down", nearest = { omega = 2.0 } }
parameter = "F"
bounds = [0.1, 0.5]
max_step = 0.3
"""
UP = """
[[analyses]]
name = "up"
type = "frequency_response"
omega = [0.5, 1.2]
max_step = 0.3
harmonics = 5
"""
BASINS = """
[[analyses]]
name = "basins"
type = "basins"
omega = 1.4
box = [[-2.0, 2.0], [-2.0, 2.0]]
grid = [20, 20]
"""


@pytest.fixture
def ticks(monkeypatch):
    """A clock that moves on by one second whenever a time limit is looked at."""

    class Clock:
        now = 0.0

        def __call__(self):
            self.now += 1.0
            return self.now

    clock = Clock()
    monkeypatch.setattr(interruption, "monotonic", clock)
    return clock


def test_an_analysis_that_ran_into_its_limit_is_done_again_and_so_is_what_starts_from_it(study_file, equal, ticks):
    path = study_file(SYSTEM + DOWN + "seconds = 40\n" + ALONG + UP)
    outcome = run_study(read_study(path))
    assert outcome.interruption == Interruption(40.0)
    assert [item.step.name for item in outcome.finished] == ["down", "along", "up"]
    results = so.load(outcome.files[0])
    assert results["down"].interruption == Interruption(40.0)
    assert not results["up"].interrupted
    assert (outcome.files[0].parent / JOURNAL).exists()
    # more time makes no other analysis of it: what was complete is taken over
    study_file(SYSTEM + DOWN + "seconds = 1e9\n" + ALONG + UP)
    again = run_study(read_study(path), resume=True)
    assert [item.reused for item in again.finished] == [False, False, True]
    assert not again.interrupted
    assert not (outcome.files[0].parent / JOURNAL).exists()
    system = read_study(path).system
    equal(again.finished[0].result, so.frequency_response(system, (3.0, 0.5), max_step=0.3, harmonics=5))
    assert len(again.finished[1].result) > 3


@pytest.mark.parametrize("given", ["key", "option"])
def test_a_study_that_ran_into_its_limit_ends_there_and_goes_on(study_file, suboctave, ticks, given):
    text = SYSTEM + UP + DOWN + ALONG
    path = study_file(text.replace('title = "limits"', 'title = "limits"\nseconds = 150') if given == "key" else text)
    options = ("--seconds", "150") if given == "option" else ()
    status, out, err = suboctave("run", path, *options)
    assert status == 1, err
    assert "the time limit of 150 s was reached" in " ".join(out.split())
    assert "--resume" in out
    results = so.load(path.parent / "study_results" / "results.nc")
    assert list(results) == ["up", "down"]
    assert (results["up"].interrupted, results["down"].interrupted) == (False, True)
    status, out, _ = suboctave("run", path, "--resume", "--seconds", "1e9", "--json")
    told = json.loads(out)
    assert (status, told["ok"], told["interrupted"]) == (0, True, False)
    assert [item["reused"] for item in told["analyses"]] == [True, False, False]


def test_the_nearer_limit_counts_and_a_limit_before_any_result_is_a_failure(study_file, suboctave, ticks):
    path = study_file(SYSTEM + DOWN + "seconds = 1\n" + UP)
    status, out, _ = suboctave("run", path, "--json")
    told = json.loads(out)
    assert (status, told["interrupted"]) == (1, True)
    assert "before there was a result to keep" in told["analyses"][0]["failure"]
    assert told["analyses"][1]["failure"] == ""
    assert list(so.load(path.parent / "study_results" / "results.nc")) == ["up"]


def test_tables_of_what_was_interrupted_are_not_kept_as_complete(study_file, ticks):
    path = study_file(SYSTEM + BASINS + "seconds = 60\n")
    outcome = run_study(read_study(path))
    assert outcome.interruption == Interruption(60.0)
    if outcome.finished[0].result is not None:
        assert not outcome.finished[0].result.result.complete
    study_file(SYSTEM + BASINS + "seconds = 1e9\n")
    again = run_study(read_study(path), resume=True, overwrite=True)
    assert not again.finished[0].reused
    assert again.finished[0].result.result.complete


@pytest.mark.parametrize("wrong", ["0", "-1", "nan", '"1 h"'])
def test_wrong_limits_are_mistakes_with_their_line(study_file, wrong):
    for text in (
        SYSTEM.replace('title = "limits"', f'title = "limits"\nseconds = {wrong}') + UP,
        SYSTEM + UP + f"seconds = {wrong}\n",
    ):
        with pytest.raises(StudyError) as refused:
            read_study(study_file(text))
        (mistake,) = refused.value.mistakes
        assert mistake.key.endswith("seconds")
        assert text.splitlines()[mistake.line - 1] == f"seconds = {wrong}"


@pytest.mark.parametrize("wrong", ["0", "-1", "nan", "inf"])
def test_wrong_limits_on_the_command_line_are_refused_before_any_work(study_file, suboctave, wrong):
    path = study_file(SYSTEM + UP)
    status, _, err = suboctave("run", path, f"--seconds={wrong}")
    assert status == 2
    assert "seconds must be a positive number" in " ".join(err.split())
    assert not (path.parent / "study_results").exists()
