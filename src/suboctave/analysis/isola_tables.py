"""Isolas as tables and datasets: what is printed, written as text, and drawn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.junction import period_name
from suboctave.analysis.readings import shared
from suboctave.errors import InputError, suggest
from suboctave.store.columns import led_by
from suboctave.store.isolas import isolas_dataset

if TYPE_CHECKING:
    import pandas
    import xarray

    from suboctave.analysis.isola import Isola
    from suboctave.analysis.isolas_found import Isolas

__all__ = ["edges_of", "isola_datasets", "isola_row", "isolas_csv", "isolas_datasets", "isolas_frame"]

_NAN = float("nan")


def edges_of(isola: Isola) -> np.ndarray:
    """Between which frequencies the closed branch lies: (places, 3), value of the parameter, lowest, highest omega.

    Those of its limit points, straight lines between the points of their curves.
    """
    low, high = isola.range
    inside = [leg.values[(leg.values > low) & (leg.values < high)] for leg in isola.legs]
    rows = []
    for value in np.unique(np.concatenate([[low, high], *inside])):
        met = []
        for leg in isola.legs:
            if leg.contains(value):
                order = np.argsort(leg.values)
                met.append(float(np.interp(value, leg.values[order], leg.omega[order])))
        if met:
            rows.append((float(value), min(met), max(met)))
    return np.array(rows).reshape(-1, 3)


def isola_row(isola: Isola) -> dict[str, Any]:
    """An isola as a row of `store.isolas`."""
    row: dict[str, Any] = {"period": isola.nu, "from": isola.range[0], "to": isola.range[1]}
    for word, end in (("born", isola.born), ("merges", isola.merges)):
        row[word] = _NAN if end is None else float(end)
        row[f"{word}_omega"] = _NAN if end is None else end.omega
    return row | {"at_from": isola.reasons[0], "at_to": isola.reasons[1], "notes": "\n".join(isola.notes)}


def isolas_frame(isolas: Isolas) -> pandas.DataFrame:
    """One row for each isola: period, range, where it is born and merges, and the frequencies there."""
    import pandas

    rows = []
    for isola in isolas:
        row = isola_row(isola)
        told: dict[str, Any] = {"period": period_name(isola.nu), "from": row["from"], "to": row["to"]}
        for word in ("born", "merges"):
            told |= {f"{word} {isolas.parameter}": row[word], f"{word} omega": row[f"{word}_omega"]}
        rows.append(told)
    return pandas.DataFrame(rows)


def isolas_csv(isolas: Isolas, path: str | Path, what: str, overwrite: bool) -> Path:
    """See `Isolas.to_csv`."""
    from suboctave.analysis.results import write_csv

    makers: dict[str, Any] = {
        "isolas": lambda: _complete_frame(isolas),
        "points": lambda: _joined([curve.to_dataframe() for curve in _curves(isolas)], isolas),
        "bifurcations": lambda: _joined([curve.bifurcations_frame() for curve in _curves(isolas)], isolas),
    }
    if what not in makers:
        raise InputError(f"to_csv writes isolas, points or bifurcations, not {what!r}{suggest(str(what), makers)}")
    return write_csv(makers[what](), path, overwrite)


def _complete_frame(isolas: Isolas) -> pandas.DataFrame:
    """The table with what happens at the ends, and the notes."""
    frame = isolas_frame(isolas)
    for name in ("at_from", "at_to", "notes"):
        frame[name] = [isola_row(isola)[name] for isola in isolas]
    return frame


def _curves(isolas: Isolas) -> list[Any]:
    return [*isolas.limit_points, *isolas.doublings]


def _joined(frames: Sequence[pandas.DataFrame], isolas: Isolas) -> pandas.DataFrame:
    import pandas

    full = [
        led_by(frame, {"curve": number, "of": curve.kind, "nu": curve.nu})
        for number, (curve, frame) in enumerate(zip(_curves(isolas), frames, strict=True))
        if len(frame)
    ]
    return pandas.concat(full, ignore_index=True) if full else pandas.DataFrame({"curve": []})


def isolas_datasets(isolas: Isolas, readings: Iterable[str] | bool = False) -> dict[str, xarray.Dataset]:
    """See `Isolas.to_xarray`."""
    found = {"isolas": head_dataset(isolas)}
    words = {"LP": "limit points", "PD": "period doublings"}
    named: dict[str, tuple[Any, dict[str, Any]]] = {}
    for number, curve in enumerate(_curves(isolas)):
        named[f"{number}: {words[curve.kind]} of {period_name(curve.nu)}"] = (curve, {})
    for number, isola in enumerate(isolas):
        which = f"isola {number}" if len(isolas) > 1 else "isola"
        for value, branch in isola.known.items():
            named[f"{which} at {isolas.parameter} = {value:.6g}"] = (branch, {"isola": number, "at": value})
    chosen = shared(readings, [branch.nu for branch, _ in named.values()])
    for (name, (branch, attributes)), names in zip(named.items(), chosen, strict=True):
        found[name] = branch.to_xarray(names).assign_attrs(attributes)
    return found


def head_dataset(isolas: Isolas) -> xarray.Dataset:
    """The isolas themselves as `store.isolas` lays them out."""
    closed = [(number, value) for number, isola in enumerate(isolas) for value in isola.known]
    return isolas_dataset(
        [isola_row(isola) for isola in isolas],
        [edges_of(isola) for isola in isolas],
        closed,
        {
            "isolas": isolas.parameter,
            "bounds_low": isolas.bounds[0],
            "bounds_high": isolas.bounds[1],
            "omega_low": isolas.omega[0],
            "omega_high": isolas.omega[1],
            "said": isolas.said,
            "notes": "\n".join(isolas.notes),
            "system": isolas.system.name,
        },
    )


def isola_datasets(isola: Isola, values: Sequence[float], readings: Iterable[str] | bool = False) -> list[Any]:
    """What a picture of one isola is drawn from: the isola, its limit points, its closed branches at some values."""
    low, high = isola.range
    attributes: dict[str, str | int | float] = {"isolas": isola.parameter, "bounds_low": low, "bounds_high": high}
    attributes |= {"omega_low": isola.omega[0], "omega_high": isola.omega[1]}
    closed = [(0, value) for value in values]
    head = isolas_dataset([isola_row(isola)], [edges_of(isola)], closed, attributes)
    curves = [isola.limit_points, *isola.further, *(isola.at(value) for value in values)]
    attributes_of: list[dict[str, Any]] = [{} for _ in range(len(curves) - len(values))]
    attributes_of += [{"isola": 0, "at": value} for value in values]
    chosen = shared(readings, [curve.nu for curve in curves])
    datasets = (curve.to_xarray(names) for curve, names in zip(curves, chosen, strict=True))
    return [head, *(data.assign_attrs(more) for data, more in zip(datasets, attributes_of, strict=True))]
