"""The [system] of a study file: read, and every mistake in it with its line.

Matrices are numbers and expressions inline, or files beside the study: those of structures, and .csv.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from suboctave.errors import InputError, Key, damage, suggest
from suboctave.model import library
from suboctave.model.description import build_part
from suboctave.model.loads import StaticLoad
from suboctave.model.matrices import matrix_coefficient
from suboctave.model.system import System
from suboctave.structures import files as structures
from suboctave.structures.structure import Structure
from suboctave.study.mistakes import Mistakes, Section
from suboctave.study.structures import DofNames, given_structure

MATRICES = ("mass", "damping", "stiffness", "structural")
SUFFIXES = (*structures.ENDINGS, ".csv")


class SystemSection(Section):
    """What vibrates: matrices or a structure with elements and loads, equations as text, or a published system."""

    name: str = ""
    library: str | None = None
    arguments: dict[str, float] = Field(default_factory=dict)
    equations: list[str] | None = None
    structure: Any = None
    mass: Any = None
    damping: Any = None
    stiffness: Any = None
    structural: Any = None
    elements: list[dict[str, Any]] = Field(default_factory=list)
    loads: list[dict[str, Any]] = Field(default_factory=list)
    parameters: dict[str, float] = Field(default_factory=dict)
    dof_names: list[str] = Field(default_factory=list)
    units: str | None = None
    angles: Any = None


def published() -> dict[str, Any]:
    """The systems of `so.library` and the published ones of `so.structures`, by name."""
    from suboctave.structures import published as public

    functions = {name: getattr(room, name) for room in (library, public) for name in room.__all__}
    return {n: f for n, f in functions.items() if inspect.signature(f).return_annotation in ("System", System)}


def make_system(section: SystemSection, folder: Path, mistakes: Mistakes, allow_code: bool) -> System | None:
    """The system, or None where something is wrong with it."""
    system, before = _made(section, folder, mistakes, allow_code), len(mistakes)
    if system is not None and section.angles is not None:
        with mistakes.at("system"):
            system = system.with_angles(section.angles)
    return system if len(mistakes) == before else None


def _made(section: SystemSection, folder: Path, mistakes: Mistakes, allow_code: bool) -> System | None:
    """The system without its angles."""
    before = len(mistakes)
    given = {what for what in (*MATRICES, "structure", "equations", "library") if getattr(section, what) is not None}
    ways = [bool(given & set(MATRICES)), "structure" in given, "equations" in given, "library" in given]
    if sum(ways) != 1:
        how = "mass, damping and stiffness; or structure; or equations; or library"
        mistakes.add(("system",), f"give one of these: {how}" + (", not several of them" if sum(ways) > 1 else ""))
        return None
    if section.arguments and section.library is None:
        mistakes.add(("system", "arguments"), "belong to library")
    if section.library is not None:
        return _published(section, mistakes)
    structure = _structure(section, folder, mistakes)
    if section.structure is not None and structure is None:
        return None
    names = DofNames(section.dof_names, structure)
    parts: dict[str, list[tuple[Key, Any]]] = {"element": [], "load": []}
    for family, built in parts.items():
        for index, item in enumerate(getattr(section, f"{family}s")):
            place = ("system", f"{family}s", index)
            with mistakes.at(*place):
                built.append((place, build_part(names.placed(item), family, allow_code=allow_code)))
    if section.equations is not None:
        return _from_equations(section, parts, mistakes) if len(mistakes) == before else None
    if structure is None:
        matrices = _matrices(section, folder, mistakes)
        dof_names: Sequence[str] = section.dof_names
    else:
        matrices, dof_names = _of_structure(structure, mistakes)
    if "mass" not in matrices:
        return None
    complete = len(mistakes) == before
    placed = {"elements": sorted(parts["element"], key=lambda item: item[1].own_nodes), "loads": parts["load"]}
    elements, loads = ([part for _, part in items] for items in placed.values())
    try:
        # in place of one that is wrong stands zero: what else is wrong is told all the same
        mass, damping, stiffness = (matrices.get(what, 0.0) for what in MATRICES[:3])
        title = section.name or (structure.name if structure is not None else "")
        losses = matrices.get("structural")
        system = System(mass, damping, stiffness, elements, loads, section.parameters, title, dof_names, losses)
    except InputError as error:
        for part in error.parts:
            first, *rest = part.key or ("",)
            if first in placed:
                mistakes.add((*placed[first][int(rest[0])][0], *rest[1:]), str(part))
            elif complete or first != "parameters":  # a part that could not be read may use the parameter
                mistakes.add(("system", *part.key), str(part))
        idle = {str(part.key[1]) for part in error.parts if part.key[:1] == ("parameters",) and len(part.key) == 2}
        if not complete or len(idle) < len(error.parts):
            return None
        # parameters that nothing uses leave a system by which the rest of the file is checked: a load of zero uses them
        with suppress(InputError):
            loads = [*loads, StaticLoad(0, f"0*({' + '.join(sorted(idle))})")]
            return System(mass, damping, stiffness, elements, loads, section.parameters, title, dof_names, losses)
        return None
    return system if complete else None


def _structure(section: SystemSection, folder: Path, mistakes: Mistakes) -> Structure | None:
    """The structure, or None where there is none, or something is wrong with it."""
    if section.structure is None:
        return None
    if section.dof_names:
        what = "the structure names its degrees of freedom: leave it out (dofs in the structure names them)"
        mistakes.add(("system", "dof_names"), what)
    try:
        return given_structure(section.structure, folder)
    except InputError as error:
        for part in error.parts:
            mistakes.add(("system", "structure", *part.key), str(part))
        return None


def _of_structure(structure: Structure, mistakes: Mistakes) -> tuple[dict[str, Any], Sequence[str]]:
    """The matrices of a structure, none where they make no system, and the names of its degrees of freedom."""
    matrices: dict[str, Any] = {}
    with mistakes.at("system", "structure"):
        read = zip(MATRICES, (*structure.matrices(), structure.losses()), strict=True)
        matrices = {what: matrix_coefficient(one, structure.n, what) for what, one in read if one is not None}
    return matrices, () if structure.dofs is None else structure.dofs.names


def _published(section: SystemSection, mistakes: Mistakes) -> System | None:
    functions = published()
    if section.library not in functions:
        mistakes.add(("system", "library"), f"no system {section.library!r}{suggest(section.library or '', functions)}")
        return None
    for what in ("elements", "loads"):
        if getattr(section, what):
            mistakes.add(("system", what), "a published system comes with its own; write the system out to add to it")
    function, given = functions[section.library], section.arguments
    known = inspect.signature(function).parameters
    wrong = [name for name in given if name not in known]
    for name in wrong:
        mistakes.add(("system", "arguments", name), f"{section.library} has no such argument{suggest(name, known)}")
    missing = [name for name, one in known.items() if one.default is one.empty and name not in given]
    if missing:
        mistakes.add(("system", "arguments"), f"{section.library} needs {', '.join(missing)}")
    if wrong or missing:
        return None
    try:
        # whole numbers of a study file are read as floats
        system = function(
            **{name: int(v) if known[name].annotation == "int" and v == int(v) else v for name, v in given.items()}
        )
    except (InputError, TypeError, ZeroDivisionError) as error:
        mistakes.add(("system", "library"), str(error))
        return None
    return overridden(system, section.parameters, ("system", "parameters"), mistakes)


def overridden(system: System, values: dict[str, float], place: Key, mistakes: Mistakes) -> System | None:
    """The system with other values of some parameters, or None where that cannot be."""
    wrong = [name for name in values if name not in system.parameters]
    for name in wrong:
        mistakes.add((*place, name), f"the system has no such parameter{suggest(name, system.parameters)}")
    if wrong:
        return None
    try:
        return system.with_parameters(values) if values else system
    except InputError as error:
        mistakes.add(place, str(error))
        return None


def _from_equations(section: SystemSection, parts: dict[str, Any], mistakes: Mistakes) -> System | None:
    unwanted = [f"{family}s" for family, items in parts.items() if items]
    for what in unwanted:
        mistakes.add(("system", what), "write these forces into the equations")
    if section.dof_names:
        mistakes.add(("system", "dof_names"), "the equations name their degrees of freedom: leave it out")
    if unwanted or section.dof_names:
        return None
    try:
        return System.from_equations(section.equations or (), section.parameters, section.name)
    except InputError as error:
        for part in error.parts:
            mistakes.add(("system", *(part.key or ("equations",))), str(part))
        return None


def _matrices(section: SystemSection, folder: Path, mistakes: Mistakes) -> dict[str, Any]:
    matrices: dict[str, Any] = {}
    size: int | None = None
    for what in MATRICES:
        value = getattr(section, what)
        if value is None:
            if what != "structural":
                mistakes.add(("system", what), "is missing")
            continue
        try:
            matrices[what] = matrix_coefficient(given_matrix(value, folder), size, what)
        except (InputError, TypeError, ValueError) as error:
            mistakes.add(("system", what), str(error))
            continue
        if what == "mass":
            size = matrices[what].n
    return matrices


# ----------------------------------------------------------------------------------------------------------- matrices
def given_matrix(value: Any, folder: Path) -> Any:
    """What a study file says of a matrix, as `System` takes it.

    A number, an expression, nested lists; `{file = "M.npy", key = "M"}` (or the name of a file alone), relative to
    `folder`; `{"expression" = matrix, ...}` for the sum of expression times matrix. Raises InputError.
    """
    if isinstance(value, str) and Path(value).suffix.lower() in SUFFIXES:
        return read_matrix(folder / value, None)
    if isinstance(value, Mapping):
        if "file" in value:
            extra = [name for name in value if name not in ("file", "key")]
            if extra:
                raise InputError(f"a matrix from a file has no key {extra[0]!r}{suggest(extra[0], ['file', 'key'])}")
            if not isinstance(value["file"], str):
                raise InputError(f"file is the name of a file, not {value['file']!r}")
            return read_matrix(folder / value["file"], value.get("key"))
        return {_number_in(factor): given_matrix(matrix, folder) for factor, matrix in value.items()}
    return value


def _number_in(text: str) -> float | str:
    """A text that is a number as that."""
    try:
        return float(text)
    except ValueError:
        return text


def read_matrix(path: Path, key: str | None) -> Any:
    """A matrix from a file, dense or sparse; `key` names it where the file holds several. Raises InputError."""
    if not path.is_file() and path.suffix.lower() not in SUFFIXES:
        raise InputError(f"there is no file {path}; matrices are read from {', '.join(SUFFIXES)} files")
    if not path.is_file():
        beside = [p.name for p in path.parent.glob("*") if p.suffix.lower() in SUFFIXES]
        raise InputError(f"there is no file {path}{suggest(path.name, beside)}")
    try:
        if path.suffix.lower() == ".csv":
            matrix = np.loadtxt(path, delimiter=",", ndmin=2)
        else:
            matrix = structures.read_matrix(path, key)
    except Exception as error:  # whatever a damaged file makes of its reader
        raise InputError(f"cannot read {path}: {error if isinstance(error, InputError) else damage(error)}") from None
    if np.iscomplexobj(matrix):
        raise InputError(f"{path.name}: the matrix holds complex numbers, not real ones")
    return matrix
