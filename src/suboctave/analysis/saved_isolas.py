"""Isolas as datasets that a file or the journal can hold, and back.

A head as `suboctave.store.isolas` lays it out; curves of limit points and of period doublings as `limit_points_0`, ...,
`doublings_0`, ...; the closed branches that are known as `closed_0`, ..., in the order of the head's dimension
`closed`. What else there is of the isolas is JSON in `record`: the legs of curves that their limit points lie on, told
by the curve and by their number along it, their ends, told by the curve and the index of the event, and the options.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.isola import Isola, IsolaEnd
from suboctave.analysis.isola_tables import head_dataset
from suboctave.analysis.isolas_found import Isolas
from suboctave.analysis.limit_curves import Leg, legs_of
from suboctave.analysis.saved import branch_from_dataset, branch_to_dataset, system_arrays, written_system
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.model.description import build
from suboctave.model.system import System
from suboctave.stability import Arbitration, Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.store.arrays import flat
from suboctave.store.plain import from_json, to_json

if TYPE_CHECKING:
    import xarray

__all__ = ["isolas_from_datasets", "isolas_to_datasets"]

_CLASSES = {
    c.__name__: c for c in (NewtonOptions, SteppingOptions, Arbitration, Hill, KoopmanHill, Monodromy, Interruption)
}


def isolas_to_datasets(isolas: Isolas) -> dict[str, xarray.Dataset]:
    """The head under the name "", curves and closed branches under names of their own; the head lists them."""
    legs = [leg for isola in isolas for leg in isola.legs]
    curves = list(dict.fromkeys([*isolas.limit_points, *(leg.curve for leg in legs), *isolas.doublings]))
    own = [curve for curve in curves if curve not in isolas.doublings]
    parts: dict[str, Any] = {f"limit_points_{i}": curve for i, curve in enumerate(own)}
    parts |= {f"doublings_{i}": curve for i, curve in enumerate(isolas.doublings)}
    names = {id(curve): name for name, curve in parts.items()}
    closed = [branch for isola in isolas for branch in isola.known.values()]
    parts |= {f"closed_{i}": branch for i, branch in enumerate(closed)}
    system, arrays = written_system(isolas.system)
    record = {
        "system": system,
        "listed": len(isolas.limit_points),
        "bounds": tuple(isolas.bounds),
        "omega": tuple(isolas.omega),
        "notes": isolas.notes,
        "interruption": isolas.interruption,
        "isolas": [_written(isola, names, curves) for isola in isolas],
    }
    head = head_dataset(isolas)
    variables = {str(name): (v.dims, v.values, v.attrs) for name, v in head.variables.items()}
    variables["record"] = ((), np.array(to_json(record)), {"long_name": "ends, curves and options, as JSON"})
    for name, array in arrays.items():
        variables[name] = (tuple(f"{name}_{axis}" for axis in range(array.ndim)), array, {})
    import xarray

    stored = xarray.Dataset(dict(flat(variables)), attrs={**head.attrs, "parts": "\n".join(parts)})
    if isolas.seconds == isolas.seconds:
        stored.attrs["seconds"] = float(isolas.seconds)
    return {"": stored} | {name: branch_to_dataset(part) for name, part in parts.items()}


def _written(isola: Isola, names: Mapping[int, str], curves: Sequence[TrackedBranch]) -> dict[str, Any]:
    """What a file holds of one isola besides the numbers."""
    return {
        "range": tuple(isola.range),
        "reasons": tuple(isola.reasons),
        "notes": isola.notes,
        "ends": [None if end is None else _end(end, names, curves) for end in isola.ends],
        "legs": [[names[id(leg.curve)], _number(leg)] for leg in isola.legs],
        "options": {name: _option(value) for name, value in isola.options.items()},
        "known": list(isola.known),
    }


def _end(end: IsolaEnd, names: Mapping[int, str], curves: Sequence[TrackedBranch]) -> list[Any]:
    """Kind, curve and place among its events of the event that an end is."""
    for curve in curves:
        for place, event in enumerate(curve.bifurcations.met):
            if event.orbit is end.orbit:
                return [end.kind, names[id(curve)], place]
    raise InputError(f"the {end!r} lies on none of the curves: it cannot be written to a file")


def _number(leg: Leg) -> int:
    """Which of the legs of its curve it is."""
    for number, other in enumerate(legs_of(leg.curve, leg.name)):
        if other.nodes[0].orbit is leg.nodes[0].orbit and other.nodes[-1].orbit is leg.nodes[-1].orbit:
            return number
    raise InputError(f"a leg over {leg.name} is none of its curve's: it cannot be written to a file")


def _option(value: Any) -> Any:
    """An option of the verbs; a stability method of a user's own by its words, as branches have it."""
    foreign = isinstance(value, StabilityMethod) and type(value).__name__ not in _CLASSES
    return repr(value) if foreign else value


def isolas_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> Isolas:
    """The isolas that `isolas_to_datasets` wrote.

    Raises InputError where the datasets are not those of isolas, or some are missing.
    """
    head = groups[""]
    try:
        names = str(head.attrs["parts"]).splitlines()
        missing = [name for name in names if name not in groups]
        if missing:
            raise InputError(f"{missing[0]} of the isolas is missing")
        parts: dict[str, Any] = {name: branch_from_dataset(groups[name], allow_code, linear) for name in names}
        record = from_json(str(head["record"].item()), _CLASSES)
        system = build(record["system"], system_arrays(head), allow_code)
        parameter = str(head.attrs["isolas"])
        closed = (branch for name, branch in parts.items() if name.startswith("closed_"))
        found = []
        for given in record["isolas"]:
            known = [(float(value), next(closed)) for value in given["known"]]
            found.append(_isola(given, parts, system, parameter, record["omega"], known))
        isolas = Isolas(
            found,
            system,
            parameter,
            record["bounds"],
            record["omega"],
            [parts[name] for name in names if name.startswith("limit_points_")][: record["listed"]],
            [parts[name] for name in names if name.startswith("doublings_")],
            record["notes"],
            str(head.attrs["said"]),
            record["interruption"] if "interruption" in record else _told(record["notes"]),
        )
    except InputError:  # which is a ValueError
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        raise InputError(f"these are no isolas of suboctave: {type(error).__name__}: {error}") from None
    isolas.seconds = float(head.attrs.get("seconds", np.nan))
    return isolas


def _told(notes: Sequence[str]) -> Interruption | None:
    """The interruption that notes tell: older files hold nothing else."""
    return Interruption() if any(note.startswith("interrupted") for note in notes) else None


def _isola(
    given: Mapping[str, Any],
    parts: Mapping[str, Any],
    system: System,
    parameter: str,
    omega: tuple[float, float],
    known: Sequence[tuple[float, Any]],
) -> Isola:
    ends: list[IsolaEnd | None] = []
    for told in given["ends"]:
        if told is None:
            ends.append(None)
            continue
        kind, curve, place = told
        event = parts[curve].bifurcations.met[place]
        if not isinstance(event, TrackedEvent):
            raise InputError(f"an end of an isola is a {event.kind} that lies on no curve")
        ends.append(IsolaEnd.of(event, parameter, kind == "isola_centre"))
    legs = [legs_of(parts[curve], parameter)[number] for curve, number in given["legs"]]
    return Isola(
        system,
        parameter,
        omega,
        (ends[0], ends[1]),
        given["range"],
        given["reasons"],
        legs,
        given["options"],
        given["notes"],
        known,
    )
