"""Multiple bifurcations as a branch lists them: each with null vectors along which a branch leaves.

The null space of m dimensions does not say where the branches are that leave it: its own symmetry does. Beside the
bifurcation, at a distance d along a unit vector phi of that space,

    R(X_0 + d phi + Y, p) = 0,    Y without a component along phi,

has a solution wherever a branch passes that hyperplane. Starts all over the space find those there are; each is solved
for again along its own direction, there and half as far, which foretells the direction at the bifurcation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import doubled_direction
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.notes import Note
from suboctave.continuation.point import make_point
from suboctave.curves.events.monitors import Located, Multiple
from suboctave.curves.junction import MERGED, Beside
from suboctave.curves.kinds.multiple import MultipleEquations, MultiplePoint
from suboctave.curves.motion import MotionProblem
from suboctave.curves.refine import bifurcation_at
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.perturbation import Kind

#: distances from the bifurcation, in scaled arclength, at which branches are looked for: close to it all directions are
#: alike where terms of high order alone tell them apart
_DISTANCES = (0.3, 0.1, 0.03, 0.01)
_NEWTON = NewtonOptions(tolerance=1e-13, correction=1e-9, iterations=15, longest=0.1, rounding=True)
#: how far the branch that passes there may lie from the bifurcation, in units of that distance
_FAR = 4.0
#: distances at which the first point of a branch is looked for
_FIRST = (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
#: directions tried in a plane; beyond it, random ones for each dimension
_FAN = 12
#: cosine beyond which two directions are one; share of the range, in units of the distance, that tells two sorts of
#: branches apart; sine of the angle with those chosen, at least
_ONE, _ALIKE, _INDEPENDENT = 0.999, 1e-4, 0.2


def multiple_at(located: Located, a: Sample, b: Sample, observe: int, notes: list[Note]) -> list[Bifurcation]:
    """The bifurcations that fall together between two neighbours, as many as there are; none where they are not found
    with the harmonics that events ask for.
    """
    item = bifurcation_at(located, a, b, observe, notes)
    if item is None or item.null_vectors is None:
        return []
    kind = located.kind
    assert isinstance(kind, Multiple)
    m, state = kind.multiplicity, item.orbit.state()
    own = MultiplePoint.of(state, kind.operator, m, item.parameter_name, item.kappa)
    kappa = np.array([item.kappa]) if kind.operator is Kind.FREE else np.zeros(own.extras)
    equations = own.at(state, kappa, (item.parameter_name,))
    curve = b.curve.with_balance(item.orbit.balance)
    mixed = np.eye(m) if kind.operator is Kind.FREE else np.array(_leaving(item, equations, curve))
    return [replace(item, multiplicity=m, null_vectors=equations.vectors(one)) for one in mixed]


def _leaving(item: Bifurcation, equations: MultipleEquations, curve: MotionProblem) -> list[Array | ComplexArray]:
    """Unit combinations, (m,), of the null vectors along which branches leave: independent ones, of different sorts
    first, and where there are too few any that complete them.
    """
    orbit, (right, _, _) = item.orbit, equations.solved
    columns, size = (right * equations.scale[:, None]).T, curve.balance.size
    if equations.of.kind is Kind.HALF:
        curve = curve.with_basis(orbit.basis.doubled)
        columns = np.array([doubled_direction(v, size, curve.balance.basis).ravel() for v in columns])
    x = orbit.basis.resized(orbit.x, curve.balance.basis)
    u = curve.join(x, item.parameter(item.parameter_name))
    curve = curve.with_balance(curve.balance.settle(x, orbit.omega, orbit.values))
    weights = curve.weights(u, 0.0)
    ways = [curve.join(v.real, 0.0) for v in columns]
    ways = [way / length(weights * way) for way in ways]
    found: list[tuple[float, Array]] = []
    for distance in _DISTANCES:
        for start in _starts(len(ways)):
            with suppress(ConvergenceError):
                found += _toward(curve, u, weights, ways, start, distance, [mix for _, mix in found])
        if len(found) >= len(ways):
            break
    return independent(found, len(ways))


def _toward(
    curve: MotionProblem, u: Array, weights: Array, ways: list[Array], start: Array, distance: float, known: list[Array]
) -> list[tuple[float, Array]]:
    """The branch that leaves about in a direction, unless it is known: how far its parameter moves, in units of the
    distance, and its direction, foretold from there and half as far.
    """
    mix, _ = _passing(curve, u, weights, ways, start, distance)
    mix, moved = _passing(curve, u, weights, ways, mix, distance)
    closer, _ = _passing(curve, u, weights, ways, mix, 0.5 * distance)
    closer *= math.copysign(1.0, float(closer @ mix))
    mix = 2.0 * closer - mix
    mix /= length(mix)
    return [] if any(abs(float(mix @ other)) > _ONE for other in known) else [(moved / distance, mix)]


def branch_beside(curve: MotionProblem, u: Array, weights: Array, way: Array, distance: float) -> Array:
    """From a multiple bifurcation u to where a branch passes the hyperplane at a distance along a null vector, of unit
    length in `weights`; ConvergenceError where none does.
    """
    there = correct(curve, u + distance * way, weights * way, weights, _NEWTON).u - u
    if length(weights * there) > _FAR * distance:
        raise ConvergenceError("what was found lies elsewhere")
    return np.asarray(there)


def first_beside(curve: MotionProblem, u: Array, weights: Array, way: Array) -> Beside:
    """The first point of a branch that leaves a multiple bifurcation u along a null vector, headed away: as close to it
    as the branch can be told from others that leave there; ConvergenceError where there is none.
    """
    moved: list[float] = []
    for distance in _FIRST:
        with suppress(ConvergenceError):
            solved = correct(curve, u + distance * way, weights * way, weights, _NEWTON)
            point = make_point(solved, way, 0.0)
            mu = floquet_multipliers(curve.balance.at(*curve.split(point.u))).multipliers
            if length(weights * (point.u - u)) > _FAR * distance:
                continue
            moved.append(float(point.u[curve.parameter] - u[curve.parameter]))
            told = bool(np.abs(mu - 1.0).min() > MERGED)
            if told or distance == _FIRST[-1]:
                ways = [*moved, float(point.tangent[curve.parameter])]
                return Beside(point, told and all(one * moved[0] > 0.0 for one in ways))
    raise ConvergenceError(f"no branch that leaves {curve.where(u)} along the null vector was found beside it")


def _passing(
    curve: MotionProblem, u: Array, weights: Array, ways: list[Array], mix: Array, distance: float
) -> tuple[Array, float]:
    """The unit combination of the null vectors along which a branch leaves about in the direction of another, and how
    far its free parameter has moved, as a share of the range.
    """
    there = branch_beside(curve, u, weights, np.array(ways).T @ mix, distance)
    along = np.array([float((weights * way) @ (weights * there)) for way in ways])
    return along / length(along), float(weights[-1] * there[-1])


def _starts(m: int) -> Iterator[Array]:
    """Directions all over a space of m dimensions, opposite ones left out; the same in every run."""
    if m == 2:
        for angle in math.pi / _FAN * np.arange(_FAN):
            yield np.array([math.cos(angle), math.sin(angle)])
        return
    yield from np.eye(m)
    random = np.random.default_rng(0).normal(size=(_FAN * m, m))
    yield from random / np.linalg.norm(random, axis=1)[:, None]


def independent(found: Sequence[tuple[float, Array | ComplexArray]], m: int) -> list[Array | ComplexArray]:
    """m independent directions of those found, one of each sort first, completed where there are too few.

    found: how far the parameter moves along each, which tells sorts apart, and unit vectors (m,), real or complex.
    """
    sorts: list[list[Array | ComplexArray]] = []
    moves: list[float] = []
    for moved, mix in sorted(found, key=lambda entry: -abs(entry[0])):
        alike = next((i for i, other in enumerate(moves) if abs(abs(other) - abs(moved)) <= _ALIKE * abs(other)), None)
        if alike is None:
            moves.append(moved)
            sorts.append([mix])
        else:
            sorts[alike].append(mix)
    order = [sort[0] for sort in sorts] + [mix for sort in sorts for mix in sort[1:]] + list(np.eye(m))
    chosen: list[Array | ComplexArray] = []
    span = np.zeros((m, 0), dtype=complex)
    for mix in order:
        rest = mix - span @ (span.conj().T @ mix)
        size = float(np.linalg.norm(rest))
        if len(chosen) < m and size > _INDEPENDENT:
            chosen.append(mix)
            span = np.column_stack((span, rest / size))
    return chosen
