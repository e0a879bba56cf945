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
from suboctave.bifurcation.bordered import doubled_direction, null_vectors
from suboctave.bifurcation.normal_form import NormalForm, normal_form
from suboctave.continuation.ending import Ending, EndReason
from suboctave.continuation.linear import distance, length
from suboctave.continuation.march import Arrival
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, between, make_point
from suboctave.continuation.problem import Array
from suboctave.curves.blow_up import BlownUp, BlownUpEvaluation, DoubledMotions
from suboctave.curves.events.locate import Guess, Singular, locate_multiple, locate_singular
from suboctave.curves.identity import apart
from suboctave.curves.motion import MotionProblem
from suboctave.curves.trace import Unsettled
from suboctave.errors import ConvergenceError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import choose_harmonics, most_harmonics

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
    x = u[: curve.balance.dimension].reshape(basis.size, -1) * curve.balance.scales[0]
    return [x[rows].ravel() for rows in _rows_of_parts(basis.nu, basis.harmonics)]


def repeats_earlier(orbit: PeriodicOrbit) -> bool:
    """Whether a motion repeats after a part of the period that it is written with."""
    basis, scales = orbit.basis, orbit.balance.scales[0]
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


#: distances from a branch point, in scaled arclength, at which a branch that leaves it begins
_DISTANCES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
#: size of the odd part, in units of the motion, at which a branch of doubled motions begins
_FIRST = 3e-3
#: factor by which it is divided while the motion there is not yet like that of the bifurcation
_CLOSER = 3.0
#: least size at which it begins: beyond, rounding turns the odd part
_LEAST = 1e-6
#: by how much the ratio of the parameter's way to the square of the odd part may change from one size to the next
_BENT = 0.05
#: cosine of the directions of two odd parts that are one, at least
_ALIKE = 0.5
#: distance, as a share of the step that passes a doubling, between where it is foretold and where it is found, at most
_FORETOLD = 0.4
#: halvings of a step towards the place at which the odd part vanishes: Newton's method does the rest
_HALVED = 20
#: share of a motion by which the first or last motion of a branch may differ from that of the bifurcation beside it
_BESIDE = 0.02
#: multipliers that differ by less (relative to moduli above one) are those of one neighbourhood
_CLOSE = 0.02
#: distance of a multiplier from +1 up to which a motion cannot be told from those of other branches that leave a
#: multiple bifurcation
MERGED = 1e-6
#: way in the scaled parameter that rounding may account for
_STILL = 1e-10
#: what a branch says where it could not look closer
UNSEEN = "motions change too fast beside the bifurcation, events may be missing"


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


def unseen(name: str, first: float, last: float) -> Unsettled:
    """The stretch between a bifurcation and the first or last motion of a branch, which has no arclength."""
    return Unsettled(name, first, last, (0.0, 0.0), UNSEEN)


def period_name(nu: int) -> str:
    """T, 2T, 4T, ..."""
    return "T" if nu == 1 else f"{nu}T"


def regular_point(point: CurvePoint) -> CurvePoint:
    """A point of a curve as it is followed: one of doubled motions in coordinates blown up."""
    curve = point.curve
    regular = curve.regular(point.u) if isinstance(curve, DoubledMotions) else None
    return point if regular is None else regular.blown_up_point(point)


def plain_point(point: CurvePoint, before: CurvePoint | None) -> CurvePoint:
    """A point of a curve blown up as one of its motions, behind the last one there."""
    assert isinstance(point.curve, BlownUp)
    return point.curve.plain_point(point, 0.0) if before is None else point.curve.behind(point, before)


def passes_doubling(b: CurvePoint) -> bool:
    """Whether the second of two neighbours lies behind the period doubling that a branch of doubled motions meets."""
    return isinstance(b.curve, BlownUp) and float(b.u[b.curve.size_of_odd]) <= 0.0


@dataclass(frozen=True)
class Meeting:
    """A branch that meets its parent: the parent's period doubling, its curve, how the march ends.

    `doubt`: the stretch between the last point and the parent if something may happen unseen there;
    `multiplicity`: of the period doubling.
    """

    solution: Singular
    parent: MotionProblem
    arrival: Arrival
    doubt: Unsettled | None = None
    multiplicity: int = 1

    def behind(self, before: CurvePoint) -> Arrival:
        """How the march ends, its last point behind another one."""
        last = self.arrival.point
        if last is None:
            return self.arrival
        arclength = before.arclength + distance(last.u, last.curve.transfer(before.u, before.curve), last.weights)
        return replace(self.arrival, point=replace(last, arclength=arclength))


def lost(a: CurvePoint) -> Arrival:
    """How a march ends behind a point where the odd part vanishes and nothing was found there."""
    where = a.curve.where(a.u)
    detail = f"the odd harmonics vanish, but no period doubling of the motions of half the period was found at {where}"
    return Arrival(None, Ending(EndReason.NO_MEANING, where, detail))


def meeting(a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> Meeting | None:
    """The parent's period doubling in which the odd part vanishes between two neighbours in coordinates blown up; None
    if it is not solved for.
    """
    try:
        landed = _landed(a, b, newton)
        doubling, several = _doubling_at(landed)
        if several == 1 and landed.orientation != a.orientation:
            # that of another branch, onto which the step has jumped
            return None
        while several == 1 and (finer := _finer(landed, doubling)) is not None:
            landed = _landed_with(finer, landed, newton)
            doubling, several = _doubling_at(landed)
    except ConvergenceError:
        return None
    motions, state = _motions_of(landed), doubling.state
    parent = motions.with_basis(motions.balance.basis.halved).with_balance(state.balance)
    before, smooth = _last_before(a, landed, doubling, newton)
    there = motions.transfer(parent.u_of(state), parent)
    where = motions.where(there)
    last = float((a if before is None else before).u[-1])
    doubt = None if smooth else unseen(motions.name, last, float(there[-1]))
    reason = f"reached the {period_name(parent.balance.basis.nu)} motion at its period doubling at {where}"
    arrival = Arrival(before, Ending(EndReason.MET_BRANCH, where, reason))
    return Meeting(doubling, parent, arrival, doubt, several)


def _motions_of(landed: CurvePoint) -> DoubledMotions:
    """The curve as it stands on which a point in coordinates blown up lies."""
    assert isinstance(landed.curve, BlownUp)
    return landed.curve.motions


def _landed(a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> CurvePoint:
    """The point between two neighbours at which the odd part vanishes; ConvergenceError where it is not found."""
    curve = b.curve
    assert isinstance(curve, BlownUp)
    at, low, high = curve.size_of_odd, 0.0, 1.0
    for _ in range(_HALVED):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if between(a, b, middle)[at] > 0.0 else (low, middle)
    guess = between(a, b, high)
    guess[at] = 0.0
    solved = correct(curve, guess, at, b.weights, newton)
    if solved.distance > _FORETOLD * distance(b.u, curve.transfer(a.u, a.curve), b.weights):
        raise ConvergenceError("what was found lies elsewhere")
    return make_point(solved, b.tangent, a.arclength)


def _landed_with(motions: DoubledMotions, landed: CurvePoint, newton: NewtonOptions) -> CurvePoint:
    """The same point of the branch with other harmonics; ConvergenceError where there is none."""
    curve = motions.blown_up
    guess, tangent = (curve.transfer(vector, landed.curve) for vector in (landed.u, landed.tangent))
    solved = correct(curve, guess, curve.size_of_odd, curve.weights(guess, 0.0), newton)
    return make_point(solved, tangent, landed.arclength)


def _doubling_at(landed: CurvePoint) -> tuple[Singular, int]:
    """The parent's period doubling where the odd part vanishes, and how many fall together there."""
    curve = landed.curve
    assert isinstance(curve, BlownUp)
    motions = curve.motions
    x, omega, values = motions.split(curve.motion(landed.u))
    basis = motions.balance.basis
    half = basis.even_part(x)
    balance = motions.with_basis(basis.halved).balance.settle(half, omega, values)
    state = balance.at(half, omega, values)
    guess = Guess(state, motions.name, motions.span)
    away = np.abs(floquet_multipliers(state).multipliers + 1.0)
    several = int(np.count_nonzero(away <= 1.1 * away.min() + MERGED))
    if several > 1:
        with suppress(ConvergenceError):
            return locate_multiple(guess, Kind.HALF, several), several
    with suppress(ConvergenceError):
        found = locate_singular(guess, Kind.HALF)
        moved = motions.transfer(guess.vector(found.state), motions.with_balance(found.state.balance))
        if length(motions.weights(moved, 0.0) * (moved - curve.motion(landed.u))) <= _BESIDE:
            return found, 1
    # with one harmonic more than the branch has the parent's doubling may lie elsewhere
    vectors = null_vectors(state, Kind.HALF)
    return Singular(state, vectors, 0.0, landed.evaluation.error, landed.iterations), 1


def _finer(landed: CurvePoint, doubling: Singular) -> DoubledMotions | None:
    """The branch with as many harmonics as its parent's doubling is listed with; None where it has them."""
    motions = _motions_of(landed)
    rule = motions.adaptive
    if rule is None:
        return None
    assert isinstance(landed.evaluation, BlownUpEvaluation)
    wanted = choose_harmonics(doubling.state, rule, rule.event_tolerance).doubled
    wanted = replace(wanted, harmonics=min(wanted.harmonics, most_harmonics(landed.evaluation.state, rule)))
    if wanted.size <= motions.balance.basis.size:
        return None
    try:
        finer = motions.finer(landed.evaluation.state, wanted)[0]
    except ConvergenceError:
        return None
    assert isinstance(finer, DoubledMotions)
    return finer


def _last_before(
    a: CurvePoint, landed: CurvePoint, doubling: Singular, newton: NewtonOptions
) -> tuple[CurvePoint | None, bool]:
    """The branch's point right before it meets its parent, headed there, None if there is none behind another one; and
    whether nothing else happens on the way from there.
    """
    curve = landed.curve
    assert isinstance(curve, BlownUp)
    # over twice the period
    multipliers = doubling.floquet.multipliers**2
    leads = doubling_curvature(doubling, curve.motions.name)
    most = 0.7 * float(a.u[-2])
    close = beside_doubling(curve, landed.u, landed.weights, multipliers, newton, leads, most)
    return (None, False) if close is None else (close.point.turned, close.smooth)


def leaving_doubling(
    curve: DoubledMotions,
    u: Array,
    direction: Array,
    multipliers: ComplexArray,
    newton: NewtonOptions,
    curvature: float | None,
) -> Beside | None:
    """The first point of the branch that leaves a period doubling, as `beside`.

    u, `direction`: the parent's motion and the doubled null vector there, as vectors (X, free parameter).
    """
    blown_up = curve.blown_up
    columns = curve.balance.column_weights
    w = direction[:-1] / length(columns * direction[:-1])
    start = np.concatenate((blown_up.joined(u[:-1], w, 1.0), [0.0, u[-1]]))
    weights = blown_up.weights(start, 0.0)
    with suppress(ConvergenceError):
        start = correct(blown_up, start, blown_up.size_of_odd, weights, newton).u
    return beside_doubling(blown_up, start, weights, multipliers, newton, curvature)


def doubling_curvature(doubling: Singular, name: str) -> float | None:
    """Which way the parameter goes on the branch that leaves a period doubling, also where its stability is open; None
    where there is no normal form.
    """
    assert doubling.vectors is not None
    with suppress(ConvergenceError):
        return normal_form("PD", doubling.state, doubling.vectors, name).coefficients.get("curvature")
    return None


def beside_doubling(
    curve: BlownUp,
    u: Array,
    weights: Array,
    multipliers: ComplexArray,
    newton: NewtonOptions,
    curvature: float | None,
    most: float = np.inf,
) -> Beside | None:
    """The point of a branch right beside the period doubling at u that it leaves, headed away; None if there is none.

    With the size eps of the odd part the parameter moves like `c eps^2`, and multipliers leave those of the doubling.
    The odd part is divided until this is so: where it is not something else happens on the way.

    `multipliers` of the parent's motion over the period of the curve's; `curvature`: the sign of c, where a normal form
    tells it; `most`: the largest odd part.
    """
    at, along = curve.size_of_odd, np.zeros(len(u))
    along[at] = 1.0 / weights[at]
    size = min(_FIRST / float(weights[at]), most)
    columns = np.where(curve.odd, curve.motions.balance.column_weights**2, 0.0)
    points: list[tuple[CurvePoint, float]] = []
    while size * weights[at] >= _LEAST:
        guess, tried = u.copy(), size
        guess[at] = tried
        size /= _CLOSER
        try:
            solved = correct(curve, guess, at, weights, newton)
            point = curve.plain_point(make_point(solved, along, 0.0), 0.0)
        except ConvergenceError:
            continue
        if float((columns * u[:-2]) @ solved.u[:-2]) < _ALIKE:
            continue
        moved = float(weights[-1] * (solved.u[-1] - u[-1]))
        points.append((point, 0.0 if abs(moved) <= _STILL else moved / tried**2))
        if len(points) > 1:
            (before, one), (_, other) = points[-2:]
            # at a doubling right beside a grazing it may do so on both sides of a turn
            foretold = curvature is None or curvature * other >= 0.0
            if foretold and _near(before, multipliers) and abs(one - other) <= _BENT * abs(other):
                return Beside(before, True)
    return Beside(points[-1][0], False) if points else None


def emanating(doubling: Singular, curve: MotionProblem, weights: Array) -> Array:
    """The direction in which a curve of twice the period leaves a period doubling, unit length in its weights."""
    assert doubling.vectors is not None
    state, size = doubling.state, curve.balance.size
    scale = np.tile(state.balance.scales[1], len(doubling.vectors.right) // size)
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
) -> Beside | None:
    """The curve's point close to a bifurcation in a direction, with its tangent pointing away; None if there is none.

    On the way the critical multiplier leaves +1, and the parameter its value, with the square of the distance. Where
    the point's multipliers are not those of the bifurcation, or the parameter goes another way, something else happens
    in between: then one closer to it is taken.

    u, `direction`: the bifurcation, and where the curve leaves it, of unit length in `weights`; `multipliers` of the
    motion there over the period of the curve's motions; `curvature`: which way the parameter goes, by its sign, where a
    normal form tells.
    """
    points: list[tuple[float, CurvePoint]] = []
    for way in _DISTANCES:
        try:
            point = _solved_beside(curve, u, way * direction, weights, newton)
        except ConvergenceError:
            continue
        points.append((way, point))
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
