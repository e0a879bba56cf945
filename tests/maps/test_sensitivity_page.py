"""docs/sensitivity.md and the page on structural damping print what they say."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = r"-?\d+\.?\d*(?:e[+-]\d+)?"


def test_the_page_prints_what_it_says(capsys):
    page = (DOCS / "sensitivity.md").read_text(encoding="utf-8")
    codes, texts = (re.findall(rf"^```{kind}\n(.*?)^```", page, re.M | re.S) for kind in ("python", "text"))
    scope: dict = {}
    for code, text in zip(codes, texts, strict=True):
        exec(compile(code, "docs/sensitivity.md", "exec"), scope)
        printed = capsys.readouterr().out
        assert re.sub(NUMBER, "", printed).split() == re.sub(NUMBER, "", text).split()
        ours, theirs = (np.array([float(one) for one in re.findall(NUMBER, part)]) for part in (printed, text))
        np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-6)
