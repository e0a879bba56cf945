"""The steps "equilibria" and "limit_cycles", and their page: as by a script, and their mistakes told."""

from __future__ import annotations

import numpy as np
import pytest
from pages import blocks, check_prints

import suboctave as so

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")

(ANALYSES,) = blocks("self_excited.md", "toml")
SYSTEM = """[system]
equations = [
  "h'' + xa*a'' + 2*zeta*w*h' + w**2*h + beta*U**2*a + beta*U*h' = 0",
  "xa*h'' + r2*a'' + 2*zeta*r2*a' + r2*(a - k3*a**3 + k5*a**5) - beta*e*U**2*a - beta*e*U*h' = 0",
]
parameters = { xa = 0.2, r2 = 0.25, zeta = 0.01, w = 0.5, beta = 0.1, e = 0.2, k3 = 2.0, k5 = 20.0, U = 0.5 }

"""
FIGURE = '[[outputs.figures]]\nfile = "flutter.png"\nanalyses = ["rest", "cycles"]\nx = "U"\n'
STUDY = SYSTEM + ANALYSES + "\n" + FIGURE


def test_the_page_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_prints("self_excited.md", capsys)
    assert (tmp_path / "flutter.png").exists()


def test_the_study_of_the_page_gives_what_a_script_gives(study_file, suboctave):
    file = study_file(STUDY)
    status, out, err = suboctave("run", file)
    assert status == 0, err
    folder = file.parent / f"{file.stem}_results"
    results = so.load(folder / "results.nc")
    assert repr(results["rest"]).startswith("Equilibria: ")
    cycles = so.limit_cycles(results["rest"].bifurcations["Hopf"][0])
    np.testing.assert_array_equal(results["cycles"].amplitude, cycles.amplitude)
    border = results["border"]
    assert border.turning == "U"
    assert border.plane == ("zeta", "U")
    assert (folder / "flutter.png").exists()
    assert "Hopf" in out


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('bifurcation = "Hopf"', 'bifurcation = "Hopff"', "did you mean 'Hopf'"),
        (', bifurcation = "Hopf"', "", "only from a Hopf point"),
        (', bifurcation = "Hopf" }', ' }\nparameter = "U"', "needs the range [from, to] of U"),
        ('parameter = "U"', 'parameter = "V"', "unknown parameter 'V'"),
        ("bounds = [1.0, 2.0]", "bounds = [1.0, 2.0]\nstart = [0.0]", "needs 2 displacements, not 1"),
        ("bounds = [1.0, 2.0]", "bounds = [1.0, 2.0]\nharmonics = 3", "equilibria have none"),
        ('= 0"', '= cos(omega*t)"', "a load drives this system"),
    ],
)
def test_mistakes(old, new, words, study_file, suboctave):
    assert old in STUDY
    status, _, err = suboctave("check", study_file(STUDY.replace(old, new, 1)))
    assert status == 2
    assert words in err
