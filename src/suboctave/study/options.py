"""Options of the verbs as tables of a study file: newton, stepping, harmonics, stability, formulation, seeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from suboctave.analysis import Seeds
from suboctave.bifurcation import Alcorta2019, BorderedSystem, ExtendedSystem, Formulation, formulation_of
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError, suggest
from suboctave.harmonic.selection import AdaptiveHarmonics
from suboctave.stability import Hill, KoopmanHill, Monodromy, StabilityMethod, method_of

__all__ = ["as_formulation", "as_harmonics", "as_newton", "as_seeds", "as_stability", "as_stepping"]

_METHODS: dict[str, Any] = {method.name: method for method in (Monodromy, Hill, KoopmanHill)}
_FORMULATIONS: dict[str, Any] = {one.name: one for one in (BorderedSystem, ExtendedSystem, Alcorta2019)}


def as_newton(table: Mapping[str, Any] | None) -> NewtonOptions | None:
    """The Newton options of a table, None where there is none."""
    return None if table is None else _options(NewtonOptions, table, "newton")


def as_stepping(table: Mapping[str, Any] | None) -> SteppingOptions | None:
    """The stepping options of a table, None where there is none."""
    return None if table is None else _options(SteppingOptions, table, "stepping")


def as_seeds(table: Mapping[str, Any] | None) -> Seeds | None:
    """How finely a search is done, of a table; None where there is none."""
    return None if table is None else _options(Seeds, table, "seeds")


def as_harmonics(given: Any, size: int = 1) -> Any:
    """A whole number, "adaptive", or the options of adaptive harmonics as a table; None stays None."""
    if isinstance(given, Mapping):
        return _options(AdaptiveHarmonics, given, "harmonics")
    if given is None or given == "adaptive":
        return given
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise InputError(f'give a whole number of at least 1, "adaptive", or a table of its options, not {given!r}')
    return given


def as_stability(given: Any) -> StabilityMethod | None:
    """A method by name, or `{method = name, option = value}`; None stays None."""
    if given is None:
        return None
    if isinstance(given, Mapping):
        table = dict(given)
        name = table.pop("method", None)
        if name not in _METHODS:
            raise InputError(f"method {name!r} is none that takes options{suggest(str(name), _METHODS)}")
        made: StabilityMethod = _options(_METHODS[name], table, name)
        return made
    if not isinstance(given, str):
        raise InputError(f"give the name of a method, or a table with method = ..., not {given!r}")
    return method_of(given)


def as_formulation(given: Any) -> Formulation | None:
    """A formulation by name, or `{name = name, option = value}`; None stays None."""
    if given is None:
        return None
    if isinstance(given, Mapping):
        table = dict(given)
        name = table.pop("name", None)
        if name not in _FORMULATIONS:
            raise InputError(f"unknown formulation {name!r}{suggest(str(name), _FORMULATIONS)}")
        made: Formulation = _options(_FORMULATIONS[name], table, name)
        return made
    if not isinstance(given, str):
        raise InputError(f"give the name of a formulation, or a table with name = ..., not {given!r}")
    return formulation_of(given)


def _options(kind: Any, table: Mapping[str, Any], what: str) -> Any:
    known = {f.name: f for f in fields(kind)}
    for name, value in table.items():
        if name not in known:
            raise InputError(f"{what} has no option {name!r}{suggest(name, known)}")
        default = known[name].default
        wanted: Any = (bool,) if isinstance(default, bool) else (str,) if isinstance(default, str) else (int, float)
        if not isinstance(value, wanted) or (isinstance(value, bool) and wanted != (bool,)):
            raise InputError(f"{what}, {name}: {value!r} will not do; the default is {default!r}")
        if isinstance(default, int) and not isinstance(default, bool) and not isinstance(value, int):
            raise InputError(f"{what}, {name}: a whole number is needed, not {value!r}")
    return kind(**table)
