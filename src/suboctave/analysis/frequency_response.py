"""What a user calls to get a curve: `frequency_response` and `continue_branch`."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from suboctave.analysis.options import CurveOptions, CurveRun, settings_of
from suboctave.analysis.subharmonics import check_order, subharmonic_start
from suboctave.analysis.switching import leave_along
from suboctave.bifurcation import Bifurcation
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.curves.discretisation import Harmonics, harmonics_of, own_linear_part
from suboctave.curves.points import BranchPoint
from suboctave.curves.starts import start_point
from suboctave.curves.trace import Trace
from suboctave.errors import InputError, is_number
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.model.inputs import check_bounds, check_parameter, check_range, check_system, timed
from suboctave.model.system import System
from suboctave.options import RunOptions, with_options
from suboctave.results.branch import Branch


@with_options(CurveOptions)
@timed
def frequency_response(
    system: System,
    omega: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
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
        `Bifurcation`, a state `(x, dx/dt)` of shape (2 n,), or coefficients of shape (2 H + 1, n).
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
    nu = _period(start, subharmonic)
    curve = run.curve(first, nu, linear)
    with run.reporting(options.get("progress"), "frequency response") as run:
        # in a fresh installation the start waits for kernels to be compiled
        run.report(0.0, f"omega = {first:.6g}")
        if start is None and nu > 1:
            trace = subharmonic_start(curve, run)
        else:
            trace = run.follow(start_point(curve, first, start, run.settings.newton))
            given = _written(harmonics, options, subharmonic=subharmonic, linear=linear)
            _warn_of_return(trace, "omega", first, f"so.frequency_response(system, ({last!r}, {first!r}){given})")
    return run.branch(trace)


def _period(start: Any, subharmonic: int | None) -> int:
    """Period, in periods of the load, of the motions that begin at `start`."""
    nu = start.basis.nu if isinstance(start, PeriodicOrbit) else 1
    if subharmonic is None or subharmonic == 1:
        return nu
    order = check_order(subharmonic)
    if isinstance(start, PeriodicOrbit) and nu != order:
        raise InputError(f"subharmonic={order}, but start is a motion of {nu} load periods: leave one of them out")
    return order


@with_options(CurveOptions)
@timed
def continue_branch(
    start: System | PeriodicOrbit | BranchPoint | Bifurcation,
    parameter: str,
    bounds: tuple[float, float],
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
    low, high = sorted(ends)
    slack = 1e-12 * (high - low)
    if not low - slack <= value <= high + slack:
        raise InputError(f"the motion has {parameter}={value:.6g}, outside the bounds ({low:g}, {high:g})")
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
            trace = run.both_ways(start_point(curve, min(high, max(low, value)), orbit, run.settings.newton))
    return run.branch(trace)


def _from_system(
    system: System,
    parameter: str,
    bounds: tuple[float, float],
    omega: float | None,
    wanted: Harmonics,
    options: CurveOptions,
) -> Branch:
    """The branch from the motion of a system at the first bound."""
    if parameter == "omega":
        if omega is not None:
            raise InputError("along omega, omega= cannot be kept as well: leave it out, the range is in bounds")
        return frequency_response(system, bounds, wanted, **options)
    check_system(system)
    check_parameter(system, parameter)
    first, last = check_bounds(system, parameter, bounds)
    if omega is None or not (is_number(omega) and omega > 0.0):
        raise InputError(f"continue_branch from a system along {parameter!r} needs a positive omega=, got {omega!r}")
    run = CurveRun(system, parameter, (first, last), wanted, settings_of(system, options))
    # the branch may begin at rest
    curve = run.scaled(run.curve(float(omega), 1, None))
    with run.reporting(options.get("progress"), f"along {parameter}") as run:
        trace = run.follow(start_point(curve, first, None, run.settings.newton))
    given = _written(wanted, options)
    call = f"so.continue_branch(system, {parameter!r}, ({last!r}, {first!r}), omega={float(omega)!r}{given})"
    _warn_of_return(trace, parameter, first, call)
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


def _warn_of_return(trace: Trace, name: str, first: float, call: str) -> None:
    """Warn where a branch leaves its range at the end where it began: the motions at the other end lie on another one.

    `call` follows that.
    """
    if trace.closed or trace.interrupted or len(trace.points) < 2:
        return
    orbit = trace.points[-1].orbit
    if (orbit.omega if name == "omega" else orbit.values[name]) == first:
        trace.warnings.append(
            f"the branch folds back and leaves the range where it began, at {name} = {first:.6g}: what the other end "
            f"leads to lies on another branch, {call}"
        )
