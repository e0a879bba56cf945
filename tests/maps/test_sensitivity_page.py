"""docs/sensitivity.md prints what it says."""

from __future__ import annotations

import pytest
from pages import check_prints


@pytest.mark.slow
def test_the_page_prints_what_it_says(capsys):
    check_prints("sensitivity.md", capsys)
