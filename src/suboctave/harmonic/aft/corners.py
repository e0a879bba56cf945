"""Corners of a law along a motion: where a function phi of all that it reads vanishes, a displacement or a velocity
less its level, or another (`model.elements.smoothness.Surface`).

Beside a corner the force is `f_0(q) + phi eta(q) H(phi)`, with n = phi_q and B = phi_qq. Its jumps there are

    [f_a] = eta n_a,    [f_ab] = eta B_ab + n_a eta_b + n_b eta_a,

and its derivatives hold

    f_ab = ... + eta n_a n_b delta(phi),
    f_abc = ... + (eta (B_ab n_c + B_ac n_b + B_bc n_a) + eta_a n_b n_c + n_a eta_b n_c + n_a n_b eta_c) delta(phi)
            + eta n_a n_b n_c delta'(phi).

Along a motion `int delta(phi) g dtau` is the sum of `g / |phi'|` at the instants at which it reaches the corner, primes
for derivatives by tau; for delta' see `law`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from suboctave.harmonic.aft.law import Along, Third
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import GAUSS, Nodes, search_grid
from suboctave.harmonic.trigonometric import crossings_of, extrema, motion
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.smoothness import CornerSampling, Sampling, Surface

#: how far on either side of a corner its jump is looked at, in units of phi along the motion
BESIDE = 1e-9
#: step in the phase of the load by which the jump of a slope is differentiated
_PHASE = 1e-3
#: distance from a rough corner, in the same units, at which the strength of its singularity is looked at
_NEAR = 1e-6
#: step in tau by which the second derivative of a surface's function is told; secants towards its zeros and extrema,
#: and how far the last may move these
_STEP, _SECANTS, _CLOSE, _ABOUT = 1e-5, 40, 1e-12, 1e-8
#: change of a surface's function along a motion, relative to its terms, that is rounding, and the curvature of what
#: does not turn at all
_ROUNDING, FLAT = 1e-13, float(np.finfo(float).tiny)


class Corner(NamedTuple):
    """A corner of a law along a motion.

    number, row
        Its number, points first, then velocities and surfaces; the row of q that has it at `level`, or as many as there
        are rows and the number of its surface.
    level, size
        And about the largest value of the displacement, the velocity or phi along the motion.
    at, rate, second
        The instants at which the motion reaches it, and the first two derivatives of phi by tau there, (N,).
    turns
        The extrema of phi, its level included: tau, value, second derivative, (3, m).
    """

    number: int
    row: int
    level: float
    size: float
    at: Array
    rate: Array
    second: Array
    turns: Array

    @property
    def everywhere(self) -> bool:
        """Whether phi stays as it is along the motion, so that the corner is reached everywhere at once."""
        return bool((self.turns[2, :1] == -FLAT).any())


class Comb(NamedTuple):
    """Dirac functions at a corner: the instants, what phi does there, and the weights `eta / |phi'|`."""

    corner: Corner
    zr: Array
    zi: Array
    surface: Surface
    weights: Array


class Cornered(Protocol):
    """A law along a motion, see `general.GeneralLaw`."""

    along: Along
    element: BaseElement
    kind: Sampling
    c: Array
    count: int
    moving: bool
    harmonic: int

    @property
    def rough(self) -> bool: ...
    @property
    def velocity(self) -> ComplexArray: ...
    @property
    def corners(self) -> list[Corner]: ...
    @property
    def nodes(self) -> Nodes: ...
    def state_at(self, zr: Array, zi: Array) -> tuple[Array, Array]: ...
    def surface(self, which: int, q: Array, theta: Array) -> Surface: ...
    def surface_slopes(self, which: int, q: Array, theta: Array) -> tuple[Array, Array, Array]: ...
    def tangent(self, q: Array, theta: Array) -> tuple[Array, Array]: ...
    def by_state_and_coefficients(self, q: Array, theta: Array) -> Array: ...
    def curvature(self, q: Array, theta: Array) -> Array: ...
    def third_derivative(self, q: Array, theta: Array) -> Array: ...


def corners_along(law: Cornered) -> list[Corner]:
    """Every corner of a law along its motion."""
    kind, along = law.kind, law.along
    if not isinstance(kind, CornerSampling):
        return []
    found: list[Corner] = []
    for row, series, levels in ((0, along.motion, kind.points), (law.count, law.velocity, kind.velocities)):
        grid = search_grid(along.high)
        turns = extrema(series, grid.zr, grid.zi)
        for level in levels:
            # a velocity that is zero throughout rests in its corner
            at = crossings_of(series, float(level), turns)[0] if series[1:].any() else np.zeros(0)
            zr, zi = np.cos(at), np.sin(at)
            size = float(np.abs(series).sum()) or 1.0
            rate, second = motion(series, zr, zi)[1], _second_rate(series, zr, zi)
            found.append(Corner(len(found), row, float(level), size, at, rate, second, turns))
    return found + [_at_surface(law, which, len(found) + which) for which in range(kind.surfaces)]


def _at_surface(law: Cornered, which: int, number: int) -> Corner:
    """Where the function of a surface turns along the motion, and vanishes."""

    def value(tau: Array) -> Array:
        return law.surface_slopes(which, *law.state_at(np.cos(tau), np.sin(tau)))[0]

    def rate(tau: Array) -> Array:
        zr, zi = np.cos(tau), np.sin(tau)
        _, normal, by_phase = law.surface_slopes(which, *law.state_at(zr, zi))
        result: Array = (normal * rates_of_state(law, zr, zi)).sum(axis=0) + law.along.nu * by_phase
        return result

    def second(tau: Array) -> Array:
        return (rate(tau + _STEP) - rate(tau - _STEP)) / (2.0 * _STEP)

    tau = search_grid(2 * law.along.high).tau
    slopes, heights = rate(tau), value(tau)
    size = float(np.abs(heights).max()) or 1.0
    q, theta = law.state_at(np.cos(tau), np.sin(tau))
    terms = float(np.abs(q * law.surface_slopes(which, q, theta)[1]).sum(axis=0).max())
    if np.ptp(heights) <= _ROUNDING * max(size, terms):
        # it stays as it is along the motion, as the radius of a circle does: a maximum and a minimum of no curvature
        none, flat = np.zeros(0), np.array([[0.0, math.pi], 2 * [float(heights.mean())], [-FLAT, FLAT]])
        return Corner(number, law.along.size + which, 0.0, size, none, none, none, flat)
    here = np.flatnonzero((slopes > 0.0) != (np.roll(slopes, -1) > 0.0))
    turns = _zeros(rate, tau[here], tau[here] + tau[1] - tau[0], _ABOUT)
    heights = value(turns)
    there = np.flatnonzero((heights > 0.0) != (np.roll(heights, -1) > 0.0))
    last = np.roll(turns, -1)[there]
    at = _zeros(value, turns[there], np.where(last < turns[there], last + 2.0 * math.pi, last), _CLOSE)
    extremes = np.array([turns, heights, second(turns)])
    return Corner(number, law.along.size + which, 0.0, size, at, rate(at), second(at), extremes)


def _zeros(function: Callable[[Array], Array], low: Array, high: Array, close: float) -> Array:
    """The zeros of a function between instants at which it differs in sign, many at once: by secants that halve the
    value at an end that stays (the Illinois method), until they move by less than `close`.
    """
    if not len(low):
        return low
    at, values = np.array([low, high]), np.array([function(low), function(high)])
    root, before = low, np.zeros(len(low), dtype=bool)
    for turn in range(_SECANTS):
        apart = values[1] - values[0]
        share = np.where(apart == 0.0, 0.5, -values[0] / np.where(apart == 0.0, 1.0, apart))
        previous, root = root, at[0] + share * (at[1] - at[0])
        if np.abs(root - previous).max() < close:
            break
        here = function(root)
        left = (here > 0.0) == (values[0] > 0.0)
        # an end that stays twice
        again = 0.5 if turn else 1.0
        stays = np.where(left == before, again, 1.0) * values
        values, at, before = np.where([left, ~left], here, stays), np.where([left, ~left], root, at), left
    return root


def gaps_of(law: Cornered) -> list[Corner]:
    """The corners at which a contact may begin: those at displacements and at surfaces."""
    return [corner for corner in law.corners if corner.row == 0 or corner.row >= law.along.size]


def surface_at(law: Cornered, corner: Corner, q: Array, theta: Array) -> Surface:
    """What phi of a corner does at states q (Q, N), theta (N,)."""
    rows, count = q.shape
    if corner.row >= rows:
        return law.surface(corner.row - rows, q, theta)
    normal = np.zeros((rows, count))
    normal[corner.row] = 1.0
    bend, by_phase, by_coefficients = np.zeros((rows, rows, count)), np.zeros(count), np.zeros((len(law.c), count))
    return Surface(q[corner.row] - corner.level, normal, bend, by_phase, np.zeros((rows, count)), by_coefficients)


def by_coefficients(law: Cornered, comb: Comb) -> list[tuple[Comb, Array]]:
    """phi_c at a corner, (nc, N), with the Dirac functions that it counts for: where several corners fall together, of
    each of them.

    They are told apart by how they move: as f is continuous, `[f_c] = sum_i eta_i phi_ic` beside `[f_a] = sum_i eta_i
    n_a`.
    """
    if comb.corner.row >= len(comb.surface.normal):
        return [(comb, comb.surface.by_coefficients)]
    moving = -law.element.level_rates(law.c)[comb.corner.number]
    spread = [np.multiply.outer(one, np.ones(len(comb.zr))) for one in moving]
    unknown = np.isnan(moving[0])
    if len(moving) == 1 and not unknown.any():
        return [(comb, spread[0])]
    q, theta = law.state_at(comb.zr, comb.zi)
    above, below, _ = beside(law, comb.corner, q, theta, BESIDE)
    jumps = law.by_state_and_coefficients(above, theta) - law.by_state_and_coefficients(below, theta)
    eta, by = jumps[comb.corner.row], jumps[len(q) :]
    if len(moving) == 1:  # of all together: right in all that is linear in it
        spread[0][unknown] = np.where(eta == 0.0, 0.0, by / np.where(eta == 0.0, 1.0, eta))[unknown]
        return [(comb, spread[0])]
    equations, known = np.concatenate((np.ones((1, len(moving))), moving.T)), np.concatenate((eta[None], by))
    # coefficients have units
    size = np.abs(equations).max(axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    parts = np.linalg.lstsq(equations / size, known / size, rcond=None)[0]
    rates = np.maximum(np.abs(comb.corner.rate), 1e-12 * comb.corner.size)
    return [(comb._replace(weights=part / rates), one) for part, one in zip(parts, spread, strict=True)]


def combs(law: Cornered) -> list[Comb]:
    """The jumps of the force's slope at every corner, as Dirac functions along the motion."""
    found = []
    for corner in law.corners:
        if not len(corner.at):
            continue
        zr, zi = np.cos(corner.at), np.sin(corner.at)
        q, theta = law.state_at(zr, zi)
        surface = surface_at(law, corner, q, theta)
        # the rate is kept from zero where the motion only touches the corner
        rates = np.maximum(np.abs(corner.rate), 1e-12 * corner.size)
        found.append(Comb(corner, zr, zi, surface, jump(law, corner, q, theta) / rates))
    return found


def jump(law: Cornered, corner: Corner, q: Array, theta: Array) -> Array:
    """eta where a corner is passed, at the states q (Q, N), theta (N,) there."""

    def across(distance: float) -> Array:
        above, below, surface = beside(law, corner, q, theta, distance)
        jumps = law.tangent(above, theta)[1] - law.tangent(below, theta)[1]
        eta: Array = (surface.normal * jumps).sum(axis=0) / (surface.normal**2).sum(axis=0)
        return eta

    near = across(BESIDE)
    # half powers that begin at the corner are no jump
    return 2.0 * near - across(4.0 * BESIDE) if law.rough else near


def beside(law: Cornered, corner: Corner, q: Array, theta: Array, distance: float) -> tuple[Array, Array, Surface]:
    """States above and below a corner, at a distance in units of phi along the motion, and phi at the corner, that
    nearest to states q (Q, N).
    """
    surface = surface_at(law, corner, q, theta)
    for _ in range(2 if surface.value.any() else 0):
        q = q - surface.value * surface.normal / (surface.normal**2).sum(axis=0)
        surface = surface_at(law, corner, q, theta)
    far = distance * corner.size * surface.normal / (surface.normal**2).sum(axis=0)
    return q + far, q - far, surface


def third_at(law: Cornered, corner: Corner) -> Third:
    """Dirac functions and their derivatives at one corner."""
    zr, zi = np.cos(corner.at), np.sin(corner.at)
    q, theta = law.state_at(zr, zi)
    surface, first = surface_at(law, corner, q, theta), rates_of_state(law, zr, zi)
    normal, bend = surface.normal, surface.bend
    length = (normal**2).sum(axis=0)

    def jumps(distance: float) -> Array:
        """Of f_ab n_b, (Q, N)."""
        above, below, _ = beside(law, corner, q, theta, distance)
        change = law.curvature(above, theta) - law.curvature(below, theta)
        along: Array = np.einsum("abn,bn->an", change, normal)
        return along

    eta = jump(law, corner, q, theta)
    if law.rough:
        along = _without_powers([jumps(share * _NEAR) for share in (1.0, 4.0, 16.0)], corner.row)
    else:
        along = jumps(BESIDE)
    along = along - eta * np.einsum("abn,bn->an", bend, normal)
    across = (along * normal).sum(axis=0) / (2.0 * length)
    # the derivatives of eta by the state and by tau
    slope = (along - across * normal) / length
    turning = np.einsum("an,an->n", slope, first)
    if law.harmonic:
        moved = [jump(law, corner, q, theta + share * _PHASE) for share in (1.0, -1.0, 2.0, -2.0)]
        by_phase = (8.0 * (moved[0] - moved[1]) - (moved[2] - moved[3])) / (12.0 * _PHASE)
        # the corner moves with the phase, and with it the state on it
        turning = turning + law.along.nu * (by_phase + across * surface.by_phase / length)
    turned = np.einsum("abn,bn->an", bend, first) + law.along.nu * surface.normal_by_phase
    rate = _kept_from_zero(corner.rate, corner.size)
    cube = np.einsum("an,bn,cn->abcn", normal, normal, normal)
    weights = _symmetric(slope - eta * turned / rate, normal) + eta * _three_ways(bend, normal)
    weights = (weights - (turning / rate - eta * corner.second / rate**2) * cube) / np.abs(rate)
    return Third(zr, zi, weights, -eta * cube / (rate * np.abs(rate)))


def _symmetric(a: Array, n: Array) -> Array:
    """`a n n + n a n + n n a`, (Q, Q, Q, N)."""
    return _three_ways(np.einsum("an,bn->abn", n, n), a)


def _three_ways(b: Array, n: Array) -> Array:
    """`b_ab n_c + b_ac n_b + b_bc n_a` of a symmetric b (Q, Q, N), (Q, Q, Q, N)."""
    first: Array = np.einsum("abn,cn->abcn", b, n)
    return first + first.transpose(0, 2, 1, 3) + first.transpose(2, 0, 1, 3)


def finite_part(law: Cornered, corner: Corner) -> Third:
    """What Gauss rules miss of `f_rrr ~ K y^-p` beside a corner, y = |q_r - level|: Hadamard's finite part.

    On the panel next to a corner instants run like the square of its variable s, `y ~ |q_r'| length s^2`, and the
    finite part of `int 2 s^(1 - 2 p) ds` over [0, 1] is `1 / (1 - p)`. The rule is exact for what is left of laws with
    half powers (p = 3/2: contact after Hertz).
    """
    row, at = corner.row, corner.at
    s, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    zr, zi = np.cos(at), np.sin(at)
    q, theta = law.state_at(zr, zi)
    slope = _kept_from_zero(corner.rate, corner.size)
    nodes = law.nodes.tau.reshape(-1, len(s))
    weights = np.zeros((len(q),) * 3 + (len(at),))
    for side in (1.0, -1.0):
        for i, (power, strength) in enumerate(zip(*_singularity(law, corner, side, q, theta), strict=True)):
            if not 0.1 < power < 1.95 or power == 1.0:
                continue
            if slope[i] * side > 0.0:
                away = np.mod(nodes - at[i], 2.0 * np.pi)
            else:
                away = np.mod(at[i] - nodes[:, ::-1], 2.0 * np.pi)
            length = away[np.argmin(away[:, 0]), -1] / s[-1] ** 2
            missed = 1.0 / (1.0 - power) - 2.0 * float((share * s ** (1.0 - 2.0 * power)).sum())
            weights[row, row, row, i] += missed * strength * length * (abs(slope[i]) * length) ** -power
    return Third(zr, zi, weights, None)


def _singularity(law: Cornered, corner: Corner, side: float, q: Array, theta: Array) -> tuple[Array, Array]:
    """Exponent p and strength K of f_rrr on one side of a corner; p = 0 where it is not singular."""
    row = corner.row
    y = _NEAR * corner.size

    def third(distance: float) -> Array:
        there = q.copy()
        there[row] = corner.level + side * distance
        return law.third_derivative(there, theta)[row, row, row]

    near, far = third(y), third(4.0 * y)
    with np.errstate(all="ignore"):
        power = np.nan_to_num(-np.log(far / near) / np.log(4.0), posinf=0.0, neginf=0.0)
    half = np.round(2.0 * power) / 2.0
    power = np.where(np.abs(power - half) < 1e-3, half, power)
    # K is the limit of a function that is smooth in y
    strength: Array = (4.0 * near * y**power - far * (4.0 * y) ** power) / 3.0
    return power, strength


def _kept_from_zero(slope: Array, size: float) -> Array:
    """Rates of phi where the motion reaches a corner, kept from zero where it only touches it."""
    return np.where(np.abs(slope) < 1e-12 * size, 1e-12 * size, slope)


def _without_powers(values: list[Array], row: int) -> Array:
    """Limits of functions K + k d^-p + k' d^(1 - p) of the distance d from their values (Q, N) at d, 4 d, 16 d.

    p is that of the given row, where it is singular at all.
    """
    near, middle, far = (value[row] for value in values)
    with np.errstate(all="ignore"):
        power = np.log((near - middle) / (middle - far)) / np.log(4.0)
    half = np.round(2.0 * power) / 2.0
    power = np.where(np.abs(power - half) < 1e-2, half, power)
    power = np.where(np.isfinite(power) & (np.abs(power) > 0.02) & (np.abs(power - 1.0) > 0.02), power, 0.5)
    first, second = 4.0**-power, 4.0 ** (1.0 - power)
    limit: Array = values[0] * first * second - values[1] * (first + second) + values[2]
    return limit / ((1.0 - first) * (1.0 - second))


def _second_rate(series: ComplexArray, zr: Array, zi: Array) -> Array:
    """The second derivative by tau of a function with these complex coefficients, (N,)."""
    turned = np.ascontiguousarray(1j * np.arange(len(series)) * series)
    second: Array = motion(turned, zr, zi)[1]
    return second


def rates_of_state(law: Cornered, zr: Array, zi: Array) -> Array:
    """Derivatives by tau of q at instants, (Q, N)."""
    along = law.along
    first = [motion(one, zr, zi)[1] for one in along.motions]
    return np.array(first + [along.rate * _second_rate(one, zr, zi) for one in along.motions if law.moving])
