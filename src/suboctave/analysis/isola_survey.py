"""What a search for isolas knows: curves of limit points and period doublings, each once, and closed branches.

Starting points come from the responses at several values of the design parameter and from the branches that bifurcate
from them. Each limit point is followed over the parameter unless it lies on a curve that is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.identity import Relation, image_of, lies_on, relation
from suboctave.analysis.isola import carrier_of, closed_branch
from suboctave.analysis.limit_curves import Leg, legs_of
from suboctave.analysis.making import Harmonics, make_curve
from suboctave.analysis.refine import orbit_of
from suboctave.analysis.response import ResponseEvaluation
from suboctave.analysis.starts import start_point
from suboctave.analysis.track import track
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.analysis.verbs import continue_branch
from suboctave.bifurcation import Bifurcation, Sample
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation import NewtonOptions
from suboctave.errors import ConvergenceError, InputError
from suboctave.interruption import pass_on
from suboctave.model.system import System

__all__ = ["SAME_OMEGA", "Loop", "Survey"]

#: frequencies that differ by less, relatively, are one
SAME_OMEGA = 1e-6
#: events that are closer, in units of the range, are met together
_TOGETHER = 1e-7
#: a limit point lies at most this many distances between neighbours away from the curve's chord
_BESIDE = 3.0
#: motions of a branch whose mirror images lead to another one, if there is any
_IMAGES = 12


@dataclass(frozen=True, eq=False)
class Loop:
    """A branch over omega at a value of the parameter, and the legs its limit points lie on.

    `detached`: whether it closes on itself, and so do all branches that it meets at branch points, and those that they
    meet: from none of them a sweep comes to it.
    """

    value: float
    branch: Branch
    legs: tuple[Leg, ...]
    detached: bool


@dataclass(eq=False)
class Survey:
    """Curves of limit points and period doublings of a system over a design parameter.

    system, name, bounds, omega
        What is looked at, `bounds` and `omega` ascending.
    harmonics, depth, options
        For the verbs that follow branches; `depth` as in `bifurcation_diagram`.
    most
        Curves after which no more are followed.
    curves, legs, doublings
        Curves of limit points over the parameter, their legs, curves of period doublings.
    met
        Branches that bifurcate from a response, or are one, by the value of the parameter.
    """

    system: System
    name: str
    bounds: tuple[float, float]
    omega: tuple[float, float]
    harmonics: Harmonics
    depth: int
    options: dict[str, Any]
    most: int
    curves: list[TrackedBranch] = field(default_factory=list)
    doublings: list[TrackedBranch] = field(default_factory=list)
    legs: list[Leg] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    met: dict[float, list[Branch]] = field(default_factory=dict)
    report: Callable[[float, str], None] | None = None
    _explained: set[tuple[float, int]] = field(default_factory=set)
    _lost: list[tuple[float, Bifurcation]] = field(default_factory=list)

    @property
    def span(self) -> float:
        """Width of the parameter's range."""
        return self.bounds[1] - self.bounds[0]

    def note(self, text: str) -> None:
        """Something that could not be settled, told once."""
        if text not in self.notes:
            self.notes.append(text)

    def say(self, share: float, where: str) -> None:
        """Tell whoever wants to know."""
        if self.report is not None:
            self.report(share, where)

    # ---------------------------------------------------------------------------------------------------- responses
    def look(self, value: float) -> None:
        """Follow responses at a value and what bifurcates from them; limit points and doublings over the parameter."""
        for branch, level in self._branches(value):
            if level < self.depth:
                for item in branch.bifurcations["PD"]:
                    self.doubling(item, value)
            self.attach(Loop(value, branch, self._legs_on(branch, value), False))

    def _branches(self, value: float) -> Iterator[tuple[Branch, int]]:
        """Branches at a value, and how many bifurcations lead to them from the response, which begins at both ends."""
        system = self.system.with_parameters({self.name: value})
        low, high = self.omega
        for ends in ((high, low), (low, high)):
            try:
                diagram = bifurcation_diagram(system, ends, self.depth, harmonics=self.harmonics, **self.options)
            except ConvergenceError as failure:
                self.note(f"at {self.name} = {value:.6g}: {failure}")
                continue
            pass_on(diagram.interruption)
            for node in diagram:
                yield node.branch, node.depth
                for item, why in node.failures:
                    self.note(f"at {self.name} = {value:.6g}, {item.kind} at omega = {item.omega:.6g}: {why}")
            root = diagram.root.branch
            yield from ((branch, 0) for branch in self._partners(diagram.branches, system))
            if len(diagram.responses) > 1 or (len(root) and root.points[-1].orbit.omega == ends[1]):
                return

    def _partners(self, branches: list[Branch], system: System) -> Iterator[Branch]:
        """Branches through motions beside the mirror images of others.

        What would be two halves of a loop between pitchforks, were the system symmetric, is taken apart by a small load
        that is not: the response runs over one half, and the other is found from its image.
        """
        low, high = self.omega
        known = list(branches)
        for branch in branches:
            for place in np.linspace(0, len(branch) - 1, min(_IMAGES, len(branch))).round().astype(int):
                orbit = branch.orbits[place]
                image = image_of(orbit)
                if not low <= orbit.omega <= high or relation(orbit, image).one:
                    continue
                curve = make_curve(system, "omega", orbit.omega, high - low, self.harmonics, branch.nu, None)
                try:
                    point = start_point(curve, orbit.omega, image.coefficients, NewtonOptions())
                    assert isinstance(point.evaluation, ResponseEvaluation)
                    found = orbit_of(Sample(point, point.evaluation.state))
                    if any(lies_on(found, other.points, images=True) for other in known):
                        continue
                    known.append(continue_branch(found, "omega", self.omega, **self.options))
                except ConvergenceError:
                    continue
                pass_on(known[-1].interruption)
                yield known[-1]

    # ------------------------------------------------------------------------------------------------- limit points
    def leg_of(self, item: Bifurcation, value: float) -> Leg | None:
        """The known leg that a limit point at a value of the parameter lies on."""
        for leg in self.legs:
            if leg.nu != item.orbit.basis.nu or not leg.contains(value):
                continue
            expected, reach = leg.omega_near(value)
            if abs(item.omega - expected) > _BESIDE * reach:
                continue
            try:
                there = leg.limit_point(value)
            except ConvergenceError:
                continue
            if _alike(there, item):
                return leg
        return None

    def known(self, item: Bifurcation, value: float) -> Leg | None:
        """The leg that a limit point lies on, after following it over the parameter if it is new; None if it fails."""
        leg = self.leg_of(item, value)
        if leg is not None or any(v == value and _beside(b, item) for v, b in self._lost):
            return leg
        curve = self._tracked(item, value)
        if curve is not None and not self._repeats(curve):
            self.curves.append(curve)
            self.legs += legs_of(curve, self.name)
            leg = self.leg_of(item, value)
        if leg is None:
            self._lost.append((value, item))
            if curve is not None:
                self.note(f"the limit point at omega = {item.omega:.6g}, {self.name} = {value:.6g} is not on its curve")
        return leg

    def _repeats(self, curve: TrackedBranch) -> bool:
        """Whether a curve is one that is known, met where the known one was not found again."""
        turns = [event for event in curve.bifurcations.met if isinstance(event, TrackedEvent) and event.isola]
        known = (e for c in self.curves if c.nu == curve.nu for e in c.bifurcations.met)
        return any(_alike(a, b) for b in known for a in turns)

    def doubling(self, item: Bifurcation, value: float) -> None:
        """Follow a period doubling over the parameter, unless its curve is known."""
        if any(lies_on(item.orbit, curve.tracked, self.name, images=True) for curve in self.doublings):
            return
        curve = self._tracked(item, value)
        if curve is not None:
            self.doublings.append(curve)

    def _tracked(self, item: Bifurcation, value: float) -> TrackedBranch | None:
        where = f"{item.kind} at omega = {item.omega:.6g}, {self.name} = {value:.6g}"
        if len(self.curves) + len(self.doublings) >= self.most:
            self.note(f"max_curves={self.most} curves were followed: the {where} and what lies beyond it were not")
            return None
        try:
            around = 0.5 * self.omega[0], 2.0 * self.omega[1]
            curve = track(item, self.name, self.bounds, omega=around, **self.options)
        except (ConvergenceError, InputError) as failure:
            self.note(f"the {where} could not be followed over {self.name}: {failure}")
            return None
        pass_on(curve.interruption)
        return curve

    # --------------------------------------------------------------------------------------------------------- loops
    def loop(self, leg: Leg, value: float) -> Loop | None:
        """The branch through a leg's limit point at a value; None where it cannot be followed."""
        try:
            found = leg.limit_point(value)
            same = [other for other in self.legs if other.curve is leg.curve]
            branch = closed_branch(found, self.omega, self.name, same, self.options)
        except ConvergenceError as failure:
            omega, _ = leg.omega_near(value)
            self.note(f"the branch at omega = {omega:.6g}, {self.name} = {value:.6g} could not be followed: {failure}")
            return None
        pass_on(branch.interruption)
        return self.loop_of(branch, value, leg)

    def loop_of(self, branch: Branch, value: float, *known: Leg) -> Loop:
        """A branch at a value, or the closed one that it hangs on, with the legs that its limit points lie on.

        `known` are legs of the given branch.
        """
        try:
            carrier = carrier_of(branch, self.met.get(value, ()), self.options)
        except (ConvergenceError, InputError) as failure:
            self.note(f"whether a closed branch at {self.name} = {value:.6g} is isolated is open: {failure}")
            carrier = None
        if carrier is None or carrier is branch:
            return Loop(value, branch, self._legs_on(branch, value, *known), carrier is branch)
        self._explained |= {(value, id(leg)) for leg in known}
        return Loop(value, carrier, self._legs_on(carrier, value), True)

    def _legs_on(self, branch: Branch, value: float, *known: Leg) -> tuple[Leg, ...]:
        """The legs that a branch's limit points lie on, each once, those that are known first."""
        found = (self.known(item, value) for item in branch.bifurcations["LP"])
        return tuple(dict.fromkeys([*known, *(leg for leg in found if leg is not None)]))

    def attach(self, loop: Loop) -> None:
        """A branch that is not detached: its limit points at that value are explained."""
        if not loop.detached:
            self.met.setdefault(loop.value, []).append(loop.branch)
            self._explained |= {(loop.value, id(leg)) for leg in loop.legs}

    def explained(self, leg: Leg, value: float) -> bool:
        """Whether a leg's limit point at a value lies on a branch that is not detached."""
        return (value, id(leg)) in self._explained

    # ------------------------------------------------------------------------------------------------ critical values
    def critical(self, nu: int, value: float, upper: bool) -> Iterator[tuple[float, list[TrackedEvent]]]:
        """Values ahead at which branches of motions of `nu` load periods may change, with what happens there."""
        events: list[TrackedEvent] = []
        for leg in self.legs:
            if leg.nu == nu:
                events += [end for end in leg.ends if end is not None]
        for curve in self.doublings:
            if 2 * curve.nu == nu:
                events += [e for e in curve.extrema if isinstance(e, TrackedEvent) and e.parameter_name == self.name]
        sign = 1.0 if upper else -1.0
        ahead = sorted(
            {id(e): e for e in events if sign * (e.parameter(self.name) - value) > _TOGETHER * self.span}.values(),
            key=lambda e: sign * e.parameter(self.name),
        )
        group: list[TrackedEvent] = []
        for event in ahead:
            if group and abs(event.parameter(self.name) - group[0].parameter(self.name)) > _TOGETHER * self.span:
                yield group[0].parameter(self.name), group
                group = []
            group.append(event)
        if group:
            yield group[0].parameter(self.name), group


def _beside(a: Bifurcation, b: Bifurcation) -> bool:
    return abs(a.omega - b.omega) <= SAME_OMEGA * b.omega


def _alike(a: Bifurcation, b: Bifurcation) -> bool:
    """Whether two limit points are one, or mirror images: what is true of the one is of the other."""
    return _beside(a, b) and relation(a.orbit, b.orbit) is not Relation.OTHER
