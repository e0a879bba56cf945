"""What every result of time integration can do, as branches can: be saved and loaded, and be written as a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from suboctave.model.system import System
from suboctave.store.arrays import flat
from suboctave.store.registry import Stored
from suboctave.store.table import Table, write_csv
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Layout", "TimeResult"]


@dataclass(frozen=True)
class Layout:
    """What of a result is written as it is: arrays with their axes, and attributes with their kinds.

    An array on the one axis of its own name is the coordinate there. `names`: variables that are not called as here.
    """

    contents: str
    arrays: Mapping[str, tuple[str, ...]]
    attributes: Mapping[str, type]
    names: Mapping[str, str] = field(default_factory=dict)


class TimeResult(Stored, ABC):
    """A result of time integration: trajectories, sections, diagrams, exponents, basins, tests, verifications."""

    layout: ClassVar[Layout]
    system: System

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
        variables: Mapping[str, Any] | None = None,
        coordinates: Mapping[str, Any] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> xarray.Dataset:
        """A dataset of everything in the layout, of what is given besides, and of what produced it."""
        import numpy as np
        import xarray

        layout, system = self.layout, self.system
        values = getattr(self, "parameters", system.parameters)
        arrays = {layout.names.get(one, one): (axes, getattr(self, one)) for one, axes in layout.arrays.items()}
        arrays |= {"parameters": (("parameter",), np.array(list(values.values()), dtype=float)), **(variables or {})}
        own = {layout.names.get(one, one): getattr(self, one) for one in layout.attributes}
        plain = {name: int(value) if isinstance(value, bool) else value for name, value in own.items()}
        produced = {"dofs": system.n, "system": system.name, "suboctave": __version__}
        dataset = xarray.Dataset(
            dict(flat(arrays)),
            coords={**(coordinates or {}), "parameter": list(values)},
            attrs={"contents": layout.contents, **plain, **(attributes or {}), **produced},
        )
        if "dof" in dataset.dims:
            dataset = dataset.assign_coords(dof=list(system.dof_names or range(system.n)))
        return dataset
