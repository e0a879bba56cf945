"""Branches over omega at values of the design parameter: which close on themselves, and on which limit points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.errors import ConvergenceError
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import Catalogue, branch_through
from suboctave.maps.pieces import MonotonePiece
from suboctave.results.branch import Branch

__all__ = ["Loop", "Loops"]

#: events that are closer, in units of the parameter's range, are met together
_TOGETHER = 1e-7


@dataclass(frozen=True, eq=False)
class Loop:
    """A branch over omega at a value of the parameter, and the pieces of curves that its limit points lie on.

    `detached`: whether it closes on itself, and so do all branches that it meets at branch points, and those that they
    meet: from none of them a sweep comes to it.
    """

    value: float
    branch: Branch
    pieces: tuple[MonotonePiece, ...]
    detached: bool


@dataclass(eq=False)
class Loops:
    """Branches through the limit points of a catalogue.

    catalogue
        The curves of limit points and period doublings over the parameter.
    met
        Branches that bifurcate from a response, or are one, by the value of the parameter.
    """

    catalogue: Catalogue
    met: dict[float, list[Branch]] = field(default_factory=dict)
    _explained: set[tuple[float, int]] = field(default_factory=set)

    def through(self, piece: MonotonePiece, value: float) -> Loop | None:
        """The branch through a limit point at a value; None where it cannot be followed."""
        catalogue = self.catalogue
        same = [other for other in catalogue.limit_points if other.curve is piece.curve]
        try:
            item = piece.solve_at(value)
            branch = branch_through(item, catalogue.omega, catalogue.name, same, catalogue.options)
        except ConvergenceError as failure:
            where = f"omega = {float(piece.across(value)):.6g}, {catalogue.name} = {value:.6g}"
            catalogue.note(f"the branch at {where} could not be followed: {failure}")
            return None
        pass_on(branch.interruption)
        return self.of(branch, value, piece)

    def of(self, branch: Branch, value: float, *known: MonotonePiece) -> Loop:
        """A branch at a value, or the closed one that it hangs on; `known` are pieces of the given branch."""
        carrier = self.catalogue.carrier(branch, value, self.met.get(value, ()))
        if carrier is None or carrier is branch:
            return Loop(value, branch, self.pieces_on(branch, value, *known), carrier is branch)
        self._explained |= {(value, id(piece)) for piece in known}
        return Loop(value, carrier, self.pieces_on(carrier, value), True)

    def pieces_on(self, branch: Branch, value: float, *known: MonotonePiece) -> tuple[MonotonePiece, ...]:
        """The pieces that a branch's limit points lie on, each once, those that are known first."""
        pieces = (self.catalogue.known(item, value) for item in branch.bifurcations["LP"])
        return tuple(dict.fromkeys([*known, *(piece for piece in pieces if piece is not None)]))

    def attach(self, loop: Loop) -> None:
        """A branch that is not detached: its limit points at that value are explained."""
        if not loop.detached:
            self.met.setdefault(loop.value, []).append(loop.branch)
            self._explained |= {(loop.value, id(piece)) for piece in loop.pieces}

    def explained(self, piece: MonotonePiece, value: float) -> bool:
        """Whether a limit point at a value lies on a branch that is not detached."""
        return (value, id(piece)) in self._explained

    def critical(self, nu: int, value: float, upper: bool) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """Values ahead at which branches of motions of `nu` load periods may change, with what happens there."""
        name, near = self.catalogue.name, _TOGETHER * self.catalogue.span
        events = [end for piece in self.catalogue.limit_points if piece.nu == nu for end in piece.ends]
        for curve in self.catalogue.curves:
            if curve.kind == "PD" and 2 * curve.nu == nu:
                extrema = (e for e in curve.extrema if isinstance(e, TrackedEvent) and e.parameter_name == name)
                events += extrema
        sign = 1.0 if upper else -1.0
        ahead = {id(e): e for e in events if e is not None and sign * (e.parameter(name) - value) > near}
        group: list[TrackedEvent] = []
        for event in sorted(ahead.values(), key=lambda e: sign * e.parameter(name)):
            if group and abs(event.parameter(name) - group[0].parameter(name)) > near:
                yield group[0].parameter(name), group
                group = []
            group.append(event)
        if group:
            yield group[0].parameter(name), group
