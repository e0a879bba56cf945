"""The steps "sensitivity" and "design_margin": as by a script, and their mistakes told."""

from __future__ import annotations

import pytest
from pages import blocks

import suboctave as so

(ANALYSES,) = blocks("sensitivity.md", "toml")
SYSTEM = '[system]\nlibrary = "reference_oscillator"\narguments = { p = 0.55, j = 0.5 }\n\n'
STUDY = SYSTEM + ANALYSES.replace("bounds = [0.0, 1.0]", "bounds = [0.0, 1.0]\nvalues = 2\nharmonics = 15")


@pytest.mark.slow
def test_the_study_of_the_page_gives_what_a_script_gives(study_file, suboctave):
    file = study_file(STUDY)
    status, out, err = suboctave("run", file)
    assert status == 0, err
    results = so.load(file.parent / f"{file.stem}_results" / "results.nc")
    (isola,) = results["isolas"]
    by_script = so.sensitivity(isola.born)
    table = results["birth"].to_dataframe().set_index("parameter")
    for name in by_script:
        assert table.loc[name, "d j"] == pytest.approx(by_script[name]["j"], rel=1e-6)
    margin = so.design_margin(isola, by=["zeta", "Kc", "p"], at=0.5)
    assert results["margin"]["gone_at"] == pytest.approx(list(margin.values.values()), rel=1e-6)
    assert f"{margin.distance:.6g}" in out


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('bifurcation = "isola_centre"', 'bifurcation = "isola_center"', "did you mean 'isola_centre'"),
        (', bifurcation = "isola_centre"', "", "name a bifurcation"),
        ('"zeta", "Kc"', '"zetta", "Kc"', "did you mean 'zeta'"),
        ('by = ["zeta", "Kc", "p"]\n', "", "by"),
        ("isola = 0 }\nby", "isola = 0, at = 0.5 }\nby", "stands beside"),
        ('name = "margin"', 'name = "margin"\nparameters = { p = 0.5 }', "leave them out"),
    ],
)
def test_mistakes(old, new, words, study_file, suboctave):
    assert old in STUDY
    status, _, err = suboctave("check", study_file(STUDY.replace(old, new)))
    assert status == 2
    assert words in err
