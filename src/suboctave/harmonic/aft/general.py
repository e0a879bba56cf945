"""Laws that are asked at nodes: of several inputs, of time, with corners, sharp, smooth: all but piecewise-linear ones.

A coupled element acts along d_out with `f(q, theta)` (`model.elements.coupled`); an element with one input is the case
d_1 = d_out. Time is `theta = nu tau`: at fixed coefficients it does not change with omega. A force with corners has
second derivatives that are Dirac functions there, as those of a contact: `int f_uu h dtau` has the terms `[f_u] h /
|du/dtau|` at the instants at which the motion reaches a corner, with the jump `[f_u]`.

At a corner of the law in q_r the force is `f_0(q) + (q_r - level) eta(q) H(q_r - level)`. Its jumps are `[f_r] = eta`,
`[f_rs] = eta_s` for s other than r, `[f_rr] = 2 eta_r`, and

    f_qqq[a, b, c] = ... + (eta.a b_r c_r + a_r eta.b c_r + a_r b_r eta.c) delta(q_r - level) + a_r b_r c_r eta
    delta'(q_r - level),

with `eta.a = sum_s eta_s a_s`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import (
    FEWEST,
    GAUSS,
    MOST,
    Nodes,
    between_corners,
    graded_nodes,
    polynomial_nodes,
    search_grid,
    uniform_nodes,
)
from suboctave.harmonic.trigonometric import crossings_of, extrema, motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    CornerSampling,
    PolynomialSampling,
    SharpSampling,
    SharpVelocitySampling,
)

__all__ = ["Corner", "GeneralLaw", "Smoothness"]

_NO_INSTANTS = np.zeros(0)
#: how far on either side of a corner its jump is looked at, in units of the motion
BESIDE = 1e-9
#: step in the phase of the load by which the jump of a slope is differentiated
_PHASE = 1e-3
#: distance from a rough corner, in units of the motion, at which the strength of its singularity is looked at
_NEAR = 1e-6


class Corner(NamedTuple):
    """A corner of a law: its number, its row of q, its place there, the instants at which the motion reaches it."""

    number: int
    row: int
    level: float
    at: Array


class _Comb(NamedTuple):
    """Dirac functions at a corner: the corner, the instants and the weights `[f_q] / |dq/dtau|`."""

    corner: Corner
    zr: Array
    zi: Array
    weights: Array


class Smoothness(NamedTuple):
    """How smooth a law is: corners in displacement and velocity, and whether powers of a half begin there; places and
    widths of its singularities in velocity; whether it is sharp at all; its degree, if it is a polynomial, or 0;
    whether it is smooth only between corners; whether all that is unknown.
    """

    points: tuple[float, ...] = ()
    velocities: tuple[float, ...] = ()
    rough: bool = False
    sharp_velocities: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    sharp: bool = False
    degree: int = 0
    cornered: bool = False
    unknown: bool = False


class GeneralLaw(LawAlong):
    """Elements along a motion whose laws are of one smoothness class; those with corners, and all that read several
    displacements, time or a velocity in which they are sharp, come alone.
    """

    def __init__(self, along: Along, members: Sequence[Member], nodes: Nodes | None = None) -> None:
        super().__init__(along, members)
        self._given = nodes
        _, self.element, self.kind, self.c, _ = members[0]
        self.count = len(along.motions)
        self.moving = self.element.depends_on_velocity
        self.harmonic = 0 if self.kind.whole else as_coupled(self.element).time_harmonic

    @property
    def samples(self) -> int:
        """Number of samples of laws of unknown smoothness."""
        return max(member.samples or FEWEST for member in self.members)

    @property
    def smoothness(self) -> Smoothness:
        """How smooth the laws are, in numbers."""
        kind = self.kind
        if isinstance(kind, CornerSampling):
            return Smoothness(kind.points, kind.velocities, kind.rough, cornered=True)
        if isinstance(kind, SharpVelocitySampling):
            return Smoothness(sharp_velocities=(kind.velocities, kind.widths), sharp=True, degree=1 + kind.degree)
        if isinstance(kind, PolynomialSampling):
            return Smoothness(degree=self._degree)
        return Smoothness(sharp=isinstance(kind, SharpSampling), unknown=isinstance(kind, AdaptiveSampling))

    @property
    def _degree(self) -> int:
        return max([m.kind.degree for m in self.members if isinstance(m.kind, PolynomialSampling)], default=0)

    def state_at(self, zr: Array, zi: Array) -> tuple[Array, Array]:
        """q (Q', N) and theta (N,) at instants."""
        along = self.along
        values = [motion(one, zr, zi) for one in along.motions]
        q = np.array([u for u, _ in values] + [along.rate * v for _, v in values if self.moving])
        return q, along.nu * np.arctan2(zi, zr) if self.harmonic else np.zeros_like(zr)

    @lazy
    def nodes(self) -> Nodes:
        """Instants and weights chosen for the law, if none were given."""
        if self._given is not None:
            return self._given
        kind, along = self.kind, self.along
        varying = self.harmonic * along.nu
        if isinstance(kind, PolynomialSampling):
            return polynomial_nodes(self._degree * along.high + varying, along.top)
        if isinstance(kind, SharpVelocitySampling):
            highest = along.top + kind.degree * along.high
            if not self._velocity.any():
                return polynomial_nodes(highest + 1, along.top)
            return graded_nodes(self._velocity, np.array(kind.velocities), np.array(kind.widths), highest)
        if isinstance(kind, SharpSampling):
            sharp = [m.kind for m in self.members if isinstance(m.kind, SharpSampling)]
            points, widths = (
                np.concatenate(parts) for parts in zip(*[(k.points, k.widths) for k in sharp], strict=True)
            )
            return graded_nodes(along.motion, points, widths, along.top)
        fewest = 1 << math.ceil(math.log2(2 * along.top + 2 + 2 * varying))
        count = max(self.samples, fewest)
        corners = np.unique(np.concatenate([_NO_INSTANTS] + [corner.at for corner in self.corners]))
        if not len(corners):
            return uniform_nodes(count)
        # twice as many nodes are so between all corners: else those of one interval might seem to have settled
        return between_corners(corners, 2.0 * math.pi * len(GAUSS[0]) / fewest, count // fewest)

    @property
    def _velocity(self) -> ComplexArray:
        """Complex coefficients of the first input's rate, (H + 1,)."""
        series: ComplexArray = 1j * self.along.rate * np.arange(self.along.high + 1) * self.along.motion
        return series

    @lazy
    def corners(self) -> list[Corner]:
        """Every corner of the law."""
        kind = self.kind
        if not isinstance(kind, CornerSampling):
            return []
        grid = search_grid(self.along.high)
        corners: list[Corner] = []
        for row, series, levels in (
            (0, self.along.motion, kind.points),
            (self.count, self._velocity, kind.velocities),
        ):
            turns = extrema(series, grid.zr, grid.zi)
            for level in levels:
                # a velocity that is zero throughout rests in its corner
                resting = not series[1:].any()
                at = _NO_INSTANTS if resting else crossings_of(series, float(level), turns)[0]
                corners.append(Corner(len(corners), row, float(level), np.asarray(at)))
        return corners

    @lazy
    def path(self) -> tuple[Array, Array]:
        """q (Q', N) and theta (N,) at the nodes."""
        return self.state_at(self.nodes.zr, self.nodes.zi)

    def project(self, values: Array) -> ComplexArray:
        """Fourier coefficients (..., top + 1) of functions given at the nodes (..., N)."""
        nodes, top = self.nodes, self.along.top
        flat = np.ascontiguousarray(np.reshape(values, (-1, len(nodes.weights))), dtype=float)
        coefficients: ComplexArray = spectra(flat, nodes.weights, nodes.zr, nodes.zi, top)
        return coefficients.reshape(np.shape(values)[:-1] + (top + 1,))

    def tangent(self, q: Array, theta: Array) -> tuple[Array, Array]:
        """f (N,) and f_q (Q', N) at states."""
        force, slopes = np.zeros_like(theta), np.zeros_like(q)
        for member in self.members:
            f, f_q = as_coupled(member.element).tangent(q, theta, member.coefficients)
            if np.shape(f) != theta.shape or np.shape(f_q) != q.shape:
                label = member.element.label
                raise InputError(f"{label}: tangent must return arrays of shape {theta.shape} and {q.shape}")
            force += f
            slopes += f_q
        return force, slopes

    def curvature(self, q: Array, theta: Array) -> Array:
        """f_qq (Q', Q', N) at states, its regular part."""
        parts = [as_coupled(m.element).curvature(q, theta, m.coefficients) for m in self.members]
        return sum(parts[1:], parts[0])

    def third_derivative(self, q: Array, theta: Array) -> Array:
        """f_qqq (Q', Q', Q', N) at states, its regular part."""
        parts = [as_coupled(m.element).third(q, theta, m.coefficients) for m in self.members]
        return sum(parts[1:], parts[0])

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        f, f_q = self.tangent(*self.path)
        out[: 1 + len(f_q)] += self.project(np.concatenate((f[None], f_q)))

    def by_coefficients(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.by_coefficients`."""
        law = as_coupled(member.element)
        f_c, f_qc = law.coefficient_tangent(*self.path, member.coefficients)
        f_cc = law.coefficient_curvature(*self.path, member.coefficients)
        derivatives = CoefficientSpectra(self.project(f_c), self.project(f_qc), self.project(f_cc))
        for row, by, spectrum in self._moved_corners():
            derivatives.tangent[:, row] -= np.multiply.outer(by, spectrum)
            derivatives.curvature[:] += np.multiply.outer(np.multiply.outer(by, by), spectrum)
        return derivatives

    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        changed = [member for member in self.members if member.number in rates]
        if not changed:
            return
        q, theta = self.path
        total = np.zeros((1 + len(q), len(theta)))
        for member in changed:
            rate, law = rates[member.number], as_coupled(member.element)
            f_c, f_qc = law.coefficient_tangent(q, theta, member.coefficients)
            total[0] += rate @ f_c
            total[1:] += (rate @ f_qc.reshape(len(rate), -1)).reshape(q.shape)
        out[: len(total)] += self.project(total)
        for row, by, spectrum in self._moved_corners():
            out[1 + row] -= (rates[self.members[0].number] @ by) * spectrum

    def _moved_corners(self) -> Iterator[tuple[int, Array, ComplexArray]]:
        """Of every corner its row of q, how it moves with the coefficients, (nc,), and the spectrum (top + 1,) of its
        Dirac function, which it takes along.
        """
        if self._combs:
            rates = self.element.level_rates(self.c)
            for corner, zr, zi, weights in self._combs:
                spectrum = spectra(np.ones((1, len(zr))), weights, zr, zi, self.along.top)[0]
                yield corner.row, rates[corner.number], spectrum

    @lazy
    def _combs(self) -> list[_Comb]:
        """The jumps of the force's slope at every corner, as Dirac functions along the motion."""
        combs = []
        for corner in self.corners:
            if not len(corner.at):
                continue
            zr, zi = np.cos(corner.at), np.sin(corner.at)
            there, phase = self.state_at(zr, zi)
            rates = motion(self._velocity if corner.row else self.along.motion, zr, zi)[1]
            # the rate is kept from zero where the motion only touches the corner
            least = 1e-12 * self.size(corner.row)
            weights = self.jump(corner, there, phase) / np.maximum(np.abs(rates), least)
            combs.append(_Comb(corner, zr, zi, weights))
        return combs

    def size(self, row: int) -> float:
        """Largest value that a row of q takes along the motion."""
        return float(np.abs(self.path[0][row]).max()) or 1.0

    def jump(self, corner: Corner, q: Array, theta: Array) -> Array:
        """Jump of `f_r` where row r of q passes a corner; q (Q, N), theta (N,) at the instants of passing."""

        def across(distance: float) -> Array:
            above, below = (self.tangent(side, theta)[1] for side in self.beside(corner, q, distance))
            jump: Array = above[corner.row] - below[corner.row]
            return jump

        near = across(BESIDE)
        # half powers that begin at the corner are no jump
        return 2.0 * near - across(4.0 * BESIDE) if self.rough else near

    def beside(self, corner: Corner, q: Array, distance: float) -> tuple[Array, Array]:
        """States above and below a corner, at a distance in units of the motion."""
        above, below = q.copy(), q.copy()
        above[corner.row] = corner.level + distance * self.size(corner.row)
        below[corner.row] = corner.level - distance * self.size(corner.row)
        return above, below

    @property
    def rough(self) -> bool:
        """Whether powers of a half begin at its corners."""
        return isinstance(self.kind, CornerSampling) and self.kind.rough

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        nodes, q = self.nodes, self.path[0]
        parts = [Second(nodes.zr, nodes.zi, nodes.weights * self.curvature(*self.path))]
        for comb in self._combs:
            weights = np.zeros((len(q), len(q), len(comb.zr)))
            weights[comb.corner.row, comb.corner.row] = comb.weights
            parts.append(Second(comb.zr, comb.zi, weights))
        return parts

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        nodes = self.nodes
        parts = [Third(nodes.zr, nodes.zi, nodes.weights * self.third_derivative(*self.path), None)]
        for corner in self.corners:
            if len(corner.at):
                parts.append(_at_corner(self, corner))
                if self.rough:
                    parts.append(_finite_part(self, corner))
        return parts

    def settled_samples(self, member: Member, settled: Callable[[ComplexArray, ComplexArray], bool]) -> int | None:
        """See `LawAlong.settled_samples`.

        Raises
        ------
        ConvergenceError
            If even 32768 do not suffice.
        """
        if not isinstance(member.kind, AdaptiveSampling | CornerSampling):
            return None
        along = self.along
        count = max(FEWEST, 1 << math.ceil(math.log2(2 * along.top + 2)))
        previous: ComplexArray | None = None
        while count <= MOST:
            current = np.zeros((1 + along.size, along.top + 1), dtype=complex)
            GeneralLaw(along, [member._replace(samples=count)]).add_spectra(current)
            if previous is not None and settled(previous, current):
                return count // 2
            previous, count = current, 2 * count
        raise ConvergenceError(
            f"{member.element.label}: the force does not settle with {MOST} samples per period: it is too sharp to be "
            "sampled blindly. Of a text (Expression) places are known where it has corners (abs, max, ...), or is "
            "sharp as tanh or atan of one velocity times a polynomial; a class of your own can tell them (sampling "
            "returning SharpSampling(points, widths) or CornerSampling). Elements that are exact: ElasticStop, "
            "Freeplay, TanhFriction"
        )


def _finite_part(law: GeneralLaw, corner: Corner) -> Third:
    """What Gauss rules miss of `f_rrr ~ K y^-p` beside a corner, y = |q_r - level|: Hadamard's finite part.

    On the panel next to a corner instants run like the square of its variable s, `y ~ |q_r'| length s^2`, and the
    finite part of `int 2 s^(1 - 2 p) ds` over [0, 1] is `1 / (1 - p)`. The rule is exact for what is left of laws with
    half powers (p = 3/2: contact after Hertz).
    """
    row, at = corner.row, corner.at
    s, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    zr, zi = np.cos(at), np.sin(at)
    q, theta = law.state_at(zr, zi)
    slope = _kept_from_zero(_rates_of_state(law, zr, zi)[0][row], law.size(row))
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


def _singularity(law: GeneralLaw, corner: Corner, side: float, q: Array, theta: Array) -> tuple[Array, Array]:
    """Exponent p and strength K of f_rrr on one side of a corner; p = 0 where it is not singular."""
    row = corner.row
    y = _NEAR * law.size(row)

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


def _at_corner(law: GeneralLaw, corner: Corner) -> Third:
    """Dirac functions and their derivatives at one corner."""
    row = corner.row
    zr, zi = np.cos(corner.at), np.sin(corner.at)
    q, theta = law.state_at(zr, zi)
    rates = _rates_of_state(law, zr, zi)

    def bend(distance: float) -> Array:
        """Jumps of f_rs."""
        above, below = (law.curvature(side, theta)[row] for side in law.beside(corner, q, distance))
        jumps: Array = above - below
        return jumps

    eta = law.jump(corner, q, theta)
    by = _without_powers([bend(share * _NEAR) for share in (1.0, 4.0, 16.0)], row) if law.rough else bend(BESIDE)
    by[row] *= 0.5
    along = np.einsum("sn,sn->n", by, rates[0])
    if law.harmonic:
        jumps = [law.jump(corner, q, theta + share * _PHASE) for share in (1.0, -1.0, 2.0, -2.0)]
        along += law.along.nu * (8.0 * (jumps[0] - jumps[1]) - (jumps[2] - jumps[3])) / (12.0 * _PHASE)
    slope = _kept_from_zero(rates[0][row], law.size(row))
    size = len(q)
    weights = np.zeros((size, size, size, len(zr)))
    for s in range(size):
        for place in ((s, row, row), (row, s, row), (row, row, s)):
            weights[place] += by[s] / np.abs(slope)
    weights[row, row, row] -= (along / slope - eta * rates[1][row] / slope**2) / np.abs(slope)
    slopes = np.zeros_like(weights)
    slopes[row, row, row] = -eta / (slope * np.abs(slope))
    return Third(zr, zi, weights, slopes)


def _kept_from_zero(slope: Array, size: float) -> Array:
    """Rates of q where the motion reaches a corner, kept from zero where it only touches it."""
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


def _rates_of_state(law: GeneralLaw, zr: Array, zi: Array) -> tuple[Array, Array]:
    """First and second derivatives by tau of q at instants, (Q, N) each."""
    first, second = [], []
    for order in (0, 1) if law.moving else (0,):
        for one in law.along.motions:
            k = 1j * np.arange(len(one))
            series = np.ascontiguousarray(k * one * (law.along.rate * k) ** order)
            a, b = motion(series, zr, zi)
            first.append(a)
            second.append(b)
    return np.array(first), np.array(second)
