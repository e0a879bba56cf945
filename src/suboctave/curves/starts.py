"""The first point of a branch, and in which harmonics it is written.

It is found from a given motion, or, without one, by Newton's method from the linear response; where that fails (it can
cycle for ever on a contact that is closed at rest, and nothing is linear about a body between stops), by a path that
leads from a linear structure without resonances to the system,

    share (A X + F) + (1 - share) B X = P,        B_k = omega^2 (1 + i k) m,

from share = 0 to 1 by continuation. At 0 there is one motion, so that a path that stays bounded cannot come back
there: it reaches 1 through whatever folds lie on the way (Allgower & Georg, Numerical Continuation Methods, 1990,
chapter 11). Damping and restoring forces bound it, linear stiffness or not, contacts closed at rest or not. With few
harmonics that path is short, but with few a motion that is made of impacts may not exist: then what rest leads to in
time tells how many it has; at last the path, with as many as it needs.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from suboctave.continuation.linear import length
from suboctave.continuation.march import March, SteppingOptions
from suboctave.continuation.newton import NewtonOptions, correct, null_row
from suboctave.continuation.point import CurvePoint, make_point
from suboctave.continuation.problem import Array
from suboctave.curves.blow_up import DoubledMotions
from suboctave.curves.floating import Floating, unheld
from suboctave.curves.motion import LEAST, MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError, InputError, NotFiniteError
from suboctave.harmonic.assembly import apply_blocks, block_diagonal
from suboctave.harmonic.basis import ComplexArray, HarmonicBasis, spectrum_to_real
from suboctave.harmonic.condensed import linear_part_of
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics, holding
from suboctave.lazy import lazy
from suboctave.model.projected import ProjectedSystem
from suboctave.model.system import System
from suboctave.projection import small_system
from suboctave.timedomain import Trajectory, integrate

#: harmonics that are expected of a rule that chooses them
_EXPECTED = 15
#: unknowns of a dense problem beyond which a run is refused (a matrix of half a gigabyte)
_DENSE_UNKNOWNS = 8000

#: sizes of a change of a motion at which forces are compared with linear ones
_SIZES = np.geomspace(1e-12, 1e12, 145).tolist()

Harmonics = int | str | AdaptiveHarmonics


def make_curve(
    system: System,
    name: str,
    omega: float,
    span: float,
    harmonics: Harmonics,
    nu: int,
    linear: LinearPart | None,
    observe: int = 0,
) -> MotionProblem:
    """The curve of a system's motions of `nu` load periods along a free parameter; InputError where it cannot be."""
    loaded = max([1] + [c.harmonic for c in system.load_components()])
    rule = rule_of(harmonics)
    adaptive = rule if isinstance(rule, AdaptiveHarmonics) else None
    high = rule if isinstance(rule, int) else max(rule.minimum, loaded)
    if linear is not None and not isinstance(linear, LinearPart):
        raise InputError(f"linear must fulfil suboctave.harmonic.LinearPart, {type(linear).__name__} does not")
    if linear is None:
        kept = high if adaptive is None else max(high, _EXPECTED)
        linear = linear_part_of(
            system, None, (kept + 0.5) * (omega + (span if name == "omega" else 0.0)), None, [observe]
        )
    basis = HarmonicBasis(high * nu, nu)
    check_unknowns(linear.size, basis)
    curve = MotionProblem if nu % 2 else DoubledMotions
    return curve.response(HarmonicBalance(system, basis, linear=linear), name, omega, span, adaptive)


def rule_of(harmonics: Any) -> AdaptiveHarmonics | int:
    """How harmonics are chosen, or how many of omega are kept: the argument `harmonics` of the verbs, checked."""
    rule = AdaptiveHarmonics() if isinstance(harmonics, str) and harmonics == "adaptive" else harmonics
    if isinstance(rule, AdaptiveHarmonics):
        return rule
    if isinstance(rule, (int, np.integer)) and not isinstance(rule, bool) and rule >= 1:
        return int(rule)
    raise InputError(
        f'harmonics must be a whole number of at least 1, "adaptive" or AdaptiveHarmonics(...), not {harmonics!r}'
    )


def harmonics_of(orbit: PeriodicOrbit) -> Harmonics:
    """The rule or the number of harmonics of the load that a motion was computed with."""
    return orbit.adaptive or max(1, orbit.basis.harmonics // orbit.basis.nu)


def check_unknowns(size: int, basis: HarmonicBasis) -> None:
    """Refuse bases whose dense matrices would not fit; `size`: unknown DOFs."""
    unknowns = size * basis.size
    if unknowns > _DENSE_UNKNOWNS:
        raise InputError(
            f"{unknowns} unknowns ({size} DOFs with {basis.harmonics // basis.nu} harmonics) are more than the "
            f"{_DENSE_UNKNOWNS} for which dense matrices fit. Keep fewer harmonics, or reduce the model to its lowest "
            "modes P: System(P.T @ M @ P, P.T @ C @ P, P.T @ K @ P, ...), with direction=P[dof] in place of dof="
        )


def own_linear_part(orbit: PeriodicOrbit, system: System | None = None) -> LinearPart:
    """The linear part an orbit was solved with, at its or a system's parameters."""
    return orbit.balance.linear.rebuilt(orbit.values if system is None else dict(system.parameters))


_PATH = "path from a heavily damped linear structure"
#: how the path is followed: contacts that begin or cease turn it within very short ways
_STEPPING = SteppingOptions(max_step=0.1, initial_step=0.02, min_step=1e-9, max_points=800)
#: singular value of R_X, in units of omega^2 and of the masses, below which something moves freely
_FREE = 1e-9
#: periods in time in which a motion has settled as a rule, or so nearly that Newton's method arrives
_PERIODS = 100
#: samples of a period of the load that tell how many harmonics a motion has
_SAMPLES = 1024
#: growth of the motion along the path from which on it is called unbounded
_UNBOUNDED = 1e4


def bounded_response(curve: MotionProblem, value: float) -> Array:
    """u of the response without elements, at a value of the free parameter, of a structure to which a share `LEAST` of
    B is added: that bounds resonances and the ways of bodies which nothing holds, and hardly changes anything else.
    """
    state = _at_rest(curve, value)
    blocks = state.blocks + LEAST * _holding_blocks(state)
    return curve.join(apply_blocks(np.linalg.inv(blocks).astype(complex), state.load), value)


def linear_response(curve: MotionProblem, value: float) -> Array:
    """u of the response without elements, at a value of the free parameter; where that is no motion of any use, in an
    undamped resonance or of a body that hardly anything holds, the bounded one.
    """
    state, bounded = _at_rest(curve, value), bounded_response(curve, value)
    try:
        inverse = np.linalg.inv(state.blocks).astype(complex)
    except np.linalg.LinAlgError:
        return bounded
    u = curve.join(apply_blocks(inverse, state.load), value)
    return u if LEAST * curve.size(u) <= curve.size(bounded) else bounded


def _at_rest(curve: MotionProblem, value: float) -> BalanceState:
    """The system at rest, at a value of the free parameter."""
    return curve.balance.at(*curve.split(curve.join(np.zeros(curve.balance.dimension), value)))


def _holding_blocks(state: BalanceState) -> ComplexArray:
    """B at the harmonics, (H + 1, size, size): `omega^2 (1 + i k / nu) m` at the multiple k omega / nu."""
    multiples = state.basis.multiples
    masses = np.diag(state.omega**2 * state.balance.scales[0] ** 2)
    return np.asarray((1.0 + 1j * multiples)[:, None, None] * masses, dtype=complex)


#: how far off the value that was asked for a motion may lie, relative to it
_THERE = 1e-9


def start_point(
    curve: MotionProblem,
    value: float,
    given: Any,
    newton: NewtonOptions,
    reach: tuple[float, float] | None = None,
) -> CurvePoint:
    """A solved point of the curve at a value of the free parameter, in a basis that suits it.

    Parameters
    ----------
    given
        None, a `PeriodicOrbit`, coefficients (2 H + 1, n), or a state `(x, dx/dt)` of shape (2 n,) from which time
        integration leads to the motion.
    reach
        Range in which the nearest motion of the curve may lie, where there is none beside a given one at the value
        itself, as at a limit point; without it only there.

    Raises
    ------
    ConvergenceError
        If no motion is found; says what was tried.
    """
    tried = []
    linear = bounded_response(curve, value)
    curve.reference = max(curve.reference, curve.size(linear))
    if given is not None:
        if isinstance(given, PeriodicOrbit) and curve.adaptive is not None and given.basis.nu == curve.balance.basis.nu:
            curve = curve.with_basis(given.basis)
        return _beside_given(curve, value, given, newton, reach)
    patient = replace(newton, iterations=max(newton.iterations, 40), damped=True)
    ways: list[tuple[str, Callable[[], tuple[MotionProblem, Array]]]] = []
    kept, count = _like(curve, None, curve.reference), curve.balance.basis.harmonics
    ways += [
        (f"linear response with {count} harmonics", partial(lambda c: (c, linear_response(c, value)), curve)),
        (f"{_PATH} with {count}", partial(_released, kept, value, newton)),
        (f"motion after {_PERIODS} periods in time", partial(_after_periods, curve, value)),
    ]
    if curve.adaptive is not None:
        ways.append((f"{_PATH} with as many as it needs", partial(_released, curve, value, newton)))
    loose: Floating | str | None = None
    wall: NotFiniteError | None = None
    for name, guess_by in ways:
        try:
            begun, guess = guess_by()
            begun = curve.with_balance(begun.balance)
            loose = loose or _loose(begun, guess)
            return settled(begun, guess, patient)
        except Floating as failure:
            loose = failure
        except ConvergenceError as failure:
            wall = failure if isinstance(failure, NotFiniteError) else wall
            reason = str(failure)
            if reason not in tried:
                tried += [name, reason]
    where = curve.where(linear)
    if isinstance(loose, Floating):
        raise ConvergenceError(f"no motion found to start from at {where}: {loose}, or start elsewhere in the range")
    if wall is not None:
        raise NotFiniteError(
            f"no motion found to start from at {where}: {wall}. Give start= (an orbit, or a state) on one side of that "
            "place"
        )
    raise ConvergenceError(
        f"no motion found to start from at {where}{loose or ''}. Tried: " + "; ".join(tried) + ". "
        "Start elsewhere in the range, or give start= (an orbit, or a state near the motion)"
    )


def _beside_given(
    curve: MotionProblem, value: float, given: Any, newton: NewtonOptions, reach: tuple[float, float] | None
) -> CurvePoint:
    """The curve's point beside a given motion, as `start_point`."""
    (curve, guess), hint = _from_given(curve, value, given), ""
    try:
        return settled(curve, guess, newton)
    except ConvergenceError as error:
        failure = error
    if isinstance(given, PeriodicOrbit):
        # at a limit point the equations are singular at a fixed parameter: the nearest point of the curve
        with suppress(ConvergenceError):
            nearest = settled(curve, guess, newton, null_row)
            low, high = sorted(reach or (value, value))
            slack = _THERE * max(abs(low), abs(high))
            if low - slack <= nearest.parameter <= high + slack:
                return nearest
            where = curve.where(nearest.u)
            hint = f"the nearest one is at {where}. Begin the range there, or give another start"
    raise ConvergenceError(f"no motion found from the given start at {curve.where(guess)}: {hint or failure}")


def linear_up_to(rest: BalanceState, change: Array, allowed: float) -> tuple[float, float]:
    """Sizes of a change of a motion, neighbours on a scale of powers: up to the first one forces are linear, from the
    second on they deviate from that by more than `allowed` times the size. Zero where they do at all sizes, infinite at
    none.

    `change`: coefficients (2 H + 1, size) of size one; `allowed`: norm of a force.
    """
    slope = rest.force_jacobian @ change.ravel()

    def bent(size: float) -> bool:
        force = rest.balance.at(rest.x + size * change, rest.omega, rest.values).force - rest.force
        return not np.isfinite(force).all() or length(force.ravel() / size - slope) > allowed

    at = bisect_left(_SIZES, True, key=bent)
    return _SIZES[at - 1] if at else 0.0, _SIZES[at] if at < len(_SIZES) else math.inf


def _loose(curve: MotionProblem, u: Array) -> Floating | str | None:
    """Why Newton's method fails from a guess: what nothing holds, or an undamped resonance; None for neither."""
    state = curve.balance.at(*curve.split(u))
    weights = curve.balance.row_weights(curve.balance.dimension)
    _, sizes, rows = np.linalg.svd(state.jacobian * weights[:, None] * weights)
    if sizes[-1] > _FREE * state.omega**2:
        return None
    loose = curve.balance.shaped(rows[-1])
    if length(loose[0]) < 0.9:
        return ": an undamped resonance lies there. Give the structure some damping, or go beside it"
    return Floating(unheld(state, loose[0] * curve.balance.scales[1]))


def _like(curve: MotionProblem, adaptive: AdaptiveHarmonics | None, reference: float) -> MotionProblem:
    """The same motions with another rule for harmonics and another size of reference."""
    tolerance = 0.0 if adaptive is None else adaptive.tolerance
    cache = {curve.balance.basis: curve.balance}
    return replace(curve, adaptive=adaptive, tolerance=tolerance, reference=reference, cache=cache)


#: which unknown keeps its value, or the row that holds a point, at a vector u of a curve with its weights
Held = Callable[[MotionProblem, Array, Array], Array | int]


def settled(
    curve: MotionProblem,
    u: Array,
    newton: NewtonOptions,
    held: Held = lambda curve, u, weights: curve.parameter,
) -> CurvePoint:
    """Solve from a guess, as a rule at its parameter value; again with more harmonics while the motion asks, or once
    with fewer. Where fewer have not been enough none are taken away again.
    """
    fewest = 0
    for _ in range(12):
        balance = curve.balance.settle(*curve.split(u))
        if balance is not curve.balance:
            curve = curve.with_balance(balance)
        weights = curve.weights(u, 0.0)
        solved = correct(curve, u, held(curve, u, weights), weights, newton)
        adapted = curve.adapted(solved.u, solved.evaluation)
        # a guess at rest has no units for a motion
        measured = curve.size(u) > 0.0 or not curve.size(solved.u) > 0.0
        present, wanted = curve.balance.basis.harmonics, adapted.balance.basis.harmonics
        if measured and (adapted.balance is curve.balance or wanted < fewest):
            break
        if wanted > present:
            fewest = wanted
        u, curve = adapted.transfer(solved.u, curve), adapted
    loose = curve.floating(solved.evaluation, weights, newton.tolerance)
    if loose is not None:
        raise Floating(loose)
    return make_point(solved, None, 0.0)


def _from_given(curve: MotionProblem, value: float, given: Any) -> tuple[MotionProblem, Array]:
    """The guess that is given, and the curve in a basis that holds it."""
    balance = curve.balance
    basis, n = balance.basis, balance.system.n
    if isinstance(given, PeriodicOrbit):
        if given.system.n != n:
            raise InputError(f"start has {given.system.n} DOFs, the system has {n}")
        return curve, curve.join(given.basis.resized(balance.linear.read(given.coefficients), basis), value)
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            "start must be a PeriodicOrbit, a point of a branch, a Bifurcation, a state (x, dx/dt) or coefficients, "
            f"not {type(given).__name__}{' (one of its .orbits?)' if hasattr(given, 'orbits') else ''}"
        ) from None
    if not np.isfinite(array).all():
        raise InputError("start contains numbers that are not finite")
    if array.ndim == 1 and array.size == 2 * n:
        return _integrated(curve, value, balance.system.viscous_equivalent(), array)
    shape = np.shape(given)
    if array.ndim == 1 and n == 1:  # coefficients of one degree of freedom
        array = array[:, None]
    if array.ndim == 2 and array.shape[1] == n and array.shape[0] % 2 == 1 and array.shape[0] > 1:
        x = HarmonicBasis(array.shape[0] // 2, basis.nu).resized(balance.linear.read(array), basis)
        return curve, curve.join(x, value)
    raise InputError(
        f"start must be a PeriodicOrbit, a state (x, dx/dt) of length {2 * n}, or coefficients of shape "
        f"(2 H + 1, {n}), H at least 1; got an array of shape {shape}"
    )


def _integrated(curve: MotionProblem, value: float, system: System, state: Array) -> tuple[MotionProblem, Array]:
    """The motion over one period from a state of a system, as harmonics of the curve in a basis that holds it."""
    balance = curve.balance
    _, omega, values = curve.split(curve.join(np.zeros(balance.dimension), value))
    nu = balance.basis.nu
    samples = max(8 * balance.basis.harmonics + 8, 0 if curve.adaptive is None else _SAMPLES * nu)
    times = np.linspace(0.0, 2.0 * math.pi * nu / omega, samples + 1)
    trajectory = integrate(system, state, times, omega, values, rtol=1e-6)
    _check_no_rotation(balance.system, trajectory)
    moved = trajectory.x[:-1]
    x = system.recovered(moved)[:] if isinstance(system, ProjectedSystem) else moved
    spectrum = np.fft.rfft(balance.linear.read(x), axis=0) / samples
    if curve.adaptive is not None:
        curve = curve.with_basis(holding(balance, spectrum, curve.adaptive))
    return curve, curve.join(spectrum_to_real(spectrum, curve.balance.basis.harmonics), value)


def _after_periods(curve: MotionProblem, value: float) -> tuple[MotionProblem, Array]:
    """The motion that rest leads to in time."""
    balance = curve.balance
    _, omega, values = curve.split(curve.join(np.zeros(balance.dimension), value))
    own = balance.system.viscous_equivalent().with_parameters(values)
    system = small_system(own, balance.highest_load * omega, [own.observed_dof])
    end = 2.0 * math.pi * _PERIODS * balance.basis.nu / omega
    settled_on = integrate(system, np.zeros(2 * system.n), np.array([0.0, end]), omega, rtol=1e-6)
    return _integrated(curve, value, system, np.concatenate((settled_on.x[-1], settled_on.v[-1])))


#: what a motion that turns may miss its beginning by after a period, relative to its velocities and to a turn
_CLOSES = 1e-3


def _check_no_rotation(system: System, trajectory: Trajectory) -> None:
    """Refuse a motion that comes back after a period but for whole turns, of 2 pi where no angle is declared."""
    turns, away = system.turns, trajectory.x[-1] - trajectory.x[0]
    rest = turns.modulo(away) if turns else away - 2.0 * math.pi * np.rint(away / (2.0 * math.pi))
    turned = np.abs(away - rest)
    if not turned.max() > 0.0:
        return
    largest = np.abs(trajectory.v).max(axis=0)
    speeds = np.abs(trajectory.v[-1] - trajectory.v[0]) / np.maximum(largest, max(_CLOSES * largest.max(), 1e-300))
    if max(speeds.max(), np.abs(rest).max() / turned.max()) <= _CLOSES:
        dof = int(np.argmax(turned))
        name = system.dof_names[dof] if system.dof_names else f"x_{dof}"
        raise ConvergenceError(
            f"{name} grows by {away[dof]:.6g} in a period: this motion rotates, which harmonic balance does not "
            "describe. Declare the angle (angles= of the system) and use so.brute_force_diagram, so.basins or "
            "so.lyapunov_exponents"
        )


class _HeldEvaluation(MotionEvaluation):
    """`share (A X + F) + (1 - share) B X - P` and its derivatives by X and by the share; `hold`: B."""

    def __init__(self, curve: MotionProblem, state: BalanceState, share: float, hold: Array) -> None:
        super().__init__(curve, state, np.zeros(0))
        self.share = share
        self.hold = hold

    @lazy
    def _rate(self) -> Array:
        return self.state.residual + self.state.load.ravel() - self.hold @ self.state.unknowns

    @lazy
    def residual(self) -> Array:
        return self.state.residual - (1.0 - self.share) * self._rate

    @lazy
    def jacobian(self) -> Array:
        return np.column_stack((self.share * self.state.jacobian + (1.0 - self.share) * self.hold, self._rate))

    @lazy
    def error(self) -> float:
        balance = self.state.balance
        size = length(self.residual * balance.row_weights(balance.dimension))
        return size / max(self.state.balanced.scale, np.finfo(float).tiny)


@dataclass(eq=False, repr=False)
class _Held(MotionProblem):
    """Motions of a system that a heavily damped linear structure holds, less and less: share 0 to 1 of its own forces.

    B is `omega^2 (1 + i k / nu) m` at the multiple k omega / nu, m the masses that the DOFs show. The share is the free
    parameter, in place of the curve's own, which keeps its `value`.
    """

    value: float = 0.0

    @classmethod
    def of(cls, curve: MotionProblem, value: float) -> _Held:
        """The held motions of a response curve, at a value of its parameter."""
        return cls(**{**{f.name: getattr(curve, f.name) for f in fields(curve)}, "spans": (1.0,), "value": value})

    @lazy
    def rest(self) -> BalanceState:
        """The system at rest."""
        return self.balance.at(*self.split(self.join(np.zeros(self.balance.dimension), self.value)))

    @lazy
    def hold(self) -> Array:
        """B."""
        return block_diagonal(_holding_blocks(self.rest), True)

    def first(self) -> Array:
        """The held motion without a share of its own: linear."""
        load = -self.evaluate(self.join(self.rest.x, 0.0)).residual
        return np.append(np.linalg.solve(self.hold, load), 0.0)

    def motion(self, u: Array) -> Array:
        """u as one of the response curve."""
        return np.append(u[:-1], self.value)

    def evaluate(self, u: Array) -> _HeldEvaluation:
        x, omega, values = self.split(self.motion(u))
        return _HeldEvaluation(self, self.balance.at(x, omega, values), float(u[-1]), self.hold)

    def images(self, u: Array) -> list[Array]:
        return [u]

    def where(self, u: Array) -> str:
        return f"{u[-1]:.1%} of the system's own forces at {self.name} = {self.value:.6g}"


def _released(curve: MotionProblem, value: float, newton: NewtonOptions) -> tuple[MotionProblem, Array]:
    """The motion at a value of the parameter, followed from that of the held system, and its curve; ConvergenceError
    where the path does not lead to the system itself.
    """
    problem = _Held.of(curve, value)
    u = problem.first()
    # the size of this motion, not of a linear response that a free body or a resonance makes large
    problem = _Held.of(_like(curve, curve.adaptive, curve.size(u)), value)
    point = make_point(correct(problem, u, problem.parameter, problem.weights(u, 0.0), newton), None, 0.0)
    # where the orientation changes a step may have gone over to another path
    march = March(point, 1.0, (0.0, 1.0), newton, _STEPPING, lambda a, b: a.orientation == b.orientation)
    # of all its points the last alone is kept: with many harmonics the matrices of hundreds would fill the memory
    (last,) = deque(march, maxlen=1)
    assert isinstance(last.curve, _Held)
    if abs(last.parameter - 1.0) <= 1e-12:
        return curve.with_balance(last.curve.balance), last.curve.motion(last.u)
    if last.curve.size(last.u) > _UNBOUNDED * curve.size(u):
        raise ConvergenceError(
            f"the motion grows without bound at {last.curve.where(last.u)}: neither damping nor restoring forces hold "
            "the load there"
        )
    raise ConvergenceError(march.ended)
