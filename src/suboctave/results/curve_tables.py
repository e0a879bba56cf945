"""What a branch and a diagram of branches have in common: tables of their points and of their bifurcations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from suboctave.errors import InputError, suggest
from suboctave.store.registry import Stored
from suboctave.store.table import write_csv

if TYPE_CHECKING:
    import pandas


class CurveTables(Stored, ABC):
    """One curve or several, as tables and as their files."""

    @abstractmethod
    def to_dataframe(self, readings: Iterable[str] | bool = False) -> pandas.DataFrame:
        """One row per point."""

    @abstractmethod
    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation."""

    def to_csv(self, path: str | Path, what: str = "points", overwrite: bool = False) -> Path:
        """The points, or the "bifurcations", as comma-separated text (.csv)."""
        frames = {"points": self.to_dataframe, "bifurcations": self.bifurcations_frame}
        if what not in frames:
            raise InputError(f"to_csv writes points or bifurcations, not {what!r}{suggest(str(what), frames)}")
        return write_csv(frames[what](), path, overwrite)
