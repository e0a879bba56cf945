"""Isolas as datasets that a file or the journal can hold, and back.

A head as `suboctave.store.isolas` lays it out; curves of limit points and of period doublings as `limit_points_0`, ...,
`doublings_0`, ...; the closed branches that are known as `closed_0`, ..., in the order of the head's dimension
`closed`. What else there is of the isolas is JSON in `record`: the pieces of curves that their limit points lie on, by
the curve and the number along it, their ends, by the curve and the index of the event, and the options.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.maps.files import Opened, map_datasets, opened, options_of, piece_number, table_head
from suboctave.maps.isolas.region import IsolaMap, IsolaRegion, Probe, Span
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas, head_dataset
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.results.branch import Branch
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.registry import Codec, register

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
    record = {
        "listed": len(isolas.limit_points),
        "bounds": tuple(isolas.bounds),
        "omega": tuple(isolas.omega),
        "isolas": [_written(isola, names, curves) for isola in isolas],
    }
    head = head_dataset(isolas)
    return map_datasets(isolas, {k: (v.dims, v.values, v.attrs) for k, v in head.items()}, head.attrs, record, parts)


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
    """The isolas that `isolas_to_datasets` wrote."""
    stored = opened(groups, "isolas", allow_code, linear)
    record, parameter = stored.record, str(stored.head.attrs["isolas"])
    closed = iter(stored.named("closed_"))
    isolas = Isolas(
        [_isola(given, stored, parameter, closed) for given in record["isolas"]],
        stored.system,
        parameter,
        record["bounds"],
        record["omega"],
        stored.named("limit_points_")[: record["listed"]],
        stored.named("doublings_"),
        record["notes"],
        str(stored.head.attrs["said"]),
        record["interruption"] if "interruption" in record else _interruption_of(record["notes"]),
    )
    isolas.seconds = stored.seconds
    return isolas


def _interruption_of(notes: Sequence[str]) -> Interruption | None:
    """The interruption that notes mention: older files hold nothing else."""
    return Interruption() if any(note.startswith("interrupted") for note in notes) else None


def _isola(given: Mapping[str, Any], stored: Opened, parameter: str, closed: Iterator[Branch]) -> Isola:
    """One isola; the next of the closed branches are its own."""
    low, high = (None if end is None else _read_end(end, stored, parameter) for end in given["ends"])
    return Isola(
        stored.system,
        parameter,
        stored.record["omega"],
        (low, high),
        given["range"],
        given["reasons"],
        tuple(pieces_of(stored.parts[curve], parameter)[number] for curve, number in given["legs"]),
        given["options"],
        tuple(given["notes"]),
        {float(value): next(closed) for value in given["known"]},
    )


def _read_end(given: Sequence[Any], stored: Opened, parameter: str) -> IsolaEnd:
    kind, curve, place = given
    event = stored.parts[curve].bifurcations.met[place]
    if not isinstance(event, TrackedEvent):
        raise InputError(f"an end of an isola is a {event.kind} that lies on no curve")
    return IsolaEnd.of(event, parameter, kind == "isola_centre")


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
    return map_datasets(isola_map, *table_head(isola_map), record, named) | parts


def isola_map_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> IsolaMap:
    """The map that `isola_map_to_datasets` wrote."""
    stored = opened(groups, "map", allow_code, linear, {"Probe": Probe})
    record, curves = stored.record, list(stored.parts.values())
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
    loaded = IsolaMap(regions, stored.system, parameter, second, record["within"], bounds, notes, interruption)
    loaded.seconds = stored.seconds
    return loaded


register(Codec("isolas", Isolas, isolas_to_datasets, isolas_from_datasets))
register(Codec("isola map", IsolaMap, isola_map_to_datasets, isola_map_from_datasets))
