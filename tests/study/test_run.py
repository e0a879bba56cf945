"""Studies run: the same as a script, kept while running, resumed after a kill, nothing overwritten."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.store.journal import Journal, read_journal
from suboctave.store.registry import from_datasets
from suboctave.study.file import read_study
from suboctave.study.runner import JOURNAL, run_study

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")


def script():
    system = so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient="alpha")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"c": 0.1, "alpha": 1.0, "F": 0.3},
    )
    response = so.frequency_response(system, (3.0, 0.5), max_step=0.2)
    return response, so.continue_branch(response.bifurcations["LP"][0], "F", (0.25, 0.4), max_step=0.2)


@pytest.fixture(scope="module")
def by_script():
    """The same by a script."""
    return script()


def test_a_study_gives_what_a_script_gives_bit_for_bit(study_file, by_script, equal):
    outcome = run_study(read_study(study_file()))
    results = so.load(outcome.files[0])
    for item, branch, read in zip(outcome.finished, by_script, results.values(), strict=True):
        equal(item.result, branch)
        equal(read, branch)
    assert list(results) == ["response", "up"]
    assert results.attributes["title"] == "Duffing"
    assert results.attributes["study"] == DUFFING
    assert results.details["up"]["seconds"] > 0.0


def test_everything_that_was_asked_for_is_written(study_file, suboctave):
    first = 'file = "a.png"\nanalyses = ["response"]\n'
    second = 'file = "b.svg"\nanalyses = ["up"]\nx = "F"\ntitle = "up"\n'
    wanted = '[outputs]\ncsv = true\nfolder = "there"\n'
    path = study_file(DUFFING + wanted + f"[[outputs.figures]]\n{first}[[outputs.figures]]\n{second}")
    status, out, err = suboctave("run", path)
    assert status == 0, err
    folder = path.parent / "there"
    names = {p.name for p in folder.iterdir()}
    tables = {"response.csv", "response_bifurcations.csv", "up.csv", "up_bifurcations.csv"}
    assert names == {"results.nc", "a.png", "b.svg"} | tables
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert not err  # nobody watches: no bar
    assert max(len(line) for line in out.splitlines() if not line.startswith("written")) <= 80


def test_figures_in_other_units_and_a_page_of_them_all(study_file, suboctave):
    figure = 'file = "a.svg"\nanalyses = ["response"]\nquantity = "phase"\nfrequency = "Hz"\nsize = "single-column"\n'
    path = study_file(DUFFING + f'[outputs]\nhtml = "report.html"\n[[outputs.figures]]\n{figure}')
    status, _, err = suboctave("run", path)
    assert status == 0, err
    folder = path.parent / "study_results"
    assert 'width="238.32pt"' in (folder / "a.svg").read_text()  # 84 mm
    page = (folder / "report.html").read_text()
    assert "<h2>response</h2>" in page
    assert "<h2>up</h2>" in page
    assert "time taken" in page


def test_figures_of_motions_are_those_of_a_script(study_file, by_script, tmp_path):
    figures = (
        '[[outputs.figures]]\nkind = "phase"\nfile = "a.svg"\nsize = "single-column"\n'
        'motions = ["up", { analysis = "response", bifurcation = "LP", index = 1 }]\n'
        '[[outputs.figures]]\nkind = "spectrum"\nfile = "b.svg"\nhighest = 5\n'
        'motions = [{ analysis = "response", nearest = { omega = 1.0 } }]\n'
        '[[outputs.figures]]\nkind = "history"\nfile = "c.svg"\nquantity = "force"\nelement = 0\n'
        'motions = [{ analysis = "response", point = 3 }]\n'
    )
    path = study_file(DUFFING + f"[outputs]\n{figures}")
    outcome = run_study(read_study(path))
    folder = path.parent / "study_results"
    assert [file.name for file in outcome.files] == ["results.nc", "a.svg", "b.svg", "c.svg"]
    response, up = by_script
    near = int(np.argmin(abs(response.omega - 1.0)))
    so.plot_phase([up.orbits[-1], response.bifurcations["LP"][1]], tmp_path / "a.svg", size="single-column")
    so.plot_spectrum(response, tmp_path / "b.svg", points=[near], highest=5)
    so.plot_history(response.points[3], tmp_path / "c.svg", quantity="force", element=0)
    for name in ("a.svg", "b.svg", "c.svg"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_motion_that_was_not_found_costs_nothing_else(study_file, suboctave):
    figures = (
        '[[outputs.figures]]\nkind = "phase"\nfile = "a.png"\n'
        'motions = [{ analysis = "response", bifurcation = "PD" }]\n[[outputs.figures]]\nfile = "b.png"\n'
        'analyses = ["response"]\n'
    )
    path = study_file(DUFFING + f"[outputs]\n{figures}")
    status, _, err = suboctave("run", path)
    assert status == 2
    assert "figures[0] is not drawn: 'response' has no PD" in err
    folder = path.parent / "study_results"
    assert {file.name for file in folder.iterdir()} == {"results.nc", "b.png", "unfinished.journal"}
    path.write_text(path.read_text().replace('"PD"', '"LP"'))
    status, _, err = suboctave("run", path, "--resume")
    assert status == 0, err
    assert (folder / "a.png").exists()
    assert not (folder / "unfinished.journal").exists()


def test_parameters_may_differ_for_one_analysis(study_file, by_script):
    text = DUFFING.replace("F = 0.3 }", "F = 9.0 }").replace(
        "max_step = 0.2\n", "max_step = 0.2\nparameters = { F = 0.3 }\n", 1
    )
    study = read_study(study_file(text.split('[[analyses]]\nname = "up"')[0]))
    result = run_study(study).finished[0].result
    assert [p.orbit.coefficients.tobytes() for p in result.points] == [
        p.orbit.coefficients.tobytes() for p in by_script[0].points
    ]


def test_every_option_of_a_verb_reaches_it(study_file, equal):
    options = (
        'max_step = 0.3\nharmonics = { minimum = 7, tolerance = 1e-6 }\nstability = "hill"\n'
        'formulation = { name = "alcorta2019", test = "determinant" }\n'
        "newton = { iterations = 9 }\nstepping = { deviation = 0.02 }\nobserve = 0\nstart = [0.05, 0.0]\n"
    )
    text = DUFFING.split('[[analyses]]\nname = "up"')[0].replace("max_step = 0.2\n", options)
    study = read_study(study_file(text))
    again = partial(
        so.frequency_response,
        study.system,
        (3.0, 0.5),
        harmonics=so.AdaptiveHarmonics(minimum=7, tolerance=1e-6),
        start=[0.05, 0.0],
        max_step=0.3,
        newton=so.NewtonOptions(iterations=9),
        stability="hill",
        formulation=so.Alcorta2019("determinant"),
        stepping=so.SteppingOptions(deviation=0.02),
        observe=0,
    )
    run_study(study)  # kernels of the method are compiled by now
    equal(run_study(study, overwrite=True).finished[0].result, again())
    assert {p.floquet.method for p in again().points} == {"Hill"}


def test_steps_choose_their_motions(study_file, by_script):
    response = by_script[0]
    text = (
        DUFFING
        + """
[[analyses]]
name = "near"
type = "continue_branch"
start = { analysis = "response", nearest = { omega = 1.2, amplitude = 1.2 } }
parameter = "alpha"
bounds = [1.0, 1.1]
[[analyses]]
name = "third"
type = "stability"
branch = "response"
points = [3]
bifurcations = ["LP"]
methods = ["monodromy", { method = "hill", selection = "strip" }]
[[analyses]]
name = "witness"
type = "verify"
branch = "up"
every = 5
"""
    )
    outcome = run_study(read_study(study_file(text)))
    near, third, witness = (item.result for item in outcome.finished[2:])
    start = min(response.points, key=lambda p: ((p.orbit.omega - 1.2) / np.ptp(response.omega)) ** 2
                + ((p.orbit.amplitude() - 1.2) / np.ptp(response.amplitude)) ** 2)  # fmt: skip
    assert start.orbit.omega == near.omega[0]
    folds = len(response.bifurcations["LP"])
    assert len(third) == 2 * (1 + folds)
    np.testing.assert_allclose(third["multiplier_0"][0], so.stability(response.orbits[3]).multipliers[0])
    assert set(third["method"]) >= {"monodromy"}
    assert witness["agrees"].all()
    read = so.load(outcome.files[0])
    assert read["third"]["multiplier_0"].tobytes() == third["multiplier_0"].tobytes()
    assert list(read["witness"]["reason"]) == list(witness["reason"])


def test_outputs_that_exist_are_left_alone(study_file, suboctave):
    path = study_file()
    assert suboctave("run", path)[0] == 0
    file = path.parent / "study_results" / "results.nc"
    before = file.read_bytes()
    status, _, err = suboctave("run", path)
    assert status == 2
    assert "--overwrite" in err
    assert file.read_bytes() == before
    assert suboctave("run", path, "--overwrite")[0] == 0
    assert suboctave("run", path, "--out", path.parent / "elsewhere")[0] == 0
    status, out, _ = suboctave("run", path, "--resume")
    assert status == 0
    assert "is complete" in out
    path.write_text(DUFFING.replace("alpha = 1.0", "alpha = 1.5"))
    status, _, err = suboctave("run", path, "--resume")
    assert status == 2
    assert "another study" in err


def test_a_kill_in_the_middle_loses_no_finished_analysis(study_file, by_script, equal):
    slow = DUFFING.replace("max_step = 0.2\n", "max_step = 0.2\n", 1).replace(
        "bounds = [0.25, 0.4]\nmax_step = 0.2", "bounds = [0.25, 0.4]\nmax_step = 0.0001"
    )
    path = study_file(slow)
    folder = path.parent / "study_results"
    process = subprocess.Popen([sys.executable, "-m", "suboctave", "run", str(path)], stdout=subprocess.DEVNULL)
    journal = folder / JOURNAL
    deadline = time.monotonic() + 400  # with kernels to compile; seconds without
    while time.monotonic() < deadline and process.poll() is None:
        kinds = [r.kind for r in read_journal(journal)] if journal.exists() else []
        if "analysis" in kinds:  # the first is finished; the second takes much longer than this loop
            break
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not (folder / "results.nc").exists()
    first = next(r for r in read_journal(journal) if r.kind == "analysis")

    path.write_text(DUFFING)  # the analysis that had not finished may be changed
    outcome = run_study(read_study(path), resume=True)
    assert [item.reused for item in outcome.finished] == [True, False]
    # what the killed process had finished is taken as it is; what follows starts from it
    equal(outcome.finished[0].result, from_datasets({"": first.dataset})[0])
    for item, branch in zip(outcome.finished, by_script, strict=True):
        np.testing.assert_allclose(item.result.amplitude, branch.amplitude, rtol=1e-9)
    assert outcome.finished[0].seconds == first.dataset.attrs["seconds"]
    assert not journal.exists()
    assert list(so.load(outcome.files[0])) == ["response", "up"]


def test_ctrl_c_keeps_what_is_there_and_can_go_on(study_file, by_script, equal):
    study = read_study(study_file())
    calls = 0

    from contextlib import contextmanager

    @contextmanager
    def impatient(step):
        def report(share, where):
            nonlocal calls
            calls += 1
            if step.name == "up" and share > 0.3:
                raise KeyboardInterrupt

        yield report

    outcome = run_study(study, watch=impatient)
    assert outcome.interrupted
    assert calls > 5
    kept = so.load(outcome.files[0])
    equal(kept["response"], by_script[0])
    assert kept["up"].ended.startswith("interrupted")
    assert 0 < len(kept["up"]) < len(by_script[1])
    with pytest.raises(so.InputError, match="--resume"):
        run_study(study)
    again = run_study(study, resume=True)
    assert [item.reused for item in again.finished] == [True, False]
    equal(so.load(again.files[0])["up"], by_script[1])


def test_a_failed_analysis_does_not_take_the_others_with_it(study_file, suboctave):
    text = (
        DUFFING.replace('bifurcation = "LP" }', 'bifurcation = "NS" }')
        + """
[[analyses]]
name = "after"
type = "continue_branch"
start = "up"
parameter = "c"
bounds = [0.1, 0.2]
[[analyses]]
name = "independent"
type = "verify"
branch = "response"
every = 50
"""
    )
    path = study_file(text)
    status, out, _ = suboctave("run", path)
    assert status == 2
    assert "'response' has no NS" in " ".join(out.split())
    assert "which gave nothing" in " ".join(out.split())
    assert list(so.load(path.parent / "study_results" / "results.nc")) == ["response", "independent"]


def test_show_prints_results_studies_and_journals(study_file, suboctave):
    path = study_file()
    suboctave("run", path)
    file = path.parent / "study_results" / "results.nc"
    status, out, _ = suboctave("show", file)
    assert status == 0
    assert max(map(len, out.splitlines())) <= 80
    assert "response: along omega" in out
    assert "LP" in out
    said = json.loads(suboctave("show", file, "--json")[1])
    assert [b["kind"] for b in said["analyses"]["response"]["bifurcations"]].count("LP") == 2
    status, out, _ = suboctave("show", path)
    assert status == 0
    assert "CubicSpring" in out
    assert "continue_branch" in out
    status, out, _ = suboctave("show", file, "--csv", path.parent / "tables")
    assert status == 0
    assert {p.name for p in (path.parent / "tables").iterdir()} == {
        "response.csv", "response_bifurcations.csv", "up.csv", "up_bifurcations.csv",
    }  # fmt: skip
    assert suboctave("show", file, "--csv", path.parent / "tables")[0] == 2
    journal = Journal.create(path.parent / "x.journal")
    journal.append("points", {"name": "response", "from": 0, "omega": [1.0, 2.0], "bifurcations": []})
    journal.close()
    status, out, _ = suboctave("show", path.parent / "x.journal")
    assert status == 0
    assert "begun" in out


def test_outputs_that_are_asked_for_later_are_drawn_from_the_results(study_file, suboctave):
    """Of a complete study: what is missing is written, what is there left alone, nothing computed again."""
    path = study_file()
    suboctave("run", path)
    folder = path.parent / "study_results"
    results = (folder / "results.nc").read_bytes()
    figures = "".join(
        f'[[outputs.figures]]\nfile = "{name}"\nanalyses = ["response"]\n' for name in ("one.svg", "two.svg")
    )
    path.write_text(path.read_text() + f'\n[outputs]\ncsv = true\nhtml = "page.html"\n{figures}')
    tables = ["response.csv", "response_bifurcations.csv", "up.csv", "up_bifurcations.csv"]

    status, out, _ = suboctave("run", path, "--resume")
    assert status == 0
    assert "nothing to compute" in out
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        ["results.nc", "one.svg", "two.svg", "page.html", *tables]
    )
    assert out.count("written: ") == 7
    assert "left as they are" not in out
    again = path.parent / "again"
    suboctave("run", path, "--out", again)
    for name in ("one.svg", "two.svg", *tables):
        assert (again / name).read_bytes() == (folder / name).read_bytes()

    # a figure that was deleted comes back; one that its user changed, or that is asked for otherwise, is left and named
    drawn = (folder / "one.svg").read_bytes()
    (folder / "one.svg").unlink()
    (folder / "two.svg").write_text("mine")
    status, out, _ = suboctave("run", path, "--resume")
    assert status == 0
    assert out.count("written: ") == 1
    assert "left as they are: two.svg" in out
    assert "--resume --overwrite" in out
    assert (folder / "one.svg").read_bytes() == drawn
    assert (folder / "two.svg").read_text() == "mine"
    assert (folder / "results.nc").read_bytes() == results


def test_overwrite_and_resume_write_every_output_of_a_complete_study_again(study_file, suboctave):
    path = study_file()
    path.write_text(path.read_text() + '\n[outputs]\n[[outputs.figures]]\nfile = "one.svg"\nanalyses = ["response"]\n')
    suboctave("run", path)
    folder = path.parent / "study_results"
    before, drawn = so.load(folder / "results.nc"), (folder / "one.svg").read_bytes()
    path.write_text(path.read_text() + 'quantity = "rms"\n')
    assert "left as they are: one.svg" in suboctave("run", path, "--resume")[1]
    assert (folder / "one.svg").read_bytes() == drawn
    status, out, _ = suboctave("run", path, "--resume", "--overwrite")
    assert status == 0
    assert out.count("written: ") == 2
    assert (folder / "one.svg").read_bytes() != drawn
    after = so.load(folder / "results.nc")
    assert after.attributes["study"] == path.read_text()
    assert [after.details[name] for name in after] == [before.details[name] for name in before]
    for name, branch in before.items():
        assert after[name].to_dataframe().equals(branch.to_dataframe())
    # nothing but outputs may differ
    path.write_text(path.read_text().replace("F = 0.3", "F = 0.31"))
    status, _, err = suboctave("run", path, "--resume", "--overwrite")
    assert status == 2
    assert "results of another study" in err


def test_figures_that_cannot_be_drawn_of_a_complete_study_are_said(study_file, suboctave):
    path = study_file()
    suboctave("run", path)
    path.write_text(
        path.read_text() + '\n[outputs]\n[[outputs.figures]]\nfile = "a.svg"\nanalyses = ["response"]\nharmonic = 0.5\n'
        '[[outputs.figures]]\nfile = "b.svg"\nanalyses = ["response"]\nharmonic = 1\n'
    )
    status, _, err = suboctave("run", path, "--resume")
    assert status == 2
    assert "outputs.figures[0] is not drawn" in err
    assert (path.parent / "study_results" / "b.svg").exists()


# ---------------------------------------------------------------------------------------- functions of users that fail
FAILING = """
title = "Duffing"
[system]
mass = 1.0
damping = 0.1
stiffness = 1.0
elements = [{ type = "Callable", dof = 0, function = { callable = "functions_of_a_user:law" } }]
loads = [{ type = "HarmonicLoad", dof = 0, amplitude = "F" }]
parameters = { F = 0.3 }

[[analyses]]
name = "watched"
type = "frequency_response"
omega = [2.5, 0.8]
events = [{ name = "hot", function = "functions_of_a_user:hot" }]

[[analyses]]
name = "from it"
type = "continue_branch"
start = { analysis = "watched", point = 1 }
parameter = "F"
bounds = [0.2, 0.35]

[[analyses]]
name = "strong"
type = "frequency_response"
omega = [2.5, 0.8]
parameters = { F = 3.0 }

[[analyses]]
name = "last"
type = "frequency_response"
omega = [2.5, 2.2]
"""
FUNCTIONS = """
import numpy as np
def law(x, v):
    if np.abs(x).max() > LARGEST:
        raise ArithmeticError("out of the table")
    return x**3
def hot(motion):
    if motion.omega < 2.0:
        raise RuntimeError("no sensor")
    return 1.0
"""


@pytest.fixture
def failing(study_file, monkeypatch, tmp_path):
    """A study with a law and an event that fail on the way."""

    def write(text):
        (tmp_path / "functions_of_a_user.py").write_text(text)
        sys.modules.pop("functions_of_a_user", None)
        importlib.invalidate_caches()
        return study_file(FAILING)

    monkeypatch.syspath_prepend(tmp_path)
    yield write
    sys.modules.pop("functions_of_a_user", None)


def test_functions_that_fail_cost_their_analysis_alone(failing, tmp_path):
    study = failing(FUNCTIONS.replace("LARGEST", "2.0"))
    outcome = run_study(read_study(study, allow_code=True))
    assert list(outcome.failures) == ["watched", "strong"]
    assert "the function of the event 'hot' failed with RuntimeError: no sensor" in outcome.failures["watched"]
    assert "out of the table" in outcome.failures["strong"]
    assert not outcome.interrupted
    done = {item.step.name: item.result for item in outcome.finished}
    assert done["watched"].omega[-1] < 2.3  # as far as it came, and what starts from it
    assert len(done["from it"]) > 2
    assert len(done["last"]) > 2
    # the functions are mended: what is complete and does not call them is taken over
    study = failing(FUNCTIONS.replace("LARGEST", "1e9").replace("motion.omega < 2.0", "False"))
    outcome = run_study(read_study(study, allow_code=True), resume=True)
    assert not outcome.failures
    assert [item.step.name for item in outcome.finished if item.reused] == []  # another law is another system


def test_functions_that_fail_are_said_on_the_command_line(failing, suboctave):
    status, printed, _ = suboctave("run", failing(FUNCTIONS.replace("LARGEST", "2.0")), "--allow-code")
    assert status != 0
    assert "failed. beyond omega = " in printed
    assert "no sensor" in printed
    assert "failed: watched, strong. Change the study, and go on with --resume" in printed


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda: {}["nothing"], "an unexpected error, please report it: KeyError: 'nothing' (test_run.py"),
        (lambda: 1 / 0, "an unexpected error, please report it: ZeroDivisionError: division by zero (test_run.py"),
        (lambda: 1e200**2, "the numbers grew too large"),
    ],
)
def test_a_mistake_of_ours_costs_its_analysis_alone(study_file, monkeypatch, mistake, words):
    study = read_study(study_file(DUFFING + "\n" + DUFFING[DUFFING.index("[[analyses]]"):].replace(
        '"response"', '"again"').split("[[analyses]]\nname = \"up\"")[0]))  # fmt: skip
    monkeypatch.setattr(type(study.steps[1]), "run", lambda step, around: mistake())
    outcome = run_study(study)
    assert list(outcome.failures) == ["up"]
    assert words in outcome.failures["up"]
    assert [item.step.name for item in outcome.finished if item.result is not None] == ["response", "again"]
