"""Steps "switch_branch" and "bifurcation_diagram": the same as a script, on the screen, in files, resumed."""

from __future__ import annotations

import json
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.store.journal import read_journal
from suboctave.study.file import read_study
from suboctave.study.runner import JOURNAL, run_study

SYSTEM = """
title = "Cascade"
[system]
library = "reference_oscillator"
arguments = { regularization = 3000.0 }
parameters = { p = 1.7 }
"""
DIAGRAM = """
[[analyses]]
name = "diagram"
type = "bifurcation_diagram"
omega = [4.5, 2.2]
max_step = 0.3
"""
SMALL = DIAGRAM.replace("[4.5, 2.2]", "[4.5, 3.9]") + "depth = 1\n"
LATER = """
[[analyses]]
name = "other end"
type = "switch_branch"
start = { analysis = "diagram", branch = 0, bifurcation = "PD", index = 1 }
max_step = 0.3
"""
MORE = """
[[analyses]]
name = "along p"
type = "continue_branch"
start = { analysis = "diagram", label = "4T", point = 3 }
parameter = "p"
bounds = [1.68, 1.71]
max_step = 0.3

[[analyses]]
name = "witness"
type = "verify"
branch = { analysis = "diagram", branch = 1 }
what = "points"
every = 100

[[analyses]]
name = "multipliers"
type = "stability"
branch = { analysis = "diagram", label = "4T" }
bifurcations = ["PD"]
methods = ["monodromy"]
"""

OUTPUTS = """
[outputs]
csv = true
html = "report.html"
[[outputs.figures]]
file = "tree.png"
analyses = ["diagram"]
[[outputs.figures]]
file = "named.svg"
analyses = ["diagram"]
labels = ["computed"]
quantity = "velocity"
[[outputs.figures]]
file = "mean.svg"
analyses = ["diagram"]
harmonic = 0
[[outputs.figures]]
file = "half.svg"
analyses = ["diagram"]
quantity = "harmonic"
harmonic = 0.5
[[outputs.figures]]
file = "quarter.svg"
analyses = ["diagram"]
quantity = "harmonic"
harmonic = "1/4"
[[outputs.figures]]
kind = "phase"
file = "portrait.png"
motions = [{ analysis = "diagram", label = "4T", bifurcation = "PD" }, { analysis = "diagram", branch = 1 }]
"""


def script():
    system = so.library.reference_oscillator(p=1.7, regularization=3000.0)
    diagram = so.bifurcation_diagram(system, (4.5, 2.2), max_step=0.3)
    four = diagram["4T"].branch
    return (
        diagram,
        so.switch_branch(diagram[0].branch.bifurcations["PD"][1], max_step=0.3),
        so.continue_branch(four.orbits[3], "p", (1.68, 1.71), max_step=0.3),
    )


@pytest.fixture(scope="module")
def by_script():
    """The same by a script."""
    return script()


def same(one, other):
    """Two branches or diagrams, bit for bit."""
    assert repr(one) == repr(other)
    if isinstance(one, so.BifurcationDiagram):
        for a, b in zip(one, other, strict=True):
            assert a.branch.options == b.branch.options
            xr.testing.assert_identical(a.branch.to_xarray(), b.branch.to_xarray())
    else:
        assert one.options == other.options
        xr.testing.assert_identical(one.to_xarray(), other.to_xarray())


@pytest.fixture(scope="module")
def ran(by_script, tmp_path_factory):
    """The study, run: what finished, and the folder of its outputs."""
    path = tmp_path_factory.mktemp("cascade") / "study.toml"
    path.write_text(SYSTEM + DIAGRAM + LATER + MORE + OUTPUTS, encoding="utf-8")
    return run_study(read_study(path)), path.parent / "study_results"


@pytest.fixture(scope="module")
def results(ran):
    """What the study wrote, read back."""
    return so.load(ran[1] / "results.nc")


@pytest.mark.parametrize(("name", "harmonic"), [("mean", 0), ("half", 0.5), ("quarter", 0.25)])
def test_components_are_drawn_as_by_a_script(ran, results, tmp_path, name, harmonic):
    so.plot(results["diagram"], tmp_path / "figure.svg", harmonic=harmonic)
    assert (ran[1] / f"{name}.svg").read_bytes() == (tmp_path / "figure.svg").read_bytes()


def test_a_study_gives_what_a_script_gives_bit_for_bit(ran, results, by_script):
    outcome, _ = ran
    assert not outcome.failed, [item.failure for item in outcome.failed]
    assert list(results) == ["diagram", "other end", "along p", "witness", "multipliers"]
    for item, expected, read in zip(outcome.finished, by_script, results.values(), strict=False):
        same(item.result, expected)
        same(read, expected)
    assert list(results.branches) == ["other end", "along p"]
    assert list(results.diagrams) == ["diagram"]
    assert results["witness"]["agrees"].all()
    assert len(results["witness"]) == 1
    assert "branch 1" in results["witness"].title
    columns = [results["multipliers"][f"multiplier_{i}"] for i in range(2)]
    assert (np.min(np.abs(np.array(columns) + 1.0), axis=0) < 1e-4).all()  # -1 at a period doubling
    assert (results["other end"].nu, results["along p"].nu) == (2, 4)


def test_a_branch_switched_to_from_a_branch_inherits_its_options(study_file):
    text = """
[[analyses]]
name = "response"
type = "frequency_response"
omega = [4.5, 3.5]
harmonics = 9
max_step = 0.25
[[analyses]]
name = "doubled"
type = "switch_branch"
start = { analysis = "response", bifurcation = "PD" }
[[analyses]]
name = "shorter"
type = "switch_branch"
start = { analysis = "response", bifurcation = "PD" }
bounds = [3.9, 4.1]
side = -1
"""
    outcome = run_study(read_study(study_file(SYSTEM + text)))
    response, doubled, shorter = (item.result for item in outcome.finished)
    assert doubled.options["bounds"] == response.options["bounds"]
    assert doubled.options["stepping"] == response.options["stepping"]
    assert set(doubled.harmonics) == {18}  # 9 of the load's frequency
    assert shorter.omega.min() >= 3.9
    np.testing.assert_allclose(shorter.amplitude[0], doubled.amplitude[0], rtol=1e-9)
    same(doubled, so.switch_branch(response.bifurcations["PD"][0]))


def test_what_is_written(ran):
    outcome, folder = ran
    tables = {f"{name}{part}.csv" for name in ("diagram", "other end", "along p") for part in ("", "_bifurcations")}
    figures = {"tree.png", "named.svg", "mean.svg", "half.svg", "quarter.svg", "portrait.png"}
    names = {"results.nc", "report.html", "witness.csv", "multipliers.csv"} | tables | figures
    assert {p.name for p in folder.iterdir()} == {p.name for p in outcome.files} == names
    assert "computed, 4T" in (folder / "named.svg").read_text()
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count('<h3 class="name">diagram, branch ') == 3
    assert "└─ 1  2T, PD 3.981602 to PD 2.39144" in page


def test_what_is_printed(ran, suboctave, tmp_path):
    _, folder = ran
    status, out, err = suboctave("show", folder / "results.nc", "--csv", tmp_path / "tables")
    assert status == 0, err
    assert max(len(line) for line in out.splitlines() if not line.startswith("written")) <= 80
    assert "└─ 1  2T, PD 3.981602 to PD 2.39144" in out
    assert "depth=2 reached" in out
    assert sum(line.split()[:2] == ["1", "PD"] for line in out.splitlines()) == 2
    for name in ("diagram.csv", "diagram_bifurcations.csv"):
        assert (tmp_path / "tables" / name).read_text() == (folder / name).read_text()
    status, said, _ = suboctave("show", folder / "results.nc", "--json")
    listed = json.loads(said)["analyses"]["diagram"]["branches"]
    places = [(b["branch"], b["parent"], b["period"], b["depth"]) for b in listed]
    assert places == [(0, None, 1, 0), (1, 0, 2, 1), (2, 1, 4, 2)]
    assert [b["omega"] for b in listed[1]["bifurcations"] if b["kind"] == "PD"] == pytest.approx(
        [3.02870285, 2.44814534], abs=1e-5
    )


def test_a_choice_that_is_not_there_is_told_in_words(study_file, suboctave):
    small = SYSTEM + SMALL
    later = '[[analyses]]\nname = "on"\ntype = "continue_branch"\nparameter = "p"\nbounds = [1.0, 2.0]\n'
    for choice, words in (
        ("branch = 7", "has 2 branches"),
        ('label = "8T"', "no branch of the diagram has a label that begins with '8T'"),
        ("branch = 0, bifurcation = 'LP'", "diagram, branch 0 has no LP"),
    ):
        path = study_file(small + later + f'start = {{ analysis = "diagram", {choice} }}\n')
        status, out, err = suboctave("run", path, "--resume")
        assert status == 2, err
        assert words in " ".join(out.split())


def interrupted_at(path, text):
    """Run a study until its progress tells a text."""

    @contextmanager
    def impatient(step):
        def report(share, where):
            if text in where:
                raise KeyboardInterrupt

        yield report

    return run_study(read_study(path), watch=impatient)


def test_ctrl_c_keeps_the_branches_that_are_there_and_resume_repeats_none(
    study_file, by_script, monkeypatch, suboctave
):
    path = study_file(SYSTEM + DIAGRAM + LATER)
    outcome = interrupted_at(path, "PD 3.028")
    assert outcome.interrupted
    kept = so.load(outcome.files[0])["diagram"]
    assert kept.interrupted
    same(kept[1].branch, by_script[0][1].branch)
    journal = path.parent / "study_results" / JOURNAL
    assert [r.kind for r in read_journal(journal)].count("branch") == 2
    status, out, _ = suboctave("show", journal)
    assert status == 0
    assert "begun" in out

    from suboctave.analysis import diagram as module

    followed = []
    for name in ("frequency_response", "switch_branch"):
        verb = getattr(module, name)

        def counted(*args, verb=verb, **options):
            followed.append(verb(*args, **options))
            return followed[-1]

        monkeypatch.setattr(module, name, counted)
    again = run_study(read_study(path), resume=True)
    assert [branch.nu for branch in followed] == [4]  # the response and the 2T branch were there
    same(again.finished[0].result, by_script[0])
    same(so.load(again.files[0])["diagram"], by_script[0])
    assert not journal.exists()


def test_a_finished_diagram_is_taken_from_the_journal(study_file):
    path = study_file(SYSTEM + SMALL + LATER.replace("index = 1", "index = 0"))

    @contextmanager
    def impatient(step):
        def report(share, where):
            if step.name == "other end":
                raise KeyboardInterrupt

        yield report

    assert run_study(read_study(path), watch=impatient).interrupted
    again = run_study(read_study(path), resume=True)
    assert [item.reused for item in again.finished][:2] == [True, False]
    system = so.library.reference_oscillator(p=1.7, regularization=3000.0)
    diagram = so.bifurcation_diagram(system, (4.5, 3.9), max_step=0.3, depth=1)
    same(again.finished[0].result, diagram)
    same(again.finished[1].result, so.switch_branch(diagram[0].branch.bifurcations["PD"][0], max_step=0.3))
