"""Sweeps of a study: the same bits in every way of computing them, and nothing lost to a point that fails, a process
that dies, Ctrl-C, or a kill at any moment."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from pages import blocks, check_prints
from scipy import stats

import suboctave as so
from suboctave.pictures.sweeps import plot_points
from suboctave.store.journal import Journal, read_journal
from suboctave.study.file import read_study
from suboctave.study.sweeps.given import parameters_of
from suboctave.study.sweeps.plan import plan_of

STUDY = """
title = "Duffing"
[system]
mass = 1.0
damping = "c"
stiffness = 1.0
elements = [{ type = "CubicSpring", dof = 0, coefficient = "alpha" }]
loads = [{ type = "HarmonicLoad", dof = 0, amplitude = "F" }]
parameters = { c = 0.1, alpha = 1.0, F = 0.3 }

[[analyses]]
name = "response"
type = "frequency_response"
omega = [3.0, 0.5]
max_step = 0.4
harmonics = 5
stability = "hill"
"""
GRID = {"F": {"from": 0.1, "to": 0.4, "count": 4}, "c": [0.1, 0.2, 0.3]}
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweep") / "duffing.toml"
    path.write_text(STUDY)
    return read_study(path)


@pytest.fixture(scope="module")
def grid(study):
    return so.sweep(study, GRID, workers=2)


def same(one, other):
    """Whether two sweeps hold the same bits, but for the times that points took."""
    return one.dataset.drop_vars("seconds").identical(other.dataset.drop_vars("seconds"))


# --------------------------------------------------------------------------------------------------------- the numbers
def test_a_point_of_a_grid_is_what_the_study_gives_there(study, grid):
    assert grid.dataset["response.peak_amplitude"].dims == ("F", "c")
    assert grid["F"].tolist() == np.linspace(0.1, 0.4, 4).tolist()
    assert not grid.failures
    assert grid.dataset.sizes["event"] == 4
    system = study.system.with_parameters({"F": grid["F"][2], "c": 0.1})
    curve = so.frequency_response(system, (3.0, 0.5), max_step=0.4, harmonics=5, stability=so.Hill())
    here = grid.dataset.isel(F=2, c=0)
    assert here["response.points"] == len(curve)
    assert here["response.peak_amplitude"] == curve.amplitude.max()
    assert here["response.peak_omega"] == curve.omega[curve.amplitude.argmax()]
    assert here["response.LP"] == len(curve.bifurcations["LP"]) == 2
    assert here["response.LP.omega"].values[:2].tolist() == [point.omega for point in curve.bifurcations["LP"]]
    assert np.isnan(here["response.LP.omega"].values[2:]).all()
    assert here["response.PD"] == 0
    assert here["response.regular"] == 1
    assert 0 < here["response.unstable_share"] < 1
    assert here["response.residual"] < 1e-6


def test_the_number_of_workers_changes_no_bit_and_a_measure_adds_its_own(study, grid):
    some = {"F": grid["F"][:2].tolist(), "c": [0.1]}
    alone = so.sweep(study, some, workers=1, measure=lambda results: {"first": results["response"].amplitude[0]})
    for name in grid.quantities:
        assert alone.dataset[name].identical(grid.dataset[name].isel(F=[0, 1], c=[0]))
    assert alone.dataset["first"].dims == ("F", "c")
    assert alone["first"][1, 0] == pytest.approx(2 * alone["first"][0, 0], rel=1e-2)  # far above resonance it is linear


@pytest.mark.slow
def test_isolas_diagrams_and_tables_have_quantities_too(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        """
[system]
library = "reference_oscillator"
parameters = { p = 0.55, j = 0.5 }
[[analyses]]
name = "isolas"
type = "find_isolas"
omega = [1.8, 3.0]
parameter = "j"
bounds = [0.45, 0.65]
harmonics = 7
values = 2
[[analyses]]
name = "diagram"
type = "bifurcation_diagram"
omega = [2.0, 2.5]
harmonics = 7
depth = 0
[[analyses]]
name = "exponents"
type = "lyapunov_exponents"
omega = 2.3
periods = 20
transient = 5
"""
    )
    found = so.sweep(path, {"zeta": 0.03}, workers=1, measure=lambda results: {"born": results["isolas"][0].born})
    assert not found.failures, found
    assert found.dataset["isolas.born"].dims == ("zeta", "isola")
    assert found["isolas.isolas"][0] == 1
    assert found["isolas.born"][0, 0] == found["born"][0] == pytest.approx(0.581, abs=2e-3)
    assert found["isolas.from"][0, 0] == 0.45
    assert np.isnan(found["isolas.merges"][0, 0])
    assert found["diagram.branches"][0] == 1
    assert "row" in found.dataset["exponents.exponent"].dims


# ----------------------------------------------------------------------------------------------------- random draws
DRAWN = {
    "F": {"distribution": "triangular", "low": 0.1, "mode": 0.2, "high": 0.4},
    "c": {"distribution": "lognormal", "median": 0.1, "deviation": 0.2},
    "alpha": 1.0,
}


@pytest.mark.parametrize("sampling", ["random", "latin hypercube", "sobol"])
def test_draws_have_their_distribution(study, sampling):
    plan = plan_of(study.system, study.steps, DRAWN, 1024, 7, sampling)
    again = plan_of(study.system, study.steps, DRAWN, 1024, 7, sampling)
    other = plan_of(study.system, study.steps, DRAWN, 1024, 8, sampling)
    assert plan.points.tobytes() == again.points.tobytes() != other.points.tobytes()
    assert set(plan.points[:, 2]) == {1.0}
    laws = (stats.triang(1 / 3, 0.1, 0.3), stats.lognorm(0.2, scale=0.1))
    for column, law in zip(plan.points.T, laws, strict=False):
        assert stats.kstest(column, law.cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    ("given", "law"),
    [
        ({"distribution": "uniform", "low": 1.0, "high": 3.0}, stats.uniform(1.0, 2.0)),
        ({"distribution": "loguniform", "low": 0.1, "high": 10.0}, stats.loguniform(0.1, 10.0)),
        ({"distribution": "normal", "mean": 1.0, "deviation": 0.1}, stats.norm(1.0, 0.1)),
        (
            {"distribution": "truncated normal", "mean": 1.0, "deviation": 0.1, "low": 0.95, "high": 1.3},
            stats.truncnorm(-0.5, 3.0, 1.0, 0.1),
        ),
    ],
)
def test_each_distribution_is_what_it_says(study, given, law):
    plan = plan_of(study.system, study.steps, {"alpha": given}, 2000, 1)
    assert stats.kstest(plan.points[:, 0], law.cdf).pvalue > 1e-3


def test_more_draws_begin_with_the_same_ones(study):
    few, many = (plan_of(study.system, study.steps, DRAWN, draws, 3) for draws in (5, 9))
    assert many.points[:5].tobytes() == few.points.tobytes()


# ------------------------------------------------------------------------------------------------------------- failures
def test_a_list_of_points_is_what_the_grid_holds_there_and_each_failure_stays_its_own(study, grid):
    def gentle(results):
        return {"half": 1 / 0} if results["response"].system.parameters["F"] == 0.1 else {}

    points = [{"F": float(grid["F"][i]), "c": c, "alpha": a} for i, c, a in ((3, 0.3, 1), (0, 0.1, 1), (0, 0.1, 1e308))]
    listed = so.sweep(study, points, workers=1, measure=gentle)
    assert listed.dataset["response.points"].dims == ("point",)
    assert list(listed.failures) == [1, 2]
    assert listed.failures[1] == "ZeroDivisionError: division by zero"
    assert listed.failures[2].startswith("response: ")
    assert np.isnan(listed["response.points"]).tolist() == [False, False, True]
    for i, point in enumerate(points[:2]):
        there = grid.dataset.sel(F=point["F"], c=point["c"])
        assert listed["response.peak_amplitude"][i] == there["response.peak_amplitude"]
        assert listed["response.LP.omega"][i].tobytes() == there["response.LP.omega"].values.tobytes()
    frame = listed.to_dataframe()
    assert frame["c"].tolist() == [0.3, 0.1, 0.1]
    assert frame["response.LP.omega[1]"][1] == listed["response.LP.omega"][1, 1]
    assert "3 points over F, c, alpha, 2 with a failure" in repr(listed)


@pytest.mark.slow
@POSIX
def test_a_worker_that_dies_costs_its_point_at_most(study, grid):
    def deadly(results):
        if results["response"].system.parameters["c"] == 0.2:
            os.kill(os.getpid(), signal.SIGKILL)
        return {}

    found = so.sweep(study, {"F": 0.1, "c": [0.2, 0.3]}, workers=1, measure=deadly)
    assert list(found.failures) == [0]
    assert "its process was ended by SIGKILL" in found.failures[0]
    for name in grid.quantities:
        if not name.startswith("response.LP."):
            assert found[name][0, 1].tobytes() == grid[name][0, 2].tobytes()


# ------------------------------------------------------------------------------------------------- stopped and gone on
def stopping_at(count):
    """A progress that presses Ctrl-C at its report of so many points."""

    def report(share, text):
        if text.startswith(f"{count} of"):
            raise KeyboardInterrupt

    return report


@pytest.mark.slow
def test_ctrl_c_leaves_what_is_computed_and_something_to_go_on_with(study, grid, tmp_path):
    path = tmp_path / "sweep.nc"
    part = so.sweep(study, GRID, path=path, workers=2, progress=stopping_at(5))
    assert part.interrupted
    assert list(part.failures.values()).count("not computed") == 7
    kept = so.load(path)
    assert kept.interrupted
    assert same(kept, part)
    with pytest.raises(so.InputError, match="holds a sweep that did not finish"):
        so.sweep(study, GRID, path=path)
    with pytest.raises(so.InputError, match="holds another sweep"):
        so.sweep(study, {"F": [0.1]}, path=path, resume=True)
    reports = []
    whole = so.sweep(study, GRID, path=path, resume=True, workers=1, progress=lambda share, text: reports.append(text))
    assert reports[0] == "5 of 12 points"
    assert "left" in reports[1]
    assert len(reports) == 8
    assert same(whole, grid)
    assert [file.name for file in tmp_path.iterdir()] == ["sweep.nc"]
    assert same(so.load(path), grid)
    assert same(so.sweep(study, GRID, path=path, resume=True), grid)
    with pytest.raises(so.InputError, match="exists and is left as it is"):
        so.sweep(study, GRID, path=path)
    with pytest.raises(so.InputError, match="nothing to resume"):
        so.sweep(study, {"F": [0.1]}, path=path, resume=True)


def scaled(factor):
    """A measure that depends on what it closes over."""
    return lambda results: {"peak": factor * results["response"].amplitude.max()}


def test_what_was_computed_is_taken_over_for_the_same_question_alone(study, tmp_path):
    """Another measure, grid or time limit gives other numbers, or other failures."""
    given, path = {"F": [0.1, 0.2]}, tmp_path / "sweep.nc"
    first = so.sweep(study, given, path=path, measure=scaled(1.0), workers=1)
    again = so.sweep(study, given, path=path, measure=scaled(1.0), workers=1, resume=True)
    assert same(first, again)
    listed = [{"F": 0.1}, {"F": 0.2}]
    limited = replace(study, seconds=100.0)
    for question, points, measure in [
        (study, given, scaled(2.0)), (study, given, None), (study, given, lambda results: {"peak": 1.0}),
        (study, listed, scaled(1.0)), (limited, given, scaled(1.0)),
    ]:  # fmt: skip
        with pytest.raises(so.InputError, match="holds the results of another sweep"):
            so.sweep(question, points, path=path, measure=measure, workers=1, resume=True)


def test_ctrl_c_before_anything_is_ctrl_c(study, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        so.sweep(study, GRID, path=tmp_path / "sweep.nc", progress=stopping_at(0))


def test_a_time_limit_gives_what_was_computed(study):
    with pytest.raises(so.TimeLimitError):
        so.sweep(study, GRID, seconds=1e-3)
    # of the study it holds for each point
    late = so.sweep(replace(study, seconds=1e-4), {"F": [0.1, 0.2]}, workers=1)
    assert set(late.failures.values()) == {"response: the time limit of 0.0001 s was reached"} or all(
        "time limit" in text for text in late.failures.values()
    )


CODE = """
import sys
import suboctave as so
so.sweep(sys.argv[1], {grid}, path=sys.argv[2], resume=True, workers=2)
"""


def points_in(path):
    """How many points the journal of a sweep holds."""
    try:
        return sum(record.kind == "point" for record in read_journal(path.with_suffix(".journal")))
    except so.InputError:  # not there yet, or being removed
        return 0


def killed(study, path, points, delay):
    """Run the sweep in a process of its own and kill that some time after it has computed so many points in all."""
    code = CODE.format(grid=repr(GRID))
    with subprocess.Popen([sys.executable, "-c", code, str(study.source), str(path)]) as process:
        while process.poll() is None and points_in(path) < points:
            time.sleep(0.02)
        time.sleep(delay)
        process.kill()


@POSIX
@pytest.mark.slow
def test_a_killed_sweep_goes_on(study, grid, tmp_path):
    path = tmp_path / "sweep.nc"
    killed(study, path, 1, 0.0)
    assert same(so.sweep(study, GRID, path=path, resume=True, workers=1), grid)
    assert [file.name for file in tmp_path.iterdir()] == ["sweep.nc"]


@POSIX
@pytest.mark.slow
def test_a_sweep_killed_at_ten_moments_is_the_undisturbed_one(study, grid, tmp_path):
    draw = random.Random(5)
    path, left = tmp_path / "sweep.nc", []
    while len(left) < 10:
        killed(study, path, points_in(path) + draw.randint(0, 2), draw.uniform(0.0, 0.3))
        left.append(points_in(path))
        if path.exists():  # complete: it is begun anew
            assert same(so.load(path), grid)
            path.unlink()
    assert any(0 < count < 12 for count in left)
    assert same(so.sweep(study, GRID, path=path, resume=True), grid)


def test_on_a_dask_cluster_it_is_the_same(study, grid):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        assert same(so.sweep(study, GRID, scheduler=address), grid)


def test_a_cluster_that_is_not_there_is_refused(study, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("suboctave.workers._CONNECT", 0.5)
    with pytest.raises(so.InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        so.sweep(study, GRID, scheduler="tcp://127.0.0.1:9")


# ---------------------------------------------------------------------------------------------------------- wrong input
@pytest.mark.parametrize(
    ("parameters", "options", "words"),
    [
        ({"f": [1.0]}, {}, "the system has no parameter 'f' (did you mean 'F'?)"),
        ({"omega": [1.0]}, {}, "omega is no parameter of a sweep"),
        ({}, {}, "a sweep needs parameters"),
        ("F", {}, "parameters are given as a mapping"),
        ({"F": []}, {}, "F has no values"),
        ({"F": [0.1, 0.1]}, {}, "F: the value 0.1 is given twice"),
        ({"F": [0.1, float("nan")]}, {}, "F: nan is no finite number"),
        ({"F": ["0.1"]}, {}, "F: '0.1' is no finite number"),
        ({"F": {"from": 0.1, "to": 0.2}}, {}, "F: a range needs count"),
        ({"F": {"from": 0.1, "too": 0.2, "count": 3}}, {}, "F: there is no 'too' of a range (did you mean 'to'?)"),
        ({"F": {"from": 0.1, "to": 0.2, "count": 1}}, {}, "at least 2 values"),
        ({"F": {"from": -0.1, "to": 0.2, "count": 5, "spacing": "log"}}, {}, "positive ends"),
        ({"F": {"distribution": ["normal"]}}, {"draws": 3}, "there is no distribution ['normal']"),
        ({"F": {"from": -1e308, "to": 1e308, "count": 3}}, {}, "F has the value"),
        ({"F": {"distribution": "gauss"}}, {"draws": 3}, "F: there is no distribution 'gauss'"),
        ({"F": {"distribution": "norml"}}, {"draws": 3}, "did you mean 'normal'"),
        ({"F": {"distribution": "normal", "mean": 1.0}}, {"draws": 3}, "the normal distribution needs deviation"),
        (
            {"F": {"distribution": "normal", "mean": 1.0, "sigma": 1.0}},
            {"draws": 3},
            "the normal distribution has no 'sigma'; known: deviation, mean",
        ),
        ({"F": {"distribution": "uniform", "low": 1.0, "high": 0.5}}, {"draws": 3}, "low must be below high"),
        ({"F": {"distribution": "normal", "mean": 1.0, "deviation": 0.0}}, {"draws": 3}, "deviation must be positive"),
        (DRAWN, {}, "draws is missing"),
        (DRAWN, {"draws": 0}, "draws must be a positive whole number, not 0"),
        (DRAWN, {"draws": 10, "sampling": "sobl"}, "there is no sampling 'sobl' (did you mean 'sobol'?)"),
        (DRAWN, {"draws": 10, "sampling": "sobol"}, "draws=8 or 16"),
        (DRAWN, {"draws": 10, "seed": -1}, "seed=-1"),
        ({**DRAWN, "alpha": [1.0, 2.0]}, {"draws": 3}, "alpha has values and others have distributions"),
        ({"F": [0.1]}, {"draws": 3}, "draws are of distributions"),
        ({"F": {"from": 0.0, "to": 1.0, "count": 10_000}, "c": {"from": 0.0, "to": 1.0, "count": 200}}, {}, "too many"),
        ([{"F": 0.1}, {"c": 0.1}], {}, "point 1 of the list has not the parameters of the first one, F"),
        ([{"F": 0.1}, {"F": None}], {}, "point 1 of the list: F is a finite number"),
        ({"F": [0.1]}, {"measure": "peak"}, "measure must be a function of 1 argument"),
        ({"F": [0.1]}, {"listed": 0}, "listed"),
        ({"F": [0.1]}, {"workers": 0}, "workers must be a positive whole number, not 0"),
        ({"F": [0.1]}, {"path": "sweep.csv"}, "must end in .nc"),
        (None, {}, "what is swept over?"),
    ],
)
def test_wrong_input_is_refused_before_any_work(study, parameters, options, words):
    with pytest.raises(so.InputError) as caught:
        so.sweep(study, parameters, progress=lambda *_: pytest.fail("work has begun"), **options)
    assert words in str(caught.value)


def test_a_parameter_that_the_analyses_do_not_take_from_the_system_is_refused(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY + "parameters = { F = 0.2 }\n")
    with pytest.raises(so.InputError, match="F has a value of its own in the analysis 'response'"):
        so.sweep(path, {"F": [0.1]})
    path.write_text(
        STUDY.replace('type = "frequency_response"\nomega = [3.0, 0.5]', "").split("[[analyses]]")[0] + ISOLAS
    )
    with pytest.raises(so.InputError, match="F varies in every analysis"):
        so.sweep(path, {"F": [0.1]})


ISOLAS = """
[[analyses]]
name = "isolas"
type = "find_isolas"
omega = [0.5, 3.0]
parameter = "F"
bounds = [0.1, 0.2]
"""


# ------------------------------------------------------------------------------------------------- table and figure
def test_the_table_of_points_has_what_varies(grid):
    table, whole = grid.points_table(), grid.to_dataframe()
    assert list(table.columns)[:3] == ["F", "c", "response.peak_amplitude"]
    for name in whole.columns:
        told = name in table.columns
        assert told == (whole[name].nunique(dropna=False) > 1 and name != "seconds"), name
        if told:
            np.testing.assert_array_equal(table[name], whole[name])
    assert list(grid.points_table(["response.LP"]).columns) == ["F", "c", "response.LP"]
    with pytest.raises(so.InputError, match=r"response\.LP"):
        grid.points_table(["response.PL"])


def test_the_figure_follows_the_number_of_parameters(grid):
    quantity = "response.peak_amplitude"
    frame = grid.to_dataframe()
    # two: a map, whose cells are the points
    axes = grid.plot(quantities=[quantity, "response.LP"]).axes
    (cells,) = axes[0].collections
    np.testing.assert_array_equal(np.asarray(cells.get_array()), frame[quantity].to_numpy().reshape(4, 3).T)
    assert (axes[0].get_xlabel(), axes[0].get_ylabel()) == ("F", "c")
    # one: joined in its order; more: a row for each quantity, a column for each parameter
    columns = {name: frame[name].to_numpy() for name in frame.columns}
    (line,) = plot_points({name: values[::-1] for name, values in columns.items()}, ["F"], [quantity]).axes[0].lines
    assert np.all(np.diff(line.get_xdata()) >= 0.0)
    columns["k"] = columns["F"] * columns["c"]
    figure = plot_points(columns, ["F", "c", "k"], [quantity, "response.LP"])
    shown = {(one.get_subplotspec().rowspan.start, one.get_subplotspec().colspan.start): one for one in figure.axes}
    assert len(shown) == 6
    assert [shown[1, i].get_xlabel() for i in range(3)] == ["F", "c", "k"]
    assert [shown[i, 0].get_ylabel() for i in range(2)] == [quantity, "response.LP"]
    np.testing.assert_array_equal(np.sort(shown[0, 2].lines[0].get_xdata()), np.sort(columns["k"]))
    # a point without a value is shown where it is
    columns[quantity] = np.where(columns["F"] > 0.35, np.nan, columns[quantity])
    crosses = plot_points(columns, ["F", "c"], [quantity]).axes[0].lines[0]
    assert set(crosses.get_xdata()) == {0.4}


# ----------------------------------------------------------------------------------------------------- the command line
def test_the_command_line_sweeps_shows_and_goes_on(study, grid, study_file, suboctave, tmp_path):
    path = study_file(STUDY)
    options = ("--grid", "F=0.1:0.4:4", "--grid", "c=0.3", "--workers", "1")
    status, out, err = suboctave("sweep", path, *options)
    assert status == 0, err
    assert "response.peak_amplitude" in out
    folder = tmp_path / "study_results"
    found = so.load(folder / "sweep.nc")
    assert found.dataset["response.LP.omega"].identical(grid.dataset["response.LP.omega"].isel(c=[2]))
    assert len((folder / "sweep.csv").read_text().splitlines()) == 5
    assert (folder / "sweep.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "sweep.html").read_text(encoding="utf-8")
    assert page.count("<tr><td>") == 4  # a row for each point
    assert "4 points over F, c" in page
    assert "Picture of sweep" in page
    rows = [line.split()[:2] for line in out.splitlines()]
    assert [row for row in rows if row[1:] == ["0.3"]] == [[force, "0.3"] for force in ("0.1", "0.2", "0.3", "0.4")]
    status, _, err = suboctave("sweep", path, *options)
    assert (status, "left as it is" in err) == (2, True)
    assert suboctave("sweep", path, *options, "--resume")[0] == 0
    status, out, _ = suboctave("show", folder / "sweep.nc", "--csv", tmp_path / "tables")
    assert "4 points over F, c" in out
    assert (tmp_path / "tables" / "sweep.csv").read_text() == (folder / "sweep.csv").read_text()


def test_the_journal_of_a_sweep_says_how_far_it_came(suboctave, tmp_path):
    with closing(Journal.create(tmp_path / "sweep.journal")) as journal:
        journal.append("sweep", {"key": ""})
        journal.append("point", {"point": 0, "row": {}, "failure": "", "seconds": 1.0})
    assert "1 point computed" in suboctave("show", tmp_path / "sweep.journal")[1]


def test_the_study_file_says_what_is_swept(study_file, suboctave, tmp_path):
    text = STUDY + "[sweep]\ndraws = 3\nseed = 4\n[sweep.parameters]\n"
    path = study_file(text + 'F = { distribution = "uniform", low = 0.1, high = 0.2 }\n')
    status, out, err = suboctave("sweep", path, "--json", "--workers", "1")
    assert status == 0, err
    assert '"points": 3' in out
    found = so.load(tmp_path / "study_results" / "sweep.nc")
    expected = 0.1 + 0.1 * np.random.default_rng(4).random(3)
    assert found["F"].tolist() == expected.tolist()
    assert "sweep over F" in suboctave("show", path)[1]
    wrong = study_file(text + 'FF = { distribution = "uniform", low = 0.1, high = 0.2 }\n')
    status, _, err = suboctave("check", wrong)
    assert status == 2
    assert "line 22: sweep.parameters.FF: the system has no parameter 'FF' (did you mean 'F'?)" in err


def test_points_come_from_a_table(tmp_path):
    (tmp_path / "points.csv").write_text("F, c\n0.1, 0.2\n0.3, 0.1\n")
    assert parameters_of([], [], tmp_path / "points.csv") == [{"F": 0.1, "c": 0.2}, {"F": 0.3, "c": 0.1}]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--grid", "F"), "give NAME=..."),
        (("--grid", "F=0.1:0.2"), "give FROM:TO:COUNT"),
        (("--grid", "F=a,b"), "'a' is no number"),
        (("--grid", "F=1", "--grid", "F=2"), "given twice"),
        (("--random", "F=nrmal:1:2", "--draws", "2"), "did you mean 'normal'"),
        (("--random", "F=normal:1", "--draws", "2"), "give normal:MEAN:DEVIATION"),
        (("--random", "F=normal:1:0.1"), "draws is missing"),
        (("--points", "nothing.csv"), "there is no such file"),
        (("--points", "nothing.csv", "--grid", "F=1"), "leave --grid and --random out"),
        ((), "what is swept over?"),
    ],
)
def test_wrong_options_are_refused(study_file, suboctave, options, words):
    status, out, err = suboctave("sweep", study_file(STUDY), *options)
    assert status == 2
    assert words in " ".join(err.split())
    assert not out


@pytest.mark.slow
def test_the_page_prints_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(blocks("sweeps.md", "toml")[0])
    check_prints("sweeps.md", capsys)
