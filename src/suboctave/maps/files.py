"""What the files of maps have in common: a head with a record, branches and curves, pieces of curves by number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

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
from suboctave.store.registry import parts_of
from suboctave.store.systems import system_arrays, written_system

if TYPE_CHECKING:
    import xarray

    from suboctave.harmonic.linear_part import LinearPart
    from suboctave.store.table import Table

__all__ = ["map_datasets", "opened", "options_of", "piece_number", "table_head"]

CLASSES: dict[str, type] = {
    c.__name__: c for c in (NewtonOptions, SteppingOptions, Arbitration, Hill, KoopmanHill, Monodromy, Interruption)
}


def map_datasets(
    item: Any,
    variables: Mapping[Any, Any],
    attributes: Mapping[str, Any],
    record: Mapping[str, Any],
    parts: Mapping[str, Branch],
) -> dict[str, xarray.Dataset]:
    """The head under the name "", `record` as JSON and the item's system with it; `parts` under names that it lists."""
    import xarray

    described, arrays = written_system(item.system)
    text = to_json({**record, "notes": item.notes, "interruption": item.interruption, "system": described})
    own: dict[str, Any] = {"record": ((), np.array(text), {"long_name": "what else there is, as JSON"})}
    own |= {name: (tuple(f"{name}_{i}" for i in range(array.ndim)), array) for name, array in arrays.items()}
    head = xarray.Dataset(dict(flat({**variables, **own})), attrs={**attributes, "parts": "\n".join(parts)})
    if item.seconds == item.seconds:
        head.attrs["seconds"] = float(item.seconds)
    return {"": head} | {name: branch_to_dataset(part) for name, part in parts.items()}


def table_head(item: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and attributes of a head that holds the table of a map."""
    table: Table = item.to_table()
    columns = {parameter_column(name, ("record",)): ("row", column) for name, column in table.columns.items()}
    return columns, {"title": table.title, "system": item.system.name}


class Opened(NamedTuple):
    """What `map_datasets` laid out: the head, the record, the system, the parts by name, and the seconds."""

    head: xarray.Dataset
    record: dict[str, Any]
    system: System
    parts: dict[str, Any]
    seconds: float

    def named(self, beginning: str) -> list[Any]:
        """The parts whose names begin in one way, in order."""
        return [part for name, part in self.parts.items() if name.startswith(beginning)]


def opened(
    groups: Mapping[str, xarray.Dataset],
    words: str,
    allow_code: bool,
    linear: LinearPart | None,
    classes: Mapping[str, type] | None = None,
) -> Opened:
    """Read what `map_datasets` laid out; InputError where parts of `words` are missing."""
    head = groups[""]
    datasets = parts_of(groups, str(head.attrs["parts"]).splitlines(), words)
    record = from_json(str(head["record"].item()), {**CLASSES, **(classes or {})})
    parts = {name: branch_from_dataset(part, allow_code, linear) for name, part in datasets.items()}
    system = build(record["system"], system_arrays(head), allow_code)
    return Opened(head, record, system, parts, float(head.attrs.get("seconds", np.nan)))


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
