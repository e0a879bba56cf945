"""docs/api: every public name has a place, its docstring there, and an example that uses it."""

from __future__ import annotations

import re

import pytest
from pages import DOCS

import suboctave
import suboctave as so

PAGES = {path.stem: path.read_text(encoding="utf-8") for path in sorted((DOCS / "api").glob("*.md"))}
#: the sections of all pages by the name that they are about
SECTIONS = {
    title.replace("&#95;", "_"): section
    for text in PAGES.values()
    for title, section in re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", text, re.M | re.S)
}


def test_every_public_name_has_a_place_and_nothing_else_has():
    assert sorted(SECTIONS) == sorted(suboctave.__all__)


@pytest.mark.parametrize("name", sorted(set(suboctave.__all__) - {"__version__", "library", "results", "structures"}))
def test_a_name_is_described_and_used(name):
    section = SECTIONS[name]
    assert re.search(rf"\.\. auto(function|class):: suboctave\.{name}$", section, re.M)
    assert "```python" in section


#: what verbs return, and errors: made by the verb beside them, not by their users
RETURNED = {
    *("Attractor", "Basins", "Bifurcation", "BifurcationDiagram", "Branch", "BruteForceDiagram", "DesignMargin"),
    *(
        "Isola",
        "IsolaMap",
        "Isolas",
        "LyapunovExponents",
        "LyapunovMap",
        "Measured",
        "PeriodicOrbit",
        "PoincareSections",
    ),
    *("RegimeMap", "Sensitivity", "Separation", "SteppedSine", "Trajectory"),
}


@pytest.mark.parametrize("name", sorted(set(suboctave.__all__) - RETURNED))
def test_its_example_names_it(name):
    assert re.search(rf"\bso\.{name}\b", SECTIONS[name].split("```python")[1])


def test_the_list_of_the_reference_names_all():
    assert all(f"`{name}`" in PAGES["index"] for name in suboctave.__all__)


def test_the_citation_is_of_this_version():
    assert f"\nversion: {suboctave.__version__}\n" in (DOCS.parent / "CITATION.cff").read_text(encoding="utf-8")


#: modules and files that go by the names of results
OTHERS = {"nc", "png", "gif", "bordered", "gaps", "measures", "extremum"}


@pytest.fixture(scope="module")
def results():
    """Results by the names that pages give them."""
    system = so.library.duffing(c=0.05, F=0.3)
    diagram = so.bifurcation_diagram(system, (2.5, 0.8), depth=0, harmonics=3)
    branch = next(iter(diagram)).branch
    fold = branch.bifurcations["LP"][0]
    tracked = so.track(fold, "F", (0.29, 0.31))
    mode = so.nonlinear_mode(so.System(1.0, 0.0, 1.0, [so.CubicSpring(0, 1.0)]), amplitude=0.2, harmonics=3)
    motion = so.integrate(system, omega=1.0, periods=2)
    brute = so.brute_force_diagram(system, (1.0, 1.1), values=2, transient=5, periods=8)
    return {
        **dict.fromkeys(("curve", "branch"), (branch, tracked, mode)),
        **dict.fromkeys(("orbit", "motion"), (branch.orbits[0], motion)),
        **dict.fromkeys(("event", "bifurcation"), (fold, *tracked.events)),
        "diagram": (diagram, brute),
    }


def test_attributes_that_pages_speak_of_exist(results):
    """In running text; blocks of code are run."""
    missing = []
    for path in sorted(DOCS.rglob("*.md")):
        text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.S)
        for code in re.findall(r"`([^`\n]+)`", text):
            for name, attribute in re.findall(rf"(?<![\w.])({'|'.join(results)})\.([a-z_]\w*)", code):
                if attribute not in OTHERS and not any(hasattr(one, attribute) for one in results[name]):
                    missing.append(f"{path.name}: {name}.{attribute}")
    assert not missing, "\n".join(missing)


def test_no_class_is_described_twice():
    """The page of results leaves out those that have a section of their own."""
    own = {name for page in PAGES.values() for name in re.findall(r"autoclass:: suboctave\.(\w+)", page)}
    left_out = re.search(r":exclude-members: (.+)", PAGES["results"])
    assert set(left_out[1].split(", ")) == own & set(suboctave.results.__all__)
