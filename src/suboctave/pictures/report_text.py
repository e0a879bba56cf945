"""Words and tables of a report page: everything that comes from a user is escaped here."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

__all__ = ["cell", "finite", "html_table", "number", "safe", "small", "spelt"]


def html_table(head: Sequence[tuple[str, str]], rows: Sequence[Sequence[str]]) -> str:
    """A table: headings with their class, and the cells of each row, as texts."""

    def written(tag: str, kind: str, text: str) -> str:
        named = f' class="{kind}"' if kind else ""
        return f"<{tag}{named}>{safe(text)}</{tag}>"

    top = "".join(written("th", "text" if kind == "long" else kind, name) for name, kind in head)
    body = "".join(
        "<tr>" + "".join(written("td", kind, text) for (_, kind), text in zip(head, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def cell(value: Any) -> str:
    """A value of a table as text."""
    if isinstance(value, complex | np.complexfloating):
        return number(complex(value))
    return f"{float(value):.9g}" if isinstance(value, float | np.floating) else str(value)


def number(value: complex) -> str:
    """A complex number, its imaginary part where it has one."""
    if not np.isfinite(value):
        return "–"
    return f"{value.real:.6f}" + (f" {value.imag:+.6f}i" if abs(value.imag) > 1e-7 else "")


def small(value: float) -> str:
    """A residual or an error."""
    return f"{value:.1e}" if math.isfinite(value) else "–"


def finite(value: Any) -> bool:
    """Whether something is a finite number."""
    try:
        return math.isfinite(float(value))
    except (TypeError, ValueError, OverflowError):
        return False


def spelt(name: str) -> str:
    """How a parameter is written."""
    return "ω" if name == "omega" else name


def safe(text: str) -> str:
    """A text as HTML."""
    return html.escape(str(text), quote=True)
