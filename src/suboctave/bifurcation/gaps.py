"""The gaps of a system's elements along a motion: where the relative displacement turns, how far from each gap, and the
contact that grazes.

A gap is a place u = b at which an element's law has a corner (a piece of a piecewise-linear law), or is sharp (a point
of `SharpSampling`). Elements that act along the same direction share one search for extrema.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.harmonic.aft.closed_form import corner_weights
from suboctave.harmonic.aft.general import GeneralLaw
from suboctave.harmonic.aft.law import LocalMotion
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.trigonometric import extrema
from suboctave.model.elements.base import BaseElement, Element
from suboctave.model.elements.coupled import CoupledElement, as_coupled, reads
from suboctave.model.elements.smoothness import CornerSampling, PiecewiseLinear, levels as levels_of


@dataclass(eq=False, slots=True)
class GapExtrema:
    """One gap and the extrema of the relative displacement there, ascending in tau.

    Index of the element, index of the gap among the element's, displacement of the gap (`level`); instants, values and
    second derivatives by tau of the extrema, shape (m,) each, m even, maxima and minima in turn.
    """

    element: int
    index: int
    level: float
    tau: Array
    value: Array
    curve: Array


def gap_extrema(state: BalanceState) -> tuple[GapExtrema, ...]:
    """Every gap of every element on a motion."""
    grid = state.balance.grid
    gaps = []
    for own, motion in zip(state.laws.levels, state.motions, strict=True):
        if own:
            turns = extrema(motion, *grid)
            gaps += [GapExtrema(element, place, level, *turns) for element, place, level in own]
    for channel in state.own_channels:
        for _, member in channel.members():
            places = levels_of(member.kind, member.coefficients)
            if places:
                turns = extrema(channel.along.motion, *grid)
                gaps += [GapExtrema(member.number, place, level, *turns) for place, level in enumerate(places)]
    return tuple(gaps)


def crossing_speeds(state: BalanceState) -> Array:
    """Moduli of du/dtau where a motion crosses the gaps of piecewise-linear laws."""
    packed, slownesses = state.packed, [np.zeros(0)]
    for motion, first, last in zip(state.motions, packed.first, packed.first[1:], strict=False):
        # of unit stiffness, on the side above, so that the weight is the inverse speed
        unit = packed.pieces[first:last] * [0.0, 1.0, 0.0] + [1.0, 0.0, 1.0]
        slownesses.append(corner_weights(motion, unit, *state.balance.grid)[2])
    return 1.0 / np.concatenate(slownesses)


def levels(local: LocalMotion) -> tuple[float, ...]:
    """Displacements at which an element's law has a corner, or is sharp."""
    return levels_of(local.kind, local.coefficients)


def level_rate(state: BalanceState, element: int, index: int, name: str) -> float:
    """Derivative of a gap by "omega" or a parameter."""
    if name == "omega":
        return 0.0
    local = state.local(element)
    rates = local.element.parameter_rates(state.values, {name: 1.0})
    if not rates.any():
        return 0.0
    kind = local.kind
    if isinstance(kind, PiecewiseLinear):
        return float(rates[kind.pieces[index].gap])
    by_coefficient = local.element.level_rates(local.coefficients)
    return float(by_coefficient[index] @ rates) if index < len(by_coefficient) else 0.0


def contact_side(local: LocalMotion, index: int) -> int:
    """+1 where the element is in contact above its gap, -1 below it: the side on which it is stiffer."""
    kind = local.kind
    if isinstance(kind, PiecewiseLinear):
        piece = kind.pieces[index]
        return piece.side if local.coefficients[piece.stiffness] >= 0.0 else -piece.side
    level = levels(local)[index]
    if isinstance(kind, CornerSampling):
        # the side on which the force is stiffer, all other states at rest
        law, near = as_coupled(local.element), 1e-3 * (float(np.abs(local.motion).max()) or 1.0)
        q = np.zeros((2 * law.count if local.element.depends_on_velocity else law.count, 2))
        q[0] = level - near, level + near
        below, above = law.tangent(q, np.zeros(2), local.coefficients)[1][0]
        return -1 if _along(local.element) * (above - below) < 0.0 else 1
    assert isinstance(local.element, Element)
    bend = local.element.curvature(np.array([level]), np.zeros(1), local.coefficients)[0]
    return -1 if float(bend[0]) < 0.0 else 1


def stiffness_jump(state: BalanceState, element: int, index: int, tau: float) -> float:
    """By how much the stiffness along what an element reads jumps where the motion reaches a gap at an instant; 0 where
    it does not (a rounded corner, powers of a half).
    """
    local = state.local(element)
    kind = local.kind
    if isinstance(kind, PiecewiseLinear):
        return float(local.coefficients[kind.pieces[index].stiffness]) * kind.pieces[index].side
    if not isinstance(kind, CornerSampling) or kind.rough:
        return 0.0
    members = (pair for channel in state.own_channels for pair in channel.members())
    law = next(law for law, member in members if member.number == element)
    assert isinstance(law, GeneralLaw)
    there = law.state_at(np.cos([tau]), np.sin([tau]))
    return float(law.jump(law.corners[index], *there)[0])


def _along(element: BaseElement) -> float:
    """Whether an element acts along the displacement that it reads, or against it."""
    if not isinstance(element, CoupledElement):
        return 1.0
    places = (element.place, *element.input_places)
    n = max(len(place.vector) if place.vector is not None else 1 + max(place.dofs) for place in places)
    return float(element.direction(n) @ reads(element, n)) or 1.0


def rests_in_corner(state: BalanceState) -> bool:
    """Whether the stiffness or damping of an element jumps at rest, u = v = 0."""
    if np.any(state.packed.pieces[:, 1] == 0.0):
        return True
    for channel in state.own_channels:
        ((_, member),) = channel.members()
        kind, law = member.kind, as_coupled(member.element)
        if not isinstance(kind, CornerSampling):
            continue
        for row, levels_there in ((0, kind.points), (channel.count, kind.velocities)):
            if 0.0 in levels_there:
                q = np.zeros((channel.along.size, 2))
                q[row] = -1e-12, 1e-12
                below, above = law.tangent(q, np.full(2, 0.7), member.coefficients)[1][row]
                if abs(above - below) > 1e-9 * max(abs(above), abs(below)):
                    return True
    return False


#: what happens along a curve, and what happens the other way round
_BACKWARDS = {"begins to touch": "ceases to touch", "begins to lift off": "ceases to lift off"}
_BACKWARDS |= {there: here for here, there in _BACKWARDS.items()}


@dataclass(frozen=True)
class GrazingContact:
    """A gap that a local extremum of an element's relative displacement just reaches.

    Attributes
    ----------
    element, label
        Index of the element in the system's list, and how messages name it.
    gap
        Displacement at which the element's law has its corner (unit of length).
    time
        Instant in the motion's period, 0 <= time < T.
    change
        What happens as the curve is followed on: a contact "begins to touch" or "ceases to touch" (an extremum that
        comes from outside), or "begins to lift off", "ceases to lift off" (one inside a contact). Empty where the
        contact belongs to a bifurcation beside the grazing.
    parameter
        Value of the free parameter at which it grazes.
    distance
        Way along the curve from the grazing to the bifurcation that it belongs to, in scaled arclength; 0 for the
        grazing itself.
    """

    element: int
    label: str
    gap: float
    time: float
    change: str
    parameter: float
    distance: float = 0.0

    def backwards(self) -> GrazingContact:
        """The same on a curve followed the other way."""
        return replace(self, change=_BACKWARDS.get(self.change, self.change))

    def __str__(self) -> str:
        return f"{self.label} {self.change}".strip()


def read_direction(state: BalanceState, element: int) -> Array:
    """The displacement that an element's gaps are places of, in the unknown DOFs."""
    system = state.balance.system
    return state.linear.retain(reads(system.elements[element], system.n))


def basis_rows(high: int, tau: float) -> tuple[Array, Array, Array]:
    """Basis functions at an instant and their first two derivatives by tau, shape (2 H + 1,) each."""
    k = np.arange(1.0, high + 1.0)
    c, s = np.cos(k * tau), np.sin(k * tau)
    value, slope, curve = np.zeros((3, 2 * high + 1))
    value[0], value[1::2], value[2::2] = 1.0, c, s
    slope[1::2], slope[2::2] = -k * s, k * c
    curve[1::2], curve[2::2] = -(k**2) * c, -(k**2) * s
    return value, slope, curve
