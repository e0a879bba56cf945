"""What a user calls to get a branch: `frequency_response`, `continue_branch`, and `switch_branch` at a bifurcation.

At a period doubling the branch of twice the period leaves along the half-odd null vector, and is followed until it
meets its parent again, closes or leaves the range. At a branch point the other branch leaves along the second solution
of the algebraic branching equation (`bifurcation.bordered`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.options import CurveOptions, CurveRun, Inherited, check_inside, settings_of
from suboctave.analysis.subharmonics import check_order, subharmonic_start
from suboctave.analysis.switch_tracked import leaves_free_phase, switch_tracked
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.bifurcation.bordered import at_values, branching_equation, null_vectors
from suboctave.continuation import CurvePoint, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import length
from suboctave.continuation.notes import Note
from suboctave.continuation.problem import Array
from suboctave.curves.blow_up import DoubledMotions
from suboctave.curves.events.locate import Singular
from suboctave.curves.follow import both_ways, follow
from suboctave.curves.identity import same_event
from suboctave.curves.junction import (
    Beside,
    beside,
    curvature_of,
    doubling_curvature,
    emanating,
    leaving_doubling,
    period_name,
    unseen,
)
from suboctave.curves.leaving import branch_beside, first_beside
from suboctave.curves.motion import MotionProblem
from suboctave.curves.starts import Harmonics, harmonics_of, linear_up_to, own_linear_part, start_point
from suboctave.curves.trace import BranchPoint, Settings, Trace, Unsettled
from suboctave.errors import ConvergenceError, InputError, is_number
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS
from suboctave.model.inputs import check_bounds, check_parameter, check_range, check_system, timed
from suboctave.model.system import System
from suboctave.options import RunOptions, with_options
from suboctave.results.branch import Branch
from suboctave.results.equilibria import as_equilibria


@with_options(CurveOptions)
@timed
def frequency_response(
    system: System,
    omega: Range,
    *,
    harmonics: Harmonics = "adaptive",
    start: Any = None,
    subharmonic: int | None = None,
    linear: LinearPart | None = None,
    **options: Unpack[CurveOptions],
) -> Branch:
    """The periodic response over a range of frequencies, with stability and located bifurcations.

    Parameters
    ----------
    system
        What vibrates; it needs a load.
    omega
        (from, to), rad per unit time. A branch that folds back inside is followed until it leaves at either end or
        closes.
    harmonics
        Highest multiple of omega kept, `"adaptive"`, or an `AdaptiveHarmonics`.
    start
        Chooses among coexisting motions at the first frequency: a `PeriodicOrbit`, a point of a branch, a
        `Bifurcation`, a state `(x, dx/dt)` of shape (2 n,), or coefficients of shape (2 H + 1, n). Without it one is
        looked for from the linear response, by a path from a heavily damped structure, and from what rest leads to in
        time: of several motions far from the linear one, rounding may decide which.
    subharmonic
        Period of the motions in periods of the load, where it is not one (or that of `start`): the state or
        coefficients of `start` are then those of a motion of that period. Without `start` one is searched for over the
        whole range and followed both ways (`find_subharmonics` gives all that it finds).
    linear
        Another linear part with this system's elements and loads, for example one condensed onto the DOFs that
        elements touch.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If no motion is found at the first frequency.
    TimeLimitError
        If the time limit was reached before that.
    """
    first, last = check_range("omega", omega, positive=True)
    check_system(system, (first, last))
    run = CurveRun(system, "omega", (first, last), harmonics, settings_of(system, options))
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    nu = start.basis.nu if isinstance(start, PeriodicOrbit) else 1
    if subharmonic not in (None, 1):
        order = check_order(subharmonic)
        if isinstance(start, PeriodicOrbit) and nu != order:
            raise InputError(f"subharmonic={order}, but start is a motion of {nu} load periods: leave one of them out")
        nu = order
    curve = run.curve(first, nu, linear)
    with run.reporting(options.get("progress"), "frequency response") as run:
        # in a fresh installation the start waits for kernels to be compiled
        run.report(0.0, f"omega = {first:.6g}")
        if start is None and nu > 1:
            trace = subharmonic_start(curve, run)
        else:
            given = _written(harmonics, options, subharmonic=subharmonic, linear=linear)
            trace = from_end(curve, start, run, f"so.frequency_response(system, ({last!r}, {first!r}){given})")
    return run.branch(trace)


@with_options(CurveOptions)
@timed
def continue_branch(
    start: System | PeriodicOrbit | BranchPoint | Bifurcation,
    parameter: str,
    bounds: Range,
    *,
    omega: float | None = None,
    harmonics: Harmonics | None = None,
    **options: Unpack[CurveOptions],
) -> Branch:
    """A curve of periodic motions along any one parameter: amplitude sweeps, S-curves, or omega from a given motion.

    Parameters
    ----------
    start
        A motion (orbit, point of a branch, bifurcation), followed in both directions to the bounds; or a system with
        `omega=`, whose motion at the first bound is looked for.
    parameter
        "omega" or a parameter of the system. Unless it is "omega", the frequency is kept: that of the motion, or
        `omega`.
    bounds
        (from, to): the branch is reported in this order. A motion on a bound is followed one way.
    harmonics
        As in `frequency_response`; default: as the motion was computed, or "adaptive" from a system.

    Errors as of `frequency_response`.
    """
    crossing = start if isinstance(start, Bifurcation) and start.parameter_name == parameter else None
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    if isinstance(start, System):
        return _from_system(start, parameter, bounds, omega, "adaptive" if harmonics is None else harmonics, options)
    if not isinstance(start, PeriodicOrbit):
        raise InputError(
            "continue_branch starts from a PeriodicOrbit, a point of a branch, a Bifurcation or a System, "
            f"not {type(start).__name__}"
        )
    orbit = start
    system = orbit.system
    check_parameter(system, parameter)
    ends = check_bounds(system, parameter, bounds)
    value = orbit.omega if parameter == "omega" else orbit.values[parameter]
    check_inside("the motion", parameter, value, ends, 1e-12)
    if omega is not None and not (is_number(omega) and abs(omega - orbit.omega) <= 1e-12 * orbit.omega):
        raise InputError(f"omega={omega!r} differs from the motion's {orbit.omega:g}: leave it out")
    wanted = harmonics_of(orbit) if harmonics is None else harmonics
    run = CurveRun(system, parameter, ends, wanted, settings_of(system, options))
    curve = run.curve(orbit.omega, orbit.basis.nu, own_linear_part(orbit))
    with run.reporting(options.get("progress"), f"along {parameter}") as run:
        if crossing is not None and crossing.tangent is not None:
            # two branches cross: go on along that on which the point was found
            trace = leave_along(crossing, curve, np.array(crossing.tangent), run)
        else:
            inside = min(max(ends), max(min(ends), value))
            point = start_point(curve, inside, orbit, run.settings.newton, run.bounds)
            trace = both_ways(point, run.ahead, run.bounds, run.settings)
    return run.branch(trace)


def _from_system(
    system: System,
    parameter: str,
    bounds: Range,
    omega: float | None,
    wanted: Harmonics,
    options: CurveOptions,
) -> Branch:
    """The branch from the motion of a system at the first bound."""
    if parameter == "omega":
        if omega is not None:
            raise InputError("along omega, omega= cannot be kept as well: leave it out, the range is in bounds")
        return frequency_response(system, bounds, harmonics=wanted, **options)
    check_system(system)
    check_parameter(system, parameter)
    first, last = check_bounds(system, parameter, bounds)
    if omega is None or not (is_number(omega) and omega > 0.0):
        raise InputError(f"continue_branch from a system along {parameter!r} needs a positive omega=, got {omega!r}")
    run = CurveRun(system, parameter, (first, last), wanted, settings_of(system, options))
    # the branch may begin at rest
    curve = run.scaled(run.curve(float(omega), 1, None))
    given = f", ({last!r}, {first!r}), omega={float(omega)!r}{_written(wanted, options)}"
    with run.reporting(options.get("progress"), f"along {parameter}") as run:
        trace = from_end(curve, None, run, f"so.continue_branch(system, {parameter!r}{given})")
    return run.branch(trace)


def _written(harmonics: Harmonics, options: CurveOptions, **more: Any) -> str:
    """The options of a call that were given, as it is written."""
    rule = None if isinstance(harmonics, str) else harmonics
    given = {"harmonics": rule, **more, **{name: options.get(name) for name in CurveOptions.__annotations__}}
    given["events"] = given["events"] or None
    words = []
    for name, option in given.items():
        value = option.item() if isinstance(option, np.generic) else option
        if isinstance(value, AdaptiveHarmonics | NewtonOptions | SteppingOptions):
            words.append(f", {name}=so.{value!r}")
        elif value is not None and name not in RunOptions.__annotations__:
            # what has no short form is called as its user called it
            words.append(f", {name}={value!r}" if isinstance(value, int | float | str) else f", {name}={name}")
    return "".join(words)


#: distance from the first value of a range, as a share of it, up to which a curve begins there
_AT_END = 1e-6


def from_end(curve: MotionProblem, start: Any, run: CurveRun, call: str) -> Trace:
    """The branch from the first value on, with a warning where it leaves its range there: the motions at the other end
    lie on another one, which `call` follows.
    """
    name, first = run.name, run.ends[0]
    begun = start_point(curve, first, start, run.settings.newton, run.bounds)
    trace = follow(begun, run.ahead, run.bounds, run.settings)
    if abs(begun.parameter - first) > _AT_END * abs(run.ends[1] - first):
        text = f"the curve begins at the nearest motion, {name} = {begun.parameter:.6g}: the start leads to none here"
        trace.notes.append(Note(text, name, first, first))
    orbit = trace.points[-1].orbit
    back = len(trace.points) > 1 and (orbit.omega if name == "omega" else orbit.values[name]) == first
    if back and not trace.closed and not trace.interrupted:
        text = f"the branch folds back and leaves the range where it began. For the branch at the other end use {call}"
        trace.notes.append(Note(text, name, first, first))
    return trace


#: share by which forces must deviate from linear ones for a motion to count as nonlinear
_NOTICED = 0.01
#: distance from a multiple branch point, in scaled arclength, at which the direction of a branch is told
_BESIDE = 1e-3
#: size of a motion, in units of a direction, that is taken for the natural one where all forces are linear
_LARGEST = 1e12

_NO_OTHER = {
    "LP": "at a limit point the branch turns back, no other branch leaves",
    "NS": "at a Neimark-Sacker point quasi-periodic motions leave, no branch of periodic motions",
    "grazing": "at a grazing contact no other branch leaves",
}


@with_options(CurveOptions)
@timed
def switch_branch(
    bifurcation: Bifurcation,
    *,
    side: int | None = None,
    bounds: Range | None = None,
    harmonics: Harmonics | None = None,
    **options: Unpack[CurveOptions],
) -> Branch:
    """The branch that leaves another one at a period doubling or a branch point, with stability and bifurcations.

    From a curve of motions of a free phase (limit cycles, modes) a curve of such motions, a `TrackedBranch`.

    At a period doubling (PD) the motions of twice the period: there is one such branch, either sign of the null vector
    leads onto the same motions, a period of the parent apart. It is followed until it meets its parent again at a
    period doubling (`branch.arrives`), closes, or leaves the range. At a branch point (BP) the other branch, both ways.

    Parameters
    ----------
    bifurcation
        A located PD or BP, of a branch or of a file. System, range, harmonics and options are those that it was found
        with unless given here.
    side
        At a BP +1 or -1 for one half of the other branch, up to where it meets the first one again; +1 is the half on
        which the free parameter grows, at a pitchfork that towards which the largest coefficient of the null vector
        does. At a PD it only chooses which of the two copies of each motion is reported.
    bounds
        Range of the free parameter, default that of the branch that it was found on.

    Raises
    ------
    InputError
        If nothing can be switched to there.
    ConvergenceError
        If no point of the other branch is found beside the bifurcation.
    """
    if not isinstance(bifurcation, Bifurcation):
        raise InputError(
            f"switch_branch takes a Bifurcation, not {type(bifurcation).__name__} (branch.bifurcations[0]?)"
        )
    kind = bifurcation.kind
    check_left(kind)
    if side not in (None, 1, -1) or isinstance(side, bool):
        raise InputError(f"side must be +1, -1 or None, not {side!r}")
    if bifurcation.uncertainty and bifurcation.null_vectors is None:
        raise InputError(
            f"this {kind} could only be bracketed, to +- {bifurcation.uncertainty:.1e}: the direction of the other "
            "branch is not known there"
        )
    orbit, name = bifurcation.orbit, bifurcation.parameter_name
    if isinstance(bifurcation, TrackedEvent) and leaves_free_phase(bifurcation):
        ends = None if bounds is None else check_bounds(orbit.system, name, bounds)
        return switch_tracked(bifurcation, side, ends, harmonics, options)
    known = Inherited(bifurcation)
    ends = check_bounds(orbit.system, name, known.bounds(name) if bounds is None else bounds)
    check_inside(f"the {KINDS[kind].words}", name, bifurcation.parameter(name), ends)
    settings = replace(settings_of(orbit.system, known.under(options)), half=kind == "BP" and side is not None)
    nu = orbit.basis.nu * (2 if kind == "PD" else 1)
    run = CurveRun(orbit.system, name, ends, harmonics_of(orbit) if harmonics is None else harmonics, settings)
    curve = run.curve(orbit.omega, nu, own_linear_part(orbit))
    with run.reporting(options.get("progress"), f"{period_name(nu)} branch along {name}") as run:
        trace = _doubled(bifurcation, curve, side or 1, run) if kind == "PD" else _other(bifurcation, curve, side, run)
    still = known.known.get("still")
    return run.branch(trace) if still is None else as_equilibria(run.branch(trace), still)


def check_left(kind: str) -> None:
    """Refuse a kind of bifurcation at which no other branch leaves; InputError."""
    if kind not in ("PD", "BP"):
        raise InputError(f"{_NO_OTHER.get(kind, 'nothing leaves a user event')}. switch_branch takes a PD or a BP")


# ------------------------------------------------------------------------------------------------------- departures
def _doubled(item: Bifurcation, curve: MotionProblem, sign: float, run: CurveRun) -> Trace:
    """The branch of twice the period."""
    parent = item.orbit
    if curve.adaptive is not None:
        curve = curve.with_basis(parent.basis.doubled)
    vectors = item.null_vectors or null_vectors(parent.state(), Kind.HALF)
    u = curve.join(parent.basis.resized(parent.x, curve.balance.basis), item.parameter(item.parameter_name))
    doubling = Singular(parent.state(), vectors, 0.0, item.residual, 0)
    direction = emanating(doubling, curve, curve.weights(u, 0.0))
    _scale_from_rest(curve, u, direction)
    weights = curve.weights(u, 0.0)
    direction *= sign / length(weights * direction)
    return _departing(item, curve, u, direction, run)


def _other(item: Bifurcation, curve: MotionProblem, side: int | None, run: CurveRun) -> Trace:
    """The branch that crosses another at a branch point, or one half of it."""
    curve, u = _at(item, curve)
    direction = _along_null_vector(item, curve, u) if item.multiplicity > 1 else _of_two(item, curve)
    _scale_from_rest(curve, u, direction)
    if side is None:
        return leave_along(item, curve, direction, run)
    return _departing(item, curve, u, side * direction, run)


def _of_two(item: Bifurcation, curve: MotionProblem) -> Array:
    """The direction of the branch that crosses another at a simple branch point."""
    equation = branching_equation(item.orbit.state(), curve.name, curve.span, item.null_vectors)
    if item.tangent is None:
        # the branch that it was found on is unknown: that which follows the parameter most
        direction = min(equation.directions, key=lambda d: abs(d[-1]))
    else:
        direction = equation.other(np.array(item.tangent))
    return _oriented(direction, equation.weights)


def _along_null_vector(item: Bifurcation, curve: MotionProblem, u: Array) -> Array:
    """The direction of a branch that leaves a multiple branch point along one of its null vectors."""
    weights, state = curve.weights(u, 0.0), item.orbit.state()
    way = curve.join(item.null_vectors.right * state.balance.row_weights(state.x.size), 0.0)
    there = branch_beside(curve, u, weights, way / length(weights * way), _BESIDE)
    return _oriented(there / length(weights * there), weights)


def _followed(start: CurvePoint, doubt: Unsettled | None, run: CurveRun) -> Trace:
    """The branch from its first point on; `doubt`: what may happen unseen before that."""
    trace = follow(start, 0.0, run.bounds, run.settings)
    if doubt is not None:
        trace.audit = trace.audit.in_doubt(doubt)
    return trace


def _departing(item: Bifurcation, curve: MotionProblem, u: Array, direction: Array, run: CurveRun) -> Trace:
    """The branch that leaves a bifurcation in one direction."""
    trace = _followed(*_away(item, curve, u, direction, run.settings), run)
    trace.departs = replace(item, arclength=0.0)
    return trace


def leave_along(item: Bifurcation, curve: MotionProblem, direction: Array, run: CurveRun) -> Trace:
    """The branch through a branch point along a direction, both ways; it ends where it is ahead in the parameter."""
    if direction[-1] * run.ahead < 0.0:
        direction = -direction
    curve, u = _at(item, curve)
    (one, doubt), (other, doubt_behind) = (_away(item, curve, u, way * direction, run.settings) for way in (1.0, -1.0))
    here = replace(item, tangent=tuple(direction.tolist()))
    forward = _followed(one, doubt, run)
    if forward.closed or forward.interrupted:
        # a closed curve comes back through the branch point, located there with other harmonics perhaps
        reach = 2.0 * _distance(one, u, curve)
        last = forward.points[-1].arclength - reach if forward.closed else math.inf
        met = [b for b in forward.bifurcations if not (same_event(b, here) or (b.kind == "BP" and b.arclength > last))]
        forward.bifurcations[:] = [replace(here, arclength=0.0), *met]
        forward.settle_end(reach)
        return forward
    back = _followed(other, doubt_behind, run)
    gap = _distance(one, u, curve) + _distance(other, u, curve)
    trace = back.reversed_before(forward, gap)
    place = back.points[-1].arclength + _distance(other, u, curve)
    at = sum(b.arclength < place for b in trace.bifurcations)
    trace.bifurcations.insert(at, replace(here, arclength=place))
    return trace


def _scale_from_rest(curve: MotionProblem, u: Array, direction: Array) -> None:
    """Where a branch leaves rest nothing says how large a motion is: one whose forces deviate from linear ones."""
    x, omega, values = curve.split(u)
    if curve.balance.at(x, omega, values).load.any():
        return
    balance = curve.balance.settle(x, omega, values)
    rest, phi = balance.at(x, omega, values), direction[:-1]
    change = balance.shaped(phi)
    slope = rest.force_jacobian @ change.ravel()
    linear = length(rest.linear_jacobian @ phi) + length(slope)
    # of what stands still they vanish at the point itself: those a little beside it
    value, little = float(u[curve.parameter]), _NOTICED * curve.span
    for aside in (value - little, value + little):
        frequency, parameters = at_values(values, curve.name, aside, omega)
        linear = max(linear, length(balance.at(x, frequency, parameters).jacobian @ phi))
    unit = curve.size(curve.join(change, 0.0))
    _, size = linear_up_to(rest, change, _NOTICED * linear)
    curve.reference = 100.0 * min(size, _LARGEST) * unit


def _distance(point: CurvePoint, u: Array, curve: MotionProblem) -> float:
    """How far a point lies from a point u of a curve, in scaled arclength."""
    return length(point.weights * (point.u - point.curve.transfer(u, curve)))


def _at(item: Bifurcation, curve: MotionProblem) -> tuple[MotionProblem, Array]:
    """The curve in the harmonics of a bifurcation, and that point on it."""
    curve = curve.with_basis(item.orbit.basis)
    return curve, curve.join(item.orbit.x, item.parameter(item.parameter_name))


def _oriented(direction: Array, weights: Array) -> Array:
    """A direction such that the parameter grows, or, where it hardly moves, the largest coefficient."""
    scaled = weights * direction
    leading = scaled[-1] if abs(scaled[-1]) > 1e-3 * length(scaled) else scaled[int(np.argmax(np.abs(scaled[:-1])))]
    return direction if leading >= 0.0 else -direction


def _away(
    item: Bifurcation, curve: MotionProblem, u: Array, direction: Array, settings: Settings
) -> tuple[CurvePoint, Unsettled | None]:
    """The first point of a branch that leaves a bifurcation, and what may happen unseen before it."""
    weights = curve.weights(u, 0.0)
    x, omega, values = curve.split(u)
    curve = curve.with_balance(curve.balance.settle(x, omega, values))
    if item.multiplicity > 1:
        close = first_beside(curve, u, weights, direction / length(weights * direction))
    else:
        close = _closest(item, curve, u, direction, settings)
    doubt = None if close.smooth else unseen(curve.name, float(u[-1]), close.point.parameter)
    return close.point, doubt


def _closest(item: Bifurcation, curve: MotionProblem, u: Array, direction: Array, settings: Settings) -> Beside:
    """The point right beside a simple bifurcation, in the harmonics that it needs."""
    weights = curve.weights(u, 0.0)
    # over the period of the branch
    expected = item.floquet.multipliers ** (2 if item.kind == "PD" else 1)
    leads = None
    if item.kind == "PD":
        assert isinstance(curve, DoubledMotions)
        state = item.orbit.state()
        vectors = item.null_vectors or null_vectors(state, Kind.HALF)
        leads = doubling_curvature(Singular(state, vectors, 0.0, item.residual, 0), curve.name)
        close = leaving_doubling(curve, u, direction, expected, settings.newton, leads)
    else:
        leads = curvature_of(item.normal_form)
        close = beside(curve, u, direction / length(weights * direction), weights, expected, settings.newton, leads)
    if close is None:
        raise ConvergenceError(
            f"no point of the other branch was found beside the {KINDS[item.kind].words} at {curve.where(u)}: its "
            "direction may be too close to that of the first branch, or too few harmonics are kept"
        )
    if item.kind == "PD":
        return close
    point = close.point
    adapted = curve.adapted(point.u, point.evaluation)
    if adapted is curve:
        return close
    assert isinstance(adapted, MotionProblem)
    u, direction = adapted.transfer(u, curve), adapted.transfer(point.u - u, curve)
    weights = adapted.weights(u, 0.0)
    direction = direction / length(weights * direction)
    again = beside(adapted, u, direction, weights, expected, settings.newton, leads)
    return again if again is not None and (again.smooth or not close.smooth) else close
