"""Names of columns: what a parameter is called in a table that has a column of its own by its name.

A user may call a parameter "amplitude". In a table or dataset that has a column "amplitude" of its own it is called
"parameter.amplitude", which no parameter can be named; elsewhere by its own name.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas


def parameter_column(name: str, taken: Collection[str]) -> str:
    """The column of a parameter in a table whose other columns have the names `taken`."""
    return f"parameter.{name}" if name in taken else name


def led_by(frame: pandas.DataFrame, leading: Mapping[str, Any]) -> pandas.DataFrame:
    """The table of one of several curves behind columns that say which it is; the others there are parameters'."""
    frame = frame.rename(columns={name: parameter_column(name, leading) for name in frame.columns})
    for place, (name, value) in enumerate(leading.items()):
        frame.insert(place, name, value)
    return frame
