"""The demonstration computes what shooting found, and the README's example runs as printed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from suboctave.study import demo

# Shooting with exact variational equations (DOP853), good to 1e-8 in omega and 1e-7 in max |x|; kind, omega, max |x|.
SHOOTING = {
    (0.55, 1.0): [("LP", 1.29137366, 1.0012975), ("LP", 2.42383602, 3.8460899)],
    (0.55, 0.0): [
        ("PD", 3.99345233, 0.0580622),
        ("PD", 2.30315297, 0.2430141),
        ("LP", 1.70914371, 1.0020314),
        ("LP", 2.54593318, 3.9242705),
    ],
    (1.7, 0.0): [
        ("PD", 3.98160156, 0.1819252),
        ("PD", 2.39144003, 0.6762020),
        ("LP", 2.13215408, 1.0626451),
        ("LP", 3.59219111, 8.1893134),
        ("PD", 1.43110773, 1.5484606),
        ("PD", 1.31643924, 1.4523944),
    ],
}


@pytest.mark.parametrize("case", demo.CASES, ids=lambda case: f"p={case.p:g},j={case.j:g}")
def test_every_bifurcation_is_where_shooting_found_it(case):
    seen = []
    dataset = demo.compute(case, lambda fraction, text: seen.append(fraction)).to_xarray()
    expected = SHOOTING[case.p, case.j]
    touching = dataset["event_kind"].to_numpy() == "grazing"
    # the stop at -1 is first touched with amplitude 1, and so is the one at 1
    assert dataset["event_amplitude"].to_numpy()[touching] == pytest.approx([1.0] * (2 if case.j else 1), abs=1e-9)
    kinds, omega, amplitude = (
        dataset[f"event_{name}"].to_numpy()[~touching] for name in ("kind", "omega", "amplitude")
    )
    assert [str(kind) for kind in kinds] == [kind for kind, _, _ in expected]
    assert omega == pytest.approx([omega for _, omega, _ in expected], rel=0, abs=1e-6)
    assert amplitude == pytest.approx([x for _, _, x in expected], rel=0, abs=1e-5)
    assert dataset["omega"].to_numpy()[[0, -1]] == pytest.approx(demo.OMEGA, abs=1e-12)
    assert seen
    assert all(0.0 <= fraction <= 1.0 for fraction in seen)


def test_the_example_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    exec(compile(example, "README.md", "exec"), scope)
    assert [event.kind for event in scope["curve"].bifurcations] == ["PD", "PD", "LP", "LP"]
    # The exact law, from shooting and from harmonic balance with 63 harmonics.
    assert scope["curve"].bifurcations["PD"][0].omega == pytest.approx(3.9697105128, abs=1e-6)
    assert (tmp_path / "response.png").exists()
    assert "Branch" in capsys.readouterr().out
