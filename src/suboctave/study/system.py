"""The [system] of a study file: read, and every mistake in it told with its line."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from suboctave.errors import InputError, suggest
from suboctave.model import library
from suboctave.model.description import build_part
from suboctave.model.mass_check import check_mass
from suboctave.model.matrix import matrix_coefficient
from suboctave.model.system import System
from suboctave.study.lines import Path as Key
from suboctave.study.matrices import given_matrix
from suboctave.study.mistakes import Mistakes

__all__ = ["SystemSection", "make_system", "published"]

MATRICES = ("mass", "damping", "stiffness")


class SystemSection(BaseModel):
    """What vibrates: matrices with elements and loads, equations as text, or a published system."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    name: str = ""
    library: str | None = None
    arguments: dict[str, float] = Field(default_factory=dict)
    equations: list[str] | None = None
    mass: Any = None
    damping: Any = None
    stiffness: Any = None
    elements: list[dict[str, Any]] = Field(default_factory=list)
    loads: list[dict[str, Any]] = Field(default_factory=list)
    parameters: dict[str, float] = Field(default_factory=dict)
    dof_names: list[str] = Field(default_factory=list)


def published() -> dict[str, Any]:
    """The systems of `so.library`, by name."""
    functions = {name: getattr(library, name) for name in library.__all__}
    return {n: f for n, f in functions.items() if inspect.signature(f).return_annotation in ("System", System)}


def make_system(section: SystemSection, folder: Path, mistakes: Mistakes, allow_code: bool) -> System | None:
    """The system, or None where something is wrong with it."""
    before = len(mistakes)
    given = {what for what in (*MATRICES, "equations", "library") if getattr(section, what) is not None}
    ways = [bool(given & set(MATRICES)), "equations" in given, "library" in given]
    if sum(ways) != 1:
        how = "mass, damping and stiffness; or equations; or library"
        mistakes.add(("system",), f"give one of these: {how}" + (", not several of them" if sum(ways) > 1 else ""))
        return None
    if section.arguments and section.library is None:
        mistakes.add(("system", "arguments"), "belong to library")
    if section.library is not None:
        return _published(section, mistakes)
    parts = {
        family: list(_parts(getattr(section, f"{family}s"), family, mistakes, allow_code))
        for family in ("element", "load")
    }
    if section.equations is not None:
        return _from_equations(section, parts, mistakes) if len(mistakes) == before else None
    matrices = _matrices(section, folder, mistakes)
    _check_names(section, matrices, parts, mistakes)
    _check_mass(section, matrices, mistakes)
    if len(mistakes) > before:
        return None
    elements, loads = ([item for _, item in parts[family]] for family in ("element", "load"))
    try:
        return System(
            *(matrices[what] for what in MATRICES), elements, loads, section.parameters, section.name, section.dof_names
        )  # type: ignore[call-arg]
    except InputError as error:
        mistakes.add(_place_of(str(error), section, parts), str(error))
        return None


def _published(section: SystemSection, mistakes: Mistakes) -> System | None:
    functions = published()
    if section.library not in functions:
        mistakes.add(("system", "library"), f"no system {section.library!r}{suggest(section.library or '', functions)}")
        return None
    for what in ("elements", "loads"):
        if getattr(section, what):
            mistakes.add(("system", what), "a published system comes with its own; write the system out to add to it")
    function = functions[section.library]
    known = list(inspect.signature(function).parameters)
    wrong = [name for name in section.arguments if name not in known]
    for name in wrong:
        mistakes.add(("system", "arguments", name), f"{section.library} has no such argument{suggest(name, known)}")
    missing = [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.default is parameter.empty and name not in section.arguments
    ]
    if missing:
        mistakes.add(("system", "arguments"), f"{section.library} needs {', '.join(missing)}")
    if wrong or missing:
        return None
    try:
        system = function(**section.arguments)
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
        mistakes.add(_place_of(str(error), section, parts), str(error))
        return None


def _matrices(section: SystemSection, folder: Path, mistakes: Mistakes) -> dict[str, Any]:
    found: dict[str, Any] = {}
    size: int | None = None
    for what in MATRICES:
        value = getattr(section, what)
        if value is None:
            mistakes.add(("system", what), "is missing")
            continue
        try:
            found[what] = matrix_coefficient(given_matrix(value, folder), size, what)
        except (InputError, TypeError, ValueError) as error:
            mistakes.add(("system", what), str(error))
            continue
        if what == "mass":
            size = found[what].n
    return found


def _parts(items: list[dict[str, Any]], family: str, mistakes: Mistakes, allow_code: bool) -> Iterator[tuple[Key, Any]]:
    for index, item in enumerate(items):
        place: Key = ("system", f"{family}s", index)
        try:
            yield place, build_part(item, family, allow_code=allow_code)
        except InputError as error:
            text = str(error)
            named = next((name for name in item if f"argument {name!r}" in text or f", {name}: " in text), None)
            if named is None and ("no element" in text or "no load" in text):
                named = "type" if "type" in item else None
            mistakes.add(place if named is None else (*place, named), text)


def _check_names(
    section: SystemSection, matrices: dict[str, Any], parts: dict[str, list[tuple[Key, Any]]], mistakes: Mistakes
) -> None:
    """Names in expressions that are no parameters, all of them (a System stops at the first), and DOFs."""
    known = section.parameters
    used: set[str] = set()

    def look(place: Key, what: str, source: Any, in_load: bool) -> None:
        used.update(source.names)
        for name in sorted(source.names):
            if name == "omega" and not in_load:
                mistakes.add(place, f"{what}: 'omega' occurs in {source}; only loads may depend on the frequency")
            elif name != "omega" and name not in known:
                hint = suggest(name, known) or "; no parameters are given"
                mistakes.add(place, f"{what}: unknown parameter {name!r} in {source}{hint}")

    for what, matrix in matrices.items():
        for source in matrix.coefficients:
            look(("system", what), what, source, False)
    for place, element in parts["element"]:
        for what, source in zip(element.coefficient_names, element.coefficients, strict=True):
            look(place, f"{element.label}, {what}", source, False)
    for place, load in parts["load"]:
        for what, source in load.coefficients:
            look(place, f"{load.label}, {what}", source, True)
    if "mass" in matrices:
        for place, part in (*parts["element"], *parts["load"]):
            try:
                if hasattr(part, "direction"):
                    part.direction(matrices["mass"].n)
            except InputError as error:
                mistakes.add((*place, "dof"), str(error))
    if not mistakes:
        for name in known:
            if name not in used:
                mistakes.add(("system", "parameters", name), "is not used in any expression; remove or use it")


def _check_mass(section: SystemSection, matrices: dict[str, Any], mistakes: Mistakes) -> None:
    """Refuse a mass that is none, as far as its parameters are known."""
    mass = matrices.get("mass")
    if mass is None or not mass.names <= section.parameters.keys():
        return
    try:
        check_mass(mass.sparse_value(section.parameters) if mass.sparse else mass.value(section.parameters))
    except InputError as error:
        mistakes.add(("system", "mass"), str(error))


def _place_of(text: str, section: SystemSection, parts: dict[str, list[tuple[Key, Any]]]) -> Key:
    """The key that a message about a whole system is about, as far as its words tell."""
    for items in parts.values():
        for place, part in items:
            if text.startswith(part.label):
                return place
    for what in (*MATRICES, "parameters"):
        if text.startswith(what):
            return ("system", what)
    for name in section.parameters:
        if f"{name!r}" in text:
            return ("system", "parameters", name)
    if section.equations is not None:
        for index, equation in enumerate(section.equations):
            if equation in text:
                return ("system", "equations", index)
        return ("system", "equations")
    return ("system", "mass") if "mass" in text else ("system",)
