"""What the files of maps have in common: a head with a record, branches and curves, pieces of curves by number.

Isolas as datasets that a file or the journal can hold, and back.

A head as `suboctave.store.layout` lays it out; curves of limit points and of period doublings as `limit_points_0`, ...,
`doublings_0`, ...; the closed branches that are known as `closed_0`, ..., in the order of the head's dimension
`closed`. What else there is of the isolas is JSON in `record`: the pieces of curves that their limit points lie on, by
the curve and the number along it, their ends, by the curve and the index of the event, and the options.

Regime maps as datasets that a file can hold, and back.

The head holds `RegimeMap.to_table()`, one row for each place on a border. The curves of bifurcations are the groups
`curve_0`, ...; the branches that stable arcs are stretches of `branch_0`, .... The JSON in `record` says the rest: the
strips, their slices and the arcs of these, each by the branch and the indices of its points, with two edges, of which
a border is named by its number among those of all curves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError
from suboctave.floquet.methods import Arbitration, Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.maps.catalogue import Catalogue, SearchRange
from suboctave.maps.isolas.map import IsolaMap, IsolaRegion, Probe, Span
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas, head_dataset
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.slices import Arc, Edge, Slice, Strip
from suboctave.model.system import System, build
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.files import branch_from_dataset, branch_to_dataset
from suboctave.store.layout import parameter_column
from suboctave.store.plain import flat, from_json, system_arrays, to_json, written_system
from suboctave.store.registry import Codec, parts_of, register

if TYPE_CHECKING:
    import xarray

    from suboctave.harmonic.linear_part import LinearPart
    from suboctave.store.table import Table

CLASSES: dict[str, type] = {
    c.__name__: c for c in (NewtonOptions, SteppingOptions, Arbitration, Hill, KoopmanHill, Monodromy, Interruption)
}


def map_datasets(
    item: Any,
    variables: Mapping[Any, Any],
    attributes: Mapping[str, Any],
    record: Mapping[str, Any],
    parts: Mapping[str, Branch],
) -> dict[str, xarray.Dataset]:
    """The head under the name "", `record` as JSON and the item's system with it; `parts` under names that it lists."""
    import xarray

    described, arrays = written_system(item.system)
    text = to_json({**record, "notes": item.notes, "interruption": item.interruption, "system": described})
    own: dict[str, Any] = {"record": ((), np.array(text), {"long_name": "what else there is, as JSON"})}
    own |= {name: (tuple(f"{name}_{i}" for i in range(array.ndim)), array) for name, array in arrays.items()}
    head = xarray.Dataset(dict(flat({**variables, **own})), attrs={**attributes, "parts": "\n".join(parts)})
    if item.seconds == item.seconds:
        head.attrs["seconds"] = float(item.seconds)
    return {"": head} | {name: branch_to_dataset(part) for name, part in parts.items()}


def table_head(item: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and attributes of a head that holds the table of a map."""
    table: Table = item.to_table()
    columns = {parameter_column(name, ("record",)): ("row", column) for name, column in table.columns.items()}
    return columns, {"title": table.title, "system": item.system.name}


class Opened(NamedTuple):
    """What `map_datasets` laid out: the head, the record, the system, the parts by name, and the seconds."""

    head: xarray.Dataset
    record: dict[str, Any]
    system: System
    parts: dict[str, Any]
    seconds: float

    def named(self, beginning: str) -> list[Any]:
        """The parts whose names begin in one way, in order."""
        return [part for name, part in self.parts.items() if name.startswith(beginning)]


def opened(
    groups: Mapping[str, xarray.Dataset],
    words: str,
    allow_code: bool,
    linear: LinearPart | None,
    classes: Mapping[str, type] | None = None,
) -> Opened:
    """Read what `map_datasets` laid out; InputError where parts of `words` are missing."""
    head = groups[""]
    datasets = parts_of(groups, str(head.attrs["parts"]).splitlines(), words)
    record = from_json(str(head["record"].item()), {**CLASSES, **(classes or {})})
    parts = {name: branch_from_dataset(part, allow_code, linear) for name, part in datasets.items()}
    system = build(record["system"], system_arrays(head), allow_code)
    return Opened(head, record, system, parts, float(head.attrs.get("seconds", np.nan)))


def piece_number(piece: MonotonePiece, pieces: Sequence[MonotonePiece]) -> int:
    """Which of the pieces of some curves one is."""
    for number, other in enumerate(pieces):
        ends = zip((piece.nodes[0], piece.nodes[-1]), (other.nodes[0], other.nodes[-1]), strict=True)
        if other.curve is piece.curve and all(one.orbit is same.orbit for one, same in ends):
            return number
    raise InputError(f"a stretch over {piece.along} lies on none of the curves: it cannot be written to a file")


def options_of(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the verbs as a file holds them; a stability method of a user's own by its words, as of branches."""
    return {
        name: repr(value) if isinstance(value, StabilityMethod) and type(value).__name__ not in CLASSES else value
        for name, value in options.items()
    }


#: the part of a map's file that holds its isolas
_ISOLAS = "isolas"


def isolas_to_datasets(isolas: Isolas) -> dict[str, xarray.Dataset]:
    """The head under the name "", curves and closed branches under names of their own; the head lists them."""
    own = dict.fromkeys([*isolas.limit_points, *(piece.curve for isola in isolas for piece in isola.pieces)])
    curves = {f"limit_points_{i}": curve for i, curve in enumerate(c for c in own if c not in isolas.doublings)}
    curves |= {f"doublings_{i}": curve for i, curve in enumerate(isolas.doublings)}
    closed = [branch for isola in isolas for branch in isola.known.values()]
    record = {
        "listed": len(isolas.limit_points),
        "bounds": isolas.bounds,
        "omega": isolas.omega,
        "isolas": [_written_isola(isola, curves) for isola in isolas],
    }
    head = head_dataset(isolas)
    variables = {name: (v.dims, v.values, v.attrs) for name, v in head.items()}
    parts: dict[str, Branch] = {**curves, **{f"closed_{i}": branch for i, branch in enumerate(closed)}}
    return map_datasets(isolas, variables, head.attrs, record, parts)


def _written_isola(isola: Isola, curves: Mapping[str, TrackedBranch]) -> dict[str, Any]:
    """What a file holds of one isola besides the numbers."""
    names = {curve: name for name, curve in curves.items()}
    return {
        "range": isola.range,
        "reasons": isola.reasons,
        "notes": isola.notes,
        "ends": [None if end is None else _written_end(end, curves) for end in isola.ends],
        "legs": [[names[p.curve], piece_number(p, pieces_of(p.curve, p.along))] for p in isola.pieces],
        "options": options_of(isola.options),
        "known": list(isola.known),
    }


def _written_end(end: IsolaEnd, curves: Mapping[str, TrackedBranch]) -> list[Any]:
    """Kind, curve and place among its events of the event that an end is."""
    for name, curve in curves.items():
        for place, event in enumerate(curve.bifurcations.met):
            if event.orbit is end.orbit:
                return [end.kind, name, place]
    raise InputError(f"the {end!r} lies on none of the curves: it cannot be written to a file")


def isolas_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> Isolas:
    """The isolas that `isolas_to_datasets` wrote."""
    stored = opened(groups, "isolas", allow_code, linear)
    record, parameter = stored.record, str(stored.head.attrs["isolas"])
    closed = iter(stored.named("closed_"))
    # older files hold nothing else of an interruption
    older = Interruption() if any(note.startswith("interrupted") for note in record["notes"]) else None
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
        record.get("interruption", older),
    )
    isolas.seconds = stored.seconds
    return isolas


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
    found = [region.isola for region in isola_map.regions]
    omega, within = found[0].omega if found else (np.nan, np.nan), isola_map.within or (np.nan, np.nan)
    isolas = Isolas(found, isola_map.system, isola_map.parameter, within, omega)
    record = {
        **{name: getattr(isola_map, name) for name in ("parameter", "second", "within", "bounds")},
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


def regime_map_to_datasets(regimes: RegimeMap) -> dict[str, xarray.Dataset]:
    """The head under the name "", curves and branches under names of their own."""
    pieces = [piece for curve in regimes.curves for piece in pieces_of(curve, regimes.parameter)]
    slices = list(dict.fromkeys(strip.slice for strip in regimes.strips if strip.slice is not None))
    curves: dict[str, Branch] = {f"curve_{i}": curve for i, curve in enumerate(regimes.curves)}
    on_arcs = {id(point) for each in slices for arc in each.arcs for point in arc.points}
    met = (branch for each in slices for branch, _ in each.branches)
    used = [branch for branch in met if any(id(point) in on_arcs for point in branch.points)]
    branches = {f"branch_{i}": branch for i, branch in enumerate(used)}
    places = {id(point): (n, i) for n, branch in branches.items() for i, point in enumerate(branch.points)}
    record = {
        **{name: getattr(regimes, name) for name in ("parameter", "bounds", "omega", "depth", "resolution")},
        "options": options_of(regimes.options),
        "slices": [
            {"value": each.value, "arcs": [_written_arc(arc, places, pieces) for arc in each.arcs]} for each in slices
        ],
        "strips": [
            (s.low, s.high, None if s.slice is None else slices.index(s.slice), s.examined) for s in regimes.strips
        ],
    }
    return map_datasets(regimes, *table_head(regimes), record, curves | branches)


def _written_arc(arc: Arc, places: Mapping[int, tuple[str, int]], pieces: Sequence[MonotonePiece]) -> dict[str, Any]:
    points = [places[id(point)] for point in arc.points]
    return {
        "nu": arc.nu,
        "isolated": arc.isolated,
        "followed": arc.followed,
        "branch": points[0][0] if points else None,
        "points": [index for _, index in points],
        "edges": [
            (e.omega, None if e.border is None else piece_number(e.border, pieces), e.kind, e.bound) for e in arc.edges
        ],
    }


def regime_map_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> RegimeMap:
    """The map that `regime_map_to_datasets` wrote."""
    stored = opened(groups, "map", allow_code, linear)
    record, branches, curves = stored.record, stored.parts, stored.named("curve_")
    name, bounds, omega = record["parameter"], record["bounds"], SearchRange(*record["omega"])
    given = stored.system, name, bounds, omega, "adaptive", record["options"], len(curves)
    catalogue = Catalogue(*given, notes=list(record["notes"]), interruption=record["interruption"])
    for curve in curves:
        catalogue.add(curve)
    pieces = catalogue.pieces
    slices = []
    for given in record["slices"]:
        met = [(branches[name], False) for name in dict.fromkeys(arc["branch"] for arc in given["arcs"]) if name]
        arcs = [_arc(arc, branches, pieces) for arc in given["arcs"]]
        slices.append(Slice(given["value"], catalogue, 2 ** record["depth"], branches=met, arcs=arcs))
    strips = [
        Strip(low, high, None if number is None else slices[number], examined)
        for low, high, number, examined in record["strips"]
    ]
    regimes = RegimeMap(catalogue, strips, record["depth"], record["resolution"])
    regimes.seconds = stored.seconds
    return regimes


def _arc(given: Mapping[str, Any], branches: Mapping[str, Branch], pieces: Sequence[MonotonePiece]) -> Arc:
    first, last = (
        Edge(omega, None if number is None else pieces[number], kind, bound)
        for omega, number, kind, bound in given["edges"]
    )
    points = tuple(branches[given["branch"]].points[i] for i in given["points"])
    return Arc(given["nu"], given["isolated"], (first, last), points, given["followed"])


register(Codec("regime map", RegimeMap, regime_map_to_datasets, regime_map_from_datasets))
