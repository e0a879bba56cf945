"""Results as a notebook shows them: their picture, and below it what they print."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from html import escape
from typing import Any

from suboctave.errors import InputError

#: tables stay tables: no proportional letters, no wrapped lines
_LETTERS = (
    "font-family: ui-monospace, Menlo, Consolas, 'DejaVu Sans Mono', monospace; white-space: pre; overflow-x: auto"
)


class Pictured(ABC):
    """What is drawn by `plot()` and printed by `repr`: a notebook shows both."""

    @abstractmethod
    def plot(self, path: Any = None, **options: Any) -> Any:
        """Its picture, saved where a path is given."""

    def _repr_html_(self) -> str:
        return cell_of(self)


def cell_of(item: Any) -> str:
    """What a notebook shows of an item: its picture, and below it in letters of one width what it prints."""
    from suboctave.pictures.paper import image_of

    words = f'<pre style="{_LETTERS}">{escape(repr(item))}</pre>'
    try:
        picture = base64.b64encode(image_of(item.plot(), "svg")).decode("ascii")
    except InputError:  # a curve without points
        return words
    return f'<img alt="" style="max-width: 44em; width: 100%" src="data:image/svg+xml;base64,{picture}">{words}'
