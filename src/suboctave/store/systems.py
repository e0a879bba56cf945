"""Systems in files: as plain data, their large arrays as variables of the dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.model.system import System, describe

if TYPE_CHECKING:
    import xarray


class Prefixed(dict[str, np.ndarray]):
    """Gives the arrays of systems names of their own among the variables of a file."""

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self.arrays = arrays

    def __len__(self) -> int:
        return len(self.arrays)

    def __setitem__(self, key: str, value: np.ndarray) -> None:
        self.arrays[f"system_{key}"] = value


def written_system(system: System) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """A system as plain data, and its large arrays as variables of a file."""
    arrays: dict[str, np.ndarray] = {}
    return describe(system, Prefixed(arrays)), arrays


def system_arrays(dataset: xarray.Dataset) -> dict[str, np.ndarray]:
    """The large arrays of systems among the variables of a file, by the names that descriptions have for them."""
    return {
        str(name)[len("system_") :]: np.asarray(variable.values)
        for name, variable in dataset.variables.items()
        if str(name).startswith("system_array_")
    }
