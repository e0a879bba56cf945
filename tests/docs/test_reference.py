"""docs/api: every public name has a place, its docstring there, and an example that uses it."""

from __future__ import annotations

import re

import pytest
from pages import DOCS

import suboctave

PAGES = {path.stem: path.read_text(encoding="utf-8") for path in sorted((DOCS / "api").glob("*.md"))}
#: the sections of all pages by the name that they are about
SECTIONS = {
    title.replace("&#95;", "_"): section
    for text in PAGES.values()
    for title, section in re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", text, re.M | re.S)
}


def test_every_public_name_has_a_place_and_nothing_else_has():
    assert sorted(SECTIONS) == sorted(suboctave.__all__)


@pytest.mark.parametrize("name", sorted(set(suboctave.__all__) - {"__version__", "library", "structures"}))
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
