"""Isolated responses over a design parameter: where they are born, where they merge, the closed branch in between."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from suboctave.analysis.options import SearchOptions
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation.ending import Ending, EndReason
from suboctave.curves.junction import period_name
from suboctave.curves.points import TrackedPoint
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.interruption import limited
from suboctave.maps.catalogue import SearchRange, branch_through
from suboctave.maps.pieces import MonotonePiece
from suboctave.maps.stretches import stable_ranges
from suboctave.model.system import System
from suboctave.results.branch import Branch
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.isolas import isolas_dataset

__all__ = ["Isola", "IsolaEnd", "edges_of", "isola_row"]

_NAN = float("nan")


class IsolaEnd(TrackedEvent, float):
    """One end of an isola's life: the bifurcation there, and as a number the design parameter's value.

    `kind` is "isola_centre" (the closed branch shrinks to a point) or "isola_merging" (it joins another branch). As any
    extremum along a curve of bifurcations it can be tracked in a third parameter.
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

    __hash__ = float.__hash__

    def __repr__(self) -> str:
        return f"{self.kind} at {self.parameter_name} = {float(self):.9g}, omega = {self.omega:.9g}"


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

    def __init__(
        self,
        system: System,
        parameter: str,
        omega: tuple[float, float],
        ends: tuple[IsolaEnd | None, IsolaEnd | None],
        bounds: tuple[float, float],
        reasons: tuple[str, str],
        pieces: Sequence[MonotonePiece],
        options: SearchOptions,
        notes: Iterable[str] = (),
        known: Iterable[tuple[float, Branch]] = (),
    ) -> None:
        self.system = system
        self.parameter = parameter
        self.omega = omega
        self.ends = ends
        self.range = bounds
        self.reasons = reasons
        self.pieces = tuple(pieces)
        self.options = options
        self.notes = tuple(notes)
        self.nu = self.pieces[0].nu
        self._known = dict(known)

    @cached_property
    def _curves(self) -> tuple[TrackedBranch, ...]:
        return tuple(curves_of(self.pieces, self.range))

    @property
    def limit_points(self) -> TrackedBranch:
        """Its limit points over omega and the parameter, within the range, from end to end."""
        return self._curves[0]

    @property
    def further(self) -> tuple[TrackedBranch, ...]:
        """Curves of further limit points on it, if there are any."""
        return self._curves[1:]

    @property
    def known(self) -> dict[float, Branch]:
        """The closed branches that have been followed so far, by the value of the parameter, ascending."""
        return dict(sorted(self._known.items()))

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
    def at(self, value: float, *, progress: Any = None, seconds: float | None = None) -> Branch:
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
        known = self._known.get(float(value))
        if known is None:
            known = self._followed(float(value), progress)
            if not known.interrupted:
                self._known[float(value)] = known
        return known

    def stable_ranges(self, value: float) -> list[tuple[float, float]]:
        """Between which frequencies there are stable motions on the closed branch at a value; pairs of omega."""
        return stable_ranges(self.at(value))

    def _followed(self, value: float, progress: Any) -> Branch:
        failure: ConvergenceError | None = None
        for piece in self.pieces:
            if not piece.contains(value):
                continue
            try:
                item = piece.solve_at(value)
            except ConvergenceError as why:
                failure = why
                continue
            options: SearchOptions = {**self.options, "progress": progress}
            return branch_through(item, SearchRange(*self.omega), self.parameter, self.pieces, options)
        raise ConvergenceError(
            f"no limit point of the isola was found at {self.parameter} = {value:.9g}"
            + (f" ({failure})" if failure else "")
        )

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

        given = list(responses) if isinstance(responses, list | tuple) else [responses]
        return plot_space([*_datasets(self, self._places(values)), *given], path, **options)

    def _places(self, values: Any) -> list[float]:
        """Values of the parameter at which closed branches are wanted, within the range; InputError otherwise."""
        low, high = self.range
        if isinstance(values, int) and not isinstance(values, bool) and values >= 1:
            first, last = low + 0.02 * (high - low), high - 0.08 * (high - low)
            return [float(v) for v in np.linspace(first, last, values)]
        places = list(values) if isinstance(values, Sequence | np.ndarray) and not isinstance(values, str) else []
        if not places or not all(is_number(value) and value in self for value in places):
            raise InputError(
                f"values must be how many, or numbers from {low:.9g} to {high:.9g}, where the isola is, not {values!r}"
            )
        return [float(value) for value in places]

    def __repr__(self) -> str:
        low, high = self.range
        text = f"{period_name(self.nu)} isola for {self.parameter} from {low:.7g} to {high:.7g}"
        for reason in self.reasons:
            text += f"\n  {reason}"
        for note in self.notes:
            text += f"\n  note: {note}"
        return text


def curves_of(pieces: Sequence[MonotonePiece], bounds: tuple[float, float]) -> list[TrackedBranch]:
    """Curves of limit points made of pieces, cut to a range of the parameter; the longest first."""
    made = []
    for curve in dict.fromkeys(piece.curve for piece in pieces):
        own = sorted((piece for piece in pieces if piece.curve is curve), key=lambda piece: piece.nodes[0].arclength)
        chains: list[list[MonotonePiece]] = []
        for piece in own:
            if chains and chains[-1][-1].ends[1] is not None and chains[-1][-1].ends[1] is piece.ends[0]:
                chains[-1].append(piece)
            else:
                chains.append([piece])
        if len(chains) > 1 and own[-1].ends[1] is not None and own[-1].ends[1] is own[0].ends[0]:
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
    met = [e for e in curve.bifurcations.met if any(e.orbit is p.orbit for p in points) or _within(e, points)]
    ending = Ending(EndReason.CUT, detail=f"cut to {chain[0].along} from {low:.7g} to {high:.7g}")
    endings = (ending, ending)
    options = curve.options
    return TrackedBranch(
        curve.kind, curve.names, curve.system, curve.name, points, met, [], False, endings, curve.observe, options
    )


def _within(event: Bifurcation, points: Sequence[TrackedPoint]) -> bool:
    return bool(points) and points[0].arclength < event.arclength < points[-1].arclength


# ------------------------------------------------------------------------------------------------------------ tables
def edges_of(isola: Isola) -> np.ndarray:
    """Between which frequencies the closed branch lies: (places, 3), value of the parameter, lowest, highest omega.

    Those of its limit points.
    """
    low, high = isola.range
    inside = [piece.values[(piece.values > low) & (piece.values < high)] for piece in isola.pieces]
    rows = []
    for value in np.unique(np.concatenate([[low, high], *inside])):
        met = []
        for piece in isola.pieces:
            if piece.contains(value):
                met.append(float(piece.across(value)))
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


def _datasets(isola: Isola, values: Sequence[float]) -> list[Any]:
    """What a picture of one isola is drawn from: the isola, its limit points, its closed branches at some values."""
    low, high = isola.range
    attributes: dict[str, str | int | float] = {"isolas": isola.parameter, "bounds_low": low, "bounds_high": high}
    attributes |= {"omega_low": isola.omega[0], "omega_high": isola.omega[1]}
    closed = [(0, value) for value in values]
    head = isolas_dataset([isola_row(isola)], [edges_of(isola)], closed, attributes)
    curves = [curve.to_xarray() for curve in (isola.limit_points, *isola.further)]
    loops = [isola.at(value).to_xarray().assign_attrs({"isola": 0, "at": value}) for value in values]
    return [head, *curves, *loops]
