"""Numbers and texts in named columns: what analyses give that are no curves; and their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.atomic import free_place, replace_file
from suboctave.errors import InputError, suggest
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.store.layout import with_units
from suboctave.store.plain import array_of, flat
from suboctave.store.registry import Codec, Datasets, Stored, from_datasets, parts_of, register, to_datasets

if TYPE_CHECKING:
    import pandas
    import xarray


#: the part of a table's file that holds what the table was taken from
_WHOLE = "result"


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers and texts in named columns, (rows,) each: what analyses give that are no curves. `title` says of what.

    `result`: what the table was taken from (basins, a stepped-sine test, ...), saved with it; None if that is all.
    `stopped`: what stopped the analysis before its end, where there is no `result` that says so.
    """

    columns: Mapping[str, np.ndarray]
    title: str = ""
    result: Stored | None = None
    stopped: Interruption | None = None

    @property
    def interruption(self) -> Interruption | None:
        """What stopped the analysis before its end, Ctrl-C or a time limit; None if nothing did."""
        return self.stopped if self.result is None else self.result.interruption

    @classmethod
    def of_rows(cls, names: Sequence[str], rows: Sequence[Sequence[Any]], title: str) -> Table:
        """Columns of these names from rows; empty ones without any."""
        columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else [np.zeros(0)] * len(names)
        return cls(dict(zip(names, columns, strict=True)), title)

    def __len__(self) -> int:
        return max((len(column) for column in self.columns.values()), default=0)

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise InputError(f"the table has no column {name!r}{suggest(name, self.columns)}")
        return self.columns[name]

    def to_xarray(self) -> xarray.Dataset:
        """The columns as variables on the dimension `row`."""
        import xarray

        return xarray.Dataset(
            {name: ("row", column) for name, column in self.columns.items()}, attrs={"title": self.title}
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per row."""
        import pandas as pd

        return pd.DataFrame(dict(self.columns))

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The table as comma-separated text, with the units that the system of its result declares in the heads; a file
        that exists is left alone unless `overwrite`.
        """
        system, dimensions = (getattr(self.result, name, None) for name in ("system", "dimensions"))
        return write_csv(with_units(self.to_dataframe(), system, dimensions=dimensions), path, overwrite)

    def __repr__(self) -> str:
        return f"Table: {self.title or 'untitled'}, {len(self)} rows\n{self.to_dataframe().to_string()}"


def write_csv(frame: pandas.DataFrame, path: str | Path, overwrite: bool = False) -> Path:
    """A table as comma-separated text, all digits kept."""
    target = free_place(path, overwrite, (".csv",))
    replace_file(target, lambda place: frame.to_csv(place, index=False, float_format="%.17g"))
    return target


def _written(table: Table) -> dict[str, xarray.Dataset]:
    """The columns, and under `result` the parts of what the table was taken from; the attribute `parts` names them."""
    import xarray

    columns = table.to_xarray()
    stored = flat({name: (variable.dims, variable.values) for name, variable in columns.variables.items()})
    dataset = xarray.Dataset(dict(stored), attrs={**columns.attrs, "columns": "\n".join(table.columns)})
    if table.result is None:
        return {"": dataset}
    whole = to_datasets(table.result)
    parts = {f"{_WHOLE}/{name}" if name else _WHOLE: part for name, part in whole.items()}
    return {"": dataset.assign_attrs(parts="\n".join(parts))} | parts


def _read(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> Table:
    head = groups[""]
    columns = {name: array_of(head, name) for name in str(head.attrs.get("columns", "")).splitlines()}
    result: Any = None
    if "parts" in head.attrs:
        parts = parts_of(groups, str(head.attrs["parts"]).splitlines(), "table")
        whole = {name.removeprefix(_WHOLE).removeprefix("/"): part for name, part in parts.items()}
        result, _ = from_datasets(whole, allow_code, linear)
    return Table(columns, str(head.attrs.get("title", "")), result)


register(Codec("table", Table, _written, _read))
