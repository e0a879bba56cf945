"""Where a branch of sub-harmonic motions leaves or meets the branch that it bifurcates from.

In a basis of an even number nu of load periods, a motion of half that period has harmonics of even order only. A branch
meets such a parent at a period doubling of the parent: its odd part shrinks to nothing and, were it followed further,
would grow again with the opposite sign, the same motions shifted by the parent's period. There the branch ends.

The same in general: with x written by harmonics of omega/nu, those that a prime factor of nu does not divide would not
be there if the motion repeated earlier by that factor.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import doubled_direction
from suboctave.bifurcation.normal_form import NormalForm, normal_form
from suboctave.continuation.ending import Ending, EndReason
from suboctave.continuation.linear import length
from suboctave.continuation.march import Arrival
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, between, make_point
from suboctave.continuation.problem import Array
from suboctave.curves.events.locate import Guess, Singular, locate_multiple, locate_singular
from suboctave.curves.events.monitors import position
from suboctave.curves.identity import apart
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind

#: sub-harmonic share of a motion that is none any more
NOTHING_LEFT = 1e-5


def keeps_subharmonics(a: CurvePoint, b: CurvePoint) -> bool:
    """False if the sub-harmonic part of a motion may have vanished between two neighbours."""
    curve = b.curve
    assert isinstance(curve, MotionProblem)
    if curve.balance.basis.nu == 1 or subharmonic_share(curve, b.u) <= NOTHING_LEFT:
        return True
    before = parts_of(curve, curve.transfer(a.u, a.curve))
    return all(float(p @ q) >= 0.25 * float(p @ p) for p, q in zip(before, parts_of(curve, b.u), strict=True))


def subharmonic_share(curve: MotionProblem, u: Array) -> float:
    """Smallest share of a motion that one of its period multiplications has brought about."""
    return min(float(np.linalg.norm(part)) for part in parts_of(curve, u)) / (curve.size(u) or 1.0)


def parts_of(curve: MotionProblem, u: Array) -> list[Array]:
    """Harmonics that the motion would not have if it repeated earlier: one array for each prime factor of nu."""
    basis = curve.balance.basis
    x = u[: curve.balance.dimension].reshape(basis.size, -1) * curve.balance.scales()[0]
    return [x[rows].ravel() for rows in _rows_of_parts(basis.nu, basis.harmonics)]


def repeats_earlier(orbit: PeriodicOrbit) -> bool:
    """Whether a motion repeats after a part of the period that it is written with."""
    basis, scales = orbit.basis, orbit.balance.scales()[0]
    x = orbit.x.reshape(basis.size, -1) * scales
    least = min((float(np.linalg.norm(x[rows])) for rows in _rows_of_parts(basis.nu, basis.harmonics)), default=np.inf)
    return least <= NOTHING_LEFT * float(np.linalg.norm(x))


@lru_cache(maxsize=64)
def _rows_of_parts(nu: int, harmonics: int) -> list[np.ndarray]:
    k = np.append(0, np.repeat(np.arange(1, harmonics + 1), 2))
    primes = [d for d in range(2, nu + 1) if nu % d == 0 and all(d % e for e in range(2, math.isqrt(d) + 1))]
    return [np.flatnonzero(k % prime) for prime in primes]


def doubled_size(curve: MotionProblem, u: Array) -> float:
    """Size of the doubled part of a motion, nu even."""
    return float(np.linalg.norm(parts_of(curve, u)[0]))


#: distances from a bifurcation, in scaled arclength, at which a branch that leaves or meets it begins or ends
_DISTANCES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
#: share of a motion by which the first or last motion of a branch may differ from that of the bifurcation beside it
_BESIDE = 0.02
#: multipliers that differ by less (relative to moduli above one) are those of one neighbourhood
_CLOSE = 0.02
#: share of its odd part with which a step leaves a motion right beside its parent, on whose doublings what follows lies
_VANISHED = 0.01
#: odd part, in units of the motion, below which a curve may lead to its parent; distance of a multiplier from +1 up to
#: which a motion cannot be told from those of other branches that leave a multiple bifurcation
_LITTLE, MERGED = 0.3, 1e-6
#: how far from where it is foretold the end of such a curve may lie, as a share of the way there
_FORETOLD = 0.2
#: way in the scaled parameter that rounding may account for
_STILL = 1e-10
#: what a branch says where it could not look closer
UNSEEN = "close to a bifurcation the motions change so fast that something may happen unseen"


@dataclass(frozen=True)
class Junction:
    """The bifurcation at which a branch leaves or meets another: its kind, place, amplitude and period.

    kind
        "PD" or "BP", of the other branch.
    parameter, omega, amplitude
        The free parameter's value, the frequency, the amplitude of the observed DOF.
    nu
        Period of the other branch's motions in periods of the load.
    """

    kind: str
    parameter: float
    omega: float
    amplitude: float
    nu: int

    @classmethod
    def of(cls, item: Bifurcation) -> Junction:
        """The place of a located bifurcation."""
        value = item.parameter(item.parameter_name)
        return cls(item.kind, value, item.omega, item.amplitude, item.orbit.basis.nu)

    def same_place(self, item: Bifurcation, span: float, beside: PeriodicOrbit) -> bool:
        """Whether a located bifurcation is this one, located anew.

        `span` is the range of the free parameter, `beside` the motion at which a branch leaves or meets this one: the
        mirror image of a bifurcation has its place and its amplitude.
        """
        there = Junction.of(item)
        near = abs(self.parameter - there.parameter) <= 1e-5 * span and there.kind == self.kind
        alike = abs(self.amplitude - there.amplitude) <= 1e-3 * max(self.amplitude, there.amplitude)
        return near and alike and apart(beside, item.orbit) <= _BESIDE

    def __str__(self) -> str:
        return f"the {self.kind} of the {period_name(self.nu)} motion at omega = {self.omega:.9g}"


def period_name(nu: int) -> str:
    """T, 2T, 4T, ..."""
    return "T" if nu == 1 else f"{nu}T"


@dataclass(frozen=True)
class Meeting:
    """A branch that meets its parent: the parent's period doubling, its curve, how the march ends.

    `doubt` says where between the last point and the parent something may happen unseen; empty if nowhere;
    `multiplicity`: of the period doubling.
    """

    solution: Singular
    parent: MotionProblem
    arrival: Arrival
    doubt: str = ""
    multiplicity: int = 1


def meeting(a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> Meeting | None:
    """The parent's period doubling that a curve passes between two neighbours, None if it passes none."""
    curve = b.curve
    assert isinstance(curve, MotionProblem)
    basis = curve.balance.basis
    if basis.nu % 2:
        return None
    odd_a, odd_b = _odd(curve.transfer(a.u, a.curve), curve, b.weights), _odd(b.u, curve, b.weights)
    first, last = length(odd_a), length(odd_b)
    turned = bool(odd_a @ odd_b < 0.0)
    ahead = not turned and last > _VANISHED * first
    if ahead and not (last < min(first, _LITTLE) and _merged(b)):
        return None
    parent = curve.with_basis(basis.halved)
    share = first / (first - last if ahead else first + last)
    u = between(a, b, share)
    x, omega, values = curve.split(u)
    half = basis.even_part(x)
    try:
        balance = parent.balance.settle(half, omega, values)
        doubling, several = _doubling(Guess(balance.at(half, omega, values), curve.name, curve.span))
    except ConvergenceError:
        return None
    state = doubling.state
    there = curve.transfer(parent.u_of(state), parent)
    if ahead:
        # beside a simple one motions are told apart as close as one likes: there is no need to end early
        reached = several > 1 and length(b.weights * (there - u)) <= _FORETOLD * length(b.weights * (u - b.u))
    else:
        place = position(a, b, there)
        reached = place is not None and -1e-6 <= place <= 1.0 + (1e-6 if turned else 2.0 * _VANISHED)
    if not reached or doubling.vectors is None:
        return None
    reason = f"met the {period_name(basis.nu // 2)} motion at its period doubling at {curve.where(there)}"
    if several > 1:
        before, doubt = None, f"between {a.curve.where(a.u)} and {curve.where(there)}"
    else:
        before, doubt = _last_before(a, b, there, doubling, newton)
    arrival = Arrival(before, Ending(EndReason.MET_BRANCH, curve.where(there), reason))
    return Meeting(doubling, parent.with_balance(state.balance), arrival, doubt, several)


def _merged(point: CurvePoint) -> bool:
    """Whether a motion cannot be told from those of other branches that lead to the same place."""
    assert isinstance(point.evaluation, MotionEvaluation)
    return bool(np.abs(point.evaluation.floquet.multipliers - 1.0).min() < MERGED)


def _doubling(guess: Guess) -> tuple[Singular, int]:
    """The period doubling beside a motion, and how many fall together in it."""
    away = np.abs(floquet_multipliers(guess.state).multipliers + 1.0)
    several = int(np.count_nonzero(away <= 1.1 * away.min() + MERGED))
    if several > 1:
        with suppress(ConvergenceError):
            return locate_multiple(guess, Kind.HALF, several), several
    return locate_singular(guess, Kind.HALF), 1


def _odd(u: Array, curve: MotionProblem, weights: Array) -> Array:
    """The weighted coefficients of odd order."""
    shaped = curve.balance.shaped((weights * u)[:-1])
    return np.concatenate((shaped[1::4].ravel(), shaped[2::4].ravel()))


def _last_before(
    a: CurvePoint, b: CurvePoint, there: Array, doubling: Singular, newton: NewtonOptions
) -> tuple[CurvePoint | None, str]:
    """The curve's point right before it meets its parent, None if a neighbour is that; and what remains in doubt."""
    curve = b.curve
    assert isinstance(curve, MotionProblem)
    before = curve.transfer(a.u, a.curve)
    way = length(b.weights * (there - before))
    direction = emanating(doubling, curve, b.weights)
    if (b.weights * direction) @ (b.weights * (before - there)) < 0.0:
        direction = -direction
    assert doubling.vectors is not None
    form = normal_form("PD", doubling.state, doubling.vectors, curve.name)
    # over twice the period
    multipliers = doubling.floquet.multipliers**2
    close = beside(curve, there, direction, b.weights, multipliers, newton, curvature_of(form), 0.7 * way)
    if close is None:
        return None, f"between {a.curve.where(a.u)} and {curve.where(there)}"
    point = close.point
    arclength = a.arclength + length(b.weights * (point.u - before))
    last = replace(point.turned, arclength=arclength)
    return last, "" if close.smooth else f"between {curve.where(point.u)} and {curve.where(there)}"


def emanating(doubling: Singular, curve: MotionProblem, weights: Array) -> Array:
    """The direction in which a curve of twice the period leaves a period doubling, unit length in its weights."""
    assert doubling.vectors is not None
    state, size = doubling.state, curve.balance.size
    scale = np.tile(state.balance.scales()[1], len(doubling.vectors.right) // size)
    phi = doubled_direction(doubling.vectors.right * scale, size, curve.balance.basis)
    direction = curve.join(phi, 0.0)
    return direction / length(weights * direction)


@dataclass(frozen=True)
class Beside:
    """A point right beside a bifurcation; `smooth`: whether nothing else happens to the motion on the way there."""

    point: CurvePoint
    smooth: bool


def beside(
    curve: MotionProblem,
    u: Array,
    direction: Array,
    weights: Array,
    multipliers: ComplexArray,
    newton: NewtonOptions,
    curvature: float | None = None,
    reach: float = np.inf,
) -> Beside | None:
    """The curve's point close to a bifurcation in a direction, with its tangent pointing away; None if there is none.

    On the way the critical multiplier leaves +1, and the parameter its value, with the square of the distance. Where
    the point's multipliers are not those of the bifurcation, or the parameter goes another way, something else happens
    in between: then one closer to it is taken, none farther than `reach`.

    u, `direction`: the bifurcation, and where the curve leaves it, of unit length in `weights`; `multipliers` of the
    motion there over the period of the curve's motions; `curvature`: which way the parameter goes, by its sign, where a
    normal form tells.
    """
    points: list[tuple[float, CurvePoint]] = []
    for distance in _DISTANCES:
        if distance > reach:
            continue
        try:
            point = _solved_beside(curve, u, distance * direction, weights, newton)
        except ConvergenceError:
            continue
        points.append((distance, point))
        if len(points) > 1 and _near(points[-2][1], multipliers) and _parabolic(points[-2], points[-1], curvature):
            return Beside(points[-2][1], True)
    return Beside(points[-1][1], False) if points else None


def _solved_beside(curve: MotionProblem, u: Array, way: Array, weights: Array, newton: NewtonOptions) -> CurvePoint:
    row = weights * way
    solved = correct(curve, u + way, row / length(row), weights, newton)
    if not 0.5 <= length(weights * (solved.u - u)) / length(row) <= 2.0:
        raise ConvergenceError("what was found lies elsewhere")
    return make_point(solved, way, 0.0)


def _near(point: CurvePoint, multipliers: ComplexArray) -> bool:
    """Whether a point has multipliers close to given ones."""
    curve = point.curve
    assert isinstance(curve, MotionProblem)
    own = floquet_multipliers(curve.balance.at(*curve.split(point.u))).multipliers
    # from a structure's larger projection there are more of them, the fast ones
    count = min(len(own), len(multipliers))
    own, expected = (np.sort_complex(mu[np.argsort(-np.abs(mu), kind="stable")][:count]) for mu in (own, multipliers))
    return float((np.abs(own - expected) / np.maximum(1.0, np.abs(expected))).max()) <= _CLOSE


def _parabolic(far: tuple[float, CurvePoint], close: tuple[float, CurvePoint], curvature: float | None) -> bool:
    """Whether the parameter goes one way between two points beside a bifurcation, and goes on so at both.

    The bifurcation's own place is not asked: cut off at a harmonic, the two curves meet a little elsewhere.
    """
    index = far[1].curve.parameter
    way = far[1].u[index] - close[1].u[index]
    slopes = [point.tangent[index] for _, point in (far, close)]
    moved = abs(way) * far[1].weights[index]
    foretold = curvature is None or curvature * way > 0.0
    return moved <= _STILL or (foretold and all(slope * way > 0.0 for slope in slopes))


def curvature_of(form: NormalForm | None) -> float | None:
    """Which way the parameter goes on the branch that leaves a bifurcation; None where its form leaves that open."""
    if form is None or form.criticality is None:
        return None
    return form.coefficients.get("curvature")
