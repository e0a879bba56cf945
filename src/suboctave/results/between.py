"""A computed curve between its points: solved again where a function of its motions vanishes.

The points of a curve and what was located on it are nodes, in the order of the curve. Between two nodes the curve is
followed as when it was computed: by its equations and the plane across the chord (`continuation.events.Bracket`), so
that a limit point between two points, which is a node, hides nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.bifurcation.gaps import GrazingContact, gap_extrema, height_at
from suboctave.continuation.events import Bracket
from suboctave.continuation.linear import cosine, length, one_thread
from suboctave.continuation.march import SteppingOptions
from suboctave.continuation.newton import NewtonOptions, closely, correct, null_row
from suboctave.continuation.point import CurvePoint, make_point
from suboctave.continuation.problem import Array
from suboctave.curves.blow_up import DoubledMotions
from suboctave.curves.kinds.nonlinear_mode import NonlinearMode
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.trace import BranchPoint, Settings, TrackedPoint
from suboctave.curves.tracked.start import solved_start
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.methods import StabilityMethod, method_of
from suboctave.harmonic.orbit import PeriodicOrbit

#: relative difference of two values of a parameter that is rounding
_SAME = 1e-12
#: share of the way between two nodes to which a zero is located
_RESOLVED = 1e-12
#: half the way in scaled arclength over which a change along the curve is taken
_BESIDE = 1e-5
#: farthest that the point at a value may lie from where the curve passes it, in scaled arclength
_MOVED = 1e-4

Measure = Callable[[PeriodicOrbit], float]


@dataclass(eq=False)
class Node:
    """A place of a curve that is known: a point, or something located on it."""

    item: Any
    index: int

    @property
    def orbit(self) -> PeriodicOrbit:
        """The motion there."""
        orbit: PeriodicOrbit = self.item.orbit
        return orbit

    @property
    def arclength(self) -> float:
        """Its place."""
        return float(self.item.arclength)


class Between:
    """A curve with what is needed to solve for its points again."""

    def __init__(self, curve: Any) -> None:
        self.curve = curve
        self.names: tuple[str, ...] = getattr(curve, "names", (curve.name,))
        self.tracked = hasattr(curve, "kind")
        known = curve.options.get("newton")
        self.newton = NewtonOptions(**known) if isinstance(known, Mapping) else NewtonOptions()
        self.method = _method(curve.options.get("stability"))
        met: list[Any] = [*curve.points, *self._located()]
        # what is located at a point stands for it only where it is no point itself
        met.sort(key=lambda item: (item.arclength, isinstance(item, Bifurcation)))
        self.nodes = [Node(item, i) for i, item in enumerate(met)]
        self._solved: dict[int, CurvePoint] = {}

    def _located(self) -> list[Bifurcation]:
        """What was located with a motion that its equations can be solved at: turns in any case."""
        met = [*self.curve.bifurcations.met, *self.curve.events.met]
        return [item for item in met if item.kind in ("extremum", "CP")] if self.tracked else met

    # ------------------------------------------------------------------------------------------------------- points
    def point_at(self, node: Node) -> CurvePoint:
        """A node as a point of the curve's equations; may raise ConvergenceError."""
        if node.index not in self._solved:
            solved = self._singled(node) if self.tracked else self._response(node)
            self._solved[node.index] = replace(solved, arclength=node.arclength)
        return self._solved[node.index]

    def _response(self, node: Node) -> CurvePoint:
        orbit, name = node.orbit, self.curve.name
        kind = MotionProblem if orbit.basis.nu % 2 else DoubledMotions
        held = {n: v for n, v in orbit.values.items() if n != name and v != orbit.balance.values[n]}
        problem = kind(orbit.balance, (name,), (self._span(name),), orbit.omega, held=held)
        u = problem.join(orbit.x, orbit.omega if name == "omega" else orbit.values[name])
        weights = problem.weights(u, 0.0)
        return make_point(correct(problem, u, null_row(problem, u, weights), weights, self.newton), None, 0.0)

    def _singled(self, node: Node) -> CurvePoint:
        item = self._as_located(self._as_point(node.item) if isinstance(node.item, Bifurcation) else node.item)
        bounds = self.curve.options.get("bounds", {})
        ranges = {n: (min(bounds[n]), max(bounds[n])) for n in self.names if n in bounds}
        settings = Settings(self.newton, SteppingOptions(), self.method)
        return solved_start(item, node.orbit.basis, None, self.names, ranges, settings)

    def _as_point(self, event: Bifurcation) -> TrackedPoint:
        """An extremum along the curve as one of its points."""
        time = 0.0 if event.contact is None else event.contact.time * event.orbit.omega / event.orbit.basis.nu
        extra = time if self.curve.kind == "grazing" else event.kappa
        return TrackedPoint(event.orbit, event.floquet, event.arclength, 0, self.method, extra)

    def _as_located(self, point: TrackedPoint) -> Bifurcation:
        """A point of a curve of bifurcations, or of motions singled out, as something that such a curve begins at."""
        curve: Any = self.curve
        kind, turning, options = curve.kind, curve.turning, curve.options
        size = math.nan
        kappa = point.extra if kind in ("NS", "Hopf") else 0.0
        context = {**options, "parameter": curve.name, "observe": curve.observe}
        given: dict[str, Any] = {"kappa": kappa, "arclength": point.arclength, "context": context}
        given["multiplicity"] = int(options.get("multiplicity", 1))
        known: Any = point.floquet if kappa == 0.0 and kind in ("NS", "Hopf") else point.known
        head = point.orbit, known, point.orbit.residual, size
        if kind == "grazing":
            given["contact"] = _contact(point)
        of_mode = "damped" in options and kind != NonlinearMode.name
        if turning or of_mode:
            family, names = NonlinearMode.name if of_mode else kind, self.names[:-1]
            item = "extremum" if turning else kind
            return TrackedEvent(
                item, *head, turning or curve.name, **given, curve=family, names=names,
                extreme=point.extreme or "minimum",
            )  # fmt: skip
        return Bifurcation(kind, *head, curve.name, **given)

    def _span(self, name: str) -> float:
        """Width of the range of a parameter, or of its values."""
        bounds = self.curve.options.get("bounds", {}).get(name)
        values = self.curve.parameter(name) if bounds is None else np.array(bounds)
        return float(np.ptp(values)) or abs(float(values[0])) or 1.0

    # ------------------------------------------------------------------------------------------------------- search
    def bracket(self, a: Node | CurvePoint, b: Node | CurvePoint, function: Callable[[CurvePoint], float]) -> Bracket:
        """A function along the curve between two places of it; may raise ConvergenceError."""
        first, last = (self.point_at(one) if isinstance(one, Node) else one for one in (a, b))
        chord = last.u - last.curve.transfer(first.u, first.curve)
        if cosine(chord, last.tangent, last.weights) < 0.0:
            last = last.turned
        back = first.curve.transfer(chord, last.curve)
        if cosine(back, first.tangent, first.weights) < 0.0:
            first = first.turned
        return Bracket(first, last, (function(first), function(last)), function, self.newton)

    def zero(self, bracket: Bracket) -> CurvePoint:
        """The point at which the function of a bracket vanishes; may raise ConvergenceError."""
        share = bracket.zero(_RESOLVED)
        bracket.value(share)
        return bracket.points[share]

    def places(self, name: str, value: float) -> list[BranchPoint]:
        """The points at which a parameter has a value, in the order of the curve; may raise ConvergenceError."""
        nodes, found = self.nodes, []
        off = np.array([value_of(node.orbit, name) - value for node in nodes])
        off[np.abs(off) <= _SAME * max(abs(value), self._span(name))] = 0.0
        # the first point of a closed curve comes after the last one, which is the same
        before = np.concatenate([off[-1:] if self.curve.closed else [math.inf], off[:-1]])
        if not off.any():
            before[0] = math.inf
        with one_thread():
            for i, node in enumerate(nodes):
                if off[i] == 0.0 and before[i] != 0.0:
                    known = isinstance(node.item, BranchPoint)
                    found.append(node.item if known else self.as_branch_point(self.point_at(node)))
                if i + 1 < len(nodes) and off[i] * off[i + 1] < 0.0:
                    found.append(self._where(node, nodes[i + 1], name, value))
        return found

    def _where(self, a: Node, b: Node, name: str, value: float) -> BranchPoint:
        point = self.zero(self.bracket(a, b, lambda p: value_at(p, name) - value))
        problem = point.curve
        assert isinstance(problem, MotionProblem)
        # exactly there, where the curve does not stand still
        u, at = point.u.copy(), problem.index(name)
        u[at] = value
        try:
            exact = correct(problem, u, at, point.weights, closely(self.newton))
        except ConvergenceError:
            return self.as_branch_point(point)
        if length(point.weights * (exact.u - point.u)) > _MOVED:
            return self.as_branch_point(point)
        return self.as_branch_point(make_point(exact, point.tangent, point.arclength))

    def as_branch_point(self, point: CurvePoint) -> BranchPoint:
        """A solved point as curves keep them."""
        sample = Sample(point, self.method)
        if not self.tracked:
            return BranchPoint(sample.orbit, None, point.arclength, point.iterations, self.method)
        none = sample.curve.augmentation.no_multipliers
        extra = sample.instant_or_frequency, sample.coefficient, sample.extreme, sample.isola
        known = sample.evaluation.floquet if none else None
        return TrackedPoint(sample.orbit, known, point.arclength, point.iterations, self.method, *extra)

    def change(self, point: CurvePoint, measure: Measure) -> float:
        """Change of a measure of the motion along the curve, by scaled arclength."""
        step = _BESIDE * point.tangent / length(point.weights * point.tangent)
        ahead, behind = (measure(orbit_at(point, point.u + side * step)) for side in (1.0, -1.0))
        return (ahead - behind) / (2.0 * _BESIDE)


def orbit_at(point: CurvePoint, u: Array) -> PeriodicOrbit:
    """The motion of unknowns u in the discretisation of a point."""
    problem = point.curve
    assert isinstance(problem, MotionProblem)
    x, omega, values = problem.split(u)
    extra = problem.extra(u)
    return PeriodicOrbit(problem.balance, x, omega, dict(values), 0.0, zeta=problem.zeta(extra))


def value_of(orbit: PeriodicOrbit, name: str) -> float:
    """omega or a parameter of a motion."""
    return orbit.omega if name == "omega" else orbit.values[name]


def value_at(point: CurvePoint, name: str) -> float:
    """omega or a parameter at a point of the equations, where it is free."""
    problem = point.curve
    assert isinstance(problem, MotionProblem)
    return float(point.u[problem.index(name)])


def _method(given: Any) -> StabilityMethod:
    """The method that a curve's multipliers come from; the default where it had options, which are not kept."""
    try:
        return method_of(given)
    except InputError:
        return method_of(None)


def _contact(point: TrackedPoint) -> GrazingContact:
    """The contact that grazes at a point of a curve of grazings: the one that is nearest to its gap at that instant."""
    state = point.orbit.state()
    gap = min(gap_extrema(state), key=lambda g: abs(height_at(state, g.element, g.index, point.extra).height))
    label = state.local(gap.element).element.label
    return GrazingContact(gap.element, label, gap.level, point.extra / state.rate, "", point.orbit.omega)
