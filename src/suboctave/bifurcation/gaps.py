"""The gaps of a system's elements along a motion: where the relative displacement turns, how far from each gap, and the
contact that grazes.

A gap is a place u = b at which an element's law has a corner (a piece of a piecewise-linear law), or is sharp (a point
of `SharpSampling`), or a surface phi = 0 of all that the law reads (`harmonic.aft.corners`): phi is then the relative
displacement, and its gap 0. Elements that act along the same direction share one search for extrema.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from suboctave.harmonic.aft.channel import Channel
from suboctave.harmonic.aft.closed_form import corner_weights
from suboctave.harmonic.aft.corners import Corner, gaps_of, jump, rates_of_state, surface_at
from suboctave.harmonic.aft.general import GeneralLaw
from suboctave.harmonic.aft.law import LocalMotion, Member
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.quadrature import search_grid
from suboctave.harmonic.trigonometric import extrema, motion
from suboctave.model.elements.base import BaseElement, Element
from suboctave.model.elements.coupled import CoupledElement, as_coupled, reads
from suboctave.model.elements.smoothness import CornerSampling, PiecewiseLinear, levels as levels_of

#: step in tau by which the rate of a surface's function, and of its derivatives by coefficients, is told
_BESIDE = 1e-5


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
    for own, series in zip(state.laws.levels, state.motions, strict=True):
        if own:
            turns = extrema(series, *grid)
            gaps += [GapExtrema(element, place, level, *turns) for element, place, level in own]
    known: set[Hashable] = set()
    for channel in state.own_channels:
        for law, member in channel.members():
            if isinstance(law, GeneralLaw) and isinstance(member.kind, CornerSampling):
                gaps += _at_corners(law, member, channel.ins.tobytes(), known)
            elif places := levels_of(member.kind, member.coefficients):
                turns = extrema(channel.along.motion, *grid)
                gaps += [GapExtrema(member.number, place, level, *turns) for place, level in enumerate(places)]
    return tuple(gaps)


def _at_corners(law: GeneralLaw, member: Member, reads: bytes, known: set[Hashable]) -> list[GapExtrema]:
    """The gaps of a law with corners, but for surfaces that another element has as well: a ring around a shaft."""
    found: list[GapExtrema] = []
    for index, corner in enumerate(gaps_of(law)):
        if corner.row:
            own = as_coupled(member.element).surface_key(corner.row - law.along.size, member.coefficients)
            key = None if own is None else (reads, own)
            if key in known:
                continue
            known |= set() if key is None else {key}
        found.append(GapExtrema(member.number, index, corner.level, *corner.turns))
    return found


def crossing_speeds(state: BalanceState) -> Array:
    """Moduli of du/dtau where a motion crosses the gaps of piecewise-linear laws."""
    packed, slownesses = state.packed, [np.zeros(0)]
    for series, first, last in zip(state.motions, packed.first, packed.first[1:], strict=False):
        # of unit stiffness, on the side above, so that the weight is the inverse speed
        unit = packed.pieces[first:last] * [0.0, 1.0, 0.0] + [1.0, 0.0, 1.0]
        slownesses.append(corner_weights(series, unit, *state.balance.grid)[2])
    return 1.0 / np.concatenate(slownesses)


def levels(local: LocalMotion) -> tuple[float, ...]:
    """Displacements at which an element's law has a corner, or is sharp."""
    return levels_of(local.kind, local.coefficients)


def level_of(local: LocalMotion, index: int) -> float:
    """The displacement of a gap, 0 of a surface."""
    places = levels(local)
    return places[index] if index < len(places) else 0.0


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
    return float(np.nan_to_num(by_coefficient[index][0]) @ rates) if index < len(by_coefficient) else 0.0


class Height(NamedTuple):
    """How far a relative displacement lies above its gap at an instant, and how fast it and its rate by tau move.

    height, slope, curve
        u - gap, and its first two derivatives by tau; of a height that stays as it is along the motion its mean, and 0.
    by_x, slope_by_x
        Derivatives of the first two by the coefficients, (2 H + 1, size).
    by_names, slope_by_names
        And by "omega" or parameters.
    """

    height: float
    slope: float
    curve: float
    by_x: Array
    slope_by_x: Array
    by_names: Array
    slope_by_names: Array


def height_at(state: BalanceState, element: int, index: int, tau: float, names: Sequence[str] = ()) -> Height:
    """The height of an element over one of its gaps at an instant."""
    if (surface := _surface_of(state, element, index)) is not None:
        if not surface[2].everywhere:
            return _over_surface(state, element, *surface, tau, names)
        every = [_over_surface(state, element, *surface, at, names) for at in search_grid(state.basis.harmonics).tau]
        height, _, _, by_x, _, by_names, _ = (sum(part) / len(every) for part in zip(*every, strict=True))
        return Height(float(height), 0.0, 0.0, by_x, np.zeros_like(by_x), by_names, np.zeros(len(names)))
    rows = basis_rows(state.basis.harmonics, tau)
    direction = read_direction(state, element)
    u = state.x @ direction
    height, slope, curve = (float(row @ u) for row in rows)
    gap = np.array([-level_rate(state, element, index, name) for name in names])
    by_x, slope_by_x = (np.multiply.outer(row, direction) for row in rows[:2])
    height -= level_of(state.local(element), index)
    return Height(height, slope, curve, by_x, slope_by_x, gap, np.zeros(len(names)))


def _surface_of(state: BalanceState, element: int, index: int) -> tuple[Channel, GeneralLaw, Corner] | None:
    """The channel, the law and the corner of a gap that is a surface, None if it is a displacement."""
    for channel in state.own_channels:
        for law, member in channel.members():
            if member.number == element and isinstance(law, GeneralLaw) and isinstance(member.kind, CornerSampling):
                corner = gaps_of(law)[index]
                return (channel, law, corner) if corner.row else None
    return None


def _over_surface(
    state: BalanceState, element: int, channel: Channel, law: GeneralLaw, corner: Corner, tau: float,
    names: Sequence[str],
) -> Height:  # fmt: skip
    """The value of a surface's function at an instant."""
    rows = basis_rows(state.basis.harmonics, tau)
    zr, zi = np.cos([tau]), np.sin([tau])
    q, theta = law.state_at(zr, zi)
    here, rates, nu = surface_at(law, corner, q, theta), rates_of_state(law, zr, zi)[:, 0], law.along.nu
    normal = here.normal[:, 0]
    turning = here.bend[:, :, 0] @ rates + nu * here.normal_by_phase[:, 0]
    by_x, slope_by_x = np.zeros((2, len(rows[0]), channel.ins.shape[1]))
    for r, direction in enumerate(channel.ins):
        by_x += np.multiply.outer(normal[r] * rows[0], direction)
        slope_by_x += np.multiply.outer(turning[r] * rows[0] + normal[r] * rows[1], direction)
        if law.moving:
            i, rate = r + law.count, law.along.rate
            by_x += np.multiply.outer(rate * normal[i] * rows[1], direction)
            slope_by_x += np.multiply.outer(rate * (turning[i] * rows[1] + normal[i] * rows[2]), direction)
    local = state.local(element).element
    moves = [np.zeros(len(law.c)) if n == "omega" else local.parameter_rates(state.values, {n: 1.0}) for n in names]
    beside = []
    for side in (_BESIDE, -_BESIDE):
        at = np.cos([tau + side]), np.sin([tau + side])
        there = surface_at(law, corner, *law.state_at(*at))
        rate = there.normal[:, 0] @ rates_of_state(law, *at)[:, 0] + nu * there.by_phase[0]
        beside.append(np.append(there.by_coefficients[:, 0], rate))
    change = (beside[0] - beside[1]) / (2.0 * _BESIDE)
    by_names = np.array([here.by_coefficients[:, 0] @ move for move in moves])
    slope_by_names = np.array([change[:-1] @ move for move in moves])
    if law.moving and "omega" in names:
        # velocities are in proportion to it
        k, fast = list(names).index("omega"), slice(law.count, None)
        by_names[k] += normal[fast] @ q[fast, 0] / state.omega
        slope_by_names[k] += (turning[fast] @ q[fast, 0] + normal[fast] @ rates[fast]) / state.omega
    slope = float(normal @ rates + nu * here.by_phase[0])
    return Height(float(here.value[0]), slope, float(change[-1]), by_x, slope_by_x, by_names, slope_by_names)


def contact_side(local: LocalMotion, index: int) -> int:
    """+1 where the element is in contact above its gap, -1 below it: the side on which it is stiffer."""
    kind = local.kind
    if isinstance(kind, PiecewiseLinear):
        piece = kind.pieces[index]
        return piece.side if local.coefficients[piece.stiffness] >= 0.0 else -piece.side
    if isinstance(kind, CornerSampling) and index >= len(kind.points):
        return 1 if _stiffer_beyond(local, index - len(kind.points)) else -1
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


def _stiffer_beyond(local: LocalMotion, which: int) -> bool:
    """Whether a law is stiffer where the function of a surface is positive: where the motion comes closest to it."""
    law = as_coupled(local.element)
    grid = search_grid(len(local.motion) - 1)
    values = [motion(one, grid.zr, grid.zi) for one in local.motions]
    q = np.array([u for u, _ in values] + [0.0 * v for _, v in values if local.element.depends_on_velocity])
    theta = np.zeros(len(grid.zr))
    here = law.surface(which, q, theta, local.coefficients)
    way = here.normal / np.maximum((here.normal**2).sum(axis=0), np.finfo(float).tiny)
    near = 1e-3 * (float(np.abs(here.value).max()) or 1.0)
    above, below = (
        float(np.abs(law.tangent(q + (side * near - here.value) * way, theta, local.coefficients)[1]).sum())
        for side in (1.0, -1.0)
    )
    return above >= below


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
    return float(jump(law, gaps_of(law)[index], *there)[0])


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
    first: Array = state.balance.group_of[element].inputs[0]
    return first


def basis_rows(high: int, tau: float) -> tuple[Array, Array, Array]:
    """Basis functions at an instant and their first two derivatives by tau, shape (2 H + 1,) each."""
    k = np.arange(1.0, high + 1.0)
    c, s = np.cos(k * tau), np.sin(k * tau)
    value, slope, curve = np.zeros((3, 2 * high + 1))
    value[0], value[1::2], value[2::2] = 1.0, c, s
    slope[1::2], slope[2::2] = -k * s, k * c
    curve[1::2], curve[2::2] = -(k**2) * c, -(k**2) * s
    return value, slope, curve
