"""What the tutorial tells its readers to do works, and gives what it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.study.cli import examples

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial" / "first_study.md").read_text(encoding="utf-8")
FIRST, LAST = TUTORIAL.split("## Period doubling, ")
LAST, BOUNDARIES = LAST.split("## Boundaries")
CASCADE, SUBHARMONIC = LAST.split("### Sub-harmonics")


def blocks(kind, part=FIRST):
    return re.findall(rf"^```{kind}\n(.*?)^```", part, re.M | re.S)


def touches(amplitude, force, zeta):
    """The frequencies, in units of the resonance, at which the linear oscillator reaches an amplitude, low and high."""
    # (1 - s)^2 + (2 zeta)^2 s = (force / amplitude)^2 with s the square of the frequency
    roots = np.roots([1.0, 4.0 * zeta**2 - 2.0, 1.0 - (force / amplitude) ** 2])
    return np.sqrt(np.sort(roots.real))


def numbers(table):
    """Kinds, frequencies and amplitudes of a printed table."""
    return re.findall(r"^ (LP|PD|NS|BP|grazing(?: \d)?) +([\d.]+) +([\d.]+)", table, re.M)


def test_three_lines_of_the_new_file_are_changed(suboctave, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert suboctave("new", "study.toml")[0] == 0
    before = Path("study.toml").read_text(encoding="utf-8").splitlines()
    (after,) = blocks("toml")
    changed = [a for a, b in zip(before, after.splitlines(), strict=True) if a != b]
    assert [line.split(" = ")[0] for line in changed] == ["title", "parameters", "omega"]


def test_its_study_and_its_script(suboctave, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (text,) = blocks("toml")
    Path("study.toml").write_text(text, encoding="utf-8")
    checked, ran = blocks("console")
    assert suboctave("check", "study.toml")[1] == checked.split("\n", 1)[1]
    status, out, _ = suboctave("run", "study.toml")
    assert status == 0
    assert numbers(out) == numbers(ran)  # the table is what the program prints
    assert len(numbers(out)) == 6

    script, again = blocks("python")
    scope = {}
    exec(compile(script + again, "docs/tutorial/first_study.md", "exec"), scope)
    said = capsys.readouterr().out
    printed = blocks("text")[1]
    assert said.splitlines()[0] == printed.splitlines()[0]
    assert said.splitlines()[2:] == printed.splitlines()[2:]
    assert "Verification: agrees" in said
    # before the stop is touched the oscillator is linear
    low, high = touches(0.5, force=0.1, zeta=0.02)
    first, *_, last = scope["curve"].grazings
    assert first.omega == pytest.approx(high, abs=1e-9)
    assert last.omega == pytest.approx(low, abs=1e-9)


def without_points(tree):
    """A printed tree without the numbers of points, which change with the steps."""
    return re.sub(r"\d+ points, \d+ unstable", "", tree)


@pytest.mark.slow
def test_its_cascade(suboctave, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made, _ = blocks("python")
    switched, tree = blocks("python", CASCADE)
    said, printed = blocks("text", CASCADE)
    scope = {}
    exec(compile(made.split("curve = ")[0] + switched, "docs/tutorial/first_study.md", "exec"), scope)
    assert capsys.readouterr().out == said
    exec(compile(tree, "docs/tutorial/first_study.md", "exec"), scope)
    assert without_points(capsys.readouterr().out) == without_points(printed)
    assert Path("cascade.png").stat().st_size > 0
    diagram = so.load("cascade.nc")
    assert repr(diagram) == repr(scope["diagram"])
    assert diagram.stopped == ""
    # as long as only the stop at 0 is touched, the equation has no length of its own: the force does not matter
    weak = scope["hard"].with_parameters({"p": 0.1})
    again = so.frequency_response(weak, omega=(4.0, 2.1)).bifurcations["PD"]
    for one, other in zip(again, diagram[0].branch.bifurcations["PD"], strict=True):
        assert one.omega == pytest.approx(other.omega, abs=1e-6)
        assert one.amplitude / 0.1 == pytest.approx(other.amplitude / 1.7, rel=1e-5)

    (first,), (second,) = blocks("toml"), blocks("toml", CASCADE)
    Path("study.toml").write_text(first.split("[[analyses]]")[0] + second, encoding="utf-8")
    status, out, err = suboctave("run", "study.toml")
    assert status == 0, err
    assert "3 branches" in out
    found = so.load("study_results/results.nc")
    assert found["once more"].nu == 8
    np.testing.assert_array_equal(found["cascade"][1].branch.omega, diagram[1].branch.omega)
    np.testing.assert_allclose(sorted(found["once more"].omega[[0, -1]]), [2.42595, 2.4488], atol=3e-4)


def test_its_isolated_subharmonic(capsys):
    (script,), (printed,) = blocks("python", SUBHARMONIC), blocks("text", SUBHARMONIC)
    exec(compile("import suboctave as so\n" + script, "docs/tutorial/first_study.md", "exec"), {})
    assert capsys.readouterr().out == printed


def test_its_mistakes_are_told_as_it_says(suboctave, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (text,) = blocks("toml")
    text = text.replace("alpha = 0.0", "alpa = 0.0").replace("omega = [2.5, 0.5]", "omega = [2.5]")
    Path("study.toml").write_text(text, encoding="utf-8")
    status, _, err = suboctave("check", "study.toml")
    assert status == 2
    assert err == blocks("text")[0]


def test_its_boundaries(suboctave, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (text,), (more,) = blocks("toml"), blocks("toml", BOUNDARIES)
    (script, _), (chapter,) = blocks("python"), blocks("python", BOUNDARIES)
    scope = {}
    exec(compile(script, "docs/tutorial/first_study.md", "exec"), scope)
    capsys.readouterr()
    exec(compile(chapter, "docs/tutorial/first_study.md", "exec"), scope)
    said = capsys.readouterr().out
    assert [said] == blocks("text", BOUNDARIES)
    assert Path("boundaries.png").stat().st_size > 0
    # the limit points of a response computed at one of these gaps
    curve = so.frequency_response(scope["system"].with_parameters({"j": 0.2}), omega=(2.5, 0.5))
    assert [f"{point.omega:.4f}" for point in curve.bifurcations["LP"]] == re.findall(r"j = 0.2: omega = (.*)", said)
    (figure,) = re.findall(r"`(\{ kind = .*? \})`", BOUNDARIES)
    whole = text.replace('{ file = "response.png" }', '{ file = "response.png" }, ' + figure) + more
    assert figure in whole
    Path("study.toml").write_text(whole, encoding="utf-8")
    status, _, err = suboctave("run", "study.toml")
    assert status == 0, err
    found = so.load("study_results/results.nc")["falls"]
    assert np.abs(found.omega - scope["limits"][1].omega).max() < 1e-9
    assert Path("study_results/falls.png").stat().st_size > 0


def test_every_command_it_names_is_there(suboctave):
    for command in set(re.findall(r"suboctave (\w+) ", "\n".join(blocks("sh") + blocks("console")))):
        assert suboctave(command, "--help")[0] == 0
    assert "new --list" in TUTORIAL
    assert len(examples()) >= 5


def test_the_housing_on_a_shaker(suboctave, tmp_path):
    status, out, err = suboctave("run", ROOT / "examples" / "study_housing.toml", "--out", tmp_path / "out")
    assert status == 0, err
    sweep = so.load(tmp_path / "out" / "results.nc")["sweep"]
    assert (tmp_path / "out" / "sweep.png").stat().st_size > 0
    # in SI units: relative motion of 1 mm under a = 1 m/s^2, natural frequency sqrt(k / m)
    natural = np.sqrt(2000.0 / 0.5)
    low, high = natural * touches(1e-3, force=1.0 / natural**2, zeta=0.03)
    first, *_, last = sweep.grazings
    assert first.omega == pytest.approx(high, rel=1e-9)
    assert last.omega == pytest.approx(low, rel=1e-9)
    assert sum(line.startswith(" LP") for line in out.splitlines()) == 2
