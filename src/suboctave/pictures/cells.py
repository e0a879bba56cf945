"""Results as a notebook shows them: their picture, and below it what they print."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from html import escape
from typing import Any

from suboctave.errors import InputError


class Pictured(ABC):
    """What is drawn by `plot()` and printed by `repr`: a notebook shows both."""

    @abstractmethod
    def plot(self, path: Any = None, **options: Any) -> Any:
        """Its picture, saved where a path is given."""

    def _repr_html_(self) -> str:
        from suboctave.pictures.paper import image_of

        words = f"<pre>{escape(repr(self))}</pre>"
        try:
            picture = base64.b64encode(image_of(self.plot(), "svg")).decode("ascii")
        except InputError:  # a curve without points
            return words
        return f'<img alt="" style="max-width: 44em; width: 100%" src="data:image/svg+xml;base64,{picture}">{words}'
