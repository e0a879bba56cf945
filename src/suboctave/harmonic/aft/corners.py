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

from typing import NamedTuple, Protocol

import numpy as np

from suboctave.harmonic.aft.law import Along, Third
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import FEWEST, GAUSS, Nodes, search_grid, uniform_nodes
from suboctave.harmonic.trigonometric import crossings_of, extrema, motion
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.smoothness import CornerSampling, Sampling, Surface

_NO_INSTANTS = np.zeros(0)
#: how far on either side of a corner its jump is looked at, in units of phi along the motion
BESIDE = 1e-9
#: step in the phase of the load by which the jump of a slope is differentiated
_PHASE = 1e-3
#: distance from a rough corner, in the same units, at which the strength of its singularity is looked at
_NEAR = 1e-6
#: share of the largest coefficient below which those of phi are left out, most instants that they are taken from, and
#: corrections of the instants of corners for what that leaves
_RESOLVED, _MOST, _CORRECTIONS = 1e-11, 2048, 3


class Corner(NamedTuple):
    """A corner of a law: its number, points first, then velocities and surfaces; the row of q that has it at `level`,
    or that many rows and the number of its surface; phi and the level as complex coefficients along the motion (., ),
    and the instants at which the motion reaches it.
    """

    number: int
    row: int
    level: float
    series: ComplexArray
    at: Array


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
    def tangent(self, q: Array, theta: Array) -> tuple[Array, Array]: ...
    def curvature(self, q: Array, theta: Array) -> Array: ...
    def third_derivative(self, q: Array, theta: Array) -> Array: ...


def corners_along(law: Cornered) -> list[Corner]:
    """Every corner of a law along its motion."""
    kind, along = law.kind, law.along
    if not isinstance(kind, CornerSampling):
        return []
    found: list[Corner] = []
    for row, series, levels in ((0, along.motion, kind.points), (law.count, law.velocity, kind.velocities)):
        for level in levels:
            # a velocity that is zero throughout rests in its corner
            at = _passed(series, float(level)) if series[1:].any() else _NO_INSTANTS
            found.append(Corner(len(found), row, float(level), series, at))
    for which in range(kind.surfaces):
        series = _along_motion(law, which)
        corner = Corner(len(found), along.size + which, 0.0, series, _passed(series, 0.0))
        for _ in range(_CORRECTIONS if len(corner.at) else 0):
            # what the series lacks
            zr, zi = np.cos(corner.at), np.sin(corner.at)
            surface = law.surface(which, *law.state_at(zr, zi))
            rate = (surface.normal * _rates_of_state(law, zr, zi)).sum(axis=0) + along.nu * surface.by_phase
            corner = corner._replace(at=corner.at - surface.value / _kept_from_zero(rate, size_of(corner)))
        found.append(corner)
    return found


def _passed(series: ComplexArray, level: float) -> Array:
    """Instants at which a function with these complex coefficients passes a level."""
    grid = search_grid(len(series) - 1)
    return np.asarray(crossings_of(series, level, extrema(series, grid.zr, grid.zi))[0])


def _along_motion(law: Cornered, which: int) -> ComplexArray:
    """Complex coefficients of a surface's function along the motion, as many as it has."""
    count = FEWEST
    while count < 8 * (law.along.high + 1):
        count *= 2
    while True:
        nodes = uniform_nodes(count)
        series = np.fft.rfft(law.surface(which, *law.state_at(nodes.zr, nodes.zi)).value) / count
        series[1:] *= 2.0
        sizes = np.abs(series)
        kept = np.flatnonzero(sizes > _RESOLVED * sizes.max(initial=0.0))
        last = int(kept[-1]) if len(kept) else 0
        if last < count // 4 or count >= _MOST:
            return np.ascontiguousarray(series[: max(2, min(last, count // 4) + 1)])
        count *= 2


def surface_at(law: Cornered, corner: Corner, q: Array, theta: Array) -> Surface:
    """What phi of a corner does at states q (Q, N), theta (N,)."""
    rows, count = q.shape
    if corner.row >= rows:
        return law.surface(corner.row - rows, q, theta)
    normal = np.zeros((rows, count))
    normal[corner.row] = 1.0
    bend, by_phase, by_coefficients = np.zeros((rows, rows, count)), np.zeros(count), np.zeros((len(law.c), count))
    return Surface(q[corner.row] - corner.level, normal, bend, by_phase, np.zeros((rows, count)), by_coefficients)


def by_coefficients(law: Cornered, comb: Comb) -> Array:
    """phi_c at a corner, (nc, N)."""
    if comb.corner.row >= len(comb.surface.normal):
        return comb.surface.by_coefficients
    rates = law.element.level_rates(law.c)[comb.corner.number]
    result: Array = np.multiply.outer(-rates, np.ones(len(comb.zr)))
    return result


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
        rates = np.maximum(np.abs(motion(corner.series, zr, zi)[1]), 1e-12 * size_of(corner))
        found.append(Comb(corner, zr, zi, surface, jump(law, corner, q, theta) / rates))
    return found


def size_of(corner: Corner) -> float:
    """About the largest value that phi and its level take along the motion."""
    return float(np.abs(corner.series).sum()) or 1.0


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
    """States above and below a corner, at a distance in units of phi along the motion, and phi at the given ones."""
    surface = surface_at(law, corner, q, theta)
    way = surface.normal / (surface.normal**2).sum(axis=0)
    on_it, far = q - surface.value * way, distance * size_of(corner)
    return on_it + far * way, on_it - far * way, surface


def third_at(law: Cornered, corner: Corner) -> Third:
    """Dirac functions and their derivatives at one corner."""
    zr, zi = np.cos(corner.at), np.sin(corner.at)
    q, theta = law.state_at(zr, zi)
    surface, first = surface_at(law, corner, q, theta), _rates_of_state(law, zr, zi)
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
    rate, second = motion(corner.series, zr, zi)[1], _second_rate(corner.series, zr, zi)
    rate = _kept_from_zero(rate, size_of(corner))
    cube = np.einsum("an,bn,cn->abcn", normal, normal, normal)
    weights = _symmetric(slope - eta * turned / rate, normal) + eta * _three_ways(bend, normal)
    weights = (weights - (turning / rate - eta * second / rate**2) * cube) / np.abs(rate)
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
    slope = _kept_from_zero(motion(corner.series, zr, zi)[1], size_of(corner))
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
    y = _NEAR * size_of(corner)

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


def _rates_of_state(law: Cornered, zr: Array, zi: Array) -> Array:
    """Derivatives by tau of q at instants, (Q, N)."""
    along = law.along
    first = [motion(one, zr, zi)[1] for one in along.motions]
    return np.array(first + [along.rate * _second_rate(one, zr, zi) for one in along.motions if law.moving])
