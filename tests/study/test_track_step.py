"""The step "track" of study files: the same curve as by a script; mistakes are told with their keys."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

ONE_MASS = (Path(__file__).parent / "one_mass.toml").read_text(encoding="utf-8")
STUDY = f"""
title = "limit points over the load"
{ONE_MASS}[[analyses]]
name = "response"
type = "frequency_response"
omega = [3.0, 0.5]
harmonics = 3
[[analyses]]
name = "limits"
type = "track"
start = {{ analysis = "response", bifurcation = "LP", index = 1 }}
parameter = "F"
bounds = [0.05, 0.5]
"""


def test_as_by_a_script(study_file, suboctave):
    path = study_file(STUDY)
    status, _, err = suboctave("run", path)
    assert status == 0, err
    found = so.load(path.parent / "study_results" / "results.nc")["limits"]
    study = read_study(path)
    response = so.frequency_response(study.system, (3.0, 0.5), harmonics=3)
    curve = so.track(response.bifurcations["LP"][1], "F", (0.05, 0.5))
    assert found.kind == "LP"
    assert found.omega == pytest.approx(curve.omega, rel=1e-9)
    (cusp,) = found.bifurcations["CP"]
    assert cusp.parameter("F") == pytest.approx(found.parameter("F").min(), rel=0.05)


def test_two_parameters(study_file):
    text = STUDY.replace('parameter = "F"', 'parameter = ["F", "c"]').replace(
        "bounds = [0.05, 0.5]", "bounds = [[0.2, 0.5], [0.05, 0.2]]"
    )
    curve = run_study(read_study(study_file(text))).finished[1].result
    assert curve.names == ("F", "c")
    assert np.ptp(curve.omega) == 0.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('parameter = "F"', 'parameter = "G"', "unknown parameter 'G'"),
        ('parameter = "F"', 'parameter = ["F"]', "is one name, beside omega, or two"),
        ("bounds = [0.05, 0.5]", "bounds = [0.5, 0.5]", "two different finite ends"),
        ("bounds = [0.05, 0.5]", "bounds = [0.05, 0.06]", "the bifurcations there have F = "),
        ('bifurcation = "LP", index = 1', "point = 3", "name a bifurcation"),
        ('bifurcation = "LP"', 'bifurcation = "CP"', "CP cannot be tracked"),
        ('parameter = "F"', 'parameter = "F"\nonto = "NS"', "LP is none"),
        ('parameter = "F"', 'parameter = "F"\nomega = [0.0, 1.0]', "frequencies are positive"),
    ],
)
def test_mistakes(study_file, suboctave, old, new, message):
    status, _, err = suboctave("run", study_file(STUDY.replace(old, new)))
    assert status != 0
    assert message in err


DAMPING = """
[[analyses]]
name = "tips"
type = "track"
start = { analysis = "limits", bifurcation = "extremum" }
parameter = "c"
bounds = [0.05, 0.15]
"""


def test_an_extremum_in_a_third_parameter(study_file):
    """The load `F (1 - q^2)` that a limit point needs is least at q = 0, whatever the damping."""
    text = STUDY.replace('amplitude = "F"', 'amplitude = "F*(1 - q**2)"').replace("F = 0.3 }", "F = 0.3, q = 0.1 }")
    text = text.replace('parameter = "F"', 'parameter = ["q", "F"]')
    text = text.replace("bounds = [0.05, 0.5]", "bounds = [[-0.8, 0.8], [0.05, 0.5]]") + DAMPING
    curve = run_study(read_study(study_file(text))).finished[-1].result
    assert (curve.names, curve.turning) == (("q", "F", "c"), "F")
    assert curve.parameter("c")[[0, -1]] == pytest.approx([0.05, 0.15])
    assert curve.parameter("q") == pytest.approx(0.0, abs=1e-9)
    assert set(curve.extreme) == {"minimum"}


def test_two_parameters_more_for_an_extremum(study_file, suboctave):
    text = STUDY + DAMPING.replace('"c"', '["c", "alpha"]').replace("[0.05, 0.15]", "[[0.05, 0.15], [0.5, 1.5]]")
    status, _, err = suboctave("run", study_file(text))
    assert status != 0
    assert "is one name: the third parameter" in err


ABSORBER = """
title = "tori from a resonance"
[system]
mass = [["m1", 0.0], [0.0, "m2"]]
damping = [["c1 + c2", "-c2"], ["-c2", "c2"]]
stiffness = [["k1 + k2", "-k2"], ["-k2", "k2"]]
parameters = { m1 = 1.0, c1 = 0.002, k1 = 1.0, a = 1.0, m2 = 0.05, c2 = 0.0128, k2 = 0.0454, b = 0.0042, F = 0.16 }
[[system.elements]]
type = "CubicSpring"
dof = 0
coefficient = "a"
[[system.elements]]
type = "CubicSpring"
dof = [0, 1]
coefficient = "b"
[[system.loads]]
type = "HarmonicLoad"
dof = 0
amplitude = "F"
[[analyses]]
name = "response"
type = "frequency_response"
omega = [0.9, 1.5]
harmonics = 3
[[analyses]]
name = "limits"
type = "track"
start = { analysis = "response", bifurcation = "LP", index = 2 }
parameter = "F"
bounds = [0.1, 0.2]
omega = [1.2, 1.5]
[[analyses]]
name = "tori"
type = "track"
start = { analysis = "limits", bifurcation = "R1" }
parameter = "F"
bounds = [0.1, 0.2]
"""


def test_another_curve_from_a_point_of_codimension_two(study_file, suboctave):
    results = run_study(read_study(study_file(ABSORBER))).finished
    limits, tori = (finished.result for finished in results[1:])
    assert tori.kind == "NS"
    expected = so.track(limits.bifurcations["R1"][0], "F", (0.1, 0.2))
    assert tori.kappa == pytest.approx(expected.kappa, abs=1e-9)
    status, _, err = suboctave("run", study_file(ABSORBER + 'onto = "PD"\n'))
    assert status != 0
    assert "the curves through R1 are LP and NS" in err
