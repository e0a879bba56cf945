"""docs/theory: what a page names exists, and the table names a function for every equation of the paper."""

from __future__ import annotations

import importlib
import re

import pytest
from pages import DOCS

import suboctave

PAGES = sorted((DOCS / "theory").glob("*.md"))
ROOMS = {path.parent.name for path in (DOCS.parent / "src" / "suboctave").glob("*/__init__.py")}


def functions_in(text: str) -> list[str]:
    """Dotted names in code that begin with a room of the package."""
    names = re.findall(r"`([a-z_]+(?:\.\w+)+)`", text)
    return [name for name in names if name.split(".")[0] in ROOMS]


def found(name: str) -> object:
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            value = importlib.import_module("suboctave." + ".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            value = getattr(value, part)
        return value
    raise AttributeError(name)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_names_exists(page):
    for name in functions_in(page.read_text(encoding="utf-8")):
        assert found(name) is not None, name


def test_every_row_of_the_table_names_a_function():
    rows = [
        line for line in (DOCS / "theory" / "paper.md").read_text(encoding="utf-8").splitlines() if line[:3] == "| ("
    ]
    assert len(rows) >= 25
    for row in rows:
        last = row.rstrip(" |").rsplit(" | ", 1)[1]
        assert functions_in(last) or "`Alcorta2019" in row, row
    numbers = {int(number) for row in rows for number in _numbers(row.split(" | ")[0])}
    assert set(range(1, 54)) - numbers <= {51, 52}


def _numbers(cell: str) -> list[int]:
    """The equations that a cell names: (4), (9)-(11), (15), (16)."""
    spans = re.findall(r"\((\d+)\)(?:-\((\d+)\))?", cell)
    return [number for first, last in spans for number in range(int(first), int(last or first) + 1)]


def test_a_public_name_that_a_page_calls_exists():
    for page in PAGES:
        for name in re.findall(r"\bso\.(\w+)", page.read_text(encoding="utf-8")):
            assert hasattr(suboctave, name), (page.name, name)


def test_the_numbers_of_the_safeguards_are_those_of_the_code():
    page = (DOCS / "theory" / "safeguards.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w.]+)\.(\w+)` \| ([-\d.e]+) \|", page, re.M)
    assert len(rows) > 30
    for module, name, value in rows:
        assert getattr(importlib.import_module(f"suboctave.{module}"), name) == float(value), name
