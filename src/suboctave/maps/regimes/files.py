"""Regime maps as datasets that a file can hold, and back.

The head holds `RegimeMap.to_table()`, one row for each place on a border. The curves of bifurcations are the groups
`curve_0`, ...; the branches that stable arcs are stretches of `branch_0`, .... The JSON in `record` says the rest: the
strips, their slices and the arcs of these, each by the branch and the indices of its points, with two edges, of which
a border is named by its number among those of all curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from suboctave.harmonic.linear_part import LinearPart
from suboctave.maps.catalogue import Catalogue, SearchRange
from suboctave.maps.files import map_datasets, opened, options_of, piece_number, table_head
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.slices import Arc, Edge, Slice
from suboctave.maps.regimes.strips import Strip
from suboctave.results.branch import Branch
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.registry import Codec, register

if TYPE_CHECKING:
    import xarray

__all__ = ["regime_map_from_datasets", "regime_map_to_datasets"]


def regime_map_to_datasets(regimes: RegimeMap) -> dict[str, xarray.Dataset]:
    """The head under the name "", curves and branches under names of their own."""
    pieces = _pieces(regimes.curves, regimes.parameter)
    slices = list(dict.fromkeys(strip.slice for strip in regimes.strips if strip.slice is not None))
    places: dict[int, tuple[str, int]] = {}
    branches: dict[str, Branch] = {f"curve_{i}": curve for i, curve in enumerate(regimes.curves)}
    used = {id(point) for each in slices for arc in each.arcs for point in arc.points}
    for branch in (branch for each in slices for branch, _ in each.branches):
        points = {id(point): i for i, point in enumerate(branch.points)}
        if used.isdisjoint(points):
            continue
        name = f"branch_{len(branches) - len(regimes.curves)}"
        branches[name] = branch
        places |= {key: (name, i) for key, i in points.items()}
    record = {
        "parameter": regimes.parameter,
        "bounds": tuple(regimes.bounds),
        "omega": tuple(regimes.omega),
        "options": options_of(regimes.options),
        "depth": regimes.depth,
        "resolution": regimes.resolution,
        "slices": [
            {"value": each.value, "arcs": [_written(arc, places, pieces) for arc in each.arcs]} for each in slices
        ],
        "strips": [
            (s.low, s.high, None if s.slice is None else slices.index(s.slice), s.examined) for s in regimes.strips
        ],
    }
    return map_datasets(regimes, *table_head(regimes), record, branches)


def _pieces(curves: Sequence[TrackedBranch], parameter: str) -> list[MonotonePiece]:
    return [piece for curve in curves for piece in pieces_of(curve, parameter)]


def _written(arc: Arc, places: Mapping[int, tuple[str, int]], pieces: Sequence[MonotonePiece]) -> dict[str, Any]:
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
    pieces = _pieces(curves, record["parameter"])
    name, bounds, omega = record["parameter"], record["bounds"], SearchRange(*record["omega"])
    options = record["options"]
    catalogue = Catalogue(stored.system, name, bounds, omega, "adaptive", options, len(curves), curves, pieces)
    catalogue.notes += record["notes"]
    catalogue.interruption = record["interruption"]
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
