"""The step "stepped_sine" of study files: the table of a script's test; mistakes are told before any work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")
STEP = """
[[analyses]]
name = "rig"
type = "stepped_sine"
omega = [1.0, 1.6]
values = 4
direction = ["up", "down"]
transient = 60
periods = 12
tap = [1.4, 0, -1.5]
noise = 0.001
seed = 3
"""
ALONE = DUFFING[: DUFFING.index("[[analyses]]")] + STEP


def test_as_by_a_script(study_file):
    study = read_study(study_file(ALONE))
    outcome = run_study(study)
    table = outcome.finished[0].result
    test = so.stepped_sine(
        study.system, (1.0, 1.6), values=4, direction=("up", "down"), transient=60, periods=12, tap=(1.4, 0, -1.5),
        noise=0.001, seed=3,
    )  # fmt: skip
    np.testing.assert_array_equal(table["amplitude"], test.to_dataframe()["amplitude"])
    assert list(table["direction"]) == 4 * ["up"] + 4 * ["down"]
    read = so.load(outcome.files[0])["rig"]
    assert read["harmonic_3"].tobytes() == table["harmonic_3"].tobytes()


@pytest.mark.parametrize(
    ("wrong", "right", "words"),
    [
        ('direction = ["up", "down"]', 'direction = "sideways"', "direction"),
        ("tap = [1.4, 0, -1.5]", "tap = [1.4, 2, -1.5]", "out of range"),
        ("tap = [1.4, 0, -1.5]", "tap = [1.4, 0.5, -1.5]", "whole number"),
        ("tap = [1.4, 0, -1.5]", "tap = [3.0, 0, -1.5]", "not within"),
        ("omega = [1.0, 1.6]", "omega = [1.0, 1.0]", "two different"),
        ("periods = 12", "periods = 7", "whole number"),
        ("noise = 0.001", "noise = -1.0", "noise"),
        ("transient = 60", "transsient = 60", "transient"),
        ("transient = 60", "settle = 60", "settle"),
    ],
)
def test_mistakes(study_file, wrong, right, words):
    assert wrong in ALONE
    with pytest.raises(InputError, match=words):
        read_study(study_file(ALONE.replace(wrong, right)))
