"""Isolas, maps of isolas and regime maps as datasets that a file or the journal can hold, and back.

Of each a head, and branches and curves as `suboctave.store.layout` lays them out, which the head lists. What is neither
is JSON in the head's `record`: pieces of curves by the number along them, events by their index, motions by those of
branch and point.

isolas
    The head as `store.layout` says; curves of limit points and of period doublings as `limit_points_0`, ...,
    `doublings_0`, ...; the closed branches that are known as `closed_0`, ..., in the order of the head's dimension
    `closed`. `record`: the pieces that their limit points lie on, by the curve and the number along it, their ends, by
    the curve and the index of the event, and the options.
isola map
    The head holds `IsolaMap.to_table()`; the curves as `curve_0`, ..., the isolas under `isolas`. `record` says of each
    region which isola and which curves it rests on, over which stretch of the second parameter, between which two ends:
    a number, or a border by its number among those of all curves.
regime map
    The head holds `RegimeMap.to_table()`; the curves of bifurcations as `curve_0`, ..., the branches that stable arcs
    are stretches of as `branch_0`, .... `record`: the strips, their slices and the arcs of these, each by the branch
    and the indices of its points, with two edges, of which a border is named by its number among those of all curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import InputError
from suboctave.floquet.methods import Arbitration, Hill, Monodromy, StabilityMethod
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.maps.catalogue import Catalogue, SearchRange
from suboctave.maps.isolas.map import IsolaMap, IsolaRegion, Probe, Span
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas, head_dataset
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.maps.regimes.arcs import Arc, Edge, Slice, Strip
from suboctave.maps.regimes.map import RegimeMap
from suboctave.results.branch import Branch
from suboctave.results.files import branch_from_dataset, branch_to_dataset
from suboctave.store.layout import parameter_column
from suboctave.store.plain import Recorded, recorded, written_system
from suboctave.store.registry import Codec, Datasets, parts_of, register

if TYPE_CHECKING:
    import xarray

_CLASSES: dict[str, type] = {
    c.__name__: c for c in (NewtonOptions, SteppingOptions, Arbitration, Hill, Monodromy, Interruption, Probe)
}


def _written(
    item: Any, head: xarray.Dataset, record: Mapping[str, Any], parts: Mapping[str, Branch]
) -> dict[str, xarray.Dataset]:
    """The head under the name "", with `record` and the item's system; `parts` under names that it lists."""
    described, arrays = written_system(item.system)
    whole = {**record, "notes": item.notes, "interruption": item.interruption, "system": described}
    stored = recorded(head, whole, "what else there is, as JSON", arrays).assign_attrs(parts="\n".join(parts))
    if item.seconds == item.seconds:
        stored.attrs["seconds"] = float(item.seconds)
    return {"": stored} | {name: branch_to_dataset(part) for name, part in parts.items()}


class _Opened(Recorded):
    """What `_written` laid out: the record, the item's system, the parts by name."""

    def __init__(self, words: str, groups: Datasets, allow_code: bool, linear: LinearPart | None) -> None:
        super().__init__(groups[""], allow_code, _CLASSES)
        datasets = parts_of(groups, str(self.dataset.attrs["parts"]).splitlines(), words)
        self.parts: dict[str, Any] = {n: branch_from_dataset(d, allow_code, linear) for n, d in datasets.items()}
        self.of = self.system(self.record["system"])

    def named(self, beginning: str) -> list[Any]:
        """The parts whose names begin in one way, in order."""
        return [part for name, part in self.parts.items() if name.startswith(beginning)]

    def timed(self, item: Any) -> Any:
        """A result that was read, with the seconds that it took."""
        item.seconds = float(self.dataset.attrs.get("seconds", np.nan))
        return item


def _table_head(item: IsolaMap | RegimeMap) -> xarray.Dataset:
    import xarray

    table = item.to_table()
    columns = {parameter_column(name, ("record",)): ("row", column) for name, column in table.columns.items()}
    return xarray.Dataset(columns, attrs={"title": table.title, "system": item.system.name})


def _number(piece: MonotonePiece, pieces: Sequence[MonotonePiece]) -> int:
    """Which of the pieces of some curves one is."""
    for number, other in enumerate(pieces):
        if other.curve is piece.curve and all(other.nodes[end].orbit is piece.nodes[end].orbit for end in (0, -1)):
            return number
    raise InputError(f"a stretch over {piece.along} lies on none of the curves: it cannot be written to a file")


def _options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the verbs as a file holds them; a stability method of a user's own by its words, as of branches."""
    return {
        name: repr(value) if isinstance(value, StabilityMethod) and type(value).__name__ not in _CLASSES else value
        for name, value in options.items()
    }


# -------------------------------------------------------------------------------------------------------------- isolas
def _write_isolas(isolas: Isolas) -> dict[str, xarray.Dataset]:
    own = dict.fromkeys([*isolas.limit_points, *(piece.curve for isola in isolas for piece in isola.pieces)])
    curves = {f"limit_points_{i}": curve for i, curve in enumerate(c for c in own if c not in isolas.doublings)}
    curves |= {f"doublings_{i}": curve for i, curve in enumerate(isolas.doublings)}
    names = {curve: name for name, curve in curves.items()}
    events = [(event, name, i) for name, curve in curves.items() for i, event in enumerate(curve.bifurcations.met)]

    def place(end: IsolaEnd) -> list[Any]:
        """Kind, curve and place among its events of the event that an end is."""
        for event, name, i in events:
            if event.orbit is end.orbit:
                return [end.kind, name, i]
        raise InputError(f"the {end!r} lies on none of the curves: it cannot be written to a file")

    written = [
        {
            **{name: getattr(isola, name) for name in ("range", "reasons", "notes")},
            "ends": [None if end is None else place(end) for end in isola.ends],
            "legs": [[names[p.curve], _number(p, pieces_of(p.curve, p.along))] for p in isola.pieces],
            "options": _options(isola.options),
            "known": list(isola.known),
        }
        for isola in isolas
    ]
    record = {"listed": len(isolas.limit_points), "bounds": isolas.bounds, "omega": isolas.omega, "isolas": written}
    parts: dict[str, Branch] = dict(curves)
    parts |= {f"closed_{i}": b for i, b in enumerate(b for isola in isolas for b in isola.known.values())}
    return _written(isolas, head_dataset(isolas), record, parts)


def _read_isolas(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> Isolas:
    stored = _Opened("isolas", groups, allow_code, linear)
    record, attributes = stored.record, stored.dataset.attrs
    parameter, closed = str(attributes["isolas"]), iter(stored.named("closed_"))

    def end(kind: str, curve: str, place: int) -> IsolaEnd:
        event = stored.parts[curve].bifurcations.met[place]
        if not isinstance(event, TrackedEvent):
            raise InputError(f"an end of an isola is a {event.kind} that lies on no curve")
        return IsolaEnd.of(event, parameter, kind == "isola_centre")

    isolas = []
    for given in record["isolas"]:
        low, high = (None if stated is None else end(*stated) for stated in given["ends"])
        pieces = tuple(pieces_of(stored.parts[curve], parameter)[number] for curve, number in given["legs"])
        followed = {float(value): next(closed) for value in given["known"]}
        isolas.append(Isola(
            stored.of, parameter, record["omega"], (low, high), given["range"], given["reasons"], pieces,
            given["options"], tuple(given["notes"]), followed,
        ))  # fmt: skip
    # older files hold nothing else of an interruption
    older = Interruption() if any(note.startswith("interrupted") for note in record["notes"]) else None
    return stored.timed(Isolas(
        isolas, stored.of, parameter, record["bounds"], record["omega"],
        stored.named("limit_points_")[: record["listed"]], stored.named("doublings_"), record["notes"],
        str(attributes["said"]), record.get("interruption", older),
    ))  # fmt: skip


# ------------------------------------------------------------------------------------------------------------ the map
_ISOLAS = "isolas"
#: attributes of a map, of the span of a region, and of a regime map that records hold as they are
_OF_MAP = ("parameter", "second", "within", "bounds")
_OF_SPAN = ("low", "high", "reasons", "closed", "settled")
_OF_REGIMES = ("parameter", "bounds", "omega", "depth", "resolution", "searched")


def _write_isola_map(made: IsolaMap) -> dict[str, xarray.Dataset]:
    curves, borders = made.curves, made.borders()
    found = [region.isola for region in made.regions]
    omega, within = found[0].omega if found else (np.nan, np.nan), made.within or (np.nan, np.nan)
    isolas = Isolas(found, made.system, made.parameter, within, omega)
    regions = [
        {
            "isola": list(isolas).index(region.isola),
            "curves": [curves.index(curve) for curve in region.curves],
            "ends": [
                ["border", _number(end, borders)] if isinstance(end, MonotonePiece) else ["value", float(end)]
                for end in region.span.ends
            ],
            "span": {name: getattr(region.span, name) for name in _OF_SPAN},
            "probes": list(region.probes),
        }
        for region in made.regions
    ]
    record = {**{name: getattr(made, name) for name in _OF_MAP}, "regions": regions}
    parts = {f"{_ISOLAS}/{name}" if name else _ISOLAS: part for name, part in _write_isolas(isolas).items()}
    return {**_written(made, _table_head(made), record, {f"curve_{i}": c for i, c in enumerate(curves)}), **parts}


def _read_isola_map(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> IsolaMap:
    stored = _Opened("map", groups, allow_code, linear)
    record, curves = stored.record, list(stored.parts.values())
    own = {name[len(_ISOLAS) + 1 :]: part for name, part in groups.items() if name.split("/")[0] == _ISOLAS}
    isolas = _read_isolas(own, allow_code, linear)
    parameter, second, within, bounds = (record[name] for name in _OF_MAP)
    borders = [border for curve in curves for border in pieces_of(curve, second, parameter)]
    regions = []
    for given in record["regions"]:
        low, high = (borders[end] if kind == "border" else end for kind, end in given["ends"])
        span, beside = Span(ends=(low, high), **given["span"]), tuple(curves[i] for i in given["curves"])
        regions.append(IsolaRegion(isolas[given["isola"]], second, span, beside, tuple(given["probes"])))
    left = record["notes"], record["interruption"]
    return stored.timed(IsolaMap(regions, stored.of, parameter, second, within, bounds, *left))


# --------------------------------------------------------------------------------------------------------- regime maps
def _write_regimes(regimes: RegimeMap) -> dict[str, xarray.Dataset]:
    pieces = [piece for curve in regimes.curves for piece in pieces_of(curve, regimes.parameter)]
    slices = list(dict.fromkeys(strip.slice for strip in regimes.strips if strip.slice is not None))
    on_arcs = {id(point) for each in slices for arc in each.arcs for point in arc.points}
    met = (branch for each in slices for branch, _ in each.branches)
    used = (branch for branch in met if any(id(point) in on_arcs for point in branch.points))
    branches: dict[str, Branch] = {f"branch_{i}": branch for i, branch in enumerate(used)}
    places = {id(point): (n, i) for n, branch in branches.items() for i, point in enumerate(branch.points)}

    def written(arc: Arc) -> dict[str, Any]:
        points = [places[id(point)] for point in arc.points]
        numbers = [None if edge.border is None else _number(edge.border, pieces) for edge in arc.edges]
        return {
            **{name: getattr(arc, name) for name in ("nu", "isolated", "followed")},
            "branch": points[0][0] if points else None,
            "points": [index for _, index in points],
            "edges": [(e.omega, number, e.kind, e.bound) for e, number in zip(arc.edges, numbers, strict=True)],
        }

    record = {
        **{name: getattr(regimes, name) for name in _OF_REGIMES},
        "options": _options(regimes.options),
        "slices": [{"value": each.value, "arcs": [written(arc) for arc in each.arcs]} for each in slices],
        "strips": [
            (s.low, s.high, None if s.slice is None else slices.index(s.slice), s.examined) for s in regimes.strips
        ],
    }
    return _written(
        regimes, _table_head(regimes), record, {f"curve_{i}": c for i, c in enumerate(regimes.curves)} | branches
    )


def _read_regimes(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> RegimeMap:
    stored = _Opened("map", groups, allow_code, linear)
    record, branches, curves = stored.record, stored.parts, stored.named("curve_")
    parameter, bounds, omega, depth, resolution, searched = (record[name] for name in _OF_REGIMES)
    asked = stored.of, parameter, bounds, SearchRange(*omega), "adaptive", record["options"], len(curves)
    catalogue = Catalogue(*asked, notes=list(record["notes"]), interruption=record["interruption"])
    for curve in curves:
        catalogue.add(curve)

    def arc(given: Mapping[str, Any]) -> Arc:
        first, last = (
            Edge(omega, None if number is None else catalogue.pieces[number], kind, bound)
            for omega, number, kind, bound in given["edges"]
        )
        points = tuple(branches[given["branch"]].points[i] for i in given["points"])
        return Arc(given["nu"], given["isolated"], (first, last), points, given["followed"])

    slices = []
    for given in record["slices"]:
        met = [(branches[name], False) for name in dict.fromkeys(arc["branch"] for arc in given["arcs"]) if name]
        slices.append(Slice(given["value"], met, [arc(a) for a in given["arcs"]]))
    strips = [Strip(low, high, None if i is None else slices[i], seen) for low, high, i, seen in record["strips"]]
    return stored.timed(RegimeMap(catalogue, strips, depth, resolution, searched))


register(Codec("isolas", Isolas, _write_isolas, _read_isolas))
register(Codec("isola map", IsolaMap, _write_isola_map, _read_isola_map))
register(Codec("regime map", RegimeMap, _write_regimes, _read_regimes))
