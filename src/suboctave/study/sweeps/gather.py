"""The dataset of a sweep from what came of its points, whatever the order in which they came."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from suboctave.interruption import Interruption
from suboctave.store.layout import parameter_column
from suboctave.study.sweeps.plan import Plan
from suboctave.study.sweeps.quantities import MEANINGS
from suboctave.study.sweeps.result import MISSING, OWN, Computed, Sweep


def gathered(
    plan: Plan,
    computed: Mapping[int, Computed],
    lists: Mapping[str, str],
    listed: int,
    attributes: Mapping[str, str],
    interruption: Interruption | None = None,
) -> Sweep:
    """The result of a sweep from what came of its points, whatever their order.

    `lists`: for each analysis the dimension along which its lists lie.
    """
    import xarray

    order = range(len(plan))
    rows = {number: computed[number].row for number in order if number in computed}
    sizes: dict[str, int] = {}
    for row in rows.values():
        for name, value in row.items():
            sizes[name] = max(sizes.get(name, 0), listed if isinstance(value, list) else 0)
    dims, shape, coordinates = _space(plan)
    variables: dict[str, Any] = {}
    for name, size in sizes.items():
        values = np.full((len(plan), size) if size else len(plan), np.nan)
        for number, row in rows.items():
            value = row.get(name, np.nan)
            if isinstance(value, list):
                values[number, : len(value)] = value
            else:
                values[number] = value
        owner = next((step for step in sorted(lists, key=len, reverse=True) if name.startswith(f"{step}.")), "")
        more, extent = ((lists.get(owner, "row"),), (size,)) if size else ((), ())
        variables[name] = ((*dims, *more), values.reshape(*shape, *extent), {"long_name": _meaning(name, owner)})
    failures = [computed[number].failure if number in computed else MISSING for number in order]
    seconds = [computed[number].seconds if number in computed else np.nan for number in order]
    variables["failure"] = (dims, np.array(failures, dtype=object).reshape(shape), {"long_name": "what failed"})
    variables["seconds"] = (dims, np.array(seconds).reshape(shape), {"long_name": "computing time of the point"})
    dataset = xarray.Dataset(variables, coordinates, {**attributes, "origin": plan.origin})
    return Sweep(dataset, plan.names, attributes.get("title", ""), interruption)


def _space(plan: Plan) -> tuple[tuple[str, ...], tuple[int, ...], dict[str, Any]]:
    """Dimensions, shape and coordinates of the points."""
    columns = [parameter_column(name, OWN) for name in plan.names]
    if plan.axes is not None:
        return tuple(columns), tuple(map(len, plan.axes)), dict(zip(columns, plan.axes, strict=True))
    coordinates = {column: ("point", plan.points[:, i]) for i, column in enumerate(columns)}
    return ("point",), (len(plan),), coordinates


def _meaning(name: str, owner: str) -> str:
    """What a quantity is, in words."""
    what = name.removeprefix(f"{owner}.")
    kind, _, detail = what.partition(".")
    return MEANINGS.get(what) or (MEANINGS.get(f"KIND.{detail}" if detail else "KIND", "") if kind.isalnum() else "")
