"""Figures of boundaries in study files: drawn as by a script, written into tables, mistakes told with their keys."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import suboctave as so

ONE_MASS = (Path(__file__).parent / "one_mass.toml").read_text(encoding="utf-8")
STUDY = f"""
title = "limit points over the load"
{ONE_MASS}[[analyses]]
name = "response"
type = "frequency_response"
omega = [3.0, 0.5]
harmonics = 3
[[analyses]]
name = "weak"
type = "frequency_response"
omega = [3.0, 0.5]
harmonics = 3
parameters = {{ F = 0.2 }}
[[analyses]]
name = "limits"
type = "track"
start = {{ analysis = "response", bifurcation = "LP", index = 1 }}
parameter = "F"
bounds = [0.2, 0.4]
[outputs]
csv = true
html = "report.html"
[[outputs.figures]]
file = "responses.png"
[[outputs.figures]]
kind = "boundary"
file = "plane.svg"
title = "Where it jumps"
[[outputs.figures]]
kind = "boundary"
file = "amplitude.svg"
quantity = "amplitude"
x = "F"
[[outputs.figures]]
kind = "space"
file = "space.svg"
azimuth = -40.0
"""


def test_drawn_as_by_a_script(study_file, suboctave, tmp_path):
    path = study_file(STUDY)
    status, _, err = suboctave("run", path)
    assert status == 0, err
    folder = path.parent / "study_results"
    results = so.load(folder / "results.nc")
    # from the file read back, live objects having drawn what the study wrote
    results["limits"].plot(tmp_path / "plane.svg", title="Where it jumps")
    results["limits"].plot(tmp_path / "amplitude.svg", quantity="amplitude", x="F")
    so.plot_space(results, tmp_path / "space.svg", azimuth=-40.0)
    so.plot([results["response"], results["weak"]], tmp_path / "responses.png")
    for name in ("plane.svg", "amplitude.svg", "space.svg", "responses.png"):
        assert (folder / name).read_bytes() == (tmp_path / name).read_bytes(), name
    with (folder / "limits.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    limits = results["limits"]
    assert [float(row["F"]) for row in rows] == list(limits.parameter("F"))
    assert [float(row["coefficient"]) for row in rows] == list(limits.coefficient)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Response curves and boundaries over ω and F" in page


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "space"', 'kind = "spaec"', "did you mean 'space'"),
        ("azimuth = -40.0", "azimut = -40.0", "azimut"),
        ("azimuth = -40.0", 'azimuth = "left"', "azimuth"),
        ("azimuth = -40.0", 'x = "G"', "neither omega nor a parameter"),
        ("azimuth = -40.0", 'analyses = ["response"]', "the parameter into the depth"),
        ("azimuth = -40.0", 'x = "F"\ny = "F"', "is 'F', which is x as well"),
        ('x = "F"\n', 'x = "F"\ny = "omega"\n', "with a quantity"),
        ('title = "Where it jumps"', 'analyses = ["response"]', "'response' is no curve of bifurcations"),
        ('title = "Where it jumps"', 'analyses = ["limit"]', "did you mean 'limits'"),
        ('title = "Where it jumps"', 'labels = ["a", "b"]', "2 labels for 1 curves"),
        ('title = "Where it jumps"', 'y = "c"', "is not free on these curves"),
        ('title = "Where it jumps"', "elevation = 3.0", "elevation"),
        ('file = "responses.png"', 'file = "responses.png"\nanalyses = ["limits"]', 'kind = "boundary" draws it'),
        ('title = "Where it jumps"', 'title = "$\\\\frac{$"', "cannot be drawn"),
    ],
)
def test_mistakes(study_file, suboctave, old, new, message):
    assert old in STUDY
    status, _, err = suboctave("check", study_file(STUDY.replace(old, new)))
    assert status == 2
    assert message in err


def test_a_boundary_needs_an_analysis_that_tracks(study_file, suboctave):
    start, end = STUDY.index('[[analyses]]\nname = "limits"'), STUDY.index("[outputs]")
    status, _, err = suboctave("check", study_file(STUDY[:start] + STUDY[end:]))
    assert status == 2
    assert "no analysis of the type 'track'" in err
