"""The code of docs/meshes.md runs from top to bottom, and writes what it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "meshes.md"


def test_the_code_of_the_page_runs(tmp_path, monkeypatch):
    for package in ("skfem", "meshio", "pyvista"):
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 7
    exec("\n".join(blocks), {})
    assert {path.name for path in tmp_path.iterdir()} == {"third_mode.png", "block.svg", "motion.gif", "plate.vtu"}
