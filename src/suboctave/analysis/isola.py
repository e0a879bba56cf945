"""Isolated responses over a design parameter: where they are born, where they merge, the closed branch in between."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.checks import is_number
from suboctave.analysis.identity import lies_on
from suboctave.analysis.junction import period_name
from suboctave.analysis.limit_curves import Leg, as_point
from suboctave.analysis.switching import switch_branch
from suboctave.analysis.tracked_branch import TrackedBranch, TrackedPoint
from suboctave.analysis.verbs import continue_branch
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation.ending import Ending, EndReason
from suboctave.errors import ConvergenceError, InputError
from suboctave.interruption import limited, pass_on
from suboctave.model.system import System

__all__ = ["Isola", "IsolaEnd"]

#: share of a closed branch's length by which points are beside a bifurcation, not at it
_CLEAR = 1e-4


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
        legs: Sequence[Leg],
        options: dict[str, Any],
        notes: Iterable[str] = (),
        known: Iterable[tuple[float, Branch]] = (),
    ) -> None:
        self.system = system
        self.parameter = parameter
        self.omega = omega
        self.ends = ends
        self.range = bounds
        self.reasons = reasons
        self.legs = tuple(legs)
        self.options = options
        self.notes = tuple(notes)
        self.nu = self.legs[0].nu
        self._known = dict(known)

    @cached_property
    def _curves(self) -> tuple[TrackedBranch, ...]:
        return tuple(curves_of(self.legs, self.range))

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
        for leg in self.legs:
            if not leg.contains(value):
                continue
            try:
                found = leg.limit_point(value)
            except ConvergenceError as why:
                failure = why
                continue
            return closed_branch(found, self.omega, self.parameter, self.legs, self.options, progress)
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
        from suboctave.analysis.isola_tables import isola_datasets
        from suboctave.pictures import plot_space

        given = list(responses) if isinstance(responses, list | tuple) else [responses]
        return plot_space([*isola_datasets(self, self._places(values)), *given], path, **options)

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


def closed_branch(
    limit_point: Bifurcation,
    omega: tuple[float, float],
    name: str,
    legs: Iterable[Leg],
    options: dict[str, Any],
    progress: Any = None,
) -> Branch:
    """The branch over omega through a limit point, in a range widened by the limit points of legs at that value."""
    value = limit_point.parameter(name)
    places = [leg.omega_near(value)[0] for leg in legs if leg.contains(value)] + [limit_point.omega, *omega]
    low, high = min(places), max(places)
    margin = 0.02 * (high - low)
    bounds = (max(low - margin, 0.5 * low), high + margin)
    return continue_branch(limit_point, "omega", bounds, progress=progress, **options)


def carrier_of(branch: Branch, attached: Iterable[Branch], options: dict[str, Any]) -> Branch | None:
    """Of the closed branches that one is connected with by branch points that on which the others hang; None if one of
    them is not closed, or meets a branch that leads to the ends of the range, as those `attached` do.

    A loop hangs on another if it turns back where it meets it, as what leaves a pitchfork does.

    Raises
    ------
    ConvergenceError, InputError
        If what crosses one of them at a branch point cannot be followed.
    """
    met, connected = list(attached), [branch]
    for one in connected:  # which grows on the way
        if not one.closed or one.departs is not None or one.arrives is not None:
            return None
        for item in one.bifurcations["BP"]:
            if any(lies_on(item.orbit, other.points) for other in met):
                return None
            if any(lies_on(item.orbit, other.points) for other in connected if other is not one):
                continue
            crossing = switch_branch(item, **options)
            pass_on(crossing.interruption)
            if not any(lies_on(crossing.points[len(crossing) // 2].orbit, other.points) for other in connected):
                connected.append(crossing)
    crossed = (one for one in connected if not any(_turns_back(one, item) for item in one.bifurcations["BP"]))
    return next(crossed, branch)


def _turns_back(branch: Branch, item: Bifurcation) -> bool:
    """Whether a closed branch lies on one side, in omega, of a bifurcation that it passes."""
    whole = float(branch.arclength[-1])
    ahead = (branch.arclength - item.arclength) % whole
    # points right beside it are off by less than its frequency is known
    clear = np.flatnonzero((ahead > _CLEAR * whole) & (ahead < (1.0 - _CLEAR) * whole))
    after, before = clear[np.argmin(ahead[clear])], clear[np.argmax(ahead[clear])]
    return bool((branch.omega[after] - item.omega) * (branch.omega[before] - item.omega) > 0.0)


def stable_ranges(branch: Branch) -> list[tuple[float, float]]:
    """Between which frequencies a branch has stable motions; pairs of omega, ascending, overlapping ones joined."""
    places, stable, omega = branch.arclength, branch.stable, branch.omega
    changes = sorted((b.arclength, b.omega) for b in branch.bifurcations.met if b.kind != "grazing")
    pieces = []
    whole = float(places[-1])
    if branch.closed and changes:
        # the seam is no end
        places, stable = (np.concatenate(pair) for pair in ((places, places[1:] + whole), (stable, stable[1:])))
        ends = [*changes, (changes[0][0] + whole, changes[0][1])]
    else:
        ends = [(0.0, omega[0]), *changes, (whole, omega[-1])]
    for (start, first), (stop, last) in pairwise(ends):
        # on a located bifurcation itself the verdict is open
        inside = (places > start) & (places < stop)
        if inside.any() and np.median(stable[inside]) > 0.5:
            pieces.append((float(min(first, last)), float(max(first, last))))
    joined: list[tuple[float, float]] = []
    for low, high in sorted(pieces):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined


def curves_of(legs: Sequence[Leg], bounds: tuple[float, float]) -> list[TrackedBranch]:
    """Curves of limit points made of legs, cut to a range of the parameter; the longest first."""
    made = []
    for curve in dict.fromkeys(leg.curve for leg in legs):
        own = sorted((leg for leg in legs if leg.curve is curve), key=lambda leg: leg.nodes[0].arclength)
        chains: list[list[Leg]] = []
        for leg in own:
            if chains and chains[-1][-1].ends[1] is not None and chains[-1][-1].ends[1] is leg.ends[0]:
                chains[-1].append(leg)
            else:
                chains.append([leg])
        if len(chains) > 1 and own[-1].ends[1] is not None and own[-1].ends[1] is own[0].ends[0]:
            # across the seam of a closed curve
            chains[0] = chains.pop() + chains[0]
        made += [_joined(chain, bounds) for chain in chains]
    return sorted(made, key=len, reverse=True)


def _joined(chain: Sequence[Leg], bounds: tuple[float, float]) -> TrackedBranch:
    """Successive legs of a curve as one, cut to a range."""
    low, high = bounds
    points: list[TrackedPoint] = []
    for leg in chain:
        inside = [node for node, value in zip(leg.nodes, leg.values, strict=True) if low <= value <= high]
        rising = leg.values[-1] > leg.values[0]
        for at_start in (True, False):
            end = low if rising == at_start else high
            if not leg.low < end < leg.high:
                continue
            with contextlib.suppress(ConvergenceError):
                cut = as_point(leg.limit_point(end)).at(leg.place(end))
                inside.insert(0 if at_start else len(inside), cut)
        points += inside[1:] if points and inside and inside[0].orbit is points[-1].orbit else inside
    curve = chain[0].curve
    met = [e for e in curve.bifurcations.met if any(e.orbit is p.orbit for p in points) or _within(e, points)]
    ending = Ending(EndReason.CUT, detail=f"cut to {chain[0].name} from {low:.7g} to {high:.7g}")
    endings = (ending, ending)
    options = curve.options
    return TrackedBranch(
        curve.kind, curve.names, curve.system, curve.name, points, met, [], False, endings, curve.observe, options
    )


def _within(event: Bifurcation, points: Sequence[TrackedPoint]) -> bool:
    return bool(points) and points[0].arclength < event.arclength < points[-1].arclength
