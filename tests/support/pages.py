"""Pages of docs/ print what they say: their blocks of code are run one after the other."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

DOCS = Path(__file__).parents[2] / "docs"
_NUMBER = r"-?\d+\.?\d*(?:e[+-]\d+)?"


def blocks(page: str, kind: str) -> list[str]:
    """The fenced blocks of a kind ("python", "text", "toml") of a page."""
    return re.findall(rf"^```{kind}\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.M | re.S)


def check_prints(page: str, capsys) -> None:
    """Run the code of a page; what each block prints is the text behind it, numbers to a thousandth."""
    scope: dict = {}
    for code, text in zip(blocks(page, "python"), blocks(page, "text"), strict=True):
        exec(compile(code, f"docs/{page}", "exec"), scope)
        check_same(capsys.readouterr().out, text)


def check_page(page: str, capsys, before: str = "", silent: bool = False) -> None:
    """Run the code of a page, block by block; a text block is what was printed since the last one.

    Unlike `check_prints` it takes blocks that print nothing, which no text follows. `before`: code that runs first, for
    pages that speak of something made elsewhere; `silent`: the page need not show what it prints.
    """
    text = (DOCS / page).read_text(encoding="utf-8")
    scope: dict = {"__name__": "page"}
    exec(compile(before, f"before docs/{page}", "exec"), scope)
    printed = ""
    for kind, content in re.findall(r"^```(python|text)\n(.*?)^```", text, re.M | re.S):
        if kind == "python":
            exec(compile(content, f"docs/{page}", "exec"), scope)
            printed += capsys.readouterr().out
        elif not silent:
            check_same(printed, content)
            printed = ""
    assert silent or not printed.strip(), f"docs/{page} does not show what it prints at its end: {printed}"


def check_same(printed: str, text: str) -> None:
    """That two texts are the same, numbers to a thousandth."""
    assert re.sub(_NUMBER, "", printed).split() == re.sub(_NUMBER, "", text).split()
    ours, theirs = (np.array([float(one) for one in re.findall(_NUMBER, part)]) for part in (printed, text))
    np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-6)
