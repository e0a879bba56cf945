"""`make docs`: the site is built without a warning. Scripts of examples/ are tests of their own and not run here."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from pages import DOCS


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    for package in ("sphinx", "myst_parser", "pydata_sphinx_theme", "sphinx-mathjax-offline"):
        pytest.importorskip(package, reason="make docs installs it")
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-n", "-q"]
    command += ["-d", str(tmp_path / "doctrees"), str(DOCS), str(tmp_path / "html")]
    environment = os.environ | {"SUBOCTAVE_DOCS_RUN": "0"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    index = (tmp_path / "html" / "index.html").read_text(encoding="utf-8")
    assert "Getting started" in index
    assert "https://cdn" not in index  # nothing is fetched when a page is read


def test_a_search_for_what_is_asked_first_finds_it():
    """Words in titles come first in the search of the site; each of these has one on the page of questions."""
    titles = re.findall(r"^### (.*)", (DOCS / "questions.md").read_text(encoding="utf-8"), re.M)
    asked = (
        "log",
        "axis",
        "dB",
        "CSV",
        "Excel",
        "natural frequencies",
        "export",
        "peak",
        "Hz",
        "phase",
        "rotor",
        "slow",
    )
    for word in asked:
        assert any(re.search(rf"\b{word}", title, re.I) for title in titles), word
