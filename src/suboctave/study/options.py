"""Options of the verbs as tables of a study file: newton, stepping, harmonics, stability, formulation, seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any

from pydantic import AfterValidator

from suboctave.analysis.subharmonics import Seeds
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.curves.events.formulation import Alcorta2019, BorderedSystem, ExtendedSystem, formulation_of
from suboctave.errors import InputError, suggest
from suboctave.floquet.methods import Hill, KoopmanHill, Monodromy, method_of
from suboctave.harmonic.truncation import AdaptiveHarmonics

_METHODS: dict[str, Any] = {method.name: method for method in (Monodromy, Hill, KoopmanHill)}
_FORMULATIONS: dict[str, Any] = {one.name: one for one in (BorderedSystem, ExtendedSystem, Alcorta2019)}


def read_by(read: Callable[[Any], Any]) -> AfterValidator:
    """What is given for a field stays as it is; where it cannot be read it is refused at its key."""

    def check(given: Any) -> Any:
        read(given)
        return given

    return AfterValidator(check)


def as_harmonics(given: Any) -> Any:
    """A whole number, "adaptive", or the options of adaptive harmonics as a table; None stays None."""
    if isinstance(given, Mapping):
        return _options(AdaptiveHarmonics, "harmonics", given)
    if given is None or given == "adaptive":
        return given
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise InputError(f'give a whole number of at least 1, "adaptive", or a table of its options, not {given!r}')
    return given


def _named(what: str, key: str, kinds: Mapping[str, Any], by_name: Callable[[str], Any], given: Any) -> Any:
    """An object by its name, or by a table with its name at `key` beside its options; None stays None."""
    if isinstance(given, Mapping):
        table = dict(given)
        name = table.pop(key, None)
        if name not in kinds:
            raise InputError(f"there is no {what} {name!r} that takes options{suggest(str(name), kinds)}")
        return _options(kinds[name], name, table)
    if given is not None and not isinstance(given, str):
        raise InputError(f"give the name of a {what}, or a table with {key} = ..., not {given!r}")
    return None if given is None else by_name(given)


def _options(kind: Any, what: str, table: Mapping[str, Any] | None) -> Any:
    """The options of a table as an object, each of the type of its default; None stays None."""
    if table is None:
        return None
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


#: what the tables of a study file give, by the option: an object for a table, or a name, None where there is none
as_newton = partial(_options, NewtonOptions, "newton")
as_stepping = partial(_options, SteppingOptions, "stepping")
as_seeds = partial(_options, Seeds, "seeds")
as_stability = partial(_named, "method", "method", _METHODS, method_of)
as_formulation = partial(_named, "formulation", "name", _FORMULATIONS, formulation_of)
