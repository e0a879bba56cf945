"""Amplitudes that a rig measured, read from comma-separated text, in the units of a model."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from suboctave.arguments import Rule, checked
from suboctave.errors import InputError, is_number, path_of, printable, suggest
from suboctave.model.elements.base import Array

_UNITS = {"rad/s": 1.0, "Hz": 2.0 * math.pi}


Column = Annotated[
    Array, Rule("a list of finite numbers", lambda column: column.ndim == 1 and bool(np.isfinite(column).all()))
]


@checked(result=True)
@dataclass(frozen=True, eq=False)
class Measured:
    """Measured amplitudes of the fundamental, in the model's units: `omega` (N,) and `amplitude` (N,)."""

    omega: Column
    amplitude: Column
    label: str

    def __len__(self) -> int:
        return len(self.omega)

    def __repr__(self) -> str:
        return f"Measured({self.label!r}, {len(self)} points, omega from {self.omega.min():g} to {self.omega.max():g})"


@checked
def read_measured(
    path: str | Path,
    *,
    frequency: str,
    amplitude: str,
    frequency_unit: str,
    scale: float = 1.0,
    omega_scale: float = 1.0,
    label: str | None = None,
) -> Measured:
    """Read two columns of a comma-separated file (.csv) with a header.

    Parameters
    ----------
    frequency, amplitude
        Names of the columns.
    frequency_unit
        "Hz" or "rad/s", of the column.
    scale
        What one unit of the column of amplitudes is in the model's unit of length: 1e-3 for millimetres and a model in
        metres.
    omega_scale
        What one rad/s is in the model's: one over the reference frequency for a dimensionless model.
    label
        What legends call it; default the file's name.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing, or an entry is no finite number; the line is told.
    """
    if frequency_unit not in _UNITS:
        raise InputError(f"frequency_unit={frequency_unit!r}: Hz or rad/s{suggest(str(frequency_unit), _UNITS)}")
    for name, value in (("scale", scale), ("omega_scale", omega_scale)):
        if not (is_number(value) and value > 0.0):
            raise InputError(f"{name} must be a positive number, not {value!r}")
    place = path_of(path)
    try:
        with place.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            header = [name.strip() for name in next(rows, [])]
            columns = [(_column(place, header, name), name) for name in (frequency, amplitude)]
            values = [
                [_number(f"{place}, line {rows.line_num}", row, at, name, name == frequency) for at, name in columns]
                for row in rows
                if any(entry.strip() for entry in row)
            ]
    except OSError as error:
        raise InputError(f"{place} cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{place} is no comma-separated text: {error}") from None
    if not values:
        raise InputError(f"{place} has no rows beneath its header")
    table = np.array(values)
    return Measured(
        table[:, 0] * (_UNITS[frequency_unit] * omega_scale),
        table[:, 1] * scale,
        printable(place.stem) if label is None else label,
    )


def _column(place: Path, header: list[str], name: str) -> int:
    if name not in header:
        raise InputError(f"{place}, line 1: there is no column {name!r}{suggest(name, header)}")
    if header.count(name) > 1:
        raise InputError(f"{place}, line 1: two columns are called {name!r}")
    return header.index(name)


def _number(where: str, row: list[str], at: int, name: str, positive: bool) -> float:
    if at >= len(row):
        raise InputError(f"{where}: {len(row)} entries, so that {name!r} is missing")
    try:
        value = float(row[at])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {name}={row[at].strip()!r} is no finite number")
    if positive and not value > 0.0:
        raise InputError(f"{where}: {name}={value:g} is no frequency")
    return value
