"""What a user calls to get a curve: `frequency_response` and `continue_branch`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch, BranchPoint
from suboctave.analysis.checks import check_bounds, check_parameter, check_range, check_system, is_number, make_settings
from suboctave.analysis.follow import follow
from suboctave.analysis.making import Harmonics, make_branch, make_curve, options_of, own_linear_part
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.starts import linear_response, start_point
from suboctave.analysis.subharmonics import check_order, subharmonic_start
from suboctave.analysis.switching import leave_along
from suboctave.analysis.trace import Trace
from suboctave.analysis.ways import both_ways
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.formulation import Formulation
from suboctave.compiled import computation_begins
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import one_thread
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.selection import AdaptiveHarmonics
from suboctave.model.system import System
from suboctave.stability import StabilityMethod


@timed
def frequency_response(
    system: System,
    omega: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    start: Any = None,
    subharmonic: int | None = None,
    max_step: float | None = None,
    observe: int | None = None,
    events: Sequence[Event] = (),
    progress: Any = None,
    seconds: float | None = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
    formulation: Formulation | str | None = None,
    linear: LinearPart | None = None,
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
    max_step
        Largest distance between neighbours in scaled arclength (short for `stepping=SteppingOptions(max_step=...)`).
    observe
        DOF whose amplitude is reported; default the first loaded one.
    events
        User's events, located along the branch.
    progress
        None, True (a bar), or a callable taking (share done, text).
    seconds
        Time limit. What was computed by then is given, as after Ctrl-C (`interrupted`), and `ended` says how to go on.
    stability
        How the multipliers of points and bifurcations are found: `Monodromy()`, `Hill()`, `KoopmanHill()`, or their
        names "monodromy", "hill", "koopman-hill". Default: the monodromy matrix, and where a verdict is open the others
        as witnesses (`Arbitration()`). Where the method is not applicable the monodromy matrix stands in, and the
        branch says so.
    formulation
        By which system bifurcations are located: "bordered" (default), "extended", or "alcorta2019", the published
        formulation of period doublings with its own test functions; or `BorderedSystem()`, `ExtendedSystem()`,
        `Alcorta2019(test="multiplier")`, where test may be "determinant". All find the same bifurcations, the last
        only those that its test shows: what it misses is in the branch's warnings.
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
    settings = make_settings(system, max_step, observe, events, newton, stepping, stability, formulation)
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    nu = start.basis.nu if isinstance(start, PeriodicOrbit) else 1
    if subharmonic is not None and subharmonic != 1:
        order = check_order(subharmonic)
        if isinstance(start, PeriodicOrbit) and nu != order:
            raise InputError(f"subharmonic={order}, but start is a motion of {nu} load periods: leave one of them out")
        nu = order
    curve = make_curve(system, "omega", first, abs(last - first), harmonics, nu, linear)
    computation_begins()
    with one_thread(), reporting(progress, "frequency response") as report:
        settings = settings.reporting_to(report, (first, last))
        if report is not None:
            # in a fresh installation the start waits for kernels to be compiled
            report(0.0, f"omega = {first:.6g}")
        searched = start is None and nu > 1
        if searched:
            trace = subharmonic_start(curve, (first, last), settings)
        else:
            point = start_point(curve, first, start, settings.newton)
            trace = follow(point, np.sign(last - first), (min(first, last), max(first, last)), settings)
    if not searched:
        given = _written(
            harmonics=None if isinstance(harmonics, str) else harmonics,
            subharmonic=subharmonic,
            max_step=max_step,
            observe=observe,
            events=events or None,
            newton=newton,
            stepping=stepping,
            stability=stability,
            formulation=formulation,
            linear=linear,
        )
        call = f"so.frequency_response(system, ({last!r}, {first!r}){given})"
        _warn_of_return(trace, "omega", first, call)
    options = options_of(settings, harmonics, {"omega": (first, last)})
    return make_branch(system, "omega", trace, settings, options)


@timed
def continue_branch(
    start: System | PeriodicOrbit | BranchPoint | Bifurcation,
    parameter: str,
    bounds: tuple[float, float],
    *,
    omega: float | None = None,
    harmonics: Harmonics | None = None,
    max_step: float | None = None,
    observe: int | None = None,
    events: Sequence[Event] = (),
    progress: Any = None,
    seconds: float | None = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
    formulation: Formulation | str | None = None,
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

    Other parameters, and errors, as `frequency_response`.
    """
    crossing = start if isinstance(start, Bifurcation) and start.parameter_name == parameter else None
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    if isinstance(start, System):
        options = (harmonics, max_step, observe, events, progress, newton, stepping, stability, formulation)
        return _from_system(start, parameter, bounds, omega, *options)
    if not isinstance(start, PeriodicOrbit):
        raise InputError(
            "continue_branch starts from a PeriodicOrbit, a point of a branch, a Bifurcation or a System, "
            f"not {type(start).__name__}"
        )
    orbit = start
    system = orbit.system
    check_parameter(system, parameter)
    first, last = check_bounds(system, parameter, bounds)
    value = orbit.omega if parameter == "omega" else orbit.values[parameter]
    low, high = min(first, last), max(first, last)
    slack = 1e-12 * (high - low)
    if not low - slack <= value <= high + slack:
        raise InputError(f"the motion has {parameter}={value:.6g}, outside the bounds ({low:g}, {high:g})")
    if omega is not None and not (is_number(omega) and abs(omega - orbit.omega) <= 1e-12 * orbit.omega):
        raise InputError(f"omega={omega!r} differs from the motion's {orbit.omega:g}: leave it out")
    settings = make_settings(system, max_step, observe, events, newton, stepping, stability, formulation)
    basis = orbit.basis
    wanted: Harmonics = harmonics if harmonics is not None else orbit.adaptive or max(1, basis.harmonics // basis.nu)
    curve = make_curve(system, parameter, orbit.omega, high - low, wanted, basis.nu, own_linear_part(orbit))
    computation_begins()
    with one_thread(), reporting(progress, f"along {parameter}") as report:
        settings = settings.reporting_to(report, (low, high))
        ahead = float(np.sign(last - first))
        if crossing is not None and crossing.tangent is not None:
            # two branches cross: go on along that on which the point was found
            trace = leave_along(crossing, curve, np.array(crossing.tangent), ahead, (low, high), settings)
        else:
            point = start_point(curve, min(high, max(low, value)), orbit, settings.newton)
            trace = both_ways(point, ahead, (low, high), settings)
    return make_branch(system, parameter, trace, settings, options_of(settings, wanted, {parameter: (first, last)}))


def _from_system(
    system: System,
    parameter: str,
    bounds: tuple[float, float],
    omega: float | None,
    harmonics: Harmonics | None,
    max_step: float | None,
    observe: int | None,
    events: Sequence[Event],
    progress: Any,
    newton: NewtonOptions | None,
    stepping: SteppingOptions | None,
    stability: StabilityMethod | str | None,
    formulation: Formulation | str | None,
) -> Branch:
    wanted: Harmonics = "adaptive" if harmonics is None else harmonics
    if parameter == "omega":
        if omega is not None:
            raise InputError("along omega, omega= cannot be kept as well: leave it out, the range is in bounds")
        return frequency_response(
            system,
            bounds,
            wanted,
            max_step=max_step,
            observe=observe,
            events=events,
            progress=progress,
            newton=newton,
            stepping=stepping,
            stability=stability,
            formulation=formulation,
        )
    check_system(system)
    check_parameter(system, parameter)
    first, last = check_bounds(system, parameter, bounds)
    if omega is None or not (is_number(omega) and omega > 0.0):
        raise InputError(f"continue_branch from a system along {parameter!r} needs a positive omega=, got {omega!r}")
    settings = make_settings(system, max_step, observe, events, newton, stepping, stability, formulation)
    curve = make_curve(system, parameter, float(omega), abs(last - first), wanted, 1, None)
    # a size of the motion to scale with, should the branch begin at rest
    curve.reference = max(curve.size(linear_response(curve, v)) for v in (first, last))
    computation_begins()
    with one_thread(), reporting(progress, f"along {parameter}") as report:
        settings = settings.reporting_to(report, (first, last))
        point = start_point(curve, first, None, settings.newton)
        trace = follow(point, np.sign(last - first), (min(first, last), max(first, last)), settings)
    given = _written(
        harmonics=None if isinstance(wanted, str) else wanted,
        max_step=max_step,
        observe=observe,
        events=events or None,
        newton=newton,
        stepping=stepping,
        stability=stability,
        formulation=formulation,
    )
    call = f"so.continue_branch(system, {parameter!r}, ({last!r}, {first!r}), omega={float(omega)!r}{given})"
    _warn_of_return(trace, parameter, first, call)
    return make_branch(system, parameter, trace, settings, options_of(settings, wanted, {parameter: (first, last)}))


def _written(**options: Any) -> str:
    """The options of a call that were given, as it is written."""
    words = []
    for name, given in options.items():
        value = given.item() if isinstance(given, np.generic) else given
        if isinstance(value, AdaptiveHarmonics | NewtonOptions | SteppingOptions):
            words.append(f", {name}=so.{value!r}")
        elif value is not None:
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


__all__ = ["continue_branch", "frequency_response"]
