"""What a user calls to get a curve: `frequency_response` and `continue_branch`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch, BranchPoint
from suboctave.analysis.follow import Settings, Trace, follow
from suboctave.analysis.progress import reporting
from suboctave.analysis.response import ResponseCurve
from suboctave.analysis.starts import start_point
from suboctave.bifurcation import KINDS, Bifurcation
from suboctave.continuation import CurvePoint, Event, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import one_thread
from suboctave.errors import InputError, suggest
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.selection import AdaptiveHarmonics
from suboctave.model.system import System

#: unknowns of a dense problem beyond which a run is refused (a matrix of half a gigabyte)
_MOST_UNKNOWNS = 8000
#: DOFs up to which the stiffness is examined for motions that nothing holds
_MOST_EXAMINED = 400

Harmonics = int | str | AdaptiveHarmonics


def frequency_response(
    system: System,
    omega: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    start: Any = None,
    max_step: float | None = None,
    observe: int | None = None,
    events: Sequence[Event] = (),
    progress: Any = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
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
    max_step
        Largest distance between neighbours in scaled arclength (short for `stepping=SteppingOptions(max_step=...)`).
    observe
        DOF whose amplitude is reported; default the first loaded one.
    events
        User's events, located along the branch.
    progress
        None, True (a bar), or a callable taking (share done, text).
    linear
        Another linear part with this system's elements and loads, for example one condensed onto the DOFs that
        elements touch.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If no motion is found at the first frequency.
    """
    _check_system(system)
    first, last = check_range("omega", omega, positive=True)
    settings = _settings(system, max_step, observe, events, newton, stepping)
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    nu = start.basis.nu if isinstance(start, PeriodicOrbit) else 1
    curve = _curve(system, "omega", first, abs(last - first), harmonics, nu, linear)
    with one_thread(), reporting(progress, "frequency response") as report:
        settings = replace(settings, report=report)
        point = start_point(curve, first, start, settings.newton)
        trace = follow(point, np.sign(last - first), (min(first, last), max(first, last)), settings)
    if len(trace.points) > 1 and not trace.closed and trace.points[-1].orbit.omega == first:
        trace.warnings.append(
            f"the branch folds back and leaves the range where it began, at omega = {first:.6g}: other motions there "
            "may lead through the range. Begin at the other end, or choose one with start="
        )
    options = _options(settings, harmonics, {"omega": (first, last)})
    return _branch(system, "omega", trace, settings, options)


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
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
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
    if isinstance(start, BranchPoint | Bifurcation):
        start = start.orbit
    if isinstance(start, System):
        return _from_system(
            start, parameter, bounds, omega, harmonics, max_step, observe, events, progress, newton, stepping
        )
    if not isinstance(start, PeriodicOrbit):
        raise InputError(
            "continue_branch starts from a PeriodicOrbit, a point of a branch, a Bifurcation or a System, "
            f"not {type(start).__name__}"
        )
    orbit = start
    system = orbit.system
    _check_parameter(system, parameter)
    first, last = _check_bounds(system, parameter, bounds)
    value = orbit.omega if parameter == "omega" else orbit.values[parameter]
    low, high = min(first, last), max(first, last)
    slack = 1e-12 * (high - low)
    if not low - slack <= value <= high + slack:
        raise InputError(f"the motion has {parameter}={value:.6g}, outside the bounds ({low:g}, {high:g})")
    if omega is not None and not (_is_number(omega) and abs(omega - orbit.omega) <= 1e-12 * orbit.omega):
        raise InputError(f"omega={omega!r} differs from the motion's {orbit.omega:g}: leave it out")
    settings = _settings(system, max_step, observe, events, newton, stepping)
    basis = orbit.basis
    wanted: Harmonics = harmonics if harmonics is not None else orbit.adaptive or max(1, basis.harmonics // basis.nu)
    curve = _curve(system, parameter, orbit.omega, high - low, wanted, basis.nu, _own_linear_part(orbit))
    with one_thread(), reporting(progress, f"along {parameter}") as report:
        settings = replace(settings, report=report)
        point = start_point(curve, min(high, max(low, value)), orbit, settings.newton)
        ahead = float(np.sign(last - first))
        trace = _both_ways(point, ahead, (low, high), settings)
    return _branch(system, parameter, trace, settings, _options(settings, wanted, {parameter: (first, last)}))


def _own_linear_part(orbit: PeriodicOrbit) -> LinearPart | None:
    """The linear part an orbit was solved with, at its parameters; None for its system's own matrices."""
    linear = orbit.balance.linear
    return None if isinstance(linear, StructuralMatrices) else linear.rebuilt(orbit.values)


def _both_ways(point: CurvePoint, ahead: float, bounds: tuple[float, float], settings: Settings) -> Trace:
    """Follow a curve from an inner point to both sides; from a bound inwards only."""
    low, high = bounds
    slack = 1e-9 * (high - low)
    if abs(point.parameter - (low if ahead > 0 else high)) <= slack:
        return follow(point, ahead, bounds, settings)
    if abs(point.parameter - (high if ahead > 0 else low)) <= slack:
        back = follow(point, -ahead, bounds, settings)
        only = Trace(back.points[:1], ended=back.ended)
        return back.reversed_before(only)
    forward = follow(point, ahead, bounds, settings)
    if forward.closed:
        return forward
    back = follow(point, -ahead, bounds, settings)
    # between two folds the curve runs the other way: what matters is where it ends
    assert isinstance(point.curve, ResponseCurve)
    name, target = point.curve.name, high if ahead > 0 else low
    ends = [t.points[-1].orbit for t in (forward, back)]
    misses = [abs((o.omega if name == "omega" else o.values[name]) - target) for o in ends]
    return back.reversed_before(forward) if misses[0] <= misses[1] else forward.reversed_before(back)


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
        )
    _check_system(system)
    _check_parameter(system, parameter)
    first, last = _check_bounds(system, parameter, bounds)
    if omega is None or not (_is_number(omega) and omega > 0.0):
        raise InputError(f"continue_branch from a system along {parameter!r} needs a positive omega=, got {omega!r}")
    settings = _settings(system, max_step, observe, events, newton, stepping)
    curve = _curve(system, parameter, float(omega), abs(last - first), wanted, 1, None)
    # a size of the motion to scale with, should the branch begin at rest
    from suboctave.analysis.starts import linear_response

    curve.reference = max(curve.size(linear_response(curve, v)) for v in (first, last))
    with one_thread(), reporting(progress, f"along {parameter}") as report:
        settings = replace(settings, report=report)
        point = start_point(curve, first, None, settings.newton)
        trace = follow(point, np.sign(last - first), (min(first, last), max(first, last)), settings)
    return _branch(system, parameter, trace, settings, _options(settings, wanted, {parameter: (first, last)}))


def _curve(
    system: System, name: str, omega: float, span: float, harmonics: Harmonics, nu: int, linear: LinearPart | None
) -> ResponseCurve:
    adaptive: AdaptiveHarmonics | None
    if isinstance(harmonics, AdaptiveHarmonics):
        adaptive = harmonics
    elif harmonics == "adaptive":
        adaptive = AdaptiveHarmonics()
    elif isinstance(harmonics, bool) or not isinstance(harmonics, (int, np.integer)) or harmonics < 1:
        raise InputError(
            f'harmonics must be a whole number of at least 1, "adaptive" or AdaptiveHarmonics(...), not {harmonics!r}'
        )
    else:
        adaptive = None
    if linear is not None and not isinstance(linear, LinearPart):
        raise InputError(f"linear must fulfil suboctave.harmonic.LinearPart, {type(linear).__name__} does not")
    loaded = max([1] + [c.harmonic for c in system.load_components()])
    high = int(harmonics) if adaptive is None else max(adaptive.minimum, loaded)  # type: ignore[arg-type]
    balance = HarmonicBalance(system, HarmonicBasis(high * nu, nu), linear=linear)
    if balance.dimension > _MOST_UNKNOWNS:
        raise InputError(
            f"{balance.size} DOFs with {high} harmonics are {balance.dimension} unknowns with dense matrices, more "
            f"than {_MOST_UNKNOWNS}: keep fewer harmonics, or reduce the model onto the DOFs that elements and loads "
            "touch (linear=)"
        )
    return ResponseCurve(balance, name, omega, span, adaptive)


def _settings(
    system: System,
    max_step: float | None,
    observe: int | None,
    events: Sequence[Event],
    newton: NewtonOptions | None,
    stepping: SteppingOptions | None,
) -> Settings:
    if isinstance(events, Event) or not isinstance(events, Iterable):
        events = (events,)
    events = tuple(events)
    for event in events:
        if not isinstance(event, Event):
            raise InputError(f"events must be Event objects, got {event!r}")
    if len({e.name for e in events}) < len(events):
        raise InputError("two events have the same name")
    for event in events:
        if event.name in KINDS:
            raise InputError(f"an event cannot be called {event.name!r}: that is the name of a kind of bifurcation")
    for name, given, kind in (("newton", newton, NewtonOptions), ("stepping", stepping, SteppingOptions)):
        if given is not None and not isinstance(given, kind):
            raise InputError(f"{name} must be a {kind.__name__}, not {type(given).__name__}")
    stepping = stepping or SteppingOptions()
    if max_step is not None:
        if not (_is_number(max_step) and max_step > 0.0):
            raise InputError(f"max_step must be a positive number, not {max_step!r}")
        stepping = replace(stepping, max_step=float(max_step), initial_step=min(stepping.initial_step, float(max_step)))
    dof = system.observed_dof if observe is None else observe
    if isinstance(dof, bool) or not isinstance(dof, (int, np.integer)) or not 0 <= dof < system.n:
        raise InputError(f"observe={dof!r} is out of range: the system has {system.n} DOFs, numbered from 0")
    return Settings(newton or NewtonOptions(), stepping, events, int(dof))


def _check_system(system: System) -> None:
    if not isinstance(system, System):
        raise InputError(f"the first argument must be a System, not {type(system).__name__}")
    if not any(c.harmonic > 0 for c in system.load_components()):
        raise InputError("the system has no periodic load: add loads=[HarmonicLoad(dof=..., amplitude=...)]")
    if system.n <= _MOST_EXAMINED:
        _check_held(system)


def _check_held(system: System) -> None:
    """Refuse a body that nothing holds: the mean of its motion is not determined."""
    mass, _, stiffness = system.matrices()
    scale = 1.0 / np.sqrt(np.diag(mass))
    _, sizes, vectors = np.linalg.svd(stiffness * np.multiply.outer(scale, scale))
    free = vectors[sizes <= 1e-13 * max(sizes[0], np.finfo(float).tiny)]
    if not len(free):
        return
    held = np.array([e.direction(system.n) * scale for e in system.elements]).reshape(-1, system.n)
    if np.linalg.matrix_rank(held @ free.T, tol=1e-10 * max(1e-300, float(np.abs(held).max(initial=0.0)))) < len(free):
        shape = ", ".join(f"{v:.3g}" for v in free[0] * scale / np.abs(free[0] * scale).max())
        raise InputError(
            f"the structure can move freely along ({shape}): its stiffness is singular and no element holds it, so "
            "that the mean position is not determined. Hold it by a spring, or write it in relative displacements"
        )


def _check_parameter(system: System, name: str) -> None:
    if name != "omega" and name not in system.parameters:
        raise InputError(f"unknown parameter {name!r}{suggest(str(name), ['omega', *system.parameters])}")


def _check_bounds(system: System, name: str, bounds: Any) -> tuple[float, float]:
    """Two ends at each of which the system exists (a mass that vanishes or turns negative does not)."""
    first, last = check_range(name, bounds, positive=name == "omega")
    if name != "omega":
        for end in (first, last):
            try:
                system.with_parameters({name: end})
            except InputError as failure:
                raise InputError(f"{name}=({first:g}, {last:g}): at {name}={end:g} {failure}") from None
    return first, last


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value)


def check_range(name: str, bounds: Any, positive: bool = False) -> tuple[float, float]:
    """(from, to) as two different finite numbers.

    Raises
    ------
    InputError
        If they are not, or not positive where they must be.
    """
    try:
        first, last = (float(b) for b in bounds)
    except (TypeError, ValueError):
        raise InputError(f"{name}={bounds!r}: give two numbers, (from, to)") from None
    if not (math.isfinite(first) and math.isfinite(last)) or first == last:
        raise InputError(f"{name}=({first:g}, {last:g}): the range must have two different finite ends")
    if positive and min(first, last) <= 0.0:
        raise InputError(f"{name}=({first:g}, {last:g}): frequencies are positive, in rad per unit time")
    return first, last


def _options(settings: Settings, harmonics: Harmonics, bounds: dict[str, tuple[float, float]]) -> dict[str, Any]:
    return {
        "bounds": bounds,
        "harmonics": asdict(harmonics) if isinstance(harmonics, AdaptiveHarmonics) else harmonics,
        "newton": asdict(settings.newton),
        "stepping": asdict(settings.stepping),
        "observe": settings.observe,
    }


def _branch(system: System, name: str, trace: Trace, settings: Settings, options: dict[str, Any]) -> Branch:
    context = {"system": system, "parameter": name, **options}
    bifurcations = [replace(b, context=context) for b in trace.bifurcations]
    return Branch(
        system,
        name,
        trace.points,
        bifurcations,
        trace.events,
        trace.closed,
        trace.ended,
        settings.observe,
        options,
        tuple(trace.warnings),
    )


__all__ = ["check_range", "continue_branch", "frequency_response"]
