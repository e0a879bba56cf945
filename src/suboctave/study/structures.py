"""The structure of a study file, and degrees of freedom by their names in its elements and loads.

[system]
structure = "plate.npz"
structure = { file = "plate.mat", mass = "MGG", fixed = ["node 1", "2 z"], damping = { rayleigh = [0.1, "beta"] } }
structure = { mass = "M.mtx", stiffness = "K.mtx", dofs = "labels.txt" }
structure = { source = "plate", length = 1.0, width = 0.6, thickness = 0.01, ..., elements = [20, 12] }
elements = [{ type = "ElasticStop", dof = ["1042 z", "77 z"], stiffness = 1e5, gap = 0.1 }]
loads = [{ type = "HarmonicLoad", direction = { "1042 z" = 1.0, "77 z" = -0.5 }, amplitude = 2.0 }]
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from suboctave.errors import InputError, located, shortened, suggest
from suboctave.model.expressions.coefficients import Coefficient, named_coefficient
from suboctave.structures.damping import ModalDamping, Rayleigh
from suboctave.structures.files import read_structure
from suboctave.structures.sources import beam, plate
from suboctave.structures.structure import Structure

#: what makes a structure without any file
SOURCES: dict[str, Callable[..., Structure]] = {"beam": beam, "plate": plate}
_KEYS = ("file", "mass", "stiffness", "damping", "structural", "dofs", "fixed")
_DAMPINGS = ("rayleigh", "ratios", "modal")
_LOSSES = "a table { loss_factor = number or expression }"


def given_structure(value: Any, folder: Path) -> Structure:
    """What a study file says of a structure: a file, or a table with the keys above; relative to `folder`.

    `{ source = "beam" }` or "plate", with the arguments of these functions, needs no file.

    `damping` is the name of a matrix, a file, or one of the tables `{ rayleigh = [alpha, beta] }`,
    `{ ratios = [[omega1, zeta1], [omega2, zeta2]] }`, `{ modal = ratio or ratios }`, `{ modal = ratio, count = 40 }`;
    `structural` the name of a matrix, a file, or `{ loss_factor = number or expression }`. Raises InputError, with the
    key.
    """
    if isinstance(value, str):
        return read_structure(folder / value)
    if not isinstance(value, Mapping):
        raise InputError(f"a structure is the name of a file, or a table, not {shortened(value)}")
    if "source" in value:
        return _from_source(dict(value))
    for key, item in value.items():
        if key not in _KEYS:
            raise InputError(f"a structure has no key {key!r}{suggest(key, [*_KEYS, 'source'])}", (key,))
        if key in ("file", "mass", "stiffness") and not isinstance(item, str):
            raise InputError(f"{key} is a text, not {shortened(item)}", (key,))
    given = dict(value)
    file, fixed = given.pop("file", None), given.pop("fixed", ())
    if isinstance(given.get("damping"), Mapping):
        with located("damping"):
            given["damping"] = _damping(given["damping"])
    elif not isinstance(given.get("damping", ""), str):
        raise InputError(f"damping is a text or a table, not {shortened(given['damping'])}", ("damping",))
    losses = given.get("structural")
    if isinstance(losses, Mapping):
        given["structural"] = _losses(losses)
    elif not isinstance(losses, str | None):
        raise InputError(f"structural is a text or {_LOSSES}, not {shortened(losses)}", ("structural",))
    for what in ("mass", "stiffness", "damping", "structural") if file is None else ():
        if isinstance(given.get(what), str):
            given[what] = folder / given[what]
    if isinstance(given.get("dofs"), str):
        given["dofs"] = folder / given["dofs"]
    structure = read_structure(None if file is None else folder / file, **given)
    with located("fixed"):
        return structure.fixed(fixed) if fixed else structure


def _from_source(given: dict[str, Any]) -> Structure:
    source, fixed, damping = given.pop("source"), given.pop("fixed", ()), given.pop("damping", None)
    losses = given.pop("structural", None)
    if source not in list(SOURCES):
        raise InputError(f"there is no source {shortened(source)}{suggest(str(source), SOURCES)}", ("source",))
    known = inspect.signature(SOURCES[source]).parameters
    for key in given:
        if key not in known:
            raise InputError(
                f"a {source} has no argument {key!r}{suggest(key, [*known, 'damping', 'structural', 'fixed'])}", (key,)
            )
    if missing := [name for name, one in known.items() if one.default is one.empty and name not in given]:
        raise InputError(f"a {source} needs {', '.join(missing)}")
    structure = SOURCES[source](**given)
    with located("damping"):
        if damping is not None:
            structure = structure.with_damping(_damping(damping))
    if losses is not None:
        structure = replace(structure, structural=_losses(losses))
    with located("fixed"):
        return structure.fixed(fixed) if fixed else structure


def _damping(given: Mapping[str, Any]) -> Rayleigh | ModalDamping:
    if isinstance(given, Mapping) and set(given) == {"modal", "count"}:
        return ModalDamping(given["modal"], given["count"])
    if not isinstance(given, Mapping) or len(given) != 1 or not set(given) <= set(_DAMPINGS):
        known = [*_DAMPINGS, "count"]
        wrong = next((key for key in (given if isinstance(given, Mapping) else ()) if key not in known), "")
        raise InputError(
            f"damping is one of {', '.join(_DAMPINGS)}, modal with count{suggest(wrong, known) if wrong else ''}"
        )
    (kind, value), *_ = given.items()
    if kind == "modal":
        return ModalDamping(value)
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        what = "alpha and beta" if kind == "rayleigh" else "[omega1, zeta1] and [omega2, zeta2]"
        raise InputError(f"{kind} is a list of two, {what}, not {shortened(value)}")
    return Rayleigh(*value) if kind == "rayleigh" else Rayleigh.from_ratios(*value)


def _losses(given: Any) -> Coefficient:
    if not isinstance(given, Mapping) or list(given) != ["loss_factor"]:
        raise InputError(f"structural is {_LOSSES}, not {shortened(given)}", ("structural",))
    return named_coefficient(given["loss_factor"], "structural", "loss_factor")


@dataclass(frozen=True)
class DofNames:
    """Names of degrees of freedom: labels of a structure, or `dof_names` of a system.

    names
        Those of the system, in the order of its matrices.
    structure
        In their place, where there is one.
    """

    names: Sequence[str]
    structure: Structure | None

    def placed(self, item: Any) -> Any:
        """The table of an element or a load, with numbers in the place of names.

        Names stand in `dof`, alone or in a pair, in `perpendicular`, among `inputs`, and as keys of `direction`.
        """
        if not isinstance(item, Mapping):
            return item
        placed = dict(item)
        for key in ("dof", "perpendicular"):
            if key in placed:
                with located(key):
                    placed[key] = self._numbered(placed[key])
        if isinstance(placed.get("inputs"), Mapping):
            with located("inputs"):
                placed["inputs"] = {name: self._numbered(place) for name, place in placed["inputs"].items()}
        if isinstance(placed.get("direction"), Mapping | str):
            with located("direction"):
                placed["direction"] = self._direction(placed["direction"])
        return placed

    def _numbered(self, place: Any) -> Any:
        if isinstance(place, list):
            return [self._numbered(one) for one in place]
        return self._number(place) if isinstance(place, str) else place

    def _number(self, name: str) -> int:
        if self.structure is not None:
            return self.structure.dof(name)
        if name not in self.names:
            hint = suggest(name, self.names) or ": give dof_names, or its number from 0"
            raise InputError(f"there is no DOF {name!r}{hint}")
        return list(self.names).index(name)

    def _direction(self, weights: Mapping[str, Any] | str) -> Any:
        if self.structure is not None:
            return self.structure.direction(weights)
        if isinstance(weights, str):
            raise InputError(f"direction = {weights!r}: without a structure give a number for each DOF")
        vector = [0.0] * len(self.names)
        for name, weight in weights.items():
            vector[self._number(name)] = weight
        return vector
