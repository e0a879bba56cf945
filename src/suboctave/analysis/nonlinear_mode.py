"""Nonlinear modes: from a linear mode at rest towards larger amplitudes (`curves.kinds.nonlinear_mode`)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.options import SearchOptions, options_of, settings_of
from suboctave.arguments import Range
from suboctave.bifurcation.gaps import rests_in_corner
from suboctave.continuation import CurvePoint, March
from suboctave.continuation.linear import length, one_thread
from suboctave.curves.kinds.nonlinear_mode import NonlinearMode
from suboctave.curves.measures import MEASURES, bounded
from suboctave.curves.motion import MotionProblem
from suboctave.curves.starts import Harmonics, linear_up_to, make_curve, settled
from suboctave.curves.trace import Settings
from suboctave.curves.tracked.follow import follow_tracked
from suboctave.errors import ConvergenceError, InputError, is_number, shortened
from suboctave.harmonic.assembly import apply_blocks
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.energy import at_rest, damping_ratio
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.linear_modes import linear_modes
from suboctave.model.frequencies import natural_frequencies
from suboctave.model.inputs import check_count, check_is_system, check_range, timed
from suboctave.model.system import System
from suboctave.model.updated import largest_entry
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.results.modes import ModeCurve

#: share by which forces deviate from linear ones where a mode begins
_LINEAR = 1e-4
#: share of a mode, in mass weights, with which a degree of freedom rests in it
_RESTS = 1e-8
#: share of the largest amplitude at which a mode begins that is linear
_FIRST = 1e-3
#: the smallest and the largest motion that is thought of, in units of that of unit modal mass
_SIZES = (1e-12, 1e12)
#: share of a bound by which a start may miss it
_ON_IT = 1e-9
#: how often an interval of sizes, in powers, is halved
_HALVED = 30
#: how often a structure is projected for higher frequencies until it has the mode, and by how much higher
_TRIES, _HIGHER = 30, 4.0
#: frequency that it is projected for first, in units of that of the structure without its elements
_ABOVE = 1.5
#: damping ratio of a conservative mode beyond which its laws are not conservative
_CONSERVATIVE = 1e-6
#: share of a matrix that is rounding
_ROUNDING = 1e-12


@with_options(SearchOptions)
@timed
def nonlinear_mode(
    system: System,
    omega: Range | None = None,
    *,
    mode: int = 1,
    amplitude: float | Range | None = None,
    energy: float | Range | None = None,
    damped: bool | None = None,
    harmonics: Harmonics = "adaptive",
    **options: Unpack[SearchOptions],
) -> ModeCurve:
    """A nonlinear mode: motions that no load keeps going, from a linear mode towards larger amplitudes.

    Of the conservative system over its energy, with the branch points from which internal resonances leave; of the
    damped one with its damping ratio (extended periodic motion concept: Krack, Computers & Structures 154, 2015).
    Oscillating loads are left out, constant ones stay.

    Parameters
    ----------
    mode
        The linear mode that it begins with, 1 the lowest of those that oscillate about the position of rest.
    omega, amplitude, energy
        Where it ends: the frequency's range, rad per unit time; the largest |x| of the observed DOF or the mean energy,
        up to a value or from one to another. By default it begins where forces are linear but
        for 1e-4, a linear mode at a thousandth of its last amplitude.
    damped
        Whether velocity-dependent forces count; False leaves damping matrices out. Default: whether there are any.
    harmonics
        As in `frequency_response`.

    Raises
    ------
    InputError
        Wrong input, before any work: also laws that depend on velocity in the conservative form, or on time.
    ConvergenceError
        If the mode does not reach where it is to begin.
    """
    check_is_system(system)
    number = check_count("mode", mode)
    ranges = ranges_of(amplitude, energy, omega)
    free, with_damping = free_system(system, damped)
    observe = options.get("observe")
    settings = settings_of(free, {**options, "observe": system.observed_dof if observe is None else observe})
    with one_thread(), reporting(options.get("progress"), f"nonlinear mode {number}") as report:
        linear = _linear_mode(free, number, ranges.get("omega"), harmonics, settings)
        span = ranges.get("omega", (0.5 * linear.omega, 2.0 * linear.omega))
        settings = settings.reporting_to(report, span, "event")
        start = _started(linear, not with_damping, ranges, settings)
        trace = follow_tracked(start, ranges, settings)
    kept = {**options_of(settings, harmonics, ranges), "damped": int(with_damping), "mode": number}
    context = {"system": free, "parameter": "omega", **kept}
    met = [replace(event, context=context) for event in trace.bifurcations]
    curve = ModeCurve(
        NonlinearMode.name, ("omega",), free, "omega", trace.points, met, [], trace.closed, trace.endings,
        settings.observe, kept, tuple(trace.open_questions),
    )  # fmt: skip
    if (note := _work_of_laws(curve)) is not None:
        curve.warnings += (note,)
    return curve


def ranges_of(amplitude: Any, energy: Any, omega: Any) -> dict[str, Range]:
    """The ranges that are given, by what they bound; InputError."""
    ranges: dict[str, Range] = {}
    for name, given in (("amplitude", amplitude), ("energy", energy)):
        if given is None:
            continue
        first, last = (0.0, given) if is_number(given) else check_range(name, given)
        if not 0.0 <= first < last < math.inf:
            raise InputError(f"{name} runs from a smaller to a larger value, not {shortened(given)}")
        ranges[name] = float(first), float(last)
    if omega is not None:
        first, last = check_range("omega", omega, positive=True)
        ranges["omega"] = min(first, last), max(first, last)
    if amplitude is not None and energy is not None:
        raise InputError("the mode ends at an amplitude or at an energy: give one of them")
    if not ranges:
        raise InputError("where does the mode end? Give amplitude=, energy= or omega=")
    return ranges


def free_system(system: System, damped: Any) -> tuple[System, bool]:
    """The system whose mode is meant, and whether it is a damped one; InputError where there is none."""
    if damped not in (None, True, False):
        raise InputError(f"damped must be True, False or None, not {shortened(damped)}")
    if system.excited_by_elements:
        raise InputError("an element depends on time: such a system has no modes")
    free = system.without_excitation()
    moving = [element.label for element in free.elements if element.depends_on_velocity]
    gyroscopic, damping = _damping(free)
    skew, _ = _sides(free.stiffness.sparse_value(free.parameters))
    with_damping = damped if damped is not None else bool(moving or damping or skew)
    if with_damping:
        return free, True
    refusals = [f"{', '.join(moving)} depend on velocity"] if moving else []
    refusals += ["damping and gyroscopic coupling are in one matrix"] if damping and gyroscopic else []
    refusals += ["the stiffness matrix is not symmetric"] if skew else []
    if refusals:
        raise InputError(
            f"the conservative form of a mode is that of forces that have a potential, but {'; '.join(refusals)}: "
            "leave damped= out for the damped one, or take these out of the system"
        )
    return (free.undamped() if damping else free), False


def _damping(system: System) -> tuple[bool, bool]:
    """Whether the damping matrix has a gyroscopic part, and whether there is damping in matrices."""
    skew, own = _sides(system.damping.sparse_value(system.parameters))
    return skew, own or not system.structural.zero


def _sides(matrix: Any) -> tuple[bool, bool]:
    """Whether a sparse matrix has a skew-symmetric part, and a symmetric one."""
    least = _ROUNDING * largest_entry(matrix)
    skew, symmetric = (largest_entry(matrix + side * matrix.T) > least for side in (-1.0, 1.0))
    return skew, symmetric


@dataclass(frozen=True, eq=False)
class _LinearMode:
    """A linear mode on the curve of a nonlinear one: its frequency, shape in the unknowns, and the position of rest."""

    curve: MotionProblem
    omega: float
    shape: ComplexArray
    rest: Array

    def motion(self, size: float) -> Array:
        """Coefficients at a size of the motion, that of unit modal mass being 1."""
        x = np.zeros((self.curve.balance.basis.size, len(self.rest)))
        x[0], x[1], x[2] = self.rest, size * self.shape.real, -size * self.shape.imag
        return x

    def state(self, size: float) -> BalanceState:
        """The same with all that follows of it."""
        return self.curve.balance.at(self.motion(size), self.omega)

    def point(self, size: float, conservative: bool, settings: Settings) -> CurvePoint:
        """The point of the nonlinear mode of about that size, headed to larger ones."""
        state = self.state(size)
        curve = replace(self.curve, augmentation=NonlinearMode.at_phase(state, conservative))
        curve.force = max(state.balanced.scale, curve.least_force(state))
        u = curve.join(state.x, self.omega, np.array([damping_ratio(state)]))

        def held(curve: MotionProblem, u: Array, weights: Array) -> Array:
            row = np.zeros(len(u))
            moving = slice(curve.balance.size, curve.balance.dimension)
            row[moving] = (weights * u)[moving]
            return row / length(row)

        return settled(curve, u, settings.newton, held=held)

    def linear_up_to(self) -> float:
        """The largest size at which forces are linear but for a small share, infinite where they are at all sizes."""
        rest, one = self.state(0.0), self.state(1.0)
        change = one.x - rest.x
        # of the forces of inertia, omega^2 M x
        momentum = apply_blocks(one.linear.feeding(one.frequencies), change)
        below, beyond = linear_up_to(rest, change, _LINEAR * self.omega * length(momentum))
        return below if math.isfinite(beyond) else math.inf


def _linear_mode(
    system: System, number: int, omega: Range | None, harmonics: Harmonics, settings: Settings
) -> _LinearMode:
    """A linear mode of a system, its linear part made to serve at its frequency."""
    served = max(omega) if omega else _ABOVE * _about(system, number)
    found = np.zeros(0)
    for _ in range(_TRIES):
        curve = make_curve(system, "omega", served, 0.0, harmonics, 1, None, settings.observe)
        rest = at_rest(curve.balance, served, curve.balance.values)
        if rests_in_corner(rest) and not rest.x.any():
            raise InputError("a law has a corner at rest: there are no linear modes to begin with")
        found, shapes = linear_modes(rest)
        if number <= len(found) and found[number - 1] <= served:
            own = float(found[number - 1])
            span = own if omega is None else max(omega) - min(omega)
            return _LinearMode(replace(curve, spans=(span,)), own, shapes[number - 1], rest.x[0])
        served *= _HIGHER
    raise InputError(f"the system has {len(found)} modes that oscillate about its position of rest, no mode {number}")


def _about(system: System, number: int) -> float:
    """About the frequency of a mode: that of the structure without its elements, where it has one."""
    mass, stiffness = (part.sparse_value(system.parameters) for part in (system.mass, system.stiffness))
    found = natural_frequencies(mass, stiffness, number).omega
    own = found[found > 0.0]
    return float(own[-1]) if own.size else 1.0


def _started(linear: _LinearMode, conservative: bool, ranges: Mapping[str, Range], settings: Settings) -> CurvePoint:
    """The first point: at the lower bound, reached from where forces are linear."""
    if "omega" in ranges:
        low, high = ranges["omega"]
        if not low <= linear.omega <= high:
            raise InputError(f"the linear mode has omega = {linear.omega:.6g}, outside of ({low:g}, {high:g})")
    limit = linear.linear_up_to()
    if limit == 0.0:
        raise InputError("forces are nowhere linear about rest: there are no linear modes to begin with")
    measure = next((name for name in ranges if name in MEASURES), None)
    first = last = math.inf
    if measure is not None:
        first, last = (_size_at(linear, measure, value, settings.observe) for value in ranges[measure])
        if not last > 0.0:
            raise InputError(f"the {measure} at rest is larger already")
        moving = ranges[measure][1] * float(linear.curve.balance.scales[0].min())
        if measure == "amplitude" and not moving > _RESTS * last:
            raise InputError(
                "the observed degree of freedom rests in this mode: choose one that moves, observe=, or give energy="
            )
    size = first if 0.0 < first < math.inf else min(limit, _FIRST * last)
    if not math.isfinite(size):
        raise InputError("this mode is linear: give amplitude= or energy=, where it ends")
    point = linear.point(min(size, limit), conservative, settings)
    if measure is None or not 0.0 < first < math.inf:
        return point
    return _moved(point, measure, ranges, settings)


def _size_at(linear: _LinearMode, name: str, value: float, observe: int) -> float:
    """About the size of a linear motion at which a measure has a value, 0 where it is larger at once."""
    low, high = (math.log(size) for size in _SIZES)
    if not value > 0.0:
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_HALVED):
            middle = 0.5 * (low + high)
            beyond = not MEASURES[name](linear.state(math.exp(middle)), observe) <= value
            low, high = (low, middle) if beyond else (middle, high)
    return math.exp(low) if low > math.log(_SIZES[0]) else 0.0


def _moved(point: CurvePoint, measure: str, ranges: Mapping[str, Range], settings: Settings) -> CurvePoint:
    """The point of a mode at the lower bound of what is measured, from one beside or below it."""
    first = ranges[measure][0]
    value = bounded(point.curve, measure, ranges[measure], settings.observe).value(point)
    if abs(value - first) <= _ON_IT * first:
        return point
    if value > first:
        point = point.turned
    ends = (-math.inf, first) if value < first else (first, math.inf)
    others = [bounded(point.curve, measure, ends, settings.observe)]
    omega = ranges.get("omega", (0.0, math.inf))
    march = March(point, 0.0, omega, settings.newton, settings.stepping, others=others)
    # the last of its points alone is kept
    (found,) = deque(march, maxlen=1)
    if abs(others[0].value(found) - first) > _ON_IT * first:
        raise ConvergenceError(f"the mode does not reach {measure} = {first:g}, where it is to begin: {march.ended}")
    return replace(found if value < first else found.turned, arclength=0.0)


def _work_of_laws(curve: ModeCurve) -> str | None:
    """What to say where forces of a conservative mode do work over a period."""
    largest = np.abs(curve.damping_ratio).max(initial=0.0)
    if curve.damped or largest <= _CONSERVATIVE:
        return None
    return (
        f"forces do work over a period, they have no potential. The motions are those of a damping ratio of up to "
        f"{largest:.1e} in addition. Use damped=True"
    )
