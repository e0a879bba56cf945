"""Tutorial and how-to pages of docs/: their code runs from top to bottom, and prints what they say."""

from __future__ import annotations

import pytest
from pages import DOCS, check_page

PAGES = sorted(path.relative_to(DOCS).as_posix() for folder in ("tutorial", "howto") for path in (DOCS / folder).iterdir())


@pytest.mark.parametrize("page", PAGES)
def test_a_page_prints_what_it_says(page, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    check_page(page, capsys)
