"""What the files of maps have in common: a head with the map's table and its record, curves' pieces by number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError
from suboctave.floquet import Arbitration, Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.interruption import Interruption
from suboctave.maps.pieces import MonotonePiece
from suboctave.model.system import System, build
from suboctave.results.branch import Branch
from suboctave.results.files.branch import branch_from_dataset, branch_to_dataset
from suboctave.store.arrays import flat
from suboctave.store.columns import parameter_column
from suboctave.store.plain import from_json, to_json
from suboctave.store.systems import system_arrays, written_system

if TYPE_CHECKING:
    import xarray

    from suboctave.harmonic.linear_part import LinearPart
    from suboctave.store.table import Table

__all__ = ["CLASSES", "map_datasets", "map_record", "options_of", "piece_number"]

CLASSES: dict[str, type] = {
    c.__name__: c for c in (NewtonOptions, SteppingOptions, Arbitration, Hill, KoopmanHill, Monodromy, Interruption)
}


def map_datasets(
    system: System, table: Table, record: Mapping[str, Any], branches: Mapping[str, Branch], seconds: float
) -> dict[str, xarray.Dataset]:
    """The head under the name "", with `table`, and `record` as JSON; `branches` under names that the head lists."""
    import xarray

    described, arrays = written_system(system)
    columns = {parameter_column(name, ("record",)): ("row", column) for name, column in table.columns.items()}
    text = to_json({**record, "system": described})
    own: dict[str, Any] = {"record": ((), np.array(text), {"long_name": "what else there is of the map, as JSON"})}
    own |= {name: (tuple(f"{name}_{i}" for i in range(array.ndim)), array) for name, array in arrays.items()}
    attributes: dict[str, Any] = {"title": table.title, "system": system.name, "parts": "\n".join(branches)}
    if seconds == seconds:
        attributes["seconds"] = float(seconds)
    head = xarray.Dataset(dict(flat({**columns, **own})), attrs=attributes)
    return {"": head} | {name: branch_to_dataset(branch) for name, branch in branches.items()}


def map_record(
    groups: Mapping[str, xarray.Dataset], classes: Mapping[str, type], allow_code: bool, linear: LinearPart | None
) -> tuple[dict[str, Any], System, dict[str, Any], float]:
    """The record, the system, the branches by name, and the seconds of the datasets that `map_datasets` laid out.

    Raises InputError where some are missing.
    """
    head = groups[""]
    names = str(head.attrs["parts"]).splitlines()
    missing = [name for name in names if name not in groups]
    if missing:
        raise InputError(f"{missing[0]} of the map is missing")
    record = from_json(str(head["record"].item()), {**CLASSES, **classes})
    branches = {name: branch_from_dataset(groups[name], allow_code, linear) for name in names}
    system = build(record["system"], system_arrays(head), allow_code)
    return record, system, branches, float(head.attrs.get("seconds", np.nan))


def piece_number(piece: MonotonePiece, pieces: Sequence[MonotonePiece]) -> int:
    """Which of the pieces of some curves one is."""
    for number, other in enumerate(pieces):
        ends = zip((piece.nodes[0], piece.nodes[-1]), (other.nodes[0], other.nodes[-1]), strict=True)
        if other.curve is piece.curve and all(one.orbit is same.orbit for one, same in ends):
            return number
    raise InputError(f"a stretch over {piece.along} lies on none of the curves: it cannot be written to a file")


def options_of(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the verbs as a file holds them; a stability method of a user's own by its words, as of branches."""
    return {
        name: repr(value) if isinstance(value, StabilityMethod) and type(value).__name__ not in CLASSES else value
        for name, value in options.items()
    }
