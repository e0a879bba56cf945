"""What every result of time integration can do, as branches can: be saved and loaded, and be written as a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING

from suboctave.interruption import Interruption

if TYPE_CHECKING:
    import pandas
    import xarray

    from suboctave.analysis.results import Table

__all__ = ["TimeResult"]


class TimeResult(ABC):
    """A result of time integration: trajectories, sections, diagrams, exponents, basins, tests, verifications.

    `interruption`: what stopped it before its end, Ctrl-C or a time limit (`seconds`); None if nothing did.
    """

    interruption: Interruption | None = None

    @abstractmethod
    def to_xarray(self) -> xarray.Dataset:
        """The result as a labelled dataset, with what produced it."""

    @abstractmethod
    def to_dataframe(self) -> pandas.DataFrame:
        """The result as a table."""

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """All of it as a NetCDF file (.nc), which `load` gives back bit for bit (layout: docs/results.md).

        Raises
        ------
        InputError
            If the file exists and `overwrite` is not given, or cannot be written there.
        """
        from suboctave.analysis.results import save

        return save(self, path, overwrite)

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The table as comma-separated text (.csv)."""
        from suboctave.analysis.results import write_csv

        return write_csv(self.to_dataframe(), path, overwrite)

    def to_table(self) -> Table:
        """The table with the result beside it (`.result`)."""
        import numpy as np

        from suboctave.analysis.results import Table

        frame = self.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame.columns}
        return Table(columns, repr(self).splitlines()[0], self)
