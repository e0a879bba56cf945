"""Isolated responses over a design parameter: where they are born, where they merge, the closed branch in between."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import InitVar, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from suboctave.analysis.options import SearchOptions
from suboctave.arguments import Positive, Progress, checked
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation.ending import Ending, EndReason
from suboctave.curves.junction import period_name
from suboctave.curves.trace import TrackedPoint
from suboctave.errors import ConvergenceError, InputError, is_number, suggest
from suboctave.interruption import Interruption, limited, pass_on
from suboctave.maps.catalogue import SearchRange, branch_through, checked_values
from suboctave.maps.pieces import MonotonePiece, stable_ranges
from suboctave.model.system import System
from suboctave.pictures.cells import Pictured
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.readings import Readings, shared
from suboctave.store.layout import isolas_dataset, led_by
from suboctave.store.registry import Stored
from suboctave.store.table import write_csv

if TYPE_CHECKING:
    import pandas
    import xarray

_NAN = float("nan")


class IsolaEnd(TrackedEvent, float):
    """One end of an isola's life: the bifurcation there, and as a number the design parameter's value.

    `kind` is "isola_centre" (the closed branch shrinks to a point) or "isola_merging" (it joins another branch). As any
    extremum along a curve of bifurcations it can be tracked in a third parameter.

    It counts as true at every value, 0 among them: an end that is not known is None. Two ends are equal if they are one
    place, of one kind.
    """

    def __new__(cls, *positional: Any, **named: Any) -> IsolaEnd:
        """The number; a copy is made from that alone."""
        if not named:
            return float.__new__(cls, *positional)
        name, orbit = named["parameter_name"], named["orbit"]
        return float.__new__(cls, orbit.omega if name == "omega" else orbit.values[name])

    @classmethod
    def of(cls, event: TrackedEvent, name: str, centre: bool) -> IsolaEnd:
        """An extremum of a parameter, as an end."""
        given = {f.name: getattr(event, f.name) for f in fields(event)}
        return cls(**{**given, "kind": "isola_centre" if centre else "isola_merging", "parameter_name": name})

    def __bool__(self) -> bool:
        return True

    def __eq__(self, other: object) -> bool:
        if isinstance(other, IsolaEnd):
            return self._place == other._place
        return float.__eq__(self, other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    # as of the number, which an end equals
    __hash__ = float.__hash__

    @property
    def _place(self) -> tuple[str, str, float, float]:
        return self.kind, self.parameter_name, float(self), self.omega

    def __repr__(self) -> str:
        return f"{self.kind} at {self.parameter_name} = {float(self):.9g}, omega = {self.omega:.9g}"


@checked(result=True)
@dataclass(eq=False, repr=False)
class Isola:
    """A closed branch that no other branch leads to, over a range of a design parameter.

    Attributes
    ----------
    system, parameter, omega
        What vibrates, the design parameter's name, the range of frequencies that was asked for.
    nu
        Period of the motions in periods of the load.
    born
        Where the loop shrinks to a point (the extremum of its curve of limit points at which the quadratic form is
        definite); None where that lies outside the bounds.
    merges
        Where it joins another branch; None where that lies outside the bounds, or where it shrinks to a point as well.
    range
        Between which values it is detached; (low, high).
    ends
        What happens at the lower and at the upper end, `IsolaEnd` or None; `reasons` says it in words.
    notes
        What could not be settled.
    """

    system: System
    parameter: str
    omega: tuple[float, float]
    ends: tuple[IsolaEnd | None, IsolaEnd | None]
    range: tuple[float, float]
    reasons: tuple[str, str]
    pieces: tuple[MonotonePiece, ...]
    options: SearchOptions
    notes: tuple[str, ...] = ()
    followed: dict[float, Branch] = field(default_factory=dict)

    @property
    def nu(self) -> int:
        """Period of the motions in periods of the load."""
        return self.pieces[0].nu

    @cached_property
    def _curves(self) -> list[TrackedBranch]:
        return curves_of(self.pieces, self.range)

    @property
    def limit_points(self) -> TrackedBranch:
        """Its limit points over omega and the parameter, within the range, from end to end."""
        return self._curves[0]

    @property
    def further(self) -> tuple[TrackedBranch, ...]:
        """Curves of further limit points on it, if there are any."""
        return tuple(self._curves[1:])

    @property
    def known(self) -> dict[float, Branch]:
        """The closed branches that have been followed so far, by the value of the parameter, ascending."""
        return dict(sorted(self.followed.items()))

    @property
    def born(self) -> IsolaEnd | None:
        """Where the closed branch shrinks to a point; None where the bounds cut that off."""
        return next((end for end in self.ends if end is not None and end.kind == "isola_centre"), None)

    @property
    def merges(self) -> IsolaEnd | None:
        """Where it joins another branch; None where the bounds cut that off, or where there is no such place."""
        return next((end for end in self.ends if end is not None and end.kind == "isola_merging"), None)

    def __contains__(self, value: float) -> bool:
        return self.range[0] <= value <= self.range[1]

    @limited
    def at(self, value: float, *, progress: Progress = None, seconds: Positive | None = None) -> Branch:
        """The closed branch at a value of the parameter, over omega.

        `seconds`: time limit, after which what was computed is given and not kept in `known`, as after Ctrl-C.

        Raises
        ------
        InputError
            Outside the range.
        ConvergenceError
            If its limit points are not found again, which may happen next to an end.
        """
        low, high = self.range
        if not is_number(value) or not low <= value <= high:
            raise InputError(f"this isola exists for {self.parameter} from {low:.9g} to {high:.9g}, not at {value!r}")
        if value in self.followed:
            return self.followed[float(value)]
        why = ""
        for piece in (piece for piece in self.pieces if piece.contains(value)):
            try:
                item = piece.solve_at(float(value))
            except ConvergenceError as failure:
                why = f" ({failure})"
                continue
            options: SearchOptions = {**self.options, "progress": progress}
            branch = branch_through(item, SearchRange(*self.omega), self.parameter, self.pieces, options)
            if not branch.interrupted:
                self.followed[float(value)] = branch
            return branch
        raise ConvergenceError(f"no limit point of the isola was found at {self.parameter} = {value:.9g}{why}")

    def stable_ranges(self, value: float) -> list[tuple[float, float]]:
        """Between which frequencies there are stable motions on the closed branch at a value; pairs of omega."""
        branch = self.at(value)
        pass_on(branch.interruption)
        return stable_ranges(branch)

    def plot(self, path: Any = None, values: int | Sequence[float] = 5, responses: Any = (), **options: Any) -> Any:
        """Draw it in space: the surface of its closed branches, its limit points, its birth.

        Parameters
        ----------
        path
            Where the figure is saved, if one is given.
        values
            At how many values of the parameter, almost from end to end, its closed branch is drawn; or these values.
        responses
            Branches or diagrams that are drawn besides, such as responses at some of these values.
        options
            As of `suboctave.plot_space`.
        """
        from suboctave.pictures import plot_space

        places, (low, high) = checked_values("values", values, self.range), self.range
        if isinstance(places, int):
            places = np.linspace(low + 0.02 * (high - low), high - 0.08 * (high - low), places).tolist()
        closed = {value: self.at(value) for value in places}
        for branch in closed.values():
            pass_on(branch.interruption)
        drawn = replace(self, followed=closed)
        alone = Isolas([drawn], self.system, self.parameter, self.range, self.omega, [self.limit_points, *self.further])
        given = list(responses) if isinstance(responses, list | tuple) else [responses]
        return plot_space([*alone.to_xarray().values(), *given], path, **options)

    def __repr__(self) -> str:
        low, high = self.range
        text = f"{period_name(self.nu)} isola for {self.parameter} from {low:.7g} to {high:.7g}"
        return "\n".join([text, *(f"  {reason}" for reason in self.reasons), *(f"  note: {n}" for n in self.notes)])


def curves_of(pieces: Sequence[MonotonePiece], bounds: tuple[float, float]) -> list[TrackedBranch]:
    """Curves of limit points made of pieces, cut to a range of the parameter; the longest first."""
    made = []
    for curve in dict.fromkeys(piece.curve for piece in pieces):
        own = sorted((piece for piece in pieces if piece.curve is curve), key=lambda piece: piece.nodes[0].arclength)
        chains: list[list[MonotonePiece]] = []
        for piece in own:
            if chains and chains[-1][-1].leads_to(piece):
                chains[-1].append(piece)
            else:
                chains.append([piece])
        if len(chains) > 1 and own[-1].leads_to(own[0]):
            # across the seam of a closed curve
            chains[0] = chains.pop() + chains[0]
        made += [_joined(chain, bounds) for chain in chains]
    return sorted(made, key=len, reverse=True)


def _joined(chain: Sequence[MonotonePiece], bounds: tuple[float, float]) -> TrackedBranch:
    """Successive pieces of a curve as one, cut to a range."""
    low, high = bounds
    points: list[TrackedPoint] = []
    for piece in chain:
        inside = [node for node, value in zip(piece.nodes, piece.values, strict=True) if low <= value <= high]
        for at_start in (True, False):
            end = low if piece.rising == at_start else high
            if not piece.low < end < piece.high:
                continue
            with contextlib.suppress(ConvergenceError):
                inside.insert(0 if at_start else len(inside), piece.cut_at(end))
        points += inside[1:] if points and inside and inside[0].orbit is points[-1].orbit else inside
    curve = chain[0].curve
    orbits = {id(point.orbit) for point in points}
    first, last = (points[0].arclength, points[-1].arclength) if points else (0.0, 0.0)
    met = [e for e in curve.bifurcations.met if id(e.orbit) in orbits or first < e.arclength < last]
    ending = Ending(EndReason.CUT, detail=f"cut to {chain[0].along} from {low:.7g} to {high:.7g}")
    own: tuple[Any, ...] = points, met, [], False, (ending, ending), curve.observe, curve.options
    return TrackedBranch(curve.kind, curve.names, curve.system, curve.name, *own)


@checked(result=True)
@dataclass(eq=False, repr=False)
class Isolas(Stored, Pictured, Sequence[Isola]):
    """Isolas in the order of the values at which they are born, and what was learnt on the way.

    Attributes
    ----------
    system, parameter, bounds, omega
        What was asked.
    limit_points, doublings
        All curves of limit points and of period doublings that were followed, in (omega, parameter).
    notes
        What could not be settled; empty if nothing was left open.
    summary
        The outcome in one sentence.
    interruption
        What stopped the search, Ctrl-C or a time limit (`seconds`); None if it came to its end.
    """

    isolas: InitVar[Iterable[Isola]]
    system: System
    parameter: str
    bounds: tuple[float, float]
    omega: tuple[float, float]
    limit_points: Sequence[TrackedBranch] = ()
    doublings: Sequence[TrackedBranch] = ()
    notes: Iterable[str] = ()
    summary: str = ""
    interruption: Interruption | None = None

    def __post_init__(self, isolas: Iterable[Isola]) -> None:
        # those whose birth is cut off come last, by the upper end of their range
        self._items = tuple(sorted(isolas, key=lambda i: (i.born is None, i.range[1] if i.born is None else i.born)))
        self.limit_points, self.doublings = tuple(self.limit_points), tuple(self.doublings)
        self.notes = tuple(self.notes)

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, which: int) -> Isola: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Isola, ...]: ...
    def __getitem__(self, which: int | slice) -> Isola | tuple[Isola, ...]:
        return self._items[which]

    @limited
    def at(self, value: float, *, progress: Progress = None, seconds: Positive | None = None) -> list[Branch]:
        """The closed branches that exist at a value of the parameter; `seconds`: time limit of all of them."""
        branches: list[Branch] = []
        for isola in self:
            if value in isola and not (branches and branches[-1].interrupted):
                branches.append(isola.at(value, progress=progress))
        return branches

    @property
    def plane(self) -> tuple[str, str]:
        """The two parameters of its curves: omega and the design parameter."""
        return "omega", self.parameter

    def noting(self, notes: Iterable[str], interruption: Interruption | None = None) -> Isolas:
        """The same with more that could not be settled, and with what stopped it."""
        self.notes = (*self.notes, *notes)
        self.interruption = self.interruption or interruption
        return self

    def to_dataframe(self) -> pandas.DataFrame:
        """One row for each isola: period, range, where it is born and merges, and the frequencies there."""
        import pandas

        rows = []
        for isola in self:
            row = isola_row(isola)
            ends: dict[str, Any] = {"period": period_name(isola.nu), "from": row["from"], "to": row["to"]}
            for word in ("born", "merges"):
                ends |= {f"{word} {self.parameter}": row[word], f"{word} omega": row[f"{word}_omega"]}
            rows.append(ends)
        return pandas.DataFrame(rows)

    def to_csv(self, path: str | Path, what: str = "isolas", overwrite: bool = False) -> Path:
        """The table of the "isolas", or the "points" or "bifurcations" of all curves, as comma-separated text (.csv).

        Curves of limit points come before those of period doublings; the column `curve` numbers them.
        """
        import pandas

        known = ("isolas", "points", "bifurcations")
        if what not in known:
            raise InputError(f"to_csv writes isolas, points or bifurcations, not {what!r}{suggest(str(what), known)}")
        if what == "isolas":  # with what happens at the ends, and the notes
            rows = [isola_row(isola) for isola in self]
            more = {name: [row[name] for row in rows] for name in ("at_from", "at_to", "notes")}
            return write_csv(self.to_dataframe().assign(**more), path, overwrite)
        points = what == "points"
        frames = [curve.to_dataframe() if points else curve.bifurcations_frame() for curve in self._curves]
        full = [
            led_by(frame, {"curve": number, "of": curve.kind, "nu": curve.nu})
            for number, (curve, frame) in enumerate(zip(self._curves, frames, strict=True))
            if len(frame)
        ]
        frame = pandas.concat(full, ignore_index=True) if full else pandas.DataFrame({"curve": []})
        return write_csv(frame, path, overwrite)

    @property
    def _curves(self) -> tuple[TrackedBranch, ...]:
        return (*self.limit_points, *self.doublings)

    def to_xarray(self, readings: Readings = False, motions: bool = False) -> dict[str, xarray.Dataset]:
        """Datasets by name: "isolas" (one entry each, and their edges), all curves, the closed branches known.

        `suboctave.store.layout` describes the first, `Branch.to_xarray` the others.
        """
        words = {"LP": "limit points", "PD": "period doublings"}
        named: dict[str, tuple[Branch, dict[str, Any]]] = {
            f"{number}: {words[curve.kind]} of {period_name(curve.nu)}": (curve, {})
            for number, curve in enumerate(self._curves)
        }
        for number, isola in enumerate(self):
            which = f"isola {number}" if len(self) > 1 else "isola"
            for value, branch in isola.known.items():
                named[f"{which} at {self.parameter} = {value:.6g}"] = (branch, {"isola": number, "at": value})
        chosen = shared(readings, [branch.nu for branch, _ in named.values()])
        return {"isolas": head_dataset(self)} | {
            name: branch.to_xarray(names, motions).assign_attrs(attributes)
            for (name, (branch, attributes)), names in zip(named.items(), chosen, strict=True)
        }

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw the curves over omega and the parameter, with each isola's region; options as of `suboctave.plot`."""
        from suboctave.pictures import plot

        return plot(self, path, **options)

    def __repr__(self) -> str:
        return "\n".join([self.summary, *(repr(isola) for isola in self), *(f"note: {note}" for note in self.notes)])


# ------------------------------------------------------------------------------------------------------------ tables
def edges_of(isola: Isola) -> np.ndarray:
    """Between which frequencies the closed branch lies: (places, 3), value of the parameter, lowest, highest omega.

    Those of its limit points.
    """
    low, high = isola.range
    inside = [piece.values[(piece.values > low) & (piece.values < high)] for piece in isola.pieces]
    rows = []
    for value in np.unique(np.concatenate([[low, high], *inside])):
        met = [float(piece.across(value)) for piece in isola.pieces if piece.contains(value)]
        if met:
            rows.append((float(value), min(met), max(met)))
    return np.array(rows).reshape(-1, 3)


def isola_row(isola: Isola) -> dict[str, Any]:
    """An isola as a row of `store.isolas`."""
    row: dict[str, Any] = {"period": isola.nu, "from": isola.range[0], "to": isola.range[1]}
    for word, end in (("born", isola.born), ("merges", isola.merges)):
        row[word] = _NAN if end is None else float(end)
        row[f"{word}_omega"] = _NAN if end is None else end.omega
    return row | {"at_from": isola.reasons[0], "at_to": isola.reasons[1], "notes": "\n".join(isola.notes)}


def head_dataset(isolas: Isolas) -> xarray.Dataset:
    """The isolas themselves as `store.isolas` lays them out."""
    closed = [(number, value) for number, isola in enumerate(isolas) for value in isola.known]
    return isolas_dataset(
        [isola_row(isola) for isola in isolas],
        [edges_of(isola) for isola in isolas],
        closed,
        {
            "isolas": isolas.parameter,
            "bounds_low": isolas.bounds[0],
            "bounds_high": isolas.bounds[1],
            "omega_low": isolas.omega[0],
            "omega_high": isolas.omega[1],
            "said": isolas.summary,
            "notes": "\n".join(isolas.notes),
            "system": isolas.system.name,
        },
    )
