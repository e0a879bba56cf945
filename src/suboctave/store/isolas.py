"""How isolas over a design parameter are laid out as a labelled dataset, beside the curves that they were found on.

Dimensions

    isola    the isolas, in the order of the values at which they are born
    edge     places on their edges in the plane of the frequency and the design parameter, isola after isola
    closed   the closed branches that were followed

Variables on `isola`: `period` (load periods), `from` and `to` (the range of the parameter in which it is detached),
`born`, `born_omega` and `merges`, `merges_omega` (nan where there is no such end), `at_from` and `at_to` (what happens
at the two ends of the range, in words), `notes`. On `edge`: `edge_isola`, its number, `edge_value`, ascending, and
between which frequencies the closed branch lies there, `edge_low` and `edge_high`. On `closed`: `closed_isola` and
`closed_at`, the value of the parameter.

Attributes: `isolas` (the design parameter), `bounds_low`, `bounds_high`, `omega_low`, `omega_high` (what was asked),
`said` (the result in one sentence), `notes` (one a line), `system`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.store.layout import LAYOUT
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


#: variables on `isola`: name, kind, meaning
ISOLA_COLUMNS: tuple[tuple[str, Any, str], ...] = (
    ("period", int, "load periods in one period of its motions"),
    ("from", float, "least value of the parameter at which it is detached"),
    ("to", float, "largest value of the parameter at which it is detached"),
    ("born", float, "value at which the closed branch shrinks to a point"),
    ("born_omega", float, "frequency there"),
    ("merges", float, "value at which it joins another branch"),
    ("merges_omega", float, "frequency there"),
    ("at_from", object, "what happens at the lower end of its range"),
    ("at_to", object, "what happens at the upper end of its range"),
    ("notes", object, "what could not be settled of it, one a line"),
)
_EDGES = ("edge_value", "edge_low", "edge_high")


def isolas_dataset(
    rows: Sequence[Mapping[str, Any]],
    edges: Sequence[np.ndarray],
    closed: Sequence[tuple[int, float]],
    attributes: Mapping[str, str | int | float],
) -> xarray.Dataset:
    """Isolas as a labelled dataset; the layout is described at the top of this module.

    `rows`: for each isola what `ISOLA_COLUMNS` names; `edges`: for each a table (places, 3) of value, lowest and
    highest frequency; `closed`: number and value of each closed branch.
    """
    import xarray

    variables: dict[str, Any] = {
        name: ("isola", np.array([row[name] for row in rows], dtype=kind), {"long_name": meaning})
        for name, kind, meaning in ISOLA_COLUMNS
    }
    table = np.concatenate([np.empty((0, 3)), *edges])
    variables["edge_isola"] = ("edge", np.repeat(np.arange(len(edges)), [len(part) for part in edges]).astype(int))
    variables |= {name: ("edge", table[:, i]) for i, name in enumerate(_EDGES)}
    variables["closed_isola"] = ("closed", np.array([number for number, _ in closed], dtype=int))
    variables["closed_at"] = ("closed", np.array([value for _, value in closed], dtype=float))
    return xarray.Dataset(variables, attrs={"layout": LAYOUT, "suboctave": __version__, **attributes})
