"""Bifurcations of periodic motions by shooting alone, with free `omega`.

The periodic motions near a start form a curve of `F(z, eta) = Phi(z, eta) - z = 0`, `eta = omega / W`, `z` the scaled
state; it is followed in short steps and a test function that vanishes at the bifurcation is driven to zero along it by
a safeguarded secant iteration. Every step onto the curve is Newton with the least-norm correction, so that limit
points are points like any other. With `A = [F_z, F_eta]` and its null vector `t`:

- LP: the component of `t` along `eta` vanishes;
- PD: `det (F_z + 2 I)` vanishes (a multiplier is -1);
- NS: `|mu|^2 - 1` of one complex pair, followed by nearness;
- BP: `det [A; t^T]`, which has a null vector there; the direction that leaves the curve is not corrected while it is
  nearly singular.

Kuznetsov, Elements of Applied Bifurcation Theory, chapter 10, has these test functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.model import System
from suboctave.model.inputs import check_count, observed_dof
from suboctave.timedomain.field import Array, Field, default_lengths, scaled_field
from suboctave.timedomain.shooting import PeriodicSolution, finish
from suboctave.timedomain.trajectory import flow

__all__ = ["Curve", "CurvePoint", "locate_by_shooting", "shoot_cycle"]

_KINDS = ("LP", "PD", "NS", "BP")
_CORRECTIONS = 25  # Gauss-Newton steps onto the curve
_FIRST_STEP = 1e-4  # along the curve, in units of the size of the motion
_NEARLY_SINGULAR = 1e-5  # relative singular value below which a BP's second direction is left alone
_NO_BRANCH_POINT = 1e-4
_IDLE = 3  # iterations without a bracket in which the test function may fail to fall to half
_CYCLE = 1e-11  # residual of a motion that nothing drives
_CONSERVED = 1e-6  # logarithm of the volume of states after a period, of motions that conserve energy
_REAL_MULTIPLIER = 1e-5  # imaginary part below which a pair on the unit circle is taken for two real multipliers


class _Spent(ConvergenceError):
    """The passes through the motion that were allowed are used up."""


@dataclass(frozen=True)
class CurvePoint:
    """A point of the curve: `u` = scaled state and eta, `A`, unit null vector, monodromy, relative residual."""

    u: Array
    slopes: Array
    tangent: Array
    transition: Array
    residual: float


class Curve:
    """Periodic motions with free frequency, in the scales of the start."""

    def __init__(
        self, model: Field, periods: int, rtol: float, tol: float, branch_point: bool, budget: int | None = None
    ) -> None:
        self.model, self.periods, self.rtol, self.tol, self.budget = model, periods, rtol, tol, budget
        self.m = 2 * model.n
        self.cut = _NEARLY_SINGULAR if branch_point else 0.0
        self.evaluations = 0

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Defect (2n,), `[F_z, F_eta]` (2n, 2n + 1), scaled monodromy."""
        if not u[-1] > 0.0:
            raise ConvergenceError("the search left the positive frequencies: start closer to the bifurcation")
        if self.budget is not None and self.evaluations >= self.budget:
            raise _Spent(
                f"not settled within {self.budget} passes through the motion, near omega = "
                f"{u[-1] * self.model.reference:.9g}: start closer, or allow more"
            )
        self.evaluations += 1
        field = self.model.at_frequency(u[-1] * self.model.reference)
        end = 2.0 * np.pi * self.periods
        final, slopes, _ = flow(field, 0.0, u[:-1], end, self.rtol, slope=True)
        transition = slopes[:, :-1].copy()
        slopes[:, :-1] -= np.eye(self.m)
        return final - u[:-1], slopes, transition

    def onto(self, u: Array, along: Array | None) -> CurvePoint:
        """The point of the curve nearest to `u`, tangent oriented like `along`."""
        previous = np.inf
        for _ in range(_CORRECTIONS):
            defect, slopes, transition = self.evaluate(u)
            residual = float(np.max(np.abs(defect)))
            left, size, right = np.linalg.svd(slopes)
            keep = size > self.cut * size[0]
            step = -right[:-1][keep].T @ ((left.T @ defect)[keep] / size[keep])
            floor = self.tol * max(1.0, size[0])
            # At the floor one more step still brings digits of omega, unless the last one brought none.
            if residual <= (floor if residual > 0.1 * previous else 0.01 * floor):
                # where other curves cross the direction is that of several which lies nearest to the one ahead, or at
                # first to that of eta
                null = right[np.count_nonzero(keep) :]
                tangent = null.T @ (null @ (np.eye(1, self.m + 1, self.m)[0] if along is None else along))
                whole = float(np.linalg.norm(tangent))
                return CurvePoint(u, slopes, tangent / whole if whole > 0.0 else null[-1], transition, residual)
            length = float(np.max(np.abs(step)))
            u = u + step * min(1.0, 0.5 / length if length > 0.0 else 1.0)
            previous = residual
        raise ConvergenceError(
            f"shooting with free omega did not converge near omega = {u[-1] * self.model.reference:.9g} (relative "
            f"residual {residual:.1e} after {_CORRECTIONS} steps): start closer, for instance from shoot(...) on the "
            "same branch"
        )


def _determinant(kind: str, multiplicity: int, point: CurvePoint) -> float:
    """What vanishes like the way to a bifurcation of this kind, and changes its sign unless an even number of
    multipliers is critical at once.
    """
    if kind == "LP":
        return float(point.tangent[-1])
    if kind == "PD":
        value = float(np.linalg.det(point.transition + np.eye(len(point.transition))))
    else:
        value = float(np.linalg.det(np.vstack([point.slopes, point.tangent])))
    return float(np.copysign(abs(value) ** (1.0 / multiplicity), value))


def _neimark_sacker(start: CurvePoint) -> Callable[[CurvePoint], float]:
    """`|mu|^2 - 1` of the complex multiplier that starts nearest to the unit circle."""
    multipliers = np.linalg.eigvals(start.transition)
    upper = multipliers[multipliers.imag > 1e-6 * np.abs(multipliers)]
    if upper.size == 0:
        return lambda point: 1.0
    current = upper[np.argmin(np.abs(np.abs(upper) - 1.0))]

    def value(point: CurvePoint) -> float:
        nonlocal current
        multipliers = np.linalg.eigvals(point.transition)
        current = multipliers[np.argmin(np.abs(multipliers - current))]
        return float(abs(current) ** 2 - 1.0)

    return value


def locate_by_shooting(
    system: System,
    kind: str,
    state: ArrayLike,
    omega: float,
    periods: int = 1,
    values: Mapping[str, float] | None = None,
    tol: float = 1e-11,
    max_step: float = 0.05,
    max_iterations: int = 40,
    observe: int | str | None = None,
    rtol: float = 1e-12,
    reach: float | None = None,
    budget: int | None = None,
    multiplicity: int = 1,
) -> PeriodicSolution:
    """The LP, PD, NS or BP nearest along the curve of periodic motions through a start, `omega` free.

    `state` (2n,), `omega`: a start near it. `periods`: those of the motion itself (a PD that leads from 2T to 4T has
    2). `max_step`: longest step along the curve, in units of the size of the motion. `reach`: how far along the curve
    it is looked for, in the same units, where the first steps do not lead to it; `budget`: passes through the motion
    with its tangent flow that may be spent (default: neither is bounded but by `max_iterations`). `multiplicity`: how
    many multipliers are critical at a PD or BP that a symmetry makes multiple; an even number of them changes no sign,
    and is found from close by only. The returned solution has `kind`, and in `test` what is left of the test function.
    Raises `InputError`, or `ConvergenceError` with the place it got to. A BP is found where a symmetry makes the
    crossing branches exist at all.
    """
    if kind not in _KINDS:
        raise InputError(f"unknown kind of bifurcation {kind!r}{suggest(str(kind), _KINDS)}")
    periods, dof = check_count("periods", periods), observed_dof(system, observe)
    multiplicity = check_count("multiplicity", multiplicity)
    model, start = _in_its_size(system, state, omega, values, periods)
    curve = Curve(model, periods, rtol, tol, kind == "BP", budget)
    point = curve.onto(start, None)
    point, test, steps = _drive(curve, point, kind, multiplicity, max_step, max_iterations, reach)

    final = model.at_frequency(point.u[-1] * model.reference)
    solution = finish(
        final, point.u[:-1] * model.scale, periods, point.transition, point.residual, steps, dof, rtol, kind, test
    )
    _confirm(kind, solution, point)
    return solution


def shoot_along(
    system: System,
    state: ArrayLike,
    omega: float,
    periods: int = 1,
    values: Mapping[str, float] | None = None,
    tol: float = 1e-11,
    observe: int | str | None = None,
    rtol: float = 1e-12,
) -> PeriodicSolution:
    """The nearest point, to a state (2n,) and a frequency, of the curve of periodic motions with `omega` free.

    Right beside a limit point there may be no motion of the same omega, or one as far off as the square root of what
    separates the two frequencies; the curve is as near as anywhere. Raises ConvergenceError where there is none near.
    """
    periods, dof = check_count("periods", periods), observed_dof(system, observe)
    model, start = _in_its_size(system, state, omega, values, periods)
    point = Curve(model, periods, rtol, tol, branch_point=True).onto(start, None)
    final = model.at_frequency(point.u[-1] * model.reference)
    return finish(final, point.u[:-1] * model.scale, periods, point.transition, point.residual, 0, dof, rtol)


def _in_its_size(
    system: System, state: ArrayLike, omega: float, values: Mapping[str, float] | None, periods: int
) -> tuple[Field, Array]:
    """The field scaled by the size that a motion has over its period, and state and eta in these scales: one pass, then
    fixed, since what is measured along a curve needs one unit of length.
    """
    start = np.array(state, dtype=float)
    model = scaled_field(system, start, omega, values)
    _, _, passage = flow(model, 0.0, start / model.scale, 2.0 * np.pi * periods, 1e-6)
    model.rescale(default_lengths(model, passage.extent * model.scale))
    return model, np.append(start / model.scale, 1.0)


def shoot_cycle(
    system: System,
    state: ArrayLike,
    omega: float,
    periods: int = 1,
    values: Mapping[str, float] | None = None,
    observe: int | str | None = None,
    rtol: float = 1e-12,
    corrected: bool = True,
) -> PeriodicSolution:
    """The motion nearest to a state (2n,) and a frequency of a system that nothing drives, both corrected.

    Least-norm corrections leave the phase as it is. Without corrections (at a limit point there may be no motion of
    these parameters beside it) `residual` is by how much, relative to the motion, it misses its beginning after a
    period. Raises ConvergenceError where there is none near.
    """
    start = np.array(state, dtype=float)
    model = scaled_field(system, start, omega, values)
    u, dof = np.append(start / model.scale, 1.0), observed_dof(system, observe)
    curve = Curve(model, periods, rtol, _CYCLE, branch_point=False)
    if corrected and abs(np.linalg.slogdet(curve.evaluate(u)[2])[1]) < _CONSERVED:
        # motions of one frequency after the other: the direction towards them is not corrected either
        curve.cut = _NEARLY_SINGULAR
    if corrected:
        point = curve.onto(u, None)
        u, transition, residual = point.u, point.transition, point.residual
    else:
        defect, _, transition = curve.evaluate(u)
        residual = float(np.max(np.abs(defect)))
    final = model.at_frequency(u[-1] * model.reference)
    return finish(final, u[:-1] * model.scale, periods, transition, residual, 0, dof, rtol)


def _drive(
    curve: Curve,
    start: CurvePoint,
    kind: str,
    multiplicity: int,
    max_step: float,
    max_iterations: int,
    reach: float | None,
) -> tuple[CurvePoint, float, int]:
    """The bifurcation on the curve: by secants from the start; if they lead nowhere, between two scanned points."""
    measure = _neimark_sacker(start) if kind == "NS" else partial(_determinant, kind, multiplicity)
    try:
        located = _secants(curve, measure, start, None, max_step, max_iterations)
    except _Spent:
        raise
    except ConvergenceError:  # a step too far
        located = None
    if located is not None:
        return located
    pair = _scan(curve, kind, start, max_step, max_iterations, np.inf if reach is None else reach)
    if pair is not None:
        measure = _neimark_sacker(pair[1]) if kind == "NS" else measure
        located = _secants(curve, measure, pair[1], pair[0], max_step, max_iterations)
        if located is not None:
            return located
    far, more = f"{max_iterations} steps", f", or allow longer steps (max_step = {max_step:g})"
    if reach is not None:
        far, more = f"{reach:g} of the motion's size", ""
    raise ConvergenceError(
        f"no {kind} found along the curve of periodic motions from omega = {start.u[-1] * curve.model.reference:.9g} "
        f"within {far} either way: start closer{more}"
    )


def _secants(
    curve: Curve,
    measure: Callable[[CurvePoint], float],
    start: CurvePoint,
    other: CurvePoint | None,
    max_step: float,
    max_iterations: int,
) -> tuple[CurvePoint, float, int] | None:
    """Secant iteration on the test function along the curve, kept inside a bracket once there is one.

    `other`: a neighbour on the far side, where one is known. None when the test function does not get smaller.
    """
    point, value = start, measure(start)
    best = (abs(value), point, value)
    step, bracket = _FIRST_STEP, other
    if other is not None:  # first guess in the middle
        step = 0.5 * float(point.tangent @ (other.u - point.u))
    idle = 0
    for count in range(1, max_iterations + 1):
        following = curve.onto(point.u + step * point.tangent, point.tangent)
        new = measure(following)
        moved = float(point.tangent @ (following.u - point.u))
        idle = 0 if abs(new) < 0.5 * abs(value) else idle + 1
        if abs(new) < best[0]:
            best = (abs(new), following, new)
        if new == 0.0:
            return following, new, count
        if new * value < 0.0:
            bracket = point
        elif bracket is None and idle > _IDLE:
            return None
        slope = (new - value) / moved if moved != 0.0 else 0.0
        wanted = -new / slope if slope != 0.0 else float(np.copysign(max_step, step))
        in_omega = abs(wanted * following.tangent[-1])
        if in_omega <= 2e-13 and abs(wanted) <= 1e-9:
            return best[1], best[2], count
        if count > 5 and in_omega <= 1e-10 and abs(wanted) <= 1e-7 and abs(new) >= best[0]:
            return best[1], best[2], count  # the noise of the integration: no further digit to be had
        limit = max_step if count > 1 or other is not None else min(max_step, 100.0 * _FIRST_STEP)
        if bracket is not None:
            room = float(following.tangent @ (bracket.u - following.u))
            if room == 0.0 or not 0.0 <= wanted / room <= 1.0:
                wanted = 0.5 * room
        step = float(np.clip(wanted, -limit, limit))
        point, value = following, new
    return None


def _scan(
    curve: Curve, kind: str, start: CurvePoint, max_step: float, max_iterations: int, reach: float
) -> tuple[CurvePoint, CurvePoint] | None:
    """The first two neighbours between which the kind of bifurcation lies, walking both ways with growing steps."""
    step, walked = 10.0 * _FIRST_STEP, 0.0
    ends = [start, start]
    sides = [_side(kind, start)] * 2
    for _ in range(max_iterations):
        for way, sign in enumerate((1.0, -1.0)):
            last = ends[way]
            try:
                following = curve.onto(last.u + sign * step * last.tangent, last.tangent)
            except _Spent:
                raise
            except ConvergenceError:
                continue
            side = _side(kind, following)
            if side != sides[way]:
                return last, following
            ends[way] = following
        walked += step
        if walked >= reach:
            return None
        step = min(max_step, 1.5 * step)
    return None


def _side(kind: str, point: CurvePoint) -> float:
    """What changes at a bifurcation of this kind, and has no pole: a sign, or for NS a number of pairs."""
    if kind != "NS":
        return float(np.sign(_determinant(kind, 1, point)))
    multipliers = np.linalg.eigvals(point.transition)
    return float(np.sum((np.abs(multipliers) > 1.0) & (multipliers.imag != 0.0)) // 2)


def _confirm(kind: str, solution: PeriodicSolution, point: CurvePoint) -> None:
    """Refuse a point that is not what was asked for."""
    mu = solution.multipliers
    where = f"near omega = {solution.omega:.9g}"
    if kind == "NS":
        off_axis = np.abs(mu.imag) > _REAL_MULTIPLIER
        if not np.any(np.abs(np.abs(mu[off_axis]) - 1.0) < 1e-6):
            raise ConvergenceError(f"the pair of multipliers followed became real {where}: no NS there")
    if kind == "BP":
        size = np.linalg.svd(point.slopes, compute_uv=False)
        if size[-1] > _NO_BRANCH_POINT * size[0]:
            raise ConvergenceError(f"no branch point {where}: no second branch crosses there (is it an LP?)")
