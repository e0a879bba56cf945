"""The code of every page of docs/ runs from top to bottom, and prints what the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pages import DOCS, check_page
from slow import slow

ROOT = Path(__file__).parents[2]
#: seconds each: maps and searches, which have tests of their own
SLOW = ("api/maps.md", "howto/isola.md", "howto/period_doubling.md", "howto/regime_map.md", "tutorial/isola.md")
SHORT = sorted(
    path.relative_to(DOCS).as_posix()
    for folder in ("tutorial", "howto", "api")
    for path in (DOCS / folder).glob("*.md")
    if path.name != "first_study.md" and path.relative_to(DOCS).as_posix() not in SLOW
)
#: what pages speak of that is made elsewhere
BEFORE = {
    "pictures.md": """
import suboctave as so

system = so.library.reference_oscillator(p=0.55, j=0.0)
curve = strong = so.frequency_response(system, (4.1, 1.3), harmonics=9)
weak = so.frequency_response(system.with_parameters({"p": 0.3}), (4.1, 1.3), harmonics=9)
curves = [strong]
doubling, fold = (curve.bifurcations[kind][0] for kind in ("PD", "LP"))
folds = so.track(fold, "j", (0.0, 0.5))
doubled = so.switch_branch(doubling)
so.Results({"response": curve}, {"title": "a study"}).save("results.nc")
""",
    "results.md": """
import suboctave as so

system = so.library.reference_oscillator(p=1.7, j=0.0)
diagram = so.bifurcation_diagram(system, (4.1, 2.2), depth=2, harmonics=9)
diagram[0].branch.save("curve.nc")
so.Results({"response": diagram[0].branch, "diagram": diagram}, {"title": "a study"}).save("results.nc")
""",
    "time.md": """
with open("rig.csv", "w") as file:
    file.write("f,X1\\n0.35,100.0\\n0.36,110.0\\n")
""",
}
#: some seconds to a minute each; what their verbs give has tests of its own
LONG = (
    "chaos.md",
    "codimension_two.md",
    "extrema.md",
    "formulations.md",
    "isolas.md",
    "phase_resonance.md",
    "pictures.md",
    "regimes.md",
    "results.md",
    "time.md",
)
#: these show only some of what they print
SILENT = ("chaos.md", "pictures.md", "regimes.md", "results.md", "time.md")
#: run beside the tests of what they are about
ELSEWHERE = {
    "meshes.md": "structures/test_meshes_page.py",
    "messages.md": "docs/test_messages.py",
    "nonlinear_modes.md": "analysis/test_nonlinear_modes.py",
    "self_excited.md": "study/test_undriven_steps.py",
    "sensitivity.md": "maps/test_sensitivity_page.py",
    "structures.md": "structures/test_page.py",
    "sweeps.md": "study/test_sweeps.py",
    "tutorial/first_study.md": "study/test_tutorial.py",
}
#: shows the verbs side by side, a minute of them: each is in a page that runs
OUTLINE = ("index.md",)


def run(page, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    check_page(page, capsys, BEFORE.get(page, ""), page in SILENT)


@pytest.mark.parametrize("page", [*SHORT, *slow(*SLOW), "coming_from.md", "questions.md"])
def test_a_page_prints_what_it_says(page, capsys, tmp_path, monkeypatch):
    run(page, capsys, tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("page", LONG)
def test_a_long_page_prints_what_it_says(page, capsys, tmp_path, monkeypatch):
    run(page, capsys, tmp_path, monkeypatch)


def test_every_page_with_code_is_run():
    pages = {
        path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md") if path.parts[len(DOCS.parts)] != "_build"
    }
    coded = {page for page in pages if re.search(r"^```python", (DOCS / page).read_text(encoding="utf-8"), re.M)}
    coded -= {page for page in coded if page.startswith("examples/")}  # generated of scripts that are tests themselves
    assert coded <= {*SHORT, *SLOW, "coming_from.md", "questions.md", *LONG, *ELSEWHERE, *OUTLINE}
    for page, test in ELSEWHERE.items():
        assert page.rpartition("/")[2] in (ROOT / "tests" / test).read_text(encoding="utf-8")


def test_every_page_is_in_the_site():
    """Reached from index.md by tables of contents."""
    reached: set[str] = set()
    waiting = ["index"]
    while waiting:
        name = waiting.pop()
        reached.add(name)
        if name.startswith("examples/"):  # generated
            continue
        text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        folder = name.rpartition("/")[0]
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```", text, re.M | re.S):
            names = [line for line in block.splitlines() if line and not line.startswith(":")]
            waiting += [full for each in names if (full := f"{folder}/{each}".strip("/")) not in reached]
    pages = {path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md")}
    assert {page for page in pages if not page.startswith(("_build", "examples/"))} <= reached
