"""What every result of time integration can do, as branches can: be saved and loaded, and be written as a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.interruption import Interruption
from suboctave.model.system import System
from suboctave.store.registry import Stored
from suboctave.store.table import Table, write_csv
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["TimeResult"]


class TimeResult(Stored, ABC):
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

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The table as comma-separated text (.csv)."""
        return write_csv(self.to_dataframe(), path, overwrite)

    def to_table(self) -> Table:
        """The table with the result beside it (`.result`)."""
        import numpy as np

        frame = self.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame.columns}
        return Table(columns, repr(self).splitlines()[0], self)

    def _dataset(
        self,
        system: System,
        contents: str,
        variables: Mapping[str, Any],
        coordinates: Mapping[str, Any],
        **attributes: Any,
    ) -> xarray.Dataset:
        """A dataset of these contents, with the parameters' values and what produced it."""
        import numpy as np
        import xarray

        values = getattr(self, "parameters", system.parameters)
        parameters = (("parameter",), np.array(list(values.values()), dtype=float))
        return xarray.Dataset(
            {"parameters": parameters, **variables},
            coords={**coordinates, "parameter": list(values)},
            attrs={"contents": contents, **attributes, "system": system.name, "suboctave": __version__},
        )
