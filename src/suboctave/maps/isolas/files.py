"""Isolas as datasets that a file or the journal can hold, and back.

A head as `suboctave.store.isolas` lays it out; curves of limit points and of period doublings as `limit_points_0`, ...,
`doublings_0`, ...; the closed branches that are known as `closed_0`, ..., in the order of the head's dimension
`closed`. What else there is of the isolas is JSON in `record`: the pieces of curves that their limit points lie on, by
the curve and the number along it, their ends, by the curve and the index of the event, and the options.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.maps.files import CLASSES, map_datasets, map_record, options_of, piece_number
from suboctave.maps.isolas.isola import Isola, IsolaEnd
from suboctave.maps.isolas.region import IsolaMap, IsolaRegion, Probe
from suboctave.maps.isolas.result import Isolas, head_dataset
from suboctave.maps.isolas.sheets import Span
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.model.system import System, build
from suboctave.results.files.branch import branch_from_dataset, branch_to_dataset
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.arrays import flat
from suboctave.store.plain import from_json, to_json
from suboctave.store.registry import Codec, register
from suboctave.store.systems import system_arrays, written_system

if TYPE_CHECKING:
    import xarray

__all__ = ["isola_map_from_datasets", "isola_map_to_datasets", "isolas_from_datasets", "isolas_to_datasets"]

#: the part of a map's file that holds its isolas
_ISOLAS = "isolas"


def isolas_to_datasets(isolas: Isolas) -> dict[str, xarray.Dataset]:
    """The head under the name "", curves and closed branches under names of their own; the head lists them."""
    pieces = [piece for isola in isolas for piece in isola.pieces]
    curves = list(dict.fromkeys([*isolas.limit_points, *(piece.curve for piece in pieces), *isolas.doublings]))
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
        "legs": [
            [names[id(piece.curve)], piece_number(piece, pieces_of(piece.curve, piece.along))] for piece in isola.pieces
        ],
        "options": options_of(isola.options),
        "known": list(isola.known),
    }


def _end(end: IsolaEnd, names: Mapping[int, str], curves: Sequence[TrackedBranch]) -> list[Any]:
    """Kind, curve and place among its events of the event that an end is."""
    for curve in curves:
        for place, event in enumerate(curve.bifurcations.met):
            if event.orbit is end.orbit:
                return [end.kind, names[id(curve)], place]
    raise InputError(f"the {end!r} lies on none of the curves: it cannot be written to a file")


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
        record = from_json(str(head["record"].item()), CLASSES)
        system = build(record["system"], system_arrays(head), allow_code)
        parameter = str(head.attrs["isolas"])
        closed = (branch for name, branch in parts.items() if name.startswith("closed_"))
        isola_items = []
        for given in record["isolas"]:
            known = [(float(value), next(closed)) for value in given["known"]]
            isola_items.append(_isola(given, parts, system, parameter, record["omega"], known))
        isolas = Isolas(
            isola_items,
            system,
            parameter,
            record["bounds"],
            record["omega"],
            [parts[name] for name in names if name.startswith("limit_points_")][: record["listed"]],
            [parts[name] for name in names if name.startswith("doublings_")],
            record["notes"],
            str(head.attrs["said"]),
            record["interruption"] if "interruption" in record else _interruption_of(record["notes"]),
        )
    except InputError:  # which is a ValueError
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        raise InputError(f"these are no isolas of suboctave: {type(error).__name__}: {error}") from None
    isolas.seconds = float(head.attrs.get("seconds", np.nan))
    return isolas


def _interruption_of(notes: Sequence[str]) -> Interruption | None:
    """The interruption that notes mention: older files hold nothing else."""
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
    for stored in given["ends"]:
        if stored is None:
            ends.append(None)
            continue
        kind, curve, place = stored
        event = parts[curve].bifurcations.met[place]
        if not isinstance(event, TrackedEvent):
            raise InputError(f"an end of an isola is a {event.kind} that lies on no curve")
        ends.append(IsolaEnd.of(event, parameter, kind == "isola_centre"))
    pieces = [pieces_of(parts[curve], parameter)[number] for curve, number in given["legs"]]
    return Isola(
        system,
        parameter,
        omega,
        (ends[0], ends[1]),
        given["range"],
        given["reasons"],
        pieces,
        given["options"],
        given["notes"],
        known,
    )


# ------------------------------------------------------------------------------------------------------------ the map
def isola_map_to_datasets(isola_map: IsolaMap) -> dict[str, xarray.Dataset]:
    """The head with `IsolaMap.to_table()` under the name "", the curves as `curve_0`, ..., the isolas under `isolas`.

    `record` says of each region which isola and which curves it rests on, over which stretch of the second parameter,
    between which two ends: a number, or a border by its number among those of all curves.
    """
    curves, borders = isola_map.curves, isola_map.borders()
    omega = isola_map.regions[0].isola.omega if isola_map.regions else (np.nan, np.nan)
    within = isola_map.within or (np.nan, np.nan)
    isolas = Isolas(
        (region.isola for region in isola_map.regions), isola_map.system, isola_map.parameter, within, omega
    )
    record = {
        "parameter": isola_map.parameter,
        "second": isola_map.second,
        "within": isola_map.within,
        "bounds": tuple(isola_map.bounds),
        "notes": isola_map.notes,
        "interruption": isola_map.interruption,
        "regions": [
            {
                "isola": list(isolas).index(region.isola),
                "curves": [curves.index(curve) for curve in region.curves],
                "ends": [
                    ["border", piece_number(end, borders)] if isinstance(end, MonotonePiece) else ["value", float(end)]
                    for end in region.span.ends
                ],
                "span": {f: getattr(region.span, f) for f in ("low", "high", "reasons", "closed", "settled")},
                "probes": list(region.probes),
            }
            for region in isola_map.regions
        ],
    }
    parts = {f"{_ISOLAS}/{name}" if name else _ISOLAS: part for name, part in isolas_to_datasets(isolas).items()}
    named = {f"curve_{i}": curve for i, curve in enumerate(curves)}
    return map_datasets(isola_map.system, isola_map.to_table(), record, named, isola_map.seconds) | parts


def isola_map_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> IsolaMap:
    """The map that `isola_map_to_datasets` wrote; InputError where the datasets are not those of one."""
    try:
        record, system, branches, seconds = map_record(groups, {"Probe": Probe}, allow_code, linear)
        curves: list[Any] = list(branches.values())
        own = {name[len(_ISOLAS) + 1 :]: part for name, part in groups.items() if name.split("/")[0] == _ISOLAS}
        isolas = isolas_from_datasets(own, allow_code, linear)
        parameter, second = record["parameter"], record["second"]
        borders = [border for curve in curves for border in pieces_of(curve, second, parameter)]
        regions = []
        for given in record["regions"]:
            low, high = (borders[end] if kind == "border" else end for kind, end in given["ends"])
            span = Span(ends=(low, high), **given["span"])
            beside = tuple(curves[i] for i in given["curves"])
            regions.append(IsolaRegion(isolas[given["isola"]], second, span, beside, tuple(given["probes"])))
        bounds, notes, interruption = record["bounds"], record["notes"], record["interruption"]
        loaded = IsolaMap(regions, system, parameter, second, record["within"], bounds, notes, interruption)
    except InputError:  # which is a ValueError
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"this is no map of isolas of suboctave: {type(error).__name__}: {error}") from None
    loaded.seconds = seconds
    return loaded


register(Codec("isolas", Isolas, isolas_to_datasets, isolas_from_datasets))
register(Codec("isola map", IsolaMap, isola_map_to_datasets, isola_map_from_datasets))
